"""Chau, Bremond, Thonnat and Corvee 2011: "Robust Mobile Object Tracking Based on Multiple Feature Similarity and
Trajectory Filtering", VISAPP.

Objects are matched with detections by the similarity of four features (distance, area, shape ratio, colour histogram)
to where a Kalman filter predicts them; the detection corrects the filter. A trajectory filter leaves out short
trajectories, which are noise, and joins the parts of one that was interrupted. `docs/papers/relatives.md` says what is
the publication's and what was chosen.
"""  # noqa: D205

from __future__ import annotations

from typing import Annotated, Any

import cv2
import numpy as np
from pydantic import Field
from scipy.optimize import linear_sum_assignment

from pftrack_sim.core.boxes import Box, centre, from_states, to_states
from pftrack_sim.core.records import Detections, Image, TrackedBoxes
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.features.histogram import histogram, uniform_layout
from pftrack_sim.trackers.multi_object.followed import FollowedPerson
from pftrack_sim.trackers.parameters import Count, NotNegative, Parameters, Positive, Share

_SHIFT = 4
_LAYOUT = uniform_layout(3, 256 >> _SHIFT)
_LEAST_PX = 1.0


class Chau2011Parameters(Parameters):
    """Parameters of `chau2011`.

    Attributes:
        distance_weight: Weight of the similarity of positions; also of the three others.
        least_similarity: Least similarity of a match.
        reach: Distance at which the similarity of positions is 0, in heights, per frame since the last match.
        least_score: Least score of a detection.
        confirm_frames: Matches from which a trajectory is no noise; those that begin in the first frame are none.
        memory_frames: Frames without a match after which a trajectory ends.
        colour_rate: Share of a matched detection in the histogram of its object.
        measurement_noise: Standard deviation of a detection's position and size, as a share of the height.
        position_noise: Of the predicted position and size, per frame.
        velocity_noise: Of the velocity, per frame.
    """

    distance_weight: NotNegative = 1.0
    area_weight: NotNegative = 1.0
    shape_weight: NotNegative = 1.0
    colour_weight: NotNegative = 1.0
    least_similarity: Share = 0.6
    reach: Positive = 0.5
    least_score: Share = 0.4
    confirm_frames: Count = 3
    memory_frames: Count = 45
    colour_rate: Annotated[float, Field(ge=0.0, le=1.0)] = 0.1
    measurement_noise: Positive = 0.05
    position_noise: Positive = 0.05
    velocity_noise: Positive = 0.01


class _Object:
    """One trajectory."""

    def __init__(
        self, box: Box, colours: FloatArray, params: Chau2011Parameters, identity: int, confirmed: bool
    ) -> None:
        self._params = params
        self.identity, self.colours, self._confirmed = identity, colours, confirmed
        self._matches, self.missed = 1, 0
        self._filter = cv2.KalmanFilter(8, 4, 0, cv2.CV_64F)
        self._filter.transitionMatrix = np.eye(8) + np.eye(8, k=4)
        self._filter.measurementMatrix = np.eye(4, 8)
        self._filter.statePost = np.concatenate([to_states(box), np.zeros(4)])[:, None]
        noise = self._noise(box[3])
        self._filter.errorCovPost = np.diag(np.concatenate([noise, 10.0 * noise]))

    def _noise(self, height: float) -> FloatArray:
        """`(4,)` variances of a measurement."""
        return np.full(4, (self._params.measurement_noise * height) ** 2)

    def predict(self) -> None:
        """Go on to the next frame."""
        height, params = max(self.box[3], _LEAST_PX), self._params
        deviations = np.repeat([params.position_noise, params.velocity_noise], 4) * height
        self._filter.processNoiseCov = np.diag(deviations**2)
        self._filter.measurementNoiseCov = np.diag(self._noise(height))
        self._filter.predict()
        self._filter.statePost = self._filter.statePre.copy()
        self._filter.errorCovPost = self._filter.errorCovPre.copy()
        self.missed += 1

    def correct(self, box: Box, colours: FloatArray) -> None:
        """Take a detection as this object."""
        self._filter.correct(to_states(box)[:, None])
        self.colours = (1.0 - self._params.colour_rate) * self.colours + self._params.colour_rate * colours
        self._matches += 1
        self.missed = 0

    @property
    def confirmed(self) -> bool:
        """Whether it is no noise: it was there from the first frame on, or was matched often enough."""
        return self._confirmed or self._matches >= self._params.confirm_frames

    @property
    def box(self) -> Box:
        """`(4,)` estimated box [px]."""
        state = np.asarray(self._filter.statePost, dtype=np.float64)[:4, 0]
        return from_states(np.concatenate([state[:2], np.maximum(state[2:], _LEAST_PX)]))


class Chau2011:
    """Multi-object tracker by the similarity of four features."""

    def __init__(self, params: Chau2011Parameters) -> None:
        self.params = params
        self._objects: list[_Object] = []
        self._count = 0
        self._frame = -1

    def update(self, detections: Detections, image: Image) -> TrackedBoxes:
        """Identify detections. Objects without one in this frame have no box."""
        self._frame += 1
        codes = np.right_shift(image, _SHIFT, dtype=np.uint8)
        found = [box for box, score in zip(detections.boxes, detections.scores.tolist(), strict=True)
                 if score >= self.params.least_score and (box[2:] >= _LEAST_PX).all()]  # fmt: skip
        colours = [histogram(codes, box, _LAYOUT) for box in found]
        for one in self._objects:
            one.predict()
        similarity = np.array(
            [[self._similarity(one, box, those) for box, those in zip(found, colours, strict=True)]
             for one in self._objects]
        ).reshape(len(self._objects), len(found))  # fmt: skip
        rows, columns = linear_sum_assignment(-similarity)
        matched: set[int] = set()
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
            if 0.0 < similarity[row, column] >= self.params.least_similarity:  # 0: out of reach
                self._objects[row].correct(found[column], colours[column])
                matched.add(column)
        for column, box in enumerate(found):
            if column not in matched:
                self._count += 1
                self._objects.append(_Object(box, colours[column], self.params, self._count, self._frame == 0))
        self._objects = [one for one in self._objects if self._goes_on(one)]
        shown = [one for one in self._objects if one.missed == 0 and one.confirmed]
        boxes = np.array([one.box for one in shown]).reshape(-1, 4)
        return TrackedBoxes(boxes, np.array([one.identity for one in shown], dtype=np.int64))

    def _similarity(self, one: _Object, box: Box, colours: FloatArray) -> float:
        """Weighted mean of four similarities in [0, 1]; 0 for a detection out of reach."""
        params, mine = self.params, one.box
        gap = float(np.linalg.norm(centre(mine) - centre(box)))
        near = 1.0 - gap / (params.reach * mine[3] * one.missed)
        if near <= 0.0:
            return 0.0
        similarities = [
            near,
            _ratio(mine[2] * mine[3], box[2] * box[3]),
            _ratio(mine[2] / mine[3], box[2] / box[3]),
            float(np.minimum(one.colours, colours).sum()),
        ]
        weights = [params.distance_weight, params.area_weight, params.shape_weight, params.colour_weight]
        return float(np.dot(weights, similarities)) / max(sum(weights), 1e-9)

    def _goes_on(self, one: _Object) -> bool:
        """The trajectory filter: noise ends with its first miss, others after `memory_frames`."""
        return one.missed == 0 or (one.confirmed and one.missed <= self.params.memory_frames)


def _ratio(first: float, second: float) -> float:
    return min(first, second) / max(first, second)


def make(name: str, *, seed: int, preset: str, **params: Any) -> FollowedPerson:
    """Make `chau2011`; it draws nothing."""
    chosen = Chau2011Parameters.from_preset(name, preset, params)
    return FollowedPerson(lambda: Chau2011(chosen))
