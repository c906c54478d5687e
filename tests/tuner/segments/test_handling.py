"""Handling beside and within a stand-still is left out, and the noise of the rest is that of the rest alone."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from tuner.curves import curve
from tuner.segments.conditions import at_rest, without_knocks
from tuner.segments.stationary import find_motion
from tuner.types.records import DataError, Record

RATE, COUNT = 100.0, 12_000
SIZES = (2e-3, 0.02)
"""Sds of the samples of a gyro, rad/s, and an accelerometer, m/s²."""


def unit(y: np.ndarray, segments: tuple[tuple[int, int], ...] = ()) -> tuple[Record, Record]:
    """Return gyro and accelerometer of unit noise (n, 6) in their sizes."""
    t = np.arange(len(y)) / RATE
    axes = [tuple(f"{sensor}_{a}" for a in "xyz") for sensor in ("gyro", "accel")]
    return (
        Record("gyro", t, SIZES[0] * y[:, :3], axes[0], "rad/s", 1 / RATE, segments),
        Record("accel", t, SIZES[1] * y[:, 3:] + 9.8, axes[1], "m/s^2", 1 / RATE, segments),
    )


def noise(seed: int, count: int = COUNT) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((count, 6))


def knock(y: np.ndarray, at: int, size: float) -> np.ndarray:
    """Return noise with a blow that rings at 9 Hz for a fifth of a second on every axis and turns the unit."""
    t = np.arange(40) / RATE
    shape = np.exp(-t / 0.06) * (np.sin(2.0 * np.pi * 9.0 * t) + 0.3)
    out = y.copy()
    out[at : at + 40] += size * shape[:, None] * np.array([1.0, -0.7, 0.5, 0.6, 0.4, -0.8])
    return out


def test_knocks_change_no_density() -> None:
    """Five knocks of twenty sds in two minutes add two thirds to the white noise at one second; left out, nothing."""
    clean = noise(1)
    hit = clean
    for at in (1500, 3300, 4200, 7700, 10_100):
        hit = knock(hit, at, 20.0)
    whole, kept = unit(clean), at_rest(unit(hit))
    assert [record.segments for record in kept] == [((0, COUNT),)] * 2
    (note,) = kept[0].notes
    assert "moved" not in note  # samples that are used as rest must not be listed as motion
    assert re.search(
        r"at rest and alike: .*; knocks inside, 5 \(from .* s on for .* and 1 more\), are replaced", note
    )
    assert find_motion(unit(hit)).share == 0.0
    for before, after, raw in zip(whole, kept, unit(hit), strict=True):
        true, found, disturbed = (
            curve(one, "oadev", tau=[1.0]).deviation()[0] for one in (before, after, raw)
        )
        assert found == pytest.approx(true, rel=0.05)
        assert disturbed[0] > 1.3 * true[0]
    bridged, parts, _ = without_knocks(unit(hit))
    assert bridged[0].segments == ((0, COUNT),)
    assert parts["gyro_x"] == ((0, COUNT),)
    np.testing.assert_array_equal(bridged[1].y, kept[1].y)


@pytest.mark.parametrize("seed", range(4))
def test_a_glitch_and_a_swell_of_white_noise_are_no_knocks(seed: int) -> None:
    y = noise(10 + seed)
    y[5000] += 20.0
    y[8000:8040, :3] *= 5.0
    y[9000:10_500] *= 2.2
    motion = find_motion(unit(y))
    assert motion.moving == motion.knocks == ()


def test_a_unit_that_lies_otherwise_after_a_knock_has_two_levels() -> None:
    y = knock(noise(2), 6000, 25.0)
    y[6020:, 3:] += 4.0
    (first, second) = at_rest(unit(y))[0].segments
    assert first[0] == 0
    assert 5950 <= first[1] <= 6000
    assert 6020 <= second[0] <= 6200
    assert second[1] == COUNT


def test_what_settles_after_handling_is_left_out() -> None:
    """The mount creeps with a time constant of 1.5 s, eight sds of a mean of a second at first."""
    y = np.vstack([60.0 * noise(3, 800), noise(4)])
    t = np.arange(COUNT) / RATE
    y[800:, 4] += 1.5 * np.exp(-t / 1.5)
    (motion,) = [find_motion(unit(y))]
    ((start, stop),) = motion.still
    assert 800 + 2 * RATE <= start <= 800 + 8 * RATE
    assert stop == len(y)
    backwards = find_motion(unit(y[::-1]))
    ((start, stop),) = backwards.still
    assert start == 0
    assert COUNT - 8 * RATE <= stop <= COUNT - 2 * RATE


def test_a_warm_up_after_handling_stays() -> None:
    """It lasts as long as the record: no time after which it has settled."""
    y = np.vstack([60.0 * noise(5, 800), noise(6)])
    y[800:, 1] += 4.0 * np.exp(-np.arange(COUNT) / RATE / 60.0)
    ((start, _),) = find_motion(unit(y)).still
    assert start <= 800 + 2 * RATE


def test_a_short_rest_between_motions_is_not_joined_to_a_long_one() -> None:
    """The second before a motion and the minute after it: only the minute is at rest for certain."""
    y = np.vstack([noise(7, 150), 60.0 * noise(8, 700), noise(9)])
    (kept, _) = at_rest(unit(y))
    ((start, stop),) = kept.segments
    assert 850 <= start <= 1100
    assert stop == len(y)
    assert "at rest and alike: " in kept.notes[-1]


def test_a_stand_still_of_a_tenth_of_the_log_is_found() -> None:
    rng = np.random.default_rng(11)
    sway = np.stack(
        [np.convolve(rng.standard_normal(COUNT), np.ones(25) / 5.0, "same") for _ in range(6)], axis=1
    )
    y = noise(12) + 40.0 * sway
    y[:1500] = noise(13, 1500)
    (kept, _) = at_rest(unit(y))
    ((start, stop),) = kept.segments
    assert start == 0
    assert 1300 <= stop <= 1500


def test_gaps_of_the_file_stay_gaps() -> None:
    records = unit(noise(14), ((0, 5000), (5100, COUNT)))
    assert at_rest(records) == records
    assert replace(records[0]).segments == ((0, 5000), (5100, COUNT))


def test_of_several_stand_stills_those_as_quiet_as_the_quietest_are_used() -> None:
    """On a table, in a hand, on the table again: between them it moves."""
    turn = 60.0 * noise(20, 500)
    y = np.vstack([noise(21, 3000), turn, 2.2 * noise(22, 3000), turn, noise(23, 3000)])
    (kept, _) = at_rest(unit(y))
    assert len(kept.segments) == 2
    assert kept.segments[0][1] <= 3000
    assert kept.segments[1][0] >= 7000
    frozen = np.vstack([y[:3500], np.ones((900, 6)), y[6500:]])
    assert len(at_rest(unit(frozen))[0].segments) == 2


def test_a_log_that_moves_most_of_the_time_has_the_quiet_ends_at_rest() -> None:
    """A fifth of it lies on a table before and after a ride whose vibration is five times the noise, with halts."""
    ride = 5.0 * noise(30, 16_000)
    ride[4000:5000] *= 0.3
    y = np.vstack([noise(31, 2000), ride, noise(32, 2000)])
    (kept, _) = at_rest(unit(y))
    (first, last) = kept.segments
    assert (first[0], last[1]) == (0, len(y))
    assert first[1] <= 2000
    assert last[0] >= 18_000


def test_a_few_seconds_of_rest_in_a_log_that_moves_are_refused():
    """Noise of some seconds says nothing of a random walk, and what moves slowly looks like rest for so long."""
    count = 60 * int(RATE)
    y = noise(9, count)
    y += 200.0 * np.sin(np.arange(count) / RATE)[:, None]
    y[2000:2300] = noise(10, 300)
    with pytest.raises(DataError, match="at rest"):
        at_rest(unit(y))
