"""What was assumed of a log, in the words that every answer begins with."""

from __future__ import annotations

import re
from collections.abc import Sequence


def assumed_text(assumptions: Sequence[str]) -> str:
    """Return what nobody stated of a log and was assumed, without what else it might be; empty for nothing."""
    parts = [re.split(r" \(|;", text)[0].replace(" assumed,", ",") for text in dict.fromkeys(assumptions)]
    return f"ASSUMED: {'; '.join(parts)}" if parts else ""
