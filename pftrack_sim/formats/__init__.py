"""Recorded sequences on disk, read into our conventions. Other conventions of boxes live here and nowhere else."""

from __future__ import annotations

from pftrack_sim.formats.layouts import LAYOUTS, read_sequence
from pftrack_sim.formats.sequence import RecordedSequence

__all__ = ["LAYOUTS", "RecordedSequence", "read_sequence"]
