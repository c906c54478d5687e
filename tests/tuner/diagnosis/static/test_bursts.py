"""Several bursts: each is named with its place and size, and no heavy tails besides.

Seeds are fixed and are the first that were tried. Every burst has hundreds of nats.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tuner.diagnosis import diagnose
from tuner.diagnosis.static.causes.burst import _reach
from tuner.identification import identify
from tuner.types import Diagnosis
from tuner.types.records import Record

INTERVAL, N = 0.01, 120_000


def diagnosed(variance: np.ndarray, seed: int) -> Diagnosis:
    return diagnose(record(np.random.default_rng(seed).standard_normal(len(variance)) * np.sqrt(variance)))


def record(y: np.ndarray) -> Record:
    return Record("gyro", INTERVAL * np.arange(len(y)), y[:, None], ("gyro_x",), "rad/s", INTERVAL)


@pytest.mark.parametrize(
    ("number", "length", "ratio"),
    [
        pytest.param(4, 1000, 3.0, marks=pytest.mark.slow),
        pytest.param(10, 500, 4.0, marks=pytest.mark.slow),
        (3, 6000, 0.1),
        (5, 4000, 1.6),
    ],
)
def test_equal_bursts_are_all_named_and_nothing_else(number, length, ratio):
    variance = np.ones(N)
    starts = 2000 + (N // number) * np.arange(number)
    for first in starts:
        variance[first : first + length] = ratio
    diagnosis = diagnosed(variance, seed=number)
    assert [f.cause for f in diagnosis.findings] == ["burst"] * number
    assert diagnosis.unexplained == ()
    said = (
        "a filter needs the larger noise while"
        if ratio > 1.0
        else "the noise of the rest, which is larger, serves"
    )
    assert all(said in finding.consequence for finding in diagnosis.findings)
    reported = sorted(diagnosis.findings, key=lambda finding: finding.parameters["start"].value)
    for first, finding in zip(starts, reported, strict=True):
        # An edge misplaced by k samples is as likely as exp(−k ¼ ln((1 + r)²/(4 r))) (Bhattacharyya): 1e-6 for each.
        edge = INTERVAL * 14.0 / (0.25 * np.log((1.0 + ratio) ** 2 / (4.0 * ratio)))
        # A variance of m samples has the relative sd √(2/m): five of them, and what misplaced edges take away.
        for name, truth, tolerance in (
            ("start", first * INTERVAL, edge),
            ("duration", length * INTERVAL, 2.0 * edge),
            ("variance_ratio", ratio, (5.0 + max(1.0 / ratio - 1.0, 0.0)) * ratio * np.sqrt(2.0 / length)),
        ):
            assert abs(finding.parameters[name].value - truth) <= tolerance, name
        low, high = finding.parameters["start"].interval
        assert high - low < 2.0 * edge


@pytest.mark.parametrize(
    ("samples", "change"), [(N // 2, N // 3), (N // 4, N // 6), (N // 2, 32_000), (N // 2, 50_000)]
)
def test_the_noisier_part_of_a_log_is_the_burst_however_long(samples, change):
    """Noise three times as large from two thirds on: the rest was a burst of 0.1 × the variance.

    From the middle on it was a drift of the variance with three bursts and heavy tails: its gain, ÷ the scatter of
    squares about a course that is wrong, was the larger.
    """
    variance = np.ones(samples)
    variance[change:] = 9.0
    (one,) = diagnosed(variance, seed=3).findings
    assert one.cause == "burst"
    assert one.parameters["start"].value == pytest.approx(INTERVAL * change, abs=0.5)
    low, high = one.parameters["variance_ratio"].interval
    assert low < 9.0 < high < 12.0


def test_axes_whose_bursts_have_other_lengths_share_none():
    """One start was told of 2145 s in one axis and 0.84 s in the other."""
    sd = np.ones((N, 2))
    sd[40_000:46_000, 0], sd[40_000:44_000, 1] = 1.6, 1.6
    y = np.random.default_rng(8).standard_normal((N, 2)) * sd
    log = replace(record(y[:, 0]), y=y, axes=("gyro_x", "gyro_y"))
    found = {one.channels: one.parameters["duration"].value for one in diagnose(log).findings}
    assert found == {("gyro_x",): pytest.approx(60.0, abs=1.0), ("gyro_y",): pytest.approx(40.0, abs=1.0)}


def test_the_size_of_a_strong_burst_is_that_of_its_own_noise():
    """A hundredfold variance in 1 %: cut at fifteen deviations of the rest it would be estimated as 73."""
    variance = np.ones(N // 2)
    variance[25_000:25_600] = 100.0
    bursts = [f for f in diagnosed(variance, seed=7).findings if f.cause == "burst"]
    assert len(bursts) == 1
    assert bursts[0].parameters["variance_ratio"].value == pytest.approx(100.0, rel=5 * np.sqrt(2 / 600))


def test_a_variance_that_drifts_or_tails_that_are_heavy_are_no_bursts():
    half = N // 2
    drift = diagnosed(np.exp(2.0 * np.arange(half) / half), seed=8)
    assert [f.cause for f in drift.findings] == ["variance_drift"]
    tails = diagnose(record(np.random.default_rng(9).standard_t(5, half)))
    assert [f.cause for f in tails.findings] == ["heavy_tails"]


def test_a_variance_that_always_changes_is_reported_as_such_and_not_as_many_bursts():
    """Large and small variance by turns, sixty times: three bursts at most, and a periodic variance."""
    variance = np.exp(0.7 * np.sign(np.sin(2.0 * np.pi * np.arange(N) / 2000.0)))
    diagnosis = diagnosed(variance, seed=11)
    assert sum(f.cause == "burst" for f in diagnosis.findings) <= 3
    assert any("period" in reported.place for reported in diagnosis.unexplained)


def test_a_burst_beside_an_identification_without_white_noise_enlarges_nothing():
    """A resonance can make the identified terms lack white noise; no factor on zero is stated, and nothing fails."""
    variance = np.ones(N // 2)
    variance[25_000:26_200] = 100.0
    one = record(np.random.default_rng(7).standard_normal(N // 2) * np.sqrt(variance))
    identified = identify([one], terms=("bias_instability",), arma=None)
    diagnosis = diagnose(one, identification=identified)
    assert [f.cause for f in diagnosis.findings] == ["burst"]
    assert diagnosis.inflations == ()


def test_a_burst_of_few_samples_at_an_end_begins_there():
    """Eight samples before its other edge no sample is left to begin at, which ended in a traceback."""
    assert _reach(np.arange(101.0), 0, 5, 1.0, move_first=True) == (0, 0)
    assert _reach(np.arange(101.0), 95, 100, 1.0, move_first=False) == (100, 100)
