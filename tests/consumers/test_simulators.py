"""What each simulator draws from an export ÷ what the configuration models, as Allan deviations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from models.units import to_si
from tests.consumers.examples import EXAMPLES, modelled_allan_variance, text_of
from tests.consumers.filters import STEP
from tests.consumers.numbers import from_assignments
from tests.consumers.simulators import SIMULATORS
from tuner.curves.allan import overlapping_allan

TAU = np.geomspace(1.0, 300.0, 16)
BY_NAME = {simulator.dialect: simulator for simulator in SIMULATORS}
ONE_STATE = ("gnss-ins-sim", "gazebo", "rotors")


def ratio(dialect: str, example: str, sensor: str) -> np.ndarray:
    drawn = BY_NAME[dialect].allan_variance(text_of(example, dialect), sensor, TAU)
    return np.sqrt(drawn / modelled_allan_variance(EXAMPLES[example]().channels[f"{sensor}_x"], TAU))


@pytest.mark.parametrize("sensor", ["gyro", "accel"])
@pytest.mark.parametrize("dialect", BY_NAME)
def test_white_noise_and_walk_are_drawn_as_modelled(dialect: str, sensor: str) -> None:
    assert ratio(dialect, "walk", sensor) == pytest.approx(np.ones(TAU.size), abs=0.01)


@pytest.mark.parametrize("sensor", ["gyro", "accel"])
@pytest.mark.parametrize("dialect", ONE_STATE)
def test_one_state_for_flicker_is_off_by_what_its_header_says(dialect: str, sensor: str) -> None:
    found = ratio(dialect, "flicker", sensor)
    assert f"{found.min():.2f} … {found.max():.2f} from 1 to 300 s" in text_of("flicker", dialect)
    # With the longest time constant of the model, 1000 s, it was off by up to 3.5.
    assert 0.7 < found.min() < found.max() < 1.4


@pytest.mark.parametrize("sensor", ["gyro", "accel"])
def test_matlab_draws_flicker_itself(sensor: str) -> None:
    # Our ladder follows flicker to a tenth; MATLAB's is flicker.
    assert ratio("matlab", "flicker", sensor) == pytest.approx(np.ones(TAU.size), abs=0.1)


def gnss_ins_sim(text: str, n: int, rng: np.random.Generator) -> np.ndarray:
    """Draw a gyro as gnss_ins_sim/pathgen/pathgen.py does: gyro_gen, bias_drift; its state starts at zero."""
    values = from_assignments(text)
    density, sd = to_si(values["gyro_arw"][0], "deg/sqrt(h)"), to_si(values["gyro_b_stability"][0], "deg/h")
    rate, time = 1.0 / STEP, values["gyro_b_corr"][0]
    kept, added = 1.0 - 1.0 / rate / time, sd * math.sqrt(1.0 - math.exp(-2.0 / (rate * time)))
    drift = lfilter([0.0, added], [1.0, -kept], rng.standard_normal(n))
    return drift + density / math.sqrt(STEP) * rng.standard_normal(n)


@pytest.mark.parametrize("example", list(EXAMPLES))
def test_draws_of_gnss_ins_sim_have_the_allan_deviation_of_its_formula(example: str) -> None:
    text = text_of(example, "gnss-ins-sim")
    samples = gnss_ins_sim(text, 1_000_000, np.random.default_rng(7))
    sizes = np.array([100, 300, 1000, 3000, 10000])
    tau = sizes * STEP
    drawn = overlapping_allan(samples, sizes)
    formula = BY_NAME["gnss-ins-sim"].allan_variance(text, "gyro", tau)
    # A variance from n·τ of data has about n degrees of freedom, so its root a relative sd of 1/√(2n): five of them.
    spread = np.sqrt(tau / (2.0 * STEP * samples.size))
    assert np.all(np.abs(np.sqrt(drawn / formula) - 1.0) < 5.0 * spread)
