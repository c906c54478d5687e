"""Is any filter consistent? NEES by block and state, NIS and outages of its output.

Ten runs or more are scored as `tuner.consistency.scores` scores simulated runs: runs are independent, and the scatter
of their means gives the degrees of freedom. Errors of fewer runs depend on each other in time (`correlated_errors`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from tuner.consistency.correlated_errors import time_score, whitened
from tuner.consistency.output_errors import OutputErrors
from tuner.consistency.scores import (
    MAX_SCORED_EPOCHS,
    OUTAGE_LENGTHS,
    SETTLING_TIME,
    innovation_scores,
    outage_epochs,
    outage_score,
    score,
    whiteness,
)
from tuner.navigation.data import ABSENT, USED
from tuner.types.consistency import ERROR_UNITS, Outage, RmsError, Score, Whiteness
from tuner.types.filter_output import BLOCKS, FilterOutput
from tuner.types.records import DataError

MIN_INDEPENDENT_RUNS = 10
"""Runs from which their scatter tells the degrees of freedom to a quarter; fewer are scored by correlation in time."""
MAX_SETTLING_SHARE = 0.1
"""Share of a record that is left out at most while the filter settles."""
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


def error_scores(runs: Sequence[OutputErrors]) -> tuple[Score | None, tuple[Score, ...]]:
    """Return NEES of all states together, None where only one block is known, and of each block."""
    nees, blocks = _error_scores(runs)
    if not any(run.between.any() for run in runs):
        return nees, blocks
    bare_nees, bare = _error_scores(_without_between(runs))
    return _mildest(nees, bare_nees), tuple(s for s in map(_mildest, blocks, bare) if s is not None)


def _without_between(runs: Sequence[OutputErrors]) -> list[OutputErrors]:
    """Return errors whose covariance is without what the truth leaves open between its rows."""
    open_between = [np.pad(run.between, ((0, 0), (0, 6)))[:, :, None] * np.eye(15) for run in runs]
    return [
        replace(run, covariance=run.covariance - more) for run, more in zip(runs, open_between, strict=True)
    ]


def _mildest(most: Score | None, least: Score | None) -> Score | None:
    """Return the score that speaks least against a filter, between those of the largest and smallest covariance.

    What a truth leaves open between its rows is an upper bound: it excuses errors, and makes no filter pessimistic.
    """
    if most is None or least is None or most.mean >= most.dof:
        return most
    return replace(most, mean=float(most.dof)) if least.mean > least.dof else least


def _error_scores(runs: Sequence[OutputErrors]) -> tuple[Score | None, tuple[Score, ...]]:
    many = len(runs) >= MIN_INDEPENDENT_RUNS
    known = [i for i in range(len(BLOCKS)) if all(known_epochs(run, i).any() for run in runs)]
    if not any(np.isfinite(run.error[:, :9]).any() for run in runs):
        raise DataError(
            "expected an estimate and a truth of the same position, velocity or attitude, found none: name their "
            "columns by --columns and --truth-columns"
        )
    if not known:
        return None, ()
    chosen = [_scored_rows(run, known, thin=many) for run in runs]
    parts: dict[str, list[FloatArray]] = {"nees": [], **{BLOCKS[i]: [] for i in known}}
    fitted: dict[str, list[FloatArray]] = {name: [] for name in parts}
    columns = np.concatenate([np.arange(3 * i, 3 * i + 3) for i in known])
    for run, rows in zip(runs, chosen, strict=True):
        error, cov = run.error[rows], run.covariance[rows]
        wide = np.concatenate([error[:, :, None], run.directions[rows]], axis=2)
        for i in known:
            own = slice(3 * i, 3 * i + 3)
            both = _of_unit_variance(run, rows, wide[:, own], cov[:, own, own])
            parts[BLOCKS[i]].append(both[..., 0])
            fitted[BLOCKS[i]].append(both[..., 1:])
        if run.correlated:
            both = _of_unit_variance(run, rows, wide[:, columns], cov[:, columns][:, :, columns])
            parts["nees"].append(both[..., 0])
            fitted["nees"].append(both[..., 1:])
        else:
            for table in (parts, fitted):
                table["nees"].append(np.concatenate([table[BLOCKS[i]][-1] for i in known], axis=1))
    found: dict[str, Score] = {}
    for name, groups in parts.items():
        d = groups[0].shape[1] if groups else 0
        if name == "nees" and len(known) < 2:
            continue
        one = (
            score(name, [np.sum(w**2, axis=1) for w in groups], d)
            if many
            else time_score(name, groups, fitted=fitted[name])
        )
        if one is not None:
            found[name] = one
    return found.pop("nees", None), tuple(found.values())


def _of_unit_variance(
    run: OutputErrors, rows: NDArray[np.intp], error: FloatArray, covariance: FloatArray
) -> FloatArray:
    try:
        return whitened(error, covariance)
    except np.linalg.LinAlgError:
        worst = int(np.argmin(np.linalg.eigvalsh(covariance)[:, 0]))
        raise DataError(
            f"{run.name}: expected covariances that are positive definite, found one that is not at "
            f"{run.t[rows][worst]:.3f} s: mend the filter's update (Joseph form), or give its sds alone"
        ) from None


def state_scores(runs: Sequence[OutputErrors]) -> tuple[Score, ...]:
    """Return the score of each state alone, in the band of as many tests as there are states."""
    found = _state_scores(runs)
    if not any(run.between.any() for run in runs):
        return found
    bare = _state_scores(_without_between(runs))
    return tuple(s for s in map(_mildest, found, bare) if s is not None)


def _state_scores(runs: Sequence[OutputErrors]) -> tuple[Score, ...]:
    many = len(runs) >= MIN_INDEPENDENT_RUNS
    states = [j for j in range(15) if all(known_epochs(run, j // 3).any() for run in runs)]
    found = []
    for j in states:
        groups, fitted = [], []
        for run in runs:
            rows = _scored_rows(run, [j // 3], thin=many)
            sd = np.sqrt(run.covariance[rows, j, j])[:, None]
            groups.append(run.error[rows, j, None] / sd)
            fitted.append(run.directions[rows, j, None] / sd[..., None])
        one = (
            score(STATE_NAMES[j], [w[:, 0] ** 2 for w in groups], 1, tests=len(states))
            if many
            else time_score(STATE_NAMES[j], groups, fitted=fitted, tests=len(states))
        )
        if one is not None:
            found.append(one)
    return tuple(found)


def known_epochs(run: OutputErrors, block: int) -> NDArray[np.bool_]:
    """Return the epochs at which a block has an error and a positive variance."""
    own = slice(3 * block, 3 * block + 3)
    variance = np.einsum("kii->ki", run.covariance[:, own, own])
    return np.asarray(np.isfinite(run.error[:, own]).all(axis=1) & (variance > 0.0).all(axis=1))


def _scored_rows(run: OutputErrors, blocks: Sequence[int], *, thin: bool) -> NDArray[np.intp]:
    """Return the aided epochs at which all blocks are known; evenly spread ones of them where they are thinned."""
    good = np.ones(len(run), dtype=bool)
    for i in blocks:
        good &= known_epochs(run, i)
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
    errors: list[FloatArray] = []
    covariances: list[FloatArray] = []
    for run in runs:
        epochs = outage_epochs(run.t, run.estimate.outages, horizon)
        epochs = epochs[known_epochs(run, 0)[epochs]]
        if not len(epochs):
            continue
        parts = [epochs] if len(runs) >= MIN_INDEPENDENT_RUNS else np.split(epochs, len(epochs))
        errors += [run.error[part, :3] for part in parts]
        covariances += [run.covariance[part, :3, :3] for part in parts]
    return outage_score(horizon, errors, covariances) if errors else None


def rms_errors(runs: Sequence[OutputErrors]) -> dict[str, RmsError]:
    """Return the rms errors while aided of position, velocity and attitude, where they are known."""
    whole = np.concatenate([run.error[aided_rows(run.t, run.estimate.outages)] for run in runs])
    found = {}
    for i, (name, unit) in enumerate(ERROR_UNITS.items()):
        part = whole[:, 3 * i : 3 * i + 3]
        part = part[np.isfinite(part).all(axis=1)]
        if len(part):
            found[name] = RmsError.of(part, unit)
    return found


def normalized(run: OutputErrors) -> FloatArray:
    """Return errors over their sds, shape (n, 15), NaN where either is unknown."""
    variance = np.einsum("kii->ki", run.covariance)
    return np.asarray(run.error / np.sqrt(np.where(variance > 0.0, variance, np.nan)))
