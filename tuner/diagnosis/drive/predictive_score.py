"""How well a configured filter predicts a part of a drive: positions in outages, and with fixes.

In windows of 10, 30 and 60 s all fixes are withheld; the error e of the position at their ends, against the reference
or, where there is none, the withheld fix, is compared with the covariance S that the filter states (that of the fix
included)::

    ln p = −½ [(ν + 3) ln(1 + eᵀS⁻¹e/(ν − 2)) + ln det S]          ν = 5

Student's density with the covariance S: a proper score, which both large errors and wrong covariances lower, and which
a few windows do not decide. The filter is the one that `navigate` runs, clocks included. It runs through the drive
once; every outage branches off from it, as if it were the only one. A reference may be that of the antenna: then the
filter is judged by where it has the antenna, and otherwise fixes are by where they have the unit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.earth import ned_between
from tuner.consistency.drive_scores import blocks, reference_at
from tuner.consistency.score_drive import CLAIMED_LENGTHS
from tuner.consistency.scores import DIVERGED_REFUSED_SHARE, innovation_scores
from tuner.diagnosis.drive.configured_run import ConfiguredRun, antenna
from tuner.diagnosis.drive.outage_errors import (
    OutageErrors,
    errors_at,
    log_density,
    position_errors,
    with_outages,
)
from tuner.navigation.data import GATED, Solution
from tuner.navigation.drive.run import (
    RECOVERY_TIME,
    Stretch,
    outage_windows,
)

INNOVATION_RATIOS = (0.8, 1.25)
"""Innovations ÷ predicted sds that `navigate` finds consistent on a drive of ten minutes."""


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
    innovations : tuple of float
        Innovations ÷ predicted sds, root mean square, of positions and of velocities; what no fix has is left out.
    bands : tuple of (float, float)
        Ratios that do not speak against the filter: by blocks of the drive as in `navigate`, and `INNOVATION_RATIOS`.
    """

    outages: tuple[OutageErrors, ...]
    tracking_rms: float
    tracking: FloatArray
    fixes_rms: float | None = None
    innovations: tuple[float, ...] = ()
    bands: tuple[tuple[float, float], ...] = ()

    @property
    def innovation_distance(self) -> float:
        """Largest |ln| of the innovation ratios: 0 where all are 1, and where they lie within `INNOVATION_RATIOS`."""
        low, high = INNOVATION_RATIOS
        far = [abs(np.log(one)) for one in self.innovations if not low <= one <= high]
        return float(max(far, default=0.0))

    @property
    def contradicted(self) -> bool:
        """Whether innovations speak against the filter: outside `bands`."""
        bands = self.bands or (INNOVATION_RATIOS,) * len(self.innovations)
        return any(not low <= one <= high for one, (low, high) in zip(self.innovations, bands, strict=True))

    def follows(self, ratio: float = 1.0) -> bool:
        """Whether positions err no more than the fixes alone, times a ratio, as far as a reference tells."""
        return self.fixes_rms is None or self.tracking_rms <= ratio * self.fixes_rms

    @property
    def nats(self) -> float:
        """Log density of all outages and of all blocks with fixes."""
        return float(sum(one.log_density.sum() for one in self.outages) + self.tracking.sum())


def predictive_score(run: ConfiguredRun, begin: float, end: float) -> PredictiveScore | None:
    """Score a filter between two times on the clock of the inertial unit, s; None if it is lost or no outage fits."""
    stretches = tuple(_until(s, end) for s in run.stretches if s.fixes.t[0] < end)
    run = replace(run, stretches=stretches)
    windows = {
        seconds: found
        for seconds in CLAIMED_LENGTHS
        if len(found := outage_windows(stretches, seconds, begin=begin, end=end)) > 1
    }
    solutions, ends = with_outages(run, [window for each in windows.values() for window in each])
    refused = np.concatenate([one.use[one.t >= begin, 0] == GATED for one in solutions])
    if np.mean(refused) > DIVERGED_REFUSED_SHARE:
        return None
    outages = [errors_at(run, seconds, each, ends) for seconds, each in windows.items()]
    tracked = [_tracked(run, s, solution, begin) for s, solution in zip(stretches, solutions, strict=True)]
    t, square, density, alone = (np.concatenate(part) for part in zip(*tracked, strict=True))
    good = [one for one in outages if one is not None]
    if not good or len(good) < len(outages) or not len(t) or not np.isfinite(density).all():
        return None
    block = (t // RECOVERY_TIME).astype(int)
    means = np.array([density[block == one].mean() for one in np.unique(block)])
    fixes_rms = None if run.reference is None else _rms(alone)
    ratios, bands = _innovation_ratios(stretches, solutions, begin)
    return PredictiveScore(tuple(good), _rms(square), means, fixes_rms, ratios, bands)


def _innovation_ratios(
    stretches: Sequence[Stretch], solutions: Sequence[Solution], begin: float
) -> tuple[tuple[float, ...], tuple[tuple[float, float], ...]]:
    """Return innovations ÷ predicted sds, root mean square, of positions and velocities after a time, s, and bands."""
    groups = [
        block
        for stretch, solution in zip(stretches, solutions, strict=True)
        for block in blocks(solution, np.flatnonzero(solution.t >= max(begin, stretch.settled)))
    ]
    scores = innovation_scores(
        [one.innovation[rows] for one, rows in groups],
        [one.innovation_covariance[rows] for one, rows in groups],
        [one.use[rows] for one, rows in groups],
    )
    found = [one for one in scores if one.name != "nis" and one.ratio > 0.0]
    low, high = INNOVATION_RATIOS
    ends = [[float(np.sqrt(end / one.dof)) for end in one.band] for one in found]
    return tuple(one.ratio for one in found), tuple((min(low, a), max(high, b)) for a, b in ends)


def _rms(square: FloatArray) -> float:
    """Return the root of the mean of squares that are known; zero where none is."""
    known = square[np.isfinite(square)]
    return float(np.sqrt(known.mean())) if len(known) else 0.0


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


def _tracked(
    run: ConfiguredRun, stretch: Stretch, solution: Solution, begin: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return times, squared errors and log densities of positions with fixes, where the filter has settled.

    A fix after as long a time without any as the shortest outage shows an outage, and is left out.
    The last of the four are squared errors of the fixes themselves, zero without a reference; where a reference has a
    gap, these and those of the filter are NaN, and the density is that of the fixes.
    """
    aided = np.diff(solution.t, prepend=-np.inf) < min(CLAIMED_LENGTHS)
    rows = np.flatnonzero((solution.t >= max(begin, stretch.settled)) & aided)
    error, covariance = position_errors(run, solution, rows)
    good = np.isfinite(error).all(axis=1)
    if run.reference is None:  # a refused fix does not say where the vehicle is
        good &= solution.use[rows, 0] > 0
    error, covariance, rows = error[good], covariance[good], rows[good]
    square, off = np.sum(error**2, axis=1), np.zeros(len(rows))
    if run.reference is not None:
        alone = ned_between(reference_at(run.reference, solution.t[rows])[0], stretch.fixes.llh[rows])
        if not run.of_antenna:
            alone = alone + antenna(run.settings, solution, rows)
        off = np.sum(alone**2, axis=1)
    return solution.t[rows], np.where(np.isfinite(off), square, np.nan), log_density(error, covariance), off
