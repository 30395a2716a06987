"""What people wear, and how alike two people are dressed.

Likeness is set on the scale on which it is later measured: the Bhattacharyya coefficient of colour histograms. Two
Gaussian colour distributions of spread sigma whose means are D apart have the coefficient exp(-D^2 / (8 sigma^2))
(Bhattacharyya 1943; Kailath 1967), so an outfit of similarity s lies sigma sqrt(8 ln(1/s)) away from its model.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.errors import ParameterError, UnknownNameError
from pftrack_sim.scene.people.anatomy import Colour
from pftrack_sim.scene.people.cloth_texture import woven

Pattern: TypeAlias = Literal["plain", "stripes", "pinstripes", "checks", "print", "block", "dots"]
GARMENTS: tuple[str, ...] = ("top", "bottom", "shoes")

_COLOUR_SPREAD = 13.0
"""Spread of a cloth's pixel values through folds and pattern [8-bit units]."""
_CLEARLY_DIFFERENT = {"top": 110.0, "bottom": 70.0, "shoes": 40.0}
"""Least distance of an unlike outfit's main colours in RGB."""

_TOP_COLOURS: tuple[tuple[Colour, float], ...] = (
    ((32, 33, 37), 1.2),
    ((226, 224, 218), 1.2),
    ((128, 130, 134), 1.0),
    ((34, 47, 88), 1.1),
    ((56, 98, 158), 0.9),
    ((138, 176, 212), 0.7),
    ((176, 36, 40), 1.0),
    ((108, 28, 44), 0.7),
    ((44, 92, 62), 0.8),
    ((104, 110, 66), 0.6),
    ((208, 162, 48), 0.7),
    ((214, 112, 44), 0.6),
    ((206, 188, 156), 0.6),
    ((110, 78, 56), 0.5),
    ((40, 124, 128), 0.6),
    ((206, 126, 148), 0.5),
    ((104, 70, 132), 0.5),
)
_BOTTOM_COLOURS: tuple[tuple[Colour, float], ...] = (
    ((52, 70, 104), 1.6),
    ((88, 112, 146), 0.9),
    ((34, 35, 40), 1.5),
    ((86, 88, 92), 1.0),
    ((158, 142, 112), 1.0),
    ((196, 184, 158), 0.5),
    ((92, 72, 54), 0.6),
    ((76, 82, 60), 0.6),
    ((118, 44, 46), 0.2),
    ((200, 200, 198), 0.3),
)
_SHOE_COLOURS: tuple[tuple[Colour, float], ...] = (
    ((36, 34, 34), 1.5),
    ((92, 60, 38), 1.0),
    ((222, 222, 220), 1.0),
    ((70, 76, 92), 0.6),
    ((150, 40, 42), 0.3),
    ((120, 122, 126), 0.6),
)


@dataclass(frozen=True)
class Garment:
    """One piece of clothing.

    Attributes:
        colour: Main colour.
        accent: Colour of stripes, checks, print or sole.
        pattern: What the accent draws.
        scale_m: Repeat of the pattern [m].
        weave: Seed of folds and of the print's drawing.
    """

    colour: Colour
    accent: Colour
    pattern: Pattern = "plain"
    scale_m: float = 0.06
    weave: int = 0


@dataclass(frozen=True)
class Outfit:
    """A top, something for the legs, and shoes.

    Attributes:
        top: Shirt, pullover or jacket.
        bottom: Trousers or shorts.
        shoes: Shoes; the accent is the sole.
        long_sleeves: Whether the sleeves reach the wrist; else they end above the elbow.
        long_legs: Whether the trousers reach the ankle; else they end above the knee.
        open_front: A row of buttons or a zip runs down the front.
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
    """Everyday clothes."""
    return Outfit(
        top=_sample_garment(
            rng,
            _TOP_COLOURS,
            (("plain", 0.36), ("stripes", 0.17), ("checks", 0.16), ("print", 0.13), ("block", 0.10), ("dots", 0.08)),
            contrast=70.0,
        ),
        bottom=_sample_garment(
            rng, _BOTTOM_COLOURS, (("plain", 0.82), ("pinstripes", 0.10), ("checks", 0.08)), contrast=25.0
        ),
        shoes=_sample_garment(rng, _SHOE_COLOURS, (("plain", 1.0),), contrast=60.0),
        long_sleeves=bool(rng.random() < 0.6),
        long_legs=bool(rng.random() < 0.88),
        open_front=bool(rng.random() < 0.4),
        looseness=float(rng.uniform(0.2, 0.9)),
    )


def similar_outfit(rng: np.random.Generator, to: Outfit, similarity: float) -> Outfit:
    """An outfit like another.

    Draws the same numbers whatever the similarity: outfits of one stream form a path from clothes that are clearly
    different to the same clothes.

    Args:
        rng: Where the unlike outfit at the other end of the path comes from.
        to: The model.
        similarity: 1 for exactly the same clothes, 0 for an independent, clearly different outfit; between them the
            expected Bhattacharyya coefficient of the colour histograms grows steadily.

    Raises:
        ParameterError: The similarity is outside [0, 1].
    """
    if not 0.0 <= similarity <= 1.0:
        raise ParameterError(f"similarity must be in [0, 1], got {similarity}")
    other = max((sample_outfit(rng) for _ in range(12)), key=lambda one: min(_difference(one, to), 1.0))
    coins = rng.random(6)
    if similarity == 1.0:
        return to
    alike = [bool(coin < similarity) for coin in coins]
    return Outfit(
        top=_toward(other.top, to.top, similarity, alike[0]),
        bottom=_toward(other.bottom, to.bottom, similarity, alike[1]),
        shoes=_toward(other.shoes, to.shoes, similarity, True),
        long_sleeves=to.long_sleeves if alike[2] else other.long_sleeves,
        long_legs=to.long_legs if alike[3] else other.long_legs,
        open_front=to.open_front if alike[4] else other.open_front,
        looseness=to.looseness if alike[5] else other.looseness,
    )


def texture(outfit: Outfit, which: str) -> NDArray[np.uint8]:
    """A garment's cloth, laid out flat: columns go around the body (front in the middle), rows go down it.

    Args:
        outfit: What is worn.
        which: `"top"`, `"bottom"` or `"shoes"`.

    Returns:
        `(h, w, 3)` RGB.

    Raises:
        UnknownNameError: There is no such garment.
    """
    if which not in GARMENTS:
        raise UnknownNameError("garment", which, GARMENTS)
    garment: Garment = getattr(outfit, which)
    return woven(
        which,
        garment.colour,
        garment.accent,
        garment.pattern,
        garment.scale_m,
        garment.weave,
        open_front=outfit.open_front and which == "top",
    )


def _sample_garment(
    rng: np.random.Generator,
    colours: tuple[tuple[Colour, float], ...],
    patterns: tuple[tuple[Pattern, float], ...],
    contrast: float,
) -> Garment:
    weights = np.array([weight for _, weight in colours])
    drawn = rng.choice(len(colours), size=8, p=weights / weights.sum())
    tints = rng.normal(0.0, 7.0, (2, 3))
    shares = np.array([share for _, share in patterns])
    pattern = patterns[int(rng.choice(len(patterns), p=shares / shares.sum()))][0]
    scale = float(rng.uniform(0.045, 0.11))
    weave = int(rng.integers(2**31))
    main = np.array(colours[int(drawn[0])][0], dtype=float)
    candidates = [np.array(colours[int(index)][0], dtype=float) for index in drawn[1:]]
    # The first candidate that stands out; patterns nobody can see are no patterns.
    accent = next((one for one in candidates if _distance(one, main) > contrast), _opposite(main))
    return Garment(_colour(main + tints[0]), _colour(accent + tints[1]), pattern, scale, weave)


def _toward(other: Garment, to: Garment, similarity: float, same_pattern: bool) -> Garment:
    reach = np.inf if similarity <= 0.0 else _COLOUR_SPREAD * np.sqrt(8.0 * np.log(1.0 / similarity))
    drawing = to if same_pattern else other
    return Garment(
        colour=_moved(other.colour, to.colour, reach),
        accent=_moved(other.accent, to.accent, reach),
        pattern=drawing.pattern,
        scale_m=drawing.scale_m,
        weave=drawing.weave,
    )


def _moved(other: Colour, to: Colour, reach: float) -> Colour:
    """The colour on the way from `to` towards `other` that is at most `reach` away from `to`."""
    start, end = np.array(to, dtype=float), np.array(other, dtype=float)
    way = end - start
    length = float(np.sqrt((way * way).sum()))
    return _colour(end if length <= reach else start + way * (reach / length))


def _difference(first: Outfit, second: Outfit) -> float:
    """Smallest of the garments' colour distances, each relative to what counts as clearly different."""
    return min(
        _distance(np.array(getattr(first, name).colour, float), np.array(getattr(second, name).colour, float)) / least
        for name, least in _CLEARLY_DIFFERENT.items()
    )


def _distance(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    return float(np.sqrt(((first - second) ** 2).sum()))


def _opposite(colour: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.full(3, 225.0) if colour.mean() < 128 else np.full(3, 35.0)


def _colour(values: NDArray[np.float64]) -> Colour:
    red, green, blue = np.clip(np.rint(values), 0, 255).astype(int).tolist()
    return (red, green, blue)
