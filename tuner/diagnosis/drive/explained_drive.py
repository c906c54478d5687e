"""The diagnosis of a drive with, for each noise setting of the filter, the scale that the drive needs and why."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from tuner.diagnosis.drive.config_after_drive import as_estimated
from tuner.diagnosis.drive.diagnose import ExaminedDrive, examine_drive
from tuner.diagnosis.drive.noise_in_motion import in_motion_to_rest, with_noise_in_motion
from tuner.diagnosis.drive.noise_scale_estimates import estimate_noise_scales
from tuner.examination.examine import Examination
from tuner.examination.examined_drive import examined_drive
from tuner.identification.identify_source import receiver_of_source
from tuner.stages import stage, task
from tuner.synthesis.from_drive import config_for_drive, config_of_drive, receiver_of, stationary_noise
from tuner.types import FilterConfig, GnssNoise
from tuner.types.progress import Progress, silent
from tuner.types.records import DataError, Drive


@task()
def examine_and_explain(
    drive: Drive,
    config: FilterConfig,
    examination: Examination | None,
    *,
    wheels: bool = False,
    progress: Progress,
) -> ExaminedDrive:
    """Diagnose a drive and explain the factor that each noise setting needs; see `examine_drive`."""
    progress("diagnosing the drive")
    stage("diagnosing the drive", 0.85)
    examined = examine_drive(drive, config, wheels=wheels, progress=progress)
    progress("estimating the scale of each noise setting")
    stage("estimating the scale of each noise setting", 1.0)
    scales = estimate_noise_scales(examined, in_motion_to_rest(examination))
    examined = replace(examined, diagnosis=replace(examined.diagnosis, noise_scales=scales))
    after = as_estimated(examined, examined.diagnosis.after)
    return replace(examined, diagnosis=replace(examined.diagnosis, after=after))


def examine_drive_of(
    drive: Drive,
    config: FilterConfig | str | Path | None = None,
    *,
    holdout: object = None,
    gnss: GnssNoise | str | None = None,
    wheels: bool = False,
    progress: Progress = silent,
) -> ExaminedDrive:
    """Diagnose a recorded drive; without a configuration, that of the unit from the parts in which the vehicle stands.

    The parameters are those of `tuner.diagnose`; a second drive to measure gains on is refused.
    """
    if holdout is not None:
        raise DataError("--holdout: expected with a static log; of a drive the last 40 % are held out")
    receiver = receiver_of_source(gnss, progress) if isinstance(gnss, str) else gnss
    drive, examination = examined_drive(drive, progress)
    if config is not None:
        chosen = config_for_drive(drive, config, gnss=receiver)
        return examine_and_explain(drive, chosen, examination, wheels=wheels, progress=progress)
    chosen = config_of_drive(drive, stationary_noise(drive), gnss=receiver or receiver_of(drive))
    progress(chosen.notes[0])
    begun = with_noise_in_motion(drive, chosen, examination)
    examined = examine_and_explain(drive, begun, examination, wheels=wheels, progress=progress)
    notes = (chosen.notes[0], *examined.diagnosis.notes)
    return replace(examined, diagnosis=replace(examined.diagnosis, notes=notes))
