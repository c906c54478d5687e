"""Every built-in grade loads, is positive and names its sources; bad data sheets are refused in one line."""

from __future__ import annotations

import math
from dataclasses import fields
from pathlib import Path

import pytest

from models.noise.bias_instability import ALLAN_FLOOR
from models.sensors import Sourced, TriadGrade
from models.units import DEG, DEG_PER_HOUR, DEG_PER_SQRT_HOUR, MICRO_G
from tuner.catalogue import grades
from tuner.catalogue.datasheet import is_datasheet, read_datasheet
from tuner.catalogue.datasheet_format import parse_sheet
from tuner.catalogue.grades import (
    config_directory,
    grade_identification,
    grade_names,
    load_gnss,
    load_grade,
    parse_gnss,
)
from tuner.synthesis import synthesize
from tuner.types.records import DataError

SHEET = """\
format: tuner-datasheet/1
name: mine
kind: maximum
rate: 50
gyro:
  noise_density: {value: 0.01, unit: deg/s/√Hz, sided: one}
  bias_instability: {value: 5, unit: deg/h}
accel:
  noise_density: {value: 0.06, unit: m/s/√h}
  bias_instability: {value: 50, unit: µg, reading: level, kind: typical}
"""


RECEIVERS = sorted(path.stem for path in (config_directory() / "gnss").glob("*.yaml"))


def sourced(triad: TriadGrade) -> list[Sourced]:
    return [value for f in fields(triad) if isinstance(value := getattr(triad, f.name), Sourced)]


def test_the_promised_grades_are_there() -> None:
    promised = {"mpu9250", "adis16405", "adis16465", "icm20602", "stim300", "ln200", "kvh1750", "rlg", "fog"}
    assert promised <= set(grade_names())
    assert {"spp", "rtk"} <= set(RECEIVERS)


@pytest.mark.parametrize("name", grade_names())
def test_every_grade_is_positive_and_names_its_sources(name: str) -> None:
    grade = load_grade(name)
    assert grade.key == name
    for triad in (grade.gyro, grade.accel):
        for number in sourced(triad):
            assert number.value > 0.0
            assert number.reference.strip()
            assert number.reference.split(":")[0] in {"datasheet typical", "datasheet maximum", "measured"}
            assert ":" in number.reference, "a built-in number names its source, or says 'recalled'"


@pytest.mark.parametrize("name", grade_names())
def test_every_grade_makes_a_configuration(name: str) -> None:
    config = synthesize(grade_identification(load_grade(name)), gnss=load_gnss("spp"))
    assert len(config.channels) == 6
    assert all(c.white_density > 0.0 and c.constant_sd > 0.0 for c in config.channels.values())


@pytest.mark.parametrize("name", RECEIVERS)
def test_every_receiver_is_positive_and_names_its_source(name: str) -> None:
    gnss = load_gnss(name)
    assert min(gnss.position_sd) > 0.0
    assert gnss.interval > 0.0
    assert gnss.gate > 0.0
    assert gnss.reference
    assert all(s.sd > 0.0 and s.time_constant > 0.0 for s in gnss.correlated)


def test_better_receivers_have_smaller_errors() -> None:
    order = ["spp", "sbas", "dgnss", "ppp", "rtk"]
    horizontal = [load_gnss(name).position_sd[0] for name in order]
    assert horizontal == sorted(horizontal, reverse=True)


def test_ring_laser_gyro_has_the_figures_of_the_paper() -> None:
    """Q = 0.29″ alone gives 0.0502 deg/h at 10 s; with N as deg/h/√Hz the sum is 0.0577."""
    found = grade_identification(load_grade("rlg")).channels["gyro_x"]
    sigma = found.sigma_10s.value
    assert sigma is not None
    assert sigma == pytest.approx(0.0577 * DEG_PER_HOUR, rel=2e-3)


def test_an_installed_package_finds_its_own_configurations(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "tuner"
    (package / "configs" / "sensors").mkdir(parents=True)
    monkeypatch.setattr(grades, "__file__", str(package / "catalogue" / "grades.py"))
    assert config_directory() == package / "configs"
    assert grade_names() == ()
    monkeypatch.setattr(grades, "__file__", str(tmp_path / "elsewhere" / "catalogue" / "grades.py"))
    with pytest.raises(DataError, match="expected a folder 'configs'"):
        config_directory()


def test_unknown_names_are_refused_with_the_known_ones() -> None:
    with pytest.raises(DataError, match=r"nosuch: expected a built-in grade \(.*stim300"):
        load_grade("nosuch")
    with pytest.raises(DataError, match=r"expected a built-in grade \(.*rtk"):
        load_gnss("nosuch")


def test_datasheet_becomes_an_identification_without_intervals(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(SHEET, encoding="utf-8")
    assert is_datasheet(path)
    found = read_datasheet(path)
    gyro, accel = found.channels["gyro_y"], found.channels["accel_z"]
    density = gyro.term("white").coefficients["density"]
    assert gyro.method == "datasheet"
    assert gyro.interval == pytest.approx(0.02)
    assert density.value == pytest.approx(0.01 * DEG / math.sqrt(2.0))
    assert density.interval is None
    assert density.reason == "datasheet maximum"
    level = gyro.term("bias_instability").coefficients["level"]
    assert level.value == pytest.approx(5.0 * DEG_PER_HOUR / ALLAN_FLOOR)
    assert accel.term("white").coefficients["density"].value == pytest.approx(0.001)
    level = accel.term("bias_instability").coefficients["level"]
    assert level.value == pytest.approx(50.0 * MICRO_G)
    assert level.reason == "datasheet typical"


def test_allan_minimum_of_a_sheet_is_what_it_quotes() -> None:
    found = grade_identification(load_grade("stim300")).channels["gyro_x"]
    assert found.minimum.value == pytest.approx(0.5 * DEG_PER_HOUR, rel=0.05)
    assert found.term("white").coefficients["density"].value == pytest.approx(0.15 * DEG_PER_SQRT_HOUR)


def test_the_example_datasheet_is_one() -> None:
    path = config_directory() / "examples" / "datasheet.yaml"
    assert is_datasheet(path)
    assert len(read_datasheet(path).channels) == 6
    assert not is_datasheet(config_directory() / "gnss" / "rtk.yaml")
    assert not is_datasheet(path.parent / "absent.yaml")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("unit: deg/h}", "unit: parsec}", "gyro.bias_instability.unit: expected a unit among rad/s"),
        ("unit: deg/h}", "unit: µg}", "gyro.bias_instability.unit: expected a unit among rad/s"),
        ("value: 0.01", "value: -1", "gyro.noise_density.value: expected a positive number, got -1"),
        ("bias_instability: {value: 5", "bias: {value: 5", "gyro: expected keys among"),
        ("sided: one", "sided: both", "gyro.noise_density.sided: expected 'one' or 'two'"),
        ("reading: level", "reading: peak", "accel.bias_instability.reading: expected one of level"),
        ("kind: maximum", "kind: rumour", "kind: expected one of typical, maximum, measured"),
        ("rate: 50", "rate: fast", "rate: expected a positive number, got 'fast'"),
        ("name: mine", "name: Mine-1", "name: expected lower-case letters and digits"),
        ("noise_density: {value: 0.06", "random_walk: {value: 0.06", "expected"),
        ("value: 5, ", "", "gyro.bias_instability: expected a key 'value'"),
    ],
)
def test_a_broken_datasheet_is_refused_in_one_line(old: str, new: str, message: str) -> None:
    assert old in SHEET
    with pytest.raises(DataError) as caught:
        parse_sheet(SHEET.replace(old, new), source="mine.yaml")
    assert message in str(caught.value)
    assert str(caught.value).startswith("mine.yaml")
    assert "\n" not in str(caught.value)


def test_a_sheet_without_sensors_is_refused() -> None:
    head = SHEET.partition("gyro:")[0]
    with pytest.raises(DataError, match="expected an entry 'gyro' or 'accel', got neither"):
        parse_sheet(head, source="mine.yaml")


def test_gauss_markov_entries_are_terms() -> None:
    entry = "  gauss_markov:\n    - {sd: {value: 3, unit: deg/h}, time_constant: {value: 2, unit: min}}\n"
    grade = parse_sheet(SHEET.replace("accel:\n", entry + "accel:\n"), source="mine.yaml")
    (state,) = grade.gyro.gauss_markov
    assert (state.value.sd, state.value.time_constant) == pytest.approx((3.0 * DEG_PER_HOUR, 120.0))
    config = synthesize(grade_identification(grade))
    assert config.channels["gyro_x"].markov[-1].time_constant == pytest.approx(120.0)


def test_a_broken_receiver_is_refused() -> None:
    with pytest.raises(DataError, match="position_sd: expected 3 numbers"):
        parse_gnss("format: tuner-gnss/1\nposition_sd: [1]\n", source="mine.yaml")


def test_a_figure_whose_square_no_number_holds_is_refused(tmp_path: Path) -> None:
    text = (Path(__file__).parents[3] / "configs" / "examples" / "datasheet.yaml").read_text()
    (tmp_path / "sheet.yaml").write_text(
        text.replace("value: 0.06, unit: m/s/√h", "value: 1e308, unit: m/s/√h")
    )
    with pytest.raises(DataError, match="expected figures of a sensor"):
        read_datasheet(tmp_path / "sheet.yaml")
