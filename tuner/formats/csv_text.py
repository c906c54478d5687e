"""Text of a CSV that a spreadsheet shows as it is."""

from __future__ import annotations

FORMULA = ("=", "+", "-", "@", "\t", "＝", "＋", "－", "＠")
"""How a cell begins that a spreadsheet may evaluate (OWASP, CSV injection)."""


def no_formula(text: object) -> object:
    """Return a text in one line, with a single quote before what a spreadsheet would evaluate; else as it is."""
    if not isinstance(text, str):
        return text
    line = " ".join(text.splitlines())
    if not (line.startswith(FORMULA) or line.lstrip().startswith(FORMULA)) or _is_number(line):
        return line
    return f"'{line}"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
