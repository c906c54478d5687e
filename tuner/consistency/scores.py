"""Is a filter consistent? Errors and innovations against the covariances that it predicts for them.

Every score is a mean square over its prediction, ideally 1, and is read as a ratio, its square root: true
rms ÷ predicted sd. Scores of one run are dependent, runs are not: with the scores s_g of G runs (or of blocks
of one drive), mean s and variance v,

    ν = min(2 s²/(v/G), number of squares)          χ² with ν degrees of freedom has this scatter
    interval of the ratio²                          s ν'/χ²_{1−α/2}(ν') … s ν'/χ²_{α/2}(ν')
    ν' = max(ν (z_{α/2}/t_{α/2}(G − 1))², G d)      v is itself an estimate; d the components of one square

A score is against the filter where the whole interval lies beyond 10 % from 1: `EQUIVALENCE_MARGIN`. α is 1 % over all
scores together (Bonferroni): `FALSE_ALARM_RATE`.

==============  ==========================================================================================
nees            eᵀ P⁻¹ e of position, velocity, attitude and total biases, while aided; of each block, and of each
                further state
nis             zᵀ S⁻¹ z of position and velocity fixes; nearly insensitive to a wrong Q
whiteness       autocorrelation of whitened innovations at lags 1 … 10
outage          |position error|² ÷ tr P after 10, 30, 60, 300 s without fixes
==============  ==========================================================================================

References
----------
.. [1] Y. Bar-Shalom, X. R. Li, T. Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001,
       ch. 5.4 (NEES, NIS, autocorrelation).
.. [2] F. E. Satterthwaite, An approximate distribution of estimates of variance components, Biometrics
       Bulletin 2 (1946).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri

from models.arrays import FloatArray
from models.probability import chi2_quantile, student_quantile
from tuner.consistency.outage_ratio import components, means_and_weights, ratio_interval, scatter_freedom
from tuner.consistency.verdicts import NOT_FINITE
from tuner.navigation.data import USED
from tuner.simulation.monte_carlo import Runs
from tuner.types import filter_output
from tuner.types.consistency import ERROR_UNITS, Consistency, Outage, RmsError, Score, Whiteness
from tuner.types.honesty import OUTAGE

Floats = NDArray[np.floating[Any]]

FALSE_ALARM_RATE = 0.01
"""Chance that any score of a right filter is called against it."""
EQUIVALENCE_MARGIN = 0.1
"""Relative error of an sd below which a filter counts as right: a ladder approximates flicker to some per cent."""
TEST_COUNT = 14
"""Scores that share `FALSE_ALARM_RATE`: NEES and its five blocks, NIS of three kinds, whiteness, four outages."""
OUTAGE_LENGTHS = (10.0, 30.0, 60.0, 300.0)
"""Lengths of outage that are scored, s: an underpass to a long tunnel."""
SETTLING_TIME = 120.0
"""Time after the start and after an outage that is not scored as aided, s: until errors of an outage have decayed."""
MAX_SCORED_EPOCHS = 60
"""Aided epochs of each run that are scored: more depend on each other and only cost time."""
MAX_LAG = 10
"""Largest lag, epochs, of the autocorrelation of innovations."""
MIN_PAIRS = 100
"""Products of components behind an autocorrelation below which it is not tested: 0.1 is then its standard error."""
BLOCKS: Mapping[str, slice] = MappingProxyType(
    {name: slice(3 * i, 3 * i + 3) for i, name in enumerate(filter_output.BLOCKS)}
)
"""Parts of the error whose NEES is scored, three components each, and their places among the errors of a run."""
INNOVATIONS = MappingProxyType({"nis": slice(0, 6), "nis_position": slice(0, 3), "nis_velocity": slice(3, 6)})
"""Scores of innovations, and their components."""
DIVERGED_RATIO = 20.0
"""True rms ÷ predicted sd, all runs together, from which a filter diverged: beyond any linear analysis of it."""
STRAYED_RATIO = 5.0
"""The same of one run from which that run diverged, where the median run is right: far beyond chance."""
DIVERGED_REFUSED_SHARE = 0.5
"""Share of fixes refused by the gate from which a filter diverged."""


def score(
    name: str,
    groups: Sequence[ArrayLike],
    dof: int,
    *,
    components: float | None = None,
    tests: int = TEST_COUNT,
) -> Score:
    """Score normalised squared errors that come in independent groups.

    Parameters
    ----------
    name : str
        What they are.
    groups : sequence of array_like
        Squares of each run, `dof` ideally each.
    dof : int
        What a square is ideally.
    components : float, optional
        Normal numbers behind a square; by default `dof`.
    tests : int
        Scores that share the family-wise error.
    """
    means, shares = means_and_weights(groups)
    mean = float(shares @ means)
    count = (components or dof) * sum(np.size(group) for group in groups)
    scattered = len(means) > 1 and mean > 0.0
    sure = effective = min(count, scatter_freedom(means, shares)) if scattered else count
    if 1 < len(means) < count:
        # The scatter of few groups is itself hardly known; each has one square of its own at least.
        tail = 0.5 * FALSE_ALARM_RATE / tests
        sure = effective * (ndtri(tail) / student_quantile(tail, len(means) - 1)) ** 2
        sure = min(max(sure, (components or dof) * len(means)), effective)
    return Score(name, mean, dof, float(effective), mean_band(dof, sure, tests=tests), float(sure))


def mean_band(dof: int, effective: float, *, tests: int = TEST_COUNT) -> tuple[float, float]:
    """Return the means of squares that do not speak against a filter: χ² with `effective` degrees, and the margin.

    Parameters
    ----------
    dof : int
        What a square is ideally.
    effective : float
        Degrees of freedom of the mean.
    tests : int
        Scores that share the family-wise error.
    """
    tail = 0.5 * FALSE_ALARM_RATE / tests
    low, high = (chi2_quantile(p, effective) / effective for p in (tail, 1.0 - tail))
    wide = (1.0 + EQUIVALENCE_MARGIN) ** 2
    return float(dof * low / wide), float(dof * high * wide)


def squares(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return eᵀ P⁻¹ e; shapes (..., n), (..., n, n) → (...)."""
    return np.asarray(np.sum(error * np.linalg.solve(covariance, error[..., None])[..., 0], axis=-1))


def evaluate(
    runs: Runs,
    outages: FloatArray,
    *,
    further: Mapping[str, slice] = MappingProxyType({}),
) -> Consistency:
    """Score simulated runs: NEES, NIS, whiteness of innovations, position in outages.

    Parameters
    ----------
    runs : Runs
        Errors and innovations.
    outages : ndarray, shape (w, 2)
        Begin and end of withheld fixes, s.
    further : mapping of str to slice
        Further states of the filter by name, and their places among the further errors of the runs.
    """
    tests = TEST_COUNT + len(further)
    chosen = scored_epochs(runs.t, outages)
    error, covariance = runs.error[:, chosen], runs.covariance[:, chosen].astype(float)
    if not (np.isfinite(runs.error).all() and np.isfinite(runs.covariance).all()):
        return Consistency(None, (), (), None, (), {}, 1.0, True, NOT_FINITE)
    blocks = [
        score(name, list(squares(error[..., own], covariance[..., own, own])), 3, tests=tests)
        for name, own in BLOCKS.items()
    ]
    for name, own in further.items():
        e, p = runs.further_error[:, chosen, own], runs.further_covariance[:, chosen, own, own]
        blocks.append(score(name, list(squares(e, p)), e.shape[-1], tests=tests))
    ends = {
        horizon: outage_epochs(runs.t, outages, horizon)
        for horizon in OUTAGE_LENGTHS
        if len(outages) and horizon <= np.diff(outages).max()
    }
    found = tuple(
        outage_score(h, list(runs.error[:, i, :3]), list(runs.covariance[:, i, :3, :3]), tests=tests)
        for h, i in ends.items()
    )
    gated = float(np.mean(runs.use == 2))
    each = squares(error, covariance)
    seen = list(runs.innovation), list(runs.innovation_covariance), list(runs.use)
    nees = score("nees", list(each), 15, tests=tests)
    return Consistency(
        nees,
        tuple(blocks),
        innovation_scores(*seen, tests=tests),
        whiteness(runs.t, *seen, tests=tests),
        found,
        rms_errors(error.reshape(-1, 15)),
        gated,
        gated > DIVERGED_REFUSED_SHARE
        or nees.ratio > DIVERGED_RATIO
        or some_strayed(np.sqrt(each.mean(axis=1) / 15)),
    )


def rms_errors(error: FloatArray) -> dict[str, RmsError]:
    """Return the rms errors of position, velocity and attitude over the rows of (n, 15) in which they are known."""
    found = {}
    for name, unit in ERROR_UNITS.items():
        part = error[:, BLOCKS[name]]
        if (known := np.isfinite(part).all(axis=1)).any():
            found[name] = RmsError.of(part[known], unit)
    return found


def run_ratios(runs: Runs, outages: FloatArray) -> FloatArray:
    """Return true rms ÷ predicted sd of each run while aided, all states together, inf where one is not finite; (m,).

    Parameters are those of `evaluate`.
    """
    finite = np.isfinite(runs.error).all(axis=(1, 2)) & np.isfinite(runs.covariance).all(axis=(1, 2, 3))
    own = np.ix_(finite, scored_epochs(runs.t, outages))
    error, covariance = runs.error[own], runs.covariance[own].astype(float)
    ratios = np.full(len(runs.error), np.inf)
    ratios[finite] = np.sqrt(squares(error, covariance).mean(axis=1) / error.shape[-1])
    return ratios


def some_strayed(ratios: FloatArray) -> bool:
    """Tell from `run_ratios` whether some runs diverged while most are consistent."""
    return bool(ratios.max() > STRAYED_RATIO and np.median(ratios) < 1.0 + EQUIVALENCE_MARGIN)


def innovation_scores(
    innovation: Sequence[FloatArray],
    covariance: Sequence[Floats],
    use: Sequence[NDArray[np.int64]],
    *,
    tests: int = TEST_COUNT,
) -> tuple[Score, ...]:
    """Score innovations of used fixes, groups of (k, 6), (k, 6, 6), (k, 2): all, position, velocity.

    A component that is NaN is missing; squares are those of as many components as most fixes have.
    """
    scores = []
    for name, own in INNOVATIONS.items():
        groups, counts = [], [np.zeros(0)]
        for z, s, u in zip(innovation, covariance, use, strict=True):
            used = (u[:, own.start // 3 : own.stop // 3] == USED).all(axis=-1)
            counts.append(np.isfinite(z[used, own]).sum(axis=1))
            own_squares = squares(np.nan_to_num(z[used, own]), s[used][:, own, own].astype(float))
            groups.append(own_squares / np.maximum(counts[-1], 1))
        known = np.concatenate(counts)
        if len(known) > 1 and (dof := int(np.median(known))):
            scores.append(score(name, [dof * one for one in groups], dof, tests=tests))
    return tuple(scores)


def whiteness(
    t: FloatArray,
    innovation: Sequence[FloatArray],
    covariance: Sequence[Floats],
    use: Sequence[NDArray[np.int64]],
    *,
    tests: int = TEST_COUNT,
) -> Whiteness | None:
    """Return the largest autocorrelation of innovations, whitened by S = L Lᵀ, over lags 1 … 10 and parts.

    Pairs across an outage or a refused fix are left out.
    """
    interval = float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    found = []
    for part, own, column in (("position", slice(0, 3), 0), ("velocity", slice(3, 6), 1)):
        sums, counts = np.zeros(MAX_LAG + 1), np.zeros(MAX_LAG + 1)
        for z, s, u in zip(innovation, covariance, use, strict=True):
            used = u[:, column] == USED
            e = np.zeros((len(z), 3))
            lower = np.linalg.cholesky(s[used][:, own, own].astype(float))
            e[used] = np.linalg.solve(lower, np.nan_to_num(z[used][:, own, None]))[..., 0]
            for lag in range(MAX_LAG + 1):
                near = t[lag:] - t[: len(t) - lag] < (lag + 0.5) * interval
                pairs = used[lag:] & used[: len(t) - lag] & near
                sums[lag] += np.sum(e[lag:][pairs] * e[: len(t) - lag][pairs])
                counts[lag] += 3 * np.count_nonzero(pairs)
        if counts[MAX_LAG] < MIN_PAIRS or sums[0] == 0.0:
            continue
        r = (sums / counts) / (sums[0] / counts[0])
        lag = 1 + int(np.argmax(np.abs(r[1:])))
        limit = -ndtri(0.5 * FALSE_ALARM_RATE / tests / (2 * MAX_LAG)) / math.sqrt(counts[lag])
        found.append(Whiteness(part, lag, float(r[lag]), float(limit + EQUIVALENCE_MARGIN)))
    return max(found, key=lambda one: abs(one.correlation) - one.band, default=None)


def scored_epochs(t: FloatArray, outages: FloatArray, settling: float = SETTLING_TIME) -> NDArray[np.intp]:
    """Return the epochs that are scored: `MAX_SCORED_EPOCHS` aided ones, evenly spread, or all where fewer."""
    aided = aided_epochs(t, outages, settling)
    return np.asarray(aided[np.unique(np.linspace(0, len(aided) - 1, MAX_SCORED_EPOCHS).astype(int))])


def aided_epochs(t: FloatArray, outages: FloatArray, settling: float = SETTLING_TIME) -> NDArray[np.intp]:
    """Return the epochs that are aided and settled; all where none is settled."""
    settled = t >= t[0] + settling
    for begin, end in outages:
        settled &= (t <= begin) | (t >= end + settling)
    return np.flatnonzero(settled if settled.any() else np.ones(len(t), dtype=bool))


def outage_epochs(t: FloatArray, outages: FloatArray, horizon: float) -> NDArray[np.intp]:
    """Return the epoch nearest to a horizon in each window (begin, end] that reaches it, less than a step from it.

    The first fix behind a window is used and may be nearer: where fixes are a microsecond late, to the end.
    """
    step = float(np.median(np.diff(t)))
    found = []
    for begin, end in outages:
        inside = np.flatnonzero((t > begin) & (t <= end + 1e-9))
        off = np.abs(t[inside] - begin - horizon)
        if end - begin >= horizon - 1e-9 and len(inside) and off.min() < step:
            found.append(inside[off.argmin()])
    return np.array(found, dtype=np.intp)


def outage_score(
    seconds: float, errors: Sequence[FloatArray], covariances: Sequence[Floats], *, tests: int = TEST_COUNT
) -> Outage:
    """Score position errors after some time without fixes.

    Parameters
    ----------
    seconds : float
        Length of the outages.
    errors, covariances : sequence of ndarray, shapes (w, 3), (w, 3, 3)
        At the ends of outages, m and m², in groups that are independent of one another.
    tests : int
        Scores that share the family-wise error.
    """
    s = [one.astype(float) for one in covariances]
    e2 = [np.sum(one**2, axis=-1) for one in errors]
    predicted = [np.trace(one, axis1=-2, axis2=-1) for one in s]
    groups = [a / b for a, b in zip(e2, predicted, strict=True)]
    freedom = float(np.mean(np.concatenate([components(one) for one in s])))
    square = np.concatenate(e2)
    return Outage(
        seconds,
        math.sqrt(float(square.mean())),
        math.sqrt(float(np.concatenate(predicted).mean())),
        score(f"{OUTAGE}{seconds:g} s", groups, 1, components=freedom, tests=tests),
        square.size,
        ratio_interval(groups, freedom),
    )
