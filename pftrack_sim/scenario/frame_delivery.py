"""Delivery of frames over the link: which captured frames arrive, from settings and seed alone."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

from pftrack_sim.core.random_streams import stream
from pftrack_sim.scenario.axes import StreamAxis
from pftrack_sim.scenario.model import ResolvedScenario


def arrivals(settings: ResolvedScenario, seed: int) -> Iterator[int]:
    """Indices of the captured frames that are delivered, ascending, endless.

    The first frame is always delivered: the target is selected in it.
    """
    axis = settings.axes.stream
    if not axis.on:
        return itertools.count()
    return _received(axis, _sent(axis.sent_hz / settings.camera.rate_hz), seed)


def frame_count(settings: ResolvedScenario, seed: int) -> int:
    """Number of frames delivered in one episode, at least 2."""
    taken = settings.frame_count
    return max(2, sum(1 for _ in itertools.takewhile(lambda index: index < taken, arrivals(settings, seed))))


def _sent(share: float) -> Iterator[int]:
    """Indices of the frames sent, spaced as evenly as a share of the captured frames allows."""
    for number in itertools.count():
        # Rounded first: rounding errors of the quotient must not move the ceiling.
        yield math.ceil(round(number / min(share, 1.0), 9))


def _received(axis: StreamAxis, sent: Iterator[int], seed: int) -> Iterator[int]:
    """Frames sent and not lost (Gilbert 1960: all are lost in the bad state, none in the good state)."""
    rng = stream(seed, "stream", "lost")
    fall, leave = axis.transitions
    yield next(sent)
    bad = False
    for index in sent:
        draw = rng.random()
        bad = draw >= leave if bad else draw < fall
        if not bad:
            yield index
