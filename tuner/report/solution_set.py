"""The result of `navigate` as a folder of files."""

from __future__ import annotations

from pathlib import Path

from tuner.consistency.score_drive import DriveResult
from tuner.formats.file_set import write_set
from tuner.report.solution_figures import solution_pictures
from tuner.report.solution_files import solution_csv, track_gpx, track_kml, tracks
from tuner.types.records import Drive


def attitude_text(drive: Drive) -> str:
    """Return of which axes the attitude in ``solution.csv`` is, in words."""
    if drive.mounting is not None:
        return (
            "attitude in solution.csv: of the vehicle, by the stated mounting of the unit (roll, pitch, yaw)"
        )
    return (
        "attitude in solution.csv: of the unit's own axes, since its mounting is not stated (imu_roll, imu_pitch, "
        "imu_yaw); --imu-frame or --mounting-rpy gives that of the vehicle"
    )


def write_solution(found: DriveResult, drive: Drive, directory: Path) -> None:
    """Write ``solution.csv``, ``track.kml``, ``track.gpx`` and the figures of track, innovations and errors.

    Parameters
    ----------
    found : DriveResult
        Of `tuner.navigate`.
    drive : Drive
        What was filtered.
    directory : Path
        Made where it does not exist; a set that is there is replaced in one step.
    """
    lines = tracks(found, drive.reference)
    texts = {
        "solution.csv": solution_csv(found, drive.origin, mounted=drive.mounting is not None),
        "track.kml": track_kml(lines, drive.name),
        "track.gpx": track_gpx(lines, drive.name),
    }
    files = {name: text.encode() for name, text in texts.items()}
    write_set(directory, files | solution_pictures(found, drive), last="solution.csv")
