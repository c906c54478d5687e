"""State spaces: discretisation, sums, and agreement with the noise terms that they represent."""

from __future__ import annotations

import math

import numpy as np
import pytest

from models.noise import (
    BiasInstability,
    GaussMarkov,
    LowPassWhite,
    NoiseModel,
    Quantization,
    Ramp,
    RandomWalk,
    Sinusoid,
    White,
)
from models.noise.bias_instability import flicker_ladder
from models.statespace import StateSpace, block_sum, discretize, spectrum

STATIONARY = [GaussMarkov(0.3, 5.0), LowPassWhite(0.1, 2.0), LowPassWhite(0.1, 2.0, order=2)]
MODEL = NoiseModel([*STATIONARY, RandomWalk(0.2), White(0.1), Quantization(1e-4)])


def random_system(seed, n=6):
    rng = np.random.default_rng(seed)
    F = rng.normal(size=(n, n)) - 2.0 * np.eye(n)
    G = rng.normal(size=(n, 2))
    return StateSpace(F, G, rng.normal(size=(1, n)), np.diag([0.3, 2.0]), np.eye(n))


@pytest.mark.parametrize("term", [*STATIONARY, RandomWalk(0.2)], ids=lambda t: f"{t.name}-{t.as_dict()}")
def test_spectrum_is_that_of_the_term(term):
    f = np.geomspace(1e-3, 50.0, 20)
    np.testing.assert_allclose(spectrum(term.state_space(), f), term.psd(f), rtol=1e-12)


@pytest.mark.parametrize("term", [*STATIONARY, Sinusoid(0.4, 0.7)], ids=lambda t: f"{t.name}-{t.as_dict()}")
def test_initial_state_is_stationary_and_has_the_autocovariance(term):
    system = term.state_space()
    drift = system.F @ system.P0 + system.P0 @ system.F.T + system.G @ system.Q @ system.G.T
    np.testing.assert_allclose(drift, 0.0, atol=1e-12 * np.abs(system.F @ system.P0).max())
    for lag in (0.0, 0.01, 0.3, 4.0):
        transition, _ = discretize(system, lag)
        covariance = float((system.H @ transition @ system.P0 @ system.H.T)[0, 0])
        expected = float(term.autocovariance(lag))
        assert covariance == pytest.approx(expected, abs=1e-12 * system.P0[0, 0])


def test_sum_of_terms_is_block_sum_of_states():
    f = np.array([0.01, 1.0, 30.0])
    system = MODEL.state_space()
    assert system.size == 5
    np.testing.assert_allclose(
        spectrum(system, f) + MODEL.white_density() ** 2, NoiseModel(MODEL.terms[:-1]).psd(f)
    )
    parts = [t.state_space() for t in MODEL.terms[:4]]
    for step in (0.01, 3.0):
        whole = discretize(system, step)
        separate = [discretize(p, step) for p in parts]
        for i in range(2):
            at = 0
            for part in separate:
                n = part[i].shape[0]
                np.testing.assert_allclose(
                    whole[i][at : at + n, at : at + n], part[i], rtol=1e-10, atol=1e-14
                )
                at += n


@pytest.mark.parametrize("seed", range(5))
def test_steps_compose(seed):
    system, a, b = random_system(seed), 0.3, 1.7
    (phi_a, q_a), (phi_b, q_b), (phi, q) = (discretize(system, step) for step in (a, b, a + b))
    np.testing.assert_allclose(phi_b @ phi_a, phi, atol=1e-12 * np.abs(phi).max())
    np.testing.assert_allclose(phi_b @ q_a @ phi_b.T + q_b, q, atol=1e-12 * np.abs(q).max())


@pytest.mark.parametrize("seed", range(5))
def test_covariance_solves_its_equation(seed):
    system = random_system(seed)
    phi, q = discretize(system, 0.8)
    drive = system.G @ system.Q @ system.G.T
    residual = system.F @ q + q @ system.F.T + drive - phi @ drive @ phi.T
    np.testing.assert_allclose(residual, 0.0, atol=1e-12 * np.abs(drive).max())


@pytest.mark.parametrize("ratio", [1e-6, 1e-2, 1.0, 50.0, 1000.0])
def test_closed_form_of_angle_and_gauss_markov_bias(ratio):
    """A step of a thousand time constants is as exact as a short one."""
    sd, time_constant, density = 0.4, 2.0, 0.1
    step = ratio * time_constant
    system = StateSpace(
        F=np.array([[0.0, 1.0], [0.0, -1.0 / time_constant]]),
        G=np.eye(2),
        H=np.array([[1.0, 0.0]]),
        Q=np.diag([density**2, 2.0 * sd**2 / time_constant]),
        P0=np.zeros((2, 2)),
    )
    phi, q = discretize(system, step)
    lost = -math.expm1(-ratio)
    assert phi[0, 1] == pytest.approx(time_constant * lost, rel=1e-12)
    assert q[1, 1] == pytest.approx(-(sd**2) * math.expm1(-2.0 * ratio), rel=1e-12)
    assert q[0, 1] == pytest.approx(sd**2 * time_constant * lost**2, rel=1e-11)
    series = ratio**3 / 3.0 - ratio**4 / 4.0 + 7.0 * ratio**5 / 60.0
    closed = ratio - 2.0 * lost - 0.5 * math.expm1(-2.0 * ratio)
    angle = 2.0 * sd**2 * time_constant**2 * (series if ratio < 1e-2 else closed)
    assert q[0, 0] - density**2 * step == pytest.approx(angle, rel=1e-7, abs=1e-14 * q[0, 0])


def test_no_step_changes_nothing():
    phi, q = discretize(random_system(0), 0.0)
    np.testing.assert_array_equal(phi, np.eye(6))
    np.testing.assert_array_equal(q, np.zeros((6, 6)))


@pytest.mark.parametrize(("per_decade", "ripple"), [(1.0, 0.021), (2.0, 3e-4)])
def test_ladder_is_flicker_between_its_ends(per_decade, ripple):
    ladder = NoiseModel(flicker_ladder(0.3, 1e-6, 1e9, per_decade=per_decade))
    tau = np.geomspace(0.1, 1e3, 41)
    ratio = ladder.allan_variance(tau) / BiasInstability(0.3).allan_variance(tau)
    np.testing.assert_allclose(ratio, 1.0, atol=ripple)


def test_ladder_rungs():
    ladder = flicker_ladder(1.0, 10.0, 1000.0)
    assert [g.time_constant for g in ladder] == pytest.approx([10.0, 100.0, 1000.0])
    assert [g.sd for g in ladder] == pytest.approx([math.sqrt(math.log(10.0) / math.pi)] * 3)
    assert len(flicker_ladder(1.0, 5.0, 5.0)) == 1


def test_flicker_itself_has_no_states():
    with pytest.raises(ValueError, match="flicker_ladder"):
        (White(1.0) + BiasInstability(1.0)).state_space()


def test_ramp_states_grow_like_the_ramp():
    system = Ramp(0.2).state_space()
    phi, q = discretize(system, 30.0)
    covariance = phi @ system.P0 @ phi.T + q
    assert covariance[0, 0] == pytest.approx((0.2 * 30.0) ** 2)


def test_errors_say_what_was_expected():
    one = np.ones((1, 1))
    with pytest.raises(ValueError, match=r"'G' must have shape \(1, 1\), got \(2, 1\)"):
        StateSpace(one, np.ones((2, 1)), one, one, one)
    with pytest.raises(ValueError, match="'step' must be zero or positive"):
        discretize(RandomWalk(1.0).state_space(), -1.0)
    with pytest.raises(ValueError, match="0 < shortest <= longest"):
        flicker_ladder(1.0, 10.0, 1.0)
    with pytest.raises(ValueError, match="'per_decade' must be positive"):
        flicker_ladder(1.0, 1.0, 10.0, per_decade=0.0)
    with pytest.raises(ValueError, match="at least one system"):
        block_sum()
