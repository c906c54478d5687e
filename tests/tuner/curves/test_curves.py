"""Curves of a record: every estimator on white noise, gaps pooled, cluster times."""

import numpy as np
import pytest

from models.noise import NoiseModel, RandomWalk, White
from tuner.curves import ESTIMATORS, curve, dof, empirical, theo
from tuner.curves.allan import overlapping_allan
from tuner.curves.theo import theo_br
from tuner.types import AllanCurve, Correlogram, Spectrum
from tuner.types.records import DataError, Record

EVERY = [*ESTIMATORS, "theoh"]


def record(y, interval=0.01, segments=()):
    y = np.asarray(y, dtype=float).reshape(len(y), -1)
    axes = tuple(f"gyro_{j}" for j in range(y.shape[1]))
    return Record("gyro", interval * np.arange(len(y)), y, axes, "rad/s", interval, segments)


def white(n, columns=1, seed=1):
    return np.random.default_rng(seed).standard_normal((n, columns))


@pytest.mark.parametrize("estimator", EVERY)
def test_white_noise_falls_with_tau(estimator):
    """The mean of 64 records is var · dt/τ within five standard errors, taken from the records themselves."""
    if estimator == "mdev":
        pytest.skip("half the Allan variance for white noise")
    found = curve(record(white(4000, 64)), estimator, noise="white")
    error = found.variance.std(axis=1, ddof=1) / np.sqrt(64)
    truth = 0.01 / found.tau
    bias = 0.03 if estimator in ("theobr", "theoh") else 0.0
    assert np.all(np.abs(found.variance.mean(axis=1) - truth) < 5.0 * error + bias * truth)
    assert found.variance.shape == found.dof.shape == (found.tau.size, 64)
    assert found.estimator == estimator
    assert found.unit == "rad/s"
    assert np.all(np.diff(found.tau) > 0)
    assert 8 <= found.tau.size <= 61


@pytest.mark.parametrize("estimator", EVERY)
def test_one_value_for_each_requested_tau(estimator):
    y = record(white(5000))
    asked = [3.0, 0.3, 12.0, 3.0]
    found = curve(y, estimator, tau=asked)
    assert found.tau == pytest.approx(asked, abs=0.011)
    assert found.variance[0] == found.variance[3]


def test_defaults():
    y = record(white(4096))
    np.testing.assert_allclose(curve(y, "adev").tau, 0.01 * 2.0 ** np.arange(11))
    assert curve(y, "oadev").tau[[0, -1]] == pytest.approx([0.01, 13.65])
    assert curve(y, "theo1").tau[[0, -1]] == pytest.approx([0.075, 0.75 * 40.96])


def test_segments_are_pooled_by_their_terms():
    y = white(3000, seed=2)[:, 0]
    cut = record(y, segments=((0, 1000), (1200, 3000)))
    found = curve(cut, "oadev", tau=[0.1, 6.0], noise="white")
    terms = np.array([[1001 - 20, 1801 - 20], [0, 1801 - 1200]])
    each = np.array([overlapping_allan(y[:1000], [10, 10])[0], overlapping_allan(y[1200:], [10])[0]])
    assert found.variance[0, 0] == pytest.approx(terms[0] @ each / terms[0].sum())
    assert found.variance[1, 0] == pytest.approx(overlapping_allan(y[1200:], [600])[0])
    freedom = dof("oadev", 1000, [10], "white") + dof("oadev", 1800, [10], "white")
    assert found.dof[0, 0] == pytest.approx(freedom[0])


def test_nothing_is_differenced_across_a_gap():
    y = white(4000, seed=3)[:, 0]
    y[2000:] += 1000.0
    joined = curve(record(y), "oadev", tau=[1.0])
    cut = curve(record(y, segments=((0, 2000), (2000, 4000))), "oadev", tau=[1.0])
    assert joined.variance[0, 0] > 1000 * cut.variance[0, 0]


def test_theoh_is_allan_and_then_theobr():
    y = record(white(3000, seed=4))
    found = curve(y, "theoh", tau=[0.05, 2.99, 3.0, 15.0])
    np.testing.assert_allclose(found.variance[:2, 0], overlapping_allan(y.y[:, 0], [5, 299]))
    np.testing.assert_allclose(found.variance[2:, 0], theo_br(y.y[:, 0], [400, 2000]))
    later = curve(y, "theoh", tau=[3.0], switch=0.2)
    np.testing.assert_allclose(later.variance[0, 0], overlapping_allan(y.y[:, 0], [300]))


def test_noise_decides_the_degrees_of_freedom():
    y = record(white(10_000, seed=5))
    tau = [0.1, 1.0, 10.0]
    by_name = curve(y, "oadev", tau=tau, noise="random_walk").dof
    np.testing.assert_allclose(by_name[:, 0], dof("oadev", 10_000, [10, 100, 1000], "random_walk"))
    mixed = curve(y, "oadev", tau=tau, noise=["white", "white", "random_walk"]).dof[:, 0]
    model = curve(y, "oadev", tau=tau, noise=NoiseModel((White(1e-3), RandomWalk(1e-3)))).dof[:, 0]
    found = curve(y, "oadev", tau=tau).dof[:, 0]
    plain = dof("oadev", 10_000, [10, 100, 1000], "white")
    np.testing.assert_allclose(mixed, [plain[0], plain[1], by_name[2, 0]])
    np.testing.assert_allclose(found, plain)
    assert by_name[2, 0] < model[2] < plain[2]


def test_long_records_say_what_was_averaged(monkeypatch):
    y = record(white(4000, seed=6))
    exact = curve(y, "theoh")
    assert exact.notes == ()
    monkeypatch.setattr(theo, "MAX_EXACT_SAMPLES", 2000)
    found = curve(y, "theoh")
    assert found.notes == (
        "Thêo1 from averages of up to 8 samples",
        "bias ratio of ThêoBR from averages of 2 samples",
    )
    assert found.axis("gyro_0").notes == found.notes
    np.testing.assert_allclose(found.variance[-1], exact.variance[-1], rtol=0.1)


@pytest.mark.parametrize("estimator", EVERY)
def test_cluster_times_out_of_range_are_named(estimator):
    y = record(white(1000))
    for tau in (0.001, 20.0, -1.0, float("nan")):
        with pytest.raises(DataError, match=r"at tau .* s: expected .* to .* s"):
            curve(y, estimator, tau=[1.0, tau])


@pytest.mark.parametrize("estimator", EVERY)
def test_records_too_short_are_refused(estimator):
    with pytest.raises(DataError, match=r"expected (a longer record|at least)"):
        curve(record([1.0, 2.0]), estimator)


def test_names():
    y = record(white(300))
    assert isinstance(empirical(y, "oadev", tau=[0.1]), AllanCurve)
    assert isinstance(empirical(y, "psd"), Spectrum)
    assert isinstance(empirical(y, "acf", tau=[0.0, 0.01]), Correlogram)
    assert empirical(y, "pacf").statistic == "pacf"
    with pytest.raises(DataError, match="psd has no cluster times"):
        empirical(y, "psd", tau=[1.0])
    with pytest.raises(ValueError, match="'estimator' must be one of"):
        empirical(y, "allan")
