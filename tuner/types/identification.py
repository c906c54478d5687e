"""Which noise a sensor has: terms with intervals, candidates, ARMA, agreement of several logs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from models.arrays import FloatArray
from models.noise import NoiseModel
from tuner.types.coefficient import Coefficient
from tuner.types.curves import AllanCurve
from tuner.types.shown import Shown


@dataclass(frozen=True)
class TermEstimate:
    """One noise term as identified: the coefficients of a present term, or the bounds of an absent one.

    Attributes
    ----------
    name : str
        ``quantization white bias_instability random_walk ramp gauss_markov`` (or ``sinusoid``,
        ``low_pass_white``, ``arma``).
    coefficients : mapping of str to Coefficient
        By the field names of the term's class in `models.noise`.
    """

    name: str
    coefficients: Mapping[str, Coefficient]

    @property
    def present(self) -> bool:
        """Whether the data contain the term (every coefficient has a value)."""
        return all(c.value is not None for c in self.coefficients.values())


@dataclass(frozen=True)
class Candidate:
    """A sum of terms that was tried, with its score (lower is better) and what became of it."""

    terms: tuple[str, ...]
    score: float
    note: str


@dataclass(frozen=True)
class SeriesTest:
    """A test of a series, or of what a model leaves of it, with the chance of a statistic as extreme.

    Attributes
    ----------
    name : str
        What is tested by whom: "unit root, ADF".
    statistic, p_value : float
        Value, and its chance where the null hypothesis holds.
    null, found : str
        The null hypothesis, and what follows from the chance, in words.
    tabulated : (float, float)
        Chances between which the test tells them: a chance at an end lies beyond it.
    """

    name: str
    statistic: float
    p_value: float
    null: str
    found: str
    tabulated: tuple[float, float] = (0.0, 1.0)


@dataclass(frozen=True)
class ArmaFit:
    """ARMA(p,q) of a record: x_k = Σ ar_i x_{k-i} + e_k + Σ ma_j e_{k-j}, var e = variance.

    Attributes
    ----------
    ar, ma : tuple of Coefficient
        Coefficients, none where the model cannot be distinguished from white noise.
    variance : float
        Of the innovations, unit².
    interval : float
        Sampling interval of the series that was fitted, s.
    unit : str
        Of its samples.
    criterion : str
        ``bic`` or ``aic``, by which the order is chosen.
    scores : mapping of (p, q) to float
        Of every order that was compared, by that criterion: the least is the best.
    white : bool
        Whether the model cannot be distinguished from white noise.
    steps : tuple of str
        How the series was prepared, in order, in words with their figures.
    samples : int
        Samples of the series.
    tests : tuple of SeriesTest
        Of the prepared series and of the residuals.
    """

    ar: tuple[Coefficient, ...]
    ma: tuple[Coefficient, ...]
    variance: float
    interval: float
    unit: str
    criterion: str
    scores: Mapping[tuple[int, int], float]
    white: bool
    steps: tuple[str, ...] = ()
    samples: int = 0
    tests: tuple[SeriesTest, ...] = ()

    @property
    def order(self) -> tuple[int, int]:
        """Orders (p, q)."""
        return len(self.ar), len(self.ma)

    def scores_by(self, criterion: str) -> Mapping[tuple[int, int], float]:
        """Return the scores of every order by ``bic`` or ``aic``: −2 ln L plus a price for each parameter."""
        more = price_of(criterion, self.samples) - price_of(self.criterion, self.samples)
        return {(p, q): score + more * (p + q + 1) for (p, q), score in self.scores.items()}


def price_of(criterion: str, samples: int) -> float:
    """Return what a parameter costs in −2 ln L: 2 by ``aic`` (Akaike), ln n by ``bic`` (Schwarz)."""
    return 2.0 if criterion == "aic" else math.log(samples)


@dataclass(frozen=True)
class ChannelIdentification:
    """The noise of one axis.

    Attributes
    ----------
    axis, unit : str
        Channel and unit of its samples.
    interval, span : float
        Sampling interval and time covered, s.
    method : str
        ``likelihood``, ``leastsquares``, ``slopes`` or ``curve``.
    model : NoiseModel
        Sum of the terms that the data contain.
    terms : tuple of TermEstimate
        Present and bounded terms, in the order of the base.
    parameters : tuple of str
        Names of the fitted parameters, such as ``white.density``, in the order of `covariance`.
    covariance : ndarray, shape (p, p)
        Covariance of the logarithms of the parameters.
    mean : Coefficient
        Mean of the channel: Allan methods cannot see a constant.
    sigma_10s : Coefficient
        Allan deviation at 10 s.
    minimum : Coefficient
        Smallest Allan deviation; its cluster time, s, is `minimum_tau`.
    floor : Coefficient
        Smallest Allan deviation ÷ 0.664: what many tools print as bias instability.
    minimum_tau : float
        Cluster time of the minimum, s.
    allan : AllanCurve
        Overlapping Allan curve of the axis.
    candidates : tuple of Candidate
        Sums that were compared.
    arma : ArmaFit or None
        Time-series model of the same axis.
    warnings : tuple of str
        What a user must know, such as disagreement between methods.
    """

    axis: str
    unit: str
    interval: float
    span: float
    method: str
    model: NoiseModel
    terms: tuple[TermEstimate, ...]
    parameters: tuple[str, ...]
    covariance: FloatArray
    mean: Coefficient
    sigma_10s: Coefficient
    minimum: Coefficient
    floor: Coefficient
    minimum_tau: float
    allan: AllanCurve
    candidates: tuple[Candidate, ...] = ()
    arma: ArmaFit | None = None
    warnings: tuple[str, ...] = ()

    def term(self, name: str) -> TermEstimate | None:
        """Return the first term of that name, or None."""
        return next((t for t in self.terms if t.name == name), None)


@dataclass(frozen=True, repr=False)
class Identification(Shown):
    """The noise of every channel of one or more logs, with where it came from."""

    source: Mapping[str, Any]
    channels: Mapping[str, ChannelIdentification]
    notes: tuple[str, ...] = ()

    @property
    def unusable(self) -> str:
        """Why no function can use it, in words; empty where one can."""
        return "" if self.channels else "with no channel"


@dataclass(frozen=True)
class PooledCoefficient:
    """One coefficient over several records.

    `spread` is the true sd from record to record (relative for amplitudes), `values` each record's own estimate,
    `p_value` that of the test that all records share one value.
    """

    name: str
    value: Coefficient
    spread: Coefficient
    values: tuple[float | None, ...]
    p_value: float


@dataclass(frozen=True)
class PooledChannel:
    """One axis over several records of a sensor; the spread of `mean` is the turn-on repeatability."""

    axis: str
    unit: str
    coefficients: tuple[PooledCoefficient, ...]
    mean: PooledCoefficient | None
