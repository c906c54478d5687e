"""A run of any number of states, rows and groups of noise has the joint density of its rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from tuner.linear_run.likelihood import NoiseHypothesis, covariances, evaluate, unaided_shift
from tuner.linear_run.linearized_run import LinearizedRun
from tuner.linear_run.whitened_innovations import whiten

K, N, C, M = 5, 4, 3, 2
SCALE = np.array([1.5])
"""Of the first group; the second is as stated."""


@pytest.fixture
def noise():
    rng = np.random.default_rng(4)

    def spread(count, size):
        root = rng.standard_normal((count, size, size))
        return root @ np.swapaxes(root, 1, 2)

    rows, sd = np.ones((K, C), dtype=bool), rng.uniform(0.5, 1.0, (K, C))
    rows[2, 1] = False
    run = LinearizedRun(
        np.arange(K, dtype=float), 0.5 * rng.standard_normal((K, N, N)), {"a": spread(K, N), "b": spread(K, N)},
        rng.standard_normal((K, C, N)), rng.standard_normal((K, C)), sd, sd, rows, rows, np.zeros((K, N)),
        spread(1, N)[0], (), rng.standard_normal((K, N, M)), rng.standard_normal((K, C, M)),
        np.zeros(K, dtype=bool),
    )  # fmt: skip
    return NoiseHypothesis(run, sd, SCALE, rows)


def joint(noise):
    """Covariance and sensitivity of all rows, by a matrix that takes start and noise of all steps to the errors."""
    run, rows = noise.linearized, noise.counted.ravel()
    start = np.eye(N)
    to_errors, push, sources = [], np.zeros((N, M)), [run.initial]
    state = np.hstack([start, np.zeros((N, K * N))])
    shift = []
    for i in range(K):
        state = run.transition[i] @ state
        state[:, N * (i + 1) : N * (i + 2)] = np.eye(N)
        push = run.transition[i] @ push + run.B[i]
        sources.append(SCALE[0] ** 2 * run.noise["a"][i] + run.noise["b"][i])
        to_errors.append(run.H[i] @ state)
        shift.append(run.H[i] @ push + run.D[i])
    big = np.zeros((N * (K + 1), N * (K + 1)))
    for i, source in enumerate(sources):
        big[N * i : N * (i + 1), N * i : N * (i + 1)] = source
    whole = np.concatenate(to_errors)
    covariance = whole @ big @ whole.T + np.diag(noise.sd.ravel() ** 2)
    return covariance[np.ix_(rows, rows)], np.concatenate(shift)[rows]


def test_the_likelihood_is_the_joint_density(noise):
    covariance, _ = joint(noise)
    y = noise.linearized.innovation[noise.counted]
    assert evaluate(noise).value == pytest.approx(multivariate_normal(cov=covariance).logpdf(y))


def test_whitened_rows_have_the_products_of_generalised_least_squares(noise):
    covariance, slope = joint(noise)
    w, y = whiten(noise), noise.linearized.innovation[noise.counted]
    assert w.slope.T @ w.slope == pytest.approx(slope.T @ np.linalg.solve(covariance, slope))
    assert w.slope.T @ w.residual == pytest.approx(slope.T @ np.linalg.solve(covariance, y))
    assert w.logs == pytest.approx(np.linalg.slogdet(2.0 * np.pi * covariance)[1])


def test_constants_shift_rows_as_they_say_where_no_filter_corrects_them(noise):
    _, slope = joint(noise)
    shift = unaided_shift(noise.linearized, range(M), np.array([1.0, -2.0]))
    assert shift[noise.counted] == pytest.approx(slope @ [1.0, -2.0])


def test_the_covariance_after_a_fix_is_that_of_the_information(noise):
    run = noise.linearized
    p = run.initial
    for i, found in enumerate(covariances(noise)):
        p = run.transition[i] @ p @ run.transition[i].T + noise.process_noise[i]
        taken = noise.counted[i]
        h, r = run.H[i][taken], noise.sd[i][taken] ** 2
        p = np.linalg.inv(np.linalg.inv(p) + (h.T / r) @ h)
        assert found == pytest.approx(p)


def test_a_group_without_a_factor_is_as_stated(noise):
    assert noise.factors.tolist() == [SCALE[0] ** 2, 1.0]
    assert replace(noise, process_noise_scale=np.array([1.5, 1.0])).factors.tolist() == [2.25, 1.0]
