"""Simulated drives of a sensor along a trajectory, and effects added to simulated or measured drives.

A perfect unit and a perfect receiver follow the trajectory; the noise of the sensor, turn-on constants and
the errors of the receiver are added, then the effects, in the order of their stages
(`models.effects.drive`). Each purpose draws from a stream of its own, spawned from the seed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.effects import Samples
from models.effects import hide as hide_at_rest
from models.effects.drive import Course, draw, hide, parse
from models.effects.drive.base import DriveEffect, DriveSamples
from models.measurements import perfect_fixes
from models.sensors import SensorGrade
from models.trajectory.motion import Motion, imu_increments
from tuner.navigation.settings import ACCELS, GYROS
from tuner.simulation.effect_spec import PlacedEffect, within_record
from tuner.simulation.receiver import draw_fix_errors, reported_sd
from tuner.simulation.static import Channel, grade_channels, sample_noise
from tuner.types import GnssNoise
from tuner.types.records import DataError, Drive, Gnss, Reference

REFERENCE_INTERVAL = 0.1
"""Spacing of the reference of a simulated drive, s."""
AXES = (*GYROS, *ACCELS)
"""The axes of a unit, in the order of the samples of a drive."""
UNIT_TEMPERATURE = 25.0
"""Temperature of the unit of a simulated drive, °C."""


def simulate_drive(
    sensor: SensorGrade | Mapping[str, Channel],
    motion: Motion,
    receiver: GnssNoise,
    *,
    rate: float | None = None,
    seed: int,
    effects: Sequence[str | DriveEffect] = (),
    at_rest: Sequence[PlacedEffect] = (),
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0),
    name: str = "simulated",
) -> tuple[Drive, dict[str, Any]]:
    """Simulate a drive.

    Parameters
    ----------
    sensor : SensorGrade or mapping of str to Channel
        The sensor, mounted forward, right, down: a grade, or its six axes one by one.
    motion : Motion
        The true motion, which becomes the reference.
    receiver : GnssNoise
        Errors of the receiver; it reports its true sds.
    rate : float, optional
        Samples a second, Hz; by default that of the grade.
    seed : int
        Seed of all randomness.
    effects : sequence of str or DriveEffect
        Effects; a text is ``CODE[:NAME=VALUE,…]``, drawn at random without parameters.
    at_rest : sequence of PlacedEffect
        Effects that also a static log shows, in axes of the unit; the unit stays at its temperature.
    lever_arm : tuple of 3 floats
        From the inertial unit to the antenna, m.
    name : str
        Of axes that were given one by one.

    Returns
    -------
    drive : Drive
        The drive.
    key : dict
        What is in it, ready for JSON (schema ``tuner.key/1``).

    Raises
    ------
    DataError
        A rate or an effect that cannot be, in one line.
    """
    name = sensor.key if isinstance(sensor, SensorGrade) else name
    rate = sensor.rate.value if rate is None and isinstance(sensor, SensorGrade) else rate
    if not rate or not motion.duration * rate >= 2.0:
        raise DataError(f"'rate' must give two samples or more in {motion.duration} s, got {rate} Hz")
    noise, biases, fixes, applied, unit = np.random.default_rng(seed).spawn(5)
    increments = np.hstack(imu_increments(motion, 1.0 / rate))
    first = motion.evaluate(np.zeros(1))
    perfect = np.vstack([np.hstack([first.omega_ib_b, first.f_b]), increments * rate])
    given = grade_channels(sensor) if isinstance(sensor, SensorGrade) else sensor
    if missing := [axis for axis in AXES if axis not in given]:
        raise DataError(f"{name}: expected the noise of six axes for a drive, {', '.join(missing)} missing")
    channels = {axis: given[axis] for axis in AXES}
    constant = {axis: c.bias_sd * float(biases.standard_normal()) for axis, c in channels.items()}
    errors, white = sample_noise(channels, constant, len(perfect), 1.0 / rate, noise)
    t, course = np.arange(len(perfect)) / rate, _true_course(motion)
    errors, white = _with_static_effects(
        Samples(t, perfect + errors, 1.0 / rate, np.full(len(t), UNIT_TEMPERATURE), white),
        perfect,
        at_rest,
        unit,
    )
    at, llh, vel, sd = _fixes(motion, receiver, lever_arm)
    samples = DriveSamples(
        t, perfect + errors, at, llh, vel, sd[:, :3], sd[:, 3:], course, lever_arm, None, errors, white
    )
    samples = _with_receiver_errors(samples, receiver, fixes)
    changed, truth = _with_effects(samples, effects, applied)
    drive = Drive(
        f"{name}-{motion.name}",
        t,
        changed.rates,
        _gnss(changed),
        Reference(course.t, course.llh, course.vel_n, rotation.rpy_from_quat(course.quat_nb)),
        lever_arm=lever_arm,
        mounting=np.eye(3),
        source=name,
    )
    key = {
        "schema": "tuner.key/1",
        "source": name,
        "trajectory": motion.name,
        "seed": seed,
        "rate_hz": rate,
        "duration_s": motion.duration,
        "receiver": {"position_sd": receiver.position_sd, "velocity_sd": receiver.velocity_sd},
        "hidden": [
            *truth,
            *(
                {"cause": h.effect.name, "channels": list(h.axes), "parameters": h.effect.parameters()}
                for h in at_rest
            ),
        ],
        "channels": {a: {"constant": constant[a], "terms": c.model.as_dict()} for a, c in channels.items()},
    }
    return drive, key


def _with_static_effects(
    block: Samples, perfect: FloatArray, effects: Sequence[PlacedEffect], rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return the errors of the unit and their white part, after the effects that a static log shows, too."""
    for one in effects:
        within_record(one.effect, block.t[0], block.t[-1])
    changed = hide_at_rest(block, [(e.effect, [AXES.index(a) for a in e.axes]) for e in effects], rng)
    assert changed.white is not None
    return changed.y - perfect, changed.white


def _true_course(motion: Motion) -> Course:
    t = np.append(np.arange(0.0, motion.duration, REFERENCE_INTERVAL), motion.duration)
    state = motion.evaluate(t)
    return Course(t, state.llh, state.vel_n, rotation.quat_from_mat(state.mat_nb))


def _fixes(
    motion: Motion, receiver: GnssNoise, lever_arm: tuple[float, float, float]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return times, positions and velocities of perfect fixes, and the sds the receiver reports, (k, 6)."""
    t = np.arange(receiver.interval, motion.duration, receiver.interval)
    llh, vel = perfect_fixes(motion, t, lever_arm=lever_arm)
    if receiver.velocity_sd is None:
        vel = np.full_like(vel, np.nan)
    return t, llh, vel, reported_sd(receiver, len(t))


def _with_receiver_errors(
    samples: DriveSamples, receiver: GnssNoise, rng: np.random.Generator
) -> DriveSamples:
    """Add the errors of the receiver to perfect fixes."""
    errors = draw_fix_errors(receiver, len(samples.fix_t), receiver.interval, rng)
    return replace(samples.moved(errors.position, errors.velocity), fix_white=errors.white)


def _with_effects(
    samples: DriveSamples, items: Sequence[str | DriveEffect], rng: np.random.Generator
) -> tuple[DriveSamples, list[dict[str, Any]]]:
    draws, rest = rng.spawn(2)
    try:
        effects = [
            item if isinstance(item, DriveEffect)
            else parse(item) if ":" in item
            else draw(item, stream, samples)
            for item, stream in zip(items, draws.spawn(len(items)), strict=True)
        ]  # fmt: skip
        for effect in effects:
            within_record(effect, samples.t[0], samples.t[-1])
        changed = hide(samples, effects, rest)
    except DataError:
        raise
    except ValueError as error:
        raise DataError(f"effect: {error}") from error
    return changed, [{"cause": e.name, "channels": ["drive"], "parameters": e.parameters()} for e in effects]


def _gnss(samples: DriveSamples) -> Gnss:
    return Gnss(samples.fix_t, samples.llh, samples.vel_n, samples.position_sd, samples.velocity_sd)
