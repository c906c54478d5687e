"""A drive ready to be filtered as a configuration says, clocks included, and whose place its reference is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.arrays import FloatArray
from models.earth import ned_between
from tuner.consistency.drive_scores import reference_at
from tuner.consistency.score_drive import drive_filter
from tuner.navigation.compensation import compensate
from tuner.navigation.data import Solution
from tuner.navigation.drive.run import (
    Stretch,
    assumed_sds,
    at_stamps,
    filtered,
    prepare,
)
from tuner.navigation.settings import FilterSettings
from tuner.types import FilterConfig
from tuner.types.records import Drive, Reference


@dataclass(frozen=True)
class ConfiguredRun:
    """A drive ready to be filtered as a configuration says.

    Attributes
    ----------
    settings : FilterSettings
        The filter.
    stretches : tuple of Stretch
        The drive.
    reference : Reference or None
        To judge by.
    of_antenna : bool
        Whether the reference is that of the antenna, not of the inertial unit.
    """

    settings: FilterSettings
    stretches: tuple[Stretch, ...]
    reference: Reference | None
    of_antenna: bool = False


def configured_run(drive: Drive, config: FilterConfig) -> ConfiguredRun:
    """Prepare a drive as `navigate` does.

    Parameters
    ----------
    drive : Drive
        As examined, its stamps as they are.
    config : FilterConfig
        The filter.
    """
    drive, settings = _drive_and_settings(drive, config)
    stretches: list[Stretch] = []
    solutions: list[Solution] = []
    for stretch in prepare(drive, settings)[0]:
        before = solutions[-1] if solutions else None
        stretches.append(at_stamps(stretch, settings, before))
        solutions.append(filtered(stretches[-1], settings, before))
    run = ConfiguredRun(settings, tuple(stretches), drive.reference)
    return replace(run, of_antenna=_is_ofantenna(run, solutions))


def _is_ofantenna(run: ConfiguredRun, solutions: Sequence[Solution]) -> bool:
    """Tell whether fixes lie nearer to the reference as they are than brought to the inertial unit."""
    if run.reference is None:
        return False
    off, arms = [], []
    for stretch, solution in zip(run.stretches, solutions, strict=True):
        rows = np.flatnonzero(solution.t >= stretch.settled)
        off.append(ned_between(stretch.fixes.llh[rows], reference_at(run.reference, solution.t[rows])[0]))
        arms.append(antenna(run.settings, solution, rows))
    fixes, arm = np.concatenate(off)[:, :2], np.concatenate(arms)[:, :2]
    known = np.isfinite(fixes).all(axis=1)
    if not known.any():
        return False
    as_they_are, at_unit = (np.linalg.norm(x[known], axis=1) for x in (fixes, fixes - arm))
    return bool(np.median(as_they_are) < np.median(at_unit))


def antenna(settings: FilterSettings, solution: Solution, rows: NDArray[np.intp]) -> FloatArray:
    """Return the place of the antenna from the inertial unit, north, east, down, (r, 3), m."""
    at, arm = settings.model.layout, np.array(settings.lever_arm)
    if "lever_arm" in at:
        arm = arm + solution.parameters[rows][:, at["lever_arm"]]
    mat = rotation.mat_from_quat(solution.state.quat_nb[rows])
    return np.asarray((mat @ np.broadcast_to(arm, (len(rows), 3))[..., None])[..., 0])


def with_other_noise(run: ConfiguredRun, drive: Drive, config: FilterConfig) -> ConfiguredRun:
    """Return a run with a configuration that differs in its noise only: alignment and velocities are kept.

    Parameters
    ----------
    run : ConfiguredRun
        Of the same drive under a configuration with the same lever arm and sensor errors.
    drive, config
        As of `configured_run`.
    """
    settings = _drive_and_settings(drive, config)[1]
    stretches = tuple(
        replace(s, fixes=replace(s.fixes, sd=assumed_sds(s.reported_sd, s.solution, settings)))
        for s in run.stretches
    )
    return replace(run, settings=settings, stretches=stretches)


def _drive_and_settings(drive: Drive, config: FilterConfig) -> tuple[Drive, FilterSettings]:
    drive = compensate(drive, config.compensation)
    return drive, drive_filter(drive, config)[0]
