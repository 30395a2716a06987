"""Results on frozen suites that others can check: submissions, the reference results that consist of them, places."""
