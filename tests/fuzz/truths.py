"""Logs with a known answer in every unit, clock, type of number and file format, as people write them."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import scipy.io
from pyarrow import parquet

DEG, G = np.pi / 180.0, 9.80665
COUNT = 1200

GRADES: Mapping[str, tuple[float, float, float, float]] = {
    "phone": (2e-4, 5e-3, 3e-3, 0.05),
    "industrial": (4e-5, 8e-4, 1e-3, 0.02),
    "tactical": (2e-5, 5e-5, 4e-4, 0.01),
    "fibre": (1.5e-6, 5e-7, 1.5e-4, 1e-3),
}
"""White density and bias of the gyroscope (rad/s/√Hz, rad/s) and of the accelerometer (m/s²/√Hz, m/s²)."""
EARTH = 7.292115e-5 * np.array([0.66, 0.0, -0.75])
GYRO_UNITS: Mapping[str, float] = {
    "rad/s": 1.0,
    "deg/s": DEG,
    "deg/h": DEG / 3600.0,
    "mrad/s": 1e-3,
    "mdeg/s": 1e-3 * DEG,
    "counts": DEG / 131.0,
    "rad": 1.0,
    "deg": DEG,
}
"""SI value of one unit; of an increment, of its rate times the interval."""
ACCEL_UNITS: Mapping[str, float] = {
    "m/s^2": 1.0,
    "g": G,
    "mg": 1e-3 * G,
    "cm/s^2": 1e-2,
    "ft/s^2": 0.3048,
    "counts": G / 8192.0,
    "m/s": 1.0,
    "ft/s": 0.3048,
}
INCREMENTS = frozenset(("rad", "deg", "m/s", "ft/s"))
CLOCKS = (
    "s",
    "s since 1970",
    "ms",
    "ms since 1970",
    "us",
    "us since 1970",
    "ns",
    "ns since 1970",
    "min",
    "h",
    "ticks",
    "Excel",
    "MATLAB",
    "HHMMSSmmm",
    "HHMMSS.sss",
    "week",
    "32 bits",
    "0 first",
    "-1 first",
    "none",
)
CLOCK_UNITS = {"s": "s", "ms": "ms", "us": "us", "ns": "ns", "min": "min", "h": "h"}
NUMBERS = ("double", "single", "text of 6 digits")
FORMATS = (".csv", ".txt", ".npz", ".mat", ".h5", ".parquet")
STATED = ("units", "nothing", "clock")


@dataclass(frozen=True)
class Truth:
    """How a log is written: units, clock, numbers, format, what its names state, and the sensor and its rate."""

    gyro: str
    accel: str | None
    clock: str
    numbers: str
    suffix: str
    stated: str
    grade: str
    rate: float
    seed: int

    @property
    def name(self) -> str:
        """Words for messages."""
        return ", ".join(str(v) for v in self.__dict__.values())


@cache
def samples(grade: str, rate: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return gyro (n, 3), rad/s, and accel (n, 3), m/s², of a sensor at rest."""
    rng = np.random.default_rng([seed, round(rate)])
    white, bias, accel_white, accel_bias = GRADES[grade]
    gyro = EARTH + bias * rng.standard_normal(3) + white * np.sqrt(rate) * rng.standard_normal((COUNT, 3))
    up = np.array([0.17, -0.1, 0.98])
    accel = 9.81 * up / np.linalg.norm(up) + accel_bias * rng.standard_normal(3)
    return gyro, accel + accel_white * np.sqrt(rate) * rng.standard_normal((COUNT, 3))


def stamps(clock: str, rate: float) -> np.ndarray | None:
    """Return the time column."""
    s = np.arange(COUNT) / rate
    day = 45297.5 + s
    digits = 1e7 * np.floor(day / 3600) + 1e5 * (np.floor(day / 60) % 60) + 1e3 * (day % 60)
    made: dict[str, Any] = {
        "s": s,
        "s since 1970": 1.7e9 + s,
        "ms": 1e3 * s,
        "ms since 1970": 1.7e12 + 1e3 * s,
        "us": np.rint(1e6 * s + 3e7),
        "us since 1970": np.rint(1.7e15 + 1e6 * s),
        "ns": np.rint(1e9 * s),
        "ns since 1970": np.rint(1e9 * s).astype(np.int64) + 1_700_000_000_000_000_000,
        "min": s / 60.0,
        "h": s / 3600.0,
        "ticks": np.rint(1e4 * s),
        "Excel": 45000.3 + s / 86400.0,
        "MATLAB": 739000.3 + s / 86400.0,
        "HHMMSSmmm": np.rint(digits),
        "HHMMSS.sss": np.rint(digits) / 1e3,
        "week": (604797.0 + s) % 604800.0,
        "32 bits": (np.rint(1e6 * s).astype(np.int64) + 2**32 - 2_000_000) % 2**32,
        "0 first": np.where(np.arange(COUNT) < 9, 0.0, 1.7e9 + s),
        "-1 first": np.where(np.arange(COUNT) < 9, -1.0, 1.7e9 + s),
        "none": None,
    }
    return made[clock]


def columns(truth: Truth) -> dict[str, np.ndarray]:
    """Return the columns of a log by name."""
    gyro, accel = samples(truth.grade, truth.rate, truth.seed)
    made: dict[str, np.ndarray] = {}
    t = stamps(truth.clock, truth.rate)
    if t is not None:
        unit = CLOCK_UNITS.get(truth.clock.split(" ")[0]) if truth.stated != "nothing" else None
        made["t" if unit is None else f"t [{unit}]"] = t
    for sensor, y, unit, units in (
        ("gyro", gyro, truth.gyro, GYRO_UNITS),
        ("accel", accel, truth.accel, ACCEL_UNITS),
    ):
        if unit is None:
            continue
        values = y / units[unit] / (truth.rate if unit in INCREMENTS else 1.0)
        if unit == "counts":
            values = np.rint(values)
        elif truth.numbers == "single":
            values = values.astype(np.float32)
        elif truth.numbers != "double":
            values = np.array([float(f"{v:.6g}") for v in values.ravel()]).reshape(values.shape)
        shown = f" [{unit}]" if truth.stated == "units" else ""
        made |= {f"{sensor}_{axis}{shown}": values[:, j] for j, axis in enumerate("xyz")}
    return made


def write(truth: Truth, folder: Path) -> Path:
    """Write a log and return its path."""
    made, path = columns(truth), folder / f"log{truth.suffix}"
    if truth.suffix in (".csv", ".txt"):
        separator = "," if truth.suffix == ".csv" else " "
        names = [name.replace(" ", "") for name in made] if separator == " " else list(made)
        rows = zip(*([str(v) for v in column] for column in made.values()), strict=True)
        path.write_text("\n".join([separator.join(names), *map(separator.join, rows)]) + "\n")
    elif truth.suffix == ".npz":
        np.savez(path, **made)  # type: ignore[arg-type]
    elif truth.suffix == ".mat":
        scipy.io.savemat(path, {_word(name): column for name, column in made.items()})
    elif truth.suffix == ".h5":
        with h5py.File(path, "w") as file:
            for name, column in made.items():
                plain, _, unit = name.partition(" ")
                file[plain] = column
                if unit:
                    file[plain].attrs["unit"] = unit.strip("[]")
    else:
        parquet.write_table(pa.table(made), path)
    return path


def _word(name: str) -> str:
    """Return a name of MATLAB, with the unit as its last word."""
    words = {
        "deg/s": "dps",
        "rad/s": "radps",
        "m/s^2": "mps2",
        "m/s": "mps",
        "mdeg/s": "mdps",
        "mrad/s": "mrads",
        "cm/s^2": "cm_s2",
        "ft/s^2": "ft_s2",
        "ft/s": "fps",
        "deg/h": "dph",
    }
    plain, _, unit = name.partition(" ")
    return f"{plain}_{words.get(unit.strip('[]'), unit.strip('[]'))}" if unit else plain


def truths(count: int, seed: int) -> Iterator[Truth]:
    """Yield logs: every pair of units and every clock in turn, the rest drawn at random."""
    rng = np.random.default_rng(seed)
    pairs = [
        (g, a)
        for g, a in itertools.product(GYRO_UNITS, [*ACCEL_UNITS, None])
        if a is None or (g in INCREMENTS) == (a in INCREMENTS)
    ]
    for number in range(count):
        gyro, accel = pairs[number % len(pairs)] if rng.random() < 0.7 else ("rad/s", "m/s^2")
        yield Truth(
            gyro,
            accel,
            str(rng.choice(CLOCKS)),
            str(rng.choice(NUMBERS)),
            str(rng.choice(FORMATS)),
            str(rng.choice(STATED)),
            str(rng.choice(list(GRADES))),
            float(rng.choice([50.0, 100.0, 200.0, 400.0, 1000.0])),
            int(rng.integers(5)),
        )
