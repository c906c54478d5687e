"""One log of a fleet: its measurement, and the store from which a later run takes it up.

The store is a folder with one JSON a log, named by the SHA-256 of the content of the log, the options and the
version: whatever could change the numbers. A log that is refused leaves nothing there and is tried again.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tuner.formats.codec import dump, load
from tuner.formats.customary_units import digits, percent
from tuner.formats.documents import json_text, parse_json, read_text
from tuner.formats.files import write_text
from tuner.formats.guard import reason
from tuner.identification import identify
from tuner.jobs import limited
from tuner.limits import LOST_SHARE
from tuner.production.quantities import further_terms, quantities_of
from tuner.production.slow_changes import slow_changes
from tuner.readers import read
from tuner.readers.columns import digest
from tuner.readers.log_format import file_of
from tuner.readers.refusal import Contradiction
from tuner.segments.conditions import at_rest
from tuner.types.fleet import UnitMeasurement
from tuner.types.one_line import printable
from tuner.types.records import DataError, Record


@dataclass(frozen=True)
class UnitOptions:
    """How each log is read and identified: arguments of `tuner.read` and `tuner.identify`."""

    reading: Mapping[str, Any] = field(default_factory=dict)
    terms: tuple[str, ...] | None = None
    latitude: float | None = None


@dataclass(frozen=True)
class Task:
    """A log to be measured, how, and the store where its measurement may be."""

    file: str
    options: UnitOptions
    store: str | None = None


@dataclass(frozen=True)
class Outcome:
    """What became of a task: a measurement with its key, found in the store or new, or an error in one line.

    `contradicted` tells a log that its samples contradict from one that cannot be read.
    """

    key: str = ""
    measurement: UnitMeasurement | None = None
    stored: bool = False
    error: str | None = None
    contradicted: bool = False


def attempt(task: Task) -> Outcome:
    """Measure one log, or take its measurement from the store; whatever goes wrong is a line."""
    try:
        path = file_of(Path(task.file))
        key = unit_key(digest(path), task.options)
        known = stored_measurement(task.store, key)
        if known is not None:
            return Outcome(key, known, stored=True)
        with limited(1):  # other units have the other processors
            return Outcome(key, measure(path, task.options))
    except (DataError, OSError, ImportError) as error:
        return Outcome(error=printable(str(error)), contradicted=isinstance(error, Contradiction))
    except MemoryError:
        return Outcome(error=printable(f"{task.file}: not enough memory; split the log, or use fewer --jobs"))
    except Exception as error:  # one log never stops the rest
        line = f"{task.file}: a mistake of this program: {type(error).__name__}: {reason(error)}"
        return Outcome(error=printable(line))


def measure(path: Path, options: UnitOptions) -> UnitMeasurement:
    """Return what a log shows of its unit.

    Raises
    ------
    DataError
        Where the log cannot be used: one line.
    """
    log = read(path, **options.reading)
    records = at_rest(log)
    found = identify(records, terms=options.terms, arma=None, latitude=options.latitude)
    units, quantities = quantities_of(found)
    more_units, changes, causes = slow_changes(records, found)
    return UnitMeasurement(
        digest=records[0].digest,
        rate=max(record.rate for record in records),
        span=max(record.span for record in records),
        units=units | more_units,
        quantities=quantities | changes,
        further=further_terms(found),
        notes=tuple(dict.fromkeys(note for record in records for note in record.notes)),
        assumptions=tuple(dict.fromkeys(text for record in records for text in record.assumptions)),
        unit_unstated=any(record.unit_unstated for record in records),
        contradicted=tuple(dict.fromkeys(text for record in records for text in record.contradicted)),
        causes=causes | readings_left_out(log, records),
    )


def readings_left_out(log: Sequence[Record], used: Sequence[Record]) -> dict[str, str]:
    """Return what somebody must see of the readings that are no noise of a sensor, by the sensor.

    Parameters
    ----------
    log, used : sequence of Record
        Sensors of one log as it was read, and at rest without wrong readings.
    """
    causes = {}
    for before, after in zip(log, used, strict=True):
        span = float(before.t[-1] - before.t[0]) + before.interval
        kept = len(after) - before.timing.get("bridged", 0.0)
        share = 1.0 - kept * before.interval / span
        said = [note for note in after.notes if note not in before.notes]
        if share > LOST_SHARE:
            said.append(f"{percent(share)} of {digits(span)} s are missing or left out")
        elif np.array_equal(before.y, after.y):
            said = []
        said += [
            f"{axis}: {count} readings that no sensor makes" for axis, (count, _) in before.broken.items()
        ]
        if said:
            causes[f"{before.name} readings"] = f"readings: {'; '.join(said)}"
    return causes


def unit_key(digest_of_log: str, options: UnitOptions) -> str:
    """Return the name of a measurement in the store."""
    parts = {
        "digest": digest_of_log,
        "options": asdict(options),
        "version": importlib.metadata.version("ins-noise-tuner"),
        "schema": UnitMeasurement.schema,
    }
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def stored_measurement(store: str | None, key: str) -> UnitMeasurement | None:
    """Return a measurement of the store; None where there is none, or only a damaged one."""
    if store is None:
        return None
    path = Path(store) / f"{key}.json"
    if not path.is_file():
        return None
    try:
        content = parse_json(read_text(path, expected="JSON"), source=str(path))
        return load(content, UnitMeasurement, source=str(path))
    except DataError:
        return None


def store_measurement(store: str, key: str, measurement: UnitMeasurement) -> None:
    """Write a measurement into the store, whole or not at all."""
    write_text(Path(store) / f"{key}.json", json_text(dump(measurement)))
