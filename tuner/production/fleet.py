"""Many logs of one kind of sensor, a row a unit: measured side by side, judged together.

The rows do not depend on where and in which order the logs were measured. What goes wrong with one log is the line of
its row.
"""

from __future__ import annotations

import glob
import inspect
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median
from types import MappingProxyType
from typing import Any

from tuner.formats.customary_units import digits
from tuner.identification.identify_source import identify_source
from tuner.identification.objective import expect_terms
from tuner.limits import SHOWN_CHANGE, WRONG_FACTOR
from tuner.production.limits import GRAVITY, all_limits, judge, read_limits
from tuner.production.outliers import LEAST_UNITS, units_apart
from tuner.production.quantities import SENSORS
from tuner.production.spread import spread
from tuner.production.unit import Outcome, Task, UnitOptions, attempt, store_measurement
from tuner.production.workers import outcomes
from tuner.readers import FORMATS, read
from tuner.readers.block_means import BASE_BYTES
from tuner.readers.log_format import file_of, log_folder
from tuner.readers.source_kind import source_name
from tuner.types.arguments import expect
from tuner.types.fleet import Fleet, FleetUnit, Limit, UnitMeasurement
from tuner.types.number_ranges import Count, Latitude
from tuner.types.one_line import printable
from tuner.types.public import public
from tuner.types.records import DataError

RESULTS = "fleet.json"
"""File by which a folder with results of an earlier run is known; it is not searched for logs."""
LOGS = "a folder with logs, a pattern such as logs/*.csv, the path of a log, or a list of these"
"""What a fleet is measured from."""
SHORT_SHARE = 0.5
"""Share of the usual length of the logs below which one ended early: one script makes logs of about one length."""
Advance = Callable[[int, int], None]
"""Called with (units done, units in total)."""


@public("fleet")
def fleet(
    logs: str | Path | Sequence[str | Path],
    *,
    limits: str | Path | Sequence[Limit] | None = None,
    datasheet: str | Path | None = None,
    jobs: Count = 1,
    scheduler: str | None = None,
    store: str | Path | None = None,
    reading: Mapping[str, Any] = MappingProxyType({}),
    terms: Sequence[str] | None = None,
    latitude: Latitude | None = None,
    progress: Advance | None = None,
) -> Fleet:
    """Measure many units of one sensor, judge each by limits, name the outlying ones, and say how far they differ.

    Parameters
    ----------
    logs : str, Path or sequence of them
        Folders, which are searched with their subfolders, patterns such as ``logs/*.csv``, and files.
    limits : str, Path or sequence of Limit, optional
        A YAML of format ``tuner-limits/1``, or what it states.
    datasheet : str or Path, optional
        A built-in grade or a sheet, from which limits follow that are not stated; see `tuner.production.limits`.
    jobs : int, optional
        Processes on this machine; 1 works in the calling process.
    scheduler : str, optional
        Address of a Dask scheduler whose workers see the same files; instead of `jobs`.
    store : str or Path, optional
        Folder in which each finished unit is kept; a later call measures only what is not there.
    reading : mapping, optional
        Arguments of `tuner.read` for every log; `memory` is that of all processes of this machine together, or of
        each worker of a cluster.
    terms, latitude
        As of `tuner.identify`.
    progress : callable, optional
        Called with (units done, units in total).

    Returns
    -------
    Fleet
        The same for any number of jobs, but for logs larger than the share of `memory` that each of them has.

    Raises
    ------
    DataError
        Where there are no logs, the limits are wrong, or the scheduler cannot be reached: one line. A log that cannot
        be used is a row with the reason.
    """
    files = find_logs(logs)
    given = read_limits(limits) if isinstance(limits, str | Path) else tuple(limits or ())
    known = all_limits(given, None if datasheet is None else identify_source(datasheet, arma=None))
    expect_terms(terms)
    folder = None if store is None else _store(Path(store))
    try:
        inspect.signature(read).bind(None, **reading)
    except TypeError as error:
        raise DataError(f"fleet: reading: expected arguments of tuner.read, but it {error}") from None
    stated = {name: dict(value) if isinstance(value, Mapping) else value for name, value in reading.items()}
    if scheduler is None:
        stated, jobs = shared_memory(stated, min(jobs, len(files)))
    options = UnitOptions(stated, None if terms is None else tuple(terms), latitude)
    tasks = [Task(file, options, folder) for file in files]
    found: dict[int, Outcome] = {}
    if progress is not None:
        progress(0, len(tasks))
    for index, outcome in outcomes(attempt, tasks, jobs=jobs, scheduler=scheduler):
        found[index] = outcome
        if folder is not None and outcome.measurement is not None and not outcome.stored:
            store_measurement(folder, outcome.key, outcome.measurement)
        if progress is not None:
            progress(len(found), len(tasks))
    new = sum(one.measurement is not None and not one.stored for one in found.values())
    rows = [
        FleetUnit(
            name,
            printable(file),
            found[index].measurement,
            found[index].error,
            "" if found[index].error is None else "FAIL" if found[index].contradicted else "ERROR",
        )
        for index, (name, file) in enumerate(zip(unit_names(files), files, strict=True))
    ]
    first: dict[str, FleetUnit] = {}
    for index, row in enumerate(rows):
        if row.measurement is not None and (one := first.setdefault(row.measurement.digest, row)) is not row:
            copy = f"a copy of the log of {one.name}, byte for byte: it is counted once"
            rows[index] = FleetUnit(row.name, row.file, None, copy, "ERROR")
    return replace(judged(fleet_name(logs), rows, known), measured=new)


def _store(folder: Path) -> str:
    """Return the whole path of the store; refuse a name that no folder can have."""
    if taken := [one for one in (folder, *folder.parents) if one.exists() and not one.is_dir()]:
        raise DataError(f"fleet: store: expected a folder, found the file {taken[0]}")
    return str(folder.resolve())


def shared_memory(reading: Mapping[str, Any], jobs: int) -> tuple[dict[str, Any], int]:
    """Return the arguments of `tuner.read` for each of several processes that share its `memory`, and how many fit."""
    memory = reading.get("memory")
    if memory is None:
        return dict(reading), jobs
    jobs = max(min(jobs, int(memory // BASE_BYTES)), 1)
    return {**reading, "memory": memory / jobs}, jobs


def judged(name: str, rows: Sequence[FleetUnit], limits: tuple[Limit, ...]) -> Fleet:
    """Return the fleet with the verdict of every unit, those that stand apart, and the spread of the others."""
    measured = {i: row.measurement for i, row in enumerate(rows) if row.measurement is not None}
    apart, cut, clocks = units_apart(measured), cut_off(measured), other_clocks(measured)
    against = Counter(text for one in measured.values() for text in one.contradicted)
    stated = tuple(limit for limit in limits if not limit.basis)
    sensors = Counter(sensor for one in measured.values() for sensor in _sensors(one))
    units = list(rows)
    for index, one in measured.items():
        ratio, clock = clocks.get(index, (1.0, ""))
        own = [text for text in one.contradicted if against[text] == 1 or 2 * against[text] <= len(measured)]
        lacks = [
            name for name, units in sensors.items() if 2 * units > len(measured) and name not in _sensors(one)
        ]
        broken, unclear = (*own, *judge(one, limits)[0]), judge(one, stated)[1]
        unclear = unclear or tuple(f"{name} is not in this log" for name in lacks)
        verdicts = {
            "FAIL": bool(broken) or ratio > WRONG_FACTOR,
            "LOOK": index in apart.outliers or clock or not all(_limited(key, limits) for key in one.causes),
            "OPEN": unclear or index in cut or one.unit_unstated,
            "PASS": any(limit != GRAVITY for limit in limits),
        }
        advice = (clock, *apart.advice.get(index, ()), *one.causes.values(), *cut.get(index, ()))
        units[index] = replace(
            rows[index],
            verdict=next((verdict for verdict, holds in verdicts.items() if holds), ""),
            broken=(*broken, *unclear),
            outliers=apart.outliers.get(index, ()),
            advice=tuple(dict.fromkeys(filter(None, advice))),
        )
    channel_units = {axis: unit for one in measured.values() for axis, unit in one.units.items()}
    return Fleet(
        name,
        tuple(units),
        limits,
        MappingProxyType(spread([one for i, one in measured.items() if i not in apart.outliers])),
        MappingProxyType(channel_units),
        apart.comparisons,
    )


def _sensors(measured: UnitMeasurement) -> set[str]:
    """Return what a log holds: gyroscopes, accelerometers, temperature."""
    return {SENSORS[unit] for unit in measured.units.values() if unit in SENSORS}


LIMITED_BY: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"warming": ("ramp", "temperature_slope"), "drift": ("ramp",)}
)
"""Symbols of the limits that judge what is named, so that nobody need see it where they are kept."""


def _limited(key: str, limits: Sequence[Limit]) -> bool:
    """Return whether a limit judges what is named of a sensor."""
    sensor, _, kind = key.rpartition(" ")
    return any(one.sensor == sensor and one.symbol in LIMITED_BY.get(kind, ()) for one in limits)


def other_clocks(measured: Mapping[int, UnitMeasurement]) -> dict[int, tuple[float, str]]:
    """Return, by the index of the unit, by which factor its rate is another than that of most others, and in words."""
    usual = median(one.rate for one in measured.values()) if measured else 1.0
    ratios = {index: one.rate / usual for index, one in measured.items()}
    other = {index: ratio for index, ratio in ratios.items() if abs(ratio - 1.0) > SHOWN_CHANGE}
    if len(measured) < LEAST_UNITS or LEAST_UNITS * len(other) > len(measured):
        return {}
    return {
        index: (
            max(ratio, 1.0 / ratio),
            f"clock: {digits(measured[index].rate)} Hz by its stamps, the others have {digits(usual)} Hz: its clock or "
            f"its rate register is off × {digits(ratio)}",
        )
        for index, ratio in other.items()
    }


def cut_off(measured: Mapping[int, UnitMeasurement]) -> dict[int, tuple[str, ...]]:
    """Return, by the index of the unit, the logs that ended early, in words: such a log passes limits by chance."""
    if len(measured) < LEAST_UNITS:
        return {}
    usual = median(one.span for one in measured.values())
    return {
        index: (
            f"its log ends after {one.span:.3g} s, half of the logs last {usual:.3g} s or more: record it again",
        )
        for index, one in measured.items()
        if one.span < SHORT_SHARE * usual
    }


def find_logs(logs: str | Path | Sequence[str | Path]) -> list[str]:
    """Return the files (or folders that are one log) of folders, patterns and files, in the order of their names.

    Raises
    ------
    DataError
        For a name that leads to no log.
    """
    suffixes = tuple(suffix for one in FORMATS.values() for suffix in one.suffixes)
    files: list[str] = []
    expect(logs, (str, Path, list, tuple), "fleet", LOGS)
    for given in [logs] if isinstance(logs, str | Path) else logs:
        expect(given, (str, Path), "fleet", LOGS)
        path = Path(given)
        if path.is_dir():
            found = _logs_in(path, suffixes)
        elif path.exists():
            found = [str(path)]
        else:
            found = sorted(glob.glob(str(given), recursive=True))  # noqa: PTH207 - absolute patterns, too
        if not found:
            what = f"a log, a folder with logs ({' '.join(suffixes)}) or a pattern that fits some"
            raise DataError(f"{given}: expected {what}, found none")
        files += found
    if not files:
        raise DataError(f"fleet: expected {LOGS}, found an empty list")
    return list(dict.fromkeys(files))


def _logs_in(folder: Path, suffixes: tuple[str, ...]) -> list[str]:
    if log_folder(folder) is not None or file_of(folder) != folder:
        return [str(folder)]
    found: list[str] = []
    if (folder / RESULTS).is_file():
        return found
    for path in sorted(folder.iterdir()):
        if path.name.startswith("."):
            continue
        if path.is_dir():
            found += _logs_in(path, suffixes)
        elif path.name.lower().endswith(suffixes):
            found.append(str(path))
    return found


def unit_names(files: Sequence[str]) -> list[str]:
    """Return a name for each unit: that of its file, with as many folders before it as tell it from the others."""
    names = [source_name(file) for file in files]
    depth = 1
    while depth < max((len(Path(file).parts) for file in files), default=1):
        counts = Counter(names)
        if all(count == 1 for count in counts.values()):
            break
        names = [
            "/".join([*Path(file).parts[-1 - depth : -1], source_name(file)]) if counts[name] > 1 else name
            for name, file in zip(names, files, strict=True)
        ]
        depth += 1
    counts = Counter(names)
    return [printable(name if counts[name] == 1 else file) for name, file in zip(names, files, strict=True)]


def output_folder(logs: Sequence[str | Path], chosen: Path | None) -> Path:
    """Return the folder of the results, by default ``tuner-fleet/NAME``.

    Raises
    ------
    DataError
        Where it holds the logs themselves.
    """
    folder = Path("tuner-fleet") / fleet_name(logs) if chosen is None else chosen
    taken = {Path(given).resolve() for given in logs} | {Path(given).resolve().parent for given in logs}
    if folder.resolve() in taken:
        raise DataError(
            f"{folder}: expected an output folder other than that of the logs; choose one with -o"
        )
    return folder


def fleet_name(logs: str | Path | Sequence[str | Path]) -> str:
    """Return the name of a fleet: that of its folder."""
    first = Path(str(logs if isinstance(logs, str | Path) else logs[0]).partition("*")[0])
    folder = first if first.is_dir() else first.parent
    return source_name(folder.resolve()) or "fleet"
