"""Whether a reference turns while the vehicle stands: then its attitude is wrong, and no filter's is judged by it.

A vehicle that stands turns, if at all, as its gyroscopes show. Over windows at rest the mean turn rates about one axis
of the reference, r, and of the gyroscopes, g, each less its mean over all windows, are related by

    g = s r + noise       ŝ = Σ g r / Σ r²       var ŝ = Σ (g − ŝ r)² / ((n − 2) Σ r²)

with s = 1 where the vehicle turned, whatever constant bias the gyroscopes have, and s = 0 where the reference alone
did. The scatter of the gyroscopes is their own: no configuration plays a part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.probability import student_quantile
from models.robust import normal_sd
from tuner.consistency.drive_scores import as_output, as_truth, settled
from tuner.consistency.output_errors import in_axes_of
from tuner.consistency.scores import FALSE_ALARM_RATE
from tuner.consistency.trajectory_alignment import at_times
from tuner.consistency.velocity_of_positions import MATTERING_SHARE
from tuner.formats.customary_units import digits
from tuner.formats.reference_words import wrong_attitude_text
from tuner.navigation.data import Solution
from tuner.navigation.drive.run import Stretch
from tuner.segments.stand_stills import runs
from tuner.types.records import Reference

WINDOW_LENGTH = 5.0
"""Length of a window, s: short against stands, long against the stamps and the noise of attitudes."""
STANDING_SPEED = 0.3
"""Speed of the filter below which the vehicle stands, m/s: some sds of a velocity between fixes."""
REST_MARGIN = 1.0
"""Time of a stand before its first window and after its last one, s: the clocks may differ by a part of it."""
SWAY_TURN = np.radians(0.1)
"""Turn in a window of a vehicle that stands with people in it, rad; by the gyroscopes, beyond that of most windows."""
STANDING_SDS = 4.0
"""The same in robust sds of the gyroscopes' turns over all windows; where more show, the vehicle creeps."""
SELECTION_ROUNDS = 3
"""Times that windows are left out: a vehicle that creeps in many of them widens the scatter."""
MIN_WINDOWS = 4
"""Least number of windows at rest: two degrees of freedom for the scatter of the gyroscopes."""
MAX_SHARE_SHOWN = 0.5
"""Share of the turn of a reference that gyroscopes show, its interval within ±: the vehicle did not turn so."""
STATED_SDS = 5.0
"""Turns in a stand, in the sds that the reference states of the attitudes at both ends, which are no chance."""
AXIS_NAMES = ("roll", "pitch", "heading")
"""The turns about forward, right and down."""


def without_wrong_attitude(
    reference: Reference, stretches: Sequence[Stretch], solutions: Sequence[Solution]
) -> tuple[Reference, str]:
    """Return a reference without attitudes where they turn while the vehicle stands, and how much; "" where not.

    Parameters
    ----------
    reference : Reference
        On the clock of the filter.
    stretches, solutions : sequences of Stretch and Solution
        Of the drive, filtered.
    """
    pairs = zip(stretches, solutions, strict=True)
    rests = standing(np.vstack([np.zeros((0, 13)), *(_rests(reference, *pair) for pair in pairs)]))
    if len(rests) < MIN_WINDOWS:
        return reference, ""
    begin, turn, by_gyros, sd, stated = rests[:, 0], *np.split(rests[:, 1:], 4, axis=1)
    stand = np.concatenate([[0], np.cumsum(np.diff(begin) > 1.5 * WINDOW_LENGTH)])
    wrong, surely = [], student_quantile(1.0 - FALSE_ALARM_RATE, len(rests) - 2.0)
    for i, axis in enumerate(AXIS_NAMES):
        sums = np.bincount(stand, turn[:, i])
        longest = int(np.argmax(np.abs(sums)))
        inside, size = stand == longest, abs(sums[longest])
        chance = STATED_SDS * np.sqrt(2.0) * stated[inside, i].max()
        if size <= max(chance, MATTERING_SHARE * sd[inside, i].min()):
            continue
        share, share_sd = _share_shown(turn[:, i], by_gyros[:, i])
        if abs(share) + surely * share_sd < MAX_SHARE_SHOWN:
            length = WINDOW_LENGTH * np.count_nonzero(inside)
            wrong.append(
                f"its {axis} by {_degrees(size)} in {length:.0f} s, of which the gyroscopes show {100.0 * share:.0f} ± "
                f"{100.0 * 2.0 * share_sd:.0f} %, and its sds allow {_degrees(stated[inside, i].max())}"
            )
    if not wrong:
        return reference, ""
    return replace(reference, rpy=np.full_like(reference.rpy, np.nan)), wrong_attitude_text(wrong)


def standing(rests: FloatArray) -> FloatArray:
    """Return the windows, as of `_rests`, in which gyroscopes turn as in most of them; maybe none at all."""
    for _ in range(SELECTION_ROUNDS):
        if len(rests) < MIN_WINDOWS:
            break
        turning = np.abs(rests[:, 4:7] - np.median(rests[:, 4:7], axis=0))
        usual = np.array([normal_sd(column) for column in turning.T])
        rests = rests[(turning <= np.maximum(STANDING_SDS * usual, SWAY_TURN)).all(axis=1)]
    return rests


def _rests(reference: Reference, stretch: Stretch, solution: Solution) -> FloatArray:
    """Return windows at rest: begin, turns of reference and gyroscopes, sds of filter and reference; (w, 13), rad."""
    rows = settled(stretch, solution)
    if len(rows) < 2:
        return np.zeros((0, 13))
    mine = as_output(solution, rows)
    theirs, _ = in_axes_of(at_times(as_truth(reference), mine.t), mine)
    known = np.isfinite(theirs.quat_nb).all(axis=1) & np.isfinite(mine.vel_n).all(axis=1)
    moves = ~known | (np.linalg.norm(mine.vel_n, axis=1) >= STANDING_SPEED)
    spans = [(mine.t[a], mine.t[b - 1]) for a, b in runs(~moves, [(0, len(moves))])]
    first = np.concatenate(
        [
            np.zeros(0),
            *(
                np.arange(a + REST_MARGIN, b - REST_MARGIN - WINDOW_LENGTH + 1e-6, WINDOW_LENGTH)
                for a, b in spans
            ),
        ]
    )
    begin, end = np.searchsorted(mine.t, first), np.searchsorted(mine.t, first + WINDOW_LENGTH - 1e-6)
    whole = mine.t[end] - mine.t[begin] < 1.5 * WINDOW_LENGTH
    begin, end = begin[whole], end[whole]
    turn = rotation.rotvec_from_quat(
        rotation.quat_multiply(rotation.quat_conjugate(theirs.quat_nb[begin]), theirs.quat_nb[end])
    )
    steps = stretch.fixes.after[rows]
    angle = np.vstack([np.zeros(3), np.cumsum(stretch.steps.increments[:, :3], axis=0)])
    by_gyros = angle[steps[end]] - angle[steps[begin]]
    c_nb = rotation.mat_from_quat(mine.quat_nb[begin])
    in_body = np.einsum("nki,nkl,nlj->nij", c_nb, mine.covariance[begin, 6:9, 6:9], c_nb)
    sd = np.sqrt(np.einsum("nii->ni", in_body))
    stated = np.nan_to_num(np.sqrt(np.einsum("nii->ni", theirs.covariance[begin, 6:9, 6:9])))
    return np.hstack([mine.t[begin, None], turn, by_gyros, sd, stated])


def _share_shown(turn: FloatArray, by_gyros: FloatArray) -> tuple[float, float]:
    """Return the share of a reference's turns that gyroscopes show, and its sd."""
    r, g = turn - turn.mean(), by_gyros - by_gyros.mean()
    power = float(r @ r)
    if power <= 0.0:
        return 0.0, np.inf
    share = float(g @ r) / power
    left = g - share * r
    return share, float(np.sqrt(left @ left / ((len(r) - 2) * power)))


def _degrees(angle: float) -> str:
    return f"{digits(float(np.degrees(angle)), 2)}°"
