"""Seeds of a plan as ranges: a thousand million of them take no more memory, in a plan or on disk, than three."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.text import one_line

MAX_SEEDS = 10**12
_MAX_DIGITS = 18
_MAX_RANGES = 1_000_000


class Seeds:
    """Distinct seeds in an order, written `0:20,25`.

    Args:
        seeds: Numbers or ranges of them, not negative.

    Raises:
        ValueError: A negative seed, one given twice, or more than `MAX_SEEDS` of them.
    """

    def __init__(self, seeds: Iterable[int | range]) -> None:
        joined: list[range] = []
        for one in seeds:
            part = one if isinstance(one, range) else range(one, one + 1)
            if part.step != 1 or part.start < 0:
                raise ValueError(f"seeds must be >= 0, got {part.start}")
            if joined and joined[-1].stop == part.start:
                joined[-1] = range(joined[-1].start, part.stop)
            elif part:
                joined.append(part)
        self._ranges = tuple(joined)
        count = sum(part.stop - part.start for part in joined)
        if count > MAX_SEEDS or len(joined) > _MAX_RANGES:
            raise ValueError(f"a run has at most {MAX_SEEDS} seeds, got {count}")
        for first, second in pairwise(sorted(joined, key=lambda part: part.start)):
            if second.start < first.stop:
                raise ValueError(f"seed given twice: {second.start}")
        self._count = count

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[int]:
        for part in self._ranges:
            yield from part

    def __getitem__(self, place: int) -> int:
        left = place + self._count if place < 0 else place
        for part in self._ranges if left >= 0 else ():
            if left < len(part):
                return part[left]
            left -= len(part)
        raise IndexError(f"there are {self._count} seeds, got index {place}")

    def place_of(self, seed: int) -> int | None:
        """Index of a seed; None where it is not among them."""
        before = 0
        for part in self._ranges:
            if seed in part:
                return before + seed - part.start
            before += len(part)
        return None

    def without(self, other: Seeds) -> Seeds:
        """These seeds but those of the other."""
        parts: list[range] = []
        for given in self._ranges:
            left = [given]
            for known in other._ranges:
                below = (range(part.start, min(part.stop, known.start)) for part in left)
                above = (range(max(part.start, known.stop), part.stop) for part in left)
                left = sorted((part for part in (*below, *above) if part), key=lambda part: part.start)
            parts += left
        return Seeds(parts)

    def joined(self, other: Seeds) -> Seeds:
        """These seeds, then those of the other that are not among them."""
        return Seeds([*self._ranges, *other.without(self)._ranges])

    def __str__(self) -> str:
        return ",".join(f"{part.start}:{part.stop}" if len(part) > 1 else str(part.start) for part in self._ranges)

    def __repr__(self) -> str:
        return f"Seeds({self})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Seeds) and self._ranges == other._ranges

    def __hash__(self) -> int:
        return hash(self._ranges)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            _validated, serialization=core_schema.to_string_ser_schema()
        )


def _validated(given: object) -> Seeds:
    if isinstance(given, Seeds):
        return given
    if isinstance(given, str):
        try:
            return parse_seeds(given)
        except ParameterError as error:
            raise ValueError(str(error)) from None
    raise ValueError("seeds are a text such as 0:20,25")


def parse_seeds(text: str, *, most: int = MAX_SEEDS) -> Seeds:
    """Parse seeds of the command line: `3`, `0:20` (20 excluded), `1,5,9`, and mixtures.

    Args:
        text: As typed.
        most: Greatest number of them.

    Raises:
        ParameterError: Another form, too many, or one given twice.

    >>> list(parse_seeds("0:3,7")), str(parse_seeds("0,1,2,7"))
    ([0, 1, 2, 7], '0:3,7')
    """
    parts: list[range] = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d+)\s*(?::\s*(\d+)\s*)?", part)
        if match and max(len(number) for number in match.groups() if number) > _MAX_DIGITS:
            raise ParameterError(f"a seed has at most {_MAX_DIGITS} digits")
        if not match or (match[2] is not None and int(match[2]) <= int(match[1])):
            raise ParameterError(f"seeds are written 3, 0:20 (20 excluded) or 1,5,9; got {one_line(text, 60)!r}")
        parts.append(range(int(match[1]), int(match[2] or int(match[1]) + 1)))
    try:
        found = Seeds(parts)
    except ValueError as error:
        raise ParameterError(str(error)) from None
    if len(found) > most:
        raise ParameterError(f"at most {most} seeds here, got {len(found)}")
    return found
