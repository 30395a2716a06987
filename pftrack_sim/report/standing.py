"""Tables of where the trackers of a run stand among the reference results of a suite."""

from __future__ import annotations

from collections.abc import Iterator

from pftrack_sim import score
from pftrack_sim.benchmark.reference.standing import EXPLAINING, Standing
from pftrack_sim.report.tables import Table, number_text, p_text, range_text

_NOTES = {
    "skill": "mean overlap over all scored frames, corrected for chance: (overlap - stay) / (1 - stay)",
    "occluded": "mean overlap while less than half of the target is visible",
    "shaken": "the same while its centre moves fast in the image",
    "light": "while its luminance changes",
    "look-alike": "while a look-alike is near",
    "scale": "while its size changes",
    "ms": "median time per frame, on the machine that ran it",
    "success": "share of drives in closed loop that reach the end without a collision and follow in the last frame",
}


def standing_tables(found: Standing) -> Iterator[Table]:
    """The board of a suite, and the paired differences of the trackers of the run."""
    mark = " (here)" if found.references and found.episodes else ""
    rows = [
        [
            one.label + (mark if one.here else ""),
            *(str(one.skill.seeds or "-"), range_text(one.skill)),
            *(number_text(value) for value in one.explained.values()),
            *(number_text(one.ms, 1), str(one.success.seeds or "-"), range_text(one.success, 2)),
        ]
        for one in found.places
    ]
    heads = ["seeds", "skill", *EXPLAINING.values(), "ms", "drives", "success"]
    yield Table(f"{found.suite}{' beside its reference results' if mark else ''}", ["tracker"], heads, rows, _NOTES)
    if found.pairs:
        rows = [
            [
                *(one.label, one.reference, str(one.difference.seeds), range_text(one.difference, sign="+")),
                *(p_text(one.difference.p), one.difference.verdict),
            ]
            for one in found.pairs
        ]
        heads = ["seeds", "difference", "p", "verdict"]
        yield Table("Mean overlap minus that of each reference, on the same frames", ["", "reference"], heads, rows,
                    grouped=True)  # fmt: skip


def standing_remarks(found: Standing, run: str) -> Iterator[str]:
    """What the numbers of a run on a suite lack, and where its frames are not those of the references."""
    if found.missing:
        yield f"{found.suite}: {found.missing} of {found.missing + found.episodes} results are missing here"
    if not found.references:
        yield f"{found.suite}: no reference results to compare with"
    if found.pairs:
        yield f"With each difference: {score.INTERVALS}. {score.VERDICTS}."
    redrawn = [one for one in found.pairs if one.other_frames]
    if redrawn:
        worst = max(redrawn, key=lambda one: one.other_frames)
        yield (
            f"{worst.other_frames} of {worst.episodes} episodes of {worst.reference} have other images, as another "
            f"renderer draws them: the target's luminance differs by {worst.luminance:.2%} in the mean. Run a "
            f"reference beside yours, on your frames, by the same command with --trackers {worst.reference} --out {run}"
        )
    for one in found.pairs:
        if one.other_scenes:
            yield f"{one.reference}: {one.other_scenes} episodes are left out, whose truth is another here"
