"""Trackers that follow synthetic sequences."""

from typing import Any, TypeVar

import numpy as np

from pftrack_sim import trackers
from pftrack_sim.core.records import Estimate, Tracker

Kind = TypeVar("Kind", bound=Tracker)

Scene = tuple[list[np.ndarray], np.ndarray]
"""Images `(H, W, 3)` uint8 RGB, and `(N, 4)` true boxes [px]."""


def made(kind: type[Kind], **given: Any) -> Kind:
    """The tracker that is registered by the name of its class in small letters."""
    tracker = trackers.make(kind.__name__.lower(), **given)
    assert isinstance(tracker, kind)
    return tracker


def follow(tracker: Tracker | str, images: list[np.ndarray], box: Any, **given: Any) -> list[Estimate]:
    """What a tracker, or one made by its name with what is given, says of the images after the first."""
    one = trackers.make(tracker, **given) if isinstance(tracker, str) else tracker
    one.init(images[0], np.asarray(box, dtype=np.float64))
    return [one.update(image) for image in images[1:]]


def followed_boxes(tracker: Tracker | str, images: list[np.ndarray], box: Any, **given: Any) -> np.ndarray:
    """`(N - 1, 4)` boxes of `follow`."""
    return np.array([one.box for one in follow(tracker, images, box, **given)])
