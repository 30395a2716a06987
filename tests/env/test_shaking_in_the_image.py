"""Camera shake, measured by the motion of the background in the image."""

import cv2
import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.simulation.simulation import Simulation

RATE_HZ, DURATION_S = 25.0, 40.0
SIZE = (320, 240)
STILL = {
    "robot.route": {"kind": "still", "start_m": [0.0, 0.0], "heading_deg": 20.0},
    "robot.gaze": "forward",
    "target.path_m": [[5.4, -2.5], [7.2, -3.4]],  # beside the image, so that only the place is seen
    "distractors.count": 0,
    "occluders": [],
    "lights.shadows": False,
    "jitter": {},
    "camera.width_px": SIZE[0],
    "camera.height_px": SIZE[1],
    "camera.rate_hz": RATE_HZ,
    "duration_s": DURATION_S,
}


def motion_deg(axis: dict[str, object]) -> np.ndarray:
    """`(N, 2)` angles by which the background has moved since the first frame, across and down."""
    loaded = scenario.load("easy/plaza-walk", {**STILL, "axes.jitter": axis})
    with Simulation(loaded) as simulation:
        first = simulation.reset(0)
        focal_px = first.truth.K[0, 0]
        reference = cv2.cvtColor(first.image, cv2.COLOR_RGB2GRAY)
        corners = cv2.goodFeaturesToTrack(reference, 120, 0.01, 6)
        middle = np.array([*SIZE, 2.0]) / 2.0
        shifts = []
        for _ in range(simulation.settings.frame_count - 1):
            grey = cv2.cvtColor(simulation.advance().image, cv2.COLOR_RGB2GRAY)
            found, followed, _ = cv2.calcOpticalFlowPyrLK(reference, grey, corners, None)
            kept = followed.ravel() == 1
            # Rolling turns the image about its middle: what is left there is pan and nod.
            moved, _ = cv2.estimateAffinePartial2D(corners[kept], found[kept], ransacReprojThreshold=1.0)
            shifts.append(moved @ middle - middle[:2])
    return np.rad2deg(np.arctan(np.array(shifts) / focal_px))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("axis", "rms_deg", "half_power_hz"),
    [
        # Flat from 2 to 8 Hz: half of the power is below 5 Hz.
        ({"sources": ["ground"], "ground_rms_deg": 0.6, "ground_rms_mm": 0.0, "ground_band_hz": [2.0, 8.0]}, 0.6, 5.0),
        # First-order gusts up to 12 corners: half of the power is below tan(atan(12) / 2) corners.
        ({"sources": ["wind"], "wind_rms_deg": 0.6, "wind_corner_hz": 1.0}, 0.6, float(np.tan(np.arctan(12.0) / 2.0))),
    ],
)
def test_the_background_moves_with_the_given_rms_and_band(
    axis: dict[str, object], rms_deg: float, half_power_hz: float
):
    moved = motion_deg(axis)
    moved -= moved.mean(axis=0)
    # Power is added up over both directions; each has the RMS asked for.
    assert abs(np.sqrt((moved**2).mean()) / rms_deg - 1.0) < 0.1
    power = (np.abs(np.fft.rfft(moved * np.hanning(len(moved))[:, None], axis=0)) ** 2).sum(axis=1)
    hertz = np.fft.rfftfreq(len(moved), 1.0 / RATE_HZ)
    assert abs(power[hertz < half_power_hz].sum() / power.sum() - 0.5) < 0.1


def test_severity_zero_moves_nothing():
    with Simulation(
        scenario.load("easy/plaza-walk", {**STILL, "duration_s": 0.4, "axes.jitter.severity": 0})
    ) as simulation:
        first = simulation.reset(0).image
        assert all((simulation.advance().image == first).all() for _ in range(5))
