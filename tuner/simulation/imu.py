"""Inertial sensors of a simulation: their true errors, whatever the configuration of the filter assumes.

Flicker is drawn as flicker, never from the states of a filter. White noise is drawn by the compiled filter;
everything slow is drawn at a lower rate and kept constant between, which loses flicker above 5 Hz, far below white
noise. White noise, low-passed or not, and quantization are no part of the true bias: no filter estimates them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.noise import (
    TERMS,
    BiasInstability,
    NoiseModel,
    RandomWalk,
    Term,
    White,
)
from models.noise.bias_instability import ALLAN_FLOOR
from models.noise.bounded_white_noise import BOUNDED_SHARE
from models.sensors import SensorGrade
from tuner.navigation.engine import SensorErrors
from tuner.navigation.settings import ACCELS, GYROS
from tuner.types import ChannelNoise, FilterConfig, TermEstimate
from tuner.types.records import DataError

SLOW_INTERVAL = 0.1
"""Sampling interval of slow errors, s: flicker above 5 Hz is far below white noise."""
MIN_SLOW_TIME_CONSTANT = 1.0
"""Shortest time constant from which an error is sampled as slow, s: ten of its samples."""


@dataclass(frozen=True)
class Sensor:
    """A simulated inertial unit (SI).

    Attributes
    ----------
    name : str
        What it is called.
    noise : tuple of 6 NoiseModel
        Axes gyro x, y, z and accelerometer x, y, z.
    constant_sd : ndarray, shape (6,)
        Spread of the turn-on constants.
    notes : tuple of str
        What had to be assumed.
    """

    name: str
    noise: tuple[NoiseModel, ...]
    constant_sd: FloatArray
    notes: tuple[str, ...] = ()

    @property
    def white(self) -> FloatArray:
        """White densities, shape (6,)."""
        return np.array([model.white_density() for model in self.noise])

    @property
    def corners(self) -> FloatArray:
        """Time below which flicker hides under white noise, (N/0.664 B)², s, 0 without flicker; shape (6,).

        No filter can follow a bias faster than that, and none needs to.
        """
        levels = [
            sum(term.level**2 for term in model.terms if isinstance(term, BiasInstability))
            for model in self.noise
        ]
        flicker = ALLAN_FLOOR**2 * np.array(levels)
        return np.where(flicker > 0.0, self.white**2 / np.where(flicker > 0.0, flicker, 1.0), 0.0)

    def draw(
        self,
        steps: int,
        interval: float,
        rng: np.random.Generator,
        *,
        smoothing: FloatArray,
        after: NDArray[np.int64],
    ) -> tuple[SensorErrors, FloatArray]:
        """Draw the errors of one switch-on.

        Parameters
        ----------
        steps : int
            Sampling intervals.
        interval : float
            s.
        rng : numpy.random.Generator
            Source of the draw; goes on to draw the white noise.
        smoothing : ndarray, shape (6,)
            Over how long the true bias that is returned is averaged, s.
        after : ndarray of int, shape (k,)
            Numbers of steps after which the bias is returned.

        Returns
        -------
        errors : SensorErrors
            For the filter run.
        bias : ndarray, shape (k, 6)
            True bias: averaged around each instant.
        """
        drawn = [[t for t in model.terms if not isinstance(t, White)] for model in self.noise]
        every = 1 if any(map(_is_fast, chain(*drawn))) else max(1, round(SLOW_INTERVAL / interval))
        rows = -(-steps // every) + 1
        half = np.round(0.5 * smoothing / (every * interval)).astype(int)
        values, smooth = np.empty((rows, 6)), np.empty((len(after), 6))
        for axis, terms in enumerate(drawn):
            biases = NoiseModel([term for term in terms if term.is_bias])
            others = NoiseModel([term for term in terms if not term.is_bias])
            bias = self.constant_sd[axis] * rng.standard_normal() + biases.sample(rows, every * interval, rng)
            smooth[:, axis] = _centred_mean(bias, half[axis], after // every)
            values[:, axis] = bias + others.sample(rows, every * interval, rng)
        return SensorErrors(self.white, values, every, rng), smooth


def sensor_of_grade(grade: SensorGrade) -> Sensor:
    """Return the sensor that a grade describes."""
    noise = tuple(grade.noise_model(kind) for kind in ("gyro", "accel") for _ in range(3))
    spread = [grade.triad(kind).turn_on_sd for kind in ("gyro", "accel") for _ in range(3)]
    return Sensor(grade.key, noise, np.array([0.0 if sd is None else sd.value for sd in spread]))


def sensor_of_config(config: FilterConfig) -> Sensor:
    """Return the sensor behind a configuration: its identified terms, or its states where there are none.

    Raises
    ------
    DataError
        Where an axis is missing.
    """
    missing = [axis for axis in GYROS + ACCELS if axis not in config.channels]
    if missing:
        raise DataError(f"{config.name}: expected six axes to simulate, {', '.join(missing)} missing")
    channels = [config.channels[axis] for axis in GYROS + ACCELS]
    bare = [c.axis for c in channels if not c.identified]
    notes = (
        (f"{', '.join(bare)}: no identified terms; the truth is drawn from the states of the filter",)
        if bare
        else ()
    )
    noise = tuple(noise_of_channel(channel) for channel in channels)
    return Sensor(config.name, noise, np.array([c.constant_sd for c in channels]), notes)


def noise_of_channel(channel: ChannelNoise) -> NoiseModel:
    """Return the identified terms of a channel, or its states where there are none."""
    if channel.identified:
        terms = [term for estimate in channel.identified if (term := _term(estimate)) is not None]
        if any(isinstance(term, White) for term in terms):
            return NoiseModel(terms)
        return NoiseModel([White(channel.white_density), *terms])
    states: list[Term] = [White(channel.white_density)]
    states += channel.markov
    if channel.random_walk_density > 0.0:
        states.append(RandomWalk(channel.random_walk_density))
    return NoiseModel(states)


def _term(estimate: TermEstimate) -> Term | None:
    """Return the term of an estimate, at half of its limit where it is only bounded."""
    values: Mapping[str, float | None] = {
        name: c.value if c.value is not None else None if c.upper is None else BOUNDED_SHARE * c.upper
        for name, c in estimate.coefficients.items()
    }
    if any(value is None for value in values.values()):
        return None
    return TERMS[estimate.name](**values)


def _centred_mean(y: FloatArray, half: int, at: NDArray[np.int64]) -> FloatArray:
    """Return the mean over `half` samples to both sides of some, fewer at the ends."""
    total = np.concatenate([[0.0], np.cumsum(y)])
    first, last = np.maximum(at - half, 0), np.minimum(at + half + 1, len(y))
    return np.asarray((total[last] - total[first]) / (last - first))


def _is_fast(term: Term) -> bool:
    return not term.is_bias or term.fastest_time() < MIN_SLOW_TIME_CONSTANT
