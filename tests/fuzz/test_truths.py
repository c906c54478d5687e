"""Nothing wrong gets in silently: a log of known truth is read right, wrong with a word, or refused with its cure."""

from __future__ import annotations

import os
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from fuzz.loggers import CLOCKS, logs, write_log
from fuzz.truths import ACCEL_UNITS, CLOCK_UNITS, GYRO_UNITS, Truth, samples, truths, write

from tuner.readers import read
from tuner.types.records import DataError, Record

QUICK = 48
SLOW = int(os.environ.get("TUNER_TRUTHS", "8000"))
TOLERANCE = 0.02
"""Relative error of mean and sd from which numbers are wrong: units differ by more than that."""


def is_right(records: tuple[Record, ...], truth: Truth) -> bool:
    """Return whether rate, mean and sd of every sensor are those of the truth."""
    gyro, accel = samples(truth.grade, truth.rate, truth.seed)
    wanted = {"gyro": gyro} | ({"accel": accel} if truth.accel else {})
    if {r.name for r in records} != set(wanted):
        return False
    for record in records:
        y, step = wanted[record.name], {"gyro": GYRO_UNITS, "accel": ACCEL_UNITS}[record.name]
        unit = truth.gyro if record.name == "gyro" else str(truth.accel)
        fuzz = step[unit] if unit == "counts" else 0.0
        if truth.numbers != "double":
            fuzz = max(fuzz, 1e-5 * float(np.abs(y).max()))
        if (
            abs(record.rate / truth.rate - 1.0) > 1e-3
            or record.y.shape[1] > y.shape[1]
            or len(record) < 0.98 * len(y)
        ):
            return False
        for axis, column in zip(record.axes, record.y.T, strict=True):
            of = y[:, "xyz".index(axis[-1])]
            if abs(column.mean() - of.mean()) > TOLERANCE * abs(of.mean()) + fuzz + 0.2 * of.std():
                return False
            if abs(column.std() - of.std()) > 10.0 * TOLERANCE * of.std() + fuzz:
                return False
    return True


def cured(message: str, truth: Truth) -> dict[str, object]:
    """The options that a message names, with what the owner of the log knows."""
    options: dict[str, object] = {}
    if "--rate" in message:
        options["rate"] = truth.rate
    elif "--columns 't=" in message:
        options["columns"] = {"t": f"t [{({**CLOCK_UNITS, 'ticks': '0.1 ms'})[truth.clock.split(' ')[0]]}]"}
    for sensor, unit, sizes in (("gyro", truth.gyro, GYRO_UNITS), ("accel", truth.accel, ACCEL_UNITS)):
        counts = unit == "counts"
        if f"--{sensor}-scale" in message:
            options |= {
                f"{sensor}_unit": "rad/s" if sensor == "gyro" else "m/s^2",
                f"{sensor}_scale": sizes[str(unit)],
            }
        elif f"--{sensor}-unit" in message and not counts:
            options[f"{sensor}_unit"] = unit
    return options


def judge(truth: Truth, path: Path) -> tuple[str, str]:
    """Return how a log ended, and the message or the assumption."""
    options: dict[str, object] = {}
    said = ""
    for attempt in range(5):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                records = read(path, **options)  # type: ignore[arg-type]
        except DataError as error:
            said = str(error)
            more = cured(said, truth)
            if not more or more.items() <= options.items():
                return "refused without a cure", said
            options |= more
            continue
        right = is_right(records, truth)
        words = "; ".join(records[0].assumptions)
        if right:
            return ("right" if attempt == 0 else "refused, right with its cure"), said
        if attempt and not words:
            return "refused, wrong with its cure", f"{options}: {said}"
        return ("wrong with a word" if words else "wrong in silence"), words or "; ".join(records[0].notes)
    return "refused without a cure", said


def tally(
    count: int,
    seed: int,
    folder: Path,
    drawn: Callable[[int, int], Iterator[Truth]] = truths,
    written: Callable[[Truth, Path], Path] = write,
) -> tuple[Counter[str], list[str]]:
    """Judge many logs; return how they ended, and those that must not end so."""
    ends: Counter[str] = Counter()
    bad = []
    for truth in drawn(count, seed):
        end, said = judge(truth, written(truth, folder))
        ends[end] += 1
        if end in ("wrong in silence", "refused without a cure", "refused, wrong with its cure"):
            bad.append(f"{end}: {truth.name}: {said}")
    return ends, bad


def test_logs_of_known_truth(tmp_path: Path) -> None:
    ends, bad = tally(QUICK, 1, tmp_path)
    assert not bad, bad[:5]
    assert ends["wrong with a word"] < 0.1 * QUICK


def test_logs_as_loggers_and_spreadsheets_write_them(tmp_path: Path) -> None:
    ends, bad = tally(3 * len(CLOCKS), 2, tmp_path, logs, write_log)
    assert not bad, bad[:5]
    assert ends["right"] > len(CLOCKS)


@pytest.mark.slow
def test_many_logs_of_known_truth(tmp_path: Path) -> None:
    ends, bad = tally(SLOW, 16, tmp_path)
    print(dict(ends))  # noqa: T201
    assert not bad, bad[:20]
    ends, bad = tally(SLOW // 8, 17, tmp_path, logs, write_log)
    print(dict(ends))  # noqa: T201
    assert not bad, bad[:20]
