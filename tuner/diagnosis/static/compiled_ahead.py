"""Compiling what identification and diagnosis call, once and on all processors, where it is not on disk yet.

Otherwise every copy of the process (`tuner.jobs`) that first needs a function would compile it for itself, all at once.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from models.noise import GaussMarkov, RandomWalk
from tuner.diagnosis.static.causes.heavy_tails import HeavyTails
from tuner.diagnosis.static.channel import MIN_SAMPLES, channel
from tuner.diagnosis.static.hypothesis_tests import spectrum
from tuner.diagnosis.static.model.fitted_channel import fit_channel
from tuner.diagnosis.static.switching.kim_filter import switching
from tuner.diagnosis.static.switching.models import STILL, Chain, Slow, likelihood
from tuner.diagnosis.static.variance.normal_scores import NormalScores
from tuner.identification.identify_channel import identify_channel
from tuner.jobs import each, on_disk
from tuner.types.records import Record

SAMPLES = 4 * MIN_SAMPLES
"""Samples of the record that the functions are run on: few, as only their types matter."""


def compile_ahead() -> None:
    """Compile, or load from disk, on all processors; nothing where the slowest function is on disk already."""
    if not on_disk(switching(2, 2)):
        each(lambda run: run(), GROUPS)


def _record() -> Record:
    """Return a record of coloured noise with a resonance, so that its spectrum needs every shape."""
    white = np.random.default_rng(0).standard_normal(SAMPLES + 1)
    phase = np.cumsum(1.0 + 0.02 * np.cumsum(white[1:]) / np.sqrt(SAMPLES))
    y = white[1:] + 0.8 * white[:-1] + np.sin(phase)
    return Record("sample", 0.01 * np.arange(float(SAMPLES)), y[:, None], ("gyro_x",), "rad/s", 0.01)


def _two_levels() -> None:
    slow = Slow.of((GaussMarkov(1.0, 10.0), RandomWalk(0.1)), 1.0)
    likelihood(np.arange(8.0), Chain.two(1.0, 0.1, 0.1), slow, 1.0)


def _one_level() -> None:
    slow = Slow.of((GaussMarkov(1.0, 10.0), RandomWalk(0.1)), 1.0)
    likelihood(np.arange(8.0), STILL, slow, 1.0)
    HeavyTails(5.0).whiten(np.arange(8.0))
    NormalScores.of(np.arange(64.0))(np.arange(8.0))


def _spectrum() -> None:
    spectrum(fit_channel(channel(_record(), "gyro_x")))


def _identification() -> None:
    identify_channel(_record(), "gyro_x")


GROUPS: tuple[Callable[[], None], ...] = (_two_levels, _spectrum, _one_level, _identification)
"""Runs that compile about equally long, the longest first."""
