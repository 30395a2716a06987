"""Text from outside: exceptions, output and names of third-party code, command lines."""

from __future__ import annotations

LONGEST = 500  # Characters kept of a message


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
