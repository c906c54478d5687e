"""Which terms a record contains: every sum of the base is fitted, and a term must earn its price.

White noise is always there; quantization, bias instability or one Gauss–Markov process, random walk and ramp
may join it. Of these 24 sums the one with the least score is chosen::

    score = -2 ln L + Σ prices of its terms

A term enters where it raises 2 ln L by more than its price. For a variance that is zero in truth the rise
is half χ²₀, half χ²₁ (at most: for a random walk in few coefficients it is smaller); for the rate of a
ramp it is χ²₁. A ramp and a Gauss–Markov process cost more than their own tests ask, because they
also stand in for a random walk or flicker seen for a short time: a line needs clearly more evidence
than a random walk that drew it, and bias instability comes before a Gauss–Markov process of one
parameter more. With these prices fewer than 5 % of records get a term they do not have, of whatever
kind, whether the truth is white noise alone or with quantization, flicker, random walk or the last two
(benchmarks/accuracy.py).

A term that is not chosen has an upper limit: the upper end of its 95 % interval beside the chosen terms. It
is exceeded in 2.5 % of all records, so that it still holds in 95 % of just those that do not show the term.

References
----------
.. [1] S. G. Self, K.-Y. Liang, Asymptotic properties of maximum likelihood estimators and likelihood ratio
   tests under nonstandard conditions, J. Am. Stat. Assoc. 82 (1987).
.. [2] R. B. Davies, Hypothesis testing when a nuisance parameter is present only under the alternative,
   Biometrika 64 (1977).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from models.arrays import LEAST_DIVISOR, FloatArray
from models.noise import TERMS, NoiseModel, Ramp, RandomWalk, Term
from models.probability import REACH_95
from tuner.identification.intervals import end
from tuner.identification.likelihood import LikelihoodFit, describe, magnitude, slope_interval
from tuner.identification.objective import Objective
from tuner.identification.periodogram import CosinePeriodogram
from tuner.identification.record_length import LONGEST_HOURS, relative_sd
from tuner.types import Candidate
from tuner.types.coefficient import TOO_SHORT

TERM_PRICE = {
    "quantization": 6.6,
    "white": 0.0,
    "bias_instability": 5.4,
    "gauss_markov": 12.0,
    "random_walk": 5.4,
    "ramp": 11.0,
}
"""Rise of 2 ln L that a term must bring."""

ABSENT_SHARE = 0.1
"""A term whose limit stays below this share of the Allan variance at every cluster time is called absent."""

TWIN_CORRELATION = 0.9
"""Correlation of two amplitudes from which on one hides the other."""

DETECTED_RELATIVE_SD = 0.2
"""Relative standard deviation of an amplitude at which four records of five show the term."""


@dataclass(frozen=True)
class Bound:
    """A term the record does not show: its parameter, the upper limit of that, and the reason."""

    name: str
    parameter: str
    upper: float
    reason: str


@dataclass(frozen=True)
class Selection:
    """The chosen sum; every sum, best first, its score relative to that; bounds of the other terms."""

    fit: LikelihoodFit
    candidates: tuple[Candidate, ...]
    bounded: tuple[Bound, ...]


def select_periodogram(data: CosinePeriodogram, further: Sequence[str] = ()) -> Selection:
    """Choose the terms that a cosine periodogram contains, and fit them.

    Parameters
    ----------
    data : CosinePeriodogram
        What was measured.
    further : sequence of str
        Terms that every sum has besides, such as a Gauss–Markov process that a diagnosis found. Where the data set
        one of their parameters no limit, the absent terms have none beside them either.
    """
    tried = []
    for terms in ((*base, *further) for base in _sums()):
        objective = Objective.of(data, terms)
        theta = objective.maximum()
        score = sum(TERM_PRICE[name] for name in terms) - 2.0 * objective.log_likelihood(theta)
        tried.append((score, terms, objective, theta))
    tried.sort(key=lambda entry: entry[0])
    least, chosen, objective, theta = tried[0]
    fit = describe(objective, theta)
    candidates = tuple(Candidate(terms, score - least, _note(terms, chosen)) for score, terms, _, _ in tried)
    absent = [name for name in TERM_PRICE if name not in chosen and name != "gauss_markov"]
    limited = not further or all(np.isfinite(high) for _, high in fit.intervals)
    bounds = tuple(_bound(data, fit, name) for name in absent) if limited else ()
    return Selection(fit, candidates, bounds)


def _sums() -> list[tuple[str, ...]]:
    """Return the sums of the base, in the order of `TERM_PRICE`."""
    optional = (
        ((), ("quantization",)),
        ((), ("bias_instability",), ("gauss_markov",)),
        ((), ("random_walk",)),
        ((), ("ramp",)),
    )
    return [(*q, "white", *slow, *k, *r) for q, slow, k, r in product(*optional)]


def _note(terms: tuple[str, ...], chosen: tuple[str, ...]) -> str:
    """Name the terms by which a sum differs from the chosen one."""
    without = [f"without {name}" for name in chosen if name not in terms]
    extra = [f"with {name}" for name in terms if name not in chosen]
    return ", ".join(extra + without) or "chosen"


def _bound(data: CosinePeriodogram, fit: LikelihoodFit, name: str) -> Bound:
    """Return the upper limit of a term that was not chosen, and the reason why it is not determined."""
    objective = Objective.of(data, (*fit.terms, name))
    theta = objective.maximum()
    if name == Ramp.name:
        upper = magnitude(slope_interval(objective, theta))[1]
        term: Term = Ramp(upper)
        twin = RandomWalk.name if RandomWalk.name in fit.terms else None
    else:
        kinds = [kind.name for kind in objective.kinds]
        sizes = [len(kind.PARAMETERS) for kind in objective.kinds]
        j = sum(sizes[: kinds.index(name)])
        upper, theta = end(objective, theta, j, REACH_95)
        if not np.isfinite(upper):
            return Bound(name, TERMS[name].PARAMETERS[0], upper, f"{TOO_SHORT}: it sets no limit")
        term = TERMS[name](**{TERMS[name].PARAMETERS[0]: upper})
        twin = _twin(objective, theta, j)
    return Bound(name, term.PARAMETERS[0], upper, _reason(term, fit.model, data, twin))


def _twin(objective: Objective, theta: FloatArray, j: int) -> str | None:
    """Return the term whose amplitude is indistinguishable from that of parameter j, if there is one."""
    information = objective(theta)[2]
    scale = np.sqrt(np.diag(information) + 1e-12)
    covariance = np.linalg.pinv(information / np.outer(scale, scale))
    spread = np.sqrt(np.diag(covariance))
    correlation = np.abs(covariance[j] / (spread * spread[j] + LEAST_DIVISOR))
    owner = [kind.name for kind in objective.kinds for _ in kind.PARAMETERS]
    correlation[j] = 0.0
    strongest = int(np.argmax(correlation))
    return owner[strongest] if correlation[strongest] > TWIN_CORRELATION else None


def _reason(term: Term, model: NoiseModel, data: CosinePeriodogram, twin: str | None) -> str:
    """Say why a term is only bounded."""
    longest = data.longest
    tau = data.interval * 2.0 ** np.arange(np.log2(max(longest / data.interval / 4.0, 1.0)) + 1e-9)
    share = term.allan_variance(tau, interval=data.interval) / model.allan_variance(
        tau, interval=data.interval
    )
    at = int(np.argmax(share))
    if share[at] < ABSENT_SHARE:
        part = 100.0 * np.sqrt(share[at])
        return (
            f"not seen: at most {part:.2g} % of the Allan deviation at any cluster time up to {tau[-1]:.3g} s"
        )
    if twin is not None:
        return f"hidden by a twin slope: {twin} explains the same part of the curve"
    if at == len(tau) - 1 and (hours := _hours_needed(term, model, data)) is not None:
        return f"{TOO_SHORT}: {hours:.3g} hours needed to show half of this limit"
    each = [other.allan_variance(tau[at : at + 1], interval=data.interval)[0] for other in model.terms]
    larger = model.terms[int(np.argmax(each))].name
    return f"masked by a larger term: {larger} at τ = {tau[at]:.3g} s"


def _hours_needed(term: Term, model: NoiseModel, data: CosinePeriodogram) -> float | None:
    """Return the length of a record that shows half of a term, h; None beyond `LONGEST_HOURS`."""
    extended = NoiseModel((term.scaled(0.5), *(t for t in model.terms if t.name != Ramp.name)))
    now = data.longest / 3600.0
    for hours in now * 1.25 ** np.arange(1.0, np.log(LONGEST_HOURS / now) / np.log(1.25)):
        if relative_sd(extended, interval=data.interval, span=3600.0 * hours)[0] <= DETECTED_RELATIVE_SD:
            return float(hours)
    return None
