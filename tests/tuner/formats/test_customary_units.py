"""Numbers as answers word them: as many digits as stated, also where rounding adds a place, and no 1e+02 %."""

import numpy as np
import pytest

from tuner.formats.customary_units import digits, percent, range_text


@pytest.mark.parametrize(
    ("value", "significant", "text"),
    [
        (9.997, 3, "10.0"),
        (10.0, 3, "10.0"),
        (0.99996, 2, "1.0"),
        (9.99, 3, "9.99"),
        (999999.7, 3, "1.00e+06"),
    ],
)
def test_a_value_that_rounds_up_has_no_digit_too_many(value: float, significant: int, text: str) -> None:
    assert digits(value, significant) == text


@pytest.mark.parametrize(
    ("share", "text"), [(1.0, "100 %"), (0.996, "100 %"), (0.0277, "2.8 %"), (0.005, "0.5 %"), (0.02, "2 %")]
)
def test_a_share_has_no_exponent(share: float, text: str) -> None:
    assert percent(share) == text


def test_a_range_of_numbers_of_numpy_is_said_as_any_other() -> None:
    """`tune` of a log that repeats rows ended in a TypeError."""
    for values in ([-1.0, 2.0], list(np.array([-1.0, 2.0]))):
        assert range_text(values) == "-1.00 to +2.00"
