"""Measured sensors at rest: terms are physical, and only bounded where a record is too short."""

import os
from pathlib import Path

import numpy as np
import pytest

from models.units import from_si
from tuner.identification import identify
from tuner.readers import read

DATA = Path(os.environ.get("TUNER_DATA", "nowhere")) / "static"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="TUNER_DATA does not name a folder with recordings")


def gyro_terms(records):
    return identify([r for r in records if r.name == "gyro"], arma=None).channels


def test_tactical_gyro_of_160_s_bounds_its_bias_instability():
    for channel in gyro_terms(read(DATA / "stim300_static.npz", rate=125.0)).values():
        level = channel.term("bias_instability").coefficients["level"]
        assert level.value is None
        assert level.upper < 4e-5
        assert "short" in level.reason
        assert channel.term("random_walk").coefficients["density"].value is None
        density = channel.term("white").coefficients["density"]
        assert 3.4e-5 < density.value < 4.6e-5  # Allan deviation at 1 s is 3.6 … 4.1e-5 rad/s
        assert channel.minimum.value is None
        assert any("filter" in warning for warning in channel.warnings)


@pytest.mark.parametrize("run", [1, *(pytest.param(run, marks=pytest.mark.slow) for run in (2, 3))])
def test_industrial_gyro(run):
    for channel in gyro_terms(read(DATA / f"adis16405_run{run}.npz")).values():
        density = channel.term("white").coefficients["density"]
        at_one_second = channel.allan.deviation()[np.argmin(np.abs(channel.allan.tau - 1.0)), 0]
        assert density.value == pytest.approx(at_one_second, rel=0.1)
        assert 2.0 < from_si(density.value, "deg/sqrt(h)") < 2.8
        level = channel.term("bias_instability").coefficients["level"]
        bound = level.upper if level.value is None else level.value
        assert 10.0 < from_si(bound, "deg/h") < 60.0


def test_phone_gyro_behind_its_filter():
    for channel in gyro_terms(read(DATA / "galaxy_s5_static.npz")).values():
        density = channel.term("white").coefficients["density"]
        # from 10 s on the curve falls as white noise; below, the phone has smoothed the samples
        assert density.value == pytest.approx(np.sqrt(10.0) * channel.sigma_10s.value, rel=0.15)
        assert 5e-5 < channel.minimum.value < 1.2e-4
        assert 300.0 < channel.minimum_tau < 2000.0
