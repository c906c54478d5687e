"""Where a likelihood falls."""

from __future__ import annotations

import pytest

from models.interval_ends import reach


@pytest.mark.parametrize("first", [0.1, 1.0, 100.0])
def test_the_distances_hold_the_fall_between_them(first):
    near, far = reach(lambda x: x > 1.7, first, 100.0, 6)
    assert near <= 1.7 < far
    assert far - near <= max(far, first) / 64.0 + 1e-12


def test_what_never_falls_is_reached_at_the_end():
    assert reach(lambda _: False, 0.1, 5.0) == (5.0, 5.0)
