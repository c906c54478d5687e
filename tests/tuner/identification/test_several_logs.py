"""Several logs of one sensor: coverage and size of the random-effects estimates."""

import numpy as np
import pytest
from scipy.stats import binom

from tuner.identification import identify
from tuner.identification.several_logs import pool, pool_coefficients, random_effects
from tuner.types import Coefficient
from tuner.types.records import DataError, Record


def simulate(rng, spread, sd):
    return 3.0 + spread * rng.standard_normal(sd.size) + sd * rng.standard_normal(sd.size)


def test_equal_sds_give_the_plain_mean():
    result = random_effects([1.0, 2.0, 3.0], [10.0, 10.0, 10.0])
    assert result.mean == pytest.approx(2.0)
    assert result.spread == 0.0
    assert result.mean_interval[1] - 2.0 == pytest.approx(1.959964 * 10 / np.sqrt(3), rel=1e-6)


def test_large_scatter_gives_the_sample_sd():
    y = [1.0, 2.0, 4.0, 8.0, 3.0]
    result = random_effects(y, [1e-6] * 5)
    assert result.spread == pytest.approx(np.std(y, ddof=1), rel=1e-4)
    assert result.p_value < 1e-12


def test_cochrans_test_has_its_size():
    rng = np.random.default_rng(1)
    sd = np.array([0.5, 1.0, 2.0, 1.0])
    alarms = sum(random_effects(simulate(rng, 0.0, sd), sd).p_value < 0.05 for _ in range(1000))
    assert binom.ppf(1e-5, 1000, 0.05) <= alarms <= binom.ppf(1 - 1e-5, 1000, 0.05)


@pytest.mark.parametrize("spread", [0.0, 3.0])
def test_intervals_cover(spread):
    rng = np.random.default_rng(2)
    sd = np.array([0.5, 1.0, 0.8, 1.0, 0.7, 0.6])
    runs = [random_effects(simulate(rng, spread, sd), sd) for _ in range(600)]
    mean_hits = sum(r.mean_interval[0] <= 3.0 <= r.mean_interval[1] for r in runs)
    spread_hits = sum(r.spread_interval[0] <= spread <= r.spread_interval[1] for r in runs)
    # Nominal 95 %: a true rate of 93 % or less would pass with probability below 1e-4 only far from the limit.
    assert mean_hits >= binom.ppf(1e-5, 600, 0.94)
    assert spread_hits >= binom.ppf(1e-5, 600, 0.94)


def test_coefficients_pool_as_logarithms_and_keep_each_value():
    values = [Coefficient.known(v, v / 1.1, v * 1.1, "rad/s/sqrt(Hz)") for v in (1.0, 1.02, 0.97)]
    pooled = pool_coefficients("white.density", [*values, None], logarithmic=True)
    assert pooled is not None
    assert pooled.values == (1.0, 1.02, 0.97, None)
    assert pooled.spread.value is None
    assert pooled.spread.upper is not None
    scaled = [Coefficient.known(7 * v.value, 7 * v.interval[0], 7 * v.interval[1], v.unit) for v in values]
    again = pool_coefficients("white.density", scaled, logarithmic=True)
    assert again is not None
    assert again.value.value == pytest.approx(7 * pooled.value.value)
    assert again.p_value == pytest.approx(pooled.p_value)


def test_two_that_differ_give_their_range_and_no_interval_three_give_one():
    """Student's t on one degree of freedom would say 0.01 … 4 for white noises of 0.187 and 0.233 known to 3 %."""
    values = [Coefficient.known(v, 0.97 * v, 1.03 * v, "rad/s^0.5") for v in (0.187, 0.233, 0.21)]
    two = pool_coefficients("white.density", values[:2], logarithmic=True)
    assert two.value.interval is None
    assert two.spread.interval is None
    assert 0.187 < two.value.value < 0.233
    assert two.values == (0.187, 0.233)
    assert "third" in two.value.reason
    low, high = pool_coefficients("white.density", values, logarithmic=True).value.interval
    assert 0.1 < low < 0.187
    assert 0.233 < high < 0.4
    alike = [Coefficient.known(v, 0.9 * v, 1.1 * v, "rad/s^0.5") for v in (0.2, 0.201)]
    low, high = pool_coefficients("white.density", alike, logarithmic=True).value.interval
    assert 0.18 < low < high < 0.22


def test_too_few_values_are_refused():
    assert pool_coefficients("mean", [None, Coefficient.bounded(1.0, "s", "x")], logarithmic=False) is None
    with pytest.raises(ValueError, match="at least two"):
        random_effects([1.0], [1.0])
    with pytest.raises(ValueError, match="must be positive"):
        random_effects([1.0, 2.0], [1.0, 0.0])


def test_axes_of_a_triad_are_pooled_over_the_records():
    def identified(seed):
        rng = np.random.default_rng(seed)
        y = np.array([1.0, 1.0, 2.0]) * rng.standard_normal((3000, 3))
        axes = ("gyro_x", "gyro_y", "gyro_z")
        return identify([Record("gyro", np.arange(3000) * 0.01, y, axes, "rad/s", 0.01)], arma=None)

    pooled = pool([identified(1), identified(2)])
    triad = {row.name: row for row in pooled["gyro"].coefficients}["white.density"]
    assert triad.values == tuple(
        {row.name: row for row in pooled[axis].coefficients}["white.density"].value.value
        for axis in ("gyro_x", "gyro_y", "gyro_z")
    )
    # Two axes agree, the third is twice as loud: the spread of the logarithms is about ln 2/√3 = 0.40.
    assert triad.p_value < 1e-6
    assert triad.spread.value == pytest.approx(np.log(2) / np.sqrt(3), rel=0.1)


def test_a_bound_that_contradicts_the_pooled_value_is_kept():
    found = [Coefficient.known(v, 0.9 * v, 1.1 * v, "rad/s") for v in (1.0e-5, 1.1e-5)]
    low = pool_coefficients("level", [*found, Coefficient.bounded(3e-6, "rad/s", "absent")], logarithmic=True)
    assert low.value.interval[0] == 3e-6
    assert "1 of 3 allow less than the pooled value: at most 3e-06 rad/s" in low.value.reason
    high = pool_coefficients(
        "level", [*found, Coefficient.bounded(3e-5, "rad/s", "absent")], logarithmic=True
    )
    assert high.value == pool_coefficients("level", found, logarithmic=True).value


def test_one_record_given_twice_is_refused():
    """Pooled with itself its intervals were √2 too narrow."""
    y = np.random.default_rng(7).standard_normal((800, 1))
    one = identify(
        [Record("gyro", np.arange(800.0), y, ("gyro_x",), "rad/s", 1.0)], terms=("white",), arma=None
    )
    with pytest.raises(DataError, match="the same samples twice"):
        pool([one, one])
