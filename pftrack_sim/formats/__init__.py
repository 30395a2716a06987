"""Sequences on disk in the layouts of public data sets. Box conventions other than the package's exist only here."""

from pftrack_sim.formats.layouts import (
    LAYOUTS,
    find_sequences,
    given_boxes,
    read_sequence,
    read_sequences,
    read_video,
)
from pftrack_sim.formats.sequence import Annotations, Layout, PersonBox, RecordedSequence

__all__ = [
    "LAYOUTS",
    "Annotations",
    "Layout",
    "PersonBox",
    "RecordedSequence",
    "find_sequences",
    "given_boxes",
    "read_sequence",
    "read_sequences",
    "read_video",
]
