"""Length of a static test: Cramér–Rao bounds, scaling laws, the cluster rule."""

import math

import numpy as np
import pytest

from models.noise import BiasInstability, GaussMarkov, NoiseModel, Ramp, RandomWalk, White
from tuner.identification.record_length import plan, relative_sd

HOUR = 3600.0


@pytest.mark.parametrize(
    ("model", "expected"),
    [
        # Relative sd from the exact discrete Whittle information at 100 Hz, one hour.
        (NoiseModel((White(1.0), GaussMarkov(0.3, 100.0))), [0.0012, 0.140, 0.40]),
        (NoiseModel((White(1.0), RandomWalk(np.sqrt(3) / 60))), [0.0012, 0.141]),
        (NoiseModel((White(1.0), BiasInstability(0.476), RandomWalk(0.0245))), [0.0012, 0.049, 0.53]),
        (NoiseModel((White(1.0), BiasInstability(0.476), RandomWalk(0.06))), [0.0012, 0.055, 0.21]),
    ],
)
def test_bounds_of_an_hour(model, expected):
    assert relative_sd(model, interval=0.01, span=HOUR) == pytest.approx(expected, rel=0.03)


def test_white_noise_is_known_to_one_over_root_two_n():
    found = relative_sd(NoiseModel((White(3.0),)), interval=0.1, span=1000.0)
    assert found == pytest.approx([1 / np.sqrt(2 * 10_000)], rel=1e-3)


def test_bounds_do_not_depend_on_units():
    model = NoiseModel((White(1.0), BiasInstability(0.5)))
    scaled = NoiseModel((White(100.0), BiasInstability(50.0)))
    assert relative_sd(model, interval=0.01, span=HOUR) == pytest.approx(
        relative_sd(scaled, interval=0.01, span=HOUR)
    )


def test_the_planned_hours_reach_the_accuracy():
    model = NoiseModel((White(1.0), RandomWalk(0.05)))
    hours = plan(model, interval=0.1, hours=1.0, accuracy=0.2).parameters[1].hours
    assert relative_sd(model, interval=0.1, span=hours * HOUR)[1] == pytest.approx(0.2, rel=0.02)


def test_ramp_is_known_as_well_as_two_half_means_differ():
    white, rate, span = 2.0, 0.1, 400.0
    found = relative_sd(NoiseModel((White(white), Ramp(rate))), interval=0.1, span=span)
    # Each half mean has variance N²/(T/2); they lie T/2 apart.
    assert found[1] == pytest.approx(np.sqrt(2 * white**2 / (span / 2)) / (span / 2) / rate, rel=1e-9)


def test_cluster_rule_of_the_standard():
    # IEEE Std 952: 25 % needs nine clusters, so 900 s for τ = 100 s.
    found = plan(NoiseModel((White(1.0),)), interval=1.0, hours=0.25, accuracy=0.25)
    assert found.clusters == 9
    assert found.longest_tau == pytest.approx(100.0)


def test_what_is_impossible_is_said():
    hidden = plan(
        NoiseModel((White(1.0), RandomWalk(1e-9))), interval=0.1, hours=1.0, accuracy=0.1
    ).parameters[1]
    assert not hidden.shown
    assert hidden.hours is None


@pytest.mark.parametrize(
    ("hours", "accuracy", "word"),
    [
        (0.0, 0.1, "hours"),
        (1e-6, 0.1, "hours"),
        (math.inf, 0.1, "hours"),
        (1.0, 0.0, "accuracy"),
        (1.0, 1.5, "accuracy"),
    ],
)
def test_bad_wishes_are_refused(hours, accuracy, word):
    with pytest.raises(ValueError, match=word):
        plan(NoiseModel((White(1.0),)), interval=0.1, hours=hours, accuracy=accuracy)


def test_a_wish_that_few_samples_meet_takes_no_longer_than_they_last():
    """White noise is known to 10 % after 51 samples; the plan named 36 s, the shortest time that it tried."""
    (white,) = plan(NoiseModel((White(1.0),)), interval=0.01, hours=0.001, accuracy=0.1).parameters
    assert white.relative_sd == pytest.approx(1.0 / math.sqrt(2 * 360), rel=0.01)
    assert white.hours == pytest.approx(0.5 / 0.1**2 * 0.01 / HOUR, rel=0.1)
