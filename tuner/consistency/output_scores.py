"""Is any filter consistent? NEES by block and state, NIS and outages of its output, in bands for correlated errors.

Ten runs or more are scored as `tuner.consistency.scores` scores simulated runs: runs are independent, and the scatter
of their means gives the degrees of freedom. Errors of fewer runs depend on each other in time. With the autocorrelation
ρ of whitened errors (of mean zero, where the filter is right), the mean of n squares of d components each has the
variance of χ² with

    ν = d N       N = n/(1 + 2 Σ ρ²(m))        the sum to the first lag with ρ below a fifth

degrees of freedom [1]_. N is an estimate itself; N²/(N + 3) in its place keeps the false-alarm rate of records of
any length beside the correlation time (simulated first-order Gauss–Markov errors: at most 0.25 % for a band of 0.07 %
and the margin).

References
----------
.. [1] M. S. Bartlett, On the theoretical specification and sampling properties of autocorrelated time-series, Suppl.
       J. Royal Statistical Society 8 (1946).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tuner.consistency.output_errors import OutputErrors
from tuner.consistency.scores import (
    MAX_SCORED_EPOCHS,
    OUTAGE_LENGTHS,
    SETTLING_TIME,
    TEST_COUNT,
    innovation_scores,
    mean_band,
    score,
    whiteness,
)
from tuner.navigation.data import ABSENT, USED
from tuner.types.consistency import Outage, Score, Whiteness
from tuner.types.filter_output import BLOCKS, FilterOutput
from tuner.types.records import DataError

FloatArray = NDArray[np.float64]

MIN_INDEPENDENT_RUNS = 10
"""Runs from which their scatter tells the degrees of freedom to a quarter; fewer are scored by correlation in time."""
MAX_SETTLING_SHARE = 0.1
"""Share of a record that is left out at most while the filter settles."""
CORRELATION_CUT = 0.2
"""Autocorrelation at which its sum ends: what follows adds 4 % of the sum, and less than the noise of its estimate."""
UNCERTAIN_COUNT = 3.0
"""N₀ of N/(1 + N₀/N): found by simulation, see the head of the file."""
INNOVATION_BLOCK_EPOCHS = 30
"""Innovations of one run that are one group: they are white where the filter is right."""
STATE_NAMES = (
    *(f"position_{x}" for x in ("north", "east", "down")),
    *(f"velocity_{x}" for x in ("north", "east", "down")),
    *(f"attitude_{x}" for x in ("north", "east", "down")),
    *(f"gyro_bias_{x}" for x in "xyz"),
    *(f"accel_bias_{x}" for x in "xyz"),
)
"""The 15 states."""


def settling_time(t: FloatArray) -> float:
    """Return the time after the start, or an outage, that is not scored, s."""
    return min(SETTLING_TIME, MAX_SETTLING_SHARE * float(t[-1] - t[0])) if len(t) else 0.0


def aided_rows(t: FloatArray, outages: FloatArray) -> NDArray[np.intp]:
    """Return the epochs with fixes, settled; all where none is."""
    settling = settling_time(t)
    good = t >= t[0] + settling
    for begin, end in outages:
        good &= (t <= begin) | (t >= end + settling)
    return np.flatnonzero(good if good.any() else np.ones(len(t), dtype=bool))


def autocorrelation(w: FloatArray) -> FloatArray:
    """Return the autocorrelation of components of mean zero, by lag; shape (n, d) → (n,)."""
    n = len(w)
    size = 1 << (2 * n - 1).bit_length()
    f = np.fft.rfft(w, size, axis=0)
    total = np.fft.irfft((f * f.conj()).real.sum(axis=1), size)[:n]
    return np.asarray(total / np.arange(n, 0, -1) / (total[0] / n)) if total[0] > 0.0 else np.eye(1, n)[0]


def independent_count(w: FloatArray) -> float:
    """Return the number of independent epochs in whitened errors, shape (n, d), at least 1."""
    rho = autocorrelation(w)
    below = np.flatnonzero(rho[: len(w) // 2 + 1] < CORRELATION_CUT)
    if not len(below):
        return 1.0
    count = len(w) * (1.0 - CORRELATION_CUT**2) / (1.0 + 2.0 * float(np.sum(rho[1 : below[0]] ** 2)))
    return max(count / (1.0 + UNCERTAIN_COUNT / count), 1.0)


def whitened(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return errors of unit covariance where the filter is right, by P = L Lᵀ; (n, d), (n, d, d) → (n, d)."""
    lower = np.linalg.cholesky(covariance)
    return np.asarray(np.linalg.solve(lower, error[..., None])[..., 0])


def time_score(
    name: str, groups: Sequence[FloatArray], *, removed: int = 0, tests: int = TEST_COUNT
) -> Score | None:
    """Score whitened errors of runs, (n, d) each, that are correlated in time; None where there are none.

    `removed` degrees of freedom were taken out of each by an alignment.
    """
    groups = [w for w in groups if len(w) > 1]
    if not groups:
        return None
    d = groups[0].shape[1]
    count = sum(map(len, groups))
    mean = sum(float(np.sum(w**2)) for w in groups) / count
    effective = sum(d * independent_count(w) for w in groups)
    left = effective - removed * len(groups)
    if left < 1.0:
        return None
    mean *= effective / left
    return Score(name, mean, d, left, mean_band(d, left, tests=tests))


def error_scores(runs: Sequence[OutputErrors]) -> tuple[Score | None, tuple[Score, ...]]:
    """Return NEES of all states together, None where only one block is known, and of each block."""
    many = len(runs) >= MIN_INDEPENDENT_RUNS
    known = [i for i in range(len(BLOCKS)) if all(_known(run, i).any() for run in runs)]
    chosen = [_scored_rows(run, known, thin=many) for run in runs]
    parts: dict[str, list[FloatArray]] = {"nees": [], **{BLOCKS[i]: [] for i in known}}
    columns = (
        np.concatenate([np.arange(3 * i, 3 * i + 3) for i in known]) if known else np.zeros(0, dtype=int)
    )
    for run, rows in zip(runs, chosen, strict=True):
        error, cov = run.error[rows], run.covariance[rows]
        for i in known:
            own = slice(3 * i, 3 * i + 3)
            parts[BLOCKS[i]].append(_whitened(run, rows, error[:, own], cov[:, own, own]))
        if run.correlated:
            whole = cov[:, columns][:, :, columns]
            parts["nees"].append(_whitened(run, rows, error[:, columns], whole))
        else:
            parts["nees"].append(np.concatenate([parts[BLOCKS[i]][-1] for i in known], axis=1))
    found: dict[str, Score] = {}
    for name, groups in parts.items():
        d = groups[0].shape[1] if groups else 0
        if name == "nees" and len(known) < 2:
            continue
        aligned = runs[0].removed if name in ("nees", "position") else 0
        one = (
            score(name, [np.sum(w**2, axis=1) for w in groups], d)
            if many
            else time_score(name, groups, removed=aligned)
        )
        if one is not None:
            found[name] = one
    return found.pop("nees", None), tuple(found.values())


def _whitened(
    run: OutputErrors, rows: NDArray[np.intp], error: FloatArray, covariance: FloatArray
) -> FloatArray:
    try:
        return whitened(error, covariance)
    except np.linalg.LinAlgError:
        worst = int(np.argmin(np.linalg.eigvalsh(covariance)[:, 0]))
        msg = (
            f"{run.name}: expected covariances that are positive definite, found one that is not at "
            f"{run.t[rows][worst]:.3f} s: mend the filter's update (Joseph form), or give its sds alone"
        )
        raise DataError(msg) from None


def state_scores(runs: Sequence[OutputErrors]) -> tuple[Score, ...]:
    """Return the score of each state alone, in the band of as many tests as there are states."""
    many = len(runs) >= MIN_INDEPENDENT_RUNS
    states = [j for j in range(15) if all(_known(run, j // 3).any() for run in runs)]
    found = []
    for j in states:
        groups = []
        for run in runs:
            rows = _scored_rows(run, [j // 3], thin=many)
            groups.append((run.error[rows, j] / np.sqrt(run.covariance[rows, j, j]))[:, None])
        one = (
            score(STATE_NAMES[j], [w[:, 0] ** 2 for w in groups], 1, tests=len(states))
            if many
            else time_score(STATE_NAMES[j], groups, tests=len(states))
        )
        if one is not None:
            found.append(one)
    return tuple(found)


def _known(run: OutputErrors, block: int) -> NDArray[np.bool_]:
    """Return the epochs at which a block has an error and a positive variance."""
    own = slice(3 * block, 3 * block + 3)
    variance = np.einsum("kii->ki", run.covariance[:, own, own])
    return np.asarray(np.isfinite(run.error[:, own]).all(axis=1) & (variance > 0.0).all(axis=1))


def _scored_rows(run: OutputErrors, blocks: Sequence[int], *, thin: bool) -> NDArray[np.intp]:
    """Return the aided epochs at which all blocks are known; evenly spread ones of them where they are thinned."""
    good = np.ones(len(run), dtype=bool)
    for i in blocks:
        good &= _known(run, i)
    aided = aided_rows(run.t, run.estimate.outages)
    if thin and len(aided):
        aided = aided[np.unique(np.linspace(0, len(aided) - 1, MAX_SCORED_EPOCHS).astype(int))]
    return aided[good[aided]]


def output_innovation_scores(outputs: Sequence[FilterOutput]) -> tuple[Score, ...]:
    """Return NIS, all, position and velocity, of outputs with innovations."""
    z, s, use = [], [], []
    for output in outputs:
        rows = np.arange(len(output))
        pieces = [rows]
        if len(outputs) < MIN_INDEPENDENT_RUNS:
            rows = np.flatnonzero(_use(output).any(axis=1))
            rows = rows[output.t[rows] >= output.t[0] + settling_time(output.t)]
            pieces = np.array_split(rows, max(1, len(rows) // INNOVATION_BLOCK_EPOCHS))
        for piece in pieces:
            z.append(output.innovation[piece])
            s.append(output.innovation_covariance[piece])
            use.append(_use(output)[piece])
    return innovation_scores(z, s, use) if z else ()


def output_whiteness(outputs: Sequence[FilterOutput]) -> Whiteness | None:
    """Return the largest autocorrelation of innovations; of outputs on one clock together, else of the longest."""
    fixes = [np.asarray(_use(output).any(axis=1)) for output in outputs]
    longest = int(np.argmax([np.count_nonzero(used) for used in fixes]))
    t = outputs[longest].t
    together = all(np.array_equal(output.t, t) for output in outputs)
    chosen = list(outputs) if together else [outputs[longest]]
    some: NDArray[np.bool_] = np.asarray(np.stack(fixes).any(axis=0)) if together else fixes[longest]
    if np.count_nonzero(some) < 2:
        return None
    chosen = [output.rows(some) for output in chosen]
    return whiteness(
        t[some],
        [output.innovation for output in chosen],
        [output.innovation_covariance for output in chosen],
        [_use(output) for output in chosen],
    )


def _use(output: FilterOutput) -> NDArray[np.int64]:
    """Return which innovations of position and velocity there are, shape (n, 2)."""
    sd = np.einsum("kii->ki", output.innovation_covariance)
    good = np.isfinite(output.innovation) & (sd > 0.0)
    return np.where(good.reshape(-1, 2, 3).all(axis=2), USED, ABSENT).astype(np.int64)


def outage_scores(runs: Sequence[OutputErrors]) -> tuple[Outage, ...]:
    """Return the position errors after some time without fixes, over all outages that are long enough."""
    lengths = [end - begin for run in runs for begin, end in run.estimate.outages]
    found = (_outage(runs, h) for h in OUTAGE_LENGTHS if lengths and h <= max(lengths) + 1e-9)
    return tuple(outage for outage in found if outage is not None)


def _outage(runs: Sequence[OutputErrors], horizon: float) -> Outage | None:
    groups: list[FloatArray] = []
    errors, variances = [], []
    for run in runs:
        step = float(np.median(np.diff(run.t)))
        goals = [b + horizon for b, e in run.estimate.outages if e - b >= horizon - 1e-9]
        nearest = [int(np.argmin(np.abs(run.t - goal))) for goal in goals]
        epochs = np.array(
            [k for k, goal in zip(nearest, goals, strict=True) if abs(run.t[k] - goal) < step], dtype=int
        )
        epochs = epochs[_known(run, 0)[epochs]]
        if not len(epochs):
            continue
        e2 = np.sum(run.error[epochs, :3] ** 2, axis=-1)
        predicted = np.trace(run.covariance[epochs, :3, :3], axis1=-2, axis2=-1)
        errors.append(e2)
        variances.append(predicted)
        if len(runs) >= MIN_INDEPENDENT_RUNS:
            groups.append(e2 / predicted)
        else:
            groups += [np.atleast_1d(value) for value in e2 / predicted]
    if not errors:
        return None
    e2, predicted = np.concatenate(errors), np.concatenate(variances)
    return Outage(
        horizon,
        math.sqrt(float(e2.mean())),
        math.sqrt(float(predicted.mean())),
        score(f"outage {horizon:g} s", groups, 1, components=3),
        len(e2),
    )


def rms_errors(runs: Sequence[OutputErrors]) -> dict[str, tuple[float, ...]]:
    """Return the rms errors while aided of position, velocity and attitude, where they are known."""
    names = ("position_rms_m", "velocity_rms_m_s", "attitude_rms_rad")
    whole = np.concatenate([run.error[aided_rows(run.t, run.estimate.outages)] for run in runs])
    found = {}
    for i, name in enumerate(names):
        part = whole[:, 3 * i : 3 * i + 3]
        part = part[np.isfinite(part).all(axis=1)]
        if len(part):
            found[name] = tuple(np.sqrt(np.mean(part**2, axis=0)).tolist())
    return found


def normalized(run: OutputErrors) -> FloatArray:
    """Return errors over their sds, shape (n, 15), NaN where either is unknown."""
    variance = np.einsum("kii->ki", run.covariance)
    return np.asarray(run.error / np.sqrt(np.where(variance > 0.0, variance, np.nan)))
