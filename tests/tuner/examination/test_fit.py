"""Laws of the likelihood by which faults of streams are compared."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.earth import metres_per_radian
from tuner.examination.examine import streams_of
from tuner.examination.fit import Placed, constants, earned, fit
from tuner.examination.streams import Positions, Streams
from tuner.examination.windows import Motion, averaged, windows_of
from tuner.simulation.simulate_source import simulate_source
from tuner.types.records import Drive


@pytest.fixture(scope="module")
def streams() -> Streams:
    """Return a right drive of three minutes with fixes at 5 Hz, whose errors wander by 2 m in a minute."""
    made = simulate_source("mpu9250", trajectory="city", gnss="rtk", duration=180.0, rate=50.0, seed=3)
    assert isinstance(made.data, Drive)
    out = streams_of(made.data)
    at = out.positions
    step = float(np.median(np.diff(at.t)))
    kept = np.exp(-step / 60.0)
    shocks = np.random.default_rng(4).standard_normal((len(at.t), 3)) * 2.0 * np.sqrt(1.0 - kept**2)
    wander = np.zeros_like(shocks)
    for k in range(1, len(shocks)):
        wander[k] = kept * wander[k - 1] + shocks[k]
    return replace(out, positions=replace(at, values=at.values + wander / metres_per_radian(at.values)))


def test_the_same_readings_are_fitted_whatever_their_delay(streams: Streams) -> None:
    """Else a delay is compared by other readings, whose errors are larger or smaller by chance."""
    dense = np.linspace(streams.positions.t[0], streams.positions.t[-1], 5 * len(streams.positions.t))
    values = np.column_stack([np.interp(dense, streams.positions.t, x) for x in streams.positions.values.T])
    fast = replace(streams, positions=replace(streams.positions, t=dense, values=values, sd=None))
    late = replace(fast, positions=fast.positions.later(0.25))
    kept = np.isfinite(fit(fast, rounds=3).wrong[0])
    other = np.isfinite(fit(late, rounds=3).wrong[0])
    inside = slice(20, -20)
    assert 0.1 < kept[inside].mean() < 0.9
    assert np.array_equal(kept[inside], other[inside])


def test_residuals_of_every_reading_are_those_of_the_readings_fitted(streams: Streams) -> None:
    some, every = fit(streams), fit(streams, every=True)
    for few, all_of, chance in zip(some.left, every.left, some.wrong, strict=True):
        there = np.isfinite(few[:, 0]) & (chance < 0.01)
        assert there.any()
        assert few[there] == pytest.approx(all_of[there], abs=1e-6)


def test_shorter_degrees_win_nothing() -> None:
    """Places exchanged to a latitude of shorter degrees have smaller errors, and a smaller density by as much."""
    there = np.tile([np.radians(10.0), np.radians(60.0), 0.0], (40, 1)) + 1e-9 * np.arange(40)[:, None]
    south = Positions(0.1 * np.arange(40), there)
    north = south.with_values(south.values[:, [1, 0, 2]])
    ratio = np.cos(np.radians(60.0)) / np.cos(np.radians(10.0))
    assert north.log_scale == pytest.approx(np.full(40, np.log(ratio)), rel=0.05)
    back = north.with_values(south.values)
    assert np.all(back.log_scale <= north.log_scale + 1e-9)


def test_errors_of_positions_that_wander_are_found_as_such(streams: Streams) -> None:
    """2 m of 60 s walk by √(2·4/60·τ) m: 0.37 m/s over the two seconds of a rate, of which a part is white."""
    found = fit(streams)
    assert 0.1 < found.errors[1] < 0.5
    assert np.all(found.noise[0].sd < 0.5)


def test_a_window_begins_where_its_readings_agree() -> None:
    """Seen: where half the positions of a window are wrong, it began amid these, and all of them were wrong."""
    made = simulate_source("mpu9250", trajectory="city", gnss="rtk", duration=300.0, rate=50.0, seed=5)
    assert isinstance(made.data, Drive)
    out, rng = streams_of(made.data), np.random.default_rng(9)
    at = out.positions
    metres = rng.normal(size=(len(at.t), 3))
    metres *= 43.0 * (rng.random(len(at.t)) < 0.5)[:, None] / np.linalg.norm(metres, axis=1)[:, None]
    planted = metres.any(axis=1)
    values = at.values + metres / metres_per_radian(at.values)
    wrong = fit(replace(out, positions=replace(at, values=values))).wrong[0]
    there = np.isfinite(wrong)
    assert np.mean((wrong[there] > 0.5) != planted[there]) < 0.02


def test_sds_of_constants_cover_a_drive_of_few_turns(streams: Streams) -> None:
    """A constant that is zero lies within four sds of its estimate, which the scatter of windows decides."""
    windows = windows_of(averaged(streams.imu))

    def delay(one: Placed, motion: Motion) -> np.ndarray:
        return -one.stream.by_time(motion)[..., None]

    value, sd = constants(streams, windows, fit(streams, windows), delay, np.ones(1), gated=True)
    assert abs(value[0]) < 4.0 * sd[0]
    assert sd[0] < 0.1


def test_gains_that_scatter_about_zero_earn_nothing() -> None:
    """Windows that win and lose by errors outside the model sum to some size; a fault wins in all."""
    scatter = np.random.default_rng(8).normal(0.0, 4.0, (200, 40))
    assert (scatter.sum(axis=1) > 7.0).mean() > 0.2  # more than the odds of a statement
    assert not any(earned(one) > 0.0 for one in scatter)
    assert earned(np.abs(scatter[0])) == pytest.approx(np.abs(scatter[0]).sum())


def test_a_drive_without_windows_has_an_empty_fit(streams: Streams) -> None:
    none = fit(replace(streams, positions=streams.positions.later(1e5), others=()))
    assert none.total == len(none.begin) == 0
    assert np.isnan(none.wrong[0]).all()


def test_positions_that_never_change_are_no_readings() -> None:
    """Their interval is infinite, and their density that of no prediction."""
    still = Positions(np.arange(30.0), np.tile([0.8, 0.2, 100.0], (30, 1)))
    assert not still.readings.any()
    assert still.interval == np.inf
    assert np.all(still.with_values(still.values[:, [1, 0, 2]]).log_scale == 0.0)
