"""Gain of the findings on the last part of a drive: outages compared in pairs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from tuner.diagnosis.drive import diagnose_drive
from tuner.diagnosis.drive.held_out_gain import change_interval


@pytest.mark.parametrize("windows", [2, 4, 8, 20])
def test_equal_filters_are_seldom_said_to_be_worse(windows):
    """At most 2.5 % of 2000 drives with errors of one distribution before and after: a bound that fails in 1e-5."""
    rng = np.random.default_rng(windows)
    errors = rng.standard_normal((2000, windows, 2)) @ np.linalg.cholesky([[1.0, 0.9], [0.9, 1.0]]).T
    more = rng.standard_normal((2000, windows, 2)) @ np.linalg.cholesky([[1.0, 0.9], [0.9, 1.0]]).T
    worse = sum(
        change_interval(first**2 + second**2)[0] > 0.0 for first, second in zip(errors, more, strict=True)
    )
    assert worse <= binom.isf(1e-5, 2000, 0.025)


def test_twice_the_error_is_worse():
    rng = np.random.default_rng(1)
    first = rng.chisquare(2, 20)
    low, high = change_interval(np.stack([first, 4.0 * first], axis=-1))
    # Squared errors s and 4 s: rms √m and 2 √m; (4 s − s)/(3 √m) has the mean √m and the standard error std/(√20 √m).
    middle = np.sqrt(first.mean())
    assert 0.5 * (low + high) == pytest.approx(middle, rel=1e-9)
    assert 0.5 * (high - low) == pytest.approx(
        2.093 * first.std(ddof=1) / np.sqrt(20.0) / middle, rel=1e-3
    )  # t of 19
    assert low > 0.0


HIDDEN = (
    {"unit": np.repeat([5.0, 1.0], 3)},
    {"fixes": 2.0},
    {"arm": (1.0, -0.6, 0.0)},
    {"lag": 0.15},
    {"values": {"accel_scale.x": 0.012}},
)


@pytest.mark.slow
def test_outages_do_not_grow_by_what_is_named(simulated, drive_config):
    """Of 20 drives few are significantly worse, one-sided 2.5 % for each of two horizons: it fails in 1e-4."""
    worse = 0
    for number in range(20):
        drive = simulated(40 + number, duration=900.0, **HIDDEN[number % len(HIDDEN)])
        figures = diagnose_drive(drive, drive_config).gain.user
        worse += any(figures[name][0] > 0.0 for name in figures if name.endswith("change_interval [m]"))
    assert worse <= binom.isf(1e-4, 20, 0.05)
