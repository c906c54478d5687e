"""The diagnosis of a drive with, for each noise setting of the filter, the scale that the drive needs and why."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from tuner.diagnosis.drive.diagnose import ExaminedDrive, examine_drive
from tuner.diagnosis.drive.noise_scale_estimates import estimate_noise_scales
from tuner.synthesis.from_drive import config_for_drive, config_of_drive, receiver_of, stationary_noise
from tuner.types import DriveDiagnosis, FilterConfig, GnssNoise
from tuner.types.progress import Progress
from tuner.types.records import Drive


def examine_and_explain(
    drive: Drive, config: FilterConfig, *, wheels: bool = False, progress: Progress
) -> ExaminedDrive:
    """Diagnose a drive and explain the factor that each noise setting needs; see `examine_drive`."""
    progress("diagnosing the drive (kernels are compiled on first use: some 20 s)")
    examined = examine_drive(drive, config, wheels=wheels, progress=progress)
    progress("estimating the scale of each noise setting")
    scales = estimate_noise_scales(examined, stationary_noise(drive).vibration)
    return replace(examined, diagnosis=replace(examined.diagnosis, noise_scales=scales))


def diagnose_drive_of(
    drive: Drive,
    config: FilterConfig | str | Path | None,
    *,
    gnss: GnssNoise | None,
    wheels: bool,
    progress: Progress,
) -> DriveDiagnosis:
    """Diagnose a drive; without a configuration, that of the unit from the parts in which the vehicle stands."""
    if config is not None:
        chosen = config_for_drive(drive, config, gnss=gnss)
        return examine_and_explain(drive, chosen, wheels=wheels, progress=progress).diagnosis
    chosen = config_of_drive(drive, stationary_noise(drive), gnss=gnss or receiver_of(drive))
    progress(chosen.notes[0])
    found = examine_and_explain(drive, chosen, wheels=wheels, progress=progress).diagnosis
    return replace(found, notes=(chosen.notes[0], *found.notes))
