"""Every variant of the compiled filter."""

from __future__ import annotations

from itertools import product

from tuner.navigation.engine.layout import BATCH_SIZE
from tuner.navigation.engine.state import LONG_ROW, SHORT_ROW

UNUSED = (LONG_ROW, 1, True)
"""What no test runs: a filter alone with many states and ideal sensors."""
VARIANTS = tuple(
    one for one in product((LONG_ROW, SHORT_ROW), (BATCH_SIZE, 1), (False, True)) if one != UNUSED
)
"""Room for states, filters, and whether sensors are ideal; those that take longest to compile first."""
