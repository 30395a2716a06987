"""The picture of people on wheels and crutches in docs/own-scenario.md, and of a child.

    python docs/site/riders.py

writes `docs/pictures/riders.webp`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

import cv2
import numpy as np

from pftrack_sim import scenario
from pftrack_sim.scenario.mobility import USUAL_SPEED_M_S, Mobility
from pftrack_sim.simulation.simulation import Simulation

SETTINGS: dict[str, Any] = {
    "robot.route": {"kind": "beside", "distance_m": 2.8, "side": "left"},
    "target.actions": [],
    "target.path_m": [[3.0, 0.0], [13.0, 0.0]],
}


def still(seed: int, more: dict[str, Any]) -> np.ndarray:
    """`(480, 400, 3)` middle of a frame."""
    with Simulation(scenario.load("plaza-walk", SETTINGS | more)) as simulation:
        frame = simulation.reset(seed)
        for _ in range(54):
            frame = simulation.advance()
        x, _, width, _ = frame.truth.box
        left = int(min(max(x + 0.5 * width - 220.0, 0.0), 240.0))
        return frame.image[:, left : left + 400]


if __name__ == "__main__":
    speeds: dict[Mobility, float] = {uses: USUAL_SPEED_M_S.get(uses, 1.3) for uses in get_args(Mobility)}
    shown = [{"target.uses": uses, "target.speed_m_s": speed_m_s} for uses, speed_m_s in speeds.items()]
    shown.append({"target.height_m": 1.1, "target.speed_m_s": 1.3})
    sheet = np.hstack([still(seed, more) for seed, more in enumerate(shown, start=3)])
    target = Path(__file__).parents[1] / "pictures" / "riders.webp"
    small = cv2.resize(sheet, None, fx=0.6, fy=0.6, interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(target), small[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, 75])
