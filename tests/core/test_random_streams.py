"""Random streams: one per concern, none shared by two names."""

import itertools

import numpy as np
import pytest

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.random_streams import pick, stream


def test_different_names_give_different_streams():
    names = [("a", "b"), ("a/b",), ("a", "b", ""), ("a/b/",), ("a\\", "b"), ("a\\/b",), ("a", "/b"), ("a//b",), ("ab",)]
    draws = [stream(0, *one).random() for one in names]
    for (first, one), (second, other) in itertools.combinations(zip(names, draws, strict=True), 2):
        assert one != other, (first, second)


def test_plain_names_keep_their_published_draws():
    assert stream(3, "clothes", "distractor-1").random() == 0.512032762580158
    assert stream(0, "sensor", "noise", 7).integers(2**63) == 8548314876312552566


def test_a_negative_seed_is_refused():
    with pytest.raises(ParameterError, match="seed must be >= 0"):
        stream(-1, "a")


def test_a_pick_is_drawn_as_a_choice_of_numpy():
    for count in (1, 2, 3, 7, 16):
        options = tuple(f"option {index}" for index in range(count))
        ours, theirs = np.random.default_rng(count), np.random.default_rng(count)
        assert [pick(ours, options) for _ in range(50)] == [str(theirs.choice(options)) for _ in range(50)]
        assert ours.random() == theirs.random()
