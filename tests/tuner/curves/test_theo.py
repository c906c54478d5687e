"""Thêo1, ThêoBR and ThêoH: definition, recursion, bias, continuation of the Allan variance."""

import numpy as np
import pytest
from scipy.fft import irfft, rfft

from tuner.curves import allan_kernels as kernels
from tuner.curves import theo
from tuner.curves.allan import overlapping_allan
from tuner.curves.theo import bias_ratio, nearest_theo1_size, theo1, theo1_all, theo_br
from tuner.types.records import DataError


def definition(y, m):
    x = np.concatenate([[0.0], np.cumsum(y)])
    inner = 0.0
    for i in range(len(x) - m):
        for d in range(m // 2):
            z = x[i] - x[i - d + m // 2] + x[i + m] - x[i + d + m // 2]
            inner += z**2 / (m // 2 - d)
    return inner / (0.75 * (len(x) - m) * m**2)


def noises(n, seed):
    white = np.random.default_rng(seed).standard_normal(n)
    return {"quantization": np.diff(white, prepend=0.0), "white": white, "random_walk": np.cumsum(white)}


@pytest.mark.parametrize("kind", ["quantization", "white", "random_walk"])
def test_agrees_with_its_definition(kind):
    y = noises(120, 1)[kind]
    m = np.array([10, 22, 60, 118, 120])
    np.testing.assert_allclose(theo1(y, m), [definition(y, k) for k in m], rtol=1e-11)


@pytest.mark.parametrize(
    ("kind", "tolerance"), [("quantization", 1e-9), ("white", 1e-10), ("random_walk", 1e-6)]
)
def test_recursion_equals_the_direct_sum(kind, tolerance):
    y = noises(5000, 2)[kind]
    every = theo1_all(y, 5000)
    m = np.array([10, 12, 100, 198, 200, 202, 350, 1000, 2500, 4000, 4998, 5000])
    assert every.size == 2496
    np.testing.assert_allclose(every[(m - 10) // 2], theo1(y, m), rtol=tolerance)


def test_recursion_over_m_holds_for_every_size_and_any_origin_of_the_phase():
    """Thêo1 is free of offset and slope of the phase; every size, first phase not zero, last one included."""
    x = np.random.default_rng(9).standard_normal(240) + 3.0 - 0.02 * np.arange(240)
    length = 2 * x.size
    lagged = irfft(np.abs(rfft(x, length)) ** 2, length)
    half = np.arange(2, 120)
    direct = kernels.theo1_sums(x, half, 0, x.size, 64)
    np.testing.assert_allclose(kernels.theo1_sums_all(x, lagged, 2, 120), direct, rtol=1e-9)


def test_white_noise_has_no_bias():
    """E Thêo1(m) = AVAR(0.75 m): the mean of 400 records within 5 of its own standard errors."""
    rng = np.random.default_rng(3)
    m = np.array([10, 40, 200, 400])
    found = np.array([theo1(rng.standard_normal(400), m) * 0.75 * m for _ in range(400)])
    assert np.all(np.abs(found.mean(axis=0) - 1.0) < 5 * found.std(axis=0) / 20)


def exact_mean(kind, m):
    """Return E Thêo1(m) / AVAR(0.75 m) from the generalised covariances of the phase."""
    c = {
        "quantization": lambda t: (t == 0) * 1.0,
        "white": lambda t: -np.abs(t),
        "bias_instability": lambda t: t**2 * np.log(np.maximum(np.abs(t), 1e-300)),
        "random_walk": lambda t: np.abs(t) ** 3,
    }[kind]
    k = m // 2
    d = np.arange(k, dtype=float)
    zero = np.zeros_like(d)
    variance = 4 * c(zero) + 2 * (c(m + zero) + c(2 * d) - 2 * c(k - d) - 2 * c(k + d))
    tau = 0.75 * m
    allan = (6 * c(np.zeros(1)) - 8 * c(np.array([tau])) + 2 * c(np.array([2 * tau])))[0] / (2 * tau**2)
    return np.sum(variance / (k - d)) / (0.75 * m**2) / allan


@pytest.mark.parametrize(
    ("kind", "m", "bias"),
    [
        ("white", 10, 1.0),
        ("white", 1000, 1.0),
        ("bias_instability", 10, 1 / 1.686),
        ("bias_instability", 100, 1 / 1.837),
        ("random_walk", 10, 1 / 2.446),
        ("random_walk", 1000, 1 / 2.700),
        ("quantization", 100, 1 / 0.222),
    ],
)
def test_known_bias_factors(kind, m, bias):
    """The oracle of the next test, against the exact factors AVAR / E Thêo1."""
    assert exact_mean(kind, m) == pytest.approx(bias, rel=3e-3)


def test_random_walk_shows_its_bias():
    rng = np.random.default_rng(4)
    m = 64
    found = np.array([theo1(np.cumsum(rng.standard_normal(1000)), [m])[0] for _ in range(400)])
    # a sampled random walk of unit steps has AVAR (2 m² + 1)/(6 m) at m samples: m/3 at 0.75 m = 48
    expected = exact_mean("random_walk", m) * 48 / 3
    assert abs(found.mean() - expected) < 5 * found.std() / 20 + 0.002 * expected


@pytest.mark.parametrize("kind", ["white", "random_walk"])
def test_theo_br_removes_the_bias(kind):
    """ThêoBR/AVAR at τ = 0.15 T: 1.03 and 1.00 in 400 runs (5 standard errors allowed)."""
    rng = np.random.default_rng(5)
    found = []
    for _ in range(300):
        white = rng.standard_normal(600)
        y = white if kind == "white" else np.cumsum(white)
        tau = 90.0
        found.append(theo_br(y, [120])[0] / (1 / tau if kind == "white" else (2 * tau**2 + 1) / (6 * tau)))
    assert abs(np.mean(found) - (1.03 if kind == "white" else 1.0)) < 5 * np.std(found) / np.sqrt(300)


def test_long_records_are_read_in_clusters(monkeypatch):
    """With the limit lowered the clustered values stay within 1.5 % of the exact ones."""
    for y in (noises(6000, 6)["white"], noises(6000, 6)["random_walk"]):
        exact_ratio = bias_ratio(y)
        with monkeypatch.context() as patch:
            m = np.array([10, 100, 510])
            exact = theo1(y, m)
            patch.setattr(theo, "MAX_EXACT_SAMPLES", 3000)
            np.testing.assert_array_equal(theo1(y, m), exact)
            coarse = nearest_theo1_size(6000, np.array([600.0, 2000.0, 4500.0]))
            clustered = theo1(y, coarse)
            ratio = bias_ratio(y)
        np.testing.assert_allclose(clustered, theo1(y, coarse), rtol=0.015)
        assert ratio == pytest.approx(exact_ratio, rel=0.02)


def test_theo_br_reads_clusters_where_theo1_is_exact():
    """Clusters of 2 samples, and of one where m/2 is odd; 0.1 % of random walk, and what white noise scatters."""
    m = np.array([6000, 6002])
    for y in (noises(30_000, 6)["white"], noises(30_000, 6)["random_walk"]):
        exact = theo1(y, m) * bias_ratio(y)
        found = theo_br(y, m)
        assert found[1] == exact[1]
        assert found[0] != exact[0]
        assert found[0] == pytest.approx(exact[0], rel=2e-3)


@pytest.mark.parametrize("n", [500, 99_999, 1_000_003])
def test_nearest_size_is_near_and_taken(n):
    wanted = np.geomspace(1, n, 200)
    near = nearest_theo1_size(n, wanted)
    assert near.min() == 10
    assert near.max() <= n
    inside = (wanted > 10) & (wanted < n)
    assert np.all(
        np.abs(near / wanted - 1)[inside]
        < np.maximum(1.01 / wanted[inside], 0.0079 if n > theo.MAX_EXACT_SAMPLES else 0.0005)
    )
    np.testing.assert_array_equal(nearest_theo1_size(n, near), near)


def test_clusters_are_explained():
    with pytest.raises(DataError, match="the nearest it takes is 9984"):
        theo1(np.zeros(200_000), [10_002])


def test_theo_br_needs_a_ratio():
    with pytest.raises(DataError, match="at least 89"):
        bias_ratio(np.arange(88.0) % 5)
    assert bias_ratio(np.random.default_rng(7).standard_normal(89)) > 0


def test_ratio_compares_equal_cluster_times():
    """At n = 89 the ratio is the single AVAR(9) / Thêo1(12)."""
    y = np.random.default_rng(8).standard_normal(89)
    assert bias_ratio(y) == pytest.approx(overlapping_allan(y, [9])[0] / theo1(y, [12])[0], rel=1e-12)
