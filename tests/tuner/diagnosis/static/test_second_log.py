"""A second log that is long, and holds means, is compared with means of the first one, and the other way round."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tuner.diagnosis.static.diagnose import diagnose
from tuner.diagnosis.static.second_log import as_coarse
from tuner.types.records import Record


def record(n: int, seed: int, segments: tuple[tuple[int, int], ...] = ()) -> Record:
    t = 0.01 * np.arange(n)
    y = np.random.default_rng(seed).normal(0.0, 1e-3, n) + 2e-4 * np.sin(2.0 * np.pi * 3.0 * t)
    return Record("gyro", t, y, ("gyro_x",), "rad/s", 0.01, segments, {"temperature": 20.0 + t})


def test_means_are_those_of_whole_groups_within_segments() -> None:
    fine = record(1000, 1, ((0, 401), (500, 503), (600, 1000)))
    (coarse,) = as_coarse([fine], [replace(fine, samples_a_mean=4)])
    assert coarse.segments == ((0, 100), (100, 200))
    assert (coarse.interval, coarse.samples_a_mean) == (0.04, 4)
    expected = np.concatenate([fine.y[:400, 0], fine.y[600:, 0]]).reshape(-1, 4).mean(axis=1)
    np.testing.assert_allclose(coarse.y[:, 0], expected, rtol=1e-12)
    np.testing.assert_allclose(coarse.t[100], fine.t[600:604].mean())
    np.testing.assert_allclose(coarse.covariates["temperature"], 20.0 + coarse.t)
    assert as_coarse([fine], [fine]) == (fine,)


@pytest.mark.parametrize("long", [0, 1])
def test_gains_are_measured_on_a_second_log_of_other_means(long: int) -> None:
    logs = [record(30_000, 2), record(40_000, 3)]
    (logs[long],) = as_coarse([logs[long]], [replace(logs[long], samples_a_mean=2)])
    found = diagnose(logs[0], holdout=logs[1])
    assert [one.cause for one in found.findings] == ["line"]
    gain = found.findings[0].gain
    assert gain is not None
    assert gain.nats > 0.0
    assert any("means of 2 samples" in note for note in found.notes) == (long == 1)
