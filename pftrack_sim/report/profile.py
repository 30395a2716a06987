"""Figure of profiles: each number of each video on a strip with the quantiles of recorded video."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pftrack_sim.benchmark.kept.files import atomic_write
from pftrack_sim.core.palette import TRACKERS, hexadecimal
from pftrack_sim.report.figure import own_style
from pftrack_sim.score.profile import NUMBERS, Profile, recorded_quantiles

_SHARES = ("stay_overlap", "ncc_to_first", "ncc_to_previous", "colour_change", "distinct_from_surround")
"""Numbers on a linear scale from 0 to 1; the others are drawn on a logarithmic one."""

_MARKERS = "osD^v"


@own_style()
def write_profile_figure(profiles: Mapping[str, Profile], target: Path) -> Path:
    """Draw profiles beside those of recorded video: bands from 10 to 90 % and from 25 to 75 %, a line at the median.

    Args:
        profiles: Profiles by name of the scenario or sequence.
        target: File ending in `.png`, `.svg` or `.pdf`.

    Raises:
        ParameterError: matplotlib is not installed.
        RunError: The file cannot be written.
    """
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullLocator

    figure: Any = Figure(figsize=(8.0, 0.55 * len(NUMBERS) + 0.3 + 0.2 * -(-len(profiles) // 4)), layout="constrained")
    strips: Any = figure.subplots(len(NUMBERS), 1)
    recorded = recorded_quantiles()
    for strip, name in zip(strips, NUMBERS, strict=True):
        low, quarter, median, three_quarters, high = recorded[name]
        strip.axvspan(low, high, color="#e8e8e8", lw=0)
        strip.axvspan(quarter, three_quarters, color="#c8c8c8", lw=0)
        strip.axvline(median, color="#808080", lw=1)
        if name in _SHARES:
            ends = (0.0, 1.0)
        else:
            values = [value for one in profiles.values() if (value := getattr(one, name)) > 0.0]
            ends = (0.8 * min(low, *values), 1.25 * max(high, *values))
            strip.set_xscale("log")
            strip.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            strip.xaxis.set_major_formatter("{x:g}")
            strip.xaxis.set_minor_locator(NullLocator())
        strip.set(xlim=ends, ylim=(0, 1), yticks=[])
        for index, (label, one) in enumerate(profiles.items()):
            colour, marker = TRACKERS[index % len(TRACKERS)], _MARKERS[index // len(TRACKERS) % len(_MARKERS)]
            # Spread over the height of the strip, so that equal numbers can be told apart; 0 lies at the left end.
            height, place = (index + 1) / (len(profiles) + 1), np.clip(getattr(one, name), *ends)
            strip.plot([place], [height], marker, ms=4, color=hexadecimal(colour), label=label, clip_on=False)
        strip.set_ylabel(name, rotation=0, ha="right", va="center", fontsize=8)
        strip.tick_params(labelsize=6, pad=1, which="both")
        strip.spines[["top", "left", "right"]].set_visible(False)
    figure.legend(
        *strips[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=7, frameon=False
    )
    with atomic_write(target) as part:
        figure.savefig(part, dpi=150, format=target.suffix[1:])
    return target
