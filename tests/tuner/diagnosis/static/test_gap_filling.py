"""Templates across missing samples are continued in the same way as the samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tuner.diagnosis import diagnose
from tuner.diagnosis.static.causes import telegraph
from tuner.diagnosis.static.causes.motion import Motion
from tuner.diagnosis.static.causes.warmup import Warmup
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.channel import channel as ready
from tuner.diagnosis.static.model.fitted_channel import fit_channel
from tuner.types.records import Record

RATE, BLOCKS = 1.0, 4096


def channel(y: np.ndarray) -> Channel:
    record = Record("gyro", np.arange(len(y)) / RATE, y[:, None], ("gyro_x",), "rad/s", 1.0 / RATE)
    return ready(record, "gyro_x")


def noise(n: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(n)


def test_a_transient_that_starts_in_a_motion_leaves_nothing_there():
    # e^6 of the transient are foretold where the record was moved; 4096 means beyond 6 sd: 1e-5
    n = 45 * BLOCKS
    t = np.arange(n) / RATE
    even = channel(noise(n, 5) + 3.0 * np.exp((600.0 - t) / 100.0))
    found = fit_channel(even, (Motion(0, 600), Warmup(100.0)))
    rest = even.block_mean(found.cleaned.y) - found.path
    assert np.max(np.abs(rest - rest.mean())) * np.sqrt(even.block) < 6.0
    assert telegraph.Telegraph.test(found).gain < 0.0


def test_a_change_of_pose_leaves_no_trace_beside_it():
    # 300 sd of level over a motion: noise of one variance beside it and elsewhere, 4 sd of a variance of 900 samples
    n, first, last = 45 * BLOCKS, 60007, 61130
    y = noise(n, 6) + 300.0 * (np.arange(n) > 60500)
    y[first:last] += 40.0 * noise(last - first, 7)
    found = fit_channel(channel(y), (Motion(first, last),))
    beside = np.concatenate((found.e[first - 450 : first], found.e[last : last + 450]))
    assert abs(np.mean(beside**2) - 1.0) < 4.0 * np.sqrt(2.0 / 900.0)
    assert np.all(np.abs(found.path - found.path.mean()) < 0.3)


def test_slopes_do_not_depend_on_the_axes_beside():
    # a move that all axes see; slopes to 2 %, intervals of 0.5 %
    n = 10 * BLOCKS
    t = np.arange(n) / RATE
    celsius = 15.0 + 8.0 * np.sin(t / 5000.0) + 3.0 * np.cos(t / 900.0)
    slopes = np.array([-0.3, 1.0])
    y = np.stack([noise(n, seed) for seed in (2, 3)], axis=1) + slopes * celsius[:, None]
    y += np.array([-80.0, 300.0]) * (t > 25400.0)[:, None]
    y[25100:25700] += 60.0 * np.repeat(noise(1800, 4).reshape(60, 30), 10, axis=0)[:, 1:3]
    axes = ("gyro_y", "gyro_z")
    record = Record("gyro", t, y, axes, "rad/s", 1.0 / RATE, covariates={"temperature": celsius})
    alone = replace(record, y=record.column("gyro_z")[:, None], axes=("gyro_z",))
    for diagnosis in (diagnose(record), diagnose(alone)):
        assert {finding.cause for finding in diagnosis.findings} == {"motion", "temperature"}
        for finding in diagnosis.findings:
            for axis in finding.channels if finding.cause == "temperature" else ():
                size = finding.by_channel[axis]["slope"].value
                assert np.isclose(size, slopes[axes.index(axis)], rtol=0.02)
