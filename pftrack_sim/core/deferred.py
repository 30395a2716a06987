"""People who are found when they are first asked for: most of a frame's truth is seldom read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, overload

from pftrack_sim.core.records import Truth


class DeferredPeople(Sequence[Truth]):
    """People in view, the target first; the others are found when any of them, or their number, is first asked for.

    It equals, and is pickled as, the tuple of all.

    Args:
        target: Truth of the target.
        find: Finds the truth of the others; called at most once.
    """

    def __init__(self, target: Truth, find: Callable[[], tuple[Truth, ...]]) -> None:
        self._target, self._find = target, find
        self._found: tuple[Truth, ...] | None = None

    @property
    def everybody(self) -> tuple[Truth, ...]:
        """The target and all others."""
        if self._found is None:
            self._found = (self._target, *self._find())
            del self._find  # With it go the poses of the frame.
        return self._found

    @overload
    def __getitem__(self, index: int) -> Truth: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Truth, ...]: ...

    def __getitem__(self, index: int | slice) -> Truth | tuple[Truth, ...]:
        """The target without finding anybody else; or others."""
        return self._target if index == 0 else self.everybody[index]

    def __len__(self) -> int:
        """Number of people in view."""
        return len(self.everybody)

    def __eq__(self, other: object) -> bool:
        """Equality with any sequence of the same truth."""
        return self.everybody == (other.everybody if isinstance(other, DeferredPeople) else other)

    __hash__ = None  # pyright: ignore[reportAssignmentType]

    def __repr__(self) -> str:
        return repr(self.everybody)

    def __reduce__(self) -> tuple[type[Any], tuple[Any, ...]]:
        return tuple, (self.everybody,)
