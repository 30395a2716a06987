"""What a target wears, and its build."""

from __future__ import annotations

import re
from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator

from pftrack_sim.scenario.section import Section, number, setting


def _colour(text: str) -> str:
    if not re.fullmatch("#[0-9a-fA-F]{6}", text):
        raise ValueError("must be red, green and blue in hexadecimal digits, as '#a03020'")
    return text


Cut: TypeAlias = Literal["shirt", "jacket", "hood"]
HairStyle: TypeAlias = Literal["short", "medium", "long", "curly", "bun", "cap", "beanie", "bald"]
Glasses: TypeAlias = Literal["none", "clear", "dark"]
_Hex = Annotated[str, AfterValidator(_colour)]


class Clothes(Section):
    """How the target looks; what is left out is drawn from the seed."""

    top: _Hex | None = setting(None, "Colour of shirt or jacket, as '#a03020'.")
    bottom: _Hex | None = setting(None, "Colour of the trousers.")
    shoes: _Hex | None = setting(None, "Colour of the shoes.")
    pattern: Literal["plain", "stripes", "checks", "print", "block", "dots"] | None = setting(None, "Of the top.")
    cut: Cut | None = setting(None, "Of the top: with a hood, or a jacket to the hips.")
    long_sleeves: bool | None = setting(None, "Whether sleeves reach the wrists.")
    long_legs: bool | None = setting(None, "Whether trousers reach the ankles.")
    skirt: bool | None = setting(None, "Whether a feminine figure wears a skirt; not where it sits or stoops.")
    hair: HairStyle | None = setting(None, "Hair, or what covers it.")
    glasses: Glasses | None = setting(None, "Glasses; sunglasses are dark.")
    skin: _Hex | None = setting(None, "Colour of the skin.")
    girth: float | None = number(None, 0.85, 1.3, "Thickness of the trunk; 1 is the average.")
