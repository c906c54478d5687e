"""What every noise does to the scores of a filter, whether the filter knows of it or not.

Linear covariance by source (`tuner.consistency.error_budget`) with further sources: bias noises of other time
constants than
those of the filter's states. They have states of their own, which get no gain.

The true bias of a simulation is a mean over a window w (`simulate.resolution`). A state of a ladder, a decade
from the next, stands for the flicker of a decade of frequencies, up to √10/(2πT); flicker averaged over w is that
below 0.40/w. Of the state's variance σ² the mean takes σ² log₁₀(w/(0.8 T)), between nothing and all of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tuner.consistency.error_budget import Budget, Source, known_sources, trace
from tuner.consistency.scores import BLOCKS, Consistency
from tuner.navigation.settings import FilterSettings
from tuner.simulation.monte_carlo import RESOLVED, Scenario

FloatArray = NDArray[np.float64]

STRETCHES = (10.0**-1.5, 0.1, 10.0**-0.5, 10.0**0.5, 10.0, 10.0**1.5)
"""Factors in the time constants at which scores are computed; between them they are interpolated."""
SLOWER = 3
"""Decades of missing slow noise: states at 10, 100 and 1000 times the longest time constant."""
UNMODELLED = 10.0
"""Time constant from which bias noise is missing where a filter has no states for it, s."""


@dataclass(frozen=True)
class Responses:
    """What every noise, known to a filter or not, does to its errors along a scenario.

    Attributes
    ----------
    known : Budget
        Of the sources that the filter believes in.
    strange : Budget
        Of bias noises that it does not know.
    names : tuple of (sensor, kind, factor)
        Of those: see `strange_sources`.
    constants : mapping of str to (float, float)
        Time constants of the fastest and the slowest state of each sensor, s; empty where there are none.
    """

    known: Budget
    strange: Budget
    names: tuple[tuple[str, str, float], ...]
    constants: dict[str, tuple[float, float]]


def responses(settings: FilterSettings, plan: Scenario, budget: Budget, *, window: FloatArray) -> Responses:
    """Return the responses of a filter to noise.

    Parameters
    ----------
    settings, plan : FilterSettings, Scenario
        What was flown.
    budget : Budget
        Of the same.
    window : ndarray, shape (6,)
        Over how long the true biases are averaged, s.
    """
    strange, names = strange_sources(settings, plan, window)
    constants = {}
    for title, key in (("gyro", "gyro_markov"), ("accelerometer", "accel_markov")):
        if key in settings.model.layout:
            values = settings.model.time_constant[settings.model.layout[key]]
            constants[title] = (float(values.min()), float(values.max()))
    return Responses(budget, strange, names, constants)


def patterns(found: Consistency, budget: Budget) -> FloatArray:
    """Return what every source adds to every score of a check, its mean over the filter's prediction; (s, g)."""
    aided, rows = budget.aided, []
    for score in found.scores:
        if score.name in ("nees", *BLOCKS):
            i = BLOCKS.index(score.name) if score.name != "nees" else -1
            own = slice(3 * i, 3 * i + 3) if i >= 0 else slice(0, 15)
            rows.append(_traces(budget.covariance[aided], budget.total[aided], own).mean(axis=0))
        elif score.name.startswith("nis"):
            own = {"nis_position": slice(0, 3), "nis_velocity": slice(3, 6)}.get(score.name, slice(0, 6))
            rows.append(_traces(budget.innovation[aided], budget.innovation_total[aided], own).mean(axis=0))
        else:
            epochs = budget.after[float(score.name.split()[1])]
            parts = np.einsum("egii->eg", budget.covariance[epochs][:, :, :3, :3])
            whole = np.einsum("eii->e", budget.total[epochs][:, :3, :3])
            rows.append((parts / whole[:, None]).mean(axis=0))
    return np.array(rows)


def _traces(parts: FloatArray, whole: FloatArray, own: slice) -> FloatArray:
    """Return tr(P⁻¹ V_g)/m of a block, shape (e, g)."""
    inverse = np.linalg.inv(whole[:, own, own])
    return np.asarray(np.einsum("eij,egji->eg", inverse, parts[:, :, own, own]) / inverse.shape[-1])


def hidden(sd: ArrayLike, constant: ArrayLike, window: ArrayLike) -> FloatArray:
    """Return the variance that a mean over a window, s, takes from the flicker that states a decade apart stand for."""
    above = np.log10(np.maximum(np.asarray(window, dtype=float) / (RESOLVED * np.asarray(constant)), 1.0))
    return np.asarray(np.asarray(sd) ** 2 * np.minimum(above, 1.0))


Ladder = list[tuple[float, float]]
"""Sds and time constants, s, of the Gauss–Markov states of an axis, the fastest first."""


def strange_sources(
    settings: FilterSettings, plan: Scenario, window: FloatArray
) -> tuple[Budget, tuple[tuple[str, str, float], ...]]:
    """Return the covariance that bias noises cause which the filter does not know.

    For each sensor: its own states with time constants stretched by each of `STRETCHES`, the decades of slow
    noise behind the last state, the first of them alone, and the decade before the first state, each as
    strong as the state beside it. Where there are no states, sds are those of white noise over `UNMODELLED`.
    """
    own, _ = known_sources(settings, plan)
    n, axes = settings.size, []
    wanted: list[tuple[tuple[str, str, float], dict[int, Ladder]]] = []
    for first, title in ((0, "gyro"), (3, "accelerometer")):
        ladders = _ladders(settings, first)
        axes += [first + axis for axis, ladder in ladders.items() for _ in range(max(SLOWER, len(ladder)))]
        if any(ladders.values()):
            for factor in STRETCHES:
                stretched = {axis: [(s, factor * t) for s, t in ladder] for axis, ladder in ladders.items()}
                wanted.append(((title, "stretched", factor), stretched))
            faster = {
                axis: [(ladder[0][0], 0.1 * ladder[0][1])] for axis, ladder in ladders.items() if ladder
            }
            wanted.append(((title, "faster", 1.0), faster))
        density = np.concatenate([settings.model.gyro_density, settings.model.accel_density])[first:]
        for kind, decades in (("slower", SLOWER), ("next", 1)):
            behind = {}
            for axis, ladder in ladders.items():
                s, t = (
                    ladder[-1] if ladder else (float(density[axis]) / math.sqrt(UNMODELLED), 0.1 * UNMODELLED)
                )
                behind[axis] = [(s, 10.0 ** (j + 1) * t) for j in range(decades)]
            wanted.append(((title, kind, 1.0), behind))
    rows = np.array(axes, dtype=np.int64)
    sources, less = [], np.zeros((len(wanted), 6))
    for g, (name, states) in enumerate(wanted):
        initial, drive = np.zeros(n + len(rows)), np.zeros(n + len(rows))
        rate = np.concatenate([own.rate, np.zeros(len(rows))])
        for axis, ladder in states.items():
            row = axis + (0 if name[0] == "gyro" else 3)
            for j, (s, t) in zip(n + np.flatnonzero(rows == row), ladder, strict=False):
                rate[j], initial[j], drive[j] = 1.0 / t, s**2, 2.0 * s**2 / t
                less[g, row] += float(hidden(s, t, window[row]))
        sources.append(Source(" ".join(map(str, name)), initial, drive, rate, np.zeros(6), np.zeros(6)))
    found = trace(settings, plan, own, sources, rows=rows)
    found.covariance[:, :, range(9, 15), range(9, 15)] -= less
    return found, tuple(name for name, _ in wanted)


def _ladders(settings: FilterSettings, first: int) -> dict[int, Ladder]:
    """Return the ladder of each axis of the gyros (first 0) or the accelerometers (3)."""
    model = settings.model
    key, axes = (
        ("gyro_markov", model.gyro_markov_axes) if first == 0 else ("accel_markov", model.accel_markov_axes)
    )
    block = model.layout[key] if axes else slice(0, 0)
    states = list(
        zip(axes, settings.initial_sd[block].tolist(), model.time_constant[block].tolist(), strict=True)
    )
    return {
        axis: sorted(((s, t) for a, s, t in states if a == axis), key=lambda pair: pair[1])
        for axis in range(3)
    }
