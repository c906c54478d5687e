"""What explains the scores of a filter: rival explanations, each with the pattern of scores it would cause.

A score that should be 1 is the mean of tr(P⁻¹ V) over its epochs, where V is the true covariance of the errors
that the filter believes to be P. Both are sums over sources (`tuner.budget`), so that every explanation
predicts all scores at once, from one number θ::

    a source is wrong by θ in sd           E s = s₀ + (θ² − 1) a_source
    time constants are wrong by θ          E s = s₀ − a_states + a(the same states with time constants θ T)
    a process is missing, of sd θ          E s = s₀ + θ² a(the process)

with a = tr(P⁻¹ V_source) and s₀ their sum, about 1, both from `tuner.responses`. The explanations compete by
their misfit in the logarithms of the scores.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tuner.consistency import Consistency
from tuner.responses import STRETCHES, UNMODELLED, Responses, patterns

FloatArray = NDArray[np.float64]

LARGEST = math.log(100.0)
"""Largest factor in an sd that is considered, as a logarithm."""
LEVEL_SCATTER = 0.05
"""Scatter of a score that linear covariance cannot explain (ladder for flicker, curvature)."""
LIKELY = 4.0
"""Misfit by which a size may be worse than the best of its explanation and still be likely."""
AS_GOOD = 9.0
"""Misfit by which an explanation may be worse than the best and still be named."""


@dataclass(frozen=True)
class Cause:
    """An explanation of the scores.

    Attributes
    ----------
    source : str
        What is wrong.
    ratio : float
        True ÷ believed sd, or time constant; of a missing process, its sd ÷ that of the nearest state.
    interval : (float, float)
        Values of it that are as likely (95 %); ends at the bounds of the search.
    misfit : float
        Sum of squares left over.
    text : str
        In words.
    """

    source: str
    ratio: float
    interval: tuple[float, float]
    misfit: float
    text: str


@dataclass(frozen=True)
class Explanation:
    """A cause whose size θ is still open: what scores are expected, (s,), at ln θ within bounds, and the words."""

    source: str
    expected: Callable[[float], FloatArray]
    bounds: tuple[float, float]
    words: Callable[[float, tuple[float, float]], str]


def attribute(found: Consistency, response: Responses) -> tuple[Cause, ...]:
    """Return the explanations, best first, of the scores of simulated runs; none where nothing explains them.

    Returned are those that take half of the misfit away and are nearly as good as the best.
    """
    ratios = np.array([score.mean / score.dof for score in found.scores])
    effective = np.array([score.effective for score in found.scores])
    own = dict(zip(response.known.sources, patterns(found, response.known).T, strict=True))
    unknown = dict(zip(response.names, patterns(found, response.strange).T, strict=True))
    return best(ratios, effective, explanations(own, unknown, response.constants))


def best(ratios: FloatArray, effective: FloatArray, rivals: Sequence[Explanation]) -> tuple[Cause, ...]:
    """Return the rivals that explain mean squares over their expectations, shape (s,), best first."""
    from scipy.optimize import minimize_scalar  # loaded when used: slow to import

    scatter = np.sqrt(2.0 / effective + LEVEL_SCATTER**2)
    nothing = float(np.sum((np.log(ratios) / scatter) ** 2))
    causes = []
    for rival in rivals:

        def misfit(x: float, rival: Explanation = rival) -> float:
            expected = np.maximum(rival.expected(x), 1e-6)
            return float(np.sum((np.log(ratios / expected) / scatter) ** 2))

        grid = np.linspace(*rival.bounds, 161)
        values = np.array([misfit(float(x)) for x in grid])
        start = grid[int(np.argmin(values))]
        step = float(grid[1] - grid[0])
        near = (max(start - step, rival.bounds[0]), min(start + step, rival.bounds[1]))
        fit = minimize_scalar(misfit, bounds=near, method="bounded")
        likely = np.exp(grid[values <= fit.fun + LIKELY])
        theta = math.exp(float(fit.x))
        low, high = min([theta, *likely]), max([theta, *likely])
        causes.append(
            Cause(rival.source, theta, (low, high), float(fit.fun), rival.words(theta, (low, high)))
        )
    causes.sort(key=lambda cause: cause.misfit)
    limit = min(max(2.0 * causes[0].misfit, causes[0].misfit + AS_GOOD), 0.5 * nothing)
    return tuple(cause for cause in causes if cause.misfit <= limit)


def explanations(
    own: dict[str, FloatArray],
    unknown: dict[tuple[str, str, float], FloatArray],
    constants: dict[str, tuple[float, float]],
) -> list[Explanation]:
    """Return the rivals, from the patterns (s,) of known sources and of unknown (sensor, kind, factor)."""
    sensors = {"gyro": "gyro bias noise", "accelerometer": "accelerometer bias noise"}
    groups: dict[str, tuple[str, ...]] = {name: (name,) for name in own}
    groups["bias noise of gyros and accelerometers"] = tuple(sensors.values())
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
        what, lambda value: np.asarray(base - states + curve(value)), (float(x[0]), float(x[-1])), words
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
