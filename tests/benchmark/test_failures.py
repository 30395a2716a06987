"""A drive without success has one cause, by the truth from the moment at which its target was last tracked."""

from typing import Any

import duckdb
import numpy as np
import pytest

from pftrack_sim.benchmark.reading.failures import CAUSES, FAILURES, Failure

FRAMES = 200
TARGET = [100.0, 50.0, 30.0, 100.0]
ASIDE = [200.0, 50.0, 30.0, 100.0]


def cause(summary: dict[str, Any] | None = None, frames: int = FRAMES, **given: Any) -> tuple[str, float | None, Any]:
    """Cause, time and what of a failed drive at 10 Hz; the estimate is right and the target in view but for `given`.

    A value holds from frame 100 on; a dictionary has values by the frame from which they hold.
    """
    calm: dict[str, Any] = {
        "status": "ok",
        "scored": True,
        "overlap": 0.8,
        "confidence": 1.0,
        "estimate_occluded": False,
        "estimate": TARGET,
        "state": "visible",
        "visible_fraction": 1.0,
        "truncation": 0.0,
        "occluders": [],
    }
    rows = [dict(calm) for _ in range(frames)]
    for name, value in given.items():
        values: dict[int, Any] = value if isinstance(value, dict) else {min(100, frames - 1): value}
        for first, held in values.items():
            for row in rows[first:]:
                row[name] = held
    columns = {name: np.array([row[name] for row in rows]) for name in calm if not isinstance(calm[name], list)}
    for name in ("estimate", "occluders"):
        columns[name] = np.empty(frames, dtype=object)
        columns[name][:] = [row[name] for row in rows]
    columns |= {
        "frame": np.arange(frames),
        "time_s": np.arange(frames) / 10.0,
        "after_s": np.arange(1, frames + 1) / 10,
    }
    ended = {"follow_success": 0.0, "follow_collision": 0.0, "collided_with": None, "error": None, **(summary or {})}
    drive = "'s' AS scenario, 'base' AS condition, 3 AS seed, 't' AS label"
    with duckdb.connect() as database:
        database.register("given", columns)
        database.execute(f"CREATE VIEW frames AS SELECT {drive}, *, {TARGET} AS amodal_box FROM given")
        people = f"(VALUES ('target', {TARGET}), ('distractor-1', {ASIDE})) AS one (person, amodal_box)"
        database.execute(f"CREATE VIEW people AS SELECT {drive}, frame, person, amodal_box FROM given, {people}")
        literal = ", ".join(f"{'NULL' if value is None else repr(value)} AS {key}" for key, value in ended.items())
        database.execute(f"CREATE VIEW summary AS SELECT {drive}, 0 AS number, 0 AS place, {literal}")
        database.execute(FAILURES)
        found = database.execute("SELECT cause, time_s, by_what FROM failures").fetchall()
    assert len(found) == int(not ended["follow_success"])
    return found[0] if found else ("", None, None)


HIDDEN = {"scored": False, "overlap": np.nan, "visible_fraction": 0.0, "state": "occluded", "occluders": ["rack-2"]}
LEAVES = {"scored": False, "overlap": np.nan, "visible_fraction": 0.0, "state": "out_of_view", "truncation": 1.0}
COVERED = {
    "scored": {100: False, 120: True},
    "visible_fraction": {100: 0.0, 120: 1.0},
    "state": {100: "occluded", 120: "visible"},
    "occluders": {100: ["rack-2"], 120: []},
}


@pytest.mark.parametrize(
    ("expected", "given"),
    [
        (("drift", 9.9, None), {"overlap": 0.0, "estimate": [0.0, 0.0, 30.0, 100.0]}),
        (("look-alike", 9.9, "distractor-1"), {"overlap": 0.0, "estimate": ASIDE}),
        (("drift", 9.9, None), {"overlap": 0.0, "estimate": ASIDE, "estimate_occluded": True}),
        (("hidden", 9.9, "rack-2"), HIDDEN),
        (("search", 9.9, "rack-2"), {**HIDDEN, "estimate_occluded": True}),
        (("search", 9.9, "rack-2"), {**HIDDEN, "confidence": 0.1}),
        (("hidden", 9.9, "rack-2"), {**COVERED, "overlap": 0.0, "estimate_occluded": True}),
        (("too slow", 9.9, None), LEAVES),
        (("too slow", 19.9, None), {}),
        (("size", 19.9, None), {"overlap": 0.4, "estimate": [100.0, 50.0, 30.0, 140.0]}),
        (("collision", 19.9, "cart-1"), {"summary": {"follow_collision": 1.0, "collided_with": "cart-1"}}),
        (("collision", 19.9, "target"), {"summary": {"follow_collision": 1.0}}),
        (("drift", 9.9, None), {"summary": {"follow_collision": 1.0}, "overlap": 0.0}),
        (("error", 9.9, "bang"), {"summary": {"error": "bang"}, "status": "error", "overlap": 0.0}),
        (("never tracked", None, None), {"frames": 1, "overlap": 0.0}),
        (("", None, None), {"summary": {"follow_success": 1.0}}),
    ],
)  # fmt: skip
def test_a_failed_drive_has_the_cause_that_the_truth_shows(
    expected: tuple[str, float | None, Any], given: dict[str, Any]
):
    assert cause(**given) == pytest.approx(expected)
    assert expected[0] in ("", *CAUSES)


def test_an_overlap_by_chance_is_no_tracking():
    """The target passes through an estimate that stands still."""
    assert cause(overlap={100: 0.0, 150: 0.4, 153: 0.0})[1] == 9.9
    assert cause(overlap={100: 0.0, 150: 0.4, 160: 0.0})[1] == 15.9, "a second is more than chance"


def test_a_statement_says_who_and_when():
    drive = ("follow/street", "base", 7, "ncc+servo")
    assert Failure(*drive, 50.13, "look-alike", "distractor-3").statement == "look-alike (distractor-3) at 50.1 s"
    assert Failure(*drive, 9.9, "error", "ValueError: bang").statement == "error at 9.9 s"
    assert Failure(*drive, None, "never tracked", None).statement == "never tracked"
