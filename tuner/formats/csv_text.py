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


def as_text(text: object) -> object:
    """Return a name as `no_formula`, and one such as ``+1`` with a quote, too: a spreadsheet shows the number 1."""
    safe = no_formula(text)
    return f"'{safe}" if isinstance(safe, str) and safe.lstrip().startswith(FORMULA) else safe


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
