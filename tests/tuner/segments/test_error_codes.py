"""Error codes: rows that hold one constant are one finding, and leave the noise; what noise gives is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from models.noise import White
from tuner.diagnosis import diagnose
from tuner.identification import identify
from tuner.segments.conditions import at_rest
from tuner.segments.error_codes import find_error_codes
from tuner.synthesis.findings import with_notes_on_findings
from tuner.types.records import Record

COUNT = 40_000
MEANS = np.array([0.1, 0.003, 9.81])
"""Zero is 5 sds from the noise of x, within that of y, and far from that of z."""


def record(y: np.ndarray) -> Record:
    axes = ("accel_x", "accel_y", "accel_z")[: y.shape[1]]
    return Record("accel", 0.01 * np.arange(len(y)), y, axes, "m/s^2", 0.01)


def samples(step: float = 0.0096) -> np.ndarray:
    y = MEANS + 0.02 * np.random.default_rng(1).standard_normal((COUNT // 2, 3))
    return step * np.round(y / step)


def codes(y: np.ndarray) -> list[float]:
    return [value for one in find_error_codes(record(y[:, None])) for value in one.values.values()]


def test_a_row_of_zeros_in_seven_is_one_finding_and_no_noise():
    y = samples()
    y[::7] = 0.0
    log = record(y)
    found = identify((log,))
    diagnosis = diagnose(log, identification=found)
    (finding,) = diagnosis.findings
    assert (finding.cause, finding.channels) == ("error_code", log.axes)
    told = {name: one.value for name, one in finding.parameters.items()}
    assert (told["period"], told["value"], told["start"]) == (7.0, 0.0, 0.0)
    assert abs(told["fraction"] - 1.0 / 7.0) < 1e-4
    again = identify(at_rest((log,)))
    for model in (m for axis in log.axes for m in (again.channels[axis].model, diagnosis.models[axis])):
        (white,) = (one for one in model.terms if isinstance(one, White))
        assert abs(white.density / 2e-3 - 1.0) < 0.02  # 3 sd, and the quantizer
    assert with_notes_on_findings(again, diagnosis, (log,)).notes == again.notes


def test_rows_that_repeat_the_others_hold_no_measurement_where_two_axes_have_a_code():
    """Each sample twice, in every second row a code in two axes: their white noise was the third axis's ÷ √2."""
    y = samples().repeat(2, axis=0)
    y[1::2, :2] = -32.768
    found = identify(at_rest((record(y),)))
    whites = [next(m for m in found.channels[a].model.terms if isinstance(m, White)) for a in found.channels]
    assert whites[0].density == pytest.approx(whites[2].density, rel=0.1)
    assert whites[1].density == pytest.approx(whites[2].density, rel=0.1)


@pytest.mark.parametrize("seed", range(5))
def test_a_code_of_the_converter_beside_bridges_of_gaps_is_none(seed):
    """Steps of 1.5 sds: a bridge near a code stood for its neighbours, and 22 % of an axis were error codes."""
    rng = np.random.default_rng(seed)
    y = 1.5 * np.round(rng.standard_normal(COUNT) / 1.5)
    y[rng.integers(0, COUNT, 25)] = 1.1 * rng.standard_normal(25)
    assert codes(y) == []


@pytest.mark.parametrize(("code", "share"), [(0.5, 0.001), (3.0, 0.003), (-6.0, 0.003), (50.0, 0.0005)])
def test_a_code_of_any_value_in_irregular_rows_is_found(code, share):
    rng = np.random.default_rng(2)
    y = rng.standard_normal(COUNT)
    y[rng.random(COUNT) < share] = code
    assert codes(y) == [code]


@pytest.mark.parametrize("step", [0.0, 0.05, 0.3, 0.9, 2.0, 4.0])
def test_what_noise_gives_is_no_code(step):
    rng = np.random.default_rng(3)
    w = rng.standard_normal(COUNT)
    rounded = step * np.round(w / step) if step else w
    shake = rounded.copy()
    shake[20_000:20_400] = np.clip(300.0 * np.sin(0.7 * np.arange(400.0)), -200.0, 200.0)
    edges = np.cumsum(max(step, 0.1) * np.maximum(1.0 + 0.33 * rng.standard_normal(4000), 0.05))
    uneven = max(step, 0.1) * np.searchsorted(edges, w + edges[2000])
    dead = np.where(np.abs(rounded) < 3.5 * max(step, 0.1), 0.0, rounded)
    rail = np.clip(rounded, -np.inf, step * np.round(2.0 / step) if step else 2.0)
    twice = np.repeat(rounded[: COUNT // 2], 2)
    outliers = np.minimum(rng.standard_t(4.0, COUNT), 8.0)
    hit = np.where(rng.random(COUNT) < 0.002, 70.0 * rng.standard_normal(COUNT), 0.0)
    shocks = np.clip(rounded + lfilter([1.0], [1.0, -1.2, 0.7], hit), -20.0, 20.0)
    for y in (rounded, shake, uneven, dead, rail, np.maximum(rounded, 0.0), twice, outliers, shocks):
        assert codes(y) == []


def test_codes_beneath_means_of_samples_are_none():
    """Means of samples that a coarse converter gave are its codes where it does not move."""
    rng = np.random.default_rng(4)
    y = np.round(0.3 * rng.standard_normal(8 * COUNT) + np.linspace(0.0, 5.0, 8 * COUNT))
    assert codes(y.reshape(-1, 8).mean(axis=1)) == []


def test_means_of_samples_at_two_rails_are_no_code_but_a_code_that_lasts_is():
    """Rails at two sds: one mean of two in 500 is of a sample at either, in the middle between them."""
    rng = np.random.default_rng(5)
    clipped = np.clip(rng.standard_normal(400_000), -2.0, 2.0)
    begins = np.arange(1000, 400_000, 4000)
    stuck = rng.standard_normal(400_000)
    stuck[(begins[:, None] + np.arange(12)).ravel()] = 25.0
    found = []
    for y in (clipped, stuck):
        means = replace(record(y.reshape(-1, 2).mean(axis=1)[:, None]), samples_a_mean=2)
        found.append([dict(one.values) for one in find_error_codes(means)])
    assert found == [[], [{"accel_x": 25.0}]]


def test_readings_of_full_scale_are_no_motion_but_a_shake_between_the_rails_is():
    """Of an int16 register; a shake of three seconds stays at a rail for several samples beside large readings."""
    rng = np.random.default_rng(6)
    rails = np.array([-3.2768, 3.2767])
    y = 1e-4 * np.round(20.0 * rng.standard_normal((COUNT, 3)))
    rows = np.flatnonzero(rng.random(COUNT) < 0.003)
    y[rows, 1] = rng.choice(rails, len(rows))
    gyro = Record("gyro", 0.01 * np.arange(COUNT), y, ("gyro_x", "gyro_y", "gyro_z"), "rad/s", 0.01)
    (kept,) = at_rest((gyro,))
    assert kept.segments == gyro.segments
    assert np.abs(kept.y).max() < 0.02
    assert {note.split(" rows")[0] for note in kept.notes} == {
        f"gyro_y: {np.count_nonzero(y[:, 1] == rail)}" for rail in rails
    }
    shake = slice(20_000, 20_300)
    turning = 8.0 * np.hanning(300) * np.sin(0.3 * np.arange(300))
    y[shake] = np.clip(y[shake] + turning[:, None], *rails)
    shaken = replace(gyro, y=y)
    assert not any(one.rows[shake].any() for one in find_error_codes(shaken))
    (kept,) = at_rest((shaken,))
    assert len(kept.segments) == 2
    assert sum(stop - start for start, stop in kept.segments) >= 0.98 * COUNT
