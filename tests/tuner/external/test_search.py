"""The search for the factors of another filter: planted ones are recovered within their intervals."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from tuner.external.innovations import Deviations, without_outliers
from tuner.external.search import MAX_RUNS, Found, search

EPOCHS, DT = 600, 1.0
R, Q, WALK = 0.5, 0.2, 0.02
"""Sd of fixes, m; densities of accelerations, m/s²/√Hz, and of their bias, m/s³/√Hz."""
F = np.array([[1.0, DT, 0.5 * DT**2], [0.0, 1.0, DT], [0.0, 0.0, 1.0]])


def noise(q: float, walk: float) -> np.ndarray:
    white = np.array([[DT**3 / 3.0, DT**2 / 2.0, 0.0], [DT**2 / 2.0, DT, 0.0], [0.0, 0.0, 0.0]])
    return q**2 * white + walk**2 * np.diag([DT**5 / 20.0, DT**3 / 3.0, DT])


def fixes(rng: np.random.Generator) -> np.ndarray:
    """Return position fixes of a body with an accelerometer whose bias walks, shape (n, 3): three axes alike."""
    root = np.linalg.cholesky(noise(Q, WALK))
    x, found = np.zeros((3, 3)), []
    for _ in range(EPOCHS):
        x = F @ x + root @ rng.normal(size=(3, 3))
        found.append(x[0] + R * rng.normal(size=3))
    return np.array(found)


def filtered(data: np.ndarray, q: float, walk: float, r: float) -> Deviations:
    """Return the innovations of a Kalman filter with some settings."""
    x, p = np.zeros((3, 3)), np.diag([1.0, 1.0, 0.1])
    z, s = np.empty((EPOCHS, 3)), np.empty(EPOCHS)
    own = noise(q, walk)
    for k in range(EPOCHS):
        x, p = F @ x, F @ p @ F.T + own
        z[k], s[k] = data[k] - x[0], p[0, 0] + r**2
        gain = p[:, 0] / s[k]
        x, p = x + gain[:, None] * z[k], p - np.outer(gain, p[0])
    return Deviations("innovations", DT * np.arange(EPOCHS), z, s[:, None, None] * np.eye(3))


def tuned(data: np.ndarray, planted: tuple[float, float, float]) -> Found:
    q, walk, r = planted

    def run(factors: Mapping[str, float]) -> Deviations:
        return filtered(
            data,
            Q / q * factors["accelerometer noise"],
            WALK / walk * factors["bias walks"],
            R / r * factors["fix sds"],
        )

    first = run({"accelerometer noise": 1.0, "bias walks": 1.0, "fix sds": 1.0})
    return search(run, first, until=np.inf, progress=lambda _done, _total: None)


def test_planted_factors_are_recovered_within_their_intervals() -> None:
    # Twelve intervals of 95 %: three or fewer miss in 98 of 100 such tests were they exact.
    inside = []
    for seed in range(4):
        found = tuned(fixes(np.random.default_rng(seed)), (3.0, 1.0, 2.0))
        assert found.converged
        assert found.runs <= MAX_RUNS
        for name, true in (("accelerometer noise", 3.0), ("bias walks", 1.0), ("fix sds", 2.0)):
            low, high = found.interval(name)
            inside.append(low < true < high)
            assert np.log(high / low) < 2.5  # told to about a factor of two: the data do speak
        assert found.interval("gyro noise") is None
        assert found.factors["gyro noise"] == 1.0
    assert sum(inside) >= 9


def test_right_settings_stay() -> None:
    found = tuned(fixes(np.random.default_rng(7)), (1.0, 1.0, 1.0))
    for name in ("accelerometer noise", "bias walks", "fix sds"):
        low, high = found.interval(name)
        assert low < 1.05
        assert high > 0.95


def test_a_fix_far_outside_is_left_out_and_no_other() -> None:
    data = fixes(np.random.default_rng(1))
    whole = filtered(data, Q, WALK, R)
    z = whole.z.copy()
    z[100, 1] = 50.0
    left = without_outliers(Deviations(whole.kind, whole.t, z, whole.s))
    assert set(whole.t) - set(left.t) == {100.0}


def test_the_likelihood_is_that_of_a_normal_density() -> None:
    from scipy.stats import multivariate_normal

    rng = np.random.default_rng(2)
    root = rng.normal(size=(3, 3))
    s = root @ root.T + np.eye(3)
    z = rng.normal(size=(5, 3))
    found = Deviations("errors", np.arange(5.0), z, np.tile(s, (5, 1, 1)))
    expected = multivariate_normal(np.zeros(3), s).logpdf(z) + 1.5 * np.log(2.0 * np.pi)
    assert found.log_likelihood() == pytest.approx(expected)
