"""Text from outside: exceptions, output and names of third-party code, command lines."""

from __future__ import annotations

import os
import sysconfig
from traceback import FrameSummary, StackSummary, extract_tb

LONGEST = 500  # Characters kept of a message
LONGEST_TRACEBACK = 8000  # Characters kept of a traceback

_MOST_FRAMES = 100
_PACKAGE = os.path.dirname(os.path.dirname(os.path.abspath(__file__))) + os.sep
_INSTALLED = tuple(sysconfig.get_path(name) + os.sep for name in ("purelib", "platlib"))
_GENERATED = "<string>"  # by dataclasses
_STANDARD = (_PACKAGE, _GENERATED, sysconfig.get_path("stdlib") + os.sep, "<frozen ")


def printable(text: str, limit: int = LONGEST) -> str:
    r"""Text that can be encoded, shown on a terminal and stored: bounded, without control characters and surrogates.

    Line ends are kept.

    >>> printable("lost \udcff\x1b[2J"), printable("abc" * 9, limit=8)
    ('lost \\udcff\\x1b[2J', 'abcabcab... (19 characters more)')
    """
    shown = "".join(
        character if character.isprintable() or character == "\n" else ascii(character)[1:-1]
        for character in text[:limit]
    )
    return shown if len(text) <= limit else f"{shown}... ({len(text) - limit} characters more)"


def one_line(text: str, limit: int = LONGEST) -> str:
    r"""As `printable`, with spaces for line ends.

    >>> one_line("first\n  second")
    'first second'
    """
    return " ".join(printable(text, limit).split())


def describe_error(error: BaseException) -> str:
    """Type and message of an exception in one line, whatever its `__str__` does.

    >>> describe_error(ValueError("lost"))
    'ValueError: lost'
    """
    try:
        text = str(error)
    except BaseException:  # noqa: BLE001 - the exception's class may be third-party code
        text = "its message cannot be made"
    return one_line(f"{type(error).__name__}: {text}")


def locate_error(error: BaseException) -> str:
    """File, line and function of third-party code in which an exception was raised; empty if none was involved.

    The innermost frame outside this package, Python and installed packages; else that of an installed package.

    >>> try:
    ...     exec(compile("raise ValueError", "/home/me/mine.py", "exec"))
    ... except ValueError as error:
    ...     print(locate_error(error))
     (mine.py, line 1)
    """
    frames = [one for one in _foreign_frames(error) if not _is_standard(one.filename)]
    own = [one for one in frames if not one.filename.startswith(_INSTALLED)] or frames
    if not own:
        return ""
    where = f", in {own[-1].name}" if own[-1].name != "<module>" else ""
    return " " + one_line(f"({os.path.basename(own[-1].filename)}, line {own[-1].lineno}{where})")


def traceback_text(error: BaseException) -> str:
    """Traceback of an exception from the first frame outside this package on, printable and bounded, or empty."""
    frames = _foreign_frames(error)
    if not frames:
        return ""
    text = "".join(["Traceback (most recent call last):\n", *StackSummary.from_list(frames).format()])
    return f"{printable(text, LONGEST_TRACEBACK)}\n{describe_error(error)}"


def _is_standard(file: str) -> bool:
    return file.startswith(_STANDARD) and not file.startswith(_INSTALLED)


def _foreign_frames(error: BaseException) -> list[FrameSummary]:
    """Frames from the first one outside this package on."""
    found = list(extract_tb(error.__traceback__, limit=-_MOST_FRAMES))
    while found and found[0].filename.startswith((_PACKAGE, _GENERATED)):
        del found[0]
    return found
