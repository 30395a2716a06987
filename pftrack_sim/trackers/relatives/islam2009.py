"""Islam, Oh & Lee 2009, "Video Based Moving Object Tracking by Particle Filter", IJSIP 2(1).

A particle filter whose observation is shape: the distance transform of the edge image inside a particle's box, brought
to the size of the template and compared with that of the first frame by normalised cross-correlation, which depends
neither on the box's size nor on the scale of the distances. Ko et al. 2012, section I and table 1, describe it so; a
second cue, an HSV histogram, can be mixed in.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.box_filter import TUNED_WALK, BoxFilterParameters, BoxFilterTracker
from pftrack_sim.trackers.features.histogram import epanechnikov_layout, histogram, similarities
from pftrack_sim.trackers.features.image_region import ImageRegion
from pftrack_sim.trackers.features.patches import sample_patches
from pftrack_sim.trackers.features.pixel_codes import JOINT_COUNT, hsv_joint_codes
from pftrack_sim.trackers.parameters import Count, NotNegative, Positive, Share

SHAPE = (32, 16)
"""Rows and columns of the template."""
_LAYOUT = epanechnikov_layout(1, JOINT_COUNT)


class Islam2009Parameters(BoxFilterParameters):
    """Parameters. Defaults are the preset `paper`; none of the publication's values is known here.

    Those of the filter: `BoxFilterParameters`, here without a rejection of jumps, and with the mean of all particles.

    Attributes:
        sharpness: lambda of the likelihood exp(-lambda (1 - similarity)).
        colour_share: Weight of the HSV histogram's similarity beside that of shape. 0: shape alone, as Ko et al.
            describe the method.
        edge_low: Lower threshold of Canny's edge detector, in grey levels of the gradient (Sobel, 3x3).
        edge_high: Its upper threshold.
        cap_share: Distance from which on pixels count as equally far from the edges, as a share of the shorter side of
            the template's grid.
    """

    TUNED: ClassVar[Mapping[str, Any]] = {
        "particle_count": 200,
        **TUNED_WALK,
        "top_count": 10,
        "redraw": "estimate",
        "colour_share": 0.7,
        "cap_share": 0.25,
    }

    sigma_centre: NotNegative = 4.0
    sigma_size: NotNegative = 1.0
    top_count: Count = 100
    hold_distance: NotNegative = 1000.0
    sharpness: Annotated[float, Field(ge=0.0, le=10_000.0)] = 20.0
    colour_share: Share = 0.0
    edge_low: Annotated[float, Field(ge=0.0, le=2000.0)] = 60.0
    edge_high: Annotated[float, Field(ge=0.0, le=2000.0)] = 150.0
    cap_share: Positive = 0.5


@dataclass(frozen=True, eq=False)
class EdgeRegion:
    """Distances to edges `(H, W)` and colour codes `(H, W, 1)` of the region that boxes touch."""

    region: ImageRegion
    distances: NDArray[np.uint8]
    codes: NDArray[np.uint8]

    def shapes(self, wanted: FloatArray) -> NDArray[np.float32]:
        """`(N, d)` patches of distances of `(N, 4)` boxes [px], of mean 0 and variance 1."""
        local = self.region.to_region(wanted)
        placements = np.zeros((len(local), 6))
        placements[:, [0, 1, 2, 5]] = boxes.to_states(local)
        return sample_patches(self.distances, placements, SHAPE)


def edge_distances(image: Image, thresholds: tuple[float, float], cap_px: float) -> NDArray[np.uint8]:
    """`(H, W)` distance of every pixel to the nearest edge, 0 on edges and 255 from `cap_px` on.

    Edges are those of Canny's detector on the grey image (ITU-R BT.601) with the lower and upper of the two thresholds.
    Beyond the cap all pixels count as equally far, so that one lost or new edge does not change a whole region.
    """
    grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    edges = np.asarray(cv2.Canny(grey, *thresholds), dtype=np.uint8)
    distances = cv2.distanceTransform(255 - edges, cv2.DIST_L2, cv2.DIST_MASK_3)
    return np.asarray(cv2.convertScaleAbs(np.minimum(distances, cap_px), alpha=255.0 / cap_px), dtype=np.uint8)


class Islam2009(BoxFilterTracker[Islam2009Parameters, EdgeRegion]):
    """Tracker by shape, and by colour if it has a share.

    Attributes:
        template: `(d,)` patch of distances, the first frame's shape.
    """

    def _learn_first(self, image: Image, box: Box) -> None:
        seen = self.observe(image, box[None])
        self.template = seen.shapes(box[None])[0]
        self._colours = histogram(seen.codes, seen.region.to_region(box[None])[0], _LAYOUT)

    def observe(self, image: Image, near: FloatArray) -> EdgeRegion:
        """Edges and colours, in blocks of about the points of the template's grid, so that edges have one size."""
        p = self.params
        region = self._blocks(image, near, (SHAPE[1], SHAPE[0]))
        distances = edge_distances(region.pixels, (p.edge_low, p.edge_high), p.cap_share * min(SHAPE))
        return EdgeRegion(region, distances, hsv_joint_codes(region.pixels))

    def log_likelihood(self, seen: EdgeRegion, wanted: FloatArray) -> FloatArray:
        """`(N,)` logarithms of the likelihood of `(N, 4)` boxes [px]."""
        return self.params.sharpness * (self.similarities(seen, wanted) - 1.0)

    def similarity(self, seen: EdgeRegion, box: Box) -> float:
        """Similarity of a `(4,)` box [px], in [0, 1]."""
        return min(float(self.similarities(seen, box[None])[0]), 1.0)

    def similarities(self, seen: EdgeRegion, wanted: FloatArray) -> FloatArray:
        """`(N,)` mixtures, in [0, 1], of the correlation of shapes, 0 where negative, and the similarity of colours."""
        share = self.params.colour_share
        correlation = seen.shapes(wanted) @ self.template / math.prod(SHAPE)
        colour = similarities(seen.codes, seen.region.to_region(wanted), _LAYOUT, self._colours)
        return (1.0 - share) * np.clip(correlation, 0.0, 1.0) + share * colour


def make(name: str, *, seed: int, preset: str, **params: Any) -> Islam2009:
    """Make the tracker; raises ParameterError."""
    return Islam2009(Islam2009Parameters.from_preset(name, preset, params), seed)
