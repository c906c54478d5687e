"""Faults planted in a right drive are named, sized and mended before any filter runs; a right drive has none."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tuner
from models.earth import ned_between
from models.trajectory.motion import Trajectory
from models.trajectory.profiles import Profile, Wave
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.cli import run
from tuner.examination.examine import Examination, examine, streams_of
from tuner.examination.fit import _fitted, fit
from tuner.examination.search import searched
from tuner.examination.streams import Stream, Velocities
from tuner.examination.windows import Motion
from tuner.formats.logs import write_drive
from tuner.readers.drive import read_drive
from tuner.simulation.drive import simulate_drive
from tuner.simulation.simulate_source import simulate_source
from tuner.types.records import DataError, Drive


def simulated(gnss: str, seed: int) -> Drive:
    """Return a right drive of five minutes in a town."""
    made = simulate_source("mpu9250", trajectory="city", gnss=gnss, duration=300.0, rate=50.0, seed=seed)
    assert isinstance(made.data, Drive)
    return made.data


@pytest.fixture(scope="module")
def drive() -> Drive:
    """Return a right drive with RTK fixes."""
    return simulated("rtk", 11)


def with_velocities(drive: Drive, change: Callable[[np.ndarray], np.ndarray]) -> Drive:
    """Return a drive with other velocities."""
    return replace(drive, gnss=replace(drive.gnss, vel_n=change(drive.gnss.vel_n.copy())))


def with_rates(drive: Drive, factors: list[float], begin: float = 0.0) -> Drive:
    """Return a drive whose samples are multiplied from a time on."""
    rates = drive.rates.copy()
    rates[drive.imu_t >= begin] *= factors
    return replace(drive, rates=rates)


def first(found: Examination) -> str:
    """Return the surest fault as a sentence."""
    assert found.repairs, "nothing was found"
    return f"{found.repairs[0].stream} {found.repairs[0].fault}"


@pytest.mark.parametrize(("gnss", "seed"), [("rtk", 11), ("spp", 12)])
def test_a_right_drive_has_nothing_to_mend_and_its_noise_is_that_of_the_receiver(
    gnss: str, seed: int
) -> None:
    right = simulated(gnss, seed)
    found = examine(right)
    assert not found.repairs
    for one in found.noise:
        assert one.reported is not None
        assert one.sd == pytest.approx(one.reported, rel=0.25)
    assert np.array_equal(found.mended.gnss.llh, right.gnss.llh)


FAULTS = {
    "wrong vertical sign": lambda d: with_velocities(d, lambda v: v * [1.0, 1.0, -1.0]),
    "are east, north, up": lambda d: with_velocities(d, lambda v: v[:, [1, 0, 2]] * [1.0, 1.0, -1.0]),
    "speed and course": lambda d: with_velocities(
        d,
        lambda v: np.column_stack(
            [np.hypot(v[:, 0], v[:, 1]), np.degrees(np.arctan2(v[:, 1], v[:, 0])) % 360.0, v[:, 2]]
        ),
    ),
    "speed and course in rad": lambda d: with_velocities(
        d, lambda v: np.column_stack([np.hypot(v[:, 0], v[:, 1]), np.arctan2(v[:, 1], v[:, 0]), v[:, 2]])
    ),
    "gyro z has the wrong sign": lambda d: with_rates(d, [1.0, 1.0, -1.0, 1.0, 1.0, 1.0]),
    "accelerometer has the sign of gravity": lambda d: with_rates(d, [1.0] * 3 + [-1.0] * 3),
}


@pytest.mark.parametrize("words", FAULTS)
def test_a_fault_of_a_whole_stream_is_named_and_mended(drive: Drive, words: str) -> None:
    found = examine(FAULTS[words](drive))
    assert words in first(found)
    assert np.allclose(found.mended.gnss.vel_n, drive.gnss.vel_n, atol=1e-3, equal_nan=True)
    assert np.allclose(found.mended.rates, drive.rates)


def test_stamps_that_jump_are_told_from_samples_that_are_lost(drive: Drive) -> None:
    jumped = examine(replace(drive, imu_t=drive.imu_t + np.where(drive.imu_t > 150.0, 2.66, 0.0)))
    assert "clock of the inertial unit jumps ahead by 2.66" in first(jumped)
    late = jumped.mended.gnss.t > 155.0
    assert np.allclose(
        jumped.mended.gnss.t[late] - 2.66, drive.gnss.t[drive.gnss.t > 152.4][: late.sum()], atol=0.03
    )
    kept = (drive.imu_t < 150.0) | (drive.imu_t > 157.99)
    lost = examine(replace(drive, imu_t=drive.imu_t[kept], rates=drive.rates[kept]))
    assert [one.fault for one in lost.repairs] == ["has no samples for 8 s, in one gap"]
    assert lost.before_filter
    assert not lost.mends  # it wrote mended.npz beside "nothing mends it here"


def test_an_axis_at_the_end_of_its_range_is_saturated(drive: Drive) -> None:
    # Seen: a quarter of the samples of a gyro clipped in the turns, and nothing was named.
    rates = drive.rates.copy()
    most = float(np.quantile(np.abs(rates[:, 2]), 0.93))
    rates[:, 2] = rates[:, 2].clip(-most, most)
    found = examine(replace(drive, rates=rates))
    assert f"gyro z is saturated in 7 % of the samples, at {np.degrees(most):.4g} deg/s" in first(found)
    assert not any("saturated" in one.fault for one in examine(drive).repairs)


@pytest.mark.parametrize(
    ("columns", "seconds", "words"),
    [
        (slice(2, 3), slice(0.0, 300.0), "gyro z gives zero in all 15001 samples: no measurement"),
        (slice(0, 3), slice(150.0, 170.0), "gyro gives zeros for 20 s: frozen, no measurement"),
    ],
)
def test_a_sensor_that_never_moves_measures_nothing(
    drive: Drive, columns: slice, seconds: slice, words: str
) -> None:
    """Seen: nothing contradicted a gyro of zeros while the course turned by five rounds."""
    rates = drive.rates.copy()
    rates[(drive.imu_t >= seconds.start) & (drive.imu_t <= seconds.stop), columns] = 0.0
    assert words in first(examine(replace(drive, rates=rates)))


def test_latitudes_beyond_the_pole_are_refused(drive: Drive) -> None:
    """Nothing contradicted them, and the next command refused them."""
    north = drive.gnss.llh + np.array([np.radians(95.0) - drive.gnss.llh[0, 0], 0.0, 0.0])
    with pytest.raises(DataError, match="expected latitudes in degrees, got up to 95"):
        examine(replace(drive, gnss=replace(drive.gnss, llh=north)))


def test_wrong_readings_are_told_where_the_fit_looks_at_none_of_them() -> None:
    # Seen: every tenth velocity wrong at 10 Hz, of which every fifth is fitted, and nothing was named.
    gnss = replace(load_gnss("rtk"), interval=0.1)
    right = simulate_drive(load_grade("bmi088"), Trajectory("car", 120.0, Profile(8.0, waves=(Wave(3.0, 0.05),)),
        Profile(waves=(Wave(1.0, 0.03),))), gnss, rate=50.0, seed=3, effects=())[0]  # fmt: skip
    vel = right.gnss.vel_n.copy()
    vel[3::10] += [6.0, -5.0, 0.0]
    found = examine(replace(right, gnss=replace(right.gnss, vel_n=vel)))
    assert "velocities are wrong in 10 %" in first(found)
    stamps = right.gnss.t * (1.0 + 1e-12)
    assert np.array_equal(_fitted(Velocities(stamps, vel)), _fitted(Velocities(right.gnss.t, vel)))


def horizontal(vel: np.ndarray) -> np.ndarray:
    """Return velocities of which speed and course are all that is known."""
    return np.column_stack([vel[:, :2], np.full(len(vel), np.nan)])


def test_speed_and_course_alone_are_held_against_the_others(drive: Drive) -> None:
    """Without a vertical velocity none was read: a phone's velocities were neither examined nor filtered."""
    right = examine(with_velocities(drive, horizontal))
    assert not right.repairs
    sizes = {one.stream: one for one in right.noise if not one.part}
    assert sizes["velocities"].sd == pytest.approx(drive.gnss.velocity_sd[0, 0], rel=0.25)
    assert "vertical sign of the velocities" not in right.unseen
    wrong = with_velocities(drive, lambda v: horizontal(3.6 * v))
    found = examine(wrong)
    assert "velocities are in km/h, read as m/s" in first(found)
    assert np.allclose(found.mended.gnss.vel_n, horizontal(drive.gnss.vel_n), atol=1e-3, equal_nan=True)
    swapped = examine(with_velocities(drive, lambda v: horizontal(v[:, [1, 0, 2]])))
    assert "velocities are east, north" in first(swapped)


def test_a_unit_that_changes_is_named_with_the_time(drive: Drive) -> None:
    """One sample in the wrong unit, 57 times its rate, turns all that follows: the mended copy has none."""
    for begin in (180.0, 100.013):
        found = examine(with_rates(drive, [180.0 / np.pi] * 3 + [1.0] * 3, begin=begin))
        assert "gyro is in deg/s" in first(found)
        assert found.repairs[0].begin == pytest.approx(begin, abs=0.05)
        assert found.repairs[0].end is None
        assert np.allclose(found.mended.rates, drive.rates)


def test_a_step_of_the_height_is_sized_to_centimetres(drive: Drive) -> None:
    llh = drive.gnss.llh.copy()
    llh[drive.gnss.t >= 150.0, 2] -= 47.61
    found = examine(replace(drive, gnss=replace(drive.gnss, llh=llh)))
    assert "heights step by -47.6 m" in first(found)
    assert found.repairs[0].size == pytest.approx(47.61, abs=0.1)
    assert np.abs(found.mended.gnss.llh[:, 2] - drive.gnss.llh[:, 2]).max() < 0.1


def test_a_third_of_the_velocities_wrong_are_counted_and_left_out(drive: Drive) -> None:
    rng = np.random.default_rng(3)
    rows = rng.random(len(drive.gnss)) < 1.0 / 3.0

    def wrong(v: np.ndarray) -> np.ndarray:
        v[rows] += 9.0 * rng.normal(size=(rows.sum(), 3))
        return v

    found = examine(with_velocities(drive, wrong))
    assert "velocities are wrong in" in first(found)
    assert len(found.repairs) == 1
    left = ~np.isfinite(found.mended.gnss.vel_n).all(axis=1)
    assert np.count_nonzero(left ^ rows) <= 0.05 * len(rows)
    low, high = found.repairs[0].interval or (0.0, 0.0)
    assert low < 9.0 * np.sqrt(3.0) < high


def test_velocities_turned_about_the_vertical_are_turned_back(drive: Drive) -> None:
    """Seen: those turned by a right angle were called velocities in the axes of the unit."""
    angle = np.radians(-90.0)
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]]
    )
    found = examine(with_velocities(drive, lambda v: v @ turn.T))
    assert "velocities are turned anticlockwise by 90" in first(found)
    low, high = found.repairs[0].interval or (0.0, 0.0)
    assert low < 90.0 < high < low + 4.0
    assert np.allclose(found.mended.gnss.vel_n, drive.gnss.vel_n, atol=0.5)


def test_errors_in_a_row_count_as_one_in_the_interval_of_their_size(drive: Drive) -> None:
    """Seen: runs of wrong fixes, each with one error, sized within a tenth of the scatter between runs."""
    rng, llh = np.random.default_rng(6), drive.gnss.llh.copy()
    rows = np.floor(drive.gnss.t / 24.0) != np.floor((drive.gnss.t - 4.0) / 24.0)
    sizes = rng.uniform(10.0, 50.0, 20)[np.floor(drive.gnss.t / 24.0).astype(int)]
    llh[rows, 2] += sizes[rows]
    found = examine(replace(drive, gnss=replace(drive.gnss, llh=llh)))
    assert "fixes are wrong in" in first(found)
    low, high = found.repairs[0].interval or (0.0, 0.0)
    assert high - low > 8.0  # 11.5 m of scatter between some 12 runs
    assert low < np.sqrt(np.mean(sizes[rows] ** 2)) < high


def test_a_delay_of_the_receiver_is_within_its_interval(drive: Drive) -> None:
    found = examine(replace(drive, gnss=replace(drive.gnss, t=drive.gnss.t - 0.7).rows(slice(5, -5))))
    assert "receiver is early" in first(found)
    low, high = found.repairs[0].interval or (0.0, 0.0)
    assert low < 0.7 < high
    assert high - low < 0.05


def test_a_small_delay_and_none_have_intervals_that_hold_them(drive: Drive) -> None:
    for delay in (0.0, 0.03):
        late = replace(drive, gnss=replace(drive.gnss, t=drive.gnss.t + delay).rows(slice(5, -5)))
        clock = examine(late).clock
        assert abs(clock.delay.value - delay) < 5.0 * clock.delay.sd < 0.05
        assert abs(clock.lag.value) < 5.0 * clock.lag.sd < 0.05


def test_an_antenna_that_swings_with_the_steps_of_a_walker_shows_the_delay() -> None:
    """The delay of 0.2 s was 0.10 s, and velocities 0.16 s early: derivatives were those of the unit."""
    steps = Profile(waves=(Wave(0.03, 1.8),)), Profile(waves=(Wave(0.04, 0.9),))
    speed = Profile(1.4, waves=(Wave(0.3, 1.0 / 40.0), Wave(0.15, 0.9)))
    heading = Profile(waves=(Wave(2.0, 1.0 / 70.0), Wave(0.05, 0.9)))
    walker = Trajectory("walker", 240.0, speed, heading, pitch=steps[0], roll=steps[1])
    gnss, arm = replace(load_gnss("rtk"), interval=0.2), (0.6, 0.1, -1.0)
    made = simulate_drive(load_grade("bmi088"), walker, gnss, rate=100.0, seed=5, lever_arm=arm, effects=())[
        0
    ]
    found = examine(replace(made, gnss=replace(made.gnss, t=made.gnss.t + 0.2)))
    assert abs(found.clock.delay.value - 0.2) < 5.0 * found.clock.delay.sd < 0.01
    assert not found.clock.lag.certain
    assert len(found.repairs) == 1


@pytest.mark.parametrize("axis", [0, 1])
def test_a_lever_arm_does_not_stand_for_a_wrong_sign(axis: int) -> None:
    """An antenna 0.4 m below stood for the sign in the swaying of a tricycle: two axes were named, or none."""
    speed = Profile(2.5, waves=(Wave(2.0, 0.04), Wave(0.3, 0.11)))
    heading = Profile(waves=(Wave(1.5, 0.03), Wave(0.5, 0.07)))
    pitch, roll = Profile(waves=(Wave(0.015, 1.1),)), Profile(waves=(Wave(0.02, 0.8),))
    gnss = replace(load_gnss("spp"), interval=0.1, velocity_sd=(0.05, 0.05, 0.075))
    tricycle = Trajectory("tricycle", 240.0, speed, heading, pitch=pitch, roll=roll)
    made = simulate_drive(load_grade("bmi088"), tricycle, gnss, rate=100.0, seed=5, effects=())[0]
    factors = [1.0] * 6
    factors[axis] = -1.0
    found = examine(replace(with_rates(made, factors), lever_arm=None))
    assert first(found) == f"gyro {'xyz'[axis]} has the wrong sign"
    assert len(found.repairs) == 1
    assert not found.lever_arm


def test_repeated_readings_are_left_out(drive: Drive) -> None:
    rows = np.arange(20, len(drive.gnss), 3)
    llh, vel = drive.gnss.llh.copy(), drive.gnss.vel_n.copy()
    llh[rows], vel[rows] = llh[rows - 1], vel[rows - 1]
    found = examine(replace(drive, gnss=replace(drive.gnss, llh=llh, vel_n=vel)))
    assert "repeat the one before" in first(found)
    assert found.repairs[0].stream == "fixes and velocities"
    assert len(found.mended.gnss) == len(drive.gnss) - len(rows)


@pytest.mark.parametrize(("power", "words"), [(0.0, "standard deviations of zero"), (2.0, "are variances")])
def test_sds_that_are_none_are_replaced(drive: Drive, power: float, words: str) -> None:
    gnss = drive.gnss
    sd = [0.0 * x if power == 0.0 else x**power for x in (gnss.position_sd, gnss.velocity_sd)]
    found = examine(replace(drive, gnss=replace(gnss, position_sd=sd[0], velocity_sd=sd[1])))
    assert words in first(found)
    assert np.allclose(found.mended.gnss.position_sd, gnss.position_sd, rtol=0.3)


def test_velocities_of_zero_are_no_measurement_and_have_no_noise(drive: Drive) -> None:
    """Their sds were 14 times too small beside it: those of no reading."""
    found = examine(with_velocities(drive, lambda v: 0.0 * v))
    assert [one.fault for one in found.repairs] == [f"are zero in all {len(drive.gnss)} rows: no measurement"]
    assert {one.stream for one in found.noise} == {"fixes"}
    assert not np.isfinite(found.mended.gnss.vel_n).any()


def test_noise_in_motion_stands_beside_that_at_rest(drive: Drive) -> None:
    rng = np.random.default_rng(8)
    rates = drive.rates.copy()
    moving = drive.imu_t > 100.0
    rates[moving] += rng.normal(size=(moving.sum(), 6)) * [0.02, 0.02, 0.02, 0.3, 0.3, 0.3]
    still, fast = examine(replace(drive, rates=rates)).vibration["gyro"]
    assert fast == pytest.approx(0.02, rel=0.1)
    assert still < 0.2 * fast


def test_signs_that_could_not_be_seen_share_their_words(drive: Drive) -> None:
    """Nine signs were listed one after the other."""
    signs = tuple(f"sign of gyro {axis}" for axis in "xyz")
    found = replace(examine(drive), unseen=(*signs, "delay of the velocities"))
    assert "Could not have shown: sign of gyro x y z, delay of the velocities" in str(found)


class Barometer(Stream):
    """Heights, m: a stream that another package declares."""

    unit = "m"
    groups = (("", (0,)),)
    usual = (1.0, 10.0)

    def seen(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Return the height."""
        return -motion.position[:, 2:], -motion.by_position[:, 2:]

    def local(self, place: np.ndarray) -> np.ndarray:
        """Return heights above the place of each window."""
        return self.values - place[:, 2:]


def test_another_sensor_is_declared_in_a_few_lines(drive: Drive) -> None:
    """Its noise is found, and a fifth of its readings that are wrong by 5 m."""
    rng = np.random.default_rng(4)
    heights = drive.gnss.llh[:, 2:] + 0.3 * rng.normal(size=(len(drive.gnss), 1))
    rows = rng.random(len(heights)) < 0.2
    heights[rows] += 5.0 * rng.normal(size=(rows.sum(), 1))
    streams = streams_of(drive)
    found = fit(
        replace(streams, others=(*streams.others, Barometer(drive.gnss.t, heights, name="barometer")))
    )
    noise = found.noise[-1]
    assert noise.sd[0] == pytest.approx(0.3, rel=0.2)
    assert noise.wrong == pytest.approx(0.2, abs=0.08)


def test_streams_that_do_not_meet_are_refused(drive: Drive) -> None:
    apart = replace(streams_of(drive), positions=streams_of(drive).positions.later(1e5), others=())
    with pytest.raises(DataError, match=r"the clocks of the streams do not meet"):
        searched(apart, "apart")


def test_the_command_names_mends_and_writes(
    drive: Drive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / "x.npz", tmp_path / "out"
    write_drive(with_velocities(drive, lambda v: v * [1.0, 1.0, -1.0]), path)
    words = ["examine", str(path), "-o", str(out), "--strict", "--quiet", "--json", str(tmp_path / "x.json")]
    assert run(words) == 1
    said = capsys.readouterr().out
    assert "Velocities have the wrong vertical sign" in said
    assert "Next: tuner tune --drive" in said
    assert "out/mended.npz" in said
    stored = json.loads((tmp_path / "x.json").read_text())
    assert stored["repairs"][0]["stream"] == "velocities"
    mended = read_drive(out / "mended.npz")
    assert np.allclose(mended.gnss.vel_n, drive.gnss.vel_n)
    assert np.abs(ned_between(mended.gnss.llh, drive.gnss.llh)).max() < 1e-3
    assert run(["examine", str(out / "mended.npz"), "--strict", "--quiet"]) == 0
    assert "Verdict: nothing contradicts" in capsys.readouterr().out


def test_the_verb_shows_itself(drive: Drive) -> None:
    found = tuner.examine(drive)
    assert "nothing contradicts" in repr(found)
    assert len(found.plot().axes) == 2


def test_tune_begins_from_the_mended_drive(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Vertical velocities that point up: said, mended, written, and named by the next command; the verdict is good."""
    made = simulate_source("mpu9250", trajectory="city", gnss="rtk", duration=400.0, rate=50.0, seed=2)
    assert isinstance(made.data, Drive)
    path, out = tmp_path / "up.npz", tmp_path / "out"
    write_drive(with_velocities(made.data, lambda v: v * [1.0, 1.0, -1.0]), path)
    assert run(["tune", "--drive", str(path), "-o", str(out), "--quiet"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "Before the filter: Velocities have the wrong vertical sign" in said
    assert "Verdict: usable" in said
    assert "mended.npz -o" in said.replace("\\ ", "")
    assert np.allclose(read_drive(out / "mended.npz").gnss.vel_n, made.data.gnss.vel_n)
    assert json.loads((out / "result.json").read_text())["examination"]["repairs"]


def stored(drive: Drive, path: Path, **arrays: np.ndarray) -> Path:
    """Write a drive with some other arrays."""
    write_drive(drive, path)
    with np.load(path) as file:
        np.savez(path, **{**{name: file[name] for name in file.files}, **arrays})
    return path


def test_a_clock_that_begins_anew_after_a_week_goes_on(drive: Drive, tmp_path: Path) -> None:
    shift = 604800.0 - 130.0
    times = {name: (t + shift) % 604800.0 for name, t in (("imu_t", drive.imu_t), ("gnss_t", drive.gnss.t))}
    read = read_drive(stored(drive, tmp_path / "week.npz", **times))
    assert [one.stream for one in read.repairs] == ["clock of the IMU", "clock of the GNSS"]
    assert np.allclose(read.imu_t, drive.imu_t - drive.imu_t[0], atol=1e-6)
    assert np.allclose(read.gnss.t, drive.gnss.t - drive.imu_t[0], atol=1e-6)


def test_stamps_cut_to_whole_seconds_are_spread(drive: Drive, tmp_path: Path) -> None:
    """Five fixes a second whose stamps lost their fractions: all are kept, each at its time."""
    assert drive.reference is not None
    t = np.arange(2.0, 290.0, 0.2)
    llh = np.column_stack([np.interp(t, drive.reference.t, x) for x in drive.reference.llh.T])
    llh[:, :2] = np.degrees(llh[:, :2])
    llh[:, 2] += np.random.default_rng(1).normal(0.0, 0.02, len(t))
    none = np.full((len(t), 3), np.nan)
    cut = {
        "gnss_t": np.floor(t + 1e-9),
        "gnss_llh": llh,
        "gnss_vned": none,
        "gnss_pstd": none,
        "gnss_vstd": none,
    }
    read = read_drive(stored(drive, tmp_path / "cut.npz", **cut))
    assert "are cut to whole seconds: 5 rows share each" in read.repairs[0].fault
    assert len(read.gnss) == len(t)
    assert np.abs(read.gnss.t - (t - drive.imu_t[0])).max() < 1e-6


def test_a_unit_that_gives_one_sample_again_and_again_is_left_out(drive: Drive) -> None:
    rates = drive.rates.copy()
    rows = (drive.imu_t > 200.0) & (drive.imu_t < 230.0)
    rates[rows] = rates[np.argmax(rows)]
    found = examine(replace(drive, rates=rates))
    assert "frozen, no measurement, from 200 to 230 s" in first(found)
    assert len(found.mended.imu_t) == np.count_nonzero(~rows) + 1
    assert len(found.repairs) == 1  # the frozen samples, which are left out, were reported as a gap, too
