"""Logs and drives named on the command line are read with a progress bar; every repair of them is reported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from tuner.cli.commands.options import Reading
from tuner.cli.progress import Messages
from tuner.stages import counted, reached
from tuner.types.records import DataError

if TYPE_CHECKING:
    from tuner.types.records import Drive, Record


def load_records(log: str, reading: Reading, messages: Messages) -> tuple[Record, ...]:
    """Read a static log, or one inertial unit of several in it, such as ``log.bin:IMU.1``."""
    from tuner.readers import read
    from tuner.readers.source_kind import with_name

    records = read(
        log,
        rate=reading.rate,
        gyro_unit=reading.gyro_unit,
        accel_unit=reading.accel_unit,
        gyro_scale=reading.gyro_scale,
        accel_scale=reading.accel_scale,
        columns=reading.columns,
        assume=reading.assume,
        memory=reading.memory,
        begin=reading.begin,
        end=reading.end,
        progress=reached,
    )
    for note in dict.fromkeys(note for record in records for note in record.notes):
        messages.say(f"{with_name(Path(log)).name}: {note}")
    return records


def assumed(data: object) -> list[str]:
    """Return lines on what nobody states and was assumed of records, to stand before the tables; none of a drive."""
    records = data if isinstance(data, tuple) else ()
    return list(dict.fromkeys(f"  {text}" for record in records for text in record.assumptions))


def load_source(source: str | None, reading: Reading, messages: Messages) -> tuple[Record, ...] | str | None:
    """Read a source if it is a log; the name of a grade and the path of anything else stay as they are."""
    from tuner.readers.source_kind import is_log

    if source is None or not is_log(source):
        _refuse_part(reading, "found none" if source is None else f"found {source}")
        return source
    return load_records(source, reading, messages)


def load_sources(
    sources: Sequence[str], reading: Reading, messages: Messages
) -> list[tuple[Record, ...] | str]:
    """Read those of several sources that are logs; what states how a log is read is theirs."""
    from tuner.readers.source_kind import is_log

    logs = [is_log(source) for source in sources]
    if not any(logs) and sources:
        _refuse_part(reading, f"found {', '.join(sources)}")
    return [
        load_records(source, reading, messages) if log else source
        for source, log in counted(list(zip(sources, logs, strict=True)))
    ]


def load_data(source: str, reading: Reading, messages: Messages) -> tuple[Record, ...] | Drive:
    """Read a static log or a measured drive."""
    from tuner.readers.drive import read_if_drive

    drive = read_if_drive(source)
    if drive is not None:
        _refuse_part(reading, f"found a drive, {source}")
    return load_records(source, reading, messages) if drive is None else drive


def _refuse_part(reading: Reading, found: str) -> None:
    """Refuse what is stated of a static log where there is none; --memory is that of the program."""
    stated = [word.partition("=")[0] for word in replace(reading, memory=None).words]
    if stated:
        raise DataError(
            f"{' and '.join(stated)}: expected a static log, {found}; leave out what states how it is read"
        )
