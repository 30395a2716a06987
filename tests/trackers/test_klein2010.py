"""klein2010: a classifier that is trained on every frame."""

import numpy as np

from pftrack_sim import trackers
from pftrack_sim.trackers.relatives.klein2010 import Klein2010, grid_of_regions, opponent_integral
from tests.trackers.following import Scene


def made(**given: float) -> Klein2010:
    tracker = trackers.make("klein2010", **given)
    assert isinstance(tracker, Klein2010)
    return tracker


def test_the_target_has_more_confidence_than_its_surround(scene: Scene):
    images, truth = scene
    tracker = made()
    tracker.init(images[0], truth[0])
    around = truth[0] + np.array([[12.0, 0, 0, 0], [-12, 0, 0, 0], [0, 18, 0, 0], [0, -18, 0, 0], [-8, -12, 16, 24]])
    seen = tracker.observe(images[0], np.concatenate([around, truth[:1]]))
    assert tracker.similarity(seen, truth[0]) > 0.7
    assert (0.5 + 0.5 * tracker.confidences(seen, around)).max() < tracker.similarity(seen, truth[0]) - 0.2


def test_a_lasting_change_is_learnt(scene: Scene):
    """The target turns slowly into its negative; the classifier of the first frame would not know it any more."""
    images, truth = scene
    confidences = {}
    for learn_above in (0.0, 1.0):
        tracker = made(learn_above=learn_above, sigma_centre=0.0, sigma_size=0.0)
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
