"""How the axes of a unit change while it is measured: a line over time, with the temperature, and in steps.

All is seen in means of `BLOCK_SECONDS`. A slope is a sum of them with weights w, and its variance what the noise S(f)
of the axis passes to it, ∫ S |W|² df. Of a step the means of `WINDOW_BLOCKS` blocks before and after it differ by more
than they do by noise as most axes of the sensor have it beside their fast noise, of which the axis shows its own: to
the fit of an axis its step is slow noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.stats import norm

from models.arrays import FloatArray
from models.noise import NoiseModel
from tuner.formats.customary_units import amount, digits, range_text
from tuner.limits import COLLINEAR_SHARE, ODD_DRIFT
from tuner.production.quantities import QUANTILE, least_size
from tuner.segments.conditions import MIN_TEMPERATURE_RANGE
from tuner.types import Coefficient, Identification
from tuner.types.records import Record

BLOCK_SECONDS = 2.0
"""Length of a mean, s: shorter than any warming, and long enough for white noise to be small in it."""
LEAST_BLOCKS = 30
"""Blocks from which anything is said: of a minute."""
WINDOW_BLOCKS = 4
"""Blocks before and after a step that are compared."""
STEP_CHANCE = 1e-5
"""Chance that a sound axis of known noise is said to step: its noise is known to 10 %, which makes ten times of it."""
PADDING_FACTOR = 8
"""Length of the transform of weights ÷ that of the log: the lowest frequencies pass, and few lie in a log."""


def slow_changes(
    records: Sequence[Record], found: Identification
) -> tuple[dict[str, str], dict[str, Coefficient], dict[str, str]]:
    """Return what changes during a log.

    Parameters
    ----------
    records : sequence of Record
        Sensors of one unit at rest.
    found : Identification
        Their noise.

    Returns
    -------
    units : dict of str to str
        SI unit of further channels: ``temperature``, where it is measured.
    quantities : dict of str to Coefficient
        By channel and symbol, as of `tuner.production.quantities`.
    causes : dict of str to str
        What a person must see, in words, by sensor and what it is: ``gyro warming``, ``gyro drift``, ``gyro steps``.
    """
    units: dict[str, str] = {}
    quantities: dict[str, Coefficient] = {}
    said: dict[str, list[str]] = {}
    behind = ""
    for record in records:
        t, starts = _means(record.t, record)
        axes = [axis for axis in record.axes if axis in found.channels]
        if len(t) < LEAST_BLOCKS or not axes or record.interval > 0.5 * BLOCK_SECONDS:
            continue
        span = float(record.t[-1] - record.t[0])
        celsius = record.covariates.get("temperature")
        warmth = np.zeros(len(t)) if celsius is None else _means(celsius, record)[0]
        spread, kind = float(np.ptp(warmth)), "drift"
        courses = {"ramp": (t, "s", span)}
        if celsius is not None and np.isfinite(warmth).all():
            units["temperature"] = "K"
            change = float(warmth[-1] - warmth[0])
            quantities["temperature.warm_up"] = Coefficient.known(change, change, change, "K")
            behind = behind or _beside(t, warmth, change)
        if spread >= MIN_TEMPERATURE_RANGE:
            courses["temperature_slope"], kind = (warmth, "K", spread), "warming"
        fast = [float(np.std(np.diff(record.column(axis)))) for axis in axes]
        passed = [_passed(STEP_WEIGHTS, len(t), found.channels[axis].model) for axis in axes]
        usual = float(np.median(np.divide(passed, fast)))
        for axis, own in zip(axes, fast, strict=True):
            y, channel = _means(record.column(axis), record)[0], found.channels[axis]
            changes = []
            for symbol, (x, per, length) in courses.items():
                quantities[f"{axis}.{symbol}"] = _slope(x, y, channel.model, f"{record.unit}/{per}")
                changes.append(_slope(x / length, y, channel.model, record.unit))
            largest = max(changes, key=least_size)
            if least_size(largest) > ODD_DRIFT * (channel.sigma_10s.value or math.inf):
                said.setdefault(f"{record.name} {kind}", []).append(f"{axis} {amount(largest)}")
            moved = any(axis in text for key in said for text in said[key] if not key.endswith("steps"))
            code = float(np.min(np.diff(np.unique(record.column(axis)))))
            if not moved and (step := _step(y, starts, usual * own)) and abs(step[0]) > code:
                size = range_text([step[0]], record.unit)
                text = f"{axis} by {size} at {t[step[1]] - 0.5 * BLOCK_SECONDS:.0f} s"
                said.setdefault(f"{record.name} steps", []).append(text)
    behind = f" over the log{behind or ', which has no temperature'}"
    causes = {
        key: f"{key.rpartition(' ')[2]}: {', '.join(parts)}{'' if key.endswith('steps') else behind}"
        for key, parts in said.items()
    }
    return units, quantities, causes


def _means(column: FloatArray, record: Record) -> tuple[FloatArray, list[int]]:
    """Return the means of the blocks of a column, shape (m,), and the first block of each segment."""
    size = max(round(BLOCK_SECONDS / record.interval), 1)
    means = [column[a : b - (b - a) % size].reshape(-1, size).mean(axis=1) for a, b in record.segments]
    return np.concatenate(means), np.cumsum([0, *map(len, means[:-1])]).tolist()


def _weights(x: FloatArray) -> FloatArray:
    """Return the weights, shape (m,), by which samples at x make the slope of a line."""
    x = x - x.mean()
    return x / float(x @ x)


def _slope(x: FloatArray, y: FloatArray, noise: NoiseModel, unit: str) -> Coefficient:
    """Return the slope of a line through the means of an axis, with the interval of its noise."""
    weights = _weights(x)
    slope, half = float(weights @ y), QUANTILE * _passed(weights, len(x), noise)
    return Coefficient.known(slope, slope - half, slope + half, unit)


def _passed(weights: FloatArray, count: int, noise: NoiseModel) -> float:
    """Return the sd of a sum of the means of a log of `count` blocks, with weights whose sum is zero."""
    passed = np.abs(np.fft.rfft(weights, PADDING_FACTOR * count))[1:] ** 2
    f = np.fft.rfftfreq(PADDING_FACTOR * count, BLOCK_SECONDS)[1:]
    return math.sqrt(2.0 * f[0] * float(noise.psd(f, interval=BLOCK_SECONDS) @ passed))


def _beside(t: FloatArray, warmth: FloatArray, change: float) -> str:
    """Say what the temperature does over a log."""
    if np.ptp(warmth) < MIN_TEMPERATURE_RANGE:
        return f", while the temperature stays within {digits(float(np.ptp(warmth)), 2)} K"
    text = f" while the temperature {'rises' if change > 0.0 else 'falls'} by {digits(abs(change))} K"
    alike = np.corrcoef(t, warmth)[0, 1] ** 2 >= COLLINEAR_SHARE
    return f"{text}: collinear with time, so that either may be the cause" if alike else text


STEP_WEIGHTS = np.repeat([1.0, -1.0], WINDOW_BLOCKS) / WINDOW_BLOCKS
"""Weights by which neighbouring means are compared."""


def _step(y: FloatArray, starts: Sequence[int], usual: float) -> tuple[float, int] | None:
    """Return size and place of the clearest step of means, shape (m,), if it is one.

    Segments are not compared; `usual` is the sd that differences have by the noise of the sensor.
    """
    place = np.arange(WINDOW_BLOCKS, len(y) - WINDOW_BLOCKS + 1)
    inside = [not any(at - WINDOW_BLOCKS < start < at + WINDOW_BLOCKS for start in starts) for at in place]
    if sum(inside) < LEAST_BLOCKS - 2 * WINDOW_BLOCKS:
        return None
    place, change = place[inside], np.convolve(y, STEP_WEIGHTS, "valid")[inside]
    change = change - np.median(change)
    first = int(np.argmax(np.abs(change)))
    sure = abs(change[first]) > usual * norm.isf(0.5 * STEP_CHANCE * WINDOW_BLOCKS / len(place))
    return (float(change[first]), int(place[first])) if sure else None
