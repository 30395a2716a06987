"""Table of the stress axes for documents: what severity 1 is."""

from __future__ import annotations

from collections.abc import Iterator

from pftrack_sim.scenario.axes import axes_by_name


def axes_rows() -> Iterator[list[str]]:
    """Rows of axis, headline at severity 1 with its unit, law, and source."""
    for name, axis in axes_by_name().items():
        yield [f"`{name}`", f"{axis(severity=1.0).physical:.3g} {axis.unit}", axis.law, axis.source]
