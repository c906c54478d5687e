"""Text from outside as one printable line: no line breaks, escape sequences or halves of characters."""

from __future__ import annotations

LONGEST_LINE = 1000
"""Characters of a message: a terminal's screen is some 4000."""


def printable(text: str, *, longest: int = LONGEST_LINE) -> str:
    """Return text as one line without control characters, escape sequences and halves of characters.

    White space becomes single blanks; the middle of what is longer than `longest` is left out.
    """
    clean = "".join(
        c if c.isprintable() else " " if c.isspace() else "\N{REPLACEMENT CHARACTER}" for c in text
    )
    line = " ".join(clean.split())
    if len(line) <= longest:
        return line
    head = longest * 2 // 3
    return f"{line[:head]} … {line[len(line) - (longest - head) :]}"
