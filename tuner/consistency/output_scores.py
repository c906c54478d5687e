"""Is any filter consistent? NEES by block and state, NIS and outages of its output.

Ten runs or more are scored as `tuner.consistency.scores` scores simulated runs: runs are independent, and the scatter
of their means gives the degrees of freedom. Errors of fewer runs depend on each other in time (`correlated_errors`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from tuner.consistency.correlated_errors import time_score, whitened
from tuner.consistency.output_errors import OutputErrors
from tuner.consistency.scores import (
    BLOCKS,
    OUTAGE_LENGTHS,
    SETTLING_TIME,
    TEST_COUNT,
    aided_epochs,
    innovation_scores,
    outage_epochs,
    outage_score,
    score,
    scored_epochs,
    whiteness,
)
from tuner.navigation.data import ABSENT, USED
from tuner.types.consistency import Outage, Score, Whiteness
from tuner.types.filter_output import FilterOutput
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


def aided_rows(run: OutputErrors) -> NDArray[np.intp]:
    """Return the epochs with fixes, settled; all where none is."""
    return aided_epochs(run.t, run.estimate.outages, settling_time(run.t))


def error_scores(runs: Sequence[OutputErrors]) -> tuple[Score | None, tuple[Score, ...]]:
    """Return NEES of all states together, None where only one block is known, and of each block."""
    found = _mildest_scores(_error_scores, runs)
    return found.pop("nees", None), tuple(found.values())


def state_scores(runs: Sequence[OutputErrors]) -> tuple[Score, ...]:
    """Return the score of each state alone, in the band of as many tests as there are states."""
    return tuple(_mildest_scores(_state_scores, runs).values())


def _mildest_scores(
    scored: Callable[[Sequence[OutputErrors]], dict[str, Score]], runs: Sequence[OutputErrors]
) -> dict[str, Score]:
    """Return the scores that speak least against a filter, with or without what the truth leaves open between rows."""
    found = scored(runs)
    if not any(run.between.any() for run in runs):
        return found
    bare = scored([_without_between(run) for run in runs])
    return {name: _mildest(one, bare.get(name)) for name, one in found.items()}


def _without_between(run: OutputErrors) -> OutputErrors:
    """Return errors whose covariance is without what the truth leaves open between its rows."""
    open_between = np.pad(run.between, ((0, 0), (0, 6)))[:, :, None] * np.eye(15)
    return replace(run, covariance=run.covariance - open_between)


def _mildest(most: Score, least: Score | None) -> Score:
    """Return the score that speaks least against a filter, between those of the largest and smallest covariance.

    What a truth leaves open between its rows is an upper bound: it excuses errors, and makes no filter pessimistic.
    """
    if least is None or most.mean >= most.dof:
        return most
    return replace(most, mean=float(most.dof)) if least.mean > least.dof else least


def _error_scores(runs: Sequence[OutputErrors]) -> dict[str, Score]:
    """Return the scores of each block that all runs know, after that of all together where it is not the only one."""
    if not any(np.isfinite(run.error[:, :9]).any() for run in runs):
        raise DataError(
            "expected an estimate and a truth of the same position, velocity or attitude, found none: name their "
            "columns by --columns and --truth-columns"
        )
    known = {name: own for name, own in BLOCKS.items() if all(known_epochs(run, own).any() for run in runs)}
    if not known:
        return {}
    parts: dict[str, list[FloatArray]] = {name: [] for name in ("nees", *known)}
    states = np.concatenate([np.arange(15)[own] for own in known.values()])
    for run in runs:
        rows = _scored_rows(run, known.values(), thin=len(runs) >= MIN_INDEPENDENT_RUNS)
        cov = run.covariance[rows]
        wide = np.concatenate([run.error[rows][:, :, None], run.directions[rows]], axis=2)
        for name, own in known.items():
            parts[name].append(_of_unit_variance(run, rows, wide[:, own], cov[:, own, own]))
        if len(known) > 1:
            parts["nees"].append(
                _of_unit_variance(run, rows, wide[:, states], cov[:, states][:, :, states])
                if run.estimate.correlated
                else np.concatenate([parts[name][-1] for name in known], axis=1)
            )
    return scored({name: groups for name, groups in parts.items() if groups})


def scored(
    parts: Mapping[str, Sequence[FloatArray]], tests: int = TEST_COUNT, *, independent: bool = False
) -> dict[str, Score]:
    """Score whitened errors of runs by name; what has no score is left out.

    Parameters
    ----------
    parts : mapping of str to sequence of ndarray, shape (n, d, 1 + r)
        Errors of each run, and their derivatives by what was taken out. Runs are independent; of few runs the
        correlation in time tells how many values are.
    tests : int
        Scores that share the family-wise error.
    independent : bool
        Whether each run has one epoch, so that few runs have no correlation in time either.
    """
    found = {}
    for name, groups in parts.items():
        w = [both[..., 0] for both in groups]
        if independent or len(groups) >= MIN_INDEPENDENT_RUNS:
            found[name] = score(name, [np.sum(one**2, axis=1) for one in w], w[0].shape[1], tests=tests)
        elif one := time_score(name, w, fitted=[both[..., 1:] for both in groups], tests=tests):
            found[name] = one
    return found


def _of_unit_variance(
    run: OutputErrors, rows: NDArray[np.intp], error: FloatArray, covariance: FloatArray
) -> FloatArray:
    try:
        return whitened(error, covariance)
    except np.linalg.LinAlgError:
        worst = int(np.argmin(np.linalg.eigvalsh(covariance)[:, 0]))
        raise DataError(
            f"{run.estimate.name}: expected covariances that are positive definite, found one that is not at "
            f"{run.t[rows][worst]:.3f} s: mend the filter's update (Joseph form), or give its sds alone"
        ) from None


def _state_scores(runs: Sequence[OutputErrors]) -> dict[str, Score]:
    parts: dict[str, list[FloatArray]] = {}
    for own in BLOCKS.values():
        if not all(known_epochs(run, own).any() for run in runs):
            continue
        each = [_scored_rows(run, [own], thin=len(runs) >= MIN_INDEPENDENT_RUNS) for run in runs]
        for j in range(own.start, own.stop):
            parts[STATE_NAMES[j]] = [
                np.concatenate([run.error[rows, j, None, None], run.directions[rows, j, None]], axis=2)
                / np.sqrt(run.covariance[rows, j, j])[:, None, None]
                for run, rows in zip(runs, each, strict=True)
            ]
    return scored(parts, len(parts))


def known_epochs(run: OutputErrors, own: slice) -> NDArray[np.bool_]:
    """Return the epochs at which states have errors and positive variances."""
    variance = np.einsum("kii->ki", run.covariance[:, own, own])
    return np.asarray(np.isfinite(run.error[:, own]).all(axis=1) & (variance > 0.0).all(axis=1))


def _scored_rows(run: OutputErrors, blocks: Iterable[slice], *, thin: bool) -> NDArray[np.intp]:
    """Return the aided epochs at which all blocks are known; evenly spread ones of them where they are thinned."""
    rows = (scored_epochs if thin else aided_epochs)(run.t, run.estimate.outages, settling_time(run.t))
    return rows[np.all([known_epochs(run, own)[rows] for own in blocks], axis=0)]


def output_innovation_scores(outputs: Sequence[FilterOutput]) -> tuple[Score, ...]:
    """Return NIS, all, position and velocity, of outputs with innovations."""
    parts = []
    for output in outputs:
        use = _use(output)
        pieces = [np.arange(len(output))]
        if len(outputs) < MIN_INDEPENDENT_RUNS:
            rows = np.flatnonzero(use.any(axis=1))
            rows = rows[output.t[rows] >= output.t[0] + settling_time(output.t)]
            pieces = np.array_split(rows, max(1, len(rows) // INNOVATION_BLOCK_EPOCHS))
        parts += [(output.innovation[i], output.innovation_covariance[i], use[i]) for i in pieces]
    return innovation_scores(*zip(*parts, strict=True)) if parts else ()


def output_whiteness(outputs: Sequence[FilterOutput]) -> Whiteness | None:
    """Return the largest autocorrelation of innovations; of outputs on one clock together, else of the longest."""
    fixes = [np.asarray(_use(output).any(axis=1)) for output in outputs]
    longest = int(np.argmax([np.count_nonzero(used) for used in fixes]))
    t = outputs[longest].t
    together = all(np.array_equal(output.t, t) for output in outputs)
    some: NDArray[np.bool_] = np.asarray(np.stack(fixes).any(axis=0)) if together else fixes[longest]
    if np.count_nonzero(some) < 2:
        return None
    chosen = [output.rows(some) for output in (outputs if together else [outputs[longest]])]
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
    parts = []
    for run in runs:
        epochs = outage_epochs(run.t, run.estimate.outages, horizon)
        epochs = epochs[known_epochs(run, BLOCKS["position"])[epochs]]
        groups = [epochs] if len(runs) >= MIN_INDEPENDENT_RUNS else list(epochs[:, None])
        parts += [(run.error[i, :3], run.covariance[i, :3, :3]) for i in groups if len(i)]
    return outage_score(horizon, *zip(*parts, strict=True)) if parts else None


def normalized(run: OutputErrors) -> FloatArray:
    """Return errors over their sds, shape (n, 15), NaN where either is unknown."""
    variance = np.einsum("kii->ki", run.covariance)
    return np.asarray(run.error / np.sqrt(np.where(variance > 0.0, variance, np.nan)))
