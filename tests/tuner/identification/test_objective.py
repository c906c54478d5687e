"""Templates and known power in the likelihood of a record's noise."""

from dataclasses import replace

import numpy as np
import pytest

from models.noise import BiasInstability, GaussMarkov, NoiseModel, RandomWalk, White
from tuner.identification.objective import Objective
from tuner.identification.periodogram import cosine_periodogram

INTERVAL, SAMPLES = 0.1, 4096


def objective(*, restricted=True):
    """White noise, flicker and a Gauss–Markov process beside three templates, two of them nearly alike."""
    rng = np.random.default_rng(2)
    t = np.linspace(-1.0, 1.0, SAMPLES)
    data = cosine_periodogram([rng.standard_normal(SAMPLES) + 0.3 * t], INTERVAL)
    ramp, jump, bend = (cosine_periodogram([y], INTERVAL) for y in (t, 1.0 * (t > 0.2), t + 0.1 * t**2))
    singles = int(np.count_nonzero(data.parity))
    plain = Objective.of(data, ["white", "bias_instability", "gauss_markov"])
    return replace(
        plain,
        columns=np.stack([one.amplitude[:singles] for one in (ramp, jump, bend)], axis=1),
        fixed=0.02 / (1.0 + data.frequency),
        restricted=restricted,
    )


THETA = np.log([0.3, 0.05, 0.1, 20.0])


@pytest.mark.parametrize("restricted", [True, False])
def test_gradient_is_that_of_the_value(restricted):
    one, step = objective(restricted=restricted), 1e-5
    assert one.kinds == (White, BiasInstability, GaussMarkov)
    differences = [
        (one(THETA + step * unit)[0] - one(THETA - step * unit)[0]) / (2.0 * step)
        for unit in np.eye(len(THETA))
    ]
    np.testing.assert_allclose(one(THETA)[1], differences, rtol=1e-6, atol=1e-5)


def test_power_of_a_given_shape_is_known_power_of_its_size():
    one, step = objective(), 1e-5
    shape, theta = one.data.frequency**-0.75, np.append(THETA, -3.0)
    value, gradient, _ = one.with_power(shape)(theta)
    known = replace(one, fixed=one.fixed + np.exp(-3.0) * shape)
    assert value == pytest.approx(known(THETA)[0], rel=1e-12)
    differences = [
        (one.with_power(shape)(theta + step * unit)[0] - one.with_power(shape)(theta - step * unit)[0])
        / (2.0 * step)
        for unit in np.eye(len(theta))
    ]
    np.testing.assert_allclose(gradient, differences, rtol=1e-6, atol=1e-5)


@pytest.mark.parametrize("restricted", [True, False])
def test_what_lies_along_a_template_does_not_count(restricted):
    one = objective(restricted=restricted)
    amplitude = one.data.amplitude.copy()
    amplitude[: len(one.columns)] += one.columns @ [3.0, -2.0, 0.5]
    shifted = replace(one, data=replace(one.data, amplitude=amplitude))
    assert shifted(THETA)[0] == pytest.approx(one(THETA)[0], abs=1e-5)
    # A template is as good as any other that spans the same: the determinant of the change is a constant.
    mixed = replace(one, columns=one.columns @ np.array([[1.0, 0.0, 0.0], [1.0, 2.0, 0.0], [0.0, 1.0, 3.0]]))
    other = THETA + np.array([0.1, -0.2, 0.3, 0.1])
    assert mixed(other)[0] - mixed(THETA)[0] == pytest.approx(one(other)[0] - one(THETA)[0], abs=1e-5)


def test_restored_degrees_of_freedom_are_those_the_templates_cost():
    restricted, plain = objective(), objective(restricted=False)
    expected = plain.expected(THETA)[0]
    lost = plain.excess(expected)[1].sum() - restricted.excess(expected)[1].sum()
    assert lost == pytest.approx(3.0, abs=1e-6)


def test_a_template_of_a_fixed_size_is_that_of_the_best_fit():
    one = objective(restricted=False)
    size = one.sizes(one.expected(THETA)[0])[0]
    assert one.with_size(1, size[1])(THETA)[0] == pytest.approx(one(THETA)[0], abs=1e-6)
    assert one.with_size(1, size[1] + 1.0)(THETA)[0] > one(THETA)[0]


@pytest.mark.parametrize("seed", range(8))
def test_a_grid_of_starts_leads_to_the_maximum_next_to_the_truth(seed):
    rng = np.random.default_rng((77, seed))
    constant, walk = float(np.exp(rng.uniform(1.0, 6.0))), float(np.exp(rng.uniform(-9.0, -5.0)))
    terms = (White(1.0), GaussMarkov(0.3, constant), RandomWalk(walk))
    data = cosine_periodogram([NoiseModel(terms).sample(60_000, INTERVAL, rng)], INTERVAL)
    one = Objective.of(data, ["white", "gauss_markov", "random_walk", "ramp"])
    best = one(one.maximum())[0]
    assert best < one.minimise(np.log([1.0, 0.3, constant, walk]))[1] + 0.01
