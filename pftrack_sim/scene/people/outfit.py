"""Clothes, and outfits of a given similarity to another.

Similarity is defined on the scale on which it is later measured: the Bhattacharyya coefficient of colour histograms.
Two Gaussian colour distributions of standard deviation sigma whose means are D apart have the coefficient
exp(-D^2 / (8 sigma^2)) (Bhattacharyya 1943; Kailath 1967), so an outfit of similarity s lies sigma sqrt(8 ln(1/s)) away
from the reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.people.anatomy import Colour, rgb

Pattern: TypeAlias = Literal["plain", "stripes", "pinstripes", "checks", "print", "block", "dots"]

_COLOUR_SIGMA = 13.0  # standard deviation of a cloth's pixel values through folds and pattern [8-bit units]
# RGB distance of main colours from which two garments count as clearly different.
_DISSIMILAR_DISTANCE = {"top": 110.0, "bottom": 70.0, "shoes": 40.0}

# Colours and their relative frequencies.
# fmt: off
_TOP_COLOURS: tuple[tuple[Colour, float], ...] = (
    ((32, 33, 37), 1.2), ((226, 224, 218), 1.2), ((128, 130, 134), 1.0), ((34, 47, 88), 1.1), ((56, 98, 158), 0.9),
    ((138, 176, 212), 0.7), ((176, 36, 40), 1.0), ((108, 28, 44), 0.7), ((44, 92, 62), 0.8), ((104, 110, 66), 0.6),
    ((208, 162, 48), 0.7), ((214, 112, 44), 0.6), ((206, 188, 156), 0.6), ((110, 78, 56), 0.5), ((40, 124, 128), 0.6),
    ((206, 126, 148), 0.5), ((104, 70, 132), 0.5),
)
_BOTTOM_COLOURS: tuple[tuple[Colour, float], ...] = (
    ((52, 70, 104), 1.6), ((88, 112, 146), 0.9), ((34, 35, 40), 1.5), ((86, 88, 92), 1.0), ((158, 142, 112), 1.0),
    ((196, 184, 158), 0.5), ((92, 72, 54), 0.6), ((76, 82, 60), 0.6), ((118, 44, 46), 0.2), ((200, 200, 198), 0.3),
)
_SHOE_COLOURS: tuple[tuple[Colour, float], ...] = (
    ((36, 34, 34), 1.5), ((92, 60, 38), 1.0), ((222, 222, 220), 1.0), ((70, 76, 92), 0.6), ((150, 40, 42), 0.3),
    ((120, 122, 126), 0.6),
)
_TOP_PATTERNS: tuple[tuple[Pattern, float], ...] = (
    ("plain", 0.36), ("stripes", 0.17), ("checks", 0.16), ("print", 0.13), ("block", 0.10), ("dots", 0.08),
)
_BOTTOM_PATTERNS: tuple[tuple[Pattern, float], ...] = (("plain", 0.82), ("pinstripes", 0.10), ("checks", 0.08))
_SHOE_PATTERNS: tuple[tuple[Pattern, float], ...] = (("plain", 1.0),)
# fmt: on


@dataclass(frozen=True)
class Garment:
    """One piece of clothing.

    Attributes:
        accent: Colour of the pattern; of the sole for shoes.
        scale_m: Repeat of the pattern [m].
        texture_seed: Seed of the folds and of the print's shape.
    """

    colour: Colour
    accent: Colour
    pattern: Pattern = "plain"
    scale_m: float = 0.06
    texture_seed: int = 0


@dataclass(frozen=True)
class Outfit:
    """Clothes of one person.

    Attributes:
        long_sleeves: Sleeves reach the wrist; else they end above the elbow.
        long_legs: Trousers reach the ankle; else they end above the knee.
        open_front: A row of buttons runs down the front.
        looseness: 0 for tight, 1 for wide.
    """

    top: Garment
    bottom: Garment
    shoes: Garment
    long_sleeves: bool = True
    long_legs: bool = True
    open_front: bool = False
    looseness: float = 0.5


def sample_outfit(rng: np.random.Generator) -> Outfit:
    """Sample everyday clothes."""
    return Outfit(
        top=_sample_garment(rng, _TOP_COLOURS, _TOP_PATTERNS, contrast=70.0),
        bottom=_sample_garment(rng, _BOTTOM_COLOURS, _BOTTOM_PATTERNS, contrast=25.0),
        shoes=_sample_garment(rng, _SHOE_COLOURS, _SHOE_PATTERNS, contrast=60.0),
        long_sleeves=bool(rng.random() < 0.6),
        long_legs=bool(rng.random() < 0.88),
        open_front=bool(rng.random() < 0.4),
        looseness=float(rng.uniform(0.2, 0.9)),
    )


def similar_outfit(rng: np.random.Generator, reference: Outfit, similarity: float) -> Outfit:
    """Sample an outfit of a given similarity to another.

    The draws do not depend on the similarity: with the same random numbers, outfits form a path from clearly different
    clothes to the same clothes.

    Args:
        rng: Generates the dissimilar outfit at the other end of the path.
        reference: The outfit to resemble.
        similarity: 1 for the same clothes, 0 for independent, clearly different ones; in between, the expected
            Bhattacharyya coefficient of the colour histograms grows monotonically.

    Raises:
        ParameterError: The similarity is outside [0, 1].
    """
    if not 0.0 <= similarity <= 1.0:
        raise ParameterError(f"similarity must be in [0, 1], got {similarity}")
    candidates = [sample_outfit(rng) for _ in range(12)]
    other = max(candidates, key=lambda candidate: min(_dissimilarity(candidate, reference), 1.0))
    draws = rng.random(6)
    if similarity == 1.0:
        return reference
    same_top, same_bottom, *same = [bool(draw < similarity) for draw in draws]
    return Outfit(
        _similar_garment(other.top, reference.top, similarity, same_top),
        _similar_garment(other.bottom, reference.bottom, similarity, same_bottom),
        _similar_garment(other.shoes, reference.shoes, similarity, True),
        long_sleeves=(reference if same[0] else other).long_sleeves,
        long_legs=(reference if same[1] else other).long_legs,
        open_front=(reference if same[2] else other).open_front,
        looseness=(reference if same[3] else other).looseness,
    )


def _sample_garment(
    rng: np.random.Generator,
    colours: Sequence[tuple[Colour, float]],
    patterns: Sequence[tuple[Pattern, float]],
    contrast: float,
) -> Garment:
    weights = np.array([weight for _, weight in colours])
    main, *others = [colours[int(index)][0] for index in rng.choice(len(colours), size=8, p=weights / weights.sum())]
    tints = rng.normal(0.0, 7.0, (2, 3))
    shares = np.array([share for _, share in patterns])
    pattern = patterns[int(rng.choice(len(patterns), p=shares / shares.sum()))][0]
    scale = float(rng.uniform(0.045, 0.11))
    texture_seed = int(rng.integers(2**31))
    # The first colour with enough contrast for the pattern to be visible, else a light or dark grey.
    grey = (225, 225, 225) if np.mean(main) < 128 else (35, 35, 35)
    accent = next((other for other in others if _distance(other, main) > contrast), grey)
    return Garment(rgb(main + tints[0]), rgb(accent + tints[1]), pattern, scale, texture_seed)


def _similar_garment(other: Garment, reference: Garment, similarity: float, same_pattern: bool) -> Garment:
    reach = np.inf if similarity <= 0.0 else _COLOUR_SIGMA * np.sqrt(8.0 * np.log(1.0 / similarity))
    drawing = reference if same_pattern else other
    return Garment(
        _limited(other.colour, reference.colour, reach),
        _limited(other.accent, reference.accent, reach),
        drawing.pattern,
        drawing.scale_m,
        drawing.texture_seed,
    )


def _limited(colour: Colour, reference: Colour, reach: float) -> Colour:
    """The colour moved towards the reference until their RGB distance is at most `reach`."""
    start, way = np.array(reference, float), np.subtract(colour, reference)
    distance = _distance(colour, reference)
    return colour if distance <= reach else rgb(start + way * (reach / distance))


def _dissimilarity(first: Outfit, second: Outfit) -> float:
    """Smallest of the garments' colour distances, each relative to a clearly different colour."""
    return min(
        _distance(getattr(first, name).colour, getattr(second, name).colour) / distance
        for name, distance in _DISSIMILAR_DISTANCE.items()
    )


def _distance(first: ArrayLike, second: ArrayLike) -> float:
    difference: FloatArray = np.subtract(first, second, dtype=np.float64)
    return float(np.sqrt((difference * difference).sum()))
