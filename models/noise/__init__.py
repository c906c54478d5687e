"""A sensor's noise is a flat sum of named terms: `NoiseModel`.

::

    model = White(2e-4) + BiasInstability(1e-5) + RandomWalk(3e-7)
    model.allan_variance([1.0, 10.0, 100.0], interval=0.01)

Spectra, variances and autocovariances of independent terms add. The order of the terms has no meaning:
sums of the same terms are equal. Units and conventions are those of `models`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from models.arrays import FloatArray
from models.noise.arma import Arma
from models.noise.base import Term
from models.noise.bias_instability import BiasInstability
from models.noise.gauss_markov import GaussMarkov, LowPassWhite
from models.noise.power_law import Quantization, Ramp, RandomWalk, White
from models.noise.sinusoid import Sinusoid
from models.registry import Registry
from models.statespace import StateSpace, block_sum

__all__ = [
    "POWER_LAW",
    "TERMS",
    "Arma",
    "BiasInstability",
    "GaussMarkov",
    "LowPassWhite",
    "NoiseModel",
    "Quantization",
    "Ramp",
    "RandomWalk",
    "Sinusoid",
    "Term",
    "White",
]

POWER_LAW = (Quantization, White, BiasInstability, RandomWalk, Ramp)
"""The five terms of IEEE Std 952 whose Allan variance is one power of τ, in the order of their slopes."""


def _complete(kind: Any) -> None:
    """Raise unless a class states all that `Term` needs."""
    if not (isinstance(kind, type) and issubclass(kind, Term)):
        raise TypeError(f"expected a subclass of models.noise.Term, got {kind!r}")
    if missing := [name for name in ("name", "PARAMETERS", "UNITS") if not hasattr(kind, name)]:
        raise TypeError(f"the class needs {', '.join(missing)}")
    if not re.fullmatch(r"[a-z][a-z0-9_]*", kind.name) or re.search(r"_[0-9]+$", kind.name):
        msg = "expected a name of lower-case letters, digits and underscores that does not end in a number, as that of "
        msg += "the second term of a kind does"
        raise ValueError(msg)
    if not kind.PARAMETERS:
        raise ValueError("PARAMETERS must name at least the amplitude")
    if len(kind.UNITS) != len(kind.PARAMETERS) and kind.units is Term.units:
        raise ValueError(f"UNITS must hold one entry for each of PARAMETERS {', '.join(kind.PARAMETERS)}")
    if strange := [name for name in kind.PARAMETERS if name not in {field.name for field in fields(kind)}]:
        raise ValueError(f"PARAMETERS must name fields of the dataclass, '{strange[0]}' is none")
    if kind.state_space is Term.state_space:
        lacking = [name for name in _BY_ITSELF if getattr(kind, name) is getattr(Term, name)]
        if lacking:
            raise ValueError(f"it must give state_space, or {', '.join(lacking)}")


_BY_ITSELF = ("psd", "allan_variance", "hadamard_variance", "autocovariance", "sample")
"""What a term without a state space gives itself."""

TERMS: Registry[type[Term]] = Registry(
    "noise term",
    "tuner.noise_terms",
    name_of=lambda kind: str(getattr(kind, "name", getattr(kind, "__name__", kind))),
    check=_complete,
)
"""Classes of the noise terms by name, in the order in which results list them; open to other packages."""
TERMS.extend(
    (Quantization, White, BiasInstability, GaussMarkov, RandomWalk, Ramp, LowPassWhite, Sinusoid, Arma)
)


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """A flat sum of independent noise terms; without terms it is silence.

    Attributes
    ----------
    terms : tuple of Term
        Nested models are flattened.
    """

    terms: tuple[Term, ...] = ()

    def __init__(self, terms: Iterable[Term | NoiseModel] = ()) -> None:
        flat = (item.terms if isinstance(item, NoiseModel) else (item,) for item in terms)
        terms = tuple(term for group in flat for term in group)
        if strangers := [type(term).__name__ for term in terms if not isinstance(term, Term)]:
            raise ValueError(f"'terms' must be noise terms, got {', '.join(strangers)}")
        object.__setattr__(self, "terms", terms)

    def __add__(self, other: Term | NoiseModel) -> NoiseModel:
        return NoiseModel((self, other))

    def __radd__(self, other: int) -> NoiseModel:
        """Let `sum` begin with its 0."""
        return self if other == 0 else NotImplemented

    def __eq__(self, other: object) -> bool:
        return isinstance(other, NoiseModel) and Counter(self.terms) == Counter(other.terms)

    def __hash__(self) -> int:
        return hash(frozenset(Counter(self.terms).items()))

    def psd(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the two-sided spectral density, shape of f, unit²/Hz; lines and ramps count 0."""
        return self._sum(f, lambda term: term.psd(f, interval=interval))

    def allan_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the Allan variance at cluster times τ, s; of samples with `interval`; shape of τ, unit²."""
        return self._sum(tau, lambda term: term.allan_variance(tau, interval=interval))

    def hadamard_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the Hadamard variance at cluster times τ, s; of samples with `interval`; shape of τ."""
        return self._sum(tau, lambda term: term.hadamard_variance(tau, interval=interval))

    def autocovariance(self, lag: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the autocovariance at lags in s, shape of lag, unit²; ValueError where a term has none."""
        return self._sum(lag, lambda term: term.autocovariance(lag, interval=interval))

    def state_space(self) -> StateSpace | None:
        """Return the block sum of the states of all terms; None where there are none (white, quantization).

        Raises
        ------
        ValueError
            Where a term has no finite state space: see `flicker_ladder`.
        """
        systems = [s for s in (term.state_space() for term in self.terms) if s is not None]
        return block_sum(*systems) if systems else None

    def white_density(self) -> float:
        """Return the density of the white terms together, unit/√Hz."""
        return float(np.sqrt(sum(t.density**2 for t in self.terms if isinstance(t, White))))

    def sample(self, n: int, interval: float, rng: np.random.Generator) -> FloatArray:
        """Return n consecutive samples, shape (n,); random walk and flicker start at 0.

        Parameters
        ----------
        n : int
            Number of samples.
        interval : float
            Sampling interval, s.
        rng : numpy.random.Generator
            Source of randomness.
        """
        total = np.zeros(n)
        for term in self.terms:
            total += term.sample(n, interval, rng)
        return total

    def scaled(self, factor: float) -> NoiseModel:
        """Return the model of data multiplied by a factor: amplitudes scale, times do not."""
        return NoiseModel(term.scaled(factor) for term in self.terms)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names such as ``white.density``; the second of a kind is ``gauss_markov_2.sd``."""
        seen: Counter[str] = Counter()
        names = []
        for term in self.terms:
            seen[term.name] += 1
            prefix = term.name if seen[term.name] == 1 else f"{term.name}_{seen[term.name]}"
            names += [f"{prefix}.{parameter}" for parameter in term.PARAMETERS]
        return tuple(names)

    def values(self) -> FloatArray:
        """Return the values of `parameters`, shape (p,)."""
        return np.array(
            [getattr(t, parameter) for t in self.terms for parameter in t.PARAMETERS], dtype=float
        )

    def with_values(self, values: ArrayLike) -> NoiseModel:
        """Return the model with other values of `parameters`, shape (p,)."""
        values = np.asarray(values, dtype=float)
        if values.shape != (len(self.parameters),):
            raise ValueError(f"'values' must have shape ({len(self.parameters)},), got {values.shape}")
        rest = iter(values.tolist())
        return NoiseModel(
            replace(term, **{parameter: next(rest) for parameter in term.PARAMETERS}) for term in self.terms
        )

    def as_dict(self) -> dict[str, Any]:
        """Return plain data, ready for JSON or YAML: each term's fields by its name.

        One mapping for a term of `POWER_LAW`, else a list of mappings.
        """
        model: dict[str, Any] = {}
        for term in self.terms:
            model.setdefault(term.name, []).append(term.as_dict())
        once = {kind.name for kind in POWER_LAW}
        return {k: v[0] if k in once and len(v) == 1 else v for k, v in model.items()}

    @classmethod
    def from_dict(cls, model: Mapping[str, Any]) -> NoiseModel:
        """Read what `as_dict` wrote.

        Raises
        ------
        ValueError
            For an unknown term or field, or a value out of range.
        """
        terms: list[Term] = []
        for name, items in model.items():
            kind = TERMS[name]
            for values in [items] if isinstance(items, Mapping) else items:
                try:
                    terms.append(kind(**values))
                except TypeError as error:
                    raise ValueError(f"noise term '{name}': {error}") from error
        return cls(terms)

    def _sum(self, argument: ArrayLike, part: Callable[[Term], FloatArray]) -> FloatArray:
        return sum((part(term) for term in self.terms), np.zeros(np.shape(argument)))
