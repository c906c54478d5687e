"""Gain of the findings on the last 40 % of a drive, with parameters from the first 60 % of the scored fixes.

Both filters, before and after, run over the whole drive with fixed parameters. Of the fixes that both used in the
last part::

    ln p = −½ Σ (z²/f + ln 2πf)          mean NIS, its lag-1 correlation
    outage: fixes withheld for 30 and 60 s, horizontal distance of the last one from its prediction, rms
    position with fixes against the reference, where the drive has one that is right, rms

Outages are compared in pairs, squared errors aᵢ before and bᵢ after; with their rms values a and b the change is b −
a = mean (bᵢ − aᵢ)/(a + b), its interval that of Student for the mean: a drive has few windows, and a bootstrap over
four of them calls one unchanged filter in ten worse.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from models.arrays import FloatArray
from models.earth import ned_between
from models.effects.drive.gnss import ClockDrift, TimeOffset, middle_of
from tuner.consistency.drive_scores import reference_at
from tuner.consistency.reference_check import trusted_reference
from tuner.diagnosis.drive.causes.reported_sd import reported_levels, sd_model_parameters, updated_values
from tuner.diagnosis.drive.hypothesis import FilterRun, Hypothesis, run_filter
from tuner.diagnosis.drive.hypothesis_tests import noise_hypothesis_of
from tuner.diagnosis.drive.linear_model.noise_fit import maximize_likelihood
from tuner.diagnosis.drive.linear_model.noise_parameters import noise_parameters, present
from tuner.diagnosis.drive.score_tests import FITTED_SHARE
from tuner.diagnosis.drive.search import SearchResult, refit_constants
from tuner.linear_run.likelihood import as_configured, evaluate
from tuner.navigation.data import WITHHELD
from tuner.navigation.drive.run import RECOVERY_TIME, navigate
from tuner.navigation.fix_sd_model import GNSS_NOISE_SCALE
from tuner.types import Compensation, Gain, Parameter
from tuner.types.records import DataError, Drive

OUTAGE_DURATIONS = (30.0, 60.0)
"""Durations of the outages, s: those that data sheets of GNSS/INS state."""
MIN_ROWS = 30
"""Least number of rows that a gain is measured on; chosen so that it is not that of a few fixes."""


def held_out_gain(drive: Drive, outcome: SearchResult) -> Gain | None:
    """Return the gain of all accepted causes; None where there is none, or the drive is too short.

    Parameters
    ----------
    drive : Drive
        In the axes of the sensor.
    outcome : SearchResult
        Of the search.
    """
    if not outcome.accepted:
        return None
    final = outcome.final.linearized
    t = final.t[final.counted.any(axis=1)]
    if not len(t):
        return None
    cut = float(t[0] + FITTED_SHARE * (t[-1] - t[0]))
    try:
        after = run_filter(drive, fitted_before(drive, outcome, cut))
    except DataError:
        return None
    before = outcome.base
    rows_b, rows_a = _shared_rows(before, after, cut, len(drive.gnss))
    if np.count_nonzero(rows_b) < MIN_ROWS:
        return None
    likelihood = [_scores(each, rows) for each, rows in ((before, rows_b), (after, rows_a))]
    user = {
        "nis": (likelihood[0][1], likelihood[1][1]),
        "innovation_lag1_correlation": (likelihood[0][2], likelihood[1][2]),
    }
    for horizon in OUTAGE_DURATIONS:
        user |= _outage_figures(before, after, cut, horizon)
    user |= _against_reference(drive, before, after, cut)
    n = int(np.count_nonzero(rows_b.any(axis=1)))
    return Gain(
        "60/40", likelihood[0][0] / n, likelihood[1][0] / n, likelihood[1][0] - likelihood[0][0], user=user
    )


def fitted_before(drive: Drive, outcome: SearchResult, cut: float) -> Hypothesis:
    """Return the final hypothesis with its values fitted to the fixes before a time."""
    final = outcome.final.hypothesis
    kept = drive.gnss.t < cut
    inertial = drive.imu_t < cut + 1.0
    part = replace(
        drive, imu_t=drive.imu_t[inertial], rates=drive.rates[inertial], gnss=drive.gnss.rows(kept)
    )
    own = replace(
        final,
        position_out=final.position_out[kept],
        velocity_out=final.velocity_out[kept],
        not_looked_at=final.not_looked_at[kept],
        compensation=about_middle(final.compensation, drive.gnss.t, part.gnss.t),
    )
    run = refit_constants(part, run_filter(part, own), outcome.shifts)
    compensation = run.hypothesis.compensation
    values = compensation.of(GNSS_NOISE_SCALE)
    if any(one.cause == GNSS_NOISE_SCALE for one in outcome.accepted):
        noise, levels = noise_hypothesis_of(run, outcome.shifts), reported_levels(run.linearized, values)
        names = present(noise, sd_model_parameters(values), levels)
        if names:
            fitted = updated_values(values, maximize_likelihood(noise, noise_parameters(names, levels)))
            compensation = compensation.with_values(
                {Parameter(GNSS_NOISE_SCALE, name): value for name, value in fitted.items()}
            )
    return replace(final, compensation=about_middle(compensation, part.gnss.t, drive.gnss.t))


def about_middle(compensation: Compensation, own: FloatArray, other: FloatArray) -> Compensation:
    """Return what shifts fixes of a drive by as much as the compensation does of a part of that drive, or the reverse.

    A clock that drifts by `rate` is counted from the middle of the fixes: t − delay − rate (t − t₀).

    Parameters
    ----------
    compensation : Compensation
        Of fixes with the stamps `own`.
    own, other : ndarray
        Stamps of the fixes that it is of, and of those that the answer is of, s.
    """
    drift = compensation.of(ClockDrift.name)
    if not drift:
        return compensation
    moved = drift["rate"] * (middle_of(other) - middle_of(own))
    delay = compensation.of(TimeOffset.name).get("delay", 0.0)
    return compensation.with_values({Parameter(TimeOffset.name, "delay"): delay + moved})


def _shared_rows(
    before: FilterRun, after: FilterRun, cut: float, count: int
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the rows after a time that both runs used, as rows of each; shapes (k, 6)."""
    both = np.ones((count, 6), dtype=bool)
    for each in (before, after):
        mine = np.zeros((count, 6), dtype=bool)
        mine[each.index] = each.linearized.counted & (each.linearized.t > cut)[:, None]
        both &= mine
    return both[before.index], both[after.index]


def _scores(run: FilterRun, rows: NDArray[np.bool_]) -> tuple[float, float, float]:
    """Return log likelihood, mean square and lag-1 correlation of whitened innovations in rows."""
    likelihood = evaluate(as_configured(run.linearized))
    white = np.where(rows, likelihood.white, 0.0)
    value = -0.5 * float(np.sum(white[rows] ** 2 + np.log(2.0 * np.pi * likelihood.variance[rows])))
    square = float(np.sum(white**2))
    return value, square / int(np.count_nonzero(rows)), float(np.sum(white[1:] * white[:-1])) / square


def _outage_figures(
    before: FilterRun, after: FilterRun, cut: float, horizon: float
) -> dict[str, tuple[float, float]]:
    """Return the rms horizontal error at the end of outages, and the 95 % interval of its change."""
    last = float(before.linearized.t[-1])
    begins = np.arange(cut, last - horizon, horizon + RECOVERY_TIME)
    if len(begins) < 2:
        return {}
    windows = np.stack([begins, begins + horizon], axis=-1)
    first, second = (_outage_errors(each, windows) for each in (before, after))
    good = np.isfinite(first) & np.isfinite(second)
    if np.count_nonzero(good) < 2:
        return {}
    pairs = np.stack([first[good], second[good]], axis=-1)
    rms = np.sqrt(pairs.mean(axis=0))
    low, high = change_interval(pairs)
    name = f"outage_{horizon:.0f}s_horizontal"
    return {
        f"{name} [m]": (float(rms[0]), float(rms[1])),
        f"{name}_change_interval [m]": (low, high),
    }


def _against_reference(
    drive: Drive, before: FilterRun, after: FilterRun, cut: float
) -> dict[str, tuple[float, float]]:
    """Return rms errors of positions with fixes against a reference, and the 95 % interval of their change by blocks.

    Innovations can fall while positions become worse, where fixes err alike; a reference shows it.
    """
    if drive.reference is None:
        return {}
    reference, _ = trusted_reference(drive.reference, after.stretches, after.settings)
    if reference is None:
        return {}
    square = np.full((2, len(drive.gnss)), np.nan)
    for own, run in zip(square, (before, after), strict=True):
        t = np.concatenate([one.t for one in run.solutions])
        llh = np.concatenate([one.state.llh for one in run.solutions])
        own[run.index] = np.sum(ned_between(reference_at(reference, t)[0], llh) ** 2, axis=1)
    t = drive.gnss.t
    good = np.isfinite(square).all(axis=0) & (t > cut)
    block = (t[good] // RECOVERY_TIME).astype(int)
    pairs = np.array([square[:, good][:, block == one].mean(axis=1) for one in np.unique(block)])
    if len(pairs) < 2:
        return {}
    rms = np.sqrt(pairs.mean(axis=0))
    name = "position_against_reference"
    return {
        f"{name} [m]": (float(rms[0]), float(rms[1])),
        f"{name}_change_interval [m]": change_interval(pairs),
    }


def change_interval(pairs: FloatArray, level: float = 0.95) -> tuple[float, float]:
    """Return the interval of the change of an rms error from squared errors before and after, (n, 2)."""
    n, change = len(pairs), pairs[:, 1] - pairs[:, 0]
    middle = float(change.mean())
    half = float(student.ppf(0.5 * (1.0 + level), n - 1) * change.std(ddof=1) / np.sqrt(n))
    whole = max(float(np.sqrt(pairs.mean(axis=0)).sum()), 1e-300)
    return (middle - half) / whole, (middle + half) / whole


def _outage_errors(run: FilterRun, windows: FloatArray) -> FloatArray:
    """Return the squared horizontal error at the last withheld fix of every window, NaN where there is none."""
    shift = run.hypothesis.compensation.value("time_offset", "delay")
    out = np.full(len(windows), np.nan)
    for solution in navigate(run.stretches, run.settings, windows - shift):
        for i, (begin, end) in enumerate(windows - shift):
            inside = (solution.t > begin) & (solution.t <= end) & (solution.use[:, 0] == WITHHELD)
            inside = np.flatnonzero(inside)
            if len(inside) and end - solution.t[inside[-1]] < 0.1 * (end - begin) + 0.5:
                out[i] = float(np.sum(solution.innovation[inside[-1], :2] ** 2))
    return out
