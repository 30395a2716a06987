"""Errors of the package.

Every message states what was given, what is allowed, and the nearest valid name. The command line prints the message
and exits with code 2.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence

from pftrack_sim.core.text import printable

_LONGEST_NAME = 200  # Characters of a name for which a similar one is looked up: the search takes the square of them


class PftrackError(Exception):
    """Base of every error that a user's input can cause."""


class UnknownNameError(PftrackError):
    """A name that is not in a registry (scenario, tracker, controller, axis)."""

    def __init__(self, kind: str, given: object, allowed: Iterable[str], hint: str = "") -> None:
        names = sorted(allowed)
        given = printable(given, 200) if isinstance(given, str) else given
        listed = ", ".join(names) if names else "none"
        super().__init__(f"unknown {kind} {given!r}{did_you_mean(str(given), names)} (known: {listed}{hint})")
        self.kind = kind
        self.given = given
        self.allowed = names
        self.hint = hint

    def __reduce__(self) -> tuple[type[UnknownNameError], tuple[str, object, list[str], str]]:
        # Errors cross process boundaries in vector environments: rebuild from the constructor's arguments.
        return (type(self), (self.kind, self.given, self.allowed, self.hint))


class BoxError(PftrackError, ValueError):
    """An invalid box: NaN, infinite, negative size, or not four numbers."""


class ImageError(PftrackError, ValueError):
    """An image that is not `(H, W, 3)` uint8, or that changed its size within a sequence."""


class ParameterError(PftrackError, ValueError):
    """A parameter outside its allowed values."""


class CommandError(PftrackError, ValueError):
    """A robot command that is not four finite numbers."""


class ScenarioError(PftrackError):
    """All problems of one scenario.

    Args:
        source: The scenario's name or path.
        problems: One line each: path of the key, value given, what is allowed, nearest valid key.
    """

    def __init__(self, source: str, problems: Sequence[str]) -> None:
        count = len(problems)
        head = f"{source}: {count} problem{'s' if count != 1 else ''} in this scenario"
        super().__init__("\n".join([head, *(f"  {line}" for line in problems)]))
        self.source = source
        self.problems = tuple(problems)

    def __reduce__(self) -> tuple[type[ScenarioError], tuple[str, tuple[str, ...]]]:
        return (type(self), (self.source, self.problems))


class SequenceError(PftrackError):
    """A recorded sequence that cannot be read: no folder, no images, no truth, counts that differ."""


class RunError(PftrackError):
    """A run folder that cannot be written or read."""


class WorkerError(PftrackError):
    """A process of a vector environment that ended without an answer."""


class RenderError(PftrackError):
    """No renderer works; the message names the remedy for each that was tried."""


class TrackerError(PftrackError):
    """A tracker that cannot be created or used as requested."""


class ControllerError(PftrackError):
    """A controller that cannot be created or used as requested."""


class StudioError(PftrackError):
    """A studio that cannot be opened; the message names the remedy."""


def did_you_mean(given: str, allowed: Iterable[str]) -> str:
    """Suggestion to append to a message; empty when no name is similar.

    >>> did_you_mean("ko2021", ["ko2012", "stay"])
    "; did you mean 'ko2012'?"
    """
    if len(given) > _LONGEST_NAME:
        return ""
    near = difflib.get_close_matches(given, list(allowed), n=1, cutoff=0.6)
    return f"; did you mean {near[0]!r}?" if near else ""
