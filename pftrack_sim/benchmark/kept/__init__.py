"""The run folder: its files, written atomically and verified."""
