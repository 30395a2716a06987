"""Edge orientations as channels."""

import numpy as np
import pytest

from pftrack_sim.trackers.features.orientation import orientation_channels


def ramp(direction_deg: float) -> np.ndarray:
    """Brightness that grows along a direction (y down)."""
    v, u = np.mgrid[:40, :40] - 20.0
    angle = np.radians(direction_deg)
    return (128 + 4 * (u * np.cos(angle) + v * np.sin(angle))).clip(0, 255).astype(np.uint8)


@pytest.mark.parametrize("direction", [10, 33, 80, 100, 170])
def test_a_ramp_lies_in_the_channel_of_its_direction_whichever_way_it_goes(direction: int):
    for turned in (direction, direction + 180):
        energy = orientation_channels(ramp(turned), 8)[5:-5, 5:-5].sum(axis=(0, 1))
        assert int(energy.argmax()) == int(direction * 8 / 180)
        assert energy.max() > 0.6 * energy.sum()


def test_channels_hold_the_magnitude_of_the_gradient_and_nothing_else():
    image = np.random.default_rng(0).integers(0, 255, (20, 30), dtype=np.uint8)
    channels = orientation_channels(image, 5)
    assert channels.shape == (20, 30, 5)
    assert ((channels > 0).sum(axis=2) <= 1).all()
    # The mask of Sobel weighs a slope by eight.
    assert np.allclose(orientation_channels(ramp(0), 5).sum(axis=2)[5:-5, 5:-5], 8 * 4, rtol=0, atol=1e-4)
    assert not orientation_channels(np.full((6, 7), 9, np.uint8), 5).any()
