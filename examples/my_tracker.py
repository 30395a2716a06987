"""A tracker of your own in twenty lines: the first view of the target, found again by template matching.

PYTHONPATH=examples pftrack-sim bench corridor --trackers my_tracker:make,stay
"""

from typing import Any

import cv2
import numpy as np

from pftrack_sim.trackers import Estimate


class Template:
    """Keeps the first view of the target, and looks for it around where it was last."""

    def init(self, image: Any, box: Any) -> None:
        """Remember the selected target; the box keeps its size."""
        self._box = np.round(box).astype(int)
        x, y, w, h = np.maximum(self._box, 0)
        self._template = image[y : y + max(h, 1), x : x + max(w, 1)].copy()

    def update(self, image: Any) -> Estimate:
        """Where the template fits best, and how well."""
        height, width = self._template.shape[:2]
        left, top = np.maximum(self._box[:2] - (width // 2, height // 4), 0)
        around = image[top : top + height * 3 // 2, left : left + 2 * width]
        if around.shape[0] >= height and around.shape[1] >= width:
            _, fit, _, (right, down) = cv2.minMaxLoc(cv2.matchTemplate(around, self._template, cv2.TM_CCOEFF_NORMED))
            self._box = np.array([left + right, top + down, width, height])
            return Estimate(self._box, confidence=float(np.clip(fit, 0.0, 1.0)))
        return Estimate(self._box, confidence=0.0)


def make(*, seed: int, preset: str) -> Template:
    """Called once for each worker: it does not read its seed (see docs/reliability.md)."""
    return Template()
