"""How well a configured filter predicts a part of a drive: positions in outages, and with fixes.

In windows of 10, 30 and 60 s all fixes are withheld; the error e of the position at their ends, against the reference
or else the withheld fix, is compared with the covariance S that the filter states (that of the fix included)::

    ln p = −½ [(ν + 3) ln(1 + eᵀS⁻¹e/(ν − 2)) + ln det S]          ν = 5

Student's density with the covariance S: a proper score, which both large errors and wrong covariances lower, and which
a few windows do not decide. The filter is the one that `navigate` runs, clocks included.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models.earth import ned_between
from tuner.consistency.drive_scores import reference_at, stated
from tuner.consistency.score_drive import OUTAGE_LENGTHS, drive_filter
from tuner.navigation.compensation import compensate
from tuner.navigation.data import WITHHELD, Solution
from tuner.navigation.drive.clock import Clock
from tuner.navigation.drive.run import RECOVERY_TIME, Stretch, navigate, outage_windows, prepare
from tuner.navigation.settings import FilterSettings
from tuner.types import FilterConfig
from tuner.types.records import Drive, Reference

FloatArray = NDArray[np.float64]

STUDENT_FREEDOM = 5.0
"""ν: heavy tails in which an error of five sds costs 8 nats, not 12."""
MAX_LATE_FIX = 0.2
"""Share of a window, beyond half a second, by which its last withheld fix may be early."""


@dataclass(frozen=True)
class OutageErrors:
    """Errors at the ends of w outages of one length: squares (w,), m², as stated (w,), m², log densities (w,)."""

    seconds: float
    square: FloatArray
    stated: FloatArray
    log_density: FloatArray

    @property
    def rms(self) -> float:
        """Root mean square of the errors, m."""
        return float(np.sqrt(np.mean(self.square)))

    @property
    def ratio(self) -> float:
        """Errors ÷ stated sds, root mean square."""
        return float(np.sqrt(np.mean(self.square / self.stated)))


@dataclass(frozen=True)
class PredictiveScore:
    """What a filter predicts of a part of a drive.

    Attributes
    ----------
    outages : tuple of OutageErrors
        By length.
    tracking_rms : float
        Position with fixes, against the reference; without one, innovations of positions, m.
    tracking : ndarray, shape (b,)
        Mean log density of the position in blocks of `RECOVERY_TIME` with fixes.
    fixes_rms : float or None
        The same error of the fixes themselves, at the same times; None without a reference.
    """

    outages: tuple[OutageErrors, ...]
    tracking_rms: float
    tracking: FloatArray
    fixes_rms: float | None = None

    @property
    def follows(self) -> bool:
        """Whether positions err no more than the fixes alone, as far as a reference tells."""
        return self.fixes_rms is None or self.tracking_rms <= self.fixes_rms

    @property
    def nats(self) -> float:
        """Log density of all outages and of all blocks with fixes."""
        return float(sum(one.log_density.sum() for one in self.outages) + self.tracking.sum())


@dataclass(frozen=True)
class ConfiguredRun:
    """A drive ready to be filtered as a configuration says."""

    settings: FilterSettings
    stretches: tuple[Stretch, ...]
    reference: Reference | None


def configured_run(drive: Drive, config: FilterConfig, clock: Clock) -> ConfiguredRun:
    """Prepare a drive as `navigate` does.

    Parameters
    ----------
    drive : Drive
        Without gross outliers, its stamps as they are.
    config : FilterConfig
        The filter.
    clock : Clock
        Of this drive, in place of what the configuration says of clocks.
    """
    compensation = config.compensation.without(("time_offset", "velocity_lag"))
    config = replace(config, compensation=compensation)
    drive = compensate(drive, compensation)
    settings, _ = drive_filter(drive, config, clock=clock)
    stretches, _ = prepare(drive, settings, clock=clock)
    return ConfiguredRun(settings, stretches, drive.reference)


def predictive_score(run: ConfiguredRun, begin: float, end: float) -> PredictiveScore | None:
    """Score a filter between two times on the clock of the inertial unit, s; None where no outage fits."""
    stretches = tuple(_until(s, end) for s in run.stretches if s.fixes.t[0] < end)
    run = replace(run, stretches=stretches)
    outages = []
    for seconds in OUTAGE_LENGTHS:
        windows = outage_windows(stretches, seconds, begin=begin, end=end)
        if len(windows) < 2:
            continue
        found = _at_ends(run, np.array(windows))
        if found is None:
            return None
        outages.append(replace(found, seconds=seconds))
    solutions = navigate(stretches, run.settings, np.zeros((0, 2)))
    tracked = [_tracked(run, s, solution, begin) for s, solution in zip(stretches, solutions, strict=True)]
    t, square, density, alone = (np.concatenate(part) for part in zip(*tracked, strict=True))
    if not outages or not len(t) or not np.isfinite(density).all():
        return None
    block = (t // RECOVERY_TIME).astype(int)
    means = np.array([density[block == one].mean() for one in np.unique(block)])
    fixes_rms = None if run.reference is None else float(np.sqrt(np.mean(alone)))
    return PredictiveScore(tuple(outages), float(np.sqrt(np.mean(square))), means, fixes_rms)


def _until(stretch: Stretch, end: float) -> Stretch:
    """Return a stretch that ends at a time."""
    count = int(np.searchsorted(stretch.fixes.t, end))
    if count >= len(stretch.fixes):
        return stretch
    fixes, last = stretch.fixes, int(stretch.fixes.after[max(count - 1, 0)]) + 1
    steps = replace(stretch.steps, dt=stretch.steps.dt[:last], increments=stretch.steps.increments[:last])
    return replace(
        stretch,
        steps=steps,
        fixes=fixes.rows(slice(0, max(count, 1))),
    )


def _position_errors(
    run: ConfiguredRun, solution: Solution, rows: NDArray[np.intp]
) -> tuple[FloatArray, FloatArray]:
    """Return errors of positions (r, 3) and their covariances (r, 3, 3), against the reference or the fixes."""
    if run.reference is None:
        return solution.innovation[rows, :3], solution.innovation_covariance[rows, :3, :3]
    t = solution.t[rows]
    error = ned_between(reference_at(run.reference, t)[0], solution.state.llh[rows])
    own = stated(run.reference, t)[:, :3, None] * np.eye(3)
    return error, solution.covariance[rows, :3, :3] + own


def _at_ends(run: ConfiguredRun, windows: FloatArray) -> OutageErrors | None:
    """Withhold windows (w, 2) and return the errors at their ends; None where a filter is lost."""
    errors, covariances = [], []
    for solution in navigate(run.stretches, run.settings, windows):
        for first, last in windows:
            inside = np.flatnonzero(
                (solution.t > first) & (solution.t <= last) & (solution.use[:, 0] == WITHHELD)
            )
            if not len(inside) or last - solution.t[inside[-1]] > MAX_LATE_FIX * (last - first) + 0.5:
                continue
            error, covariance = _position_errors(run, solution, inside[-1:])
            if np.isfinite(error).all():
                errors.append(error[0])
                covariances.append(covariance[0])
    if not errors or not np.isfinite(covariances).all():
        return None
    e, s = np.array(errors), np.array(covariances)
    return OutageErrors(0.0, np.sum(e**2, axis=1), np.trace(s, axis1=1, axis2=2), _log_density(e, s))


def _tracked(
    run: ConfiguredRun, stretch: Stretch, solution: Solution, begin: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return times, squared errors and log densities of positions with fixes, where the filter has settled.

    The last of the four are squared errors of the fixes themselves, zero without a reference.
    """
    rows = np.flatnonzero(solution.t >= max(begin, stretch.settled))
    error, covariance = _position_errors(run, solution, rows)
    good = np.isfinite(error).all(axis=1) & (solution.use[rows, 0] > 0)
    error, covariance, rows = error[good], covariance[good], rows[good]
    alone = np.zeros_like(error)
    if run.reference is not None:
        alone = ned_between(reference_at(run.reference, solution.t[rows])[0], stretch.fixes.llh[rows])
    square, off = np.sum(error**2, axis=1), np.sum(alone**2, axis=1)
    return solution.t[rows], square, _log_density(error, covariance), off


def _log_density(e: FloatArray, s: FloatArray) -> FloatArray:
    """Return the log density of errors (w, 3) under Student's law with covariances (w, 3, 3), up to a constant."""
    square = np.sum(e * np.linalg.solve(s, e[..., None])[..., 0], axis=1)
    nu = STUDENT_FREEDOM
    return np.asarray(-0.5 * ((nu + 3.0) * np.log1p(square / (nu - 2.0)) + np.linalg.slogdet(s)[1]))


def outage_pairs(
    before: ConfiguredRun, after: ConfiguredRun, begin: float, end: float
) -> Mapping[float, FloatArray]:
    """Return squared errors at the ends of the same outages under two filters, (w, 2), m², by length, s.

    A drive of ten minutes has two outages of a minute in its last part, by which no change can be judged. Here are
    those of the whole time given, and again those half a window later.
    """
    pairs = {}
    for seconds in OUTAGE_LENGTHS:
        errors = []
        for run in (before, after):
            both: list[FloatArray] = []
            for late in (0.0, 0.5 * (seconds + RECOVERY_TIME)):
                windows = [
                    (a + late, b + late)
                    for a, b in outage_windows(run.stretches, seconds, begin=begin, end=end - late)
                ]
                found = _at_ends(run, np.array(windows)) if windows else None
                both.append(np.zeros(0) if found is None else found.square)
            errors.append(np.concatenate(both))
        if len(errors[0]) == len(errors[1]) > 1:
            pairs[seconds] = np.stack(errors, axis=-1)
    return pairs
