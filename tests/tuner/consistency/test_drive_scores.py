"""Scores of filters on measured drives; simulated ones have a truth."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.signal import lfilter

from models import rotation
from models.earth import in_degrees, llh_displaced, ned_between
from models.trajectory.catalogue import TRAJECTORIES
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.cli import run
from tuner.consistency import score_drive
from tuner.consistency.drive_scores import differences, errors, reference_at
from tuner.consistency.score_drive import MIN_NOISE_RATIO, drive_filter, navigate_drive, navigate_recorded
from tuner.navigation.data import Steps
from tuner.navigation.drive.alignment import Alignment, align, stationary_until
from tuner.navigation.drive.run import initial_state, navigate, prepare
from tuner.navigation.drive.vehicle_constraints import (
    Vehicle,
    constraint_counts,
    forward_axes,
    stationary_noise,
)
from tuner.readers.drive import read_drive
from tuner.synthesis import synthesize
from tuner.synthesis.from_drive import receiver_of
from tuner.synthesis.load_config import load_config
from tuner.types import Coefficient, TermEstimate
from tuner.types.clock import Clock, Delay
from tuner.types.consistency import Outage
from tuner.types.records import DataError, Gnss, Reference

INTERVAL = 0.02
LEVER = (0.5, -0.3, -1.2)
MOUNTING_RPY = (180.0, 3.0, 100.0)
DELAY = 0.15
PLACED = {"lever_arm_frd_m": LEVER, "mounting_rpy_deg": MOUNTING_RPY}
STILL = 40.0
MEASURED = os.environ.get("TUNER_DATA")


def timed(path):
    """Return a drive whose delay is known as an examination knows it."""
    return replace(read_drive(path), clock=Clock(Delay(DELAY, 0.003)))


@pytest.fixture(scope="module")
def result(configuration, file):
    return navigate_drive(timed(file), configuration())


def test_simulated_drive_is_navigated(result):
    found = result.consistency
    rms = found.errors
    assert not found.diverged
    assert max(rms["position"].values[:2]) < 0.5
    assert max(rms["velocity"].values) < 0.1
    assert max(rms["attitude"].values[:2]) < np.radians(0.3)
    assert found.gated < 0.01
    assert [outage.seconds for outage in found.outages] == [10.0, 30.0, 60.0]
    assert all(0.4 < outage.score.ratio < 2.0 for outage in found.outages)
    blocks = {s.name: s.ratio for s in found.blocks}
    assert set(blocks) == {"position", "velocity", "attitude"}
    assert max(blocks.values()) < 1.6


def test_a_slow_reference_does_not_cut_corners():
    """A reference of 1 Hz between its rows, in a town: straight lines are off by 0.3 m, 0.3 m/s and degrees."""
    motion = TRAJECTORIES["city"](120.0)
    t = np.arange(0.0, 120.5)
    state, between = motion.evaluate(t), np.arange(0.5, 119.0)
    reference = Reference(
        t, state.llh, state.vel_n, np.mod(rotation.rpy_from_mat(state.mat_nb) + np.pi, 2 * np.pi) - np.pi
    )
    true = motion.evaluate(between)
    llh, vel_n, rpy = reference_at(reference, between)
    assert np.abs(ned_between(llh, true.llh)).max() < 0.04
    assert np.abs(vel_n - true.vel_n).max() < 0.15
    off = rotation.rotvec_from_mat(rotation.mat_from_rpy(rpy) @ np.swapaxes(true.mat_nb, 1, 2))
    assert np.degrees(np.abs(off)).max() < 3.0
    at, _, _ = reference_at(reference, np.array([-1.0, 3.0, 121.0]))
    np.testing.assert_array_equal(np.isfinite(at).all(axis=1), [False, True, False])
    np.testing.assert_allclose(at[1], state.llh[3], rtol=1e-14)


def test_clock_offset_and_biases_are_found(result):
    ((offset, sd),) = result.estimates["time_offset"]
    delay = result.stretches[0].alignment.delay + offset
    assert delay == pytest.approx(DELAY, abs=max(0.02, 5.0 * sd))
    sensor = rotation.mat_from_rpy(np.radians(MOUNTING_RPY))
    bias = np.array([value for value, _ in result.estimates["gyro_bias"]])
    np.testing.assert_allclose(sensor @ bias, [2e-3, -1e-3, 1.5e-3], atol=6e-4)


def test_constraints_help_through_outages_and_are_counted(configuration, file, result):
    drive = timed(file)
    found = navigate_drive(drive, configuration(), vehicle=Vehicle(0.1, 0.05))
    counted = constraint_counts(found.solutions)
    assert counted["non-holonomic"].used > 50
    assert counted["zero velocity"].used > 20
    assert all(one.ratio < 1.5 for one in counted.values())
    # Without vibration, smooth driving looks like standing to the unit: there the gate must speak.
    assert counted["zero velocity"].refused > 20
    free, held = (x.consistency for x in (result, found))
    assert held.outages[-1].rms < 0.8 * free.outages[-1].rms
    assert held.outages[-1].score.ratio < 2.0
    assert max(held.errors["position"].values[:2]) < 0.5
    (_, (pitch, _), (yaw, _)) = found.estimates["mounting"]
    assert np.abs([pitch, yaw]).max() < np.radians(1.0)
    assert any("refused by the gate" in note for note in found.notes)
    assert constraint_counts(result.solutions) == {}


def test_sensors_noisier_than_configured_are_reported(configuration, file, monkeypatch):
    quiet = replace(
        configuration(),
        channels={
            name: replace(
                c, identified=(), white_density=0.1 * c.white_density, markov=(), random_walk_density=0.0
            )
            for name, c in configuration().channels.items()
        },
    )
    drive = timed(file)
    for config in (quiet, replace(quiet, provenance={"drive": {"digest": drive.digest}})):
        (note,) = (one for one in navigate_drive(drive, config).notes if "noisier over 1 s" in one)
        assert "gyro_x" in note
        assert ("or from this drive" in note) == (config is quiet)
    # An excavator that swung about its antenna seemed 25 times as noisy at rest; without fixes it erred as predicted.
    right = Outage(10.0, 1.0, 1.0, None, 5, (0.8, 1.4))
    with monkeypatch.context() as patched:
        patched.setattr(score_drive, "_outage", lambda *_: right)
        patched.setattr(score_drive, "verdicts", lambda _: ())
        assert not any("noisier over 1 s" in note for note in navigate_drive(drive, quiet).notes)
    loud = replace(
        quiet,
        channels={
            name: replace(c, white_density=1e3 * c.white_density) for name, c in quiet.channels.items()
        },
    )
    assert not any("noisier over 1 s" in note for note in navigate_drive(drive, loud).notes)
    # Settings of a drive, whose noise in motion is 8 times that at rest, were said to have less than at rest.
    at_rest = {
        name: (TermEstimate("white", {"density": Coefficient(c.white_density, None, None, "1")}),)
        for name, c in quiet.channels.items()
    }
    made = replace(
        loud, channels={name: replace(c, identified=at_rest[name]) for name, c in loud.channels.items()}
    )
    assert not any("noisier over 1 s" in note for note in navigate_drive(drive, made).notes)


def test_few_movements_at_rest_are_no_noise():
    """People who got into a car made its gyroscope "2.7 times noisier" at rest than configured: it was quieter."""
    rng, interval, seconds = np.random.default_rng(1), 0.01, 28
    rates = 1e-3 * rng.standard_normal((round(seconds / interval), 6))
    steps = Steps(0.0, np.full(len(rates), interval), interval * rates)
    moved = steps.increments.copy()
    for begin in (200, 1300, 2100):
        moved[begin : begin + 100] += 1e-5
    start = Alignment(
        0.0, np.array([1.0, 0.0, 0.0, 0.0]), 0.0, 0.0, np.zeros(3), 0.0, float(seconds), np.zeros(3)
    )
    quiet, found = (stationary_noise(one, start) for one in (steps, replace(steps, increments=moved)))
    assert (quiet > 0.5e-4).all()
    assert (found < MIN_NOISE_RATIO * 1e-4).all()


def test_mounting_for_constraints_comes_from_motion(configuration, saved, data, tmp_path):
    drive = read_drive(saved(tmp_path / "bare.npz", data))
    settings, notes = drive_filter(drive, configuration())
    assert not any("sds of the fixes" in note for note in notes)
    without = replace(drive.gnss, position_sd=np.full_like(drive.gnss.position_sd, np.nan))
    assert "sds of the fixes not stated" in drive_filter(replace(drive, gnss=without), configuration())[1][-1]
    stretches, _ = prepare(drive, settings)
    axes = forward_axes(navigate(stretches, settings, np.zeros((0, 2)))[0])
    off = rotation.rotvec_from_mat(axes.T @ rotation.mat_from_rpy(np.radians(MOUNTING_RPY)))
    assert np.linalg.norm(off) < np.radians(2.0)


def test_vehicle_that_never_stood_is_not_said_to_stand(configuration, saved, data, tmp_path):
    moving = {name: values for name, values in data.items() if name.split("_")[0] != "ref"}
    late = data["imu_t"] > 1000.0 + STILL + 60.0
    for name in ("imu_t", "gyro", "accel"):
        moving[name] = data[name][late]
    drive = timed(saved(tmp_path / "moving.npz", moving, **PLACED))
    found = navigate_drive(drive, configuration(), vehicle=Vehicle(None, 0.05))
    assert constraint_counts(found.solutions) == {}
    assert any("never" in note for note in found.notes)


def test_start_in_a_turn_knows_the_lever_arm_once(configuration, saved, data, tmp_path):
    """Where the other states are zero, the start is where its fix says: nothing is left to move it by."""
    moving = {name: values for name, values in data.items() if name.split("_")[0] != "ref"}
    turning = np.abs(data["gyro"][:, 2]) > 0.1
    late = data["imu_t"] > data["imu_t"][int(np.argmax(turning & (data["imu_t"] > 1000.0 + STILL)))]
    for name in ("imu_t", "gyro", "accel"):
        moving[name] = data[name][late]
    drive = read_drive(saved(tmp_path / "turning.npz", moving, **PLACED))
    settings, _ = drive_filter(drive, configuration())
    stretch = prepare(drive, replace(settings, lever_arm=(1.0, -0.5, 0.2)))[0][0]
    begun = initial_state(replace(settings, lever_arm=(1.0, -0.5, 0.2)), stretch, np.zeros(settings.size))
    assert np.linalg.norm(stretch.start.vel_n - begun.vel_n) < 1e-3  # the Earth turns the arm by 1e-4
    assert np.allclose(begun.llh, stretch.start.llh, rtol=0.0, atol=1e-14)


def test_sds_of_the_reference_count(configuration, saved, data, tmp_path):
    n = len(data["ref_t"])
    rng = np.random.default_rng(5)
    decay = np.exp(
        -np.median(np.diff(data["ref_t"])) / 10.0
    )  # white noise would show in the reference itself
    staying = lfilter([np.sqrt(1.0 - decay**2)], [1.0, -decay], rng.standard_normal((n, 3)), axis=0)
    path = cumulative_trapezoid(
        0.3 * staying, data["ref_t"], axis=0, initial=0.0
    )  # no contradiction of its own
    began = data["ref_llh"] * [np.pi / 180.0, np.pi / 180.0, 1.0]
    moved = in_degrees(llh_displaced(began, path))
    noisy = dict(data, ref_vned=data["ref_vned"] + 0.3 * staying, ref_llh=moved)
    stating = dict(noisy, ref_vstd=np.full((n, 3), 0.3), ref_pstd=np.zeros((n, 3)), ref_astd=np.zeros((n, 3)))
    ratios = []
    for name, arrays_of in (("silent", noisy), ("stating", stating)):
        drive = timed(saved(tmp_path / f"{name}.npz", arrays_of, **PLACED))
        found = navigate_drive(drive, configuration())
        ratios.append({s.name: s.ratio for s in found.consistency.blocks}["velocity"])
    assert ratios[0] > 3.0
    assert ratios[1] < 1.3


def test_few_wrong_attitudes_of_the_reference_do_not_spoil_the_rest(result, file):
    drive = read_drive(file)
    (solution,), reference = result.solutions, drive.reference
    rows = np.flatnonzero(solution.t > 120.0)
    wrong = reference.rpy.copy()
    wrong[reference.t < 180.0, 2] += 1.5
    error = differences(replace(reference, rpy=wrong), solution, rows)
    right = differences(reference, solution, rows)
    after = solution.t[rows] > 181.0
    np.testing.assert_allclose(error[after, 6:], right[after, 6:], atol=2e-3)


def test_mounting_may_be_unknown(configuration, saved, data, tmp_path):
    drive = timed(saved(tmp_path / "bare.npz", data))
    assert drive.mounting is None
    found = navigate_drive(drive, configuration())
    assert not found.consistency.diverged
    assert max(found.consistency.errors["position"].values[:2]) < 0.8
    arm = np.array([value for value, _ in found.estimates["lever_arm"]])
    sensor = rotation.mat_from_rpy(np.radians(MOUNTING_RPY))
    np.testing.assert_allclose((sensor.T @ arm)[:2], LEVER[:2], atol=0.4)


def test_without_reference_outages_are_scored_by_the_fixes(configuration, saved, data, tmp_path):
    bare = {name: values for name, values in data.items() if not name.startswith("ref")}
    found = navigate_drive(timed(saved(tmp_path / "bare.npz", bare, **PLACED)), configuration())
    # Instead of a reference there is the smoother, which the filter agrees with.
    assert [s.name for s in found.consistency.blocks] == ["position", "velocity", "attitude"]
    assert all(s.ratio < 1.5 for s in found.consistency.blocks)
    assert any("smoother" in note for note in found.notes)
    assert len(found.consistency.outages) == 3
    assert "nis_position" in found.consistency.errors


def test_gap_starts_anew(configuration, saved, data, tmp_path):
    cut = dict(data)
    keep = (data["imu_t"] < 1200.0) | (data["imu_t"] > 1212.0)
    for name in ("imu_t", "gyro", "accel"):
        cut[name] = data[name][keep]
    found = navigate_drive(timed(saved(tmp_path / "cut.npz", cut, **PLACED)), configuration())
    assert len(found.stretches) == 2
    assert any("1 gaps" in note for note in found.notes)
    assert not found.consistency.diverged


def test_outliers_are_refused_and_counted(configuration, saved, data, tmp_path):
    bad = dict(data)
    llh = data["gnss_llh"].copy()
    llh[200::17, 2] += 60.0
    bad["gnss_llh"] = llh
    found = navigate_drive(timed(saved(tmp_path / "bad.npz", bad, **PLACED)), configuration())
    scored = len(range(200, len(llh), 17))
    assert found.consistency.gated == pytest.approx(scored / (len(llh) - STILL - 60.0), rel=0.15)
    assert abs(found.consistency.errors["position"].values[2]) < 1.0


def test_diverging_filter_is_reported(saved, data, tmp_path, capsys):
    lost = dict(data)
    llh = data["gnss_llh"].copy()
    rng = np.random.default_rng(3)
    llh[110:] += rng.uniform(-1.2e-3, 1.2e-3, llh[110:].shape)
    lost["gnss_llh"], lost["gnss_vned"] = (
        llh,
        data["gnss_vned"]
        + 30.0 * rng.standard_normal(data["gnss_vned"].shape) * (np.arange(len(llh)) > 110)[:, None],
    )
    path = saved(tmp_path / "lost.npz", lost, **PLACED)
    call = ["navigate", str(path), "--config", "mpu9250", "--gnss", "dgnss", "--strict", "--quiet"]
    assert run([*call, "--json", str(tmp_path / "lost.json")]) == 1
    out = capsys.readouterr().out
    assert "diverged" in out
    assert "outage" not in out
    written = json.loads((tmp_path / "lost.json").read_text(encoding="utf-8"))
    assert written["diverged"]
    assert written["nees"] is written["nis"] is written["whiteness"] is None
    assert not any(written[name] for name in ("errors", "outage", "blocks", "nis_parts"))


def test_standing_ends_with_the_first_motion(saved, data, tmp_path):
    drive = read_drive(saved(tmp_path / "a.npz", data))
    assert stationary_until(drive.gnss) == pytest.approx(STILL + 4.0, abs=4.0)


def test_alignment_needs_motion(data):
    t = data["imu_t"] - 1000.0
    steps = Steps(0.0, np.diff(t, prepend=0.0), np.hstack([data["gyro"], data["accel"]]) * INTERVAL)
    k = 30
    still = Gnss(
        data["gnss_t"][:k] - 1000.0,
        np.radians(data["gnss_llh"][:k] * [1.0, 1.0, np.degrees(1.0)]),
        data["gnss_vned"][:k],
        data["gnss_pstd"][:k],
        data["gnss_vstd"][:k],
    )
    with pytest.raises(DataError, match="speed"):
        align(steps, still, bias_sd=np.repeat([0.05, 0.3], 3))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda data: {"gyro": data["gyro"][:, :2]}, "in gyro, three a stamp of imu_t"),
        (lambda data: {"accel": data["accel"] + 0j}, "type complex128"),
        (lambda data: {"gnss_llh": data["gnss_llh"].astype(str)}, "in gnss_llh"),
        (lambda data: {"gyro": data["gyro"][:-5]}, "in gyro"),
    ],
)
def test_arrays_that_are_no_triads_are_refused(saved, data, tmp_path, change, words):
    with pytest.raises(DataError, match=words):
        read_drive(saved(tmp_path / "wrong.npz", dict(data, **change(data))))


def test_a_reference_without_attitude_gives_no_error_of_attitude(result, file):
    reference = read_drive(file).reference
    blind = replace(reference, rpy=np.full_like(reference.rpy, np.nan))
    rows = [np.arange(len(s.t)) for s in result.solutions]
    assert set(errors(blind, result.solutions, rows)) == {"position", "velocity"}


def test_a_receiver_nobody_names_is_what_its_fixes_report(file):
    drive = read_drive(file)
    found = receiver_of(drive)
    assert found.correlated == ()
    np.testing.assert_allclose(found.position_sd, np.nanmedian(drive.gnss.position_sd, axis=0))
    assert found.interval == pytest.approx(np.median(np.diff(drive.gnss.t)))
    silent = replace(drive.gnss, position_sd=np.full_like(drive.gnss.position_sd, np.nan))
    assert receiver_of(replace(drive, gnss=silent)) == load_gnss("spp")
    assert load_config("mti1", default_gnss=receiver_of(drive)).gnss.correlated == ()
    assert load_config("mti1", gnss="dgnss", default_gnss=receiver_of(drive)).gnss == load_gnss("dgnss")


def test_a_drive_that_ends_before_the_filter_settles_is_refused(file, configuration):
    drive = timed(file)
    short = replace(drive, gnss=drive.gnss.rows(drive.gnss.t < drive.gnss.t[0] + 75.0))
    with pytest.raises(DataError, match="nothing is left to judge it by"):
        navigate_drive(short, configuration())


def test_navigate_from_the_command_line(file, tmp_path, capsys):
    out = tmp_path / "out.json"
    arguments = [
        "navigate",
        str(file),
        "--config",
        "mpu9250",
        "--gnss",
        "dgnss",
        "--quiet",
        "--json",
        str(out),
    ]
    assert run(arguments) == 0
    content = json.loads(out.read_text(encoding="utf-8"))
    assert content["schema"] == "tuner.consistency/1"
    assert content["source"]["estimates"]["time_offset"]
    assert [o["seconds"] for o in content["outage"]] == [10.0, 30.0, 60.0]
    assert not any("no receiver is named" in note for note in content["notes"])
    unnamed = [word for word in arguments if word not in ("--gnss", "dgnss")]
    assert run(unnamed) == 0
    assert any(
        "no receiver is named" in note for note in json.loads(out.read_text(encoding="utf-8"))["notes"]
    )
    capsys.readouterr()
    for bad in (["--lever-arm", "1,2"], ["--imu-frame", "XYZ"], ["--state", "moon=1"]):
        assert run([*arguments, *bad]) == 2
        assert capsys.readouterr().err.count("\n") == 1


DRIVES = {
    "hipnuc_span_20220320_11": ("icm20602", "spp"),
    "hipnuc_span_20220405": ("icm20602", "spp"),
    "rtkexplorer_drive_0708": ("mpu9250", "rtk"),
    "stim300_rtk_20180417": ("stim300", "rtk"),
    "stim300_rtk_20180419_sharp": ("stim300", "rtk"),
    "stim300_rtk_20180419_smooth": ("stim300", "rtk"),
}
SHORT_DRIVE = "stim300_rtk_20180419_sharp"
"""The others take five to eighteen seconds of processor time each."""


@pytest.mark.skipif(MEASURED is None, reason="TUNER_DATA is not set")
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name != SHORT_DRIVE)) for name in DRIVES]
)
def test_measured_drives_are_navigated(name):
    grade, receiver = DRIVES[name]
    config = synthesize(grade_identification(load_grade(grade)), gnss=load_gnss(receiver))
    found = navigate_recorded(Path(str(MEASURED)) / "drives" / f"{name}.npz", config)
    assert not found.consistency.diverged
    assert found.consistency.outages
    assert found.consistency.verdicts
    assert found.consistency.gated < 0.5
    # One of them has fixes up to 90 m off, stamped a second late, and wrong velocities.
    room = 20.0 if name == "hipnuc_span_20220405" else 3.0
    if "position" in found.consistency.errors:
        assert max(found.consistency.errors["position"].values[:2]) < room
        assert max(found.consistency.errors["attitude"].values) < np.radians(3.0)
    assert all(outage.windows > 0 for outage in found.consistency.outages)
