"""The likeliest size of a hypothesis and its interval, from deviances that are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from tuner.linear_run.best_size import best_size

GRID = np.linspace(-3.0, 3.0, 9).tolist()


def test_a_parabola_has_its_middle_and_two_standard_errors_to_either_side():
    found = best_size(lambda x: ((x - 0.4) / 0.1) ** 2, GRID)
    assert found.size == pytest.approx(0.4, abs=1e-3)
    assert found.interval() == pytest.approx((0.2, 0.6), abs=0.2 / 30.0)
    assert not found.beyond


def test_the_lowest_of_two_valleys_is_found():
    found = best_size(lambda x: min((x + 2.0) ** 2 + 1.0, (x - 2.1) ** 2), GRID)
    assert found.size == pytest.approx(2.1, abs=1e-3)


def test_a_deviance_that_falls_to_the_end_has_its_size_beyond():
    found = best_size(lambda x: -x, GRID)
    assert found.beyond
    assert found.interval()[1] == found.bounds[1]
