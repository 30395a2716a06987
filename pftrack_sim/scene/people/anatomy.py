"""Natural proportions of adults.

Lengths of segments are shares of stature from Drillis and Contini (1966), as drawn in Winter, "Biomechanics and Motor
Control of Human Movement" (2009), figure 4.1; joints lie a little inside the body's landmarks, and shoes add to foot
and ankle. Stature, and how much proportions differ between people, are about those of adults in Gordon et al., "2012
Anthropometric Survey of U.S. Army Personnel" (2014); girths spread as widely as looks natural.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from pftrack_sim.core.errors import ParameterError

Colour: TypeAlias = tuple[int, int, int]
"""RGB, 0..255."""

HairStyle: TypeAlias = Literal["short", "medium", "long", "bun", "cap", "bald"]

_SKINS: tuple[Colour, ...] = (
    (241, 208, 184),
    (232, 190, 160),
    (221, 172, 138),
    (198, 147, 112),
    (168, 118, 84),
    (132, 88, 60),
    (98, 64, 45),
)
_HAIRS: tuple[Colour, ...] = (
    (30, 26, 24),
    (46, 34, 27),
    (74, 50, 34),
    (104, 74, 48),
    (150, 112, 68),
    (186, 152, 98),
    (140, 68, 38),
    (150, 148, 146),
)


@dataclass(frozen=True)
class Anatomy:
    """One person's body, standing in shoes; everything in metres unless the name says otherwise.

    Attributes:
        height_m: Stature: sole to top of the head.
        thigh_m: Hip joint to knee joint.
        shank_m: Knee joint to ankle joint.
        ankle_m: Ankle joint above the sole.
        foot_m: Length of the shoe.
        hip_half_m: Hip joint to the mid-plane.
        pelvis_m: Hip joints up to the waist.
        torso_m: Waist to the base of the neck.
        head_m: Base of the neck to the top of the head.
        shoulder_half_m: Shoulder joint to the mid-plane.
        shoulder_drop_m: Base of the neck above the shoulder joints.
        upper_arm_m: Shoulder joint to elbow joint.
        forearm_m: Elbow joint to wrist.
        hand_m: Wrist to fingertips.
        girth: Thickness of the trunk relative to the average; limbs vary half as much.
        figure: 0 for a broad-shouldered, narrow-hipped figure, 1 for the opposite.
        skin: Skin tone.
        hair: Hair colour.
        hair_style: How the hair is worn; a `"cap"` has the hair colour painted below it.
        beard: Strength of stubble or beard, 0 for none, 1 for a full one.
    """

    height_m: float
    thigh_m: float
    shank_m: float
    ankle_m: float
    foot_m: float
    hip_half_m: float
    pelvis_m: float
    torso_m: float
    head_m: float
    shoulder_half_m: float
    shoulder_drop_m: float
    upper_arm_m: float
    forearm_m: float
    hand_m: float
    girth: float
    figure: float
    skin: Colour
    hair: Colour
    hair_style: HairStyle
    beard: float = 0.0

    @property
    def hip_height_m(self) -> float:
        """Hip joints above the ground with straight legs."""
        return self.thigh_m + self.shank_m + self.ankle_m

    @property
    def sole_m(self) -> tuple[float, float, float, float]:
        """What the shoe rolls on: x of the heel arc's centre, its radius, x of the toe arc's centre, its radius.

        x is measured forward from the ankle; between the two centres the sole is flat.
        """
        return (-0.18 * self.foot_m, 0.10 * self.foot_m, 0.56 * self.foot_m, 0.22 * self.foot_m)


def sample_anatomy(rng: np.random.Generator, height_m: float | None = None) -> Anatomy:
    """A person with natural proportions.

    Args:
        rng: Drawn from the same number of times whatever the arguments, so that height does not change the rest.
        height_m: Stature [m]; None draws one.

    Raises:
        ParameterError: The height is not between 1.2 and 2.3 m.
    """
    if height_m is not None and not 1.2 <= height_m <= 2.3:
        raise ParameterError(f"height_m must be between 1.2 and 2.3 m, got {height_m}")
    feminine = bool(rng.random() < 0.5)
    figure = float(np.clip(rng.normal(0.85 if feminine else 0.1, 0.12), 0.0, 1.0))
    drawn_height = float(np.clip(rng.normal(1.65 if feminine else 1.77, 0.065), 1.48, 2.02))
    spread = np.clip(rng.normal(0.0, 1.0, 12), -2.2, 2.2)
    girth = float(np.clip(rng.normal(1.0, 0.085), 0.88, 1.22))
    tone, shade = rng.random(2)
    skin = _between(_SKINS, tone)
    # Dark skin rarely comes with light hair; the last colour is the grey of age.
    common = (0.22, 0.22, 0.19, 0.13, 0.09, 0.06, 0.03, 0.06) if tone < 0.55 else (0.60, 0.28, 0.04, 0, 0, 0, 0, 0.08)
    hair = _varied(_HAIRS[int(np.searchsorted(np.cumsum(common), 0.999 * shade, side="right"))], rng, 8)
    style_drawn, beard_drawn = rng.random(), rng.random()

    height = drawn_height if height_m is None else float(height_m)
    # The shares add up to 1, so longer legs mean a shorter trunk, as they do in people of one stature.
    legs = 0.535 * (1.0 + 0.013 * spread[0])
    ankle = 0.045
    thigh = (legs - ankle) * 0.5 * (1.0 + 0.012 * spread[1])
    head = 0.163 * (1.0 + 0.025 * spread[2]) * (1.75 / height) ** 0.35
    trunk = 1.0 - legs - head
    arm = 1.0 + 0.02 * spread[3]
    shoulders = (0.107 - 0.008 * figure) * (1.0 + 0.03 * spread[4]) * (1.0 + 0.25 * (girth - 1.0))
    return Anatomy(
        height_m=height,
        thigh_m=height * thigh,
        shank_m=height * (legs - ankle - thigh),
        ankle_m=height * ankle,
        foot_m=height * (0.156 - 0.004 * figure) * (1.0 + 0.02 * spread[5]),
        hip_half_m=height * (0.049 + 0.002 * figure) * (1.0 + 0.03 * spread[6]),
        pelvis_m=height * trunk * 0.246,
        torso_m=height * trunk * 0.754,
        head_m=height * head,
        shoulder_half_m=height * shoulders,
        shoulder_drop_m=height * 0.040 * (1.0 + 0.06 * spread[7]),
        upper_arm_m=height * 0.170 * arm * (1.0 + 0.01 * spread[8]),
        forearm_m=height * 0.146 * arm * (1.0 + 0.01 * spread[9]),
        hand_m=height * 0.105 * (1.0 + 0.02 * spread[10]),
        girth=girth,
        figure=figure,
        skin=skin,
        hair=hair,
        hair_style=_hair_style(feminine, float(style_drawn)),
        beard=0.0 if feminine else float(np.clip(2.2 * beard_drawn - 1.0, 0.0, 1.0)),
    )


def _hair_style(feminine: bool, drawn: float) -> HairStyle:
    styles: tuple[tuple[HairStyle, float], ...] = (
        (("long", 0.42), ("bun", 0.24), ("medium", 0.26), ("short", 0.05), ("cap", 0.03))
        if feminine
        else (("short", 0.66), ("medium", 0.12), ("cap", 0.12), ("bald", 0.10))
    )
    for style, share in styles:
        drawn -= share
        if drawn < 0.0:
            return style
    return styles[0][0]


def _between(colours: tuple[Colour, ...], drawn: float) -> Colour:
    """A colour on the polyline through the given ones."""
    place = float(drawn) * (len(colours) - 1)
    low = min(int(place), len(colours) - 2)
    share = place - low
    first, second = colours[low], colours[low + 1]
    return (
        round(first[0] + share * (second[0] - first[0])),
        round(first[1] + share * (second[1] - first[1])),
        round(first[2] + share * (second[2] - first[2])),
    )


def _varied(colour: Colour, rng: np.random.Generator, spread: int) -> Colour:
    red, green, blue = np.clip(np.array(colour) + rng.integers(-spread, spread + 1), 0, 255).tolist()
    return (red, green, blue)
