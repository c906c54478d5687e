"""Errors of positions at the ends of outages: each branches off the filter with all fixes, as if it were the only one.

A reference may be that of the antenna: then the filter is judged by where it has the antenna, and otherwise fixes are
by where they have the unit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.earth import ned_between
from models.strapdown import NavigationState
from tuner.consistency.correlated_errors import independent_share
from tuner.consistency.drive_scores import reference_at, stated
from tuner.consistency.outage_ratio import components, ratio_interval
from tuner.diagnosis.drive.configured_run import ConfiguredRun, antenna
from tuner.formats.outage_words import PREDICTED_RATIOS, outage_words
from tuner.navigation import engine
from tuner.navigation.data import Solution, Steps
from tuner.navigation.drive.run import (
    Stretch,
    initial_estimates,
    initial_state,
)
from tuner.navigation.settings import FilterSettings

Window = tuple[float, float]
"""Begin and end of an outage, s."""

STUDENT_FREEDOM = 5.0
"""ν: heavy tails in which an error of five sds costs 8 nats, not 12."""
BY_FIX = (
    "t",
    "parameters",
    "covariance",
    "innovation",
    "innovation_covariance",
    "use",
    "further_covariance",
)
"""What a solution has at every fix, beside the state."""
WINDOW_SPACING: Mapping[float, float] = MappingProxyType({10.0: 10.0, 30.0: 20.0, 60.0: 40.0})
"""Time between the begins of outages, by length, s: closer ones tell hardly more."""
MAX_LATE_FIX = 0.2
"""Share of a window, beyond half a second, by which its last withheld fix may be early."""


@dataclass(frozen=True)
class OutageErrors:
    """Errors at the ends of w outages of one length.

    Attributes
    ----------
    seconds : float
        Length.
    square, stated : ndarray, shape (w,)
        Squared errors and their predictions, m².
    log_density : ndarray, shape (w,)
        Of the errors.
    freedom : float
        Components that an error counts for, 1 to 3.
    begin : ndarray, shape (w,)
        Begins of the outages, s.
    normal : ndarray, shape (w, 3)
        Errors over their rms prediction.
    """

    seconds: float
    square: FloatArray
    stated: FloatArray
    log_density: FloatArray
    freedom: float = 1.0
    begin: FloatArray = field(default_factory=lambda: np.zeros(0))
    normal: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))

    @property
    def rms(self) -> float:
        """Root mean square of the errors, m."""
        return float(np.sqrt(np.mean(self.square)))

    @property
    def ratio(self) -> float:
        """Errors ÷ stated sds, root mean square."""
        return float(np.sqrt(np.mean(self.square / self.stated)))

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of `ratio` at 95 %."""
        share = independent_share(self.normal) if len(self.normal) > 1 else 1.0
        return ratio_interval(list(self.square / self.stated), self.freedom, share)

    def since(self, t: float) -> OutageErrors:
        """Return those that begin at a time, s, or later."""
        late = self.begin >= t
        rows = {
            name: getattr(self, name)[late] for name in ("square", "stated", "log_density", "begin", "normal")
        }
        return replace(self, **rows)

    @property
    def predicted(self) -> bool:
        """Whether the ratio is within `PREDICTED_RATIOS`, or these windows cannot tell it from 1."""
        (least, most), (low, high) = PREDICTED_RATIOS, self.interval
        return least <= self.ratio <= most or low <= 1.0 <= high

    @property
    def refuted(self) -> bool:
        """Whether these windows show the ratio to be outside `PREDICTED_RATIOS`."""
        (least, most), (low, high) = PREDICTED_RATIOS, self.interval
        return low > most or high < least

    @property
    def text(self) -> str:
        """Errors and predictions, their ratio, and how well these windows tell it, in words."""
        predicted = float(np.sqrt(np.mean(self.stated)))
        return outage_words(self.seconds, self.rms, predicted, self.ratio, self.interval, len(self.square))


def with_outages(
    run: ConfiguredRun, windows: Sequence[Window]
) -> tuple[tuple[Solution, ...], Mapping[Window, Solution | None]]:
    """Filter with all fixes, and from there through each window; return also the prediction of its last fix."""
    solutions: list[Solution] = []
    ends: dict[Window, Solution | None] = dict.fromkeys(windows)
    for stretch in run.stretches:
        x, p = initial_estimates(run.settings, stretch, solutions[-1] if solutions else None)
        now, fixes = initial_state(run.settings, stretch, x), stretch.fixes
        at = {
            window: (int(first), int(last))
            for window, first, last in zip(
                windows,
                *np.searchsorted(fixes.t, np.array(windows).reshape(-1, 2).T, side="right"),
                strict=True,
            )
            if 0 < first < last
            and window[1] - fixes.t[last - 1] <= MAX_LATE_FIX * (window[1] - window[0]) + 0.5
        }
        parts, first, refused = [], 0, fixes.refused_since
        for last in [*sorted({begun for begun, _ in at.values()} - {len(fixes)}), len(fixes)]:
            stretch = replace(stretch, fixes=replace(fixes, refused_since=refused))
            part = _filtered_part(run.settings, now, stretch, np.arange(first, last), x, p)
            refused = part.refused_since(refused)
            now, x, p, first = part.final, part.final_parameters, part.final_covariance, last
            parts.append(part)
            here = {window: until - 1 for window, (begun, until) in at.items() if begun == last}
            if here:
                rows = np.unique(list(here.values()))
                blind = _filtered_part(run.settings, now, stretch, rows, x, p, since=last)
                ends |= {one: _rows(blind, np.flatnonzero(rows == row)) for one, row in here.items()}
        solutions.append(_joined(parts))
    return tuple(solutions), ends


def _filtered_part(
    settings: FilterSettings,
    now: NavigationState,
    stretch: Stretch,
    which: NDArray[np.intp],
    x: FloatArray,
    p: FloatArray,
    *,
    since: int | None = None,
) -> Solution:
    """Filter on with some of the fixes of a stretch; from the fix before `since` on they are withheld."""
    steps, before = stretch.steps, int(which[0]) if since is None else since
    begin = int(stretch.fixes.after[before - 1]) if before else 0
    own = stretch.fixes.rows(which)
    own = replace(own, after=own.after - begin, withheld=own.withheld | (since is not None))
    last = int(which[-1])
    to_the_end = last == len(stretch.fixes) - 1 and since is None
    done = slice(begin, len(steps.dt) if to_the_end else int(stretch.fixes.after[last]))
    start = steps.start + float(steps.dt[:begin].sum())
    part = Steps(start, steps.dt[done], steps.increments[done])
    return engine.run(settings, now, part, own, parameters=x, covariance=p)


def _joined(parts: Sequence[Solution]) -> Solution:
    """Return solutions of parts that follow one another as one."""
    state = NavigationState(
        *(np.concatenate([getattr(one.state, name) for one in parts]) for name in ("llh", "vel_n", "quat_nb"))
    )
    whole = {name: np.concatenate([getattr(one, name) for one in parts]) for name in BY_FIX}
    return _with_fixes(parts[-1], state, whole)


def _rows(solution: Solution, which: NDArray[np.intp]) -> Solution:
    """Return some rows of a solution."""
    state = NavigationState(*(getattr(solution.state, name)[which] for name in ("llh", "vel_n", "quat_nb")))
    return _with_fixes(solution, state, {name: getattr(solution, name)[which] for name in BY_FIX})


def _with_fixes(solution: Solution, state: NavigationState, columns: Mapping[str, Any]) -> Solution:
    """Return a solution with other rows, one a fix."""
    return replace(solution, state=state, **columns)


def position_errors(
    run: ConfiguredRun, solution: Solution, rows: NDArray[np.intp]
) -> tuple[FloatArray, FloatArray]:
    """Return errors of positions (r, 3) and covariances (r, 3, 3), against the reference, where it is not the fixes."""
    innovation = solution.innovation[rows, :3], solution.innovation_covariance[rows, :3, :3]
    if run.reference is None:
        return innovation
    t = solution.t[rows]
    error = ned_between(reference_at(run.reference, t)[0], solution.state.llh[rows])
    if run.of_antenna:
        error = error - antenna(run.settings, solution, rows)
    covariance = solution.covariance[rows, :3, :3] + stated(run.reference, t)[:, :3, None] * np.eye(3)
    there = np.asarray(np.isfinite(error).all(axis=1))
    return (
        np.where(there[:, None], error, innovation[0]),
        np.where(there[:, None, None], covariance, innovation[1]),
    )


def errors_at(
    run: ConfiguredRun, seconds: float, windows: Sequence[Window], ends: Mapping[Window, Solution | None]
) -> OutageErrors | None:
    """Return the errors at the ends of outages of one length; None where a filter is lost."""
    found = {window: end for window in windows if (end := ends[window]) is not None}
    if not found:
        return None
    whole = _joined(list(found.values()))
    e, s = position_errors(run, whole, np.arange(len(whole.t)))
    good = np.isfinite(e).all(axis=1)
    e, s, begin = e[good], s[good], np.array([first for first, _ in found])[good]
    if not len(e) or not np.isfinite(s).all():
        return None
    stated = np.trace(s, axis1=1, axis2=2)
    return OutageErrors(
        seconds,
        np.sum(e**2, axis=1),
        stated,
        log_density(e, s),
        float(np.mean(components(s))),
        begin,
        e / np.sqrt(stated)[:, None],
    )


def log_density(e: FloatArray, s: FloatArray) -> FloatArray:
    """Return the log density of errors (w, 3) under Student's law with covariances (w, 3, 3), up to a constant."""
    square = np.sum(e * np.linalg.solve(s, e[..., None])[..., 0], axis=1)
    nu = STUDENT_FREEDOM
    return np.asarray(-0.5 * ((nu + 3.0) * np.log1p(square / (nu - 2.0)) + np.linalg.slogdet(s)[1]))


def all_outages(run: ConfiguredRun, begin: float, end: float) -> Mapping[float, OutageErrors]:
    """Return errors in outages of a drive between two times, by length, s, one after another (`WINDOW_SPACING`).

    A drive of ten minutes has two outages of a minute in its last part, by which nothing can be judged.
    """
    windows = {
        seconds: [
            (float(first), float(first) + seconds)
            for s in run.stretches
            for first in np.arange(max(begin, s.settled), min(end, s.fixes.t[-1]) - seconds, spacing)
        ]
        for seconds, spacing in WINDOW_SPACING.items()
    }
    _, ends = with_outages(run, [one for each in windows.values() for one in each])
    found = {s: errors_at(run, s, each, ends) for s, each in windows.items()}
    return {s: one for s, one in found.items() if one is not None}


def outage_pairs(
    before: Mapping[float, OutageErrors], after: Mapping[float, OutageErrors]
) -> Mapping[float, FloatArray]:
    """Return squared errors in the same outages (`all_outages`) under two filters, (w, 2), m², by length, s."""
    return {
        seconds: np.stack([before[seconds].square, after[seconds].square], axis=-1)
        for seconds in WINDOW_SPACING
        if seconds in before
        and seconds in after
        and len(before[seconds].square) == len(after[seconds].square) > 1
    }
