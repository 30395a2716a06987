"""Recorded sequences on disk. Box conventions other than the package's own exist only here."""

from pftrack_sim.formats.otb import read_sequence
from pftrack_sim.formats.sequence import RecordedSequence

__all__ = ["RecordedSequence", "read_sequence"]
