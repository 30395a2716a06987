"""klein2010: a classifier that AdaBoost trains on every frame."""

import numpy as np
import pytest

from pftrack_sim import trackers
from pftrack_sim.trackers.relatives.klein2010 import grid_of_regions, opponent_integral, train
from tests.trackers.following import Scene


def test_a_lasting_change_is_learnt(scene: Scene):
    """The target turns slowly into its negative; the classifier of the first frame would not know it any more."""
    images, truth = scene
    confidences = {}
    for learn_above in (0.0, 1.0):
        tracker = trackers.make("klein2010", learn_above=learn_above, sigma_centre=0.0, sigma_size=0.0)
        tracker.init(images[0], truth[0])
        x, y, w, h = truth[0].astype(int)
        for share in np.linspace(0.0, 1.0, 20):
            image = np.array(images[0])
            part = image[y : y + h, x : x + w].astype(float)
            image[y : y + h, x : x + w] = ((1 - share) * part + share * (255 - part)).astype(np.uint8)
            confidences[learn_above] = tracker.update(image).confidence
    assert confidences[0.0] > confidences[1.0] + 0.2


def test_features_ignore_brightness_and_follow_the_size():
    rng = np.random.default_rng(0)
    image = rng.integers(0, 100, (60, 80, 3), dtype=np.uint8)
    box = np.array([[30.0, 20, 16, 24]])
    pool = grid_of_regions(3, 0.5)
    values = pool.values(opponent_integral(image), box)
    assert values.shape == (1, 3 * len(pool.regions))
    brighter = pool.values(opponent_integral(image + np.uint8(50)), box)
    assert np.allclose(values, brighter, rtol=0, atol=1e-2)
    doubled = pool.values(opponent_integral(image.repeat(2, 0).repeat(2, 1)), 2 * box)
    assert np.allclose(values, doubled, rtol=0, atol=1e-2)
    chosen = np.array([5, 0, 17, 5])
    assert np.array_equal(pool.values(opponent_integral(image), box, chosen), values[:, chosen])


def samples(count: int = 60, features: int = 20, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Noise in which features 3, 8 and 11 each hint at the class, 11 with lower values for the positive one."""
    rng = np.random.default_rng(seed)
    positive = np.arange(count) < count // 3
    values = rng.standard_normal((count, features))
    values[:, [3, 8]] += 2.0 * positive[:, None]
    values[:, 11] -= 2.0 * positive
    return values, positive


def error(found: np.ndarray, positive: np.ndarray) -> float:
    return float(np.mean((found > 0) != positive))


@pytest.mark.parametrize("soft", [False, True])
def test_more_rounds_tell_the_classes_apart_better(soft: bool):
    values, positive = samples(300)
    unseen, labels = samples(300, seed=1)
    errors = []
    for rounds in (1, 3):
        strong = train(values, positive, np.ones(300), rounds)
        assert set(strong.chosen) <= {3, 8, 11}
        errors.append(error(strong.score(unseen[:, strong.chosen], soft=soft), labels))
    assert errors[1] < errors[0] < 0.25


def test_a_round_weights_the_samples_so_that_its_weak_classifier_is_a_coin():
    """Freund & Schapire 1997: the vote 1/2 ln((1 - e) / e) does that; the next choice is the best at these weights."""
    values, positive = samples()
    first, both = (train(values, positive, np.ones(60), rounds) for rounds in (1, 2))
    assert both.chosen[0] == first.chosen[0]
    right = (first.score(values[:, first.chosen], soft=False) > 0) == positive
    equal = np.where(positive, 1 / positive.sum(), 1 / (~positive).sum()) / 2
    vote = 0.5 * np.log((equal @ right) / (equal @ ~right))
    weights = equal * np.exp(np.where(right, -vote, vote))
    assert np.average(right, weights=weights) == pytest.approx(0.5, abs=1e-9)
    second = (values[:, both.chosen[1]] - both.thresholds[1]) * both.slopes[1] > 0
    error_of_second = np.average(second != positive, weights=weights)
    expected = 0.5 * np.log((1 - error_of_second) / error_of_second)
    assert both.votes[1] / both.votes[0] == pytest.approx(expected / vote, abs=1e-9)


def test_scores_are_in_range_and_soft_ones_grow_between_the_means():
    values, positive = samples()
    strong = train(values, positive, np.ones(60), 5)
    for soft in (False, True):
        found = strong.score(1000 * values[:, strong.chosen], soft=soft)
        assert np.abs(found).max() <= 1 + 1e-9
    single = train(values, positive, np.ones(60), 1)
    means = np.stack([values[part].mean(0) for part in (positive, ~positive)])[:, single.chosen]
    assert np.ptp(single.score(means, soft=True)) == pytest.approx(2, abs=0.5)
    assert single.votes.sum() == pytest.approx(1, abs=1e-12)


def test_a_heavier_sample_counts_as_several():
    values, positive = samples()
    weights = np.ones(60)
    weights[[2, 40]] = 3
    repeated = np.concatenate([np.arange(60), [2, 2, 40, 40]])
    heavy = train(values, positive, weights, 10)
    many = train(values[repeated], positive[repeated], np.ones(64), 10)
    assert np.array_equal(heavy.chosen, many.chosen)
    assert np.allclose(heavy.votes, many.votes, rtol=0, atol=1e-6)


def test_nothing_is_chosen_where_nothing_differs():
    strong = train(np.ones((10, 4)), np.arange(10) < 5, np.ones(10), 3)
    assert strong.chosen.size == 0
    assert strong.score(np.empty((7, 0)), soft=True).tolist() == [0.0] * 7
