"""Text of targets that are configured by a script: comments and vectors in their language."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def commented(lines: Iterable[str], mark: str) -> str:
    """Return lines as comments behind a mark; line breaks within a line become spaces."""
    return "".join(f"{mark} {' '.join(line.split())}".rstrip() + "\n" for line in lines)


def vector(values: Sequence[float]) -> str:
    """Return ``[a, b, c]``, every number such that it reads back equal."""
    return f"[{', '.join(repr(float(value)) for value in values)}]"


def xml_comment(lines: Iterable[str]) -> str:
    """Return lines as one XML comment, in which two hyphens may not follow each other."""
    remarks = "\n".join(" ".join(line.split()).replace("--", "–") for line in lines)
    return f"<!--\n{remarks}\n-->\n"
