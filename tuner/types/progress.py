"""How a long computation says what it is doing: a callback that receives one line at each step."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str], None]


def silent(_message: str) -> None:
    """Take no notice of a message."""
