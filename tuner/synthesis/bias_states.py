"""Bias states of a filter: what flicker and identified correlations become.

A filter knows white noise, random walks and first-order Gauss–Markov states. Flicker, S(f) = B²/(2πf), is
none of them; it is approached by a *ladder* of Gauss–Markov states with time constants in a geometric ratio
r and equal

    σ_i = B √(ln r / π)        (r = 10: 0.856 B, Allan variance within 2 %)

from about the corner of white noise and flicker, (N / 0.664 B)², to the longest time the filter must
predict. One state instead of a ladder is cheaper and optimistic; `RULES` names the usual choices and how
far the true error exceeded the predicted standard deviation in outages of 10 to 1000 s (exact covariance
propagation of four filters).

The state that is safe whatever the true values in a box of sd and time constant: the structure function
2σ²(1 − e^{−τ/T}) is largest at every lag for the largest σ and the smallest T, but the integral of the bias
(angle, velocity) grows as 2σ²T t and is largest for the largest T. No corner of the box bounds both. A
state whose spectrum lies above all spectra of the box does: the difference of two spectra that is nowhere
negative is the spectrum of a process that could be added, so any linear filter's error is bounded. Among
single states the smallest such one is

    T' = √(T_lo T_hi),    σ'² = σ_hi² √(T_hi / T_lo).

Symbols: B level, N white density, σ sd, T time constant (s), τ_min cluster time of the Allan minimum (s).

References
----------
.. [1] IEEE Std 952-1997, Annex C (exponentially correlated noise, Allan variance).
.. [2] S. Langel, O. García Crespillo, M. Joerger, "Overbounding the effect of uncertain Gauss-Markov noise in
   Kalman filtering", NAVIGATION 68(2), 2021, 259–276 (abstract read: bounds of the same kind).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from models.noise import GaussMarkov, Term
from models.noise.bias_instability import ALLAN_FLOOR, flicker_ladder

PEAK_TIME = 1.89262
"""Cluster time of the Allan peak of a Gauss–Markov process ÷ its time constant."""

PEAK_SD = 0.617364
"""Allan deviation at that peak ÷ sd."""


@dataclass(frozen=True)
class FlickerView:
    """What a rule may look at, SI.

    Attributes
    ----------
    level : float
        B of flicker.
    density : float
        White density N.
    minimum, minimum_tau : float
        Smallest Allan deviation and its cluster time, s.
    horizon : float
        Longest time the filter must predict without aiding, s.
    interval : float
        Sampling interval, s.
    """

    level: float
    density: float
    minimum: float
    minimum_tau: float
    horizon: float
    interval: float

    @property
    def corner(self) -> float:
        """Cluster time where white noise meets the flicker floor, s."""
        return (self.density / (ALLAN_FLOOR * self.level)) ** 2


@dataclass(frozen=True)
class Rule:
    """A way to put flicker into a filter, with its price.

    Attributes
    ----------
    formula : str
        What it sets.
    worst_ratio : float
        Largest true rms ÷ predicted sd seen in outages of 10 to 1000 s.
    states : callable
        `FlickerView` → bias states.
    """

    formula: str
    worst_ratio: float
    states: Callable[[FlickerView], tuple[GaussMarkov, ...]]

    def describe(self) -> str:
        """Say formula and price in one line."""
        return f"{self.formula}; true error up to {self.worst_ratio:g} × predicted in outages of 10 to 1000 s"


def ladder(view: FlickerView) -> tuple[GaussMarkov, ...]:
    """Return one state a decade, sd 0.856 B each, from the horizon down to the first below twice the corner.

    A state of time constant T < corner/3 lies below white noise at every frequency and could not be observed.
    """
    shortest = min(max(2.0 * view.corner, view.interval), view.horizon)
    decades = math.ceil(math.log10(view.horizon / shortest))
    rungs = flicker_ladder(view.level, view.horizon / 10.0**decades, view.horizon, per_decade=1)
    return tuple(GaussMarkov(rung.sd, rung.time_constant) for rung in rungs)


def _peak(view: FlickerView) -> tuple[GaussMarkov, ...]:
    return (GaussMarkov(ALLAN_FLOOR / PEAK_SD * view.level, view.minimum_tau / PEAK_TIME),)


def _level(view: FlickerView) -> tuple[GaussMarkov, ...]:
    return (GaussMarkov(view.level, view.minimum_tau),)


def _minimum(view: FlickerView) -> tuple[GaussMarkov, ...]:
    return (GaussMarkov(view.minimum, view.minimum_tau),)


def _wide(view: FlickerView) -> tuple[GaussMarkov, ...]:
    return (GaussMarkov(1.5 * view.level, view.minimum_tau / 2.0),)


RULES: Mapping[str, Rule] = MappingProxyType(
    {
        "ladder": Rule("ladder of Gauss–Markov states, one a decade, sd 0.856 B each", 1.09, ladder),
        "wide": Rule("one Gauss–Markov state, sd 1.5 B, time constant τ_min/2", 1.36, _wide),
        "peak": Rule(
            "one Gauss–Markov state, sd 1.08 B, time constant τ_min/1.893 (Allan peaks match)", 1.65, _peak
        ),
        "level": Rule("one Gauss–Markov state, sd B, time constant τ_min", 2.0, _level),
        "minimum": Rule(
            "one Gauss–Markov state, sd of the Allan minimum, time constant τ_min", 2.4, _minimum
        ),
    }
)
"""Rules by name, safest first. All leave rate random walk and turn-on constant to states of their own."""


BOUND = "bound"
"""The rule that takes the upper end of every interval: ladder for flicker, `bounding_state` for the rest."""


def bounding_state(sd: tuple[float, float], time_constant: tuple[float, float]) -> GaussMarkov:
    """Return the smallest single state whose spectrum lies above every spectrum of a box.

    Parameters
    ----------
    sd : (float, float)
        Interval of the sd, unit.
    time_constant : (float, float)
        Interval of the time constant, s.

    Returns
    -------
    GaussMarkov
        A filter that uses it predicts, for any state or outage, at least the variance of any process in the
        box.
    """
    low, high = time_constant
    if not 0.0 < low <= high < math.inf:
        raise ValueError(f"'time_constant' must be an interval of positive numbers, got {time_constant}")
    return GaussMarkov(sd[1] * (high / low) ** 0.25, math.sqrt(low * high))


def spectrum_bound(term: Term) -> GaussMarkov:
    """Return the Gauss–Markov state of least variance whose spectrum lies nowhere below that of a stationary term.

    For a time constant T the least variance is max_f S(f) (1 + (2πfT)²)/(2T); T is the best of a fine grid. The error
    of any linear filter with this state in place of the term is no larger than the filter says.

    Raises
    ------
    ValueError
        Where the term is not stationary, or its spectrum falls less steeply than 1/f² at high frequencies.
    """
    variance = float(term.autocovariance(0.0))
    found = term.exponentials()
    if found is None:
        raise ValueError(
            f"noise term '{term.name}' has no state space, so that no Gauss–Markov state can stand for it"
        )
    rates = np.abs(found[1])
    time = np.geomspace(0.1 / rates.max(), 10.0 / rates.min(), BOUND_GRID)
    f = np.geomspace(1e-3 * rates.min(), 1e3 * rates.max(), 10 * BOUND_GRID) / (2.0 * np.pi)
    corner = (2.0 * np.pi * f * time[:, None]) ** 2
    needed = np.max(term.psd(f) * (1.0 + corner), axis=1) / (2.0 * time)
    best = int(np.argmin(needed))
    if needed[best] > MAX_BOUND_VARIANCE * variance:
        ratio = needed[best] / variance
        raise ValueError(
            f"noise term '{term.name}': one Gauss–Markov state would need {ratio:.3g} times its variance"
        )
    return GaussMarkov(math.sqrt(float(needed[best])), float(time[best]))


BOUND_GRID = 300
"""Time constants that are tried; the variance is then within 0.8 % of the least."""
MAX_BOUND_VARIANCE = 100.0
"""Variance of a bounding state ÷ that of the term beyond which the state says nothing useful of it: white noise, or a
narrow line."""
