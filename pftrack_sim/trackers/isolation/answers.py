"""What counts as an answer of a tracker, wherever it runs."""

from __future__ import annotations

import numpy as np

from pftrack_sim.core.errors import TrackerError
from pftrack_sim.core.records import Estimate, Image


def checked_answer(said: object, given: Image, original: Image) -> Estimate:
    """A plain estimate out of what `update` returned.

    Args:
        said: What the tracker returned.
        given: `(H, W, 3)` the copy of the image that the tracker was given.
        original: `(H, W, 3)` the image as it was.

    Raises:
        TrackerError: It is no estimate, or the tracker wrote into its image.
        BoxError: Its box is no box.
        ParameterError: Its confidence is not in [0, 1].
    """
    check_untouched(given, original)
    if not isinstance(said, Estimate):
        raise TrackerError(f"update must return an Estimate, got {type(said).__name__}")
    # Made anew: the numbers are checked now, whatever a subclass does later.
    return Estimate(np.array(said.box), float(said.confidence), bool(said.occluded), said.particles)


def check_untouched(given: Image, original: Image) -> None:
    """Raise TrackerError when a tracker wrote into the image it was given."""
    if not np.array_equal(given, original):
        raise TrackerError("it wrote into the image it was given")
