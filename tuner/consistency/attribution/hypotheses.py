"""Hypotheses on what is wrong with a configuration, each with the scores that it expects.

A score that should be 1 is the mean of tr(P⁻¹ V) over its epochs, where V is the true covariance of the errors
and P the one that the filter predicts. Both are sums over sources (`tuner.consistency.error_budget`), so that every
hypothesis predicts all scores at once, from one number θ::

    a source is wrong by θ in sd           E s = s₀ + (θ² − 1) a_source
    time constants are wrong by θ          E s = s₀ − a_states + a(the same states with time constants θ T)
    a process is missing, of sd θ          E s = s₀ + θ² a(the process)

with a = tr(P⁻¹ V_source) and s₀ their sum, about 1, both from `tuner.consistency.attribution.sensitivity`. The same
holds for every element of the whitened matrices of `tuner.consistency.attribution.likelihood`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from tuner.consistency.attribution.sensitivity import TIME_CONSTANT_FACTORS, UnmodelledNoise
from tuner.types.verdict import ExplanationKind, explanation_source

LOG_MAX_RATIO = math.log(100.0)
"""Largest ratio of true to configured sd that is considered, as a logarithm: beyond it a filter diverges."""


@dataclass(frozen=True)
class Hypothesis:
    """Something wrong with a configuration, of a size θ that is still unknown.

    Attributes
    ----------
    kind : ExplanationKind
        In which way it is wrong.
    process : str
        The source of errors, such as ``gyro bias noise``.
    expected : callable
        Of ln θ; the scores that are expected, and behind them the products of
        `tuner.consistency.attribution.likelihood`.
    bounds : (float, float)
        Of ln θ; by default as far as `LOG_MAX_RATIO`.
    time_constant : float or None
        Of the state beside a missing process, s; None where the filter has none.
    equivalent : str
        Source of the hypothesis that describes the same error where θ < 1; empty where none does.
    """

    kind: ExplanationKind
    process: str
    expected: Callable[[float], FloatArray]
    bounds: tuple[float, float] = (-LOG_MAX_RATIO, LOG_MAX_RATIO)
    time_constant: float | None = None
    equivalent: str = ""

    @property
    def source(self) -> str:
        """What is wrong, in a few words."""
        return explanation_source(self.kind, self.process)


@dataclass(frozen=True)
class Fit:
    """A hypothesis at its best size: ln θ, its interval, the misfit of scores, and −2 ln p by run, (m,).

    `level_loss` is what −2 ln p rises, in the mean, where all that is expected is larger by the error of the model,
    `beyond` whether the best size lies beyond the bounds of the search: then the pattern is another hypothesis's.
    """

    hypothesis: Hypothesis
    size: float
    interval: tuple[float, float]
    misfit: float
    loss: FloatArray
    level_loss: float
    beyond: bool


def hypotheses(
    own: Mapping[str, FloatArray],
    unmodelled: Mapping[UnmodelledNoise, FloatArray],
    time_constants: Mapping[str, tuple[float, float]],
) -> list[Hypothesis]:
    """Return all hypotheses on the errors of a configuration.

    Parameters
    ----------
    own : mapping of str to ndarray, shape (s,)
        What each configured source adds to every score and product.
    unmodelled : mapping of UnmodelledNoise to ndarray, shape (s,)
        What noise adds that the filter has no states for.
    time_constants : mapping of str to (float, float)
        Of the fastest and the slowest state of a sensor, s.
    """
    sensors = {"gyro": "gyro bias noise", "accelerometer": "accelerometer bias noise"}
    groups: dict[str, tuple[str, ...]] = {
        **{name: (name,) for name in own},
        "bias noise of gyros and accelerometers": tuple(sensors.values()),
        "turn-on biases of gyros and accelerometers": tuple(f"{title} turn-on bias" for title in sensors),
        "start": ("initial position and velocity", "initial tilt", "initial heading"),
        "all sensor noise": tuple(
            f"{title} {noise}"
            for title in sensors
            for noise in ("white noise", "bias noise", "bias random walk")
        ),
        "position and velocity fixes": ("position fixes", "velocity fixes"),
        "white and correlated noise of the fixes": ("position fixes", "velocity fixes", "correlated fixes"),
    }
    base = np.sum(list(own.values()), axis=0)
    answer = []
    for name, members in groups.items():
        inside = [own[member] for member in members if member in own]
        if len(inside) == len(members) or name == "all sensor noise":
            answer.append(_scaled(name, base, np.sum(inside, axis=0)))
    for name, titles in (
        *((title, (title,)) for title in sensors),
        ("gyro and accelerometer", tuple(sensors)),
    ):
        process = f"{name} bias noise"
        if all(title in time_constants for title in titles):
            stretched = {
                factor: column
                for factor in TIME_CONSTANT_FACTORS
                if np.isfinite(
                    column := _summed(unmodelled, titles, ExplanationKind.TIME_CONSTANT, factor)
                ).all()
            }
            states = np.sum([own[sensors[title]] for title in titles], axis=0)
            answer.append(_stretched(process, base, states, stretched))
        for kind in (
            ExplanationKind.MISSING_SLOWER,
            ExplanationKind.MISSING_NEXT,
            ExplanationKind.MISSING_FASTER,
        ):
            if all(UnmodelledNoise(title, kind) in unmodelled for title in titles):
                column = _summed(unmodelled, titles, kind, 1.0)
                ends = [time_constants[title] for title in titles if title in time_constants]
                beside = max((slowest for _, slowest in ends), default=None)
                if kind is ExplanationKind.MISSING_FASTER:
                    beside = min((fastest for fastest, _ in ends), default=None)
                answer.append(_missing(kind, process, base, column, beside))
    return answer + [
        _missing(noise.kind, noise.sensor, base, column, noise.factor)
        for noise, column in unmodelled.items()
        if noise.kind is ExplanationKind.MISSING_CORRELATED
    ]


def _summed(
    unmodelled: Mapping[UnmodelledNoise, FloatArray],
    titles: Sequence[str],
    kind: ExplanationKind,
    factor: float,
) -> FloatArray:
    return np.asarray(np.sum([unmodelled[UnmodelledNoise(title, kind, factor)] for title in titles], axis=0))


def _scaled(process: str, base: FloatArray, share: FloatArray) -> Hypothesis:
    return Hypothesis(
        ExplanationKind.SCALE,
        process,
        lambda x: base + (math.exp(2.0 * x) - 1.0) * share,
    )


def _stretched(
    process: str, base: FloatArray, states: FloatArray, stretched: Mapping[float, FloatArray]
) -> Hypothesis:
    from scipy.interpolate import PchipInterpolator  # loaded when used: slow to import

    points = {0.0: states, **{math.log(factor): column for factor, column in stretched.items()}}
    x = np.array(sorted(points))
    curve = PchipInterpolator(x, np.array([points[value] for value in x]))
    return Hypothesis(
        ExplanationKind.TIME_CONSTANT,
        process,
        lambda value: np.asarray(base - states + curve(value)),
        (float(x[0]), float(x[-1])),
        equivalent=explanation_source(ExplanationKind.MISSING_FASTER, process),
    )


def _missing(
    kind: ExplanationKind, process: str, base: FloatArray, column: FloatArray, time_constant: float | None
) -> Hypothesis:
    """Return the hypothesis that a process is missing, beside a state or of this time constant, s."""
    return Hypothesis(kind, process, lambda x: base + math.exp(2.0 * x) * column, time_constant=time_constant)
