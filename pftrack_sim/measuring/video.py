"""Measuring a video or a sequence of images: one pass over its frames."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from pftrack_sim.formats.images import ImageFiles
from pftrack_sim.measuring.exposure import measure_exposure
from pftrack_sim.measuring.jitter import Systematic, Untold, cuts, measure_jitter
from pftrack_sim.measuring.light import measure_light
from pftrack_sim.measuring.material import Material, camera_of
from pftrack_sim.measuring.measured import Measured, Quantity
from pftrack_sim.measuring.motion import MotionMeter, Step
from pftrack_sim.measuring.noise import NoiseMeter
from pftrack_sim.measuring.shutter import measure_readout
from pftrack_sim.measuring.stream import measure_stream

_FROZEN_PX, _SHRUNK = 0.2, 0.1
"""What H.264 at rate factors 21 and 28 takes off a shake of 0.05 and 0.2 degrees (320x240, docs/measure.md)."""


def measure_video(
    material: Material,
    fovy_deg: float | None = None,
    calibration: Path | None = None,
    on_frame: Callable[[], None] = lambda: None,
) -> Measured:
    """What a video or sequence tells of the axes.

    Args:
        material: Its frames.
        fovy_deg: Vertical field of view.
        calibration: Calibration file.
        on_frame: Called after every frame.

    Raises:
        SequenceError: A frame cannot be read.
        ParameterError: A wrong calibration.
    """
    first = material.images.read(0)
    height, width = first.shape[:2]
    camera, focal_share = camera_of((width, height), fovy_deg, calibration)
    meter = MotionMeter(camera)
    noise = NoiseMeter(material.images)
    steps: list[Step] = []
    for index in range(len(material.images)):
        hidden = material.boxes[index - 1] if material.boxes is not None and index else None
        image = material.images.read(index)
        step = meter.step(image, hidden)
        steps += [step] if step is not None else []
        noise.add(index, image)
        on_frame()
    quantities, doubts = measure_stream(material, steps)
    left_out: dict[str, str] = {}
    pixel_deg = math.degrees(1.0 / float(camera.K[0, 0]))
    lossy = {} if isinstance(material.images, ImageFiles) else {"frozen_deg": _FROZEN_PX * pixel_deg, "shrunk": _SHRUNK}
    systematic = Systematic(focal_share, **lossy)
    measures: dict[str, Callable[[], list[Quantity]]] = {
        "jitter": lambda: measure_jitter(steps, material.times_s, systematic),
        "light": lambda: measure_light(steps, material.times_s, doubts),
        "rolling_shutter": lambda: measure_readout(steps, material.times_s),
        "blur": lambda: measure_exposure(material.images, steps, material.times_s, float(camera.K[0, 0])),
        "noise": lambda: noise.measure(doubts),
    }
    for name, measure in measures.items():
        try:
            quantities += measure()
        except Untold as reason:
            left_out[name] = str(reason)
    if focal_share != (1.0, 1.0):
        doubts.append(
            "the field of view is not known: 40 to 62 degrees from top to bottom widen the intervals; see --fovy-deg"
        )
    found = cuts(steps)
    if found:
        where = ", ".join(f"{material.times_s[index + 1]:.2f} s" for index in found[:5])
        doubts.append(f"{len(found)} cut{'s' if found[1:] else ''} in it (at {where}): nothing is measured across")
    shares = [one.share for one in steps if one.known]
    if shares and np.median(shares) < 0.6:
        doubts.append(f"only {100 * np.median(shares):.0f} % of what has texture belongs to the static background")
    size = [
        Quantity(name, side, side, side, "px", len(steps) + 1, settings={f"camera.{name}_px": side})
        for name, side in (("width", width), ("height", height))
    ]
    return Measured(material.name, (*size, *quantities), left_out, tuple(doubts))
