"""The interval of true ÷ predicted error in outages holds the ratio as often as it says, also with few windows."""

from __future__ import annotations

import numpy as np
import pytest

from tuner.consistency.outage_ratio import components, ratio_interval
from tuner.formats.outage_words import is_undecided, outage_words

DRAWS = 600
"""Draws of a coverage: its standard error is 0.9 % at 95 %."""


def test_components_are_those_that_share_the_error():
    shares = np.stack([np.diag(d) for d in ([1.0, 1.0, 1.0], [4.0, 0.0, 0.0], [2.0, 2.0, 0.0])])
    np.testing.assert_allclose(components(shares), [3.0, 1.0, 2.0])


@pytest.mark.parametrize("windows", [2, 4, 12])
@pytest.mark.parametrize("shape", [(1.0, 1.0, 1.0), (1.0, 0.5, 0.0), (1.0, 0.0, 0.0)])
def test_intervals_hold_the_ratio(windows, shape):
    """Normal errors of covariance S, predicted 1.5 times too small: 95 % within four standard errors, or more."""
    rng = np.random.default_rng(windows)
    variances = np.array(shape)
    freedom = float(components(np.diag(variances)))
    held = 0
    for _ in range(DRAWS):
        square = np.sum(variances * rng.standard_normal((windows, 3)) ** 2, axis=1) / variances.sum()
        low, high = ratio_interval(list(1.5**2 * square), freedom)
        held += low <= 1.5 <= high
    assert held / DRAWS >= 0.95 - 0.036


def test_intervals_hold_the_ratio_where_windows_differ():
    """Errors whose sd differs by a factor of e^0.5 from window to window: a χ² of all components holds 77 % of them."""
    rng = np.random.default_rng(8)
    held = 0
    for _ in range(DRAWS):
        sizes = np.exp(0.5 * rng.standard_normal(5) - 0.25)
        square = np.mean((sizes[:, None] * rng.standard_normal((5, 2))) ** 2, axis=1)
        low, high = ratio_interval(list(square), 2.0)
        held += low <= 1.0 <= high
    assert held / DRAWS >= 0.85


def test_more_windows_tell_more():
    widths = [np.diff(np.log(ratio_interval([1.0] * n, 2.0)))[0] for n in (2, 4, 8, 16)]
    assert widths == sorted(widths, reverse=True)


def test_few_windows_say_that_they_cannot_tell():
    assert is_undecided(1.6, (0.9, 2.4))
    assert not is_undecided(1.6, (1.1, 2.4))
    assert not is_undecided(1.2, (0.7, 2.4))
    text = outage_words(60.0, 12.0, 8.0, 1.6, (0.9, 2.4), 5)
    assert (
        text
        == "60 s: true 12.0 m, predicted 8.00 m (ratio 1.6, 0.90 … 2.4 with 5 windows: 5 cannot tell it from 1)"
    )
