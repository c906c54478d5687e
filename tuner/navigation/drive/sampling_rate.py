"""Is the rate of the inertial samples high enough for the motion? The same integrated at half the rate would tell.

Two steps are joined, once after each was corrected for coning and sculling, once as one step of twice the length. What
this changes on average is an angular rate and a force that no sensor measured. Integration errors grow with the square
of the step at least, so that the samples as they are err by up to a third of that change.
"""

from __future__ import annotations

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.strapdown import correct_increments
from tuner.navigation.data import Steps

DRIVE_PARTS = 20
"""Parts of a drive whose scatter tells a mean change from chance."""
MIN_SIGNIFICANCE = 5.0
"""Mean change in its standard errors: chance reaches that once in 10⁴ drives (Student's t of 19)."""
ERROR_SHARE = 1.0 / 3.0
"""Share of the change by half the rate that the rate itself errs by: e(2h) − e(h) = 3 e(h) for e ∝ h²."""


def rate_note(steps: Steps, bias_sd: FloatArray) -> str | None:
    """Return a note where the rate is too low for the motion: errors beyond the biases, of sds (6,); else None."""
    pairs = len(steps.dt) // 2 * 2
    if pairs < 4 * DRIVE_PARTS:
        return None
    once, twice = steps.increments[:pairs], steps.increments[:pairs].reshape(-1, 2, 6).sum(axis=1)
    angle, push = _corrected(once)
    first = rotation.mat_from_rotvec(angle[::2])
    turn = rotation.rotvec_from_mat(first @ rotation.mat_from_rotvec(angle[1::2]))
    moved = push[::2] + (first @ push[1::2, :, None])[..., 0]
    error = np.hstack([turn, moved]) - np.hstack(_corrected(twice))
    lengths = steps.dt[:pairs].reshape(-1, 2).sum(axis=1)
    parts = np.array_split(np.arange(len(error)), DRIVE_PARTS)
    means = ERROR_SHARE * np.array([error[part].sum(axis=0) / lengths[part].sum() for part in parts])
    mean, sd = means.mean(axis=0), means.std(axis=0, ddof=1) / np.sqrt(DRIVE_PARTS)
    bad = (np.abs(mean) > MIN_SIGNIFICANCE * sd) & (np.abs(mean) > bias_sd)
    if not bad.any():
        return None
    rate, force = np.degrees(np.linalg.norm(mean[:3])), np.linalg.norm(mean[3:])
    return (
        f"{1.0 / np.median(steps.dt):.4g} Hz are too few for this motion: turning between the samples makes errors of "
        f" some {rate:.2g} deg/s and {force:.2g} m/s^2, beyond the biases; record at twice that rate or more"
    )


def _corrected(increments: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return rotation vectors and velocity increments of steps (n, 6), corrected for coning and sculling."""
    now = increments.T
    before = np.hstack([now[:, :1], now[:, :-1]])
    angle, push = correct_increments(tuple(now[:3]), tuple(now[3:]), tuple(before[:3]), tuple(before[3:]))
    return np.stack(angle, axis=-1), np.stack(push, axis=-1)
