"""The picture of lenses in docs/own-scenario.md: what an off-centre camera and two equidistant ones see, with truth.

    python docs/site/lenses.py

writes `docs/pictures/lenses.webp` from calibrations in the forms of ROS and Kalibr.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import cv2
import numpy as np

from pftrack_sim import scenario
from pftrack_sim.render.overlay import draw_frame
from pftrack_sim.simulation.simulation import Simulation

OFF_CENTRE = """image_width: 640
image_height: 480
camera_matrix: {rows: 3, cols: 3, data: [420.0, 0.0, 255.0, 0.0, 425.0, 290.0, 0.0, 0.0, 1.0]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.28, 0.07, 0.001, 0.0005, 0.0]}
"""
EQUIDISTANT = """cam0:
  camera_model: pinhole
  distortion_model: equidistant
  distortion_coeffs: [0.01, -0.005, 0.001, 0.0]
  intrinsics: [{focal}, {focal}, 321.5, 236.0]
  resolution: [640, 480]
"""
FOCALS_PX = 306.0, 198.0  # 120 and 185 degrees across


def still(text: str) -> np.ndarray:
    """`(480, 640, 3)` frame with boxes through the camera of a calibration."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "camera.yaml")
        file.write_text(text)
        loaded = scenario.load("follow/plaza", {"camera.calibration": str(file)})
    with Simulation(loaded) as simulation:
        frame = simulation.reset(3)
        for _ in range(90):
            frame = simulation.advance()
        return draw_frame(frame, {})


if __name__ == "__main__":
    sheet = np.hstack([still(OFF_CENTRE), *(still(EQUIDISTANT.format(focal=focal)) for focal in FOCALS_PX)])
    target = Path(__file__).parents[1] / "pictures" / "lenses.webp"
    cv2.imwrite(str(target), sheet[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, 55])
