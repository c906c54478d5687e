"""Telegraph noise has two levels; switching between three is reported without a name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from models.noise import BiasInstability, NoiseModel, RandomWalk, White
from tuner.diagnosis import diagnose
from tuner.diagnosis.static.outcome import TestResult
from tuner.diagnosis.static.search import _settled
from tuner.diagnosis.static.switching.models import STILL, Chain, Slow, likelihood, likelihood_by_start
from tuner.simulation.static import Channel, simulate
from tuner.types.records import Record

NOISE = NoiseModel((White(1e-3), BiasInstability(2e-4), RandomWalk(5e-6)))


def record(levels: tuple[float, ...], seed: int) -> Record:
    """Half an hour at 25 Hz; a bias switches every 40 s on average to another of these levels."""
    clean = simulate({"gyro_x": Channel(NOISE)}, duration=1800.0, rate=25.0, seed=seed)[0][0]
    rng = np.random.default_rng((seed, 1))
    switches = np.cumsum(rng.exponential(40.0, 200))
    ways = np.cumsum(rng.integers(1, len(levels), 201)) % len(levels)
    path = np.array(levels)[ways[np.searchsorted(switches, clean.t - clean.t[0])]]
    return replace(clean, y=clean.y + path[:, None])


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_three_levels_are_reported_without_a_name(seed):
    # hundreds of nats between the two hypotheses
    diagnosis = diagnose(record((-3e-3, 0.0, 3e-3), seed))
    assert not diagnosis.findings
    assert any("more than two levels" in result.statistic for result in diagnosis.unexplained)


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_two_levels_are_telegraph_noise(seed):
    # three levels must be likelier by 3 nats: here they are less likely by ten and more; tens of nats are held out
    diagnosis = diagnose(record((0.0, 3e-3), seed))
    (finding,) = diagnosis.findings
    assert finding.cause == "telegraph"
    assert finding.gain.split == "60/40"
    assert finding.gain.nats > 0
    assert not diagnosis.unexplained


def test_mean_dwells_are_those_of_the_hidden_path():
    """The path is known: the same noise with it and without it. One or two of 31 dwells at each level may be missed.

    The record begins at the level at which it is seldom. A filter that mixed what it knows of the unknown offset over
    both levels gave 29 s and 28 s for dwells of 48 s and 10 s.
    """
    sensor = {"gyro_x": Channel(NOISE)}
    hidden = "telegraph:size=6e-3,dwell_low=40,dwell_high=15"
    (clean,), _ = simulate(sensor, duration=1800.0, rate=20.0, seed=3)
    (made,), _ = simulate(sensor, duration=1800.0, rate=20.0, seed=3, effects=[hidden])
    high = (made.y - clean.y)[:, 0] > 3e-3
    edges = np.flatnonzero(np.diff(high.astype(int), prepend=~high[0], append=~high[-1]))
    dwells, level = np.diff(edges) / 20.0, high[edges[:-1]]
    (finding,) = diagnose(made).findings
    for name, true in (("dwell_low", dwells[~level].mean()), ("dwell_high", dwells[level].mean())):
        assert finding.parameters[name].value == pytest.approx(true, rel=0.15), name


def test_levels_that_are_one_are_none():
    slow = Slow.of((RandomWalk(0.1),), 1.0)
    y = np.cumsum(np.random.default_rng(3).standard_normal(200))
    alone = likelihood(y, STILL, slow, 0.5)
    assert np.isclose(likelihood(y, Chain.two(0.0, 0.1, 0.3), slow, 0.5), alone)
    assert np.isclose(likelihood(y, Chain.even([0.0, 0.0, 0.0], 0.2), slow, 0.5), alone)


@pytest.mark.parametrize("states", [1, 2, 8])
def test_one_level_is_an_offset_with_a_normal_law(states):
    """The likelihood is that of normal numbers whose covariances are those of the states and the white part."""
    rng, phi, q = np.random.default_rng(5), np.linspace(0.9, 0.5, states), np.linspace(0.2, 0.1, states)
    y, path, lag = (
        rng.standard_normal(12),
        np.zeros(12),
        np.abs(np.subtract.outer(np.arange(12), np.arange(12))),
    )
    covariance = 0.5 * np.eye(12) + sum(v / (1.0 - a**2) * a**lag for a, v in zip(phi, q, strict=True))
    exact = multivariate_normal.logpdf(y - 3.0, cov=covariance) + 6.0 * np.log(2.0 * np.pi)
    slow = Slow(phi, q, q / (1.0 - phi**2))
    assert likelihood(y, Chain.even([3.0], 0.0), slow, 0.5, path) == pytest.approx(exact, rel=1e-9)
    assert likelihood_by_start(y, Chain.even([3.0], 0.0), slow, 0.5) == pytest.approx(exact, rel=1e-9)
    assert np.all(path == 3.0)


def test_no_level_is_refused():
    none = Chain(np.empty(0), np.empty(0), np.empty((0, 0)))
    with pytest.raises(ValueError, match=r"^0 levels"):
        likelihood(np.zeros(4), none, Slow.of([RandomWalk(0.1)], 1.0), 1.0)


def test_two_levels_with_even_chances_are_one_chain():
    slow = Slow.of((RandomWalk(0.1),), 1.0)
    y = np.random.default_rng(4).standard_normal(200) + 2.0 * (np.arange(200) // 25 % 2)
    two, even = np.empty(200), np.empty(200)
    values = [
        likelihood(y, chain, slow, 0.5, path)
        for chain, path in ((Chain.two(2.0, 0.1, 0.1), two), (Chain.even([0.0, 2.0], 0.1), even))
    ]
    assert np.isclose(*values)
    assert np.allclose(two, even)


def interacting(y, chain, slow, r):
    """Log likelihood by interacting multiple models with matrices, as Blom and Bar-Shalom (1988) write them."""
    modes, n = len(chain.levels), len(slow.phi)
    s, p = np.zeros((modes, n)), np.stack([np.diag(slow.initial)] * modes)
    chance, total, path = chain.first, 0.0, []
    for t, one in enumerate(y):
        if t:
            joint = chance[:, None] * chain.chances
            chance = joint.sum(axis=0)
            share = joint / chance
            mean = share.T @ s
            off = s[:, None] - mean
            mixed = np.einsum("km,kij->mij", share, p) + np.einsum("km,kmi,kmj->mij", share, off, off)
            s, p = slow.phi * mean, mixed * np.outer(slow.phi, slow.phi) + np.diag(slow.q)
        variance = r[t] + p.sum(axis=(1, 2))
        innovation = one - chain.levels - s.sum(axis=1)
        gain = p.sum(axis=2)
        s = s + gain * (innovation / variance)[:, None]
        p = p - gain[:, :, None] * gain[:, None] / variance[:, None, None]
        density = chance * np.exp(-0.5 * innovation**2 / variance) / np.sqrt(variance)
        total += np.log(density.sum())
        chance = density / density.sum()
        path.append(chance @ chain.levels)
    return total, path


@pytest.mark.parametrize("levels", [(0.0, 2.0), (0.0, 2.0, 4.0), (1.0,)])
@pytest.mark.parametrize("states", [1, 2, 7])
def test_the_filter_is_that_of_interacting_models(levels, states):
    rng = np.random.default_rng([len(levels), states])
    path = np.array(levels)[np.cumsum(rng.random(500) < 0.02) % len(levels)]
    y = path + 0.1 * np.cumsum(rng.standard_normal(500)) + 0.5 * rng.standard_normal(500)
    slow = Slow(np.linspace(1.0, 0.9, states), np.linspace(0.01, 0.05, states), np.linspace(1.0, 0.3, states))
    chain, r, found = Chain.even(levels, 0.02), rng.uniform(0.1, 0.4, 500), np.empty(500)
    value, mean = interacting(y, chain, slow, r)
    assert likelihood(y, chain, slow, r, found) == pytest.approx(value, rel=1e-12)
    np.testing.assert_allclose(found, mean, atol=1e-9)


@pytest.mark.parametrize(("others", "judged"), [({"lowpass": 900.0}, 0), ({"lowpass": 90.0}, 0), ({}, 1)])
def test_a_path_is_judged_closely_only_where_it_may_be_accepted(others, judged):
    """Beside a filter that gains more it waits; a Gauss–Markov process stays behind it meanwhile."""
    calls = []

    def confirm():
        calls.append(1)
        return TestResult("telegraph", 1e-20, -9.0, 30.0, "two levels")

    known = {"gauss_markov": 25.0, **others}
    results = tuple(TestResult(cause, 1e-20, gain, gain, cause, tuple) for cause, gain in known.items())
    unsure = TestResult("telegraph", 1e-20, 30.0, 30.0, "two levels", tuple, confirm=confirm)
    settled = _settled((*results, unsure), 1e-6)
    assert len(calls) == judged
    assert {r.cause: r.gain for r in settled} == {**known, "telegraph": -9.0 if judged else 30.0}
