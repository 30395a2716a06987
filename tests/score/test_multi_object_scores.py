"""HOTA, IDF1 and MOTA: cases worked out by hand, and laws. `tests/benchmark/test_toolkits.py` has TrackEval."""

import math

import numpy as np
import pytest

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.score.multi_object import Tracks, multi_object


def tracks(rows: list[tuple[int, int, float]]) -> Tracks:
    """Boxes 10 px wide and high at (frame, identity, x)."""
    frames, identities, x = (np.array(column) for column in zip(*rows, strict=True)) if rows else (np.zeros(0),) * 3
    boxes = np.column_stack([x, np.zeros(len(x)), np.full((len(x), 2), 10.0)])
    return Tracks(frames.astype(np.int64), identities.astype(np.int64), boxes)


TWO = [(frame, identity, 50.0 * identity) for frame in range(4) for identity in (1, 2)]


def test_true_tracks_are_perfect_whatever_their_numbers():
    renamed = [(frame, 9 - identity, x) for frame, identity, x in TWO]
    found = multi_object([(tracks(TWO), tracks(renamed))])
    assert {name: found[name] for name in ("hota", "idf1", "mota", "switches")} == pytest.approx(
        {"hota": 1.0, "idf1": 1.0, "mota": 1.0, "switches": 0.0}
    )


def test_one_of_two_persons_tracked():
    found = multi_object([(tracks(TWO), tracks([row for row in TWO if row[1] == 1]))])
    # Half of the boxes are found, with perfect association.
    assert found == pytest.approx(
        {
            "hota": math.sqrt(0.5), "deta": 0.5, "assa": 1.0, "idf1": 2 * 4 / 12, "mota": 0.5,
            "switches": 0, "missed": 4, "false_alarms": 0,
        }
    )  # fmt: skip


def test_an_exchange_of_identities_in_the_middle():
    exchanged = [(frame, identity if frame < 2 else 3 - identity, x) for frame, identity, x in TWO]
    found = multi_object([(tracks(TWO), tracks(exchanged))])
    assert found["switches"] == 2
    assert found["mota"] == pytest.approx(1 - 2 / 8)
    assert found["idf1"] == pytest.approx(0.5)
    assert found["deta"] == 1.0
    assert found["assa"] == pytest.approx(2 / 6)  # 2 boxes together of 4 + 4 - 2


def test_overlap_decides_at_each_threshold():
    # Boxes shifted by a quarter overlap by 0.6: matched at 12 of 19 thresholds.
    found = multi_object([(tracks(TWO), tracks([(frame, identity, x + 2.5) for frame, identity, x in TWO]))])
    assert found["deta"] == pytest.approx(12 / 19)
    assert found["mota"] == 1.0


def test_counts_of_sequences_are_added():
    whole, none = (tracks(TWO), tracks(TWO)), (tracks(TWO), tracks([]))
    found = multi_object([whole, none])
    assert found["mota"] == pytest.approx(0.5)
    assert found["idf1"] == pytest.approx(2 * 8 / 24)
    assert found["missed"] == 8
    assert multi_object([(tracks([]), tracks([]))])["mota"] == 0.0


def test_two_boxes_of_one_person_are_refused():
    with pytest.raises(ParameterError, match="identity 3 has 2 boxes in frame 1"):
        tracks([(1, 3, 0.0), (1, 3, 5.0)])
