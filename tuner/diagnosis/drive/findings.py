"""Accepted causes as findings: parameters, words, and what is inseparable on a drive."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from models.arrays import FloatArray
from tuner.diagnosis.drive.causes.registry import DRIVE_CAUSES
from tuner.diagnosis.drive.causes.time_offset import OFFSET_DELAY, RATE
from tuner.diagnosis.drive.search import Accepted
from tuner.diagnosis.static.findings import words
from tuner.types import Coefficient, Finding, Gain, Inseparable
from tuner.types.clock import HALF_INTERVAL, Clock, Delay
from tuner.types.records import Drive


def finding(one: Accepted, drive: Drive, gain: Gain | None, doubted: tuple[str, ...] = ()) -> Finding:
    """Return an accepted cause as a finding; a lever arm in axes of the vehicle where its mounting is known.

    Parameters
    ----------
    one : Accepted
        The cause.
    drive : Drive
        The drive.
    gain : Gain or None
        What the cause is worth.
    doubted : tuple of str
        Its parameters that are not determined; an axis of the vehicle is named after the nearest one of the sensor.
    """
    declared = DRIVE_CAUSES[one.cause]
    channels = declared.channels
    parameters: Mapping[str, Coefficient] = one.parameters
    if one.cause == "lever_arm" and drive.mounting is not None:
        names = list(parameters)
        nearest = dict(zip(names, np.abs(drive.mounting.T).argmax(axis=0).tolist(), strict=True))
        doubted = tuple(names[nearest[name]] for name in doubted)
        parameters = rotated_parameters(parameters, drive.mounting.T)
    result = one.candidate.result
    figures = {name: c for name, c in parameters.items() if name not in doubted}
    extension: dict[str, Any] = {
        "cause": one.cause,
        "joins": declared.joins,
        "parameters": {name: c.value for name, c in figures.items()},
    }
    return Finding(
        one.cause,
        channels,
        result.name,
        result.statistic,
        min(1.0, result.p_value),
        parameters,
        words(one.cause, channels, declared.meaning, figures),
        declared.consequence,
        extension,
        gain,
        one.alternatives,
        doubted=doubted,
    )


def of_first_and_last(accepted: tuple[Accepted, ...], t: FloatArray) -> tuple[Accepted, ...]:
    """Return accepted causes with the delay of the first and of the last fix where their clock drifts.

    Parameters
    ----------
    accepted : tuple of Accepted
        With estimates.
    t : ndarray, shape (k,)
        Stamps of the fixes, s.
    """
    of = {one.cause: one.parameters for one in accepted}
    delay, rate = (of.get(p.cause, {}).get(p.name) for p in (OFFSET_DELAY, RATE))
    if delay is None or rate is None:
        return accepted
    clock = Clock(_as_delay(delay), drift=_as_delay(rate), ends=(float(t[0]), float(t[-1])))
    ends = {
        when.strip().replace(" ", "_"): Coefficient.known(one.value, *one.interval, "s")
        for when, one in clock.delays.items()
    }
    return tuple(
        replace(one, parameters=ends) if one.cause == OFFSET_DELAY.cause else one for one in accepted
    )


def _as_delay(figure: Coefficient) -> Delay:
    low, high = figure.interval or (0.0, 0.0)
    return Delay(figure.value or 0.0, (high - low) / (2.0 * HALF_INTERVAL))


def rotated_parameters(parameters: Mapping[str, Coefficient], matrix: Any) -> dict[str, Coefficient]:
    """Return three parameters along other axes, each with the interval of a sum of independent ones."""
    known = list(parameters.values())
    value = matrix @ np.array([c.value for c in known])
    half = np.array([0.5 * (c.interval[1] - c.interval[0]) if c.interval else 0.0 for c in known])
    spread = np.sqrt(matrix**2 @ half**2)
    return {
        name: Coefficient.known(float(v), float(v - s), float(v + s), c.unit)
        for (name, c), v, s in zip(parameters.items(), value, spread, strict=True)
    }


def inseparable_causes(accepted: tuple[Accepted, ...]) -> tuple[Inseparable, ...]:
    """Return the causes that a drive cannot separate, and the motion that would."""
    return tuple(
        Inseparable(
            (one.cause, *one.inseparable),
            f"cannot be separated on this drive: {', '.join((one.cause, *one.inseparable))}; drive {SEPARATING_MOTION}",
        )
        for one in accepted
        if one.inseparable
    )


SEPARATING_MOTION = "an S-turn, with hard braking and starting, to separate them"
