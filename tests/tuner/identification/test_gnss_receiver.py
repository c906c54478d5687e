"""A receiver at rest: the noise put into its fixes comes back, from arrays and from the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from models.earth import llh_displaced
from tests.cramer_rao import spectral_bound
from tuner.cli import run
from tuner.identification.gnss_receiver import identify_receiver
from tuner.identification.identify_source import receiver_of_source
from tuner.readers.gnss_log import is_fixes, read_fixes
from tuner.types.records import DataError, Gnss

HOME = np.array([np.radians(48.0), np.radians(11.0), 500.0])
WHITE, SD, TIME = np.array([0.8, 0.6, 1.5]), np.array([0.9, 0.7, 2.0]), 40.0


def at_rest(n: int, *, interval: float = 1.0, correlated: bool = True, seed: int = 0) -> Gnss:
    rng = np.random.default_rng(seed)
    ned = WHITE * rng.standard_normal((n, 3))
    if correlated:
        a = np.exp(-interval / TIME)
        drive = SD * np.sqrt(1.0 - a * a) * rng.standard_normal((n, 3))
        drive[0] = SD * rng.standard_normal(3)
        ned = ned + lfilter([1.0], [1.0, -a], drive, axis=0)
    t = interval * np.arange(n)
    keep = (t < 0.4 * t[-1]) | (t > 0.45 * t[-1])
    nothing = np.full((n, 3), np.nan)
    vel_n = 0.05 * rng.standard_normal((n, 3))
    return Gnss(t[keep], llh_displaced(HOME, ned)[keep], vel_n[keep], nothing[keep], nothing[keep])


def spectrum(f: np.ndarray, white: float, sd: float, time: float) -> np.ndarray:
    """Two-sided density of samples at 1 Hz: white noise and a first-order autoregression."""
    a = np.exp(-1.0 / time)
    return white**2 + sd**2 * (1.0 - a * a) / np.abs(1.0 - a * np.exp(-2j * np.pi * f)) ** 2


def test_white_and_correlated_parts_come_back() -> None:
    """Within 4.5 sds of the best estimate from the 19 000 fixes of each axis, 1e-5 each, and about as sure as it."""
    found = identify_receiver(at_rest(20_000))
    for axis, white, sd in zip(found.position, WHITE, SD, strict=True):
        told = found.position[axis]
        truth = {"white_sd": white, "sd": sd, "time_constant": TIME}
        bounds = spectral_bound(spectrum, tuple(truth.values()), 19_000, 1.0)
        for (name, value), bound in zip(truth.items(), bounds, strict=True):
            low, high = np.log(told[name].interval)
            assert abs(np.log(told[name].value / value)) < 4.5 * bound, (axis, name)
            assert high - low == pytest.approx(3.92 * bound, rel=0.3), (axis, name)
    (state,) = found.noise.correlated
    assert state.sd == pytest.approx(np.sqrt(np.mean(SD[:2] ** 2)), rel=0.2)
    assert state.time_constant == pytest.approx(TIME, rel=0.3)
    assert found.noise.correlated_down == pytest.approx(SD[2] / state.sd, rel=0.3)
    assert found.noise.velocity_sd == pytest.approx((0.05, 0.05, 0.05), rel=0.05)


def test_white_fixes_need_no_state() -> None:
    found = identify_receiver(at_rest(3000, correlated=False))
    assert found.noise.correlated == ()
    assert found.noise.position_sd == pytest.approx(WHITE, rel=0.08)


def test_a_moving_antenna_is_refused() -> None:
    gnss = at_rest(1000)
    moving = llh_displaced(gnss.llh, np.outer(gnss.t, [5.0, 0.0, 0.0]))
    with pytest.raises(DataError, match="at rest"):
        identify_receiver(Gnss(gnss.t, moving, gnss.vel_n, gnss.position_sd, gnss.velocity_sd))


@pytest.fixture
def log(tmp_path: Path) -> Path:
    gnss, path = at_rest(5000), tmp_path / "gnss.csv"
    rows = np.column_stack([gnss.t, np.degrees(gnss.llh[:, :2]), gnss.llh[:, 2], gnss.vel_n])
    np.savetxt(
        path, rows, delimiter=",", header="t,lat [deg],lon [deg],height,vn,ve,vd", comments="", fmt="%.10f"
    )
    return path


def test_a_log_of_fixes_is_read(log: Path) -> None:
    assert is_fixes(log)
    assert len(read_fixes(log)) == len(at_rest(5000))


def test_identify_knows_a_log_of_fixes(log: Path, tmp_path: Path) -> None:
    assert run(["identify", str(log), "--json", str(tmp_path / "found.json"), "--quiet"]) == 0
    told = json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))
    assert told["schema"] == "tuner.receiver/1"
    low, high = told["position"]["north"]["white_sd"]["interval"]
    assert low < WHITE[0] * 1.05
    assert high > WHITE[0] * 0.95


def test_a_log_of_fixes_stands_for_a_grade(log: Path) -> None:
    identified = receiver_of_source(log)
    assert identified.correlated[0].time_constant == pytest.approx(TIME, rel=0.6)
    assert receiver_of_source("spp").position_sd
