"""What each noise, modelled by a filter or not, adds to the scores of that filter.

Linear covariance by source (`tuner.consistency.error_budget`) with further sources: bias noises of other time
constants than those of the filter's states. They have states of their own, which get no gain.

The true bias of a simulation is a mean over a window w (`tuner.simulation.monte_carlo.resolution`). A state of a
ladder, a decade from the next, represents the flicker of a decade of frequencies, up to √10/(2πT); flicker averaged
over w is that below 0.40/w. Of the state's variance σ² the mean removes σ² log₁₀(w/(0.8 T)), between nothing and all
of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from models.arrays import FloatArray
from models.noise import GaussMarkov
from tuner.consistency.error_budget import Source, known_sources, trace
from tuner.consistency.scores import BLOCKS, INNOVATIONS
from tuner.navigation.settings import FilterSettings, filter_settings
from tuner.simulation.monte_carlo import AVERAGING_RATIO
from tuner.simulation.scenario import Scenario
from tuner.types import FilterConfig, GnssNoise
from tuner.types.consistency import Consistency, ErrorBudget
from tuner.types.verdict import ExplanationKind

TIME_CONSTANT_FACTORS = (10.0**-1.5, 0.1, 10.0**-0.5, 10.0**0.5, 10.0, 10.0**1.5)
"""Factors in the time constants at which scores are computed; between them, half a decade, they are interpolated."""
CORRELATED_TIMES = (20.0, 100.0, 500.0)
"""Time constants of errors of the fixes that a filter may lack, s: multipath of a vehicle to orbits and atmosphere."""
SLOWER_DECADES = 3
"""Decades of missing slow noise: states at 10, 100 and 1000 times the longest time constant."""
UNMODELLED_TIME_CONSTANT = 10.0
"""Time constant from which on bias noise is missing where a filter has no states for it, s."""


class UnmodelledNoise(NamedTuple):
    """Noise that a filter has no states for, of a sensor, ``gyro`` or ``accelerometer``, or of ``position fixes``.

    `factor` is that of the time constants, of `ExplanationKind.TIME_CONSTANT`; of fixes their time constant, s; else 1.
    """

    sensor: str
    kind: ExplanationKind
    factor: float = 1.0


@dataclass(frozen=True)
class ScoreSensitivity:
    """What each noise, modelled by a filter or not, adds to its errors along a scenario.

    Attributes
    ----------
    configured : ErrorBudget
        Of the sources that the filter is configured for.
    unmodelled : tuple of (ErrorBudget, tuple of UnmodelledNoise)
        Of noises that it is not configured for.
    time_constants : mapping of str to (float, float)
        Time constants of the fastest and the slowest state of each sensor, s; empty where there are none.
    """

    configured: ErrorBudget
    unmodelled: tuple[tuple[ErrorBudget, tuple[UnmodelledNoise, ...]], ...]
    time_constants: dict[str, tuple[float, float]]


def score_sensitivity(
    settings: FilterSettings,
    plan: Scenario,
    budget: ErrorBudget,
    *,
    window: FloatArray,
    config: FilterConfig | None = None,
) -> ScoreSensitivity:
    """Return what each noise adds to the errors of a filter along a scenario.

    Parameters
    ----------
    settings, plan : FilterSettings, Scenario
        Filter and scenario.
    budget : ErrorBudget
        Of both.
    window : ndarray, shape (6,)
        Over how long the true biases are averaged, s.
    config : FilterConfig, optional
        What the filter was made from: its fixes may have errors that stay.
    """
    unmodelled = [unmodelled_budget(settings, plan, window)]
    if config is not None and config.gnss is not None:
        unmodelled.append(_correlated_budget(config, config.gnss, plan))
    time_constants = {}
    for title, key in (("gyro", "gyro_markov"), ("accelerometer", "accel_markov")):
        if key in settings.model.layout:
            values = settings.model.time_constant[settings.model.layout[key]]
            time_constants[title] = (float(values.min()), float(values.max()))
    return ScoreSensitivity(budget, tuple(unmodelled), time_constants)


def _correlated_budget(
    config: FilterConfig, gnss: GnssNoise, plan: Scenario
) -> tuple[ErrorBudget, tuple[UnmodelledNoise, ...]]:
    """Return what correlated errors of the fixes, as large as the white ones, add to those of a filter without them."""
    more = tuple(GaussMarkov(1.0, time) for time in CORRELATED_TIMES)
    wide = replace(config, gnss=replace(gnss, correlated=(*gnss.correlated, *more)))
    settings = filter_settings(wide, constants=config.constants)
    own, _ = known_sources(settings, plan)
    last = settings.model.layout["gnss_position"].stop
    first = last - 3 * len(CORRELATED_TIMES)
    known = np.ones(settings.size)
    known[first:last] = 0.0
    sources = []
    for i, time in enumerate(CORRELATED_TIMES):
        initial = np.zeros(settings.size)
        initial[first + 3 * i : first + 3 * i + 3] = own.fix_sd[:3] ** 2
        sources.append(Source(str(time), initial, 2.0 * initial / time, own.rate, np.zeros(6), np.zeros(6)))
    own = replace(own, initial=known * own.initial, drive=known * own.drive)
    noises = (
        UnmodelledNoise("position fixes", ExplanationKind.MISSING_CORRELATED, time)
        for time in CORRELATED_TIMES
    )
    return trace(settings, plan, own, sources), tuple(noises)


def score_contributions(found: Consistency, budget: ErrorBudget) -> FloatArray:
    """Return what every source adds to every score of a check, over the filter's prediction; shape (s, g)."""
    aided, rows = budget.aided, []
    errors, innovations = (
        (budget.covariance[aided], budget.total[aided]),
        (budget.innovation[aided], budget.innovation_total[aided]),
    )
    places = {name: (*errors, own) for name, own in {"nees": slice(0, 15), **BLOCKS}.items()}
    places |= {name: (*innovations, own) for name, own in INNOVATIONS.items()}
    for score in found.scores:
        if score.name in places:
            rows.append(_traces(*places[score.name]).mean(axis=0))
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


def variance_lost_by_averaging(sd: ArrayLike, time_constant: ArrayLike, window: ArrayLike) -> FloatArray:
    """Return the variance that a mean over a window, s, removes from flicker that states a decade apart represent."""
    above = np.log10(
        np.maximum(np.asarray(window, dtype=float) / (AVERAGING_RATIO * np.asarray(time_constant)), 1.0)
    )
    return np.asarray(np.asarray(sd) ** 2 * np.minimum(above, 1.0))


def unmodelled_budget(
    settings: FilterSettings, plan: Scenario, window: FloatArray
) -> tuple[ErrorBudget, tuple[UnmodelledNoise, ...]]:
    """Return the covariance caused by bias noises for which a filter is not configured, and those noises.

    For each sensor: its own states with time constants multiplied by each of `TIME_CONSTANT_FACTORS`, the decades of
    slow noise beyond the last state, the first of them alone, and the decade before the first state, each as strong
    as the state beside it. Where there are no states, sds are those of white noise over `UNMODELLED_TIME_CONSTANT`.
    """
    own, _ = known_sources(settings, plan)
    n, axes = settings.size, []
    white = [*settings.model.gyro_density.tolist(), *settings.model.accel_density.tolist()]
    wanted: list[tuple[UnmodelledNoise, dict[int, list[tuple[float, float]]]]] = []
    for first, title in ((0, "gyro"), (3, "accelerometer")):
        ladders = _ladders(settings, first)
        axes += [axis for axis, ladder in ladders.items() for _ in range(max(SLOWER_DECADES, len(ladder)))]
        if any(ladders.values()):
            for factor in TIME_CONSTANT_FACTORS:
                stretched = {axis: [(s, factor * t) for s, t in ladder] for axis, ladder in ladders.items()}
                wanted.append((UnmodelledNoise(title, ExplanationKind.TIME_CONSTANT, factor), stretched))
            faster = {
                axis: [(ladder[0][0], 0.1 * ladder[0][1])] for axis, ladder in ladders.items() if ladder
            }
            wanted.append((UnmodelledNoise(title, ExplanationKind.MISSING_FASTER), faster))
        last = {
            axis: [
                (white[axis] / math.sqrt(UNMODELLED_TIME_CONSTANT), 0.1 * UNMODELLED_TIME_CONSTANT),
                *ladder,
            ][-1]
            for axis, ladder in ladders.items()
        }
        for kind, decades in (
            (ExplanationKind.MISSING_SLOWER, SLOWER_DECADES),
            (ExplanationKind.MISSING_NEXT, 1),
        ):
            behind = {
                axis: [(s, 10.0 ** (j + 1) * t) for j in range(decades)] for axis, (s, t) in last.items()
            }
            wanted.append((UnmodelledNoise(title, kind), behind))
    rows = np.array(axes, dtype=np.int64)
    sources, averaged = [], np.zeros((len(wanted), 6))
    for g, (noise, states) in enumerate(wanted):
        initial, density2 = np.zeros(n + len(rows)), np.zeros(n + len(rows))
        rate = np.concatenate([own.rate, np.zeros(len(rows))])
        for row, ladder in states.items():
            for j, (s, t) in zip(n + np.flatnonzero(rows == row), ladder, strict=False):
                rate[j], initial[j], density2[j] = 1.0 / t, s**2, 2.0 * s**2 / t
                averaged[g, row] += float(variance_lost_by_averaging(s, t, window[row]))
        sources.append(Source(" ".join(map(str, noise)), initial, density2, rate, np.zeros(6), np.zeros(6)))
    found = trace(settings, plan, own, sources, rows=axes)
    found.covariance[:, :, range(9, 15), range(9, 15)] -= averaged
    return found, tuple(noise for noise, _ in wanted)


def _ladders(settings: FilterSettings, first: int) -> dict[int, list[tuple[float, float]]]:
    """Return the ladder of each axis of the gyros (first 0, axes 0 … 2) or the accelerometers (3, axes 3 … 5).

    A ladder is the sds and time constants, s, of the Gauss–Markov states of an axis, the fastest first.
    """
    model = settings.model
    key, axes = (
        ("gyro_markov", model.gyro_markov_axes) if first == 0 else ("accel_markov", model.accel_markov_axes)
    )
    block = model.layout[key] if axes else slice(0, 0)
    states = list(
        zip(axes, settings.initial_sd[block].tolist(), model.time_constant[block].tolist(), strict=True)
    )
    return {
        first + axis: sorted(((s, t) for a, s, t in states if a == axis), key=lambda pair: pair[1])
        for axis in range(3)
    }
