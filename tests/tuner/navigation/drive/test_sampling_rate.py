"""Rates too low for a motion: coning of a known size is told where its error exceeds the biases."""

from __future__ import annotations

import numpy as np
import pytest

from tuner.navigation.data import Steps
from tuner.navigation.drive.sampling_rate import rate_note

BIAS_SD = np.array([1e-4] * 3 + [1e-2] * 3)


def _coning(rate, *, frequency=2.0, angle=0.1, noise=0.0):
    """Return steps of a unit whose x and y axes swing, one a quarter of a period after the other."""
    t = np.arange(0.0, 100.0, 1.0 / rate)
    phase = 2.0 * np.pi * frequency * t
    angles = angle * np.stack([np.sin(phase), np.cos(phase), 0.0 * t], axis=-1)
    force = np.tile([0.0, 0.0, -9.8 / rate], (len(t) - 1, 1))
    turn = np.diff(angles, axis=0) + noise * np.random.default_rng(1).standard_normal((len(t) - 1, 3))
    return Steps(0.0, np.diff(t), np.hstack([turn, force]))


@pytest.mark.parametrize(("rate", "enough"), [(100.0, True), (40.0, True), (7.0, False)])
def test_coning_is_told_where_the_samples_do_not_follow_it(rate, enough):
    note = rate_note(_coning(rate, noise=1e-5), BIAS_SD)
    assert (note is None) == enough
    if note:
        assert f"{rate:g} Hz" in note


def test_noise_and_large_biases_are_no_reason():
    assert rate_note(_coning(7.0), 1e4 * BIAS_SD) is None
    assert rate_note(_coning(50.0, angle=0.0, noise=0.01), BIAS_SD) is None
