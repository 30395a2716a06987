"""The picture of a ball that is kicked, in docs/own-scenario.md.

    python docs/site/kicked.py

writes `docs/pictures/kicked.webp`.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from pftrack_sim import scenario
from pftrack_sim.simulation.simulation import Simulation

TIMES_S = (1.0, 1.3, 2.0, 2.6)  # From before the first kick until the ball has bounced
SETTINGS = {"camera.fovy_deg": 20, "distractors.count": 0, "occluders": []}

if __name__ == "__main__":
    panels: list[np.ndarray] = []
    with Simulation(scenario.load("objects/kicked-ball", SETTINGS)) as simulation:
        frame = simulation.reset(2)
        for time_s in TIMES_S:
            while frame.time_s < time_s - 1e-6:
                frame = simulation.advance()
            panels.append(frame.image)
    target = Path(__file__).parents[1] / "pictures" / "kicked.webp"
    cv2.imwrite(str(target), np.hstack(panels)[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, 60])
