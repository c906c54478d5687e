"""The whole loop around a filter of its own: its settings are written, scored, moved and judged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.tuner.external.test_search import EPOCHS, WALK, Q, R, filtered, fixes
from tuner.external.tune_external import _reference_gain, tune_external
from tuner.report.external_tables import external_json, external_tables
from tuner.report.terminal import show
from tuner.types import ChannelNoise, FilterConfig, GnssNoise, InitialUncertainty
from tuner.types.filter_output import filter_output
from tuner.types.records import DataError, Drive, Gnss

RADIUS = 6.4e6


@dataclass(frozen=True)
class InProcess:
    """A program that needs no process: it reads what a real one would, and writes its innovations."""

    words: tuple[str, ...] = ("small_filter",)

    def names(self, placeholder: str) -> bool:
        return placeholder == "output"

    def run(self, paths: Mapping[str, Path], folder: Path) -> None:
        noise = yaml.safe_load(paths["config"].read_text(encoding="utf-8"))
        gnss = np.genfromtxt(paths["gnss"], delimiter=",", names=True)
        places = [RADIUS * np.radians(gnss[name]) for name in ("lat_deg", "lon_deg")]
        data = np.column_stack([*places, -gnss["height"]])
        found = filtered(
            data,
            noise["accelerometer_noise_density"],
            noise["accelerometer_random_walk"],
            float(gnss["sd_n"][0]),
        )
        sd = np.sqrt(found.s[:, :1, 0])
        rows = np.column_stack([gnss["t"], found.z, sd, sd, sd])
        names = "t,z_n,z_e,z_d,sd_z_n,sd_z_e,sd_z_d"
        np.savetxt(f"{paths['output']}.csv", rows, delimiter=",", header=names, comments="")


def config(q: float, walk: float, r: float) -> FilterConfig:
    gyro = [ChannelNoise(f"gyro_{a}", "rad/s", 1e-4, (), 1e-6, 1e-3) for a in "xyz"]
    accel = [ChannelNoise(f"accel_{a}", "m/s^2", q, (), walk, 0.05) for a in "xyz"]
    channels = {channel.axis: channel for channel in (*gyro, *accel)}
    receiver = GnssNoise((r,) * 3, None, 1.0, 5.0)
    return FilterConfig("made by hand", 0.5, channels, InitialUncertainty(1, 1, 1, 1), receiver)


def drive() -> Drive:
    data = fixes(np.random.default_rng(0))
    llh = np.column_stack([data[:, :2] / RADIUS, -data[:, 2]])
    none = np.full((EPOCHS, 3), np.nan)
    t = np.arange(float(EPOCHS))
    return Drive(
        "toy", np.arange(0.0, EPOCHS, 0.5), np.zeros((2 * EPOCHS, 6)), Gnss(t, llh, none, none, none)
    )


@pytest.fixture(scope="module")
def result():
    told: list[tuple[int, int]] = []
    begin = config(Q / 3.0, WALK, R / 2.0)
    found = tune_external(
        InProcess(),
        drive(),
        begin,
        "kalibr",
        path="toy.npz",
        progress=lambda done, total: told.append((done, total)),
    )
    assert told[0] == (0, 40)
    assert told[-1] == (40, 40)
    return found


def test_planted_noise_is_found_and_the_rest_of_the_drive_is_more_likely_with_it(result) -> None:
    for name, true in (("accelerometer noise", 3.0), ("fix sds", 2.0)):
        low, high = result.found.interval(name)
        assert low < true < high
    assert result.found.interval("gyro noise") is None
    assert result.kept
    assert result.gain > 3.0 * result.gain_sd
    assert abs(np.log(result.ratios[1])) < abs(np.log(result.ratios[0])) / 3.0
    text = yaml.safe_load(result.text)
    factor = result.found.factors["accelerometer noise"]
    assert text["accelerometer_noise_density"] == pytest.approx(factor * Q / 3.0, rel=1e-5)
    assert "small_filter showed on toy" in result.text


def test_both_scores_are_shown(result, capsys: pytest.CaptureFixture[str]) -> None:
    untouched, tuned = result.scores
    assert not untouched.consistency.consistent
    assert tuned.consistency.consistent
    show(external_tables(result))
    said = capsys.readouterr().out
    assert "no effect on the output" in said
    assert "kept: the rest of the drive is more likely" in said
    content = external_json(result, source={})
    assert content["factors"]["gyro noise"]["interval"] is None
    assert content["kept"]


def test_factors_that_the_reference_speaks_against_are_not_kept(result, capsys) -> None:
    against = replace(result, reference_gain=-1.0)
    assert not against.kept
    show(external_tables(against))
    assert "not kept: the fixes of the rest are more likely" in capsys.readouterr().out
    t = np.arange(200.0)
    truth = filter_output("truth", t, local=np.zeros((200, 3)))
    off = np.random.default_rng(0).standard_normal((200, 3))
    one, other = (
        filter_output("e", t, local=off, covariance=np.full((200, 15, 15), sd**2) * np.eye(15))
        for sd in (1.0, 0.2)
    )
    assert (
        _reference_gain(one, other, truth, 100.0) < -10.0 < 10.0 < _reference_gain(other, one, truth, 100.0)
    )
    assert _reference_gain(one, other, None, 100.0) is None


def test_what_cannot_be_run_is_refused() -> None:
    with pytest.raises(DataError, match="--to"):
        tune_external(InProcess(), drive(), config(Q, WALK, R), "no-dialect", path="toy.npz")
    nobody = replace(config(Q, WALK, R), gnss=None)
    with pytest.raises(DataError, match="found neither: --gnss"):
        tune_external(InProcess(), drive(), nobody, "kalibr", path="toy.npz")
