"""Allan and Hadamard variances: textbook sums, exact inputs, gaps, scaling."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tuner.curves import allan_kernels as kernels
from tuner.curves.allan import (
    allan,
    hadamard,
    modified_allan,
    overlapping_allan,
    overlapping_hadamard,
    two_group_allan,
)
from tuner.curves.theo import theo1, theo_br
from tuner.curves.total import total
from tuner.types.records import DataError

SIZES = np.array([1, 2, 3, 7, 16, 60])
SQUARES = [allan, two_group_allan, overlapping_allan, modified_allan, hadamard, overlapping_hadamard, total]
LONG = [theo1, theo_br]
EVERY = [*SQUARES, *LONG]


def sizes_for(statistic):
    return np.array([10, 12, 60, 120]) if statistic in LONG else SIZES


def phase(y):
    return np.concatenate([[0.0], np.cumsum(y)])


def definition(statistic, y, m):
    """Return the textbook sum, written out."""
    x, n = phase(y - y.mean()), len(y)
    if statistic is overlapping_allan:
        return np.mean([(x[i + 2 * m] - 2 * x[i + m] + x[i]) ** 2 for i in range(n + 1 - 2 * m)]) / (2 * m**2)
    if statistic is allan:
        means = y[: n // m * m].reshape(-1, m).mean(axis=1)
        return 0.5 * np.mean(np.diff(means) ** 2)
    if statistic is two_group_allan:
        return 0.5 * (definition(allan, y, m) + definition(allan, y[m // 2 :], m))
    if statistic is modified_allan:
        inner = [
            sum(x[i + 2 * m] - 2 * x[i + m] + x[i] for i in range(j, j + m)) for j in range(n + 1 - 3 * m + 1)
        ]
        return np.mean(np.square(inner)) / (2 * m**4)
    if statistic is hadamard:
        means = y[: n // m * m].reshape(-1, m).mean(axis=1)
        return np.mean(np.diff(means, 2) ** 2) / 6
    if statistic is overlapping_hadamard:
        third = [x[i + 3 * m] - 3 * x[i + 2 * m] + 3 * x[i + m] - x[i] for i in range(n + 1 - 3 * m)]
        return np.mean(np.square(third)) / (6 * m**2)
    extended = {j: x[j] for j in range(n + 1)}
    for j in range(1, n):
        extended[-j] = 2 * x[0] - x[j]
        extended[n + j] = 2 * x[n] - x[n - j]
    squares = [(extended[i - m] - 2 * extended[i] + extended[i + m]) ** 2 for i in range(1, n)]
    return np.mean(squares) / (2 * m**2)


@pytest.mark.parametrize("statistic", SQUARES)
def test_agrees_with_its_definition(statistic):
    y = np.random.default_rng(1).standard_normal(203) + np.linspace(0, 3, 203) ** 2
    expected = [definition(statistic, y, m) for m in SIZES]
    np.testing.assert_allclose(statistic(y, SIZES), expected, rtol=1e-11)


def test_pair_means_halve_the_record():
    """The 2^k form of the papers: halve by pair means, drop an odd last value, and difference."""
    y = np.random.default_rng(2).standard_normal(1003)
    halved, k = y, 0
    while len(halved) >= 2:
        assert allan(y, [2**k])[0] == pytest.approx(0.5 * np.mean(np.diff(halved) ** 2), rel=1e-12)
        halved = halved[: len(halved) // 2 * 2].reshape(-1, 2).mean(axis=1)
        k += 1


@pytest.mark.parametrize("statistic", EVERY)
def test_a_constant_has_none(statistic):
    assert np.all(statistic(np.full(200, 0.1), sizes_for(statistic)) == 0.0)


@pytest.mark.parametrize("statistic", [allan, two_group_allan, overlapping_allan, modified_allan])
def test_a_ramp_shows_half_its_squared_slope(statistic):
    """Exact numbers in, the exact number out: AVAR = a² τ²/2."""
    m = np.array([1, 2, 4, 16, 64])
    np.testing.assert_array_equal(statistic(3.0 * np.arange(257.0), m), 4.5 * m**2)


@pytest.mark.parametrize("statistic", [hadamard, overlapping_hadamard])
def test_hadamard_is_blind_to_a_ramp(statistic):
    np.testing.assert_array_equal(statistic(3.0 * np.arange(257.0), SIZES), 0.0)


@pytest.mark.parametrize("statistic", EVERY)
@settings(max_examples=15, deadline=None)
@given(
    scale=st.floats(1e-6, 1e6),
    offset=st.floats(-10, 10),
    seed=st.integers(0, 1000),
)
def test_scales_as_a_variance_and_ignores_the_mean(statistic, scale, offset, seed):
    y = np.random.default_rng(seed).standard_normal(200)
    m = sizes_for(statistic)
    np.testing.assert_allclose(statistic(scale * (y + offset), m), scale**2 * statistic(y, m), rtol=1e-9)


@pytest.mark.parametrize(
    "statistic", [overlapping_allan, modified_allan, overlapping_hadamard, total, theo1, theo_br]
)
def test_time_reversed_gives_the_same_where_all_positions_count(statistic):
    y = np.cumsum(np.random.default_rng(3).standard_normal(333))
    m = sizes_for(statistic)
    np.testing.assert_allclose(statistic(y[::-1], m), statistic(y, m), rtol=1e-9)


@pytest.mark.parametrize("statistic", EVERY)
def test_columns_stand_alone(statistic):
    y = np.random.default_rng(4).standard_normal((200, 3))
    m = sizes_for(statistic)
    together = statistic(y, m)
    assert together.shape == (m.size, 3)
    for j in range(3):
        np.testing.assert_array_equal(together[:, j], statistic(np.asfortranarray(y)[:, j], m))


def test_order_and_repetition_of_sizes_do_not_matter():
    y = np.random.default_rng(5).standard_normal(500)
    m = np.array([40, 1, 7, 40, 3, 250])
    alone = [overlapping_allan(y, [k])[0] for k in m]
    np.testing.assert_allclose(overlapping_allan(y, m), alone, rtol=1e-13)


def test_two_groups_lie_between_none_and_all():
    y = np.random.default_rng(6).standard_normal(400)
    m = np.array([4, 16])
    np.testing.assert_array_equal(two_group_allan(y, m, offset=0), allan(y, m))
    np.testing.assert_allclose(two_group_allan(y, [1]), allan(y, [1]))
    # all m offsets averaged with the weight of their terms are the overlapping form
    n, k = 400, 8
    terms = np.array([(n - o) // k - 1 for o in range(k)])
    shifted = np.array([allan(y[o:], [k])[0] for o in range(k)])
    assert np.sum(terms * shifted) / terms.sum() == pytest.approx(overlapping_allan(y, [k])[0], rel=1e-12)


def test_long_records_split_among_threads_give_the_same(monkeypatch):
    y = np.random.default_rng(7).standard_normal(700_001)
    m = np.array([1, 2, 5, 100, 4097, 233_333])
    monkeypatch.setattr(kernels, "usable", lambda: 1)
    alone = [s(y, m) for s in (overlapping_allan, overlapping_hadamard, total)]
    monkeypatch.setattr(kernels, "usable", lambda: 3)
    for statistic, expected in zip((overlapping_allan, overlapping_hadamard, total), alone, strict=True):
        np.testing.assert_array_equal(statistic(y, m), expected)


def test_precision_survives_a_large_offset():
    y = np.random.default_rng(8).standard_normal(100_000)
    m = np.array([1, 10, 1000])
    np.testing.assert_allclose(overlapping_allan(y + 1e6, m), overlapping_allan(y, m), rtol=1e-7)


@pytest.mark.parametrize(
    ("statistic", "name"),
    [
        (allan, "adev"),
        (overlapping_allan, "oadev"),
        (modified_allan, "mdev"),
        (hadamard, "hdev"),
        (overlapping_hadamard, "ohdev"),
        (total, "totdev"),
        (theo1, "theo1"),
    ],
)
def test_equals_allantools(statistic, name):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import allantools

        y = np.cumsum(np.random.default_rng(9).standard_normal(400)) + 3.0
        m = np.array([10, 20, 64, 100]) if statistic is theo1 else np.array([1, 2, 5, 32, 100])
        _, deviation, _, _ = getattr(allantools, name)(y, rate=1.0, data_type="freq", taus=m.astype(float))
    np.testing.assert_allclose(np.sqrt(statistic(y, m)), deviation, rtol=1e-9)


@pytest.mark.parametrize(
    ("statistic", "m"),
    [
        (allan, [0]),
        (allan, [51]),
        (overlapping_allan, [51]),
        (overlapping_allan, [1.5]),
        (two_group_allan, [51]),
        (modified_allan, [34]),
        (hadamard, [34]),
        (overlapping_hadamard, [34]),
        (total, [100]),
        (theo1, [8]),
        (theo1, [11]),
        (theo1, [102]),
        (theo_br, [8]),
        (overlapping_allan, [np.nan]),
    ],
)
def test_sizes_out_of_range_are_named(statistic, m):
    with pytest.raises(DataError, match=r"size .*samples"):
        statistic(np.zeros(100) + np.arange(100) % 3, m)
