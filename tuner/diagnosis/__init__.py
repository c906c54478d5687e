"""What a simulation of the fitted model gets wrong, and why: of the noise of a static log, or of a filter on a drive.

`diagnose` turns data into residuals that must be independent standard normal numbers if the model is right, tests
them in many ways, extends the model by the cause that explains most, and starts again until no test rejects. Every
cause is one file in `tuner.diagnosis.static.causes` or `tuner.diagnosis.drive.causes`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import overload

from tuner.readers import read
from tuner.readers.drive import read_if_drive
from tuner.types import Diagnosis, DriveDiagnosis, FilterConfig, GnssNoise, Identification
from tuner.types.number_ranges import Whole
from tuner.types.progress import Progress, silent
from tuner.types.public import public
from tuner.types.records import DataError, Drive, Record

__all__ = ["diagnose"]


@overload
def diagnose(
    data: Record | Sequence[Record],
    *,
    holdout: Record | Sequence[Record] | None = ...,
    identification: Identification | None = ...,
    replicas: int = ...,
    seed: int = ...,
    progress: Progress = ...,
) -> Diagnosis: ...


@overload
def diagnose(
    data: Drive,
    *,
    config: FilterConfig | str | Path | None = ...,
    gnss: GnssNoise | str | None = ...,
    wheels: bool = ...,
    progress: Progress = ...,
) -> DriveDiagnosis: ...


@overload
def diagnose(
    data: Record | Sequence[Record] | Drive | str | Path,
    *,
    holdout: Record | Sequence[Record] | None = ...,
    identification: Identification | None = ...,
    replicas: int = ...,
    seed: int = ...,
    config: FilterConfig | str | Path | None = ...,
    gnss: GnssNoise | str | None = ...,
    wheels: bool = ...,
    progress: Progress = ...,
) -> Diagnosis | DriveDiagnosis: ...


@public("diagnose")
def diagnose(
    data: Record | Sequence[Record] | Drive | str | Path,
    *,
    holdout: Record | Sequence[Record] | None = None,
    identification: Identification | None = None,
    replicas: Whole = 0,
    seed: Whole = 0,
    config: FilterConfig | str | Path | None = None,
    gnss: GnssNoise | str | None = None,
    wheels: bool = False,
    progress: Progress = silent,
) -> Diagnosis | DriveDiagnosis:
    """Find what a simulation of the fitted model gets wrong, and name the causes.

    Parameters
    ----------
    data : Record, sequence of Record, Drive, str or Path
        The records of a static log, a measured drive, or the path of either.
    holdout : Record or sequence of Record, optional
        Of a static log: a second log of the same unit, to measure gains on; without it, on the last 40 %.
    identification : Identification, optional
        Of a static log: its noise as identified, which findings are reported against; without it, identified here.
    replicas : int
        Of a static log: simulated records a finding, for bands; 0 for none.
    seed : int
        Of a static log: seed of the noise that bridges gaps and of the replicas.
    config : FilterConfig, str or Path, optional
        Of a drive: the filter, as a configuration, its file or a built-in grade; without it, one made from the parts
        in which the vehicle stands.
    gnss : GnssNoise or str, optional
        Of a drive: its receiver, where the fixes report no standard deviations; the name of a built-in one, or a log
        of fixes at rest.
    wheels : bool
        Of a drive: whether the vehicle's wheels do not slip sideways; then the stated mounting is tested.
    progress : callable, optional
        Called with one line at each step.

    Returns
    -------
    Diagnosis or DriveDiagnosis
        Of a static log, or of a drive.

    Raises
    ------
    DataError
        Where the data cannot be analysed, or an option does not go with them.
    """
    if isinstance(data, str | Path):
        drive = read_if_drive(data)
        data = read(data) if drive is None else drive
    if isinstance(data, Drive):
        from tuner.diagnosis.drive.explained_drive import examine_drive_of

        return examine_drive_of(
            data, config, holdout=holdout, gnss=gnss, wheels=wheels, progress=progress
        ).diagnosis
    from tuner.diagnosis.static.diagnose import diagnose as diagnose_records

    given = {"config": config is not None, "gnss": gnss is not None, "wheels": wheels}
    if any(given.values()):
        argument = next(name for name, value in given.items() if value)
        raise DataError(f"diagnose: {argument}: expected with a drive, but a static log has no fixes")
    progress("diagnosing")
    return diagnose_records(
        data, holdout=holdout, identification=identification, replicas=replicas, seed=seed
    )
