"""The result of `navigate` as a folder of files."""

from __future__ import annotations

from pathlib import Path

from tuner.consistency.score_drive import DriveResult
from tuner.formats.files import write_text
from tuner.report.solution_figures import draw_solution
from tuner.report.solution_files import solution_csv, track_gpx, track_kml, tracks
from tuner.types.records import Drive


def write_solution(found: DriveResult, drive: Drive, directory: Path) -> None:
    """Write ``solution.csv``, ``track.kml``, ``track.gpx`` and the figures of track, innovations and errors.

    Parameters
    ----------
    found : DriveResult
        Of `tuner.navigate`.
    drive : Drive
        What was filtered.
    directory : Path
        Made where it does not exist; each file is written whole or not at all.
    """
    lines = tracks(found, drive.reference)
    write_text(directory / "solution.csv", solution_csv(found, drive.origin))
    write_text(directory / "track.kml", track_kml(lines, drive.name))
    write_text(directory / "track.gpx", track_gpx(lines, drive.name))
    draw_solution(found, drive, directory)
