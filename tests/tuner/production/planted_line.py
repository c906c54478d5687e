"""A production line of simulated units with planted faults: what `fleet` is to name, and what it is to let pass."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from models.effects.static.temperature_profiles import Warming
from models.units import STANDARD_GRAVITY, to_si
from tuner.catalogue.grades import load_grade
from tuner.formats.logs import write_log
from tuner.simulation.static import simulate
from tuner.types.records import Record

SPREAD = 0.05
"""Sd of the logarithm of the noise of an axis from unit to unit."""


@dataclass(frozen=True)
class Line:
    """What a line makes: sensor, length of a log, s, its rate, Hz, and the sizes of the faults.

    Attributes
    ----------
    noise : float
        Noise of the noisy axis, a gyro's, ÷ that of a good one.
    drift, warmth : float
        Change of a gyro over the log, deg/h, and of the temperature meanwhile, K.
    step : float
        Size of the steps of a gyro, deg/h.
    axis : int
        Axis in which the faults of one axis are.
    """

    grade: str
    duration: float
    rate: float
    seed: int
    noise: float = 3.0
    drift: float = 270.0
    warmth: float = 15.0
    step: float = 150.0
    axis: int = 0


def _noise(line: Line, gyro: Record, accel: Record) -> tuple[Record, Record]:
    y = gyro.y.copy()
    mean = y[:, line.axis].mean()
    y[:, line.axis] = mean + line.noise * (y[:, line.axis] - mean)
    return replace(gyro, y=y), accel


def _scale(line: Line, gyro: Record, accel: Record) -> tuple[Record, Record]:
    return gyro, replace(accel, y=2.0 * accel.y)


def _in_g(line: Line, gyro: Record, accel: Record) -> tuple[Record, Record]:
    return gyro, replace(accel, y=accel.y / STANDARD_GRAVITY)


def _warming(line: Line, gyro: Record, accel: Record) -> tuple[Record, Record]:
    share, y = gyro.t / gyro.t[-1], gyro.y.copy()
    y[:, line.axis] += to_si(line.drift, "deg/h") * share
    warmer = {"temperature": gyro.covariates["temperature"] + line.warmth * share}
    return replace(gyro, y=y, covariates=warmer), replace(accel, covariates=warmer)


def _steps(line: Line, gyro: Record, accel: Record) -> tuple[Record, Record]:
    y = gyro.y.copy()
    high = (gyro.t > 0.3 * line.duration) & (gyro.t < 0.7 * line.duration)
    y[:, line.axis] += to_si(line.step, "deg/h") * high
    return replace(gyro, y=y), accel


def _dead(line: Line, gyro: Record, accel: Record) -> tuple[Record, Record]:
    y = gyro.y.copy()
    y[:, line.axis] = 0.0
    return replace(gyro, y=y), accel


def _swapped(line: Line, gyro: Record, accel: Record) -> tuple[Record, Record]:
    return replace(gyro, y=accel.y), replace(accel, y=gyro.y)


def _clock(line: Line, gyro: Record, accel: Record) -> tuple[Record, Record]:
    return replace(gyro, t=0.5 * gyro.t), replace(accel, t=0.5 * accel.t)


Fault = Callable[[Line, Record, Record], tuple[Record, Record]]
FAULTS: Mapping[str, Fault] = {
    "noise": _noise,
    "scale": _scale,
    "g": _in_g,
    "warming": _warming,
    "steps": _steps,
    "dead": _dead,
    "swapped": _swapped,
    "clock": _clock,
}
"""What goes wrong, by name."""


def write_unit(line: Line, number: int, path: Path, fault: str = "") -> None:
    """Write the log of one unit."""
    rng = np.random.default_rng((line.seed, number))
    warmth = Warming(25.0 + rng.normal(0.0, 2.0), rng.uniform(0.2, 1.5), line.duration)
    records, _ = simulate(
        load_grade(line.grade),
        duration=line.duration,
        rate=line.rate,
        seed=1000 * line.seed + number,
        temperature=warmth,
    )
    differing = []
    for record in records:
        mean = record.y.mean(axis=0)
        differing.append(
            replace(record, y=mean + (record.y - mean) * np.exp(SPREAD * rng.standard_normal(3)))
        )
    gyro, accel = differing
    write_log(FAULTS[fault](line, gyro, accel) if fault else (gyro, accel), path)


def write_line(line: Line, folder: Path, units: int, faults: Mapping[int, str]) -> None:
    """Write the logs of a whole line, `faults` by the number of the unit."""
    folder.mkdir(parents=True)
    for number in range(units):
        write_unit(line, number, folder / f"SN{number:02d}.csv", faults.get(number, ""))


SIXTY = {4 + 7 * k: fault for k, fault in enumerate(FAULTS)}
"""Eight faulty units among sixty."""
