"""Verify a submission: a random share of its episodes is played again, here, and compared frame by frame."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

from pftrack_sim.benchmark import keys
from pftrack_sim.benchmark.asked.from_names import code_of
from pftrack_sim.benchmark.reference.submission import Row, Submission, cell_of, rows_of, suite_plan
from pftrack_sim.benchmark.running.progress import RunProgress
from pftrack_sim.benchmark.running.run import run
from pftrack_sim.core.errors import RunError
from pftrack_sim.trackers import is_builtin

SHARE = 20
"""One of so many episodes is played again."""

CLOSE = 0.01
"""Difference of mean overlaps on the same frames that another processor may make."""

_SAME = ("moment", "frames", "outcome", "follow_success", "follow_collision")
"""What no processor makes another on the same frames: the truth, and in closed loop the drive that drew them."""

_TRUTH, _LAST_DIGITS = "stay", 1e-9
"""A number of the truth alone, which another processor rounds otherwise, and by how much at most."""

_CLOSE = ("mean_overlap", "success")

Outcome: TypeAlias = Literal["the same to the bit", "close", "different", "of other frames"]


@dataclass(frozen=True)
class Replayed:
    """An episode that was played again.

    Attributes:
        name: Scenario, condition and seed.
        outcome: `"close"`: on the same frames, with a difference up to `CLOSE`.
        submitted: Mean overlap in the submission.
        here: The same here.
        graphics: What drew the submission's frames, and those here.
    """

    name: str
    outcome: Outcome
    submitted: float
    here: float
    graphics: tuple[str, str]


@dataclass(frozen=True)
class Verification:
    """What came of playing episodes again: as many as the submission has, and those that were."""

    total: int
    replayed: tuple[Replayed, ...]
    code: tuple[str, ...]

    @property
    def good(self) -> bool:
        """Whether every episode is the same, or close on the same frames."""
        return all(one.outcome in ("the same to the bit", "close") for one in self.replayed)

    def lines(self) -> Iterator[str]:
        """The verification as text."""
        for line in self.code:
            yield f"other code or versions: {line}"
        for one in self.replayed:
            if one.outcome in ("different", "of other frames"):
                by, here = one.graphics
                drawn = f" (drawn by {by}{', as here' if by == here else f'; here {here}'})"
                drawn = drawn if one.outcome != "different" else ""
                yield f"{one.name}: {one.outcome}{drawn}: overlap {one.submitted:.3f} submitted, {one.here:.3f} here"
        counts = Counter(one.outcome for one in self.replayed)
        parts = ", ".join(f"{count} {outcome}" for outcome, count in counts.items())
        yield f"{len(self.replayed)} of {self.total} episodes were played again: {parts}"
        mend = (
            ": not the submitted scores" if counts["different"] else ": other frames prove nothing; draw them as it did"
        )
        yield "verified" if self.good else f"refused{mend}"


def verify(
    submission: Submission,
    seed: int,
    *,
    workers: int = 0,
    share: int = SHARE,
    isolation: str = "auto",
    on_progress: Callable[[RunProgress], None] = lambda _: None,
) -> Verification:
    """Play one of `share` episodes of a submission again, of each of its parts.

    Args:
        submission: The submission.
        seed: Of the random choice of episodes; not known to the submitter.
        workers: Local processes; 0 runs all in this one.
        share: How many there are for each that is played again.
        isolation: As in `run`.
        on_progress: Called after every episode and a few times a second.

    Raises:
        RunError: The tracker's code here is another, or an episode cannot be run.
    """
    about = submission.about
    for spec in about.trackers:
        other = list(keys.differences(code_of(spec), spec.code)) if not is_builtin(spec.name) else []
        if other:
            raise RunError(
                "\n  ".join([f"the code of {spec.label} is another here than in {submission.path}:", *other])
            )
    rows = {(*cell_of(row), row["label"]): row for row in submission.rows}
    replayed: list[Replayed] = []
    with tempfile.TemporaryDirectory(prefix="pftrack-sim-") as folder:
        for number, spec in enumerate(about.trackers):
            plan = suite_plan(about.suite, [spec.model_copy(update={"code": code_of(spec)})])
            store = run(plan, Path(folder) / str(number), workers=workers, videos="none", part=(1, share), shuffle=seed,
                        isolation=isolation, on_progress=on_progress)  # fmt: skip
            replayed += [_compared(rows[(*cell_of(row), row["label"])], row) for row in rows_of(store)]
    return Verification(len(rows), tuple(replayed), tuple(keys.differences(keys.environment(), about.environment)))


def _compared(submitted: Row, here: Row) -> Replayed:
    def apart(name: str) -> float:
        return abs((submitted.get(name) or 0.0) - (here.get(name) or 0.0))

    theirs, ours = (row["mean_overlap"] or 0.0 for row in (submitted, here))
    if submitted["frames_digest"] != here["frames_digest"]:
        outcome: Outcome = "of other frames"
    elif any(submitted.get(name) != here.get(name) for name in _SAME) or apart(_TRUTH) > _LAST_DIGITS:
        outcome = "different"
    elif all(submitted.get(name) == here.get(name) for name in ("overlap", _TRUTH, *_CLOSE)):
        outcome = "the same to the bit"
    else:
        outcome = "close" if max(map(apart, _CLOSE)) <= CLOSE else "different"
    name = " ".join(map(str, cell_of(here)[1:]))
    graphics = str(submitted.get("graphics")), str(here.get("graphics"))
    return Replayed(name, outcome, theirs, ours, graphics)
