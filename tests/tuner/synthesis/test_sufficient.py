"""What a filter cannot be configured from, and what is not the sensor's own."""

from __future__ import annotations

import pytest

from tuner import choose, compare, tune
from tuner.catalogue.grades import grade_identification, load_grade
from tuner.exporters import export, withheld
from tuner.identification.identify_source import identify_source
from tuner.report.result_set import tune_files
from tuner.report.sensor_answers import comparison_answer
from tuner.synthesis import synthesize
from tuner.synthesis.sufficient import lacking_slow_bias
from tuner.types import Identification
from tuner.types.borrowed import borrowed, borrowed_words

SHEET = """format: tuner-datasheet/1
name: whiteonly
title: Sheet of white noise alone
kind: typical
rate: 100
reference: made by hand
gyro:
  noise_density: {value: 2.8, unit: mdeg/s/√Hz, sided: one}
  turn_on_sd: {value: 0.5, unit: deg/s}
accel:
  noise_density: {value: 70, unit: µg/√Hz, sided: one}
"""


@pytest.fixture
def sheet(tmp_path):
    path = tmp_path / "whiteonly.yaml"
    path.write_text(SHEET, encoding="utf-8")
    return path


def test_a_sheet_without_a_slow_bias_lacks_it_for_each_sensor(sheet):
    found = lacking_slow_bias(identify_source(sheet))
    assert found.keys() == {"gyro", "accel"}
    # The range is that of named built-in sheets, in the unit and convention of a sheet (Allan minimum).
    assert "usual is 0.50 to 10 deg/h, the Allan minimum, by the built-in sheets" in found["gyro"]
    assert "icm20602" in found["gyro"]
    assert "µg" in found["accel"]


def test_settings_and_the_noise_that_they_are_made_from_agree(sheet):
    for source in (sheet, "rlg", "icm20602", "fog"):
        noise = identify_source(source)
        assert lacking_slow_bias(synthesize(noise)) == lacking_slow_bias(noise)


def test_a_sheet_with_bias_instability_alone_is_written(sheet):
    sheet.write_text(SHEET + "  bias_instability: {value: 40, unit: µg}\n", encoding="utf-8")
    assert lacking_slow_bias(identify_source(sheet)).keys() == {"gyro"}
    noise = identify_source("icm20602")  # B and no K
    assert withheld(synthesize(noise)) is None
    assert export(synthesize(noise), "kalibr")


def test_tune_writes_no_file_from_such_a_sheet_and_says_why(sheet):
    result = tune(sheet)
    assert result.exports == {}
    assert set(result.withheld) == {"noise.yaml", "kalibr.yaml", "kf-gins.yaml"}
    assert all("record 3 h at rest" in why for why in result.withheld.values())
    assert not any(name.endswith(".yaml") for name in tune_files(result))


def test_compare_and_choose_give_such_a_sheet_no_rank(sheet):
    found = compare("icm20602", sheet)
    assert found.drift[0] is not None
    assert found.drift[1] is None
    assert set(found.unranked) == {"whiteonly"}
    assert any(
        "whiteonly has no rank" in text for text in comparison_answer(found).parts if isinstance(text, str)
    )
    assert "rlg" not in {one.name for one in choose().ranking}  # its gyroscopes state white noise alone


def test_terms_of_a_built_in_sensor_are_named_by_axis():
    noise = grade_identification(load_grade("icm20602"))
    gyros = Identification(
        noise.source, {a: c for a, c in noise.channels.items() if a.startswith("gyro")}, ()
    )
    config = synthesize(gyros, complete=load_grade("mpu9250"))
    assert borrowed(config) == dict.fromkeys(("accel_x", "accel_y", "accel_z"), "mpu9250")
    (words,) = borrowed_words(config)
    assert words.startswith("noise of accel_x, accel_y, accel_z is ASSUMED from the built-in sensor mpu9250")
    assert f"# {words}" in export(config, "kalibr")
    assert borrowed(synthesize(noise)) == {}


def test_noise_yaml_marks_what_is_not_stated_and_what_is_assumed():
    # Until now a term that a sheet does not state was a "none" behind its 0, like a measured one.
    noise = identify_source("icm20602")  # states B, not K
    text = export(synthesize(noise), "native")
    assert text.count("random_walk_density: 0.0  # rad/s/√s; not stated: left out") == 3
    assert "ASSUMED" not in text
    gyros = Identification(
        noise.source, {a: c for a, c in noise.channels.items() if a.startswith("gyro")}, ()
    )
    text = export(synthesize(gyros, complete=load_grade("mpu9250")), "native")
    lines = [line for line in text.splitlines() if "white_density" in line]
    assert ["ASSUMED from mpu9250, not yours" in line for line in lines] == [False] * 3 + [True] * 3
