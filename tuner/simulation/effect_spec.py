"""Specification of an effect in a simulated log: its code, its channels, and its parameters or none.

The text is ``CODE[@CHANNEL+CHANNEL…][:NAME=VALUE,…]``, such as ``temperature@gyro:slope=1e-5`` or
``line@gyro_x+gyro_y``; parameters that are not given are drawn at random.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.effects import EFFECTS, Effect, draw, parse
from models.effects.parsing import Written
from models.noise import NoiseModel
from tuner.types.records import DataError

ALL_CHANNELS = "imu"
"""Name of all channels together."""


@dataclass(frozen=True)
class PlacedEffect:
    """An effect and the axes that it acts on."""

    effect: Effect
    axes: tuple[str, ...]


def read_effect(text: str, axes: Sequence[str]) -> tuple[str, tuple[str, ...]]:
    """Split ``CODE[@CHANNELS][:PARAMETERS]`` into effect and axes.

    Parameters
    ----------
    text : str
        Channels are axes, ``gyro``, ``accel`` or ``imu``, joined by ``+``.
    axes : sequence of str
        The axes there are.

    Returns
    -------
    effect : str
        ``CODE[:PARAMETERS]``.
    axes : tuple of str
        The axes meant.

    Raises
    ------
    DataError
        A channel that is not there.
    """
    head, colon, parameters = text.partition(":")
    code, at, where = (part.strip() for part in head.partition("@"))
    groups = {axis: (axis,) for axis in axes} | {ALL_CHANNELS: tuple(axes)}
    for sensor in dict.fromkeys(map(sensor_of, axes)):
        groups[sensor] = tuple(axis for axis in axes if sensor_of(axis) == sensor)
    effect = EFFECTS.get(code)
    wanted = where.split("+") if at else [(effect and effect.home) or sensor_of(axes[0])]
    if unknown := [w for w in wanted if w not in groups]:
        raise DataError(f"effect '{text}': expected channels out of {' '.join(groups)}, got '{unknown[0]}'")
    meant = {axis for w in wanted for axis in groups[w]}
    return code + colon + parameters, tuple(axis for axis in axes if axis in meant)


def sensor_of(axis: str) -> str:
    """Return the sensor that an axis belongs to, such as ``gyro``."""
    return axis.partition("_")[0]


def within_record(effect: Written, begin: float, end: float) -> None:
    """Refuse an effect that begins after the end of the record.

    Parameters
    ----------
    effect : Written
        An effect; one with a ``time`` or ``start`` begins then.
    begin, end : float
        First and last stamp of the record, s.

    Raises
    ------
    DataError
        Nothing of the effect would be in the record.
    """
    values = {name: value for name, value in vars(effect).items() if value is not None}
    name = next((name for name in ("time", "start") if name in values), None)
    if name is None or (begin <= values[name] + values.get("duration", 0.0) and values[name] < end):
        return
    raise DataError(
        f"effect '{effect.name}': expected '{name}' within the record, {begin:g} … {end:g} s, got {values[name]:g} s; "
        "give an earlier time or a longer record"
    )


def noise_scale(model: NoiseModel, interval: float, span: float) -> tuple[float, float]:
    """Return the white sd of a sample and the smallest Allan deviation up to a tenth of the span, unit."""
    m = np.unique(np.geomspace(1, max(2.0, 0.1 * span / interval), 60).astype(int))
    variance = model.allan_variance(m * interval, interval=interval)
    return model.white_density() / math.sqrt(interval), float(np.sqrt(variance.min()))


def resolve(
    item: str | PlacedEffect,
    models: Mapping[str, NoiseModel],
    *,
    interval: float,
    span: float,
    constant: Mapping[str, float],
    rng: np.random.Generator,
) -> PlacedEffect:
    """Return the effect and axes of a specification, drawing what it leaves open.

    Parameters
    ----------
    item : str or PlacedEffect
        The specification.
    models : mapping of str to NoiseModel
        Noise of every axis: it sizes an effect that has to be drawn.
    interval, span : float
        Sampling interval and length of the record, s.
    constant : mapping of str to float
        Mean of every axis.
    rng : numpy.random.Generator
        Source of an effect that has to be drawn.

    Raises
    ------
    DataError
        An effect, a parameter or a channel that cannot be.
    """
    if isinstance(item, PlacedEffect):
        return item
    text, axes = read_effect(item, tuple(models))
    white_sd, floor = noise_scale(models[axes[0]], interval, span)
    scale = {"white_sd": white_sd, "interval": interval, "span": span, "floor": floor}
    try:
        return PlacedEffect(
            parse(text) if ":" in text else draw(text, rng, **scale, level=constant[axes[0]]), axes
        )
    except ValueError as error:
        raise DataError(f"effect '{item}': {error}") from error
