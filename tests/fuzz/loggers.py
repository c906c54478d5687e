"""Logs of known truth as loggers and spreadsheets write them: their dates, ticks, names with units, containers."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
from fuzz.truths import ACCEL_UNITS, COUNT, GYRO_UNITS, Truth, samples

START = datetime.datetime(2024, 5, 1, 23, 59, 58)
"""Midnight, an hour, a minute and a week of GPS begin soon."""
TOW = 604798.0


def _date(form: str) -> Callable[[float], str]:
    def text(s: float) -> str:
        day = START + datetime.timedelta(microseconds=round(1e6 * s))
        return day.strftime(form).format(f"{day.microsecond // 1000:03d}")

    return text


CLOCKS: Mapping[str, tuple[str, Callable[[float], str]]] = {
    "German": ("Zeit", _date("%d.%m.%Y %H:%M:%S,{}")),
    "American": ("Time", _date("%m/%d/%Y %I:%M:%S.{} %p")),
    "MATLAB": ("time", _date("%d-%b-%Y %H:%M:%S.{}")),
    "ISO": ("timestamp", _date("%Y-%m-%dT%H:%M:%S.{}Z")),
    "minutes": ("Time", _date("%M:%S.{}")),
    "Excel": ("Time", lambda s: f"{45413.49994 + s / 86400.0:.11f}"),
    "PX4": ("TimeUS", lambda s: f"{7e7 + 1e6 * s:.0f}"),
    "clock crystal": ("ticks", lambda s: f"{32768.0 * s:.0f}"),
    "80 MHz": ("ticks", lambda s: f"{8e7 * s:.0f}"),
    "1 GHz": ("tick", lambda s: f"{1e9 * s:.0f}"),
    "32 bits": ("t_us", lambda s: f"{(round(1e6 * s) + 2**32 - 2_000_000) % 2**32}"),
    "31 bits": ("time", lambda s: f"{(round(1e6 * s) + 2**31 - 2_000_000) % 2**31}"),
    "16 bits": ("Time (ms)", lambda s: f"{(round(1e3 * s) + 2**16 - 2000) % 2**16}"),
    "week": ("week,sow", lambda s: f"{2312 + (TOW + s) // 604800.0:.0f},{(TOW + s) % 604800.0:.4f}"),
    "single": ("t [s]", lambda s: str(np.float32(s + 40000.0))),
    "hundredths": ("time_s", lambda s: f"{s:.2f}"),
    "ROS": ("stamp.secs,stamp.nsecs", lambda s: f"{1_714_000_000 + int(s)},{round(1e9 * (s % 1.0))}"),
}
GYRO = {
    "rad/s": "wibb_{} [rad/s]",
    "deg/s": "Gyro {} (°/s)",
    "deg/h": "AngularRate{}[deg/h]",
    "mdeg/s": "gyr_{}_mdps",
    "counts": "gyro_{}_raw",
}
ACCEL = {
    "m/s^2": "Acc {} (m/s²)",
    "g": "a{} (g)",
    "mg": "acc_{}_mg",
    "cm/s^2": "accel_{}_cms2",
    "counts": "accel_{}_raw",
}
CONTAINERS = ("plain", "decimal comma", "UTF-16", "quoted", "trailing", "units below", "comments", "state")


def logs(count: int, seed: int) -> Iterator[Truth]:
    """Yield logs, every clock in turn; `stated` is the container."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        yield Truth(
            str(rng.choice(list(GYRO))),
            None if rng.random() < 0.2 else str(rng.choice(list(ACCEL))),
            list(CLOCKS)[number % len(CLOCKS)],
            "text of 6 digits",
            ".csv",
            str(rng.choice(CONTAINERS)),
            str(rng.choice(["phone", "industrial"])),
            float(rng.choice([50.0, 100.0, 200.0, 400.0])),
            int(rng.integers(5)),
        )


def write_log(truth: Truth, folder: Path) -> Path:
    """Write a log and return its path."""
    header, clock = CLOCKS[truth.clock]
    separator = ";" if "," in clock(0.0) and truth.clock == "German" else ","
    if truth.stated in ("decimal comma", "UTF-16"):
        separator = ";" if truth.stated == "decimal comma" else "\t"
    decimal = "," if truth.stated == "decimal comma" else "."
    names = header.split(",")
    cells = [clock(i / truth.rate) for i in range(COUNT)]
    columns = (
        [list(c) for c in zip(*(c.split(",") for c in cells), strict=True)] if len(names) > 1 else [cells]
    )
    columns = [
        [c.replace(".", decimal) if c.replace(".", "").isdigit() else c for c in one] for one in columns
    ]
    y = samples(truth.grade, truth.rate, truth.seed)
    for values, unit, patterns, sizes in (
        (y[0], truth.gyro, GYRO, GYRO_UNITS),
        (y[1], truth.accel, ACCEL, ACCEL_UNITS),
    ):
        if unit is None:
            continue
        form = "{:.0f}" if unit in ("counts", "mdeg/s", "mg") else "{:.7g}"
        for j, axis in enumerate("xyz"):
            names.append(patterns[unit].format(axis if "_" in patterns[unit] else axis.upper()))
            columns.append([form.format(v).replace(".", decimal) for v in values[:, j] / sizes[unit]])
    lines = [list(row) for row in zip(*columns, strict=True)]
    above = [names]
    if truth.stated == "units below" and any("(" in n or "[" in n for n in names):
        split = [n.replace("[", "(").rstrip(")]").partition("(") for n in names]
        above = [[n[0].strip() for n in split], [n[2] for n in split]]
    if truth.stated == "quoted":
        lines = [[f'"{cell}"' for cell in row] for row in lines]
    if truth.stated in ("trailing", "state"):
        lines = [[*row, "OK" if truth.stated == "state" else ""] for row in lines]
        above = [[*row, "state" if truth.stated == "state" else ""] for row in above]
    text = "\r\n".join([*(separator.join(row) for row in (*above, *lines)), ""])
    path = folder / "log.csv"
    head = "# logger 1.2; serial 47\n" if truth.stated == "comments" else ""
    path.write_bytes((head + text).encode("utf-16" if truth.stated == "UTF-16" else "utf-8"))
    return path
