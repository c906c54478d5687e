"""What a term gives in closed form and what follows from its state space agree, for every registered term."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from models.noise import TERMS, GaussMarkov, Quantization, Sinusoid, Term, White, from_state_space
from models.registry import RegistryError
from models.statespace import StateSpace, discretize, spectrum, stationary_system
from tests.extension.second_order_gauss_markov import SecondOrderGaussMarkov
from tests.models.noise.terms import CONTINUOUS, EXAMPLES, EXPONENTIAL, INTERVAL, RANDOM, named

WITH_STATES = [t for t in CONTINUOUS if t.name not in ("white", "bias_instability")]
TAU = np.array([1.0, 2.0, 7.0, 100.0, 1e5]) * INTERVAL


@pytest.mark.parametrize("interval", [None, INTERVAL])
@pytest.mark.parametrize("term", WITH_STATES, ids=named)
def test_spectrum_and_variances_follow_from_the_state_space(term: Term, interval: float | None) -> None:
    system, f = term.state_space(), np.geomspace(1e-5, 4.9, 40)
    assert system is not None
    expected = term.psd(f, interval=interval)
    np.testing.assert_allclose(from_state_space.power_spectrum(system, f, interval), expected, rtol=1e-9)
    allan = from_state_space.difference_variance(system, TAU, interval, 2)
    np.testing.assert_allclose(allan, term.allan_variance(TAU, interval=interval), rtol=1e-9)
    hadamard = from_state_space.difference_variance(system, TAU, interval, 3)
    np.testing.assert_allclose(hadamard, term.hadamard_variance(TAU, interval=interval), rtol=1e-9)


@pytest.mark.parametrize("term", EXPONENTIAL, ids=named)
def test_autocovariance_is_that_of_the_discrete_states(term: Term) -> None:
    system = term.state_space()
    assert system is not None
    expected = term.autocovariance(np.arange(5) * INTERVAL)
    transition, noise = discretize(system, INTERVAL)
    np.testing.assert_allclose(
        transition @ system.P0 @ transition.T + noise, system.P0, atol=1e-12 * system.P0.max()
    )
    state = system.P0 @ system.H.T
    for value in expected:
        assert float((system.H @ state)[0, 0]) == pytest.approx(value, rel=1e-9, abs=1e-12 * expected[0])
        state = transition @ state
    derived = from_state_space.autocovariance(system, np.arange(5) * INTERVAL)
    np.testing.assert_allclose(derived, expected, rtol=1e-9, atol=1e-12 * expected[0])
    c, p = term.exponentials()
    lag = np.array([0.0, 0.3, 2.0]) / p.real.max()
    powers = np.sum(c[:, None] * np.exp(-p[:, None] * lag), axis=0)
    np.testing.assert_allclose(powers.real, term.autocovariance(lag), rtol=1e-8)
    np.testing.assert_allclose(powers.imag, 0.0, atol=1e-8 * expected[0])


@pytest.mark.parametrize("term", RANDOM, ids=named)
def test_allan_variance_is_the_second_difference_of_the_phase_covariance(term: Term) -> None:
    """var z = 6 c(0) − 8 c(τ) + 2 c(2τ) for the generalised covariance c of the phase."""
    tau = 30.0 * INTERVAL
    smooth, white = term.phase_covariance(np.array([0.0, tau, 2.0 * tau]), tau), term.phase_white_variance()
    interval = INTERVAL if term.name in ("arma", "quantization") else None
    variance = (0.0 if white else float(smooth @ [6.0, -8.0, 2.0])) + 6.0 * white
    assert variance / (2.0 * tau**2) == pytest.approx(
        float(term.allan_variance(tau, interval=interval)), rel=1e-7
    )


@pytest.mark.parametrize("term", WITH_STATES, ids=named)
def test_samples_from_the_state_space_have_the_autocovariance(term: Term) -> None:
    """Means over independent records, at 5 standard errors: 3e-5 in all by chance."""
    system, rng = term.state_space(), np.random.default_rng(11)
    assert system is not None
    assert from_state_space.sample(system, 1, INTERVAL, rng).shape == (1,)
    starts = np.array([from_state_space.sample(system, 4, INTERVAL, rng) for _ in range(4000)])
    if term.name == "random_walk":
        assert np.all(starts[:, 0] == 0.0)
        starts, expected = np.diff(starts), np.array([term.density**2 * INTERVAL, 0.0, 0.0])
    else:
        expected = term.autocovariance(np.arange(3) * INTERVAL)
    for k in range(3):
        products = starts[:, 0] * starts[:, k]
        assert abs(products.mean() - expected[k]) < 5.0 * products.std() / np.sqrt(len(products))


def test_second_order_gauss_markov_has_its_closed_forms() -> None:
    """S = 4σ²T/(1 + (2πfT)²)²; ∫∫ of σ² (1 + |t|/T) e^{−|t|/T} over t is 2σ²T² (2x − 3 + (3 + x) e^{−x}), x = t/T."""
    term, x = SecondOrderGaussMarkov(0.3, 5.0), np.array([0.0, 1.0, 2.0, 8.0])
    f = np.geomspace(1e-3, 3.0, 9)
    np.testing.assert_allclose(
        term.psd(f), 4.0 * 0.09 * 5.0 / (1.0 + (10.0 * np.pi * f) ** 2) ** 2, rtol=1e-12
    )
    np.testing.assert_allclose(term.autocovariance(5.0 * x), 0.09 * (1.0 + x) * np.exp(-x), rtol=1e-12)
    variance = 2.0 * 0.09 * 25.0 * (2.0 * x - 3.0 + (3.0 + x) * np.exp(-x))
    expected = (4.0 * variance[1] - variance[2]) / 50.0
    assert float(term.allan_variance(5.0)) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("time", [1e-3, 36_000.0])
def test_time_constants_of_any_size_keep_their_digits(time: float) -> None:
    unbalanced = stationary_system(
        [[0.0, 1.0], [-(time**-2.0), -2.0 / time]], [[0.0], [1.0]], [[1.0, 0.0]], [[4.0 * time**-3.0]]
    )
    f = np.array([0.01, 1.0, 100.0]) / time
    np.testing.assert_allclose(spectrum(unbalanced, f), SecondOrderGaussMarkov(1.0, time).psd(f), rtol=1e-12)
    assert (unbalanced.H @ unbalanced.P0 @ unbalanced.H.T).item() == pytest.approx(1.0, rel=1e-12)


def test_what_is_not_stationary_has_no_stationary_system() -> None:
    with pytest.raises(ValueError, match="poles in the left half plane"):
        stationary_system([[0.0]], [[1.0]], [[1.0]], [[1.0]])


@pytest.mark.parametrize(
    "kind", [k for k in {type(t): t for t in EXAMPLES} if k.fitted], ids=lambda k: k.name
)
def test_trial_shapes_make_terms(kind: type[Term]) -> None:
    trials = kind.trial_shapes(np.geomspace(1.0, 100.0, 3))
    assert len(trials) == 3 ** (len(kind.PARAMETERS) - 1)
    for shape in trials:
        kind(**dict(zip(kind.PARAMETERS, (1.0, *shape), strict=True)))


def test_the_fastest_time_of_a_term() -> None:
    assert GaussMarkov(1.0, 5.0).fastest_time() == pytest.approx(5.0)
    assert SecondOrderGaussMarkov(1.0, 5.0).fastest_time() == pytest.approx(5.0, rel=1e-6)
    assert (
        White(1.0).fastest_time()
        == Quantization(1.0).fastest_time()
        == Sinusoid(1.0, 1e-3).fastest_time()
        == 0.0
    )


@dataclass(frozen=True)
class Damped(Term):
    """An oscillator with a damping ratio, which is neither a time nor a frequency."""

    sd: float
    damping: float

    name: ClassVar[str] = "damped"
    PARAMETERS: ClassVar[tuple[str, ...]] = ("sd", "damping")
    UNITS: ClassVar[tuple[float | str, ...]] = (0.0, "1")

    def state_space(self) -> StateSpace:
        """Return a decay of 1/s turning at 1 rad/s, whatever the damping."""
        return stationary_system([[-1.0, 1.0], [-1.0, -1.0]], [[1.0], [0.0]], [[1.0, 0.0]], [[self.sd**2]])


def test_what_a_declaration_lacks_is_said_in_one_line() -> None:
    with pytest.raises(
        ValueError, match=r"^noise term 'damped' cannot be fitted: it gives no trial_shapes for 'damping'$"
    ):
        Damped.trial_shapes(np.ones(3))
    empty = type("Empty", (Term,), {"name": "empty", "PARAMETERS": (), "UNITS": ()})
    with pytest.raises(
        RegistryError, match="noise term 'empty': PARAMETERS must name at least the amplitude"
    ):
        TERMS.add(empty)
    silent = type("Silent", (White,), {"name": "silent", "state_space": Term.state_space, "psd": Term.psd})
    with pytest.raises(RegistryError, match="noise term 'silent': it must give state_space, or psd"):
        TERMS.add(silent)
    strange = type("Strange", (White,), {"name": "strange", "PARAMETERS": ("level",)})
    with pytest.raises(RegistryError, match="PARAMETERS must name fields of the dataclass, 'level' is none"):
        TERMS.add(strange)
    short = type("Short", (GaussMarkov,), {"name": "short", "UNITS": (0.0,)})
    with pytest.raises(
        RegistryError, match="UNITS must hold one entry for each of PARAMETERS sd, time_constant"
    ):
        TERMS.add(short)
    with pytest.raises(RegistryError, match="expected a subclass of models"):
        TERMS.add(type("Other", (), {"name": "other"}))
    assert not {"empty", "silent", "strange", "short", "other"} & set(TERMS)
