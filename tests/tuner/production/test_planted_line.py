"""Planted faults of a production line are named, good units pass: small lines of each fault, and a study of sixty."""

import csv
import re

import numpy as np
import pytest

from models.units import STANDARD_GRAVITY, to_si
from tests.tuner.production.planted_line import FAULTS, SIXTY, Line, write_line
from tuner.cli import run
from tuner.production.fleet import fleet, judged
from tuner.production.limits import GRAVITY, all_limits, read_limits
from tuner.report.fleet_answer import fleet_answer, reasons
from tuner.report.fleet_files import write_fleet
from tuner.report.terminal import text_of
from tuner.types import Coefficient
from tuner.types.fleet import FleetUnit, UnitMeasurement
from tuner.types.records import DataError

NAMED = {
    "noise": "gyro [xyz] N |noisy axis: gyro",
    "scale": "range register is set to half",
    "g": r"g read as m/s\^2",
    "warming": "either may be the cause",
    "steps": "steps: gyro_[xyz]",
    "dead": "dead",
    "swapped": "exchanged",
    "clock": "× 2.00",
}
"""What must be said of each fault, a regular expression."""
SMALL = Line("mpu9250", 120.0, 25.0, 5, drift=600.0, step=400.0, axis=1)


@pytest.fixture(scope="module")
def line(tmp_path_factory):
    """Fourteen units, the last eight of them faulty, judged by the sheet."""
    folder = tmp_path_factory.mktemp("line") / "line"
    write_line(SMALL, folder, 14, dict(enumerate(FAULTS, start=6)))
    store = folder.parent / "units"
    return fleet(folder, datasheet="mpu9250", store=store), folder, store


@pytest.mark.parametrize(("number", "fault"), list(enumerate(FAULTS, start=6)))
def test_a_planted_fault_is_named(line, number, fault):
    found = line[0]
    unit = found.units[number]
    assert unit.verdict in ("FAIL", "LOOK")
    assert (unit.verdict == "LOOK") <= (fault in ("warming", "steps"))
    assert re.search(NAMED[fault], " ".join(reasons(unit, found)))


def test_good_units_of_the_line_pass(line):
    assert [unit.verdict for unit in line[0].units[:6]] == ["PASS"] * 6


def test_the_page_and_the_screen_have_the_worst_first(line, tmp_path):
    found, _, _ = line
    text = text_of(fleet_answer(found))
    assert text.count("Not tested") == 1
    assert text.index(": FAIL:") < text.index(": LOOK:")
    write_fleet(found, tmp_path)
    with (tmp_path / "fleet.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert rows[6]["reason"].startswith("gyro y N")
    assert "2 × that of mpu9250" in rows[6]["limits"]
    page = (tmp_path / "fleet.html").read_text()
    assert page.rindex("SN06") < page.rindex("SN00")


def test_a_line_that_is_taken_up_again_has_the_same_bytes(line, tmp_path):
    found, folder, store = line
    again = fleet(folder, datasheet="mpu9250", store=store)
    assert again.measured == 0
    for name in write_fleet(found, tmp_path / "one"):
        write_fleet(again, tmp_path / "two")
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_a_limit_of_the_ramp_or_the_temperature_judges_a_warming_unit(line, tmp_path):
    """The warming unit is named without a limit; a wide one lets it pass, and a narrow one fails it."""
    found, _, _ = line
    warming = found.units[9]
    for limits, verdict in (
        ("gyro: {temperature_slope: 900 deg/h/K}", "PASS"),
        ("gyro: {temperature_slope: 9 deg/h/K}", "FAIL"),
        ("gyro: {ramp: 1 deg/h/s}", "FAIL"),
        ("gyro: {allan_deviation_10s: 1 deg/h}", "FAIL"),
        ("temperature: {warm_up: 5 K}", "FAIL"),
    ):
        path = tmp_path / "limits.yaml"
        path.write_text(f"format: tuner-limits/1\n{limits}\n")
        assert judged("lot", [warming], read_limits(path)).units[0].verdict == verdict


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("gyro: {temperature_slope: 9 deg/h}", "deg/h/K"),
        ("temperature: {warm_up: 5 deg}", "K"),
        ("temperature: {N: 5 K}", "warm_up"),
    ],
)
def test_wrong_limits_of_the_temperature_are_refused(tmp_path, text, said):
    path = tmp_path / "limits.yaml"
    path.write_text(f"format: tuner-limits/1\n{text}\n")
    with pytest.raises(DataError, match=said):
        read_limits(path)


@pytest.mark.parametrize(
    ("ratio", "cause"),
    [(1.96, "where a range register is set to half"), (9.8, "m/s^2 read as g"), (1.3, "")],
)
def test_accelerometers_that_miss_gravity_are_told_in_g_without_any_limit(ratio, cause):
    excess = (ratio - 1.0) * STANDARD_GRAVITY
    one = UnitMeasurement(
        "", 50.0, 240.0, {"accel": "m/s^2"},
        {"accel.mean": Coefficient.known(excess, excess - 1e-3, excess + 1e-3, "m/s^2")},
    )  # fmt: skip
    (unit,) = judged("lot", [FleetUnit("u", "u.csv", one)], (GRAVITY,)).units
    assert unit.verdict == "FAIL"
    assert unit.broken[0].startswith(f"accel reads {ratio:.2f} g at rest")
    assert cause in unit.broken[0]


def test_a_unit_without_the_accelerometers_of_the_others_is_open():
    """It passed every limit of a sheet that it could not show."""
    level = {"accel.mean": Coefficient.known(0.0, -1e-3, 1e-3, "m/s^2")}
    whole = UnitMeasurement("", 50.0, 240.0, {"gyro_x": "rad/s", "accel": "m/s^2"}, level)
    part = UnitMeasurement("", 50.0, 240.0, {"gyro_x": "rad/s"}, {})
    rows = [FleetUnit(f"u{i}", f"u{i}.csv", part if i == 2 else whole) for i in range(3)]
    units = judged("lot", rows, (GRAVITY,)).units
    assert units[2].verdict == "OPEN"
    assert units[2].broken == ("accel is not in this log",)
    assert units[0].broken == ()


def test_a_copy_of_a_log_is_counted_once(line, tmp_path):
    write_line(SMALL, tmp_path / "lot", 2, {})
    (tmp_path / "lot" / "copy.csv").write_bytes(sorted((tmp_path / "lot").iterdir())[0].read_bytes())
    units = fleet(tmp_path / "lot").units
    assert [unit.verdict for unit in units].count("ERROR") == 1
    assert any("byte for byte" in (unit.error or "") for unit in units)


@pytest.mark.parametrize(
    ("rows", "value", "said"),
    [
        (slice(200, 3000, 500), 0.5, "readings that no sensor makes"),
        (slice(1000, 2000), None, "missing or left out"),
    ],
)
def test_readings_that_are_wrong_or_lost_are_to_be_seen(tmp_path, rows, value, said):
    """A unit with spikes of 160 sds, or without a third of its samples, was PASS without a word."""
    write_line(SMALL, tmp_path / "lot", 1, {})
    (path,) = (tmp_path / "lot").iterdir()
    head, *lines = path.read_text().splitlines()
    for index in range(*rows.indices(len(lines))):
        cells = lines[index].split(",")
        lines[index] = "" if value is None else ",".join([*cells[:3], str(value), *cells[4:]])
    path.write_text("\n".join([head, *filter(None, lines)]))
    (unit,) = fleet(path).units
    assert unit.verdict == "LOOK"
    assert said in unit.advice[0]


def test_a_warming_that_ends_is_told_whole(tmp_path):
    """25 K to 33 K as 1 − exp(−t/60 s): a line through it says 5.5 K, and 6 K were not exceeded; it has no step."""
    write_line(SMALL, tmp_path / "lot", 1, {})
    (path,) = (tmp_path / "lot").iterdir()
    lines = path.read_text().splitlines()
    head = lines[0].split(",")
    rows = np.array([[float(x) for x in line.split(",")] for line in lines[1:]])
    t = rows[:, 0]
    rows[:, -1] = 25.0 + 8.0 * (1.0 - np.exp(-t / 40.0))
    rows[:, head.index(next(one for one in head if "gyro" in one))] += 0.02 * (1.0 - np.exp(-t / 40.0))
    np.savetxt(path, rows, delimiter=",", header=lines[0], comments="")
    (unit,) = fleet(path).units
    assert unit.measurement.quantities["temperature.warm_up"].value == pytest.approx(7.6, abs=0.3)
    assert not any(key.endswith("steps") for key in unit.measurement.causes)
    assert any(key.endswith("warming") for key in unit.measurement.causes)


def test_limits_follow_from_a_sheet_unless_they_are_stated(line):
    limits = {(one.sensor, one.symbol): one for one in line[0].limits}
    # The sheet of the MPU-9250 has 0.01 deg/s/√Hz, one-sided, and 10 mg and 3 % beside standard gravity.
    assert limits["gyro", "N"].largest == pytest.approx(2.0 * to_si(0.01, "deg/s/√Hz") / np.sqrt(2.0))
    assert limits["accel", "mean"].largest == pytest.approx(
        STANDARD_GRAVITY * (5.0 * np.hypot(0.01, 0.03) + 0.003)
    )
    assert all(one.basis for one in limits.values())
    stated = limits["gyro", "N"].__class__("gyro", "N", 1.0)
    assert {one.largest for one in all_limits([stated], None)} == {1.0, GRAVITY.largest}


def test_the_command_takes_a_sheet(line, tmp_path, capsys):
    _, folder, store = line
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "units").symlink_to(store)
    how = ["fleet", str(folder), "-o", str(tmp_path / "out"), "--jobs", "1", "--datasheet"]
    assert run([*how, "mpu9250", "--strict"]) == 1
    assert "6 PASS, 1 LOOK, 7 FAIL, 0 OPEN" in " ".join(capsys.readouterr().out.split())
    assert run([*how, "mpu925"]) == 2
    assert "expected a file or a built-in grade" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    "sixty",
    [
        Line("mpu9250", 240.0, 50.0, 1),
        Line("adis16465", 200.0, 100.0, 2, noise=2.2, drift=120.0, warmth=8.0, step=60.0, axis=2),
        Line("bmi088", 180.0, 50.0, 3, noise=2.5, drift=-200.0, warmth=10.0, step=-100.0, axis=1),
    ],
)
def test_seven_of_eight_faults_among_sixty_units_are_named(sixty, tmp_path):
    """With the sheet and without it; at most one good unit is accused."""
    folder = tmp_path / "line"
    write_line(sixty, folder, 60, SIXTY)
    for sheet in (None, sixty.grade):
        found = fleet(folder, datasheet=sheet, store=tmp_path / "units")
        accused = [number for number, unit in enumerate(found.units) if unit.verdict in ("FAIL", "LOOK")]
        named = [
            number
            for number, fault in SIXTY.items()
            if re.search(NAMED[fault], " ".join(reasons(found.units[number], found)))
        ]
        assert len(set(named) & set(accused)) >= 7, (sheet, named)
        assert len(set(accused) - SIXTY.keys()) <= 1, (sheet, accused)
