"""Body proportions of adults and children.

Segment lengths are fractions of stature from Drillis and Contini (1966), as drawn in Winter, "Biomechanics and Motor
Control of Human Movement" (2009), figure 4.1; joints lie slightly inside the body's landmarks, and shoes add to foot
and ankle. Stature and the spread of proportions approximate those of adults in Gordon et al., "2012 Anthropometric
Survey of U.S. Army Personnel" (2014); the spread of girths was chosen by eye, and so were a child's larger head and
shorter legs, which a body has in part below 1.48 m and in full from 1 m down.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from pftrack_sim.core.data_files import asset_table
from pftrack_sim.scenario.clothes import Glasses, HairStyle

Colour: TypeAlias = tuple[int, int, int]  # RGB, 0..255

_ADULT_M, _SMALL_M = 1.48, 1.0  # Statures of the smallest adult drawn, and of a child all of whose proportions differ


def rgb(values: Iterable[float]) -> Colour:
    """Colour from three channel values, rounded and clipped to 0..255."""
    red, green, blue = (min(max(round(float(value)), 0), 255) for value in values)
    return (red, green, blue)


@dataclass(frozen=True)
class Anatomy:
    """Body of one person, standing in shoes. Lengths in metres.

    Segments run between joint centres: thigh from hip to knee, shank from knee to ankle, upper arm from shoulder to
    elbow, forearm from elbow to wrist, hand from wrist to fingertips. `ankle_m` is the height of the ankle above the
    sole, `foot_m` the length of the shoe. The pelvis reaches from the hip joints to the waist, the torso from the waist
    to the base of the neck, the head from there to the crown; `shoulder_drop_m` is the height of the base of the neck
    above the shoulder joints. `hip_half_m` and `shoulder_half_m` are distances of the joints from the mid-plane.

    Attributes:
        height_m: Stature: sole to crown.
        girth: Thickness of the trunk relative to the average; limbs vary half as much.
        figure: 0 for broad shoulders and narrow hips, 1 for the opposite.
        hair_style: Style of the hair; below a `"cap"` or `"beanie"` the scalp is painted in the hair colour.
        beard: Strength of the beard, from 0 (none) to 1 (full).
        glasses: Or sunglasses, which are `"dark"`.
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
    glasses: Glasses = "none"

    @property
    def grip_m(self) -> float:
        """From the elbow to what a hand holds."""
        return self.forearm_m + 0.72 * self.hand_m

    @property
    def sole_m(self) -> tuple[float, float, float, float]:
        """Arcs on which the shoe rolls: x of the heel arc's centre, its radius, x of the toe arc's centre, its radius.

        x is measured forward from the ankle; the sole is flat between the two centres.
        """
        return (-0.18 * self.foot_m, 0.10 * self.foot_m, 0.56 * self.foot_m, 0.22 * self.foot_m)


def sample_anatomy(rng: np.random.Generator, height_m: float | None = None) -> Anatomy:
    """Sample a body with natural proportions and this stature; None draws one.

    The number of draws does not depend on the stature, so that it changes no other attribute drawn.
    """
    feminine = bool(rng.random() < 0.5)
    figure = float(np.clip(rng.normal(0.85 if feminine else 0.1, 0.12), 0.0, 1.0))
    drawn_height = float(np.clip(rng.normal(1.65 if feminine else 1.77, 0.065), 1.48, 2.02))
    spread = np.clip(rng.normal(0.0, 1.0, 12), -2.2, 2.2)
    girth = float(np.clip(rng.normal(1.01, 0.11), 0.87, 1.3))
    tone, shade = rng.random(), rng.random()
    colours = asset_table("people")["colours"]
    tones = range(len(colours["skin"]))
    skin = rgb([np.interp(tone * tones[-1], tones, channel) for channel in zip(*colours["skin"], strict=True)])
    # Light hair is rare with dark skin; the last colour is grey.
    shares = (0.22, 0.22, 0.19, 0.13, 0.09, 0.06, 0.03, 0.06) if tone < 0.55 else (0.60, 0.28, 0.04, 0, 0, 0, 0, 0.08)
    index = int(np.count_nonzero(np.cumsum(np.array(shares)) <= 0.999 * shade))
    hair = rgb(np.array(colours["hair"][index]) + rng.integers(-8, 9))
    style_drawn, beard_drawn, glasses_drawn = rng.random(3)

    height = drawn_height if height_m is None else float(height_m)
    young = min(max((_ADULT_M - height) / (_ADULT_M - _SMALL_M), 0.0), 1.0)
    figure *= 1.0 - young
    # The fractions add up to 1: at one stature, longer legs mean a shorter trunk.
    legs = 0.535 * (1.0 + 0.013 * spread[0]) * (1.0 - 0.08 * young)
    ankle = 0.045
    thigh = (legs - ankle) * 0.5 * (1.0 + 0.012 * spread[1])
    head = 0.163 * (1.0 + 0.025 * spread[2]) * (1.75 / height) ** 0.35 * (1.0 + 0.18 * young)
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
        hair_style=_hair_style(feminine or young > 0.0, float(style_drawn)),
        beard=0.0 if feminine or young else float(np.clip(2.2 * beard_drawn - 1.0, 0.0, 1.0)),
        glasses="clear" if glasses_drawn < 0.25 else "dark" if glasses_drawn < 0.32 else "none",
    )


def _hair_style(feminine: bool, drawn: float) -> HairStyle:
    table = asset_table("people")["hair_styles"]
    styles: list[tuple[HairStyle, float]] = table["feminine" if feminine else "masculine"]
    for style, share in styles:
        drawn -= share
        if drawn < 0.0:
            return style
    return styles[0][0]
