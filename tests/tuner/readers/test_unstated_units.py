"""A unit that the file does not state is found by gravity or the Earth's rate, assumed with a note, or requested."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.tuner.readers.plain_logs import ACCEL, COUNT, GYRO, HEADER, T, notes, refused, rows, write
from tuner.readers import read


def cure(message: str) -> dict[str, object]:
    """The options that a message says to pass, as arguments of `read`."""
    found = re.findall(r"--(accel|gyro)-(unit|scale) ([\w/^.]+)", message.split(" or --")[0])
    return {f"{sensor}_{what}": value if what == "unit" else float(value) for sensor, what, value in found}


def test_noise_without_gravity_is_taken_as_si_only_where_that_is_stated(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", rows(accel=ACCEL - ACCEL.mean(axis=0)))
    message = refused(path, "accel reads .* × gravity, and nothing states its unit; no reading fits")
    assert "--" not in message
    assert "accel: m/s^2 assumed, as --assume si says" in notes(path, assume="si")
    assert "unit could not be checked" in notes(path, accel_unit="m/s^2")


@pytest.mark.parametrize(
    ("unit", "size"),
    [("g", 9.80665), ("mg", 9.80665e-3), ("cm/s^2", 0.01), ("ft/s^2", 0.3048), ("m/s", 100.0)],
)
def test_accelerometers_in_another_unit_are_refused_with_it(tmp_path: Path, unit: str, size: float) -> None:
    factor = 0.01 if unit == "m/s" else 1.0
    path = write(tmp_path / "log.csv", rows(gyro=0.3 * GYRO * factor, accel=ACCEL / size))
    gyro_unit = "rad" if unit == "m/s" else "rad/s"
    message = refused(path, f"--accel-unit {re.escape(unit)} --gyro-unit {gyro_unit}(,|$)")
    _, accel = read(path, **cure(message))  # type: ignore[arg-type]
    np.testing.assert_allclose(accel.y, ACCEL, rtol=1e-9)


def test_counts_of_an_accelerometer_are_refused_with_their_scale(tmp_path: Path) -> None:
    counts = np.rint(ACCEL / 9.80665 * 8192)
    message = refused(
        write(tmp_path / "log.csv", rows(accel=counts)), "--accel-unit g --accel-scale 0.00012207 --gyro-unit"
    )
    _, accel = read(tmp_path / "log.csv", **cure(message))  # type: ignore[arg-type]
    np.testing.assert_allclose(accel.y, ACCEL, atol=9.81 / 8192)


def test_gyroscopes_beside_accelerometers_in_g_are_not_assumed(tmp_path: Path) -> None:
    quiet = np.random.default_rng(3).normal(1e-3, 1e-3, (COUNT, 3))
    path = write(tmp_path / "log.csv", rows(gyro=quiet, accel=ACCEL / 9.80665))
    refused(
        path, "accel is in g, and nothing states the unit of gyro: pass --gyro-unit deg/s", accel_unit="g"
    )


@pytest.mark.parametrize("size", [1e-100, 1e-300])
def test_a_signal_that_no_sensor_resolves(tmp_path: Path, size: float) -> None:
    header = re.sub(r"(gyro_.)", r"\1 [rad/s]", HEADER)
    refused(write(tmp_path / "log.csv", rows(gyro=GYRO * size), header), "which no sensor resolves")


def test_readings_beyond_every_unit_are_refused_with_their_size(tmp_path: Path) -> None:
    header = re.sub(r"(gyro_.)", r"\1 [rad/s]", HEADER)
    path = write(tmp_path / "log.csv", rows(gyro=GYRO * 1e300), header)
    refused(
        path, r"gyro reads up to [34]\.\d+e\+298 rad/s, and no sensor does in any unit: choose other columns"
    )


@pytest.mark.parametrize("white", [0.002, 0.01, 0.03])
def test_gyroscopes_in_degrees_are_refused_with_the_unit(tmp_path: Path, white: float) -> None:
    """White noise of built-in MEMS gyroscopes, deg/s/√Hz, is more than any sensor has in rad/s/√Hz."""
    y = np.random.default_rng(4).normal(0.1, white * 10.0, (COUNT, 3))
    message = refused(write(tmp_path / "log.csv", rows(gyro=y)), "pass --gyro-unit deg/s, or")
    gyro, _ = read(tmp_path / "log.csv", **cure(message))  # type: ignore[arg-type]
    np.testing.assert_allclose(gyro.y, np.deg2rad(y), rtol=1e-9)
    assert "gyro: rad/s assumed, as --assume si says" in notes(tmp_path / "log.csv", assume="si")


def test_the_step_of_a_gyroscope_tells_its_unit(tmp_path: Path) -> None:
    """A quiet gyroscope of ± 250 deg/s in 16 bits: noise and bias alone would allow both units."""
    degrees = np.rint(np.random.default_rng(5).normal(0.0, 1.5, (COUNT, 3))) / 131.0
    path = write(tmp_path / "log.csv", rows(gyro=degrees))
    refused(path, "multiples of a step that gyroscopes have in deg/s.*--gyro-unit deg/s")
    assert "the step of its samples" in notes(write(tmp_path / "log.csv", rows(gyro=np.deg2rad(degrees))))


def test_a_gyroscope_that_turns_as_the_earth_tells_its_unit(tmp_path: Path) -> None:
    earth = np.rad2deg(7.292115e-5) * np.array([0.6, 0.0, -0.8])
    path = write(
        tmp_path / "log.csv", rows(gyro=np.random.default_rng(6).normal(0.0, 1e-3, (COUNT, 3)) + earth)
    )
    refused(path, "turns as the Earth does in deg/s.*--gyro-unit deg/s")


def test_an_open_unit_is_assumed_with_what_another_would_change(tmp_path: Path) -> None:
    gyro, _ = read(
        write(tmp_path / "log.csv", rows(gyro=np.random.default_rng(7).normal(1e-3, 1e-3, (COUNT, 3))))
    )
    assert "gyro: rad/s assumed, as nothing states the unit" in gyro.assumptions[0]
    assert (
        "every number of the gyro is 57.3 times too large for samples in deg/s: --gyro-unit deg/s states another"
        in gyro.assumptions[0]
    )
    assert gyro.notes[: len(gyro.assumptions)] == gyro.assumptions


def test_a_stated_unit_that_gravity_contradicts_is_refused(tmp_path: Path) -> None:
    header = re.sub(r"(accel_.)", r"\1 [m/s^2]", HEADER)
    path = write(tmp_path / "log.csv", rows(accel=ACCEL / 9.80665), header)
    message = refused(
        path,
        r"reads 0.9997 m/s\^2 at rest, 0.102 × gravity: the unit m/s\^2 is wrong by 9.81x, as g read as m/s\^2: pass "
        "--accel-unit g",
    )
    _, accel = read(path, **cure(message))  # type: ignore[arg-type]
    np.testing.assert_allclose(accel.y, ACCEL, rtol=1e-9)


def test_rates_beside_increments_are_not_assumed(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", rows(gyro=GYRO * 0.01, accel=ACCEL * 0.01))
    refused(path, "accel is in m/s, an increment.*--gyro-unit rad, or --gyro-unit deg", accel_unit="m/s")


def test_seven_columns_of_rates_are_refused_with_the_numbers_of_the_file(tmp_path: Path) -> None:
    """KF-GINS writes increments so; of rates in m/s² deg/s was named first, in which N was 57 times too small."""
    quiet = 0.1 * GYRO
    path = tmp_path / "log.txt"
    path.write_text("\n".join(row.replace(",", " ") for row in rows(gyro=quiet)) + "\n")
    message = refused(
        path,
        r"accel reads 980\.\d m/s\^2 \(increments of 9\.80\d m/s ÷ 0\.01 s\).*"
        r": pass --accel-unit m/s\^2 --gyro-unit rad/s, or",
    )
    how = cure(message)
    np.testing.assert_array_equal(read(path, **how)[0].y, quiet)  # type: ignore[arg-type]
    assert "increments" not in notes(path, **how)


def test_an_index_in_brackets_is_no_unit(tmp_path: Path) -> None:
    """The names of PX4: ``gyro_rad[0]`` is the x axis in rad/s."""
    names = [f"gyro_rad[{j}]" for j in range(3)] + [f"accelerometer_m_s2[{j}]" for j in range(3)]
    gyro, accel = read(write(tmp_path / "log.csv", rows(), ",".join(["t", *names])))
    np.testing.assert_array_equal(gyro.y, GYRO)
    np.testing.assert_array_equal(accel.y, ACCEL)
    assert gyro.assumptions[0].startswith("gyro: rad/s assumed")


def test_columns_that_are_left_out_are_named(tmp_path: Path) -> None:
    lines = [f"{row},1,2" for row in rows()]
    assert "columns not used: status, mag_x" in notes(
        write(tmp_path / "log.csv", lines, HEADER + ",status,mag_x")
    )


def test_a_gyroscope_that_moves_is_not_named_the_unit_of_one_at_rest(tmp_path: Path) -> None:
    """Vibration of 30 deg/s fits only deg/h and mdeg/s where it is noise at rest; motorcycles shake as much.

    Whether it moves the accelerometers tell; without them, both are named.
    """
    y = np.random.default_rng(5).normal(3.0, 30.0, (COUNT, 3))
    lines = [line.rpartition(",")[0].rpartition(",")[0].rpartition(",")[0] for line in rows(gyro=y)]
    header = ",".join(HEADER.split(",")[:4])
    message = refused(
        write(tmp_path / "log.csv", lines, header), "pass --gyro-unit deg/s if the sensor moved, or"
    )
    assert "--gyro-unit deg/h" in message
    still = refused(
        write(tmp_path / "log.csv", rows(gyro=y)), "pass --gyro-unit deg/h, or --gyro-unit mdeg/s$"
    )
    assert "moved" not in still
    shaken = ACCEL + np.random.default_rng(6).normal(0.0, 3.0, ACCEL.shape)
    refused(write(tmp_path / "log.csv", rows(gyro=y, accel=shaken)), "pass --gyro-unit deg/s, or")


def test_the_unit_in_which_a_moving_gyroscope_is_read_is_among_those_offered(tmp_path: Path) -> None:
    """Vibration of 0.02 rad/s and 0.5 m/s²: only deg/s and mrad/s were named, in which N was 57 times too small."""
    rng = np.random.default_rng(10)
    gyro = rng.normal(2e-3, 0.02, (COUNT, 3))
    shaken = write(tmp_path / "log.csv", rows(gyro=gyro, accel=ACCEL + rng.normal(0.0, 0.5, ACCEL.shape)))
    message = refused(
        shaken,
        "accel shows that the sensor moves, so only its owner knows the unit: pass --gyro-unit rad/s, or",
    )
    assert "--gyro-unit deg/s" in message
    np.testing.assert_array_equal(read(shaken, **cure(message))[0].y, gyro)  # type: ignore[arg-type]
    still = refused(write(tmp_path / "log.csv", rows(gyro=5.0 * gyro)), "nothing states its unit: pass")
    assert "--gyro-unit rad/s" not in still


def test_rare_samples_of_a_gyroscope_may_be_noisier(tmp_path: Path) -> None:
    """0.05 deg/s/√Hz up to 100 Hz, 0.5 deg/s in every sample: at 4 Hz as loud as 0.25 deg/s/√Hz."""
    y = np.random.default_rng(6).normal(0.0, 0.5, (COUNT, 3))
    refused(
        write(tmp_path / "log.csv", rows(25.0 * T, y), HEADER.replace("t,", "t [s],")),
        "pass --gyro-unit deg/s, or",
    )


def test_a_vehicle_on_level_ground_moves_though_gravity_keeps_its_direction(tmp_path: Path) -> None:
    """A robot turns about the vertical, brakes and shakes by 3 deg/s: the unit that is stated is right, it moves."""
    rng = np.random.default_rng(8)
    turns = np.repeat(rng.normal(0.0, 0.3, COUNT // 100), 100)
    gyro = rng.normal(0.0, 0.05, (COUNT, 3)) + np.outer(0.1 + turns, [0.0, 0.2, 1.0])
    brakes = np.repeat(rng.normal(0.0, 0.2, (COUNT // 100, 3)), 100, axis=0)
    header = ",".join(
        ["t [s]", *(f"gyro_{a} [rad/s]" for a in "xyz"), *(f"accel_{a} [m/s^2]" for a in "xyz")]
    )
    drives = write(tmp_path / "drives.csv", rows(gyro=gyro, accel=ACCEL + brakes), header)
    np.testing.assert_array_equal(read(drives)[0].y, gyro)
    rests = write(tmp_path / "rests.csv", rows(gyro=gyro), header)
    refused(rests, "the unit rad/s is wrong: pass --gyro-unit deg/s")


def test_accelerometers_without_gravity_are_no_increments_in_feet(tmp_path: Path) -> None:
    """0.355 ft/s in a sample of 10 ms are 1.1 gravity: what nobody states is not looked for beyond 10 %."""
    accel = np.random.default_rng(9).normal(0.0, 1e-2, (COUNT, 3)) + np.array([0.0, 0.0, -0.355])
    message = refused(
        write(tmp_path / "log.csv", rows(gyro=0.1 * GYRO, accel=accel)), "× gravity, and nothing states"
    )
    assert "--" not in message


def test_a_unit_that_makes_all_numbers_smaller_says_so(tmp_path: Path) -> None:
    """At 5 Hz an increment in rad is 5 times the rate: "in rad 0.2 times too large" was said of 5 times too small."""
    gyro = np.random.default_rng(7).normal(0.0, 1e-3, (COUNT, 3)).tolist()
    lines = [f"{0.2 * i},{','.join(map(repr, row))}" for i, row in enumerate(gyro)]
    said = notes(write(tmp_path / "log.csv", lines, HEADER.partition(",accel")[0]))
    assert "5 times too small for samples in rad, 11.5 times too large for samples in deg:" in said
