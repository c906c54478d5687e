"""Advice is tried before it is printed; where no reading is left, the line says what was measured."""

from __future__ import annotations

import re
import sys
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from tests.tuner.readers.plain_logs import ACCEL, COUNT, HEADER, T, notes, refused, rows, write
from tuner.cli import run
from tuner.formats import noise_yaml, packages
from tuner.readers import parse_columns, read
from tuner.readers.drive import read_drive
from tuner.readers.refusal import Change, without_options
from tuner.types.records import DataError

GYRO = np.random.default_rng(2).normal(0.01, 2e-3, (COUNT, 3))
SI = (
    "t [s],"
    + ",".join(f"gyro_{a} [rad/s]" for a in "xyz")
    + ","
    + ",".join(f"accel_{a} [m/s^2]" for a in "xyz")
)


def advice(message: str) -> dict[str, object]:
    """The first reading that a line recommends, as arguments of `read`."""
    first = message.split(": pass ")[1].split(", or ")[0]
    found: dict[str, object] = {f"{s}_unit": u for s, u in re.findall(r"--(gyro|accel)-unit (\S+)", first)}
    columns = re.search(r"--columns '([^']*)'", first)
    return found | ({"columns": parse_columns(columns[1])} if columns else {})


def test_sums_are_no_rates_in_a_small_unit(tmp_path: Path) -> None:
    """BerryIMU prints the angle summed up, in deg: read as increments at a rate, only deg/h seemed to fit."""
    sums = 12.0 + np.cumsum(np.degrees(GYRO + 0.05), axis=0) * 0.01
    path = write(tmp_path / "log.csv", rows(T, sums), SI.replace("rad/s", "deg"))
    message = refused(path, "gyro .* no rate of a unit at rest does; gyro may hold sums, the angle turned")
    assert "--" not in message


def test_samples_of_half_size_are_in_no_other_unit(tmp_path: Path) -> None:
    """At 200 Hz, 4.9 m/s² is gravity in cm/s of an interval; gyroscopes in rad/s are then no increments."""
    path = write(tmp_path / "log.csv", rows(0.5 * T, GYRO / 2.0, ACCEL / 2.0), SI)
    message = refused(
        path, r"accel reads 4.9\d* m/s\^2 at rest, 0.5 × gravity: .* may be half of what was measured"
    )
    assert "--" not in message


def test_a_scale_that_is_no_unit_is_said_first(tmp_path: Path) -> None:
    gyro, _ = read(write(tmp_path / "log.csv", rows(T, GYRO, 1.335 * ACCEL), SI))
    assert gyro.assumptions[0].startswith("accel reads 13.09 m/s^2 at rest in m/s^2, 1.3")
    assert gyro.contradicted == ("accel, which reads 1.33 × gravity at rest",)
    settled, _ = read(write(tmp_path / "log.csv", rows(T, GYRO, ACCEL), SI))
    assert not settled.contradicted


def test_samples_a_thousand_times_too_large_are_no_exchanged_triads(tmp_path: Path) -> None:
    """As accelerometers in ft/s² and gyroscopes in deg/h they would fit, and gyro noise be 30 times too small."""
    path = write(tmp_path / "log.csv", rows(T, 1e3 * (GYRO - [0.0, 0.03, 0.0]), 1e3 * ACCEL), SI)
    assert "--columns" not in refused(path, "1e\\+03 × gravity")


def test_triads_that_are_exchanged_are_read_by_the_option_that_says_so(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", rows(T, ACCEL, GYRO), SI)
    gyro, accel = read(path, **advice(refused(path, "--columns 'gyro_x=accel_x \\[rad/s\\],")))  # type: ignore[arg-type]
    np.testing.assert_array_equal(gyro.y, GYRO)
    np.testing.assert_array_equal(accel.y, ACCEL)


@pytest.mark.parametrize("letters", ["x", "z", "xy", "yz"])
@pytest.mark.parametrize("header", [HEADER, SI])
def test_axes_that_are_exchanged_are_read_by_the_option_that_says_so(
    tmp_path: Path, letters: str, header: str
) -> None:
    """The whole triads or deg/s were named: followed, N was up to 57 times too small."""
    quiet = 0.1 * GYRO
    gyro, accel = quiet.copy(), ACCEL.copy()
    for axis in map("xyz".index, letters):
        gyro[:, axis], accel[:, axis] = ACCEL[:, axis], quiet[:, axis]
    path = write(tmp_path / "log.csv", rows(T, gyro, accel), header)
    message = refused(path, f"gyro_{letters[0]} and accel_{letters[0]}.* may be exchanged: .* pass --columns")
    assert "-unit" not in message
    for record, truth in zip(read(path, **advice(message)), (quiet, ACCEL), strict=True):  # type: ignore[arg-type]
        np.testing.assert_array_equal(record.y, truth)


def test_vibration_about_one_axis_is_no_exchange(tmp_path: Path) -> None:
    """Accelerometers and gyroscopes are both noisier there; of exchanged axes the former are as quiet as the latter."""
    rng = np.random.default_rng(11)
    shaken = [np.outer(rng.normal(0.0, sd, COUNT), [0.0, 0.0, 1.0]) for sd in (0.01, 0.3)]
    path = write(tmp_path / "log.csv", rows(T, 0.1 * GYRO + shaken[0], ACCEL + shaken[1]), SI)
    np.testing.assert_allclose(read(path)[1].y, ACCEL + shaken[1])


def test_triads_that_are_exchanged_with_their_registers_have_no_reading(tmp_path: Path) -> None:
    """A driver scales counts of the accelerometers as rates: no option mends that."""
    raw = np.rint(ACCEL / 9.80665 * 16384) * np.radians(1 / 131), np.rint(GYRO / np.radians(1 / 131)) * 6e-4
    message = refused(
        write(tmp_path / "log.csv", rows(T, *raw), SI), "125 deg/s: the columns .* may be exchanged"
    )
    assert "--" not in message


def test_a_steady_bias_in_place_of_gravity_is_exchanged_all_the_same(tmp_path: Path) -> None:
    """A rate of 1 deg/s, scaled as accelerometers, is as steady as gravity, but a hundredth of it."""
    raw = ACCEL / 9.80665 * 1.1, 0.2 + GYRO
    refused(write(tmp_path / "log.csv", rows(T, *raw), SI), "63 deg/s: the columns .* may be exchanged")


def test_gravity_in_another_unit_is_no_exchanged_gyroscope(tmp_path: Path) -> None:
    """Accelerometers in g beside a bias of 3 deg/s, neither unit stated."""
    path = write(
        tmp_path / "log.csv",
        rows(T, np.degrees(GYRO) + np.array([3.0, 0.0, 0.0]), ACCEL / 9.80665),
        "t,gx,gy,gz,ax,ay,az",
    )
    assert "exchanged" not in refused(path, "--accel-unit g --gyro-unit deg/s")


def test_two_statements_are_not_wrong_at_once(tmp_path: Path) -> None:
    """Exchanged triads in other units than the stated ones: among enough units some fit any numbers."""
    drift = 9.80665 * np.array([0.06, -0.05, 0.07]) + GYRO
    head = (
        "t [s],accel_x [m/s^2],accel_y [m/s^2],accel_z [m/s^2],gyro_x [deg/s],gyro_y [deg/s],gyro_z [deg/s]"
    )
    path = write(tmp_path / "log.csv", rows(T, 1.61 * ACCEL, drift), head)
    assert "--columns" not in refused(path, "1.61 × gravity")


def test_whole_numbers_under_names_of_mavlink_have_its_units_among_the_readings(tmp_path: Path) -> None:
    """ArduPilot issue 15652: the gyroscopes' count could not be stated from the log alone."""
    counts = np.rint(1e3 * GYRO), np.rint(1e3 * ACCEL / 9.80665)
    path = write(tmp_path / "log.csv", rows(T, *counts), "t [s],xgyro,ygyro,zgyro,xacc,yacc,zacc")
    message = refused(path, "where xgyro is a scaled reading of MAVLink")
    gyro, accel = read(path, **advice(message.split(" where xgyro")[0]))  # type: ignore[arg-type]
    np.testing.assert_allclose(gyro.y, 1e-3 * counts[0])
    np.testing.assert_allclose(accel.y, 9.80665e-3 * counts[1])


def test_samples_of_0_6_times_gravity_are_not_half_of_what_was_measured(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", rows(T, GYRO, 0.6 * ACCEL), SI)
    assert "twice as large" not in refused(path, "0.6 × gravity")
    half = write(tmp_path / "half.csv", rows(T, GYRO, 0.5 * ACCEL), SI)
    refused(half, "twice as large they fit")


def test_increments_that_are_called_rates_are_named_together(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", rows(T, 0.01 * GYRO, 0.01 * ACCEL), SI)
    assert advice(refused(path, "0.01 × gravity")) == {"accel_unit": "m/s", "gyro_unit": "rad"}


def test_stamps_in_seconds_that_are_called_milliseconds(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", rows(T + 302400.0, GYRO), SI.replace("t [s]", "tow(msec)"))
    message = refused(path, r"1e\+05 Hz in ms, as the file states, .*: pass --columns 't=tow \[s\]'$")
    assert read(path, **advice(message))[0].rate == pytest.approx(100.0)  # type: ignore[arg-type]


def test_a_counter_of_samples_takes_the_rate_that_is_asked_for(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", rows(np.rint(100.0 * T), GYRO), SI.replace("t [s]", "t"))
    refused(path, "it counts by one, as a counter of samples does.*pass --rate HZ")
    assert read(path, rate=250.0)[0].rate == pytest.approx(250.0)


def test_the_ticks_of_xsens_are_those_of_either_device(tmp_path: Path) -> None:
    for step, rate in ((16667.0, 60.0), (100.0, 100.0)):
        path = write(
            tmp_path / "log.csv", rows(step * 100.0 * T, GYRO), SI.replace("t [s]", "SampleTimeFine")
        )
        assert read(path)[0].rate == pytest.approx(rate, rel=1e-4)


def test_the_scales_of_a_gcsv(tmp_path: Path) -> None:
    head = "GYROFLOW IMU LOG\ntscale,0.0018\ngscale,0.0005\nascale,0.00048828125\nt,gx,gy,gz,ax,ay,az"
    counts = np.rint(GYRO / 0.0005), np.rint(ACCEL / 9.80665 / 0.00048828125)
    gyro, accel = read(write(tmp_path / "log.gcsv", rows(100.0 * T, *counts), head))
    assert gyro.rate == pytest.approx(1.0 / 0.0018)
    np.testing.assert_allclose(gyro.y, GYRO, atol=0.0005)
    np.testing.assert_allclose(accel.y, ACCEL, atol=0.005)


def test_kalibr_calls_the_specific_force_alpha(tmp_path: Path) -> None:
    header = HEADER.replace("gyro", "omega").replace("accel", "alpha")
    assert [r.name for r in read(write(tmp_path / "log.csv", rows(T, GYRO), header))] == ["gyro", "accel"]


def test_two_topics_in_one_table_are_read_one_at_a_time(tmp_path: Path) -> None:
    """PlotJuggler issue 1038: rows of one topic leave the cells of the other empty."""
    lines = [text for row in rows(T, GYRO) for text in (_without(row, 4), _without(row, 1))]
    path = write(tmp_path / "log.csv", lines, SI)
    gyro, accel = read(path)
    (alone,) = read(path, columns={"accel": "none"})
    np.testing.assert_array_equal(gyro.y, GYRO)
    np.testing.assert_array_equal(alone.y, GYRO)
    assert (gyro.name, accel.name, len(accel)) == ("gyro", "accel", len(GYRO))
    assert not any("not used" in note for record in (gyro, accel, alone) for note in record.notes)


def _without(row: str, first: int) -> str:
    cells = row.split(",")
    return ",".join([*cells[:first], "", "", "", *cells[first + 3 :]])


def test_a_print_of_messages_is_called_that(tmp_path: Path) -> None:
    one = "angular_velocity: \n  x: 0.1\n  y: 0.2\n  z: 0.3\ncovariance: [0.0, 0.0, 0.0]\n---\n"
    path = tmp_path / "log.txt"
    path.write_text(50 * one)
    refused(path, "messages printed as YAML, such as by rostopic echo")


@pytest.mark.parametrize(
    ("name", "text"), [("noise.yaml", "format: ins-noise/1\nseed: 3\n"), ("o.json", '{"a": [1, 2]}')]
)
def test_what_was_made_of_a_log_is_no_log(tmp_path: Path, name: str, text: str) -> None:
    """`diagnose noise.yaml` said "messages printed as YAML, such as by rostopic echo"."""
    (tmp_path / name).write_text(text.replace("ins-noise/1", noise_yaml.FORMAT))
    refused(tmp_path / name, "has no samples: give the log that it was made of")


def test_a_line_states_no_option_that_its_command_lacks(tmp_path: Path) -> None:
    line = "log.csv: 5 Hz, expected more: pass --rate HZ, or --gyro-unit deg/s"
    assert without_options(line, frozenset(["--rate"])) == "log.csv: 5 Hz, expected more: pass --rate HZ"
    write(tmp_path / "imu.csv", rows(1e3 * T, GYRO))
    (tmp_path / "gnss.csv").write_text("t,lat,lon,h\n0,48,11,500\n")
    with pytest.raises(DataError, match=r"100 Hz in ms.*: write 't \[ms\]' into the header") as caught:
        read_drive(tmp_path)
    assert "--" not in str(caught.value)


def test_what_is_lacking_is_installed_by_its_own_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """The package stands on no index, so that ``pip install 'ins-noise-tuner[ulog]'`` fails."""
    line = packages.install("ulog", "pyulog")
    assert re.fullmatch(r"\S+ -m pip install '?pyulog(>=[\d.]+'|)", line), line
    monkeypatch.setattr(metadata, "requires", lambda name: None)
    assert packages.install("ulog", "pyulog").endswith("pip install pyulog")
    assert packages.python() in ("python", sys.executable)


def test_a_change_is_written_as_it_is_typed() -> None:
    both = Change(columns={"t": "t [ms]"}).with_(Change({"gyro": "deg/s"}))
    assert str(both) == "--columns 't=t [ms]' --gyro-unit deg/s"


def test_what_is_assumed_stays_without_advice(tmp_path: Path) -> None:
    assert "--accel-unit" not in notes(write(tmp_path / "log.csv", rows(T, GYRO), SI))


def test_columns_of_a_wide_array_are_those_in_which_gravity_is_seen(tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", imu0=np.hstack([GYRO, ACCEL]))
    message = refused(tmp_path / "log.npz", "pass --columns 'gyro=imu0.0:3.,accel=imu0.3:6.'$")
    _, accel = read(tmp_path / "log.npz", rate=100.0, **advice(message))  # type: ignore[arg-type]
    np.testing.assert_array_equal(accel.y, ACCEL)


def test_an_array_of_one_triad_and_its_time_is_read_by_the_advice(tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", accelBuffer=np.column_stack([T, ACCEL / 9.80665]))
    message = refused(
        tmp_path / "log.npz", "pass --columns 't=accelBuffer.0.,accel=accelBuffer.1:4.' --accel-unit g$"
    )
    (accel,) = read(tmp_path / "log.npz", **advice(message))  # type: ignore[arg-type]
    np.testing.assert_allclose(accel.y, ACCEL)


def test_objects_of_matlab_are_told_as_such(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A timetable of MATLAB Mobile: no array in it, so no columns to choose."""
    fields = np.array([(b"a", b"MCOS", b"timetable", 0)], [(name, "O") for name in ("s0", "s1", "s2", "arr")])
    monkeypatch.setattr(
        scipy.io, "loadmat", lambda *_, **__: {"None": fields.view(scipy.io.matlab.MatlabOpaque)}
    )
    (tmp_path / "log.mat").write_bytes(b"MATLAB 5.0 MAT-file".ljust(128))
    message = refused(
        tmp_path / "log.mat", r"found no numbers \(objects of MATLAB \(timetable\) are left out"
    )
    assert "--columns" not in message


def test_a_command_prints_the_advice_it_can_take(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / "log.csv", rows(T + 302400.0, GYRO), SI.replace("t [s]", "tow(msec)"))
    assert run(["identify", str(path)]) == 2
    assert "pass --columns 't=tow [s]'" in capsys.readouterr().err


@pytest.mark.parametrize("extra", ["a temperature", "a counter"])
def test_an_array_of_eight_columns_has_its_time_among_them(tmp_path: Path, extra: str) -> None:
    """Time, both sensors and one column more, before or behind them."""
    first, last = ([], [np.full(COUNT, 25.0)]) if extra == "a temperature" else ([np.arange(COUNT)], [])
    np.savez(tmp_path / "log.npz", np.column_stack([*first, T, GYRO, ACCEL, *last]))
    at = len(first)
    message = refused(
        tmp_path / "log.npz", rf": pass --columns 't=arr_0\[{at}\],gyro=arr_0\[{at + 1}:{at + 4}\]"
    )
    assert "--rate" not in message
    gyro, accel = read(tmp_path / "log.npz", **advice(message))  # type: ignore[arg-type]
    np.testing.assert_array_equal(gyro.y, GYRO)
    np.testing.assert_array_equal(accel.y, ACCEL)
