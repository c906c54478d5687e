"""What scores a filter's settings: innovations that it states, or fixes less what it predicted, or its errors.

A filter that writes more often than it gets fixes shows its innovations without stating them: the last epoch before a
fix is its prediction. The position there, carried to the fix by velocity and acceleration, and its variance, carried
on as it grows, with that of the fix give the innovation and its variance. Their likelihood is that of the settings
[1]_. Where neither is known, the errors against a reference stand in: their score is best at the right settings, too,
as these have the least errors.

References
----------
.. [1] F. C. Schweppe, Evaluation of likelihood functions for Gaussian signals, IEEE Trans. Inf. Theory 11 (1965).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.arrays import FloatArray
from models.earth import ned_between
from models.robust import normal_sd
from tuner.consistency.output_errors import output_errors
from tuner.consistency.output_scores import settling_time
from tuner.external.inputs import Fixes
from tuner.types.filter_output import FilterOutput
from tuner.types.records import DataError

SAME_INSTANT = 1e-3
"""Stamps nearer than this are one, s: an epoch at a fix is taken as one after it."""
MAX_PREDICTION_SHARE = 0.3
"""Time from the last epoch to a fix, in intervals of fixes, up to which it is a prediction of it."""
MIN_EPOCHS = 60
"""Innovations from which settings follow: a tenth of their spread each of four numbers."""
ERROR_INTERVAL = 1.0
"""Shortest time between errors that are scored, s: between fixes they are one error."""
GROSS_RATIO = 8.0
"""Innovation, in units of the typical one of the filter as it is, beyond which a fix is taken for a gross outlier."""


@dataclass(frozen=True)
class Deviations:
    """Vectors that are white noise of known covariance where the settings are right.

    Attributes
    ----------
    kind : str
        ``innovations``, ``predictions of fixes`` or ``errors``.
    t : ndarray, shape (n,)
        s.
    z : ndarray, shape (n, d)
        m, m/s, rad.
    s : ndarray, shape (n, d, d)
        Predicted covariance.
    """

    kind: str
    t: FloatArray
    z: FloatArray
    s: FloatArray

    def rows(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> Deviations:
        """Return the innovations of some rows."""
        return Deviations(self.kind, self.t[which], self.z[which], self.s[which])

    def log_likelihood(self) -> FloatArray:
        """Return the logarithm of the density of each vector, up to a constant; shape (n,)."""
        squares = np.einsum("ni,ni->n", self.z, np.linalg.solve(self.s, self.z[..., None])[..., 0])
        return np.asarray(-0.5 * (squares + np.linalg.slogdet(self.s)[1]))

    def ratio(self) -> float:
        """Return true rms ÷ predicted sd."""
        squares = np.einsum("ni,ni->n", self.z, np.linalg.solve(self.s, self.z[..., None])[..., 0])
        return float(np.sqrt(squares.mean() / self.z.shape[1]))


def deviations_of(
    output: FilterOutput, fixes: Fixes, fix_factor: float, truth: FilterOutput | None
) -> Deviations:
    """Return what scores an output.

    Parameters
    ----------
    output : FilterOutput
        Of the program.
    fixes : Fixes
        That it was given.
    fix_factor : float
        On the sds of the fixes.
    truth : FilterOutput or None
        A better solution, where there is one.

    Raises
    ------
    DataError
        Where the output cannot be scored.
    """
    found = _stated(output) or _predictions(output, fixes, fix_factor) or errors_of(output, truth)
    if found is None or len(found.t) < MIN_EPOCHS:
        count = 0 if found is None else len(found.t)
        raise DataError(
            f"{output.name}: expected {MIN_EPOCHS} innovations, or positions with sds (sd_n, sd_e, sd_d) at epochs "
            f"between the fixes, or a reference in the drive, found {count}"
        )
    return found.rows(found.t > found.t[0] + settling_time(found.t))


def common(one: Deviations, other: Deviations) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows of two series of innovations that are of the same instants."""
    near = np.searchsorted(other.t, one.t - SAME_INSTANT).clip(0, len(other.t) - 1)
    same = np.abs(other.t[near] - one.t) < SAME_INSTANT
    return np.flatnonzero(same), near[same]


def without_outliers(found: Deviations) -> Deviations:
    """Return the vectors without gross outliers, by the typical size of each component."""
    sizes = np.abs(found.z) / np.sqrt(np.einsum("nii->ni", found.s))
    typical = normal_sd(sizes, axis=0)
    return found.rows((sizes < GROSS_RATIO * typical).all(axis=1))


def _stated(output: FilterOutput) -> Deviations | None:
    if not output.has_innovations:
        return None
    known = np.isfinite(output.innovation) & np.isfinite(np.einsum("kii->ki", output.innovation_covariance))
    often = np.flatnonzero(known.sum(axis=0) >= 0.5 * known.any(axis=1).sum())
    rows = np.flatnonzero(known[:, often].all(axis=1))
    s = output.innovation_covariance[rows][:, often][:, :, often]
    return Deviations("innovations", output.t[rows], output.innovation[rows][:, often], np.nan_to_num(s))


def _predictions(output: FilterOutput, fixes: Fixes, fix_factor: float) -> Deviations | None:
    if output.llh is None or not np.isfinite(output.vel_n).any():
        return None
    before = np.searchsorted(output.t, fixes.t - SAME_INSTANT) - 1
    ahead = fixes.t - output.t[before.clip(0)]
    near = (before > 0) & (ahead < MAX_PREDICTION_SHARE * np.median(np.diff(fixes.t)))
    rows = before[near]
    p = output.covariance[rows][:, :3, :3]
    if not len(rows) or not np.isfinite(np.einsum("nii->ni", p)).all():
        return None
    if np.isfinite(output.quat_nb[rows]).all():
        arm = rotation.mat_from_quat(output.quat_nb[rows]) @ fixes.lever_arm
    elif not fixes.lever_arm.any():
        arm = np.zeros((len(rows), 3))
    else:
        return None
    steps = output.t[rows] - output.t[rows - 1]
    gained = (output.vel_n[rows] - output.vel_n[rows - 1]) / steps[:, None]
    way = output.vel_n[rows] * ahead[near, None] + 0.5 * gained * ahead[near, None] ** 2 + arm
    z = ned_between(fixes.llh[near], output.llh[rows]) - way
    variance = np.einsum("nii->ni", output.covariance)[:, :3]
    growth = (variance[rows] - variance[rows - 1]).clip(0.0) * (ahead[near] / steps)[:, None]
    own = growth + (fix_factor * fixes.sd[near]) ** 2
    s = np.where(np.isfinite(p), p, 0.0) + own[:, :, None] * np.eye(3)
    return Deviations("predictions of fixes", fixes.t[near], z, s)


def errors_of(output: FilterOutput, truth: FilterOutput | None) -> Deviations | None:
    """Return the errors of an output where there is a better solution and sds of it."""
    if truth is None:
        return None
    run = output_errors(output, truth)
    known = np.isfinite(run.error) & (np.einsum("kii->ki", run.covariance) > 0.0)
    often = np.flatnonzero(known.mean(axis=0) > 0.5)
    if not len(often):
        return None
    rows = np.flatnonzero(known[:, often].all(axis=1))
    step = max(1, int(np.ceil(ERROR_INTERVAL / float(np.median(np.diff(run.t[rows]))))))
    rows = rows[::step]
    p = run.covariance[rows][:, often][:, :, often]
    return Deviations("errors", run.t[rows], run.error[rows][:, often], np.where(np.isfinite(p), p, 0.0))
