"""Several records of one sensor pooled: one value where they agree, a spread where they do not.

Each record i gives an estimate y_i = μ + b_i + e_i with its own known sd s_i; the effects b_i ~ N(0, τ²) are
what differs from start to start (or unit to unit, or axis to axis). Cochran's Q = Σ (y_i − ȳ)²/s_i² tests
τ = 0 as χ² with n − 1 degrees of freedom. Where it passes, the records are one sample and μ is the
inverse-variance mean; where it fails, τ is the restricted maximum-likelihood value, its interval inverts
Q(τ), and μ has the Hartung–Knapp interval on n − 1 degrees of freedom; two that differ have none.

References
----------
.. [1] W. G. Cochran, The combination of estimates from different experiments, Biometrics 10, 1954.
.. [2] W. Viechtbauer, Confidence intervals for the amount of heterogeneity in meta-analysis,
   Statist. Med. 26, 2007 (Q profile).
.. [3] J. Hartung, G. Knapp, On tests of the overall treatment effect in meta-analysis,
   Statist. Med. 20, 2001.
.. [4] A. Gonnermann, T. Framke, A. Großhennig, A. Koch, No solution yet for combining two independent
   studies in the presence of heterogeneity, Statist. Med. 34, 2015.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq, minimize_scalar

from models.arrays import FloatArray
from models.probability import chi2_beyond, chi2_quantile, normal_reach, student_quantile
from tuner.formats.grouping import gathered
from tuner.types import LEVEL, Coefficient, Identification, PooledChannel, PooledCoefficient
from tuner.types.records import DataError

TWO_DIFFER = "two logs that differ give no interval, only their range; a third log does"
"""Said of two estimates that are not one: Student's t on one degree of freedom is ± 12.7 sds, and every narrower
interval rests on a prior of the spread [4]_."""
VARIATION_P_VALUE = 0.05
"""Size of the test that decides whether records differ."""


@dataclass(frozen=True)
class RandomEffects:
    """Mean and spread of several estimates (see the module's page).

    `spread_interval` is the Q-profile interval of τ; `p_value` that of Cochran's test of τ = 0.
    """

    mean: float
    mean_interval: tuple[float, float]
    spread: float
    spread_interval: tuple[float, float]
    p_value: float


def random_effects(estimate: ArrayLike, sd: ArrayLike) -> RandomEffects:
    """Pool estimates with known standard deviations.

    Parameters
    ----------
    estimate, sd : array_like, shape (n,), n ≥ 2
        Estimates and their standard deviations, in one unit.

    Raises
    ------
    ValueError
        With fewer than two estimates or a standard deviation that is not positive.
    """
    y, s = np.asarray(estimate, float), np.asarray(sd, float)
    if y.size < 2 or y.shape != s.shape:
        raise ValueError(f"'estimate' and 'sd' must hold at least two values each, got {y.size} and {s.size}")
    if not np.all(s > 0):
        raise ValueError(f"'sd' must be positive, got {s.min()}")
    n = y.size
    cochran = _weighted_squares(y, s, 0.0)
    p_value = chi2_beyond(cochran, n - 1)
    spread_interval = (
        _spread_at(y, s, chi2_quantile(0.5 + 0.5 * LEVEL, n - 1.0)),
        _spread_at(y, s, chi2_quantile(0.5 - 0.5 * LEVEL, n - 1.0)),
    )
    spread = _restricted_likelihood_spread(y, s) if p_value < VARIATION_P_VALUE else 0.0
    weight = 1.0 / (s**2 + spread**2)
    mean = float(weight @ y / weight.sum())
    if p_value < VARIATION_P_VALUE:
        scatter = max(1.0, float(weight @ (y - mean) ** 2) / (n - 1))
        half = student_quantile(0.5 + 0.5 * LEVEL, n - 1) * math.sqrt(scatter / weight.sum())
    else:
        half = normal_reach(LEVEL) / math.sqrt(weight.sum())
    return RandomEffects(mean, (mean - half, mean + half), spread, spread_interval, p_value)


def pool(identifications: Sequence[Identification]) -> dict[str, PooledChannel]:
    """Pool the records of one sensor: every axis over the records, then every triad over its axes.

    Amplitudes and time constants are pooled as logarithms (their sd from the interval), the mean as it is: its
    spread is the turn-on repeatability. The triads ``gyro`` and ``accel`` pool the values of their axes: their
    spread is that between axes. What fewer than two of them identify is left out.

    Raises
    ------
    DataError
        Where two of them are of the same samples.
    """
    _refuse_repeated(identifications)
    axes = dict.fromkeys(axis for one in identifications for axis in one.channels)
    pooled: dict[str, PooledChannel] = {}
    for axis in axes:
        channels = [one.channels[axis] for one in identifications if axis in one.channels]
        if len(channels) < 2:
            continue
        tables = [
            {f"{e.name}.{field}": c for e in channel.terms for field, c in e.coefficients.items()}
            for channel in channels
        ]
        mean = pool_coefficients("mean", [c.mean for c in channels], logarithmic=False)
        pooled[axis] = PooledChannel(axis, channels[0].unit, _pool_tables(tables), mean)
    return pooled | _pool_triads(pooled)


def _refuse_repeated(identifications: Sequence[Identification]) -> None:
    """Refuse a record that is given twice: its means and levels are equal to the last digit."""
    known: dict[tuple[object, ...], object] = {}
    for one in identifications:
        figures = tuple((axis, c.mean.value, c.sigma_10s.value) for axis, c in one.channels.items())
        name = one.source.get("name", "unnamed")
        if figures in known and figures:
            raise DataError(
                f"{known[figures]}, {name}: expected two recordings, found the same samples twice: give each once"
            )
        known[figures] = name


def _pool_triads(axes: Mapping[str, PooledChannel]) -> dict[str, PooledChannel]:
    triads = gathered((axis.rpartition("_")[0] or axis, channel) for axis, channel in axes.items())
    answer = {}
    for name, channels in triads.items():
        coefficients = _pool_tables([{c.name: c.value for c in channel.coefficients} for channel in channels])
        if len(channels) > 1 and coefficients:
            answer[name] = PooledChannel(name, channels[0].unit, coefficients, None)
    return answer


def _pool_tables(tables: Sequence[Mapping[str, Coefficient]]) -> tuple[PooledCoefficient, ...]:
    names = dict.fromkeys(name for table in tables for name in table)
    found = (pool_coefficients(name, [t.get(name) for t in tables], logarithmic=True) for name in names)
    return tuple(one for one in found if one is not None)


def pool_coefficients(
    name: str, values: Sequence[Coefficient | None], *, logarithmic: bool
) -> PooledCoefficient | None:
    """Pool one coefficient over records; None where fewer than two records give it with an interval.

    A record that only bounds the coefficient below that interval widens it down to its bound, with the reason.

    The spread of a logarithm is relative (0.1: records differ by 10 %).
    """
    usable = [v for v in values if v is not None and v.value is not None and v.interval is not None]
    if len(usable) < 2:
        return None
    quantile = normal_reach(LEVEL)
    numbers = np.array([(v.value, *(v.interval or ())) for v in usable], float)
    scaled = np.log(numbers) if logarithmic else numbers
    result = random_effects(scaled[:, 0], (scaled[:, 2] - scaled[:, 1]) / (2.0 * quantile))
    back = math.exp if logarithmic else float
    unit = usable[0].unit
    low, high = result.mean_interval
    spread_low, spread_high = result.spread_interval
    spread_unit = "relative" if logarithmic else unit
    spread = (
        Coefficient.known(result.spread, spread_low, spread_high, spread_unit)
        if result.p_value < VARIATION_P_VALUE
        else Coefficient.bounded(
            spread_high, spread_unit, f"records agree (Cochran's test, p = {result.p_value:.2g})"
        )
    )
    if len(usable) == 2 and result.p_value < VARIATION_P_VALUE:
        mean, between = back(result.mean), result.spread
        value, spread = (
            Coefficient(v, None, None, u, TWO_DIFFER) for v, u in ((mean, unit), (between, spread_unit))
        )
        each = tuple(None if v is None else v.value for v in values)
        return PooledCoefficient(name, value, spread, each, result.p_value)
    least, why = _contradicting(values, back(low))
    return PooledCoefficient(
        name,
        Coefficient.known(back(result.mean), least, back(high), unit, why),
        spread,
        tuple(v.value if v is not None else None for v in values),
        result.p_value,
    )


def _contradicting(values: Sequence[Coefficient | None], low: float) -> tuple[float, str | None]:
    """Return the lower end of a pooled interval, no higher than any bound, and which bounds moved it."""
    bounds = [v for v in values if v is not None and v.value is None and v.upper is not None]
    below = [v.upper for v in bounds if v.upper is not None and v.upper < low]
    if not below:
        return low, None
    most = f"at most {min(below):.4g} {bounds[0].unit} (95 %)"
    return min(below), f"{len(below)} of {len(values)} allow less than the pooled value: {most}"


def _weighted_squares(y: FloatArray, s: FloatArray, spread: float) -> float:
    weight = 1.0 / (s**2 + spread**2)
    return float(weight @ (y - weight @ y / weight.sum()) ** 2)


def _spread_at(y: FloatArray, s: FloatArray, quantile: float) -> float:
    """Return the spread τ at which the weighted squares fall to `quantile`; 0 where they start below it."""
    if _weighted_squares(y, s, 0.0) <= quantile:
        return 0.0
    high = float(np.ptp(y) + s.max())
    while _weighted_squares(y, s, high) > quantile:
        high *= 2.0
    return float(brentq(lambda x: _weighted_squares(y, s, x) - quantile, 0.0, high))


def _restricted_likelihood_spread(y: FloatArray, s: FloatArray) -> float:
    def cost(spread: float) -> float:
        variance = s**2 + spread**2
        information = float(np.sum(1.0 / variance))
        return float(np.sum(np.log(variance))) + math.log(information) + _weighted_squares(y, s, spread)

    bound = 4.0 * float(np.ptp(y)) + float(s.max())
    return float(
        minimize_scalar(cost, bounds=(0.0, bound), method="bounded", options={"xatol": 1e-10 * bound}).x
    )
