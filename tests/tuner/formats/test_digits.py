"""Documents carry the digits that an interval supports and two more; rounding again changes nothing."""

from __future__ import annotations

import math
from decimal import Decimal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tuner.formats.customary_units import stamp
from tuner.formats.digits import rounded, rounded_content, rounded_interval

thorough = settings(max_examples=500, deadline=None, derandomize=True)
numbers = st.floats(-1e200, 1e200)
finite = st.tuples(numbers, numbers).map(lambda ends: (min(ends), max(ends)))
intervals = finite | numbers.map(lambda low: (low, math.inf)) | numbers.map(lambda high: (-math.inf, high))


def test_a_time_that_rounds_to_zero_has_no_sign() -> None:
    assert [stamp(time) for time in (-1e-9, -0.0, -2.5, 100120.0)] == ["0", "0", "-2.5", "100120"]


@st.composite
def estimates(draw: st.DrawFn) -> tuple[float, tuple[float, float]]:
    """Return a value within an interval, of any relative width."""
    value = draw(st.floats(1e-12, 1e6))
    width = value * 10.0 ** draw(st.floats(-8.0, 4.0))
    share = draw(st.floats(0.0, 1.0))
    return value, (value - share * width, value + (1.0 - share) * width)


@thorough
@given(estimates())
def test_rounding_moves_a_value_and_its_limits_by_less_than_one_percent_of_the_half_width(
    estimate: tuple[float, tuple[float, float]],
) -> None:
    value, interval = estimate
    half = 0.5 * (interval[1] - interval[0])
    moved = [rounded(value, interval), *rounded_interval(value, interval)]
    slack = 4e-16 * max(abs(value), *map(abs, interval))
    assert all(abs(a - b) < 0.01 * half + slack for a, b in zip(moved, (value, *interval), strict=True))


@thorough
@given(st.none() | numbers, intervals)
def test_rounding_again_changes_nothing(value: float | None, interval: tuple[float, float]) -> None:
    once = rounded_content({"value": value, "interval": list(interval)})
    assert rounded_content(once) == once


@thorough
@given(st.floats(1e-300, 1e300), st.integers(1, 17))
def test_without_an_interval_so_many_significant_digits_stay(value: float, digits: int) -> None:
    found = rounded(value, digits=digits)
    assert found == pytest.approx(value, rel=max(0.5 * 10.0 ** (1 - digits), 0.005) * (1.0 + 1e-9))
    assert len(Decimal(repr(found)).normalize().as_tuple().digits) <= max(digits, 3)
    assert rounded(found, digits=digits) == found


@pytest.mark.parametrize(
    ("value", "interval", "expected"),
    [
        (0.152073421, (0.1504321, 0.1536123), 0.15207),  # half width 1.6e-3: to 1e-5
        (1234567.891, (1.0e6, 1.5e6), 1235000.0),  # half width 2.5e5: to 1e3
        (1.23456789e-9, (0.0, 1e-3), 1.23e-9),  # three digits always stay
        (9.87654321, (9.0, math.inf), 9.877),  # by the finite end, 0.88 away: to 1e-3
        (2.0 / 3.0, (-math.inf, math.inf), 0.666667),
        (2.0 / 3.0, (1.0, 1.0), 0.666667),
    ],
)
def test_digits_by_hand(value: float, interval: tuple[float, float], expected: float) -> None:
    assert rounded(value, interval) == expected


def test_numbers_of_a_tree_are_rounded_and_nothing_else() -> None:
    content = {
        "a": [1.23456789, 7, True, None, "1.23456789"],
        "b": {"value": 1.23456, "interval": [1.0, 1.5]},
    }
    assert rounded_content(content) == {
        "a": [1.23457, 7, True, None, "1.23456789"],
        "b": {"value": 1.235, "interval": [1.0, 1.5]},
    }


def test_coefficients_of_arma_noise_are_written_as_they_are() -> None:
    """A root of 0.99 moves beyond 1 where a coefficient near 2 keeps six digits."""
    numbers = {"arma": [{"ma": [1.99879964, 0.99879994123456789]}], "rate": 0.123456789}
    assert rounded_content(numbers) == numbers | {"rate": 0.123457}
