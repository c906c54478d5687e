"""Wrong filters, and the reasons named for them: simulated sensors draw flicker, never the states of a filter.

The studies fly the whole strapdown filter: twenty switch-ons of 25 minutes with an outage of five each. A
study errs where the filter is not flagged, or where the first reason is not the one that was planted.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.noise import GaussMarkov
from models.trajectories import TRAJECTORIES
from tuner.attribution import attribute, best, explanations
from tuner.budget import error_budget
from tuner.consistency import evaluate
from tuner.grades import grade_identification, load_gnss, load_grade
from tuner.navigation.sensor import sensor_of_config
from tuner.navigation.settings import filter_settings
from tuner.navigation.simulate import resolution, scenario, simulate
from tuner.responses import hidden, responses
from tuner.results import MarkovState
from tuner.synthesis import synthesize
from tuner.verdicts import explained

CONFIG = synthesize(grade_identification(load_grade("mpu9250")), gnss=load_gnss("spp"))
TRUTH = sensor_of_config(CONFIG)


def belief(*, q=1.0, r=1.0, memory=1.0, rungs=None, sensors=("gyro", "accel"), white=1.0):
    """Return the right configuration with variances, time constants or states believed wrongly."""
    channels = {
        axis: replace(
            c,
            white_density=c.white_density * np.sqrt(q * white),
            random_walk_density=c.random_walk_density * np.sqrt(q),
            markov=tuple(MarkovState(m.sd * np.sqrt(q), m.time_constant * memory) for m in c.markov[:rungs]),
        )
        if axis.startswith(sensors)
        else c
        for axis, c in CONFIG.channels.items()
    }
    gnss = CONFIG.gnss
    receiver = replace(
        gnss,
        position_sd=tuple(np.sqrt(r) * x for x in gnss.position_sd),
        velocity_sd=tuple(np.sqrt(r) * x for x in gnss.velocity_sd),
    )
    return replace(CONFIG, channels=channels, gnss=receiver)


@pytest.fixture(scope="module")
def town():
    return scenario(TRAJECTORIES["city"](1500.0), load_gnss("spp"), 0.02)


def answers(settings, plan):
    return responses(settings, plan, error_budget(settings, plan), window=resolution(settings, TRUTH))


def scores(settings, plan, seed, runs=20):
    return evaluate(simulate(settings, TRUTH, plan, runs=runs, seed=seed), plan.outages)


BIASES = "bias noise of gyros and accelerometers"
STATES = "gyro and accelerometer bias noise"
CASES = {  # what is believed, the reasons that are right, bounds of the size named first
    # White noise hardly counts here: with it and without it the noise of the sensors explains the same.
    "Q×0.1": ({"q": 0.1}, {"all sensor noise", BIASES}, (2.7, 3.7)),
    "Q×10": ({"q": 10.0}, {"all sensor noise", BIASES}, (0.27, 0.37)),
    "R×0.3": ({"r": 0.3}, {"position and velocity fixes"}, (1.6, 2.0)),
    "R×3": ({"r": 3.0}, {"position and velocity fixes"}, (0.5, 0.65)),
    # The ladder of a flicker, T × 10, lacks its first decade: the two are one fault in two words.
    "T×10": (
        {"memory": 10.0},
        {f"time constants of the {STATES}", f"missing {STATES} (faster)"},
        (0.03, 1.3),
    ),
    "ladder cut short": ({"rungs": 1}, {f"missing {STATES} (slower)"}, (0.8, 1.25)),
}


@pytest.mark.parametrize("name", ["Q×10", "T×10", "ladder cut short"])
def test_wrong_belief_is_named(town, name):
    wrong, reasons, (low, high) = CASES[name]
    settings = filter_settings(belief(**wrong))
    found = scores(settings, town, 4)
    assert not found.consistent
    causes = attribute(found, answers(settings, town))
    assert causes[0].source in reasons
    assert low < causes[0].ratio < high
    assert causes[0].interval[0] <= causes[0].ratio <= causes[0].interval[1]
    assert explained(found, causes)[0].startswith(causes[0].text)


@pytest.mark.parametrize("factor", [1.0 / 9.0, 9.0])
def test_wrong_gyros_are_told_from_wrong_accelerometers(town, factor):
    settings = filter_settings(belief(q=factor, white=1.0 / factor, sensors=("gyro",)))
    causes = attribute(scores(settings, town, 4, runs=12), answers(settings, town))
    assert causes[0].source == "gyro bias noise"
    assert causes[0].ratio == pytest.approx(factor**-0.5, rel=0.35)


def test_nothing_is_named_where_nothing_fits():
    own = {"gyro white noise": np.array([0.5, 0.0]), "start": np.array([0.0, 0.0])}
    rivals = explanations(own, {}, {})
    assert best(np.array([4.0, 0.2]), np.array([1e4, 1e4]), rivals) == ()


def test_mean_over_a_window_hides_fast_noise():
    rng = np.random.default_rng(1)
    sd, constant, window, dt = 2.0, 3.0, 9.0, 0.1
    y = GaussMarkov(sd, constant).sample(2_000_000, dt, rng)
    half = round(0.5 * window / dt)
    total = np.concatenate([[0.0], np.cumsum(y)])
    mean = (total[2 * half :] - total[: -2 * half]) / (2 * half)
    assert sd**2 - mean.var() == pytest.approx(hidden(sd, constant, window), rel=0.02)
    assert hidden(sd, 1e6, 1.0) == pytest.approx(0.0, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_wrong_belief_is_flagged_for_the_right_reason_in_fifty_studies(town, name):
    wrong, reasons, (low, high) = CASES[name]
    settings = filter_settings(belief(**wrong))
    response = answers(settings, town)
    flagged, named = 0, 0
    for seed in range(50):
        found = scores(settings, town, 1000 + seed)
        causes = attribute(found, response)
        flagged += not found.consistent
        named += bool(causes) and causes[0].source in reasons and low < causes[0].ratio < high
    assert flagged >= 48, f"flagged {flagged}, for the right reason {named} of 50"
    assert named >= 48, f"flagged {flagged}, for the right reason {named} of 50"


@pytest.mark.slow
def test_right_configuration_passes_in_a_hundred_studies(town):
    settings = filter_settings(CONFIG)
    passed = sum(scores(settings, town, 2000 + seed).consistent for seed in range(100))
    assert passed >= 98
