"""Clothes, and outfits of a given similarity to another.

Similarity is defined on the scale on which it is later measured: the Bhattacharyya coefficient of colour histograms.
Two Gaussian colour distributions of standard deviation sigma whose means are D apart have the coefficient
exp(-D^2 / (8 sigma^2)) (Bhattacharyya 1943; Kailath 1967), so an outfit of similarity s lies sigma sqrt(8 ln(1/s)) away
from the reference.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Literal, TypeAlias

import numpy as np

from pftrack_sim.core.data_files import asset_table
from pftrack_sim.core.random_streams import pick
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.clothes import Clothes, Cut
from pftrack_sim.scene.people.anatomy import Anatomy, Colour, rgb

Pattern: TypeAlias = Literal["plain", "stripes", "pinstripes", "checks", "print", "block", "dots"]

_CUTS: tuple[Cut, ...] = ("shirt", "shirt", "jacket", "hood")

_COLOUR_SIGMA = 13.0  # standard deviation of a cloth's pixel values through folds and pattern [8-bit units]
_CONTRAST = {"top": 70.0, "bottom": 25.0, "shoes": 60.0}  # RGB distance of the accent, for the pattern to be visible
# RGB distance of main colours from which two garments count as clearly different.
_DISSIMILAR_DISTANCE = {"top": 110.0, "bottom": 70.0, "shoes": 40.0}


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
        cut: Of the top; a jacket covers the hips and has a row of buttons or is open, a jumper has a hood.
        skirt: In place of trousers, where the figure is feminine.
        looseness: 0 for tight, 1 for wide.
    """

    top: Garment
    bottom: Garment
    shoes: Garment
    long_sleeves: bool = True
    long_legs: bool = True
    cut: Cut = "shirt"
    looseness: float = 0.5
    skirt: bool = False


def sample_outfit(rng: np.random.Generator) -> Outfit:
    """Sample everyday clothes."""
    garments = [_sample_garment(rng, name) for name in ("top", "bottom", "shoes")]
    cut = pick(rng, _CUTS)
    return Outfit(
        *garments,
        long_sleeves=bool(rng.random() < 0.4) or cut != "shirt",
        long_legs=bool(rng.random() < 0.88),
        cut=cut,
        looseness=float(rng.uniform(0.2, 0.9)),
        skirt=bool(rng.random() < 0.3),
    )


def dressed(outfit: Outfit, clothes: Clothes) -> Outfit:
    """The outfit with what a scenario says of it; a colour of its own is plain unless a pattern is named."""
    garments = {
        name: replace(getattr(outfit, name), colour=_of_hex(colour), pattern="plain")
        for name, colour in (("top", clothes.top), ("bottom", clothes.bottom), ("shoes", clothes.shoes))
        if colour is not None
    }
    if clothes.pattern is not None:
        garments["top"] = replace(garments.get("top", outfit.top), pattern=clothes.pattern)
    cut: dict[str, Any] = {name: getattr(clothes, name) for name in ("cut", "long_sleeves", "long_legs", "skirt")}
    return replace(outfit, **garments, **{name: value for name, value in cut.items() if value is not None})


def groomed(anatomy: Anatomy, clothes: Clothes) -> Anatomy:
    """The body with what a scenario says of its build, skin and hair."""
    said: dict[str, Any] = {"hair_style": clothes.hair, "glasses": clothes.glasses, "girth": clothes.girth}
    if clothes.skin is not None:
        said["skin"] = _of_hex(clothes.skin)
    return replace(anatomy, **{name: value for name, value in said.items() if value is not None})


def _of_hex(colour: str) -> Colour:
    red, green, blue = bytes.fromhex(colour[1:])
    return red, green, blue


def similar_outfit(rng: np.random.Generator, reference: Outfit, similarity: float) -> Outfit:
    """Sample an outfit of a given similarity to another.

    1 gives the same clothes, 0 independent, clearly different ones; in between, the expected Bhattacharyya coefficient
    of the colour histograms grows monotonically. The draws do not depend on the similarity: with the same random
    numbers, outfits form a path from clearly different clothes to the same clothes.
    """
    candidates = [sample_outfit(rng) for _ in range(12)]
    other = max(candidates, key=lambda candidate: min(_dissimilarity(candidate, reference), 1.0))
    draws = rng.random(7)
    if similarity == 1.0:
        return reference
    same_top, same_bottom, *same = [bool(draw < similarity) for draw in draws]
    traits = ("long_sleeves", "long_legs", "cut", "looseness", "skirt")
    kept = {trait: getattr(reference, trait) for trait, is_same in zip(traits, same, strict=True) if is_same}
    garments = {
        name: _similar_garment(getattr(other, name), getattr(reference, name), similarity, same_pattern)
        for name, same_pattern in (("top", same_top), ("bottom", same_bottom), ("shoes", True))
    }
    return replace(other, **garments, **kept)


def _sample_garment(rng: np.random.Generator, name: str) -> Garment:
    """A garment whose accent is the first colour drawn with enough contrast to it, else a light or dark grey."""
    colours, colour_shares, patterns, pattern_shares = _palette(name)
    # Draws as `rng.choice(..., p=...)`, to the bit, in a third of its time.
    indices: list[int] = colour_shares.searchsorted(rng.random(8), side="right").tolist()
    main, *others = (colours[index] for index in indices)
    tints: list[list[float]] = rng.normal(0.0, 7.0, (2, 3)).tolist()
    pattern = patterns[int(pattern_shares.searchsorted(rng.random(), side="right"))]
    scale_m, texture_seed = float(rng.uniform(0.045, 0.11)), int(rng.integers(2**31))
    grey: Colour = (225, 225, 225) if sum(main) < 3 * 128 else (35, 35, 35)
    accent = next((other for other in others if _distance(other, main) > _CONTRAST[name]), grey)
    return Garment(_tinted(main, tints[0]), _tinted(accent, tints[1]), pattern, scale_m, texture_seed)


def _tinted(colour: Colour, tint: Sequence[float]) -> Colour:
    return rgb(channel + shift for channel, shift in zip(colour, tint, strict=True))


@cache
def _palette(name: str) -> tuple[list[Colour], FloatArray, list[Pattern], FloatArray]:
    """Colours and patterns of a kind of garment, each with the cumulative shares in which they are worn."""
    palette = asset_table("people")["garments"][name]
    colours: list[tuple[Colour, float]] = palette["colours"]
    patterns: list[tuple[Pattern, float]] = palette["patterns"]
    cumulative: list[FloatArray] = []
    for table in (colours, patterns):
        weights = np.array([weight for _, weight in table])
        shares = np.cumsum(weights / weights.sum())
        cumulative.append(shares / shares[-1])
    return [colour for colour, _ in colours], cumulative[0], [pattern for pattern, _ in patterns], cumulative[1]


def _similar_garment(other: Garment, reference: Garment, similarity: float, same_pattern: bool) -> Garment:
    reach = np.inf if similarity <= 0.0 else _COLOUR_SIGMA * np.sqrt(8.0 * np.log(1.0 / similarity))
    colour, accent = _limited(other.colour, reference.colour, reach), _limited(other.accent, reference.accent, reach)
    return replace(reference if same_pattern else other, colour=colour, accent=accent)


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


def _distance(first: Colour, second: Colour) -> float:
    red, green, blue = first[0] - second[0], first[1] - second[1], first[2] - second[2]
    return math.sqrt(red * red + green * green + blue * blue)
