"""What may explain the scores of a filter, each with the pattern of scores that it would cause.

A score that should be 1 is the mean of tr(P⁻¹ V) over its epochs, where V is the true covariance of the errors
that the filter believes to be P. Both are sums over sources (`tuner.consistency.error_budget`), so that every
explanation
predicts all scores at once, from one number θ::

    a source is wrong by θ in sd           E s = s₀ + (θ² − 1) a_source
    time constants are wrong by θ          E s = s₀ − a_states + a(the same states with time constants θ T)
    a process is missing, of sd θ          E s = s₀ + θ² a(the process)

with a = tr(P⁻¹ V_source) and s₀ their sum, about 1, both from `tuner.consistency.attribution.sensitivity`. The
same holds for every element
of the whitened matrices of `tuner.consistency.attribution.likelihood`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tuner.consistency.attribution.sensitivity import STRETCHES, UNMODELLED

FloatArray = NDArray[np.float64]

LARGEST = math.log(100.0)
"""Largest factor in an sd that is considered, as a logarithm."""


@dataclass(frozen=True)
class Explanation:
    """A cause whose size θ is still open.

    Attributes
    ----------
    source : str
        What is wrong.
    expected : callable
        Of ln θ; the scores that are expected, and behind them the products of
        `tuner.consistency.attribution.likelihood`.
    bounds : (float, float)
        Of ln θ.
    words : callable
        Of θ and its interval.
    same : str
        The source that says the same in other words where θ < 1; empty where none does.
    """

    source: str
    expected: Callable[[float], FloatArray]
    bounds: tuple[float, float]
    words: Callable[[float, tuple[float, float]], str]
    same: str = ""


def explanations(
    own: dict[str, FloatArray],
    unknown: dict[tuple[str, str, float], FloatArray],
    constants: dict[str, tuple[float, float]],
) -> list[Explanation]:
    """Return the rivals, from the patterns (s,) of known sources and of unknown (sensor, kind, factor)."""
    sensors = {"gyro": "gyro bias noise", "accelerometer": "accelerometer bias noise"}
    groups: dict[str, tuple[str, ...]] = {name: (name,) for name in own}
    groups["bias noise of gyros and accelerometers"] = tuple(sensors.values())
    groups["turn-on biases of gyros and accelerometers"] = tuple(f"{title} turn-on bias" for title in sensors)
    groups["all sensor noise"] = tuple(
        f"{title} {noise}" for title in sensors for noise in ("white noise", "bias noise", "bias random walk")
    )
    groups["position and velocity fixes"] = ("position fixes", "velocity fixes")
    groups["white and correlated noise of the fixes"] = (
        "position fixes",
        "velocity fixes",
        "correlated fixes",
    )
    base = np.sum(list(own.values()), axis=0)
    rivals = []
    for name, members in groups.items():
        inside = [own[member] for member in members if member in own]
        if len(inside) == len(members) or name == "all sensor noise":
            rivals.append(_scaled(name, base, np.sum(inside, axis=0)))
    for name, titles in (
        *((title, (title,)) for title in sensors),
        ("gyro and accelerometer", tuple(sensors)),
    ):
        if all(title in constants for title in titles):
            stretched = {
                factor: np.sum([unknown[title, "stretched", factor] for title in titles], axis=0)
                for factor in STRETCHES
            }
            states = np.sum([own[sensors[title]] for title in titles], axis=0)
            rivals.append(_stretched(name, base, states, stretched))
        for kind in ("slower", "next", "faster"):
            if all((title, kind, 1.0) in unknown for title in titles):
                column = np.sum([unknown[title, kind, 1.0] for title in titles], axis=0)
                edges = [constants[title] for title in titles if title in constants]
                rivals.append(_missing(name, kind, base, column, edges))
    return rivals


def _sized(theta: float, interval: tuple[float, float]) -> str:
    """Return a factor, taken above 1, with its interval."""
    low, high = interval if theta > 1.0 else (1.0 / interval[1], 1.0 / interval[0])
    return f"about {max(theta, 1.0 / theta):.2g} times{_between(max(low, 1.0), high)}"


def _between(low: float, high: float) -> str:
    """Return an interval in words, nothing where it is narrower than the digits shown."""
    return "" if f"{low:.2g}" == f"{high:.2g}" else f" ({low:.2g} … {high:.2g})"


def _scaled(name: str, base: FloatArray, share: FloatArray) -> Explanation:
    def words(theta: float, interval: tuple[float, float]) -> str:
        return f"{name} (sd) {_sized(theta, interval)} too {'small' if theta > 1.0 else 'large'}"

    return Explanation(name, lambda x: base + (math.exp(2.0 * x) - 1.0) * share, (-LARGEST, LARGEST), words)


def _stretched(
    name: str, base: FloatArray, states: FloatArray, stretched: dict[float, FloatArray]
) -> Explanation:
    from scipy.interpolate import PchipInterpolator  # loaded when used: slow to import

    points = {0.0: states, **{math.log(factor): column for factor, column in stretched.items()}}
    x = np.array(sorted(points))
    curve = PchipInterpolator(x, np.array([points[value] for value in x]))
    what = f"time constants of the {name} bias noise"

    def words(theta: float, interval: tuple[float, float]) -> str:
        return f"{what} {_sized(theta, interval)} too {'long' if theta < 1.0 else 'short'}"

    return Explanation(
        what,
        lambda value: np.asarray(base - states + curve(value)),
        (float(x[0]), float(x[-1])),
        words,
        f"missing {name} bias noise (faster)",
    )


def _missing(
    name: str, kind: str, base: FloatArray, column: FloatArray, edges: Sequence[tuple[float, float]]
) -> Explanation:
    """Return the explanation that states are missing beside those with the time constants `edges`."""
    if edges:
        fast, slow = min(edge[0] for edge in edges), max(edge[1] for edge in edges)
        where = {
            "slower": f"over decades slower than the slowest state ({slow:.3g} s)",
            "next": f"a decade slower than the slowest state ({slow:.3g} s)",
            "faster": f"a decade faster than the fastest state ({fast:.3g} s)",
        }[kind]
    else:
        where = "over decades" if kind == "slower" else f"of some {UNMODELLED:g} s"

    def words(theta: float, interval: tuple[float, float]) -> str:
        size = f", about {theta:.2g} times{_between(*interval)} as strong" if edges else ""
        return f"{name} bias noise {where} is missing{size}"

    return Explanation(
        f"missing {name} bias noise ({kind})",
        lambda x: base + math.exp(2.0 * x) * column,
        (-LARGEST, LARGEST),
        words,
    )
