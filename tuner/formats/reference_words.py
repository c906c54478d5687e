"""What is wrong with the reference of a drive, in words: whole for notes, in one line for answers."""

from __future__ import annotations

import re
from collections.abc import Sequence

_WRONG = "the reference is wrong: in"
_TURNS = "the attitude of the reference is wrong: while the vehicle stands it turns,"
_NOTHING_LEFT = "what is left is too short: errors are judged without a reference"


def wrong_times_text(
    seconds: int, size: float, spans: Sequence[tuple[float, float]], *, any_left: bool
) -> str:
    """Return in how many seconds a reference is wrong, by up to how much, m/s, and which spans of it, s, are unused."""
    times = ", ".join(f"{begin:.0f} to {end:.0f} s" for begin, end in spans)
    unused = sum(end - begin for begin, end in spans)
    text = (
        f"{_WRONG} {seconds} seconds its velocity changes by up to {size:.1f} m/s more or less than inertial unit and "
        f"receiver show, which agree with one another; its times {times}, {unused:.0f} s in all, are not used"
    )
    return text if any_left else f"{text}, and {_NOTHING_LEFT}"


def wrong_attitude_text(turns: Sequence[str]) -> str:
    """Return the note on a reference whose attitude rotates while the vehicle stands, by `turns`, a text an axis."""
    return f"{_TURNS} {'; '.join(turns)}: attitudes are not compared with it"


def reference_line(notes: Sequence[str]) -> list[str]:
    """Return in one line what notes say is wrong with a reference, no line where it is right."""
    parts = []
    for note in notes:
        if note.startswith(_WRONG):
            (seconds,) = re.findall(rf"^{_WRONG} (\d+) ", note)
            (unused,) = re.findall(r"(\d+) s in all", note)
            kept = "nothing" if _NOTHING_LEFT in note else f"{unused} s not"
            parts.append(f" in {seconds} s: {kept} judged by it")
    if any(note.startswith(_TURNS) for note in notes):
        parts.append(
            ", attitude not compared"
            if parts
            else ": it turns while the vehicle stands, attitude not compared"
        )
    return [f"Reference wrong{''.join(parts)}"] if parts else []
