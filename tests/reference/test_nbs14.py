"""NBS14: nine frequencies and the 1000-point congruential set of NIST SP 1065, pages 107-108.

Printed values of SP 1065 and Stable32 (as listed in the test suite of allantools), ThêoBR by this project.
"""

from __future__ import annotations

import numpy as np
import pytest

from tuner.curves.allan import allan, hadamard, modified_allan, overlapping_allan, overlapping_hadamard
from tuner.curves.theo import bias_ratio, theo1, theo_br
from tuner.curves.total import total

NINE = np.array([892.0, 809.0, 823.0, 798.0, 671.0, 644.0, 883.0, 903.0, 677.0])

NINE_PRINTED = [  # τ = 1, 2
    (allan, 91.22945, 115.8082),
    (overlapping_allan, 91.22945, 85.95287),
    (modified_allan, 91.22945, 74.78849),
    (hadamard, 70.80607, 116.7980),
    (overlapping_hadamard, 70.80607, 85.61487),
    (total, 91.22945, 93.90379),
]

THOUSAND_PRINTED = [  # τ = 1, 10, 100
    (allan, 2.922319e-1, 9.965736e-2, 3.897804e-2),
    (overlapping_allan, 2.922319e-1, 9.159953e-2, 3.241343e-2),
    (modified_allan, 2.922319e-1, 6.172376e-2, 2.170921e-2),
    (hadamard, 2.943883e-1, 1.052754e-1, 3.910861e-2),
    (overlapping_hadamard, 2.943883e-1, 9.581083e-2, 3.237638e-2),
    (total, 2.922319e-1, 9.134743e-2, 3.406530e-2),
]

PHASE_DAT = [  # Stable32 on PHASE.DAT, which is this set without its mean
    (
        overlapping_allan,
        [1, 2, 4, 8, 16, 32, 64, 128, 256],
        [
            2.922319e-1,
            2.010160e-1,
            1.447913e-1,
            1.057039e-1,
            6.191478e-2,
            4.808214e-2,
            3.623721e-2,
            2.767386e-2,
            1.028222e-2,
        ],
        7,
    ),
    (
        total,
        [1, 2, 4, 8, 16, 32, 64, 128, 256],
        [
            2.922319e-1,
            2.008851e-1,
            1.444370e-1,
            1.054012e-1,
            6.178820e-2,
            4.857972e-2,
            3.590486e-2,
            3.125892e-2,
            1.336944e-2,
        ],
        7,
    ),
    (
        theo1,
        [10, 20, 40, 100, 202, 400, 998, 1000],
        [1.0757e-1, 7.2762e-2, 4.8652e-2, 3.1789e-2, 2.4120e-2, 1.4321e-2, 5.0234e-3, 5.0524e-3],
        5,
    ),
    (
        theo_br,
        [10, 20, 40, 100, 202, 400, 998],
        [1.120871e-1, 7.581495e-2, 5.069278e-2, 3.312297e-2, 2.513158e-2, 1.492138e-2, 5.234109e-3],
        7,
    ),
]


@pytest.fixture(scope="module")
def thousand():
    """Return the set n_0 = 1234567890, n_{i+1} = 16807 n_i mod (2³¹ - 1), y = n/(2³¹ - 1)."""
    numbers = [1234567890]
    for _ in range(999):
        numbers.append(16807 * numbers[-1] % 2147483647)
    return np.array(numbers) / 2147483647


def half_digit(value, digits):
    return 0.505 * 10.0 ** (np.floor(np.log10(value)) - digits + 1)


@pytest.mark.parametrize(("statistic", "one", "two"), NINE_PRINTED)
def test_nine_points(statistic, one, two):
    printed = np.array([one, two])
    # the last digit of the printed Hadamard values differs by one between editions
    assert np.all(np.abs(np.sqrt(statistic(NINE, [1, 2])) - printed) <= 2 * half_digit(printed, 7))


@pytest.mark.parametrize(("statistic", "one", "ten", "hundred"), THOUSAND_PRINTED)
def test_thousand_points(thousand, statistic, one, ten, hundred):
    printed = np.array([one, ten, hundred])
    assert np.all(np.abs(np.sqrt(statistic(thousand, [1, 10, 100])) - printed) <= half_digit(printed, 7))


@pytest.mark.parametrize(("statistic", "m", "printed", "digits"), PHASE_DAT)
def test_phase_dat(thousand, statistic, m, printed, digits):
    printed = np.array(printed)
    assert np.all(np.abs(np.sqrt(statistic(thousand, m)) - printed) <= half_digit(printed, digits))


def test_ratio_of_theo_br(thousand):
    assert bias_ratio(thousand) == pytest.approx(1.085666384, rel=5e-10)


@pytest.mark.parametrize("reach", [0.1, 0.5])
def test_ratio_follows_the_published_recipe(thousand, reach):
    """q = ⌊N/30 - 3⌋ (Sigma) is reach 0.1, q = ⌊N/6 - 3⌋ (Stable32, on which its Sr87 values rest) is 0.5."""
    steps = np.arange(int(reach * 1001 / 3 - 3) + 1)
    ratios = overlapping_allan(thousand, 9 + 3 * steps) / theo1(thousand, 12 + 4 * steps)
    assert bias_ratio(thousand, reach=reach) == pytest.approx(ratios.mean(), rel=1e-12)
