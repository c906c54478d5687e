"""Logs of known truth as people spoil them (units, sizes, triads, clocks, headers), and the advice of a refusal.

An owner follows a line to the letter: what stands behind ``pass``, one reading behind each ``or``. A placeholder
(``HZ``, ``X``, ``UNIT``) is filled with the truth, which the owner knows.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np
from fuzz.truths import ACCEL_UNITS, GRADES, GYRO_UNITS, INCREMENTS

from tuner.cli.commands import tune
from tuner.readers import parse_columns, read
from tuner.types.records import DataError

COUNT = 3000
FACTOR = 1.4
"""White noise within this is right: the limit from which a number misleads."""
EARTH = 7.292115e-5 * np.array([0.66, 0.0, -0.75])
OPTION = re.compile(
    r"--(?:gyro|accel)-(?:unit|scale) [^\s,;)]+|--(?:rate|assume) [^\s,;)]+|--columns (?:'[^']*'|[^\s;']*[^\s;,:.)'])"
)
SAMPLES = (
    "unit",
    "no unit",
    "half",
    "half rates",
    "double",
    "swapped",
    "swapped unstated",
    "increments",
    "sums",
    "counts",
)
CLOCKS = ("fine", "wrong unit", "no unit", "counter", "no stamps")
FORMS = ("plain", "alpha", "YAML", "one name less", "two topics", "semicolons", "seven columns")
ODD_GYRO = {k: v for k, v in GYRO_UNITS.items() if k not in INCREMENTS | {"counts"}}
ODD_ACCEL = {k: v for k, v in ACCEL_UNITS.items() if k not in INCREMENTS | {"counts"}}
CLOCK_UNITS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}


@dataclass(frozen=True)
class Spoilt:
    """A log at rest and what is wrong with it: its samples, its clock, its form; sensor, rate and seed."""

    samples: str
    clock: str
    form: str
    grade: str
    rate: float
    seed: int

    @property
    def name(self) -> str:
        """Words for messages."""
        return ", ".join(str(v) for v in self.__dict__.values())


@dataclass(frozen=True)
class Written:
    """What was written: the file, what one number of each sensor is in SI, and the unit of the stamps."""

    path: Path
    si: Mapping[str, float]
    clock: str | None


def spoilt(count: int, seed: int) -> Iterator[Spoilt]:
    """Yield logs, each kind of fault in turn, a fifth of them with another one beside it."""
    rng = np.random.default_rng(seed)
    kinds = [(s, "fine", "plain") for s in SAMPLES] * 3
    kinds += [("right", c, "plain") for c in CLOCKS[1:]] * 2 + [("right", "fine", f) for f in FORMS[1:]]
    for number in range(count):
        samples, clock, form = kinds[number % len(kinds)]
        if rng.random() < 0.2:
            clock = str(rng.choice(CLOCKS))
        grades = (
            ["phone", "industrial"] if samples == "counts" else list(GRADES)
        )  # counts that show the noise
        yield Spoilt(
            samples,
            clock,
            form,
            str(rng.choice(grades)),
            float(rng.choice([50.0, 100.0, 200.0, 400.0, 1000.0])), number,
        )  # fmt: skip


def truth(case: Spoilt) -> tuple[np.ndarray, np.ndarray]:
    """Return gyro and accel (n, 3) in SI."""
    rng = np.random.default_rng([case.seed, 7])
    white, bias, accel_white, accel_bias = GRADES[case.grade]
    sd = np.sqrt(case.rate)
    gyro = EARTH + bias * rng.standard_normal(3) + white * sd * rng.standard_normal((COUNT, 3))
    up = rng.normal(size=3) * [0.2, 0.2, 0.0] + [0.0, 0.0, 1.0]
    accel = 9.81 * up / np.linalg.norm(up) + accel_bias * rng.standard_normal(3)
    return gyro, accel + accel_white * sd * rng.standard_normal((COUNT, 3))


def write(case: Spoilt, folder: Path) -> Written:
    """Write a log."""
    rng = np.random.default_rng([case.seed, 8])
    gyro, accel = truth(case)
    named = {"gyro": "rad/s", "accel": "m/s^2"}
    sizes: dict[str, float] = {"gyro": 1.0, "accel": 1.0}
    kind = case.samples
    if kind in ("unit", "no unit"):
        held = {"gyro": str(rng.choice(list(ODD_GYRO))), "accel": str(rng.choice(list(ODD_ACCEL)))}
        if kind == "unit" and rng.random() < 0.5:
            right = str(rng.choice(["gyro", "accel"]))
            held[right] = named[right]
        sizes = {"gyro": GYRO_UNITS[held["gyro"]], "accel": ACCEL_UNITS[held["accel"]]}
        named = dict.fromkeys(named, "") if kind == "no unit" else named
    elif kind in ("half", "double"):
        sizes = dict.fromkeys(sizes, 2.0 if kind == "half" else 0.5)
    elif kind == "half rates":
        sizes["gyro"] = 2.0
    elif kind == "increments":
        degrees = rng.random() < 0.5
        sizes = {"gyro": case.rate * (np.pi / 180.0 if degrees else 1.0), "accel": case.rate}
        named["gyro"] = "deg/s" if degrees else "rad/s"
        named = dict.fromkeys(named, "") if rng.random() < 0.5 else named
    elif kind == "counts":
        scale = 1.0 / rng.choice([131.0, 262.4])
        sizes = {"gyro": np.radians(scale), "accel": 9.80665 / float(rng.choice([4096, 8192, 16384]))}
        named = dict.fromkeys(named, "") if rng.random() < 0.5 else named
    values = {"gyro": gyro / sizes["gyro"], "accel": accel / sizes["accel"]}
    if kind == "counts":
        values = {k: np.rint(v) for k, v in values.items()}
    if kind == "sums":
        sizes["gyro"] = float(rng.choice([1.0, np.pi / 180.0]))
        values["gyro"] = np.cumsum(gyro / sizes["gyro"], axis=0) / case.rate
        named["gyro"] = str(rng.choice(["deg", "deg/s", "rad/s"])) if rng.random() < 0.7 else ""
    if kind.startswith("swapped"):
        values = {"gyro": accel, "accel": gyro}
        named = dict.fromkeys(named, "") if kind != "swapped" else named
    rng = np.random.default_rng([case.seed, 9])  # of the clock, the same for other samples
    s = np.arange(COUNT) / case.rate
    unit = str(rng.choice(list(CLOCK_UNITS)))
    begin = float(rng.choice([0.0, 302400.0, 1.7e9]))
    stated = unit
    if case.clock == "wrong unit":
        stated = str(rng.choice([u for u in CLOCK_UNITS if u != unit]))
    t = [f"{CLOCK_UNITS[unit] * begin + CLOCK_UNITS[unit] * v:.6f}" if unit in ("s", "ms") else
         f"{int(CLOCK_UNITS[unit] * begin) + round(CLOCK_UNITS[unit] * v)}" for v in s]  # fmt: skip
    if case.clock == "counter":
        t, unit = [str(i) for i in range(COUNT)], ""
    brackets = "()" if rng.random() < 0.3 else "[]"

    def shown(name: str, unit: str) -> str:
        return f"{name} {brackets[0]}{unit}{brackets[1]}" if unit else name

    stem = {"gyro": "omega", "accel": "alpha"} if case.form == "alpha" else {"gyro": "gyro", "accel": "accel"}
    names = [shown("time", "" if case.clock in ("no unit", "counter") else stated)]
    names += [shown(f"{stem[k]}_{a}", named[k]) for k in ("gyro", "accel") for a in "xyz"]
    digits = [[f"{v:.9g}" for v in row] for row in np.hstack([values["gyro"], values["accel"]])]
    rows = [[stamp, *row] for stamp, row in zip(t, digits, strict=True)]
    if case.clock == "no stamps":
        names, rows = names[1:], [row[1:] for row in rows]
    path = folder / f"log{case.seed}.{'txt' if case.form in ('YAML', 'seven columns') else 'csv'}"
    path.write_text(_text(case.form, names, rows))
    return Written(path, sizes, None if case.clock in ("counter", "no stamps") else unit)


def _text(form: str, names: list[str], rows: list[list[str]]) -> str:
    separator = ";" if form == "semicolons" else " " if form == "seven columns" else ","
    if form == "YAML":
        keys = ("angular_velocity", "linear_acceleration")
        return "---\n".join(
            f"header: \n  seq: {i}\n  stamp: \n    secs: {1700000000 + i // 100}\n    nsecs: {i % 100 * 10000000}\n"
            + "".join(
                f"{k}: \n  x: {r[j]}\n  y: {r[j + 1]}\n  z: {r[j + 2]}\n"
                for k, j in zip(keys, (-6, -3), strict=True)
            )
            for i, r in enumerate(rows)
        )
    if form == "one name less":
        rows = [[*row, "0"] for row in rows]
    if form == "two topics":
        rows = [r for row in rows for r in ([*row[:-3], "", "", ""], [*row[:-6], "", "", "", *row[-3:]])]
    lines = [separator.join(row) for row in rows]
    return "\n".join(([] if form == "seven columns" else [separator.join(names)]) + lines) + "\n"


def readings(message: str) -> list[list[str]]:
    """Return the arguments of each reading that a line recommends, in its order."""
    found = [OPTION.findall(part) for part in re.split(r",? or (?=[^;]*--)|; (?=[^;]*--)", message)]
    return [shlex.split(" ".join(options)) for options in found if options]


def followed(arguments: list[str], written: Written, case: Spoilt) -> Mapping[str, Any]:
    """Return the arguments of `read` for those of the command line; a click exception where it has no such option."""
    base = {"gyro": "rad/s", "accel": "m/s^2"}
    filled: list[str] = []
    for word in arguments:
        option = filled[-1] if filled else ""
        sensor = option[2:].partition("-")[0]
        if word == "UNIT":
            filled += [base[sensor], f"--{sensor}-scale", repr(float(written.si[sensor]))]
        elif word == "X":
            unit = (
                base[sensor]
                if f"--{sensor}-unit" not in filled
                else filled[filled.index(f"--{sensor}-unit") + 1]
            )
            filled.append(repr(float(written.si[sensor]) / {**GYRO_UNITS, **ACCEL_UNITS}[unit]))
        else:
            filled.append({"HZ": str(case.rate)}.get(word, word.replace("NAME", "time")))
    context = tune.command.make_context("tune", ["log", *filled])
    taken = ("rate", "gyro_unit", "accel_unit", "gyro_scale", "accel_scale", "assume")
    how = {k: context.params[k] for k in taken if context.params[k] is not None}
    columns = context.params["columns"]
    return how | ({"columns": parse_columns(columns)} if columns else {})


def is_right(case: Spoilt, path: Path, **options: Any) -> bool:
    """Return whether a log read with these options has the white noise of every sensor that is read."""
    wanted = dict(zip(("gyro", "accel"), truth(case), strict=True))
    records = read(path, **options)
    for record in records:
        steps = np.diff(record.y, axis=0)
        white = steps.std(axis=0) * np.sqrt(record.interval / 2.0)
        axes = ["xyz".index(axis[-1]) for axis in record.axes]
        true = np.diff(wanted[record.name][:, axes], axis=0).std(axis=0) / np.sqrt(2.0 * case.rate)
        if not np.all((white < FACTOR * true) & (true < FACTOR * white)):
            return False
    return True


def judge(case: Spoilt, folder: Path) -> tuple[str, str]:
    """Return how a log ended, and its line."""
    written = write(case, folder)
    try:
        return ("read right" if is_right(case, written.path) else "read wrong"), ""
    except DataError as error:
        said = str(error)
    ends = [_end(case, written, options) for options in readings(said)]
    if not ends:
        return "no advice", said
    alone = (replace(case, clock="fine"), replace(case, samples="right")) if case.clock != "fine" else ()
    if "right" not in ends and any(judge(one, folder)[0] == "read wrong" for one in alone if one != case):
        return "read wrong", said  # one of two faults shows in no refusal
    best = "right" if "right" in ends else "refused again" if set(ends) <= {"refused again"} else "wrong"
    return best, f"{' | '.join(ends)}: {said}"


def _end(case: Spoilt, written: Written, arguments: list[str], depth: int = 0) -> str:
    """Return how one reading ends that is followed, and what is advised then, to the third refusal."""
    try:
        options = followed(arguments, written, case)
    except click.ClickException as error:
        return f"no such option: {error.format_message()}"
    try:
        return "right" if is_right(case, written.path, **options) else "wrong"
    except DataError as error:
        if depth == 2:
            return "refused again"
        ends = [
            _end(case, written, [*arguments, *more], depth + 1)
            for more in readings(str(error))
            if not set(more) <= set(arguments)
        ]
        return "right" if "right" in ends else "refused again" if set(ends) <= {"refused again"} else "wrong"
