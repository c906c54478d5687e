"""A measured drive on trial: innovations, errors against a reference where there is one, outages everywhere.

An outage withholds the fixes of a window and scores the position at its end against the reference, or else
against the withheld fix itself, whose own error is part of the prediction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.earth import ned_between
from tuner.consistency import (
    DIVERGED,
    REJECTED,
    Consistency,
    Outage,
    Score,
    Whiteness,
    innovation_scores,
    score,
    squares,
    whiteness,
)
from tuner.navigation.compensation import compensated, compensated_settings
from tuner.navigation.drive import SETTLING, Stretch, navigate, prepare
from tuner.navigation.inputs import GATED, USED, WITHHELD, Solution
from tuner.navigation.settings import FilterSettings, filter_settings
from tuner.records import Drive, Reference
from tuner.results import FilterConfig
from tuner.verdicts import verdicts

FloatArray = NDArray[np.float64]

HORIZONS = (10.0, 30.0, 60.0)
RECOVERY = 30.0
"""Time with fixes between two outages, s."""
BLOCK = 30.0
"""Length of the blocks of a drive that count as independent, s."""
STATES: Mapping[str, float] = MappingProxyType({"time_offset": 0.1})
"""Further states of a filter on a drive, with their priors."""
UNKNOWN_LEVER_ARM = 1.0
"""Prior of a lever arm that nobody gave, m."""


@dataclass(frozen=True)
class DriveResult:
    """What a filter made of a drive.

    Attributes
    ----------
    consistency : Consistency
        Scores and verdicts.
    settings : FilterSettings
        The filter.
    stretches : tuple of Stretch
        What was filtered.
    solutions : tuple of Solution
        One a stretch, all fixes used.
    estimates : mapping of str to tuple of (value, sd)
        Final estimates of lever arm, time offset and other constants, SI.
    notes : tuple of str
        What was repaired, found and done.
    """

    consistency: Consistency
    settings: FilterSettings
    stretches: tuple[Stretch, ...]
    solutions: tuple[Solution, ...]
    estimates: Mapping[str, tuple[tuple[float, float], ...]]
    notes: tuple[str, ...]


def drive_filter(
    drive: Drive, config: FilterConfig, *, states: Mapping[str, float] | None = None
) -> tuple[FilterSettings, tuple[str, ...]]:
    """Return the filter of a configuration for a drive: with the offset of the clocks and an unknown lever arm."""
    constants = {**STATES, **config.constants, **(states or {})}
    arm, notes = drive.lever_arm, []
    if arm is not None and drive.mounting is None and any(arm):
        arm = None
        notes.append("the lever arm is given in vehicle axes, but the mounting of the sensor is unknown")
    if arm is None:
        constants.setdefault("lever_arm", UNKNOWN_LEVER_ARM)
        notes.append(f"lever arm estimated from 0 ± {constants['lever_arm']:g} m")
    settings = filter_settings(config, constants=constants, lever_arm=arm or (0.0, 0.0, 0.0))
    return compensated_settings(settings, config.compensation), tuple(notes)


def navigate_drive(
    drive: Drive, config: FilterConfig, *, states: Mapping[str, float] | None = None
) -> DriveResult:
    """Filter a drive, with and without its fixes.

    Parameters
    ----------
    drive : Drive
        The drive.
    config : FilterConfig
        What the filter believes of the sensor.
    states : mapping of str to float, optional
        Further states, names of `models.layout.OPTIONAL`, with the sd of their prior.

    Raises
    ------
    DataError
        Where the configuration lacks an axis or the drive cannot be aligned.
    """
    drive = compensated(drive, config.compensation)
    settings, assumed = drive_filter(drive, config, states=states)
    stretches, notes = prepare(drive, settings)
    solutions = navigate(stretches, settings, np.zeros((0, 2)))
    scored = [_settled(stretch, solution) for stretch, solution in zip(stretches, solutions, strict=True)]
    groups = [
        block for stretch, rows in zip(solutions, scored, strict=True) for block in _blocks(stretch, rows)
    ]
    found = Consistency(
        None,
        _against_reference(drive.reference, solutions, scored) if drive.reference is not None else (),
        innovation_scores(
            [s.innovation[rows] for s, rows in groups],
            [s.innovation_covariance[rows] for s, rows in groups],
            [s.use[rows] for s, rows in groups],
        ),
        _whiteness(solutions, scored),
        tuple(
            outage
            for horizon in HORIZONS
            if (outage := _outage(drive.reference, stretches, settings, horizon)) is not None
        ),
        _errors(drive.reference, solutions, scored),
        float(
            np.mean(
                np.concatenate([s.use[rows, 0] == GATED for s, rows in zip(solutions, scored, strict=True)])
            )
        ),
        False,
    )
    found = replace(found, diverged=_diverged(found, solutions))
    return DriveResult(
        replace(found, verdicts=verdicts(found)),
        settings,
        stretches,
        solutions,
        _estimates(settings, solutions[-1]),
        (*drive.notes, *assumed, *notes),
    )


def _settled(stretch: Stretch, solution: Solution) -> NDArray[np.intp]:
    """Return the epochs after the filter has settled."""
    a = stretch.alignment
    return np.flatnonzero(solution.t >= a.t + a.still + SETTLING)


def _blocks(solution: Solution, rows: NDArray[np.intp]) -> list[tuple[Solution, NDArray[np.intp]]]:
    if not len(rows):
        return []
    number = ((solution.t[rows] - solution.t[rows[0]]) // BLOCK).astype(int)
    return [(solution, rows[number == n]) for n in np.unique(number)]


def _whiteness(solutions: Sequence[Solution], scored: Sequence[NDArray[np.intp]]) -> Whiteness | None:
    longest = max(range(len(solutions)), key=lambda i: len(scored[i]))
    solution, rows = solutions[longest], scored[longest]
    return whiteness(
        solution.t[rows],
        [solution.innovation[rows]],
        [solution.innovation_covariance[rows]],
        [solution.use[rows]],
    )


def _reference_at(reference: Reference, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return position, velocity, attitude angles of the reference at times inside it, NaN outside or in gaps."""

    def at(values: FloatArray) -> FloatArray:
        return np.stack(
            [np.interp(t, reference.t, column, left=np.nan, right=np.nan) for column in values.T], axis=-1
        )

    after = np.clip(np.searchsorted(reference.t, t), 1, len(reference.t) - 1)
    usual = 3.0 * float(np.median(np.diff(reference.t)))
    hole = reference.t[after] - reference.t[after - 1] > usual
    parts = [at(v) for v in (reference.llh, reference.vel_n, np.unwrap(reference.rpy, axis=0))]
    for part in parts:
        part[hole] = np.nan
    return parts[0], parts[1], parts[2]


def _differences(reference: Reference, solution: Solution, rows: NDArray[np.intp]) -> FloatArray:
    """Return reference minus estimate: position, velocity, attitude less one constant rotation; (r, 9)."""
    llh, vel_n, rpy = _reference_at(reference, solution.t[rows])
    out = np.full((len(rows), 9), np.nan)
    out[:, :3] = ned_between(llh, solution.state.llh[rows])
    out[:, 3:6] = vel_n - solution.state.vel_n[rows]
    good = np.isfinite(rpy).all(axis=1)
    if np.count_nonzero(good) > 10:
        mine = rotation.mat_from_quat(solution.state.quat_nb[rows][good])
        theirs = rotation.mat_from_rpy(rpy[good])
        # One rotation from the reference's body into mine, the mean of all.
        u, _, vt = np.linalg.svd(np.einsum("kji,kjl->il", mine, theirs))
        mounting = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
        turn = theirs @ mounting.T @ np.swapaxes(mine, -1, -2)
        out[good, 6:9] = rotation.rotvec_from_mat(turn)
    return out


def _against_reference(
    reference: Reference, solutions: Sequence[Solution], scored: Sequence[NDArray[np.intp]]
) -> tuple[Score, ...]:
    """Score position, velocity and attitude against a reference, in blocks."""
    parts: dict[str, list[FloatArray]] = {"position": [], "velocity": [], "attitude": []}
    for solution, rows in zip(solutions, scored, strict=True):
        error = _differences(reference, solution, rows)
        for block, own in _blocks(solution, rows):
            part = error[np.isin(rows, own)]
            for i, name in enumerate(parts):
                at = slice(3 * i, 3 * i + 3)
                good = np.isfinite(part[:, at]).all(axis=1)
                parts[name].append(squares(part[good, at], block.covariance[own][good, at, at]))
    return tuple(
        score(name, groups, 3)
        for name, groups in parts.items()
        if sum(len(group) > 0 for group in groups) > 1
    )


def _errors(
    reference: Reference | None, solutions: Sequence[Solution], scored: Sequence[NDArray[np.intp]]
) -> dict[str, tuple[float, ...]]:
    """Return rms differences to the reference, else rms innovations."""
    if reference is None:
        pairs = zip(solutions, scored, strict=True)
        z = np.concatenate([s.innovation[rows][s.use[rows, 0] == USED] for s, rows in pairs])
        rms = np.sqrt(np.mean(z**2, axis=0))
        return {
            "position_innovation_rms_m": tuple(rms[:3].tolist()),
            "velocity_innovation_rms_m_s": tuple(rms[3:].tolist()),
        }
    error = np.concatenate(
        [_differences(reference, s, rows) for s, rows in zip(solutions, scored, strict=True)]
    )
    rms = np.sqrt(np.nanmean(error**2, axis=0))
    return {
        "position_rms_m": tuple(rms[:3].tolist()),
        "velocity_rms_m_s": tuple(rms[3:6].tolist()),
        "attitude_rms_rad": tuple(rms[6:].tolist()),
    }


def _outage(
    reference: Reference | None, stretches: tuple[Stretch, ...], settings: FilterSettings, horizon: float
) -> Outage | None:
    """Withhold windows of one length and score the position at their ends; None where no window fits."""
    windows = [
        (begin, begin + horizon)
        for s in stretches
        for begin in np.arange(
            s.alignment.t + s.alignment.still + SETTLING, s.fixes.t[-1] - horizon, horizon + RECOVERY
        )
    ]
    if not windows:
        return None
    found: list[tuple[float, float]] = []
    for solution in navigate(stretches, settings, np.array(windows)):
        for begin, end in windows:
            inside = np.flatnonzero(
                (solution.t > begin) & (solution.t <= end) & (solution.use[:, 0] == WITHHELD)
            )
            if not len(inside) or end - solution.t[inside[-1]] > 0.2 * horizon + 0.5:
                continue
            k = int(inside[-1])
            if reference is None:
                error, spread = solution.innovation[k, :3], solution.innovation_covariance[k, :3, :3]
            else:
                error = ned_between(
                    _reference_at(reference, solution.t[k : k + 1])[0][0], solution.state.llh[k]
                )
                spread = solution.covariance[k, :3, :3]
            if np.isfinite(error).all():
                found.append((float(error @ error), float(np.trace(spread))))
    if not found:
        return None
    e2, predicted = np.array(found).T
    return Outage(
        horizon,
        float(np.sqrt(e2.mean())),
        float(np.sqrt(predicted.mean())),
        score(f"outage {horizon:g} s", [[v] for v in e2 / predicted], 1, components=3),
        len(found),
    )


def _diverged(found: Consistency, solutions: Sequence[Solution]) -> bool:
    """Whether the filter lost its way: not finite, most fixes refused, or errors beyond all prediction."""
    finite = all(np.isfinite(s.state.llh).all() and np.isfinite(s.covariance).all() for s in solutions)
    return not finite or found.gated > REJECTED or any(s.ratio > DIVERGED for s in found.nis)


def _estimates(settings: FilterSettings, last: Solution) -> dict[str, tuple[tuple[float, float], ...]]:
    sd = np.sqrt(np.diag(last.final_covariance))
    layout = settings.model.layout
    return {
        name: tuple(zip(last.final_parameters[layout[name]].tolist(), sd[layout[name]].tolist(), strict=True))
        for name, _ in layout.blocks[3:]
        if not name.endswith("_markov") and name != "gnss_position"
    }
