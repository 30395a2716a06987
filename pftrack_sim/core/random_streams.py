"""Random streams: one root seed per episode, one named child stream per concern.

A stream depends on the seed and on its own name only, so drawing more from one, or adding another, leaves
every other draw as it was: two conditions of an experiment stay paired by seed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from pftrack_sim.core.errors import ParameterError

_Option = TypeVar("_Option")


def stream(seed: int, *names: str | int) -> np.random.Generator:
    """Random generator of one concern of one episode, by root seed and name in parts: `"clothes", "crosser-1"`.

    Raises:
        ParameterError: The seed is negative.

    >>> bool(stream(3, "jitter").random() == stream(3, "jitter").random())
    True
    """
    if seed < 0:
        raise ParameterError(f"seed must be >= 0, got {seed}")
    # Escaped, so that ("a", "b") and ("a/b",) are two streams.
    key = "/".join(str(name).replace("\\", "\\\\").replace("/", "\\/") for name in names).encode()
    # The words of 32 bits that numpy makes of the seed itself, in more time.
    root = int(seed).to_bytes(4 * max(1, (int(seed).bit_length() + 31) // 32), "little")
    words = np.frombuffer(root + hashlib.sha256(key).digest()[:16], dtype="<u4")
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(words)))


def pick(rng: np.random.Generator, options: Sequence[_Option]) -> _Option:
    """One of several options, drawn as by `rng.choice(options)`, in a sixth of its time."""
    return options[int(rng.integers(len(options)))]
