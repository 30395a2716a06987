"""Sequences on disk in the layouts of public data sets. Box conventions other than the package's exist only here."""

from pftrack_sim.formats.layouts import LAYOUTS, Layout, find_sequences, read_sequence, read_sequences
from pftrack_sim.formats.sequence import Annotations, PersonBox, RecordedSequence

__all__ = [
    "LAYOUTS",
    "Annotations",
    "Layout",
    "PersonBox",
    "RecordedSequence",
    "find_sequences",
    "read_sequence",
    "read_sequences",
]
