"""Likelihood of a linear model against the joint density, finite differences and generalised least squares."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest
from scipy.stats import multivariate_normal

from tests.tuner.diagnosis.drive.replicas import Source
from tuner.diagnosis.drive.linear_model.noise_parameters import noise_parameters
from tuner.diagnosis.drive.linear_model.propagation_kernels import _add_white
from tuner.linear_run.likelihood import (
    NoiseHypothesis,
    as_configured,
    evaluate,
    evaluate_with_gradient,
)
from tuner.linear_run.linearized_run import LinearizedRun
from tuner.types import Parameter

NAMES = (
    "position_horizontal", "position_vertical", "velocity_horizontal", "velocity_vertical", "gyro_white",
    "accel_white", "gyro_bias", "accel_bias", "markov_horizontal", "markov_vertical", "markov_time",
)  # fmt: skip


def cut(linearized: LinearizedRun, k: int) -> LinearizedRun:
    names = ("t", "transition", "H", "innovation", "sd", "reported_sd", "available", "used", "correction",
             "B", "D", "starts", "scored")  # fmt: skip
    parts = {name: getattr(linearized, name)[:k] for name in names}
    return replace(linearized, **parts, noise={g: q[:k] for g, q in linearized.noise.items()})


def holes(linearized: LinearizedRun, rng: np.random.Generator) -> LinearizedRun:
    """Take some rows away, let the filter refuse others, and let it settle in both stretches."""
    k = len(linearized.t)
    available = np.repeat(rng.random((k, 2)) > 0.1, 3, axis=1)
    used = available & np.repeat(rng.random((k, 2)) > 0.1, 3, axis=1)
    scored = (np.arange(k) > 20) & (np.abs(np.arange(k) - 125) > 5)
    return replace(linearized, available=available, used=used, scored=scored)


@pytest.fixture
def drawn(short_drive: LinearizedRun) -> LinearizedRun:
    rng = np.random.default_rng(3)
    return Source.of(as_configured(holes(short_drive, rng))).draw(rng)


def joint(h: NoiseHypothesis) -> float:
    """ln L from the joint covariance of all rows taken; corrections act on the mean."""
    r = h.linearized
    k, n = r.transition.shape[:2]
    e, total, offset = np.eye(n), [r.initial], np.zeros(n)
    rows, means = [], []
    for i in range(k):
        if i and r.starts[i]:
            e[:9] = 0.0
            e = np.hstack([e, np.vstack([np.eye(9), np.zeros((n - 9, 9))])])
            total.append(r.initial[:9, :9])
            offset[:9] = 0.0
        q = sum(f**2 * r.noise[g][i] for f, g in zip(h.process_noise_scale, r.noise, strict=True))
        e = np.hstack([r.transition[i] @ e, np.eye(n)])
        total.append(q)
        offset = r.transition[i] @ offset
        rows.append(r.H[i] @ e)
        means.append(r.H[i] @ offset)
        offset = offset - r.correction[i]
    size = e.shape[1]
    P = np.zeros((size, size))
    at = 0
    for block in total:
        P[at : at + len(block), at : at + len(block)] = block
        at += len(block)
    big = np.vstack([np.hstack([row, np.zeros((6, size - row.shape[1]))]) for row in rows])
    S = big @ P @ big.T + np.diag((h.sd**2).ravel())
    if np.any(h.markov_sd > 0.0):
        decay = np.exp(-np.abs(r.t[:, None] - r.t[None]) / h.markov_time)
        for axis in range(3):
            S[axis::6, axis::6] += h.markov_sd[axis] ** 2 * decay
    root = h.rows.ravel()
    y = (r.innovation - np.array(means)).ravel()
    return float(multivariate_normal.logpdf(y[root], cov=S[np.ix_(root, root)]))


def test_it_is_the_joint_density(drawn: LinearizedRun) -> None:
    small = cut(drawn, 30)
    small = replace(small, starts=small.starts | (np.arange(30) == 17), scored=np.ones(30, dtype=bool))
    h = as_configured(small)
    assert evaluate(h).value == pytest.approx(joint(h), abs=1e-6)
    h = replace(
        noise_parameters(NAMES[:8]).change(h, np.linspace(-0.5, 0.7, 8)),
        markov_sd=np.array([0.5, 0.3, 1.1]),
        markov_time=7.0,
    )
    assert evaluate(h).value == pytest.approx(joint(h), abs=1e-6)


def test_as_configured_the_innovations_are_those_of_the_filter(drawn: LinearizedRun) -> None:
    first = drawn.available[:, 0]
    z = evaluate(as_configured(drawn)).innovation
    np.testing.assert_allclose(z[first, 0], drawn.innovation[first, 0], rtol=0, atol=1e-9)
    alone = drawn.available[:, 3] & ~drawn.used[:, 0]
    np.testing.assert_allclose(z[alone, 3], drawn.innovation[alone, 3], rtol=0, atol=1e-9)


def test_corrections_are_known_inputs(drawn: LinearizedRun) -> None:
    """Another filter on the same trajectory, with the corrections it made, has the same likelihood under any noise."""
    rng = np.random.default_rng(1)
    shift = 0.1 * rng.standard_normal(drawn.correction.shape) * np.sqrt(np.diag(drawn.initial))
    moved = np.zeros_like(drawn.innovation)
    offset = np.zeros(drawn.correction.shape[1])
    for i in range(len(drawn.t)):
        if i and drawn.starts[i]:
            offset[:9] = 0.0
        offset = drawn.transition[i] @ offset
        moved[i] = drawn.H[i] @ offset
        offset = offset - shift[i]
    other = replace(drawn, innovation=drawn.innovation + moved, correction=drawn.correction + shift)
    for logs in (np.zeros(8), np.linspace(-0.4, 0.4, 8)):
        a, b = (
            evaluate(noise_parameters(NAMES[:8]).change(as_configured(r), logs)).value for r in (drawn, other)
        )
        assert a == pytest.approx(b, abs=1e-6)


def test_slopes_are_those_of_differences(drawn: LinearizedRun) -> None:
    h = replace(
        as_configured(drawn), markov_sd=np.array([0.4, 0.4, 0.9]), markov_time=15.0, columns=(0, 1, 2, 6)
    )
    h = noise_parameters(NAMES).change(h, np.linspace(0.3, -0.3, len(NAMES)))
    parameters = noise_parameters(NAMES)
    analytic = parameters.slopes(h, np.zeros(len(NAMES)), evaluate_with_gradient(h)[1])
    step = 1e-4
    for j, unit in enumerate(np.eye(len(NAMES))):
        up, down = (evaluate(noise_parameters(NAMES).change(h, s * step * unit)).value for s in (1.0, -1.0))
        assert analytic[j] == pytest.approx((up - down) / (2.0 * step), rel=1e-4, abs=1e-3)


def _information(h, likelihood):
    """Information of the rows that count about the constants: the sum of s sᵀ / f."""
    s = likelihood.sensitivity[h.counted]
    return s.T @ (s / likelihood.variance[h.counted][:, None])


def test_mean_parameters_are_found(short_drive: LinearizedRun) -> None:
    """Pulls of 20 replicas: the sum of squares of 7 parameters is chi-square with 140 degrees of freedom."""
    theta = np.array([0.05, 0.3, -0.2, 0.5, 0.002, 0.003, -0.004])
    source, pulls = Source.of(as_configured(short_drive)), []
    for seed in range(20):
        h = replace(as_configured(source.draw(np.random.default_rng(seed), theta)), columns=(0, 1, 2, 6))
        likelihood = evaluate(h)
        root = np.linalg.cholesky(_information(h, likelihood))
        pulls.append(root.T @ (likelihood.theta - theta[[0, 1, 2, 6]]))
    square = float(np.sum(np.square(pulls)))
    assert 34.0 < square < 152.0, "80 degrees of freedom, 1e-4 on either side"


def test_innovations_are_white_under_the_true_noise(short_drive: LinearizedRun) -> None:
    h = replace(
        noise_parameters(("position_horizontal", "gyro_white")).change(
            as_configured(short_drive), np.array([0.5, 0.7])
        ),
        markov_sd=np.array([0.5, 0.5, 1.0]),
        markov_time=20.0,
    )
    source, total, lagged, count = Source.of(h), 0.0, 0.0, 0
    for seed in range(20):
        white = evaluate(replace(h, linearized=source.draw(np.random.default_rng(seed)))).white
        total += float(np.sum(white**2))
        lagged += float(np.sum(white[1:] * white[:-1]))
        count += white.size
    assert abs(total - count) < 4.5 * np.sqrt(2.0 * count)
    assert abs(lagged) < 4.5 * np.sqrt(count)


def test_an_impulse_is_scored(drawn: LinearizedRun) -> None:
    """Score and information of a jump of a bias are those of its column by brute force."""
    h = noise_parameters(("gyro_white",)).change(
        as_configured(replace(drawn, scored=drawn.scored | True)), np.array([0.4])
    )
    _, gradient = evaluate_with_gradient(h)
    at, state = 60, 10
    column = np.zeros((*drawn.B.shape[:2], 1))
    column[at + 1] = drawn.transition[at + 1][:, state : state + 1]
    jump = replace(
        h.linearized, B=column, D=np.zeros((*drawn.D.shape[:2], 1)), parameters=(Parameter("bias_jump", "x"),)
    )
    h = replace(h, linearized=jump, columns=(0,))
    likelihood = evaluate(h)
    information = gradient.information[at, state - 9, state - 9]
    assert _information(h, likelihood)[0, 0] == pytest.approx(information, rel=1e-8)
    assert likelihood.theta[0] == pytest.approx(gradient.score[at, state - 9] / information, rel=1e-6)


def test_rounding_does_not_grow(long_drive: LinearizedRun) -> None:
    """Variances as of Joseph's form in extended precision, fixes far better and noise far stronger than configured."""
    sd, drive = long_drive.sd / 100.0, np.full(4, 100.0)
    likelihood = evaluate(replace(as_configured(long_drive), sd=sd, process_noise_scale=drive))
    P, one = long_drive.initial.astype(np.longdouble), np.eye(15, dtype=np.longdouble)
    for i, F in enumerate(long_drive.transition.astype(np.longdouble)):
        P = F @ P @ F.T + sum(drive[j] ** 2 * q[i] for j, q in enumerate(long_drive.noise.values()))
        for row, h in enumerate(long_drive.H[i].astype(np.longdouble)):
            f = h @ P @ h + sd[i, row] ** 2
            assert likelihood.variance[i, row] == pytest.approx(float(f), rel=1e-7)
            L = one - np.outer(P @ h, h) / f
            P = L @ P @ L.T + np.outer(P @ h, P @ h) * (sd[i, row] / f) ** 2


def test_white_noise_of_a_sensor_adds_to_its_own_block_alone():
    """Compiled code checks no bounds: what lies behind an array is not a number here, and must not be met."""

    @numba.njit
    def add(W, at, G, s, density):
        _add_white(W, at, G, s, density)

    G = np.full((12, 6), np.nan)[:9]
    G[:] = np.random.default_rng(8).standard_normal(G.shape)
    W = np.zeros((9, 30))
    add(W, 9, G, 2, 0.5)
    expected = np.zeros_like(W)
    expected[:, 9:18] = 0.5 * np.outer(G[:, 2], G[:, 2])
    np.testing.assert_allclose(W, expected, rtol=1e-14)
