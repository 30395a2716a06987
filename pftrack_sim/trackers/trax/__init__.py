"""The TraX protocol, in both directions: trackers of other programs here (`client`), ours elsewhere (`server`)."""

import shlex

from pftrack_sim.core.errors import ParameterError

PREFIX = "trax:"
"""Begins the name of a tracker that another program runs; its command follows."""


def words_of(name: str) -> list[str]:
    """The command in a name, split like a shell's; raises ParameterError where it cannot be read."""
    try:
        return shlex.split(name.removeprefix(PREFIX))
    except ValueError as error:
        raise ParameterError(f"tracker {name!r}: the command cannot be read: {error}") from None
