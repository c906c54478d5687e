"""Bias states: flicker ladder, single states, the bounding state, process noise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from models.noise import BiasInstability, GaussMarkov
from models.statespace import discretize
from tuner.synthesis import (
    RULES,
    axis_states,
    axis_system,
    bounding_state,
)
from tuner.synthesis.bias_states import FlickerView, spectrum_bound
from tuner.types import ChannelNoise

VIEW = FlickerView(
    level=2.4e-5, density=4.4e-5, minimum=1.6e-5, minimum_tau=600.0, horizon=1000.0, interval=0.01
)


def channel(**changes: object) -> ChannelNoise:
    settings = {
        "white_density": 1e-4,
        "markov": (),
        "random_walk_density": 0.0,
        "constant_sd": 1e-3,
    } | changes
    return ChannelNoise("gyro_x", "rad/s", **settings)  # type: ignore[arg-type]


def test_ladder_spans_corner_to_horizon_with_equal_sds() -> None:
    states = RULES["ladder"].states(VIEW)
    times = np.array([s.time_constant for s in states])
    assert times[-1] == pytest.approx(VIEW.horizon)
    assert times[1:] / times[:-1] == pytest.approx(10.0)
    assert VIEW.corner / 5.0 <= times[0] <= 2.0 * VIEW.corner
    assert [s.sd for s in states] == pytest.approx(
        [math.sqrt(math.log(10.0) / math.pi) * VIEW.level] * len(states)
    )


def test_ladder_has_the_allan_floor_of_flicker() -> None:
    states = RULES["ladder"].states(FlickerView(1.0, 1e-3, 0.7, 600.0, 1e4, 0.01))
    tau = np.geomspace(0.1, 1e3, 40)
    ladder = sum(GaussMarkov(s.sd, s.time_constant).allan_variance(tau) for s in states)
    assert ladder == pytest.approx(BiasInstability(1.0).allan_variance(tau), rel=0.05)


@pytest.mark.parametrize("horizon", [1e-3, 1.0, 1e5])
@pytest.mark.parametrize("corner", [1e-6, 1.0, 1e6])
def test_ladder_never_lacks_a_state(horizon: float, corner: float) -> None:
    density = 0.664 * math.sqrt(corner)
    states = RULES["ladder"].states(FlickerView(1.0, density, 0.7, 1.0, horizon, 0.01))
    assert states[-1].time_constant == pytest.approx(horizon)
    assert all(s.sd > 0.0 and s.time_constant > 0.0 for s in states)


def test_peak_rule_matches_height_and_place_of_the_allan_minimum() -> None:
    (state,) = RULES["peak"].states(VIEW)
    assert state.sd == pytest.approx(1.08 * VIEW.level, rel=5e-3)
    tau = np.geomspace(60.0, 6000.0, 2001)
    curve = GaussMarkov(state.sd, state.time_constant).allan_variance(tau)
    assert math.sqrt(curve.max()) == pytest.approx(
        math.sqrt(2 * math.log(2) / math.pi) * VIEW.level, rel=1e-4
    )
    assert tau[curve.argmax()] == pytest.approx(VIEW.minimum_tau, rel=5e-3)


def test_single_state_rules_are_what_they_say() -> None:
    assert RULES["level"].states(VIEW) == (GaussMarkov(VIEW.level, 600.0),)
    assert RULES["minimum"].states(VIEW) == (GaussMarkov(VIEW.minimum, 600.0),)
    assert RULES["wide"].states(VIEW) == (GaussMarkov(1.5 * VIEW.level, 300.0),)
    worst = [rule.worst_ratio for rule in RULES.values()]
    assert worst == sorted(worst)


# The bounding state. Each corner of a box of sd and time constant fails at some lag or frequency; the
# bounding state holds for spectrum, growth of the bias and growth of its integral alike.

BOX_SD = (0.7, 1.3)
BOX_TIME = (40.0, 250.0)


def box() -> list[GaussMarkov]:
    return [GaussMarkov(s, t) for s in np.linspace(*BOX_SD, 4) for t in np.geomspace(*BOX_TIME, 9)]


def spectrum(state: GaussMarkov, f: np.ndarray) -> np.ndarray:
    return 2.0 * state.sd**2 * state.time_constant / (1.0 + (2.0 * np.pi * f * state.time_constant) ** 2)


def integral_variance(state: GaussMarkov, t: np.ndarray) -> np.ndarray:
    x = t / state.time_constant
    return 2.0 * state.sd**2 * state.time_constant**2 * (x + np.expm1(-x))


def growth(state: GaussMarkov, t: np.ndarray) -> np.ndarray:
    return -2.0 * state.sd**2 * np.expm1(-t / state.time_constant)


def test_bounding_state_lies_above_every_spectrum_and_growth_of_the_box() -> None:
    bound = bounding_state(BOX_SD, BOX_TIME)
    f = np.geomspace(1e-6, 10.0, 400)
    lag = np.geomspace(1e-2, 1000.0, 400)
    for state in box():
        assert np.all(spectrum(bound, f) >= spectrum(state, f) * (1.0 - 1e-12))
        assert np.all(growth(bound, lag) >= growth(state, lag) * (1.0 - 1e-12))
        assert np.all(integral_variance(bound, lag) >= integral_variance(state, lag) * (1.0 - 1e-12))


def test_bounding_state_dominates_as_a_covariance() -> None:
    bound = bounding_state(BOX_SD, BOX_TIME)
    t = np.linspace(0.0, 1000.0, 120)
    lag = np.abs(t[:, None] - t[None, :])

    def covariance(state: GaussMarkov) -> np.ndarray:
        return state.sd**2 * np.exp(-lag / state.time_constant)

    for state in box():
        assert np.linalg.eigvalsh(covariance(bound) - covariance(state)).min() > -1e-9


def test_no_smaller_single_state_bounds_the_box() -> None:
    bound = bounding_state(BOX_SD, BOX_TIME)
    f = np.geomspace(1e-6, 10.0, 400)
    for time in np.geomspace(5.0, 2000.0, 60):
        candidate = GaussMarkov(0.99 * bound.sd, time)
        assert any(np.any(spectrum(candidate, f) < spectrum(state, f)) for state in box())


def test_each_corner_of_the_box_alone_fails() -> None:
    """(sd_hi, T_lo) bounds the growth of the bias at every lag, but not its integral."""
    short, long = GaussMarkov(BOX_SD[1], BOX_TIME[0]), GaussMarkov(BOX_SD[1], BOX_TIME[1])
    lag = np.geomspace(1e-2, 1000.0, 400)
    assert all(np.all(growth(short, lag) >= growth(state, lag) * (1.0 - 1e-12)) for state in box())
    assert np.any(integral_variance(short, lag) < integral_variance(long, lag))
    assert np.any(growth(long, lag) < growth(short, lag))


def test_bounding_state_of_a_point_is_the_point() -> None:
    assert bounding_state((1.0, 2.0), (50.0, 50.0)) == GaussMarkov(2.0, 50.0)
    with pytest.raises(ValueError, match="time_constant"):
        bounding_state((1.0, 2.0), (0.0, 50.0))


def test_noise_of_a_step_has_the_closed_forms() -> None:
    sd, time, walk, white = 2e-3, 50.0, 3e-5, 1e-2
    noise = channel(white_density=white, markov=(GaussMarkov(sd, time),), random_walk_density=walk)
    assert axis_states(noise) == ("integral", "markov_1", "bias")
    for step in (0.01, 1.0, 100.0, 1000.0 * time):
        phi = math.exp(-step / time)
        transition, q = discretize(axis_system(noise), step)
        gain = time * -math.expm1(-step / time)
        area = step - 2.0 * gain + time * -math.expm1(-2.0 * step / time) / 2.0
        if step > 0.1 * time:  # below, the closed form cancels
            assert q[0, 0] == pytest.approx(
                white**2 * step + 2.0 * sd**2 * time * area + walk**2 * step**3 / 3.0, rel=1e-9
            )
        assert q[1, 1] == pytest.approx(-(sd**2) * math.expm1(-2.0 * step / time), rel=1e-9)
        assert q[0, 1] == pytest.approx(sd**2 * time * math.expm1(-step / time) ** 2, rel=1e-9)
        assert q[2, 2] == pytest.approx(walk**2 * step, rel=1e-9)
        assert q[0, 2] == pytest.approx(walk**2 * step**2 / 2.0, rel=1e-9)
        assert transition[0] == pytest.approx([1.0, gain, step], rel=1e-9)
        assert transition[1, 1] == pytest.approx(phi, rel=1e-9, abs=1e-300)


def test_axis_system_has_the_densities_on_its_diagonal() -> None:
    noise = channel(
        markov=(GaussMarkov(2e-3, 50.0), GaussMarkov(1e-3, 5.0)), random_walk_density=3e-5, ramp_sd=1e-7
    )
    system = axis_system(noise)
    assert axis_states(noise) == ("integral", "markov_1", "markov_2", "bias", "bias_rate")
    expected = [1e-8, 2.0 * 4e-6 / 50.0, 2.0 * 1e-6 / 5.0, 9e-10, 0.0]
    assert np.diag(system.Q) == pytest.approx(expected)
    assert np.diag(system.P0) == pytest.approx([0.0, 4e-6, 1e-6, 1e-6, 1e-14])


@pytest.mark.parametrize("time", [0.01, 1.0, 300.0, 1e5])
@pytest.mark.parametrize("sd", [1e-8, 1.0, 100.0])
def test_the_state_that_bounds_a_gauss_markov_process_is_that_process(time, sd):
    """In any unit and at any time constant; steps of the grid are 1.5 %, T and variance are off by half of one."""
    state = spectrum_bound(GaussMarkov(sd, time))
    assert state.time_constant == pytest.approx(time, rel=8e-3)
    assert state.sd == pytest.approx(sd, rel=4e-3)
