"""Temperature profiles, and the thermometer that reads them."""

from __future__ import annotations

import numpy as np
import pytest

from models.effects.static.temperature_profiles import (
    Diurnal,
    Warming,
    thermometer,
)

T = np.arange(0.0, 7200.0, 10.0)


def test_warming():
    curve = Warming(20.0, 8.0, 600.0).celsius(T)
    assert curve[0] == 20.0
    assert curve[60] == pytest.approx(20.0 + 8.0 * (1.0 - np.exp(-1.0)))
    assert curve[-1] == pytest.approx(28.0, abs=1e-3)


def test_diurnal_comes_back_after_a_day():
    day = Diurnal(15.0, 5.0, phase=0.3)
    np.testing.assert_allclose(day.celsius(T + 86400.0), day.celsius(T), atol=1e-9)
    assert day.celsius(np.linspace(0, 86400, 1000)).max() == pytest.approx(20.0, abs=1e-3)


def test_thermometer_reads_multiples_and_holds_them():
    curve = Warming(20.0, 8.0, 600.0).celsius(T)
    read = thermometer(T, curve, step=0.125, refresh=40.0, sd=0.0, rng=np.random.default_rng(0))
    np.testing.assert_array_equal(read / 0.125, np.round(read / 0.125))
    assert len(np.unique(np.flatnonzero(np.diff(read)) % 4)) == 1
    assert np.abs(read - curve).max() < 0.0625 + 40.0 * 8.0 / 600.0
    exact = thermometer(T, curve, step=0.0, refresh=0.0, sd=0.0, rng=np.random.default_rng(0))
    np.testing.assert_array_equal(exact, curve)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Warming(20.0, 1.0, 0.0), "'time_constant' must be positive, got 0.0"),
        (lambda: Diurnal(np.nan, 1.0), "'mean' must be finite, got nan"),
    ],
)
def test_impossible_profiles_are_refused(make, says):
    with pytest.raises(ValueError, match=says):
        make()


def test_a_cycle_begins_at_its_phase():
    """mean + amplitude sin(2πt/period + phase): at 0 and a quarter of a period later."""
    day = Diurnal(15.0, 5.0, period=1000.0, phase=0.3)
    np.testing.assert_allclose(
        day.celsius(np.array([0.0, 250.0])), 15.0 + 5.0 * np.array([np.sin(0.3), np.cos(0.3)])
    )
