"""What was asked for: scenarios x conditions x seeds x trackers, as data."""
