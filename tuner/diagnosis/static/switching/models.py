"""Models of block means for the switching filter: a chain of levels, and the states of slow noise besides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.noise import BiasInstability, GaussMarkov, Quantization, RandomWalk, Term, White
from tuner.diagnosis.static.model.null_distributions import COST_OUTSIDE
from tuner.diagnosis.static.switching.kim_filter import switching
from tuner.types.records import DataError

KNOWN_TERMS = (White, Quantization, GaussMarkov, RandomWalk)
"""Noise whose block means have states or a white part here; flicker noise is a ladder of the third."""
NO_VALUES = np.empty(0)
"""Path that the filter need not fill."""


@dataclass(frozen=True)
class Chain:
    """Levels, in scales, their probabilities at the start, and those of a switch in a block, from row to column."""

    levels: FloatArray
    first: FloatArray
    chances: FloatArray

    @classmethod
    def two(cls, size: float, up: float, down: float) -> Chain:
        """Return levels 0 and `size` with the chances of a switch."""
        first = np.array([down, up]) / (up + down)
        return cls(np.array([0.0, size]), first, np.array([[1.0 - up, up], [down, 1.0 - down]]))

    @classmethod
    def even(cls, levels: Sequence[float], chance: float) -> Chain:
        """Return levels that are left with one chance, for any other alike."""
        m = len(levels)
        chances = np.full((m, m), chance / max(m - 1, 1))
        np.fill_diagonal(chances, 1.0 - chance)
        return cls(np.array(levels), np.full(m, 1.0 / m), chances)


STILL = Chain.even([0.0], 0.0)
"""No switching at all."""


@dataclass(frozen=True)
class Slow:
    """States of slow noise on blocks."""

    phi: FloatArray
    q: FloatArray
    initial: FloatArray

    @classmethod
    def of(cls, terms: Sequence[Term], step: float, offset: float = 1e6) -> Slow:
        """Return the states of noise terms for blocks of `step` s; `offset` is the first variance of a random walk.

        Raises
        ------
        DataError
            A term that has neither a state nor a white part here, such as one of another package.
        """
        _refuse_others(terms)
        phi, q, initial = [], [], []
        for term in terms:
            if isinstance(term, RandomWalk):
                phi.append(1.0)
                q.append(term.density**2 * step)
                initial.append(offset)
            elif isinstance(term, GaussMarkov):
                decay = float(np.exp(-step / term.time_constant))
                ratio = step / term.time_constant
                mean = term.sd**2 * (2.0 * (ratio - 1.0 + decay) / ratio**2 if ratio > 1e-3 else 1.0)
                phi.append(decay)
                q.append(mean * (1.0 - decay**2))
                initial.append(mean)
        return cls(np.array(phi), np.array(q), np.array(initial))


def _refuse_others(terms: Sequence[Term]) -> None:
    """Refuse terms that neither the states nor the white part of a block mean would contain."""
    for term in terms:
        if not isinstance(term, KNOWN_TERMS):
            raise DataError(
                f"noise term '{term.name}' cannot be searched for switching levels: expected "
                f"{', '.join(known.name for known in KNOWN_TERMS)}; leave it out of the model of the diagnosis"
            )


def ladder(level: float, shortest: float, longest: float, per_decade: int = 3) -> tuple[GaussMarkov, ...]:
    """Return Gauss–Markov processes, so many to a decade, that make flicker noise."""
    ratio = 10.0 ** (1.0 / per_decade)
    count = int(np.ceil(np.log(longest / shortest) / np.log(ratio))) + 1
    sd = level * float(np.sqrt(np.log(ratio) / np.pi))
    return tuple(GaussMarkov(sd, shortest * ratio**i) for i in range(count))


def expanded(terms: Sequence[Term], step: float, span: float) -> list[Term]:
    """Return the terms with flicker noise as a ladder."""
    out: list[Term] = []
    for term in terms:
        out += ladder(term.level, 0.5 * step, 2.0 * span) if isinstance(term, BiasInstability) else [term]
    return out


def block_noise(terms: Sequence[Term], step: float) -> float:
    """Return the variance of the white part of a block mean; DataError for terms without a state in `Slow`."""
    _refuse_others([term for term in terms if not isinstance(term, BiasInstability)])
    white = sum(t.density**2 / step for t in terms if isinstance(t, White))
    return float(
        white + sum(2.0 * (t.increment_sd / step) ** 2 for t in terms if isinstance(t, Quantization))
    )


def likelihood(
    y: FloatArray, chain: Chain, slow: Slow, r: FloatArray | float, path: FloatArray = NO_VALUES
) -> float:
    """Return the log likelihood of block means, shape (M,), by `switching`.

    `r` is the variance of their white part, one for all or one each, shape (M,).

    Raises
    ------
    ValueError
        Without a level.
    """
    if not len(chain.levels):
        raise ValueError("0 levels, expected 1 or more")
    run, white = switching(len(slow.phi), len(chain.levels)), np.full(len(y), r)
    value = run(y, chain.levels, chain.first, chain.chances, slow.phi, slow.q, slow.initial, white, path)
    return float(value) if np.isfinite(value) else -COST_OUTSIDE


def likelihood_from(
    y: FloatArray, chain: Chain, slow: Slow, r: FloatArray | float, level: int, path: FloatArray = NO_VALUES
) -> float:
    """Return `likelihood` of block means together with this level at the start."""
    start = Chain(chain.levels, np.eye(len(chain.levels))[level], chain.chances)
    return float(np.log(chain.first[level])) + likelihood(y, start, slow, r, path)


def likelihood_by_start(
    y: FloatArray, chain: Chain, slow: Slow, r: FloatArray | float, path: FloatArray = NO_VALUES
) -> float:
    """Return `likelihood` with one filter for each level at the start, and the path from the likeliest of them.

    While the offset of all levels is unknown, a record that begins at one level looks like one that begins at
    another. A filter that mixes both keeps the offset that is likelier beforehand, and is lost at the first switch
    where that is the wrong one.
    """
    paths = [np.empty_like(path) for _ in chain.levels]
    values = [likelihood_from(y, chain, slow, r, level, own) for level, own in enumerate(paths)]
    path[:] = paths[int(np.argmax(values))]
    return float(np.logaddexp.reduce(values))
