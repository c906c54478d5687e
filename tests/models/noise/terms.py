"""One or more examples of every registered noise term, and of one of another package: all must obey the same laws."""

from __future__ import annotations

from models.noise import TERMS, Arma, GaussMarkov, LowPassWhite, NoiseModel, Term
from tests.extension.second_order_gauss_markov import SecondOrderGaussMarkov

INTERVAL = 0.1
SHORT, LONG = 0.04, 5.0
"""Time constants of the examples, s: shorter and longer than the sampling interval."""
AMPLITUDE = 0.3

FURTHER: tuple[Term, ...] = (
    GaussMarkov(AMPLITUDE, SHORT),
    SecondOrderGaussMarkov(AMPLITUDE, SHORT),
    LowPassWhite(0.1, 2.0, order=2),
    LowPassWhite(0.1, 0.01, order=2),
    Arma((), (0.5, 0.2, -0.3), 0.04, INTERVAL),
)
"""Examples of further cases of a term."""


def example(kind: type[Term]) -> Term:
    """Return a term of a class, from what it declares: times of `LONG`, frequencies of 0.7 Hz."""
    if kind is Arma:
        return Arma((0.7, -0.2), (0.3,), 0.04, INTERVAL)
    values = {"s": LONG, "Hz": 0.7}
    shape = {n: values[u] for n, u in zip(kind.PARAMETERS[1:], kind.UNITS[1:], strict=True)}
    return kind(**{kind.PARAMETERS[0]: AMPLITUDE}, **shape)


EXAMPLES = (*map(example, dict.fromkeys((*TERMS.values(), SecondOrderGaussMarkov))), *FURTHER)
RANDOM = tuple(term for term in EXAMPLES if not term.deterministic)


def _has(function: str, argument: float, interval: float | None) -> dict[str, bool]:
    answers = {}
    for term in EXAMPLES:
        try:
            getattr(term, function)(argument, interval=interval)
        except ValueError:
            answers[named(term)] = False
        else:
            answers[named(term)] = True
    return answers


def named(term: Term | NoiseModel) -> str:
    """Return a name for a test."""
    if isinstance(term, NoiseModel):
        return " + ".join(named(one) for one in term.terms)
    return f"{term.name}-{'-'.join(str(v) for v in term.as_dict().values())}"


_CONTINUOUS, _STATIONARY = _has("psd", 1.0, None), _has("autocovariance", 0.0, INTERVAL)
CONTINUOUS = tuple(term for term in RANDOM if _CONTINUOUS[named(term)] and term.name != "arma")
"""Random terms that exist without a sampling interval."""
STATIONARY = tuple(term for term in RANDOM if _STATIONARY[named(term)])
EXPONENTIAL = tuple(term for term in RANDOM if term.exponentials() is not None)
"""Stationary terms with a state space."""
