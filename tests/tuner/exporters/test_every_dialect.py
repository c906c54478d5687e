"""Laws that every dialect keeps: sources, one sensor or one axis, digits, units, refusals."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
import yaml

from models.noise import GaussMarkov
from tests.tuner.exporters.made_by_hand import (
    CONFIG,
    DT,
    N_GYRO,
    entries,
    make,
    near,
    written,
)
from tuner.exporters import DIALECTS, export
from tuner.exporters.header import stated_ratios
from tuner.formats.digits import CLOCK_DIGITS
from tuner.synthesis.load_config import load_config
from tuner.synthesis.projection import Projected
from tuner.types import FilterConfig
from tuner.types.records import DataError

OTHERS = [name for name in DIALECTS if name != "native"]


@pytest.mark.parametrize("dialect", OTHERS)
def test_every_dialect_says_its_source_and_its_inflation(dialect: str) -> None:
    text = written(dialect)
    assert "made by hand" in text
    assert "white.density × 1.5 (gyro_x): vibration" in text
    assert "N = 0.688 deg/√h" in text


ALONE = [name for name in OTHERS if not DIALECTS[name].needs]


@pytest.mark.parametrize("dialect", [name for name in OTHERS if name not in ALONE])
@pytest.mark.parametrize("sensor", ["gyro", "accel"])
def test_a_target_that_needs_both_sensors_refuses_one(dialect: str, sensor: str) -> None:
    half = {axis: c for axis, c in CONFIG.channels.items() if axis.startswith(sensor)}
    with pytest.raises(DataError, match=r"needs gyroscopes and accelerometers, found no .*--complete GRADE"):
        written(dialect, replace(CONFIG, channels=half))


@pytest.mark.parametrize("dialect", ALONE)
@pytest.mark.parametrize("sensor", ["gyro", "accel"])
def test_a_missing_sensor_is_left_out_with_a_comment(dialect: str, sensor: str) -> None:
    half = {axis: c for axis, c in CONFIG.channels.items() if axis.startswith(sensor)}
    text = written(dialect, replace(CONFIG, channels=half))
    assert "are left out" in text
    assert "nan" not in text.lower().replace("covariance", "")


@pytest.mark.parametrize("dialect", ALONE)
def test_one_axis_is_enough(dialect: str) -> None:
    one = {"gyro_z": CONFIG.channels["gyro_z"]}
    assert "N = 0.688 deg/√h" in written(dialect, replace(CONFIG, channels=one))


def uneven() -> FilterConfig:
    """Return settings of a sheet with tenfold wander of the bias of gyro x."""
    config = load_config("icm20602")
    one = config.channels["gyro_x"]
    worse = replace(one, markov=tuple(replace(state, sd=10.0 * state.sd) for state in one.markov))
    return replace(config, channels={**config.channels, "gyro_x": worse})


def test_a_file_with_one_number_states_the_errors_that_follow_from_it() -> None:
    """The header had 0.87 to 1.11, of numbers by axis; the rms in the file makes 0.25 to 1.83."""
    config = uneven()
    text = export(config, "kalibr")
    found = yaml.safe_load(text)
    target = DIALECTS["kalibr"].target(config)
    ratios = [
        ratio
        for axis, channel in config.channels.items()
        for name in ("gyroscope" if axis.startswith("gyro") else "accelerometer",)
        for ratio in target.errors(
            channel, Projected(found[f"{name}_noise_density"], found[f"{name}_random_walk"])
        ).values()
    ]
    stated = stated_ratios(text)
    assert (min(stated), max(stated)) == pytest.approx((min(ratios), max(ratios)), abs=0.006)
    assert min(stated) < 0.5
    assert max(stated) > 1.5


@pytest.mark.parametrize("dialect", OTHERS)
def test_a_dialect_declares_whether_all_axes_have_one_number(dialect: str) -> None:
    assert ("; for all axes" in export(uneven(), dialect)) == DIALECTS[dialect].shared


@pytest.mark.parametrize("dialect", ["px4", "ardupilot"])
def test_numbers_that_are_not_loaded_have_no_ratio(dialect: str) -> None:
    text = export(uneven(), dialect)
    assert "keep stock" in text
    assert not stated_ratios(text)
    assert stated_ratios(export(uneven(), "fastlio"))


@pytest.mark.parametrize("dialect", ["kf-gins", "ob-gins", "navego"])
def test_a_state_that_fades_between_fixes_is_not_the_one_of_the_filter(dialect: str) -> None:
    """Its T of 20 ms was that of the filter: "nan" and a bound of the search were written."""
    config = load_config("icm20602")
    brief = {axis: replace(c, markov=(GaussMarkov(3e-4, 0.02),)) for axis, c in config.channels.items()}
    text = export(replace(config, channels=brief), dialect)
    assert "Gauss–Markov states are in N and K" in text
    assert 0.9 < min(stated_ratios(text)) <= max(stated_ratios(text)) < 1.1


def test_noise_that_makes_no_filter_is_refused() -> None:
    nothing = {
        axis: replace(c, white_density=1e-30, markov=(GaussMarkov(1e-30, 100.0),), random_walk_density=0.0)
        for axis, c in CONFIG.channels.items()
    }
    with pytest.raises(DataError, match="white noise of 1e-30 rad/s/√Hz: expected one with which"):
        export(replace(CONFIG, channels=nothing), "kalibr")


def test_no_dialect_gets_a_zero_noise_from_a_still_bias() -> None:
    still = {
        axis: replace(c, markov=() if axis.endswith("x") else c.markov) for axis, c in CONFIG.channels.items()
    }
    found = entries("kalibr", replace(CONFIG, channels=still))
    assert all(found[key] > 0.0 for key in found if key.endswith(("density", "walk")))
    noise = entries("kf-gins", replace(CONFIG, channels=still))["imunoise"]
    assert min(noise["gbstd"] + noise["abstd"]) > 0.0
    assert "stands in, as no target may get 0" in written("kalibr", replace(CONFIG, channels=still))
    assert "stands in" not in written("kalibr")


@pytest.mark.parametrize("dialect", list(DIALECTS))
def test_no_dialect_is_written_without_a_slow_bias(dialect: str) -> None:
    # A filter without one trusts its biases for ever: until now a sheet of white noise alone was written as K = 0.
    still = {
        a: replace(c, markov=() if a.startswith("gyro") else c.markov) for a, c in CONFIG.channels.items()
    }
    with pytest.raises(
        DataError, match=r"nothing is written for .*gyroscopes: neither bias instability .* usual is"
    ):
        export(replace(CONFIG, channels=still), dialect)


def test_an_unknown_dialect_is_refused() -> None:
    with pytest.raises(DataError, match=r"^unknown dialect 'klingon'; known are native, kalibr, openvins,"):
        export(CONFIG, "klingon")
    with pytest.raises(DataError, match=r"^unknown dialect 'kf_gins' \(did you mean 'kf-gins'\?\)"):
        export(CONFIG, "kf_gins")


@pytest.mark.parametrize("dialect", OTHERS)
def test_no_dialect_carries_more_digits_than_it_should(dialect: str) -> None:
    third = {
        axis: replace(c, white_density=c.white_density / 3.0) for axis, c in make(spread=0.1).channels.items()
    }
    text = export(replace(CONFIG, channels=third, interval=1.0 / 30.0), dialect)
    numbers = re.findall(r"(?<![\w.])\d+\.\d+", text)
    assert max(len(number.replace(".", "").strip("0")) for number in numbers) <= CLOCK_DIGITS


def test_fast_livo2_is_told_what_its_fixed_walk_predicts() -> None:
    text = export(CONFIG, "fast-livo2")
    assert yaml.safe_load(text)["imu"]["gyr_cov"] == near(N_GYRO**2 / DT)
    # LIVMapper.cpp fixes 1e-4 (rad/s²)² a step: K = 1e-3 at 100 Hz, σ√(2/T) = 1.7e-6 in the configuration. The filter
    # believes in a drift of the bias that is 600 times as large.
    said = re.search(r"gyroscopes: true ÷ predicted .* 60 s after the last fix (\d+\.\d\d)", text)
    assert float(said[1]) < 0.5


def test_settings_that_are_fitted_to_the_curve_say_so_beside_the_identified_terms() -> None:
    one = replace(CONFIG.channels["gyro_x"], handling={"white": "not used: fitted to the Allan curve"})
    text = written("kalibr", replace(CONFIG, channels=dict(CONFIG.channels) | {"gyro_x": one}))
    assert "gyro_x: N = 0.688 deg/√h: fitted to the Allan curve; identified: nothing" in text


@pytest.mark.parametrize("config", [CONFIG, load_config("icm20602")], ids=["state", "flicker"])
@pytest.mark.parametrize("dialect", [name for name in DIALECTS if name != "native"])
def test_every_number_of_a_header_has_its_unit(dialect: str, config: FilterConfig) -> None:
    found = re.findall(
        r"[NKBσT] = [\d.e+-]+(?![\d.e+-])(?! (?:rad|m|s|deg|µg)\b)[^\n]{0,20}", export(config, dialect)
    )
    assert found == []


@pytest.mark.parametrize("dialect", [name for name in DIALECTS if name != "native"])
def test_an_axis_without_white_noise_is_refused(dialect: str) -> None:
    channels = {a: replace(c, white_density=0.0) if a == "gyro_y" else c for a, c in CONFIG.channels.items()}
    with pytest.raises(
        DataError, match=r"expected white noise of gyro_y above 0, found 0, .*: set white_density"
    ):
        export(replace(CONFIG, channels=channels), dialect)
