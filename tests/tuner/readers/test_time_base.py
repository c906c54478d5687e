"""Time base of a log: the interval from rounded stamps; jitter is no gap; every lost sample is found."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tuner.readers.time_base import MAX_BRIDGED_GAP, even_timebase, stamped_timebase
from tuner.readers.timestamps import without_wrong_stamps
from tuner.types.records import DataError

COUNT = 20_000


@pytest.mark.parametrize(
    "rate", [10.0, 97.0, 99.97, 100.0, 125.0, 400.0, 760.0, 800.0, 950.0, 1000.0, 2000.0, 3333.0]
)
@pytest.mark.parametrize("resolution", [1e-3, 1e-6, 0.0])
def test_rounded_stamps_give_the_right_rate(rate: float, resolution: float) -> None:
    t = np.arange(COUNT) / rate
    stamps = np.floor(t / resolution + 0.5) * resolution if resolution else t
    base = stamped_timebase(stamps)
    assert base.interval * rate == pytest.approx(1.0, abs=max(resolution, 1e-9) * rate / COUNT)
    assert (base.gaps, base.duplicates, len(base.t)) == (0, 0, COUNT)
    assert np.abs(base.t - t).max() <= resolution + 1e-6 / rate
    np.testing.assert_allclose(np.diff(base.t), base.interval, rtol=1e-6)


@pytest.mark.parametrize("jitter", [0.01, 0.1, 0.3, 0.6])
def test_jitter_is_no_gap(jitter: float) -> None:
    rng = np.random.default_rng(11)
    t = 0.01 * np.arange(COUNT)
    base = stamped_timebase(np.sort(t + rng.normal(0.0, jitter * 0.01, COUNT)))
    assert base.missing == 0
    assert base.interval == pytest.approx(0.01, rel=1e-5)
    if jitter <= 0.1:
        assert base.jitter == pytest.approx(jitter * 0.01, rel=0.05)


def test_stamps_written_late_in_bursts_are_no_gap() -> None:
    rng = np.random.default_rng(12)
    delay = np.where(rng.random(COUNT) < 0.01, rng.exponential(0.05, COUNT), 0.0)
    stamps = np.maximum.accumulate(0.01 * np.arange(COUNT) + delay) + 1e-6 * np.arange(COUNT)
    base = stamped_timebase(stamps)
    assert base.interval == pytest.approx(0.01, rel=2e-4)
    assert base.missing <= 0.001 * COUNT


def test_batches_with_one_stamp_are_spread() -> None:
    t = 0.001 * np.arange(COUNT)
    base = stamped_timebase(t[::10].repeat(10))
    assert base.interval == pytest.approx(0.001, rel=1e-6)
    assert (base.missing, base.duplicates) == (0, 0)


def test_duplicates_are_dropped_only_where_values_are_equal() -> None:
    t = 0.01 * np.arange(COUNT)
    twice = np.sort(np.concatenate([t, t[::20]]))
    base = stamped_timebase(twice, equal=lambda i, j: np.ones(len(i), bool))
    assert base.duplicates == COUNT // 20
    assert base.interval == pytest.approx(0.01, rel=1e-9)
    assert base.rows is not None
    np.testing.assert_array_equal(twice[base.rows], t)


@pytest.mark.parametrize(("codes", "copied"), [(3.0, 0.0), (30.0, 0.0), (30.0, 0.3), (30.0, 1.0)])
def test_equal_readings_of_one_second_are_copies_only_if_chance_does_not_explain_them(
    codes: float, copied: float
) -> None:
    rng = np.random.default_rng(21)
    values = np.rint(codes / 10.0 * rng.normal(size=COUNT))
    t = np.floor(0.2 * np.arange(COUNT))
    rows = np.repeat(np.arange(COUNT), 1 + (rng.random(COUNT) < copied))
    values, t = values[rows], t[rows]
    base = stamped_timebase(t, equal=lambda i, j: values[i] == values[j])
    if copied == 0.0:
        assert (base.duplicates, base.interval) == (0, pytest.approx(0.2, rel=1e-4))
    else:
        by_chance = np.mean(values[1:] == values[:-1])
        assert base.duplicates >= len(rows) - COUNT
        assert base.duplicates <= (len(rows) - COUNT) + 1.3 * by_chance * COUNT


def test_a_row_whose_stamp_alone_is_wrong_is_where_it_stands() -> None:
    t = 0.013 * np.arange(COUNT)
    stamps = t.copy()
    stamps[[300, 9000, 15000]] += [-900.0, 900.0, 1.0]
    mended, wrong = without_wrong_stamps(stamps)
    assert wrong == 3
    np.testing.assert_allclose(mended, t, atol=1e-9)


def test_a_row_that_came_late_has_no_wrong_stamp() -> None:
    t = 0.01 * np.arange(COUNT)
    late = np.concatenate([t[:500], t[501:510], t[500:501], t[510:]])
    swapped = t.copy()
    swapped[[700, 701]] = swapped[[701, 700]]
    for stamps in (t, late, swapped):
        assert without_wrong_stamps(stamps)[1] == 0


@settings(max_examples=60, deadline=None)
@given(
    gaps=st.dictionaries(st.integers(20, 4970), st.integers(1, 400), min_size=1, max_size=6),
    jitter=st.sampled_from([0.0, 0.02, 0.1]),
    rounded=st.booleans(),
    seed=st.integers(0, 2**32 - 1),
)
def test_every_loss_is_found(gaps: dict[int, int], jitter: float, rounded: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    number = np.arange(5000) + np.cumsum(np.bincount(list(gaps), list(gaps.values()), 5000).astype(int))
    stamps = 0.005 * number + 0.005 * jitter * rng.uniform(-1.0, 1.0, 5000)
    if rounded:
        stamps = np.round(stamps, 4)
    base = stamped_timebase(stamps)
    assert base.gaps == len(gaps)
    assert base.missing == sum(gaps.values())
    assert base.interval == pytest.approx(0.005, rel=1e-5)
    kept = base.rows if base.rows is not None else np.arange(5000)
    assert len(kept) == 5000
    short = [g for g in gaps.values() if g <= MAX_BRIDGED_GAP]
    assert base.bridged == sum(short)
    assert len(base.t) == 5000 + sum(short)
    for start, stop in base.segments:
        np.testing.assert_allclose(np.diff(base.t[start:stop]), base.interval, rtol=1e-6)
    assert (np.diff(base.t) > 0).all()


def test_many_losses_are_not_bridged() -> None:
    rng = np.random.default_rng(13)
    kept = np.sort(rng.choice(COUNT, int(0.69 * COUNT), replace=False))
    base = stamped_timebase(0.01 * kept)
    assert base.bridged == 0
    assert base.positions is None
    assert base.missing == kept[-1] - kept[0] + 1 - len(kept)
    assert base.interval == pytest.approx(0.01, rel=1e-9)


def test_white_noise_keeps_its_variance_and_exceeds_it_at_long_cluster_times_by_the_share_of_bridges() -> (
    None
):
    # Mean of 400 records: the relative sd of the ratio of two variances of the same noise is below 0.1 %.
    rng = np.random.default_rng(14)
    count, reach = 2000, 40
    gaps = rng.choice(np.arange(20, count - 20, 25), 5, replace=False)
    lost = np.concatenate([np.arange(g, g + size) for g, size in zip(gaps, (1, 2, 3, 5, 5), strict=True)])
    kept = np.setdiff1d(np.arange(count), lost)
    base = stamped_timebase(0.01 * kept)
    white = rng.standard_normal((400, count))
    bridged = np.array([base.bridge(row[kept], stream) for stream, row in enumerate(white)])
    for size, high in ((1, 0.0), (reach, len(lost) / count)):
        variance = [
            np.mean(np.diff(x.reshape(400, -1, size).sum(axis=2), axis=1) ** 2) for x in (white, bridged)
        ]
        change = np.sqrt(variance[1] / variance[0]) - 1.0
        assert -1e-3 <= change <= high + 1e-3


def test_missing_rows_without_stamps() -> None:
    valid = np.ones(1000, bool)
    valid[[100, 500, 501]] = False
    base = even_timebase(1000, 0.01, valid)
    assert (base.gaps, base.missing, base.bridged) == (2, 3, 3)
    np.testing.assert_allclose(base.t, 0.01 * np.arange(1000), atol=1e-12)
    ramp = np.where(valid, np.arange(1000.0), np.nan)
    np.testing.assert_allclose(base.regrid(ramp), np.arange(1000.0), rtol=1e-12)


def test_shift_and_scale_of_time() -> None:
    rng = np.random.default_rng(15)
    number = np.delete(np.arange(3000), [700, 1500, 1501])
    stamps = 0.01 * number + rng.normal(0.0, 1e-4, len(number))
    base, moved = stamped_timebase(stamps), stamped_timebase(3.0 * stamps + 70.0)
    assert moved.interval == pytest.approx(3.0 * base.interval, rel=1e-9)
    assert moved.segments == base.segments
    np.testing.assert_allclose(moved.t, 3.0 * base.t + 70.0, atol=1e-8)


def test_pieces_too_short_are_left_out() -> None:
    t = np.concatenate([np.arange(100.0), [150.0, 151.0], 200.0 + np.arange(100.0)])
    base = stamped_timebase(t)
    assert base.segments == ((0, 100), (102, 202))
    assert base.left_out == 2


@pytest.mark.parametrize(
    "stamps", [[], [0.0], [0.0, 1.0], [1.0, 1.0, 1.0, 1.0], [0.0, 1.0, 10.0, 11.0, 20.0, 21.0]]
)
def test_too_little_is_refused(stamps: list[float]) -> None:
    with pytest.raises(DataError):
        stamped_timebase(np.array(stamps))


def test_rows_without_a_number_are_no_gap_of_the_clock() -> None:
    """Lost rows are; also where the rows of another sensor, which have no number here, stand between."""
    t = 0.01 * np.arange(1000.0)
    numbered = np.ones(1000, dtype=bool)
    numbered[[300, 600, 601]] = False
    told = stamped_timebase(t, valid=numbered)
    assert (told.gaps, told.unread, told.rounding) == (2, 2, 0.0)
    lost = stamped_timebase(np.delete(t, [300, 600, 601]))
    assert (lost.gaps, lost.unread) == (2, 0)
    both = np.stack((t, t + 0.005), axis=1).ravel()
    mine = np.tile([True, False], 1000)
    kept = np.delete(np.arange(2000), 800)
    assert stamped_timebase(both[kept], valid=mine[kept]).unread == 0
    mine[800] = False
    assert stamped_timebase(both, valid=mine).unread == 1


def test_the_course_of_the_stamps_shows_the_late_one_and_the_gap() -> None:
    stamps = 0.01 * np.arange(COUNT)
    stamps[700] += 0.003
    kept = np.delete(stamps, slice(12_000, 12_005))
    t, low, high, missing = stamped_timebase(kept).stamp_course(kept).T
    assert len(t) <= 600
    assert (t[np.argmax(high)], np.max(high)) == (pytest.approx(7.0, abs=0.4), pytest.approx(0.003, abs=1e-5))
    assert np.abs(low).max() < 1e-5
    assert missing.sum() == 5
    assert t[np.argmax(missing)] == pytest.approx(120.0, abs=0.5)


@pytest.mark.parametrize(
    ("kind", "rate", "gaps"), [("buffered", 100.0, 0), ("lost", 500.0, 1000), ("asleep", 500.0, 40)]
)
def test_stamps_of_bursts_are_those_of_arrival_where_nothing_is_lost(kind, rate, gaps):
    """A buffer of 100 Hz is emptied every 10 … 90 ms, 1 … 3 ms a sample; of 500 Hz four of five samples are lost.

    At random, which leaves the line that buffered samples stay near, and in sleep of 8 s after every 2 s.
    """
    rng = np.random.default_rng(3)
    if kind == "buffered":
        emptied = np.cumsum(rng.uniform(0.01, 0.09, 4000))
        made = 0.01 * np.arange(10_000)
        stamps = emptied[np.searchsorted(emptied, made)]
        turn = np.arange(len(made)) - np.searchsorted(stamps, stamps)
        stamps = np.sort(stamps + np.cumsum(rng.uniform(0.001, 0.003, 40))[turn])
    elif kind == "lost":
        kept = np.repeat(rng.random(10_000) < 0.2, rng.integers(1, 9, 10_000))
        stamps = 0.002 * np.flatnonzero(kept)
    else:
        stamps = (
            10.0 * np.arange(50)[:, None] + 0.002 * np.arange(1000) + rng.normal(0.0, 1e-4, (50, 1000))
        ).ravel()
    found = stamped_timebase(stamps)
    assert 1.0 / found.interval == pytest.approx(rate, rel=5e-3)
    assert len(found.segments) > gaps if gaps else len(found.segments) == 1


@pytest.mark.parametrize("stamp", [0.0, 0.001, 0.1, 1.0])
@pytest.mark.parametrize("set_back", ["for good", "and on again soon", "and on again later"])
def test_rows_follow_one_another_where_a_clock_was_set_back(stamp, set_back):
    """Payload-SDK issue 433: 1.9 s once a minute; stamps of ms, of 0.1 s and of whole seconds."""
    if stamp >= 0.1 and set_back != "for good":
        pytest.skip("the size of the jumps is known to a stamp")
    t = np.arange(60_000) / 100.0
    t = t if stamp == 0.0 else np.floor(t / stamp + 1e-9) * stamp
    if set_back == "for good":
        t[30_000:] -= 50.0
    elif set_back == "and on again later":
        t[30_000:32_000] -= 15.0
    else:
        for first in range(3_000, 60_000, 6_000):
            t[first : first + 95] -= 1.9
    base = stamped_timebase(t)
    assert base.interval == pytest.approx(0.01, rel=4e-3)
    assert base.t[-1] - base.t[0] == pytest.approx(600.0, abs=2.0)
    assert base.missing == base.duplicates == 0
    assert base.set_back == (10 if "soon" in set_back else 1)


@pytest.mark.parametrize(("ratio", "share"), [(3.0, 0.2), (3.0, 0.9), (4.0, 0.5), (10.0, 0.5), (0.2, 0.5)])
def test_a_clock_that_changes_its_step_is_found_with_both_steps(ratio: float, share: float) -> None:
    """Read at the mean step, or with most samples taken for lost, white noise was 1.7 times too large and usable."""
    row = np.arange(30_000.0)
    change = share * 30_000
    t = 0.01 * (np.minimum(row, change) + ratio * np.maximum(row - change, 0.0))
    found = stamped_timebase(t).change
    assert found is not None
    assert found.factor > 1.4
    assert (found.before, found.after) == (
        pytest.approx(0.01, rel=0.01),
        pytest.approx(0.01 * ratio, rel=0.01),
    )
    assert found.time == pytest.approx(0.01 * change, abs=0.05)


def _uneven(kind: str) -> np.ndarray:
    rng = np.random.default_rng(31)
    t = 0.01 * np.arange(COUNT)
    emptied = np.cumsum(rng.uniform(0.01, 0.5, COUNT))
    return {
        "a few gaps": t + 5.0 * (t > 60.0) + 300.0 * (t > 90.0),
        "jitter": np.sort(t + rng.normal(0.0, 0.03, COUNT)),
        "five rows a second": np.floor(np.arange(COUNT) / 5.0),
        "bursts": emptied[np.searchsorted(emptied, t)],
        "late stamps": np.maximum.accumulate(t + (rng.random(COUNT) < 0.01) * rng.exponential(0.1, COUNT))
        + 1e-6 * np.arange(COUNT),
        "half lost from the middle on": t[rng.random(COUNT) > 0.5 * (t > 100.0)],
        "three of four lost from the middle on": t[rng.random(COUNT) > 0.75 * (t > 100.0)],
        "a clock that wanders": t * (1.0 + 2e-4 * np.sin(t / 50.0)),
    }[kind]


@pytest.mark.parametrize(
    "kind",
    [
        "a few gaps",
        "jitter",
        "five rows a second",
        "bursts",
        "late stamps",
        "half lost from the middle on",
        "three of four lost from the middle on",
        "a clock that wanders",
    ],
)
@pytest.mark.parametrize("rows", [1000, COUNT])
def test_uneven_stamps_of_one_clock_change_no_step(kind: str, rows: int) -> None:
    assert stamped_timebase(_uneven(kind)[:rows]).change is None


def test_times_follow_a_clock_that_wanders_and_no_jitter() -> None:
    t = np.cumsum(0.01 * (1.0 + 0.01 * np.exp(-np.arange(COUNT) / 5000.0)))
    jitter = np.random.default_rng(16).normal(0.0, 1e-3, COUNT)
    base = stamped_timebase(t + jitter)
    assert np.abs(base.t - t).max() < 2e-3 < base.wander
    assert "times follow the stamps" in base.notes()[-1]
    even = stamped_timebase(0.01 * np.arange(COUNT) + jitter)
    assert even.wander == 0.0
    np.testing.assert_allclose(np.diff(even.t), even.interval, rtol=1e-6)
