"""Accepted causes as findings: parameters, words, and what is inseparable on a drive."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tuner.diagnosis.drive.causes.registry import DRIVE_CAUSES
from tuner.diagnosis.drive.search import Accepted
from tuner.diagnosis.static.findings import words
from tuner.types import Coefficient, Finding, Gain, Inseparable
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
