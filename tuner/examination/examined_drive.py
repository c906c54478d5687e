"""What a filter begins from: a recorded drive, examined once, without the faults that are certain."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from tuner.examination.examine import Examination, examine
from tuner.formats.repair_words import repair_text
from tuner.readers.drive import read_drive, with_mounting
from tuner.readers.drive_checks import possible_drive
from tuner.types.named_cause import NamedCause, one_line
from tuner.types.progress import Progress, silent
from tuner.types.records import DataError, Drive


def examined_drive(
    drive: Drive | str | Path,
    progress: Progress = silent,
    *,
    lever_arm: tuple[float, float, float] | None = None,
) -> tuple[Drive, Examination | None]:
    """Read a recorded drive and examine its streams.

    Parameters
    ----------
    drive : Drive, str or Path
        As recorded, or where it is stored.
    progress : callable, optional
        Called with what is being done.
    lever_arm : tuple of 3 floats, optional
        As the user states it, in place of that of the drive; see `with_mounting`.

    Returns
    -------
    drive : Drive
        Without what a filter must not begin with; its notes say what that was, its repairs all that was found, its
        clock what delays its stamps have.
    examination : Examination or None
        None where the drive is too short to be examined.

    Raises
    ------
    DataError
        Where its numbers are possible in no unit, the streams agree in two readings of one of them, or the lever arm is
        refused.
    """
    recorded = drive if isinstance(drive, Drive) else read_drive(drive)
    recorded = with_mounting(recorded, lever_arm=lever_arm)
    progress("examining the drive")
    try:
        found = examine(recorded)
    except DataError:
        return possible_drive(recorded), None
    if found.undecided:
        raise DataError(f"{recorded.source or recorded.name}: {found.undecided}")
    said = (NamedCause(f"before the filter: {repair_text(one)}") for one in found.before_filter)
    notes = (*recorded.notes, *one_line(said))
    return possible_drive(
        replace(found.filtered, notes=notes, repairs=found.repairs, clock=found.clock)
    ), found
