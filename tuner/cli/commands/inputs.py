"""What a word on the command line stands for: a log, a curve, a datasheet or a built-in grade."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tuner.cli.commands.options import Reading
from tuner.cli.progress import Messages
from tuner.types import FilterConfig, GnssNoise, Identification
from tuner.types.records import DataError, Record

if TYPE_CHECKING:
    from tuner.diagnosis.drive import ExaminedDrive
    from tuner.identification.arma import Likelihood
    from tuner.identification.gnss_receiver import ReceiverErrors
    from tuner.types.records import Drive


def source_name(source: str) -> str:
    """Return the short name of a source: its file name without suffixes, or the name of the grade."""
    name = Path(source).name
    return name.split(".")[0] or name


def is_file(source: str) -> bool:
    """Tell a path from the name of a built-in grade: a path exists, or looks like one."""
    return Path(source).exists() or "/" in source or "." in source


def is_log(source: str) -> bool:
    """Tell a log from a grade, a datasheet, an identification on file and a measured curve."""
    from tuner.catalogue.datasheet import is_datasheet
    from tuner.readers import is_curve
    from tuner.readers.stored import is_stored

    path = Path(source)
    return is_file(source) and not (is_datasheet(path) or is_stored(path) or is_curve(path))


def load_at_rest(log: str, messages: Messages) -> ReceiverErrors:
    """Identify a receiver from a log of its fixes at rest."""
    from tuner.identification.gnss_receiver import identify_receiver
    from tuner.readers.gnss_log import read_fixes

    messages.say(f"identifying the receiver from {Path(log).name}")
    return identify_receiver(read_fixes(log), name=source_name(log))


def load_receiver(source: str, messages: Messages) -> GnssNoise:
    """Return the errors of a receiver: a built-in grade, or a log of fixes at rest."""
    from tuner.catalogue.grades import load_gnss

    return load_at_rest(source, messages).noise if is_file(source) else load_gnss(source)


def load_records(log: str, reading: Reading, messages: Messages) -> tuple[Record, ...]:
    """Read a log with a progress bar; every repair is said."""
    from tuner.readers import read

    with messages.bar(f"reading {Path(log).name}") as advance:
        records = read(
            Path(log),
            rate=reading.rate,
            gyro_unit=reading.gyro_unit,
            accel_unit=reading.accel_unit,
            gyro_scale=reading.gyro_scale,
            accel_scale=reading.accel_scale,
            columns=reading.columns,
            progress=advance,
        )
    for note in dict.fromkeys(note for record in records for note in record.notes):
        messages.say(f"{Path(log).name}: {note}")
    return records


def load_identification(
    source: str,
    reading: Reading,
    messages: Messages,
    *,
    terms: tuple[str, ...] | None = None,
    method: str = "likelihood",
    arma: Likelihood | None = "fast",
    latitude: float | None = None,
) -> Identification:
    """Identify whatever the source is: a grade, a datasheet, an identification on file, a curve or a log.

    Raises
    ------
    DataError
        If the source is none of these.
    """
    from tuner.catalogue.datasheet import is_datasheet, read_datasheet
    from tuner.catalogue.grades import grade_identification, grade_names, load_grade
    from tuner.identification import identify
    from tuner.identification.from_curve import identify_curve
    from tuner.readers import is_curve, read_curve
    from tuner.readers.stored import is_stored, read_stored
    from tuner.segments.conditions import at_rest
    from tuner.segments.multi_position import calibrate

    if not is_file(source):
        if source not in grade_names():
            msg = f"{source}: expected a file or a built-in grade ({' '.join(grade_names())}), found neither"
            raise DataError(msg)
        return grade_identification(load_grade(source))
    if is_datasheet(Path(source)):
        return read_datasheet(Path(source))
    if is_stored(Path(source)):
        return read_stored(Path(source))
    if is_curve(Path(source)):
        return identify_curve(read_curve(Path(source)), source=source_name(source), terms=terms)
    whole = load_records(source, reading, messages)
    records = at_rest(whole, messages.say)
    if calibrate(whole) is not None:
        messages.say("several poses: `tuner tune` also calibrates the sensors from them")
    messages.say("identifying")
    return identify(records, terms=terms, method=method, arma=arma, latitude=latitude)


def is_drive(source: str) -> bool:
    """Tell a drive (a folder, an NPZ with fixes, a YAML of KF-GINS) from a log of the inertial unit alone."""
    import zipfile

    path = Path(source)
    if path.is_dir():
        return True
    if path.suffix.lower() == ".npz" and zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as file:
            return "gnss_t.npy" in file.namelist()
    if path.suffix.lower() in (".yaml", ".yml") and path.is_file():
        head = path.read_text(encoding="utf-8", errors="replace")
        return "imupath" in head and "gnsspath" in head
    return False


def load_drive(source: str) -> Drive:
    """Read a drive."""
    from tuner.readers.drive import read_drive

    return read_drive(source)


def examined_drive(
    drive: Drive, config: FilterConfig, messages: Messages, *, wheels: bool = False
) -> ExaminedDrive:
    """Criticise the filter of a configuration on a drive, and explain what the drive asks of its noise settings."""
    from dataclasses import replace

    from tuner.diagnosis.drive import examine_drive
    from tuner.diagnosis.drive.noise_scale_estimates import estimate_noise_scales
    from tuner.synthesis.from_drive import standing

    messages.say("diagnosing the drive (kernels are compiled on first use: some ten seconds)")
    examined = examine_drive(drive, config, wheels=wheels, progress=messages.say)
    messages.say("explaining what the drive asks of each noise setting")
    asked = estimate_noise_scales(examined, standing(drive).vibration)
    return replace(examined, diagnosis=replace(examined.diagnosis, noise_scales=asked))
