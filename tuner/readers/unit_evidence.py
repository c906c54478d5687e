"""What the samples of a sensor at rest say about their unit, whatever the file calls it.

An accelerometer triad at rest reads 9.81 m/s² whatever its attitude. A gyroscope at rest reads its bias and the
Earth's rate, and noise: both lie in the range that sensors are made in. Counts are whole numbers, and rates made from
counts are multiples of a step that belongs to one unit: 1/131 deg/s is 250 deg/s over 2¹⁵ counts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.robust import normal_sd
from models.units import DEG, STANDARD_GRAVITY, unit_value
from tuner.limits import WRONG_FACTOR
from tuner.readers.column_names import INCREMENT_UNITS, UNITS
from tuner.types.records import Record

GRAVITY_TOLERANCE = 0.1
"""Relative distance of the mean specific force from gravity: consumer accelerometers are within 60 mg and 3 %."""
TIMES_GRAVITY = {
    2.0: "where a range register is set to half",
    4.0: "where a range register is set to a quarter",
    0.5: "where a range register is set to twice",
    0.25: "where a range register is set to four times",
    STANDARD_GRAVITY: "m/s^2 read as g",
    1.0 / STANDARD_GRAVITY: "g read as m/s^2",
}
"""What makes accelerometers at rest read so many times gravity."""
MAX_BIAS = 0.35
"""Bias of a gyroscope, rad/s: 20 deg/s, the zero-rate tolerance of the cheapest data sheets."""
MAX_STEADY_RATE = 5.0
"""rad/s: nothing that is navigated turns as fast all the time; rate tables are slower."""
MAX_WHITE = 2e-3
"""White density of a gyroscope, rad/s/√Hz: three times that of the noisiest built-in sensor (ADIS16405)."""
OPEN_BANDWIDTH = 100.0
"""Bandwidth of a gyroscope without a filter, Hz: its noise is folded into samples that are taken more rarely."""
MIN_WHITE = 4e-8
"""White density of a gyroscope, rad/s/√Hz: a tenth of that of the built-in ring laser gyro."""
USUAL_RATES = ("deg/s", "rad/s", "deg/h", "rad", "deg")
"""Units that gyroscopes are written in without saying so, most frequent first."""
FULL_SCALES = (125.0, 245.0, 250.0, 300.0, 350.0, 400.0, 450.0, 500.0, 1000.0, 2000.0, 4000.0)
"""Ranges of gyroscopes with 16-bit counts, deg/s."""
DATASHEET_STEPS = (
    0.00381, 0.004375, 0.00625, 0.00875, 0.0175, 0.02, 0.025, 0.035, 0.04, 0.05, 0.06, 0.07, 0.07326, 0.14,
    1 / 131, 1 / 65.5, 1 / 32.8, 1 / 16.4, 1 / 262.4, 1 / 14.375,
)  # fmt: skip
"""Steps of gyroscopes as their data sheets state them, deg/s in one count."""
STEP_TOLERANCE = 1e-3
"""Relative error of a step that was found: steps of the lists are further apart from one another in either unit."""
DECIMAL_TOLERANCE = 1e-6
"""Relative distance of a step from a power of ten that comes from the digits of a text, not from the sensor."""
MAX_SUMMED = 0.5
"""`Sizes.summed` of sums: they have about 1 or more (χ² of some 8 degrees of freedom an axis), noise below a low-pass
filter of n samples n²/8 over the record."""
SURELY_SUMMED = 10.0
"""`Sizes.summed` that only sums of a bias have, hundreds and more: a drift of 1 deg/s in an hour has less than 1."""
MAX_AXIS_RATIO = 5.0
"""Noise of the noisiest axis of a sensor at rest ÷ that of its quietest: data sheets state up to 2, and axes that come
from two makes differ by 3."""
LARGEST_CHANGE = {"rad/s": 5e-3, "m/s^2": 0.1}
"""Largest usual change of the mean from one second to the next of a sensor at rest, by unit: twice that of the noisiest
gyroscopes sold (0.1 deg/s/√Hz) and seven times that of the noisiest accelerometers (1 mg/√Hz)."""
MIN_BLOCK_SAMPLES = 32
"""Fewest samples of such a second, where the rate is low."""
CHECKED_SAMPLES = 20_000
"""Samples from which sizes are taken: medians are then known to 1 %."""
STEP_SAMPLES = 4096
"""Samples from which the step of a quantizer is found: it is the same in all of them."""
MAX_LEVELS = 2048
"""Different values among them up to which a common step is looked for."""


@dataclass(frozen=True)
class Sizes:
    """How large the readings of a sensor are, in the unit they were read in.

    Attributes
    ----------
    norm : float
        Median norm of the samples.
    mean : float
        Norm of the median of each axis.
    noise : float
        Norm of the robust sd of each axis, from differences of neighbours.
    white : float
        White density of the noisiest axis, unit/√Hz: an upper bound where the noise is not white.
    summed : float
        Variance of samples an eighth of the record apart ÷ that of neighbours ÷ the number of steps between them,
        median of the axes: about 1 or more where samples are sums, next to 0 where they are noise.
    change : float
        Usual change of the mean from one second to the next, of the axis that changes most.
    """

    norm: float
    mean: float
    noise: float
    white: float
    summed: float
    change: float


def why_times_gravity(ratio: float) -> str:
    """Return what makes accelerometers at rest read so many times gravity, ``, as …``; "" where nothing is known."""
    near = (text for one, text in TIMES_GRAVITY.items() if abs(ratio / one - 1.0) < GRAVITY_TOLERANCE)
    return next((f", as {text}" for text in near), "")


def sizes_of(record: Record) -> Sizes:
    """Return the sizes of a record of one to three axes."""
    stride = max(1, len(record) // CHECKED_SAMPLES)
    y = record.y[::stride]
    step = _differences(record)
    robust = normal_sd(step, axis=0) / math.sqrt(2.0)
    quantized = np.where(robust > 0.0, robust, step.std(axis=0) / math.sqrt(2.0))
    norm = np.sqrt(np.einsum("ij,ij->i", y, y))
    return Sizes(
        float(np.median(norm)),
        float(np.linalg.norm(np.median(y, axis=0))),
        float(np.linalg.norm(robust)),
        float(quantized.max()) * math.sqrt(record.interval),
        float(np.median([_summed(y) for y in record.y.T])),
        _change(record),
    )


def _differences(record: Record) -> FloatArray:
    """Return differences of neighbours, of as many samples as sizes are taken from."""
    stride = max(1, len(record) // CHECKED_SAMPLES)
    return np.asarray(record.y[1::stride] - record.y[:-1:stride])


def axis_noise(record: Record) -> FloatArray:
    """Return the noise of each axis, from differences of neighbours; no less than that of the step of its samples."""
    noise = normal_sd(_differences(record), axis=0) / math.sqrt(2.0)
    steps = np.array([step_of(y, 1.0) for y in record.y.T]) / math.sqrt(12.0)
    return np.asarray(np.hypot(noise, steps))


def axes_exchanged(gyro: Record, accel: Record) -> str:
    """Return the letters of one or two axes that the triads have exchanged, "" for none.

    Exchanged, both triads have axes of one noise; as they stand, neither has: in one the axes are too quiet, in the
    other too noisy, which vibration cannot do.
    """
    noise = np.array([axis_noise(gyro), axis_noise(accel)])
    if _axis_ratios(noise).min() <= MAX_AXIS_RATIO:
        return ""
    for axes in ([0], [1], [2], [0, 1], [0, 2], [1, 2]):
        other = noise.copy()
        other[:, axes] = noise[::-1, axes]
        if _axis_ratios(other).max() <= MAX_AXIS_RATIO and other[0].max() < other[1].min():
            return "".join("xyz"[axis] for axis in axes)
    return ""


def _axis_ratios(noise: FloatArray) -> FloatArray:
    smallest = noise.min(axis=1)
    return np.where(smallest > 0.0, noise.max(axis=1) / np.maximum(smallest, 1e-300), 1.0)


def one_sensor(record: Record) -> bool:
    """Return whether the axes of a triad at rest can be of one sensor."""
    return float(_axis_ratios(axis_noise(record)[None, :])[0]) <= MAX_AXIS_RATIO


def _change(record: Record) -> float:
    length = max(MIN_BLOCK_SAMPLES, round(1.0 / record.interval))
    blocks = record.y[: len(record) // length * length].reshape(-1, length, record.y.shape[1]).mean(axis=1)
    return float(normal_sd(np.diff(blocks, axis=0), axis=0).max()) if len(blocks) > 2 else 0.0


def _summed(y: FloatArray) -> float:
    lag = len(y) // 8
    near = float(np.mean(np.diff(y) ** 2))
    return float(np.mean((y[lag:] - y[: len(y) - lag]) ** 2)) / near / lag if lag and near > 0.0 else 0.0


def si_value(unit: str, interval: float) -> float:
    """Return the SI value of one unit; of an increment, as a rate over the interval."""
    return unit_value(unit) / (interval if unit in INCREMENT_UNITS else 1.0)


def same_kind(one: str, other: str) -> bool:
    """Return whether two units are both of rates, or both of increments."""
    return (one in INCREMENT_UNITS) == (other in INCREMENT_UNITS)


def units_with_gravity(raw: float, interval: float) -> list[str]:
    """Return the units in which a raw mean specific force is gravity, best first; increments last.

    Where none is within `GRAVITY_TOLERANCE`, the rates within `WRONG_FACTOR`: consumer units without a calibration err
    by a tenth, and their noise is right all the same; sensors that give increments are calibrated.
    """
    ratios = {unit: raw * si_value(unit, interval) / STANDARD_GRAVITY for unit in UNITS["accel"]}
    near = {unit: abs(ratio - 1.0) for unit, ratio in ratios.items() if abs(ratio - 1.0) < GRAVITY_TOLERANCE}
    far = {
        unit: abs(ratio - 1.0)
        for unit, ratio in ratios.items()
        if 1.0 / WRONG_FACTOR < ratio < WRONG_FACTOR and unit not in INCREMENT_UNITS
    }
    fitting = near or far
    return sorted(fitting, key=lambda unit: (unit in INCREMENT_UNITS, fitting[unit], unit))


def possible_rate(unit: str, found: Sizes, interval: float, read_in: str, *, assumed: bool = True) -> bool:
    """Return whether a gyroscope at rest can have these sizes, had they been written in `unit`.

    For another unit than one that is assumed, samples rarer than `OPEN_BANDWIDTH` may hold noise of higher
    frequencies, too.
    """
    factor = si_value(unit, interval) / si_value(read_in, interval)
    alias = 1.0 if assumed and unit == read_in else max(1.0, math.sqrt(OPEN_BANDWIDTH * interval))
    return found.mean * factor <= MAX_BIAS and MIN_WHITE <= found.white * factor <= MAX_WHITE * alias


def rate_in_motion(found: Sizes, interval: float, read_in: str) -> bool:
    """Return whether a gyroscope that moves, but none at rest, can have these sizes, if written in deg/s."""
    factor = si_value("deg/s", interval) / si_value(read_in, interval)
    too_small = found.white * factor < MIN_WHITE
    moves = not too_small and not possible_rate("deg/s", found, interval, read_in)
    return moves and found.mean * factor <= MAX_STEADY_RATE


def whole_numbers(y: FloatArray, factor: float) -> bool:
    """Return whether all samples are whole multiples of a unit, and vary, as counts do."""
    some = np.round(y[:STEP_SAMPLES] / factor, 6)
    return bool(np.all(some == np.rint(some)) and np.ptp(some, axis=0).max() >= 1.0)


def step_of(y: FloatArray, factor: float) -> float:
    """Return the step, in units of `factor`, that samples of an axis are multiples of apart; 0 where none is seen."""
    levels = np.unique(y[:STEP_SAMPLES] / factor)
    if not 3 <= len(levels) <= MAX_LEVELS:
        return 0.0
    gaps = np.diff(levels)
    fuzz = 4.0 * float(np.abs(levels).max()) * float(np.finfo(np.float32).eps)
    gaps = gaps[gaps > fuzz]
    if len(gaps) < 2:
        return 0.0
    step = float(gaps.min())
    for _ in range(3):
        step = float(gaps.sum() / np.rint(gaps / step).sum())
    off = np.abs(gaps - step * np.rint(gaps / step))
    return step if float(off.max()) <= max(0.02 * step, 2.0 * fuzz) and step > 4.0 * fuzz else 0.0


def unit_of_step(step: float) -> str | None:
    """Return ``deg/s`` or ``rad/s`` where a step, in that unit, is that of a known sensor; None where it tells none."""
    if step <= 0.0:
        return None
    power = 10.0 ** round(math.log10(step))
    if any(abs(step / (m * power) - 1.0) < DECIMAL_TOLERANCE for m in (0.1, 1.0, 10.0)):
        return None
    known = (*DATASHEET_STEPS, *(scale / 2**15 for scale in FULL_SCALES))

    def fits(size: float) -> bool:
        return any(abs(size / one - 1.0) < STEP_TOLERANCE for one in known)

    degrees, radians = fits(step), fits(step / DEG)
    return None if degrees == radians else "deg/s" if degrees else "rad/s"
