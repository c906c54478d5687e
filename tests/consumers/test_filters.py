"""What each filter predicts from an export ÷ what the configuration models, by the filter's own propagation.

White noise and a random walk, which every filter can hold, come out equal at each horizon. Flicker, four states in our
configuration, is two numbers or one state in theirs: what these can do at best is stated by the header of the export.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.consumers import filters
from tests.consumers.examples import EXAMPLES, LAGS, text_of
from tests.consumers.filters import FILTERS, Filter
from tests.consumers.simulators import SIMULATORS
from tuner.exporters import DIALECTS, export
from tuner.synthesis.error_growth import modelled_growth
from tuner.synthesis.projection import AUTOPILOT, CAMERA, GNSS, LIDAR, Aiding

BY_NAME = {program.dialect: program for program in FILTERS}
FADING = ("kf-gins", "ob-gins", "navego")
OWN_STEP = ("px4", "ardupilot")
"""Their filters predict at a step of their own, whatever the rate of the IMU."""


def test_every_dialect_has_a_consumer_whose_use_of_its_numbers_was_read() -> None:
    known = {*BY_NAME, *(simulator.dialect for simulator in SIMULATORS), "native"}
    assert known == set(DIALECTS)


def ratios(program: Filter, example: str, sensor: str) -> np.ndarray:
    channel = EXAMPLES[example]().channels[f"{sensor}_x"]
    predicted = program.growth(text_of(example, program.dialect), sensor, LAGS)
    if not program.has_bias:
        return np.sqrt(predicted / (channel.white_density**2 * LAGS))
    return np.sqrt(predicted / modelled_growth(channel, LAGS, memory=LAGS[-1]))


@pytest.mark.parametrize("sensor", ["gyro", "accel"])
@pytest.mark.parametrize("dialect", BY_NAME)
def test_white_noise_and_walk_are_predicted_as_modelled(dialect: str, sensor: str) -> None:
    # Six digits of the export and the Euler step of a fading bias (dt/T = 3e-6) leave a thousandth; a state that fades
    # in 1 h is not quite a walk.
    off = 1e-2 if dialect in FADING else 2e-3
    assert ratios(BY_NAME[dialect], "walk", sensor) == pytest.approx(np.ones(LAGS.size), abs=off)


@pytest.mark.parametrize("rate", [10.0, 4000.0])
@pytest.mark.parametrize("dialect", [name for name in BY_NAME if name not in OWN_STEP])
def test_the_rate_of_the_target_changes_no_prediction(
    monkeypatch: pytest.MonkeyPatch, dialect: str, rate: float
) -> None:
    program, lags = BY_NAME[dialect], LAGS[:2]
    monkeypatch.setattr(filters, "STEP", 1.0 / rate)
    text = export(EXAMPLES["walk"](), dialect, interval=1.0 / rate)
    for sensor in ("gyro", "accel"):
        channel = EXAMPLES["walk"]().channels[f"{sensor}_x"]
        modelled = modelled_growth(channel, lags, memory=LAGS[-1])
        if not program.has_bias:
            modelled = channel.white_density**2 * lags
        assert np.sqrt(program.growth(text, sensor, lags) / modelled) == pytest.approx(np.ones(2), abs=3e-3)


@pytest.mark.parametrize("sensor", ["gyro", "accel"])
@pytest.mark.parametrize("aiding", [GNSS, AUTOPILOT, CAMERA, LIDAR], ids=lambda one: one.words)
def test_two_numbers_for_flicker_are_the_same_in_every_filter_with_the_same_fixes(
    aiding: Aiding, sensor: str
) -> None:
    others = [p for p in FILTERS if p.has_bias and DIALECTS[p.dialect].aiding == aiding]
    found = np.array([ratios(one, "flicker", sensor) for one in others if one.dialect not in FADING])
    assert len(found) > 1
    assert np.ptp(found, axis=0).max() < 2e-3
