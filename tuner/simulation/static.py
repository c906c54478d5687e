"""Static logs of a simulated sensor with effects on request, and the ground truth of both.

A channel is the sum of the noise terms of its model, a turn-on bias and, on an accelerometer, gravity. The
unit lies level: the specific force of b (forward-right-down) is (0, 0, −g). Effects come in the order in
which a sample meets them (`models.effects.static.base`).

Every purpose draws from a stream of its own, spawned from the seed: each noise term of each channel, the
biases, the effects and the thermometer. A further effect therefore leaves the noise as it was.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.effects import Effect, Samples, hide
from models.effects.static.base import log_uniform, sign
from models.effects.static.distribution import Burst, HeavyTails
from models.effects.static.events import Spikes, Step, Telegraph
from models.effects.static.sampling import Duplicates
from models.effects.static.spectral import Line, LowPass, Vibration
from models.effects.static.temperature_profiles import Diurnal, Profile, Warming, thermometer
from models.effects.static.thermal import TemperatureSlope, Warmup
from models.noise import NoiseModel, White
from models.sensors import KINDS, SensorGrade
from tuner.readers.time_base import stamped_timebase
from tuner.simulation.effect_spec import PlacedEffect, noise_scale, resolve, sensor_of, within_record
from tuner.types.number_ranges import Positive, Whole
from tuner.types.public import public
from tuner.types.records import DataError, Record

GRAVITY = 9.80665
"""Standard gravity, m/s²."""
UNITS: Mapping[str, str] = MappingProxyType({"gyro": "rad/s", "accel": "m/s^2"})
DEMO_GRADE, DEMO_RATE, DEMO_DURATION = "mpu9250", 100.0, 3600.0
"""The built-in simulated sensor: a MEMS unit, Hz, s."""

THERMOMETER_STEP = 0.125
THERMOMETER_REFRESH = 1.28
THERMOMETER_SD = 0.02
"""Quantizer step (K), time between readings (s) and noise (K) of the thermometer, as in a Bosch BMI088."""


@dataclass(frozen=True)
class Channel:
    """What one axis is made of: a noise model and the sd of its turn-on bias (SI)."""

    model: NoiseModel
    bias_sd: float = 0.0


def grade_channels(grade: SensorGrade) -> dict[str, Channel]:
    """Return the six axes of a grade."""
    channels: dict[str, Channel] = {}
    for kind in KINDS:
        triad = grade.triad(kind)
        channel = Channel(triad.noise_model(), triad.turn_on_sd.value if triad.turn_on_sd else 0.0)
        channels |= {f"{kind}_{axis}": channel for axis in "xyz"}
    return channels


@public("simulate")
def simulate(
    sensor: SensorGrade | Mapping[str, Channel] | Mapping[str, NoiseModel],
    *,
    duration: Positive,
    rate: Positive | None = None,
    seed: Whole,
    effects: Sequence[str | PlacedEffect] = (),
    temperature: Profile | None = None,
) -> tuple[tuple[Record, ...], dict[str, Any]]:
    """Simulate a static log.

    Parameters
    ----------
    sensor : SensorGrade or mapping of str to Channel or NoiseModel
        A grade, or the axes one by one, such as ``gyro_x``; a model alone has no turn-on bias.
    duration : float
        s.
    rate : float, optional
        Samples a second, Hz; by default that of the grade.
    seed : int
        Seed of all randomness.
    effects : sequence of str or PlacedEffect
        Effects; a text is ``CODE[@CHANNEL+CHANNEL…][:NAME=VALUE,…]``. Without channels the effect is in all
        axes of the first sensor (tilt: of the accelerometer; time stamps: in everything); without parameters
        they are drawn at random, sized by the noise of the first of its axes.
    temperature : Profile, optional
        Temperature of the sensor; by default it warms up by 8 K over about a sixth of the record.

    Returns
    -------
    records : tuple of Record
        One a sensor, with the covariate ``temperature`` as a digital thermometer reads it.
    key : dict
        What is in the records, ready for JSON (schema ``tuner.key/1``): noise, constants, effects.

    Raises
    ------
    DataError
        A duration, an effect or a channel that cannot be, in one line.
    """
    name = sensor.key if isinstance(sensor, SensorGrade) else "simulated"
    rate = sensor.rate.value if rate is None and isinstance(sensor, SensorGrade) else rate
    given = grade_channels(sensor) if isinstance(sensor, SensorGrade) else sensor
    channels = {axis: c if isinstance(c, Channel) else Channel(c) for axis, c in given.items()}
    if not (rate and rate > 0 and duration * rate >= 2):
        raise DataError(f"'duration' and 'rate' must give two samples or more, got {duration} s at {rate} Hz")
    noise, biases, draws, applied, reading = np.random.default_rng(seed).spawn(5)
    constant = {a: gravity_of(a) + c.bias_sd * float(biases.standard_normal()) for a, c in channels.items()}
    t = np.arange(round(duration * rate)) / rate
    profile = temperature or Warming(25.0, 8.0, duration / 6.0)
    y, white = sample_noise(channels, constant, len(t), 1.0 / rate, noise)
    block = Samples(t, y, 1.0 / rate, profile.celsius(t), white)
    models = {axis: channel.model for axis, channel in channels.items()}
    chosen = [
        resolve(item, models, interval=1.0 / rate, span=duration, constant=constant, rng=stream)
        for item, stream in zip(effects, draws.spawn(len(effects)), strict=True)
    ]
    for one in chosen:
        within_record(one.effect, t[0], t[-1])
    axes = tuple(channels)
    try:
        block = hide(block, [(h.effect, [axes.index(a) for a in h.axes]) for h in chosen], applied)
    except ValueError as error:
        raise DataError(str(error)) from error
    key = {
        "schema": "tuner.key/1",
        "source": name,
        "seed": seed,
        "rate_hz": rate,
        "duration_s": duration,
        "temperature": {"profile": type(profile).__name__.lower(), **vars(profile)},
        "hidden": [
            {"cause": h.effect.name, "channels": list(h.axes), "parameters": h.effect.parameters()}
            for h in chosen
        ],
        "channels": {a: {"constant": constant[a], "terms": c.model.as_dict()} for a, c in channels.items()},
    }
    return _records(block, axes, name, reading), key


def demo(seed: int) -> tuple[tuple[Record, ...], dict[str, Any]]:
    """Simulate an hour of a MEMS unit with one effect, clear enough to be found, drawn from the seed.

    Parameters
    ----------
    seed : int
        Seed of the effect and of all noise.

    Returns
    -------
    records, key
        As of `simulate`.
    """
    from tuner.catalogue.grades import load_grade

    grade = load_grade(DEMO_GRADE)
    rng = np.random.default_rng((seed, 1))
    white_sd, floor = noise_scale(grade.noise_model("gyro"), 1.0 / DEMO_RATE, DEMO_DURATION)
    effect = _clear_effect(rng, white_sd, floor)
    axes = (
        tuple(f"gyro_{a}" for a in "xyz")
        if isinstance(effect, Duplicates | LowPass)
        else (f"gyro_{rng.choice(list('xyz'))}",)
    )
    return simulate(
        grade,
        duration=DEMO_DURATION,
        rate=DEMO_RATE,
        seed=seed,
        effects=(PlacedEffect(effect, axes),),
        temperature=Diurnal(30.0, 5.0, period=log_uniform(rng, 1200.0, 2400.0)),
    )


def _clear_effect(rng: np.random.Generator, white_sd: float, floor: float) -> Effect:
    """Draw an effect that an hour at 100 Hz shows plainly."""
    time, turn = DEMO_DURATION * float(rng.uniform(0.2, 0.8)), sign(rng)
    choices: tuple[Effect, ...] = (
        Line(log_uniform(rng, 1.0, 40.0), white_sd * log_uniform(rng, 0.05, 0.3)),
        Vibration(
            log_uniform(rng, 5.0, 40.0), log_uniform(rng, 10.0, 50.0), white_sd * log_uniform(rng, 0.2, 0.5)
        ),
        LowPass(log_uniform(rng, 12.0, 35.0)),
        TemperatureSlope(turn * floor * log_uniform(rng, 10.0, 30.0)),
        Warmup(turn * floor * log_uniform(rng, 30.0, 60.0), log_uniform(rng, 100.0, 600.0)),
        Step(time, turn * floor * log_uniform(rng, 6.0, 15.0)),
        Telegraph(turn * white_sd * log_uniform(rng, 0.3, 0.5), *rng.uniform(10.0, 60.0, 2).tolist()),
        Spikes(log_uniform(rng, 0.01, 0.1), white_sd * log_uniform(rng, 8.0, 30.0)),
        HeavyTails(log_uniform(rng, 0.3, 2.0)),
        Burst(time, log_uniform(rng, 60.0, 300.0), log_uniform(rng, 2.0, 6.0)),
        Duplicates(log_uniform(rng, 0.02, 0.2)),
    )
    return choices[int(rng.integers(len(choices)))]


def gravity_of(axis: str) -> float:
    """Return what gravity makes an axis of a level unit read, SI."""
    return -GRAVITY if axis == "accel_z" else 0.0


def sample_noise(
    channels: Mapping[str, Channel],
    constant: Mapping[str, float],
    n: int,
    interval: float,
    rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray]:
    """Draw the samples of channels about constants, each term from a stream of its own.

    Returns
    -------
    y, white : ndarray, shape (n, k)
        Samples and their white part.
    """
    y, white = np.empty((n, len(channels)), order="F"), np.zeros((n, len(channels)), order="F")
    for j, (stream, (axis, channel)) in enumerate(
        zip(rng.spawn(len(channels)), channels.items(), strict=True)
    ):
        y[:, j] = constant[axis]
        terms = channel.model.terms
        for term, own in zip(terms, stream.spawn(len(terms)), strict=True):
            (white if isinstance(term, White) else y)[:, j] += term.sample(n, interval, own)
        y[:, j] += white[:, j]
    return y, white


def _records(
    block: Samples, axes: tuple[str, ...], name: str, rng: np.random.Generator
) -> tuple[Record, ...]:
    """Cut a block into one record a sensor, with the temperature as it is read."""
    assert block.temperature is not None
    celsius = thermometer(
        block.t,
        block.temperature,
        step=THERMOMETER_STEP,
        refresh=THERMOMETER_REFRESH,
        sd=THERMOMETER_SD,
        rng=rng,
    )
    stamps = stamped_timebase(block.t)
    timing = {
        "gap_count": float(stamps.gaps),
        "jitter_sd": stamps.jitter,
        "rounding": stamps.rounding,
        "clock_ratio": stamps.interval / block.interval,
    }
    records = []
    for sensor in dict.fromkeys(map(sensor_of, axes)):
        columns = [j for j, axis in enumerate(axes) if sensor_of(axis) == sensor]
        record = Record(
            name=sensor,
            t=block.t,
            y=block.y[:, columns],
            axes=tuple(axes[j] for j in columns),
            unit=UNITS.get(sensor, ""),
            interval=block.interval,
            segments=tuple(pairwise((0, *block.breaks, len(block.t)))),
            covariates={"temperature": celsius},
            source=name,
            timing=timing,
        )
        records.append(record)
    return tuple(records)
