"""Noise terms and their sum: spectrum, Allan and Hadamard variance, autocovariance, state space, samples.

A term is a frozen dataclass whose fields are its parameters in SI units. Terms add up to a flat `NoiseModel`.
Functions take `interval`, s, to answer for samples (see `models`); with it, cluster times are multiples m =
τ/interval and frequencies satisfy |f| <= 1/(2 interval).

Both variances are contrasts of the sum x of the rate samples. With V(m) = var(x_{k+m} − x_k), generalised
where the rate is not stationary::

    AVAR(m) = [4 V(m) − V(2m)] / (2 m²)
    HVAR(m) = [15 V(m) − 6 V(2m) + V(3m)] / (6 m²)
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, replace
from itertools import product
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from models.arrays import ComplexArray, FloatArray
from models.noise import from_state_space
from models.registry import Registry
from models.statespace import StateSpace, block_sum
from models.units import time_derivative

_LOG_STEP = 1e-3
"""Step of the logarithm of a parameter: truncation (1e-12) and rounding (1e-13) are then about equal."""


def as_array(values: ArrayLike) -> FloatArray:
    """Return the values as floats."""
    return np.asarray(values, dtype=np.float64)


def require_positive(name: str, value: float) -> None:
    """Raise ValueError unless the value is positive and finite."""
    if not 0.0 < value < np.inf:
        raise ValueError(f"'{name}' must be positive, got {value}")


@dataclass(frozen=True)
class Term:
    """A noise process with a name and positive parameters; the first parameter scales its amplitude.

    A new term is a frozen dataclass with `name`, `PARAMETERS`, `UNITS` and `state_space`; see
    docs/extending/noise-term.md. Everything else is computed from the state space, and may be overridden by a closed
    form. A term without a state space (white noise, flicker) gives every function itself.
    """

    name: ClassVar[str]
    PARAMETERS: ClassVar[tuple[str, ...]]
    """Names of the positive parameters, the amplitude first; in the order of the first fields."""
    UNITS: ClassVar[tuple[float | str, ...]]
    """Unit of each parameter: a unit, or the power p of 1/s by which it differs from the unit of the rate."""
    SYMBOLS: ClassVar[tuple[str, ...]] = ()
    """Symbol of each parameter in tables and figures; its name where there is none."""
    title: ClassVar[str] = ""
    """What tables call the term; nothing where `name` says it."""
    deterministic: ClassVar[bool] = False
    """Whether it has no spectral density: a ramp, a line."""
    fitted: ClassVar[bool] = True
    """Whether it can be fitted to a record by its name."""
    is_bias: ClassVar[bool] = True
    """Whether a filter follows it as an error of the bias; not so for what is white to it or stays in the integral."""
    is_power_law: ClassVar[bool] = False
    """Whether its Allan variance is one power of τ, as of the terms of `models.noise.POWER_LAW`."""

    def __post_init__(self) -> None:
        for parameter in self.PARAMETERS:
            require_positive(parameter, getattr(self, parameter))

    def state_space(self) -> StateSpace | None:
        """Return the states that make the process; None where it is white, or a difference of such.

        Raises
        ------
        ValueError
            Where the process has no finite state space.
        """
        raise ValueError(f"noise term '{self.name}' gives no state space")

    def psd(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the two-sided spectral density at frequencies f, Hz; shape of f, unit²/Hz."""
        return from_state_space.power_spectrum(self._system("spectrum"), as_array(f), interval)

    def psd_gradient(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the derivatives of `psd` by the logarithms of PARAMETERS, shape (p, *shape of f).

        Computed by central differences of fourth order, right to about 1e-10 of the spectrum.
        """
        rows = [2.0 * self.psd(f, interval=interval)]
        for parameter in self.PARAMETERS[1:]:
            one, two = (
                self._moved(parameter, h).psd(f, interval=interval)
                - self._moved(parameter, -h).psd(f, interval=interval)
                for h in (_LOG_STEP, 2.0 * _LOG_STEP)
            )
            rows.append((8.0 * one - two) / (12.0 * _LOG_STEP))
        return np.stack(rows)

    def allan_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the Allan variance at cluster times τ, s; shape of τ, unit²."""
        return from_state_space.difference_variance(
            self._system("Allan variance"), as_array(tau), interval, 2
        )

    def hadamard_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the Hadamard variance at cluster times τ, s; shape of τ, unit²."""
        return from_state_space.difference_variance(
            self._system("Hadamard variance"), as_array(tau), interval, 3
        )

    def autocovariance(self, lag: ArrayLike, *, interval: float | None = None) -> FloatArray:  # noqa: ARG002
        """Return the autocovariance at lags, s; shape of lag, unit²; ValueError where it does not exist."""
        system = self._system("autocovariance")
        if not from_state_space.is_stationary(system):
            raise ValueError(f"noise term '{self.name}' has no autocovariance: it is not stationary")
        return from_state_space.autocovariance(system, as_array(lag))

    def sample(self, n: int, interval: float, rng: np.random.Generator) -> FloatArray:
        """Return n consecutive samples, shape (n,)."""
        return from_state_space.sample(self._system("samples"), n, interval, rng)

    @classmethod
    def trial_shapes(cls, times: FloatArray) -> tuple[tuple[float, ...], ...]:
        """Return trial values of the parameters after the amplitude, where a fit begins to search.

        Every combination: the given times for a parameter in s, 0.5 ÷ time for one in Hz.

        Parameters
        ----------
        times : ndarray
            Times that the record covers, s, rising.

        Raises
        ------
        ValueError
            Where a parameter is neither a time nor a frequency: the term gives its own trial values then.
        """
        trials: list[list[float]] = []
        for parameter, unit in zip(cls.PARAMETERS[1:], cls.UNITS[1:], strict=True):
            if unit not in ("s", "Hz"):
                raise ValueError(
                    f"noise term '{cls.name}' cannot be fitted: it gives no trial_shapes for '{parameter}'"
                )
            trials.append(times.tolist() if unit == "s" else (0.5 / times[::-1]).tolist())
        return tuple(product(*trials))

    def fastest_time(self) -> float:
        """Return the time within which the process changes least, s: the inverse of its fastest pole.

        0 for a process without states, infinite for one that has only integrators.
        """
        try:
            system = self.state_space()
        except ValueError:
            return 0.0
        if system is None:
            return 0.0
        rate = float(np.max(np.abs(np.linalg.eigvals(system.F))))
        return 1.0 / rate if rate > 0.0 else np.inf

    def exponentials(self) -> tuple[ComplexArray, ComplexArray] | None:
        """Return c and p of the autocovariance Σ c exp(−p |t|); None where the term has no such form."""
        try:
            system = self.state_space()
        except ValueError:
            return None
        if system is None or not from_state_space.is_stationary(system):
            return None
        return from_state_space.exponentials(system)

    def phase_covariance(self, t: ArrayLike, scale: float) -> FloatArray:
        """Return the generalised covariance of the integral of the process at lags t ≥ 0, s; shape of t, unit² s².

        −½ of the variance of the integral over t where the process is stationary; a parabola may be added, as second
        differences do not see it. A process without exponentials counts as white noise that has its Allan variance
        at τ = scale.

        Parameters
        ----------
        t : array_like
            Lags, s.
        scale : float
            Cluster time, s, of the differences that are wanted.
        """
        lag = as_array(t)
        found = self.exponentials()
        if found is None:
            return -0.5 * float(self.allan_variance(scale)) * scale * lag
        total = np.zeros(np.shape(lag))
        for c, p in zip(*found, strict=True):
            total -= np.real(c / p**2 * (p * lag + np.expm1(-p * lag)))
        return total

    def phase_white_variance(self) -> float:
        """Return the variance of the white error of the integral, unit² s²; 0 but for quantization."""
        return 0.0

    def _white_density(self) -> float:
        return 0.0

    def _system(self, wanted: str) -> StateSpace:
        system = self.state_space()
        if system is None:
            raise ValueError(f"noise term '{self.name}' has no state space: it must give its own {wanted}")
        return system

    def _moved(self, parameter: str, log_step: float) -> Self:
        return replace(self, **{parameter: getattr(self, parameter) * float(np.exp(log_step))})

    def scaled(self, factor: float) -> Self:
        """Return the term of a process multiplied by a factor."""
        amplitude = self.PARAMETERS[0]
        return replace(self, **{amplitude: abs(factor) * getattr(self, amplitude)})

    def units(self, rate_unit: str) -> tuple[str, ...]:
        """Return the SI unit of each parameter for a rate in ``rad/s`` or ``m/s^2``."""
        return tuple(u if isinstance(u, str) else time_derivative(rate_unit, u) for u in self.UNITS)

    def as_dict(self) -> dict[str, Any]:
        """Return the fields as plain numbers and lists, ready for JSON or YAML."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return {k: list(v) if isinstance(v, tuple) else v for k, v in values.items() if v is not None}

    def __add__(self, other: Term | NoiseModel) -> NoiseModel:
        return NoiseModel((self, other))

    def __radd__(self, other: int) -> NoiseModel:
        """Let `sum` begin with its 0."""
        return NoiseModel((self,)) if other == 0 else NotImplemented


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
        return float(np.sqrt(sum(term._white_density() ** 2 for term in self.terms)))

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

        One mapping for a single power law, else a list of mappings.
        """
        model: dict[str, Any] = {}
        for term in self.terms:
            model.setdefault(term.name, []).append(term.as_dict())
        once = {term.name for term in self.terms if term.is_power_law}
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
