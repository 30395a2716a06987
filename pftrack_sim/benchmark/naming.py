"""Names as parts of files' names: whatever strangers call their things, nothing leaves the run folder."""

from __future__ import annotations

import re
from collections.abc import Iterable

_LONGEST = 80


def slug(name: str) -> str:
    """A name as part of a file's name: no separators, no surprises; no `=`, which readers take for a partition's key.

    >>> slug("lee2012/db01"), slug("../../etc/x y")
    ('lee2012-db01', 'etc-x-y')
    """
    return re.sub(r"[^A-Za-z0-9._-]+", "-", name)[:_LONGEST].strip("-.") or "unnamed"


def distinct_slugs(names: Iterable[str]) -> dict[str, str]:
    """A slug for each name, no two alike even where upper and lower case are one.

    >>> distinct_slugs(["a/b", "a-b", "A-B"])
    {'a/b': 'a-b', 'a-b': 'a-b-2', 'A-B': 'A-B-3'}
    """
    made: dict[str, str] = {}
    taken: set[str] = set()
    for name in dict.fromkeys(names):
        candidate, count = slug(name), 1
        while candidate.lower() in taken:
            count += 1
            candidate = f"{slug(name)}-{count}"
        taken.add(candidate.lower())
        made[name] = candidate
    return made
