"""What was found: the frozen results every room hands to the next.

Numbers are SI; every number a user sees is a `Coefficient`: a value with its 95 % interval, or an upper limit
with the reason why there is no more. Results import none of the code that makes them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from models.noise import NoiseModel

FloatArray = NDArray[np.float64]

LEVEL = 0.95
"""Level of every interval and limit that does not say otherwise."""


@dataclass(frozen=True)
class Coefficient:
    """One number and how far it can be trusted.

    Attributes
    ----------
    value : float or None
        Estimate; None where the data only bound it.
    interval : (float, float) or None
        Two-sided 95 % interval.
    upper : float or None
        One-sided 95 % upper limit, where there is no value.
    unit : str
        SI unit.
    reason : str or None
        Why there is only a bound (absent, hidden, masked, record too short: hours needed), or what to know
        of the value.
    """

    value: float | None
    interval: tuple[float, float] | None
    upper: float | None
    unit: str
    reason: str | None = None

    @classmethod
    def known(
        cls, value: float, lower: float, upper: float, unit: str, reason: str | None = None
    ) -> Coefficient:
        """Make an estimate with its interval."""
        return cls(value, (lower, upper), None, unit, reason)

    @classmethod
    def bounded(cls, upper: float, unit: str, reason: str) -> Coefficient:
        """Make an upper limit with its reason."""
        return cls(None, None, upper, unit, reason)


@dataclass(frozen=True)
class AllanCurve:
    """An empirical curve of the Allan family: one variance a cluster time and axis.

    Attributes
    ----------
    estimator : str
        ``adev oadev twogroup mdev hdev ohdev totdev theo1 theobr theoh``.
    tau : ndarray, shape (m,)
        Effective cluster time, s (0.75 m τ0 for Thêo1).
    variance : ndarray, shape (m, k)
        Variance, unit².
    dof : ndarray, shape (m, k)
        Equivalent degrees of freedom.
    unit : str
        Unit of the deviation.
    axes : tuple of str
        Names of the k columns.
    notes : tuple of str
        What was done to make the curve affordable, such as block averaging.
    """

    estimator: str
    tau: FloatArray
    variance: FloatArray
    dof: FloatArray
    unit: str
    axes: tuple[str, ...]
    notes: tuple[str, ...] = ()

    def deviation(self) -> FloatArray:
        """Return the square root of the variance, shape (m, k)."""
        return np.sqrt(self.variance)

    def interval(self, level: float = LEVEL) -> tuple[FloatArray, FloatArray]:
        """Return lower and upper limits of the deviation from χ² with `dof` degrees of freedom, shapes (m, k)."""
        tail = 0.5 * (1.0 - level)
        scaled = self.dof * self.variance
        return np.sqrt(scaled / chi2.ppf(1.0 - tail, self.dof)), np.sqrt(scaled / chi2.ppf(tail, self.dof))

    def axis(self, name: str) -> AllanCurve:
        """Return the curve of one axis alone."""
        j = self.axes.index(name)
        only = slice(j, j + 1)
        return replace(self, variance=self.variance[:, only], dof=self.dof[:, only], axes=(name,))


@dataclass(frozen=True)
class Spectrum:
    """An empirical two-sided power spectral density.

    Attributes
    ----------
    frequency : ndarray, shape (m,)
        Hz, positive.
    density : ndarray, shape (m, k)
        unit²/Hz, two-sided: white noise of density N shows N².
    dof : ndarray, shape (m,)
        Equivalent degrees of freedom of each value.
    unit : str
        Unit of the samples.
    axes : tuple of str
        Names of the k columns.
    """

    frequency: FloatArray
    density: FloatArray
    dof: FloatArray
    unit: str
    axes: tuple[str, ...]

    def interval(self, level: float = LEVEL) -> tuple[FloatArray, FloatArray]:
        """Return lower and upper limits of the density from χ² with `dof` degrees of freedom, shapes (m, k)."""
        tail = 0.5 * (1.0 - level)
        dof = self.dof[:, None]
        return self.density * dof / chi2.ppf(1.0 - tail, dof), self.density * dof / chi2.ppf(tail, dof)


@dataclass(frozen=True)
class Correlogram:
    """Sample autocorrelation or partial autocorrelation.

    Attributes
    ----------
    statistic : str
        ``acf`` or ``pacf``.
    lag : ndarray, shape (m,)
        s.
    value : ndarray, shape (m, k)
        Correlation, -1 … 1.
    band : float
        Half width of the band that holds 95 % of the values of white noise.
    axes : tuple of str
        Names of the k columns.
    """

    statistic: str
    lag: FloatArray
    value: FloatArray
    band: float
    axes: tuple[str, ...]


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
class ArmaFit:
    """ARMA(p,q) of a record: x_k = Σ ar_i x_{k-i} + e_k + Σ ma_j e_{k-j}, var e = variance.

    `white` is True where the model cannot be told from white noise; `interval` is the sampling interval
    of the series that was fitted, s; `steps` are the preprocessing steps and tests, in order, in words
    with their figures.
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

    @property
    def order(self) -> tuple[int, int]:
        """Orders (p, q)."""
        return len(self.ar), len(self.ma)


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
        ``likelihood``, ``leastsquares``, ``slopes``, ``unweighted`` or ``curve``.
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
        Doubts a user must know, such as disagreement between methods.
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


@dataclass(frozen=True)
class Identification:
    """The noise of every channel of one or more logs, with where it came from."""

    source: Mapping[str, Any]
    channels: Mapping[str, ChannelIdentification]
    notes: tuple[str, ...] = ()


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


@dataclass(frozen=True)
class MarkovState:
    """A first-order Gauss–Markov bias state: stationary sd and time constant, s."""

    sd: float
    time_constant: float

    @property
    def driving_density(self) -> float:
        """White density that drives the state, sd·√(2/T), unit/√s."""
        return float(self.sd * np.sqrt(2.0 / self.time_constant))


@dataclass(frozen=True)
class Inflation:
    """A number that was enlarged: by how much, and why."""

    quantity: str
    factor: float
    reason: str


@dataclass(frozen=True)
class ChannelNoise:
    """What the filter believes of one axis (SI).

    Attributes
    ----------
    axis, unit : str
        Channel and unit of its samples.
    white_density : float
        unit/√Hz.
    markov : tuple of MarkovState
        Gauss–Markov bias states (a ladder stands for flicker).
    random_walk_density : float
        Drive of the bias random walk, unit/√s; 0 where there is none.
    constant_sd : float
        Prior sd of the turn-on constant.
    ramp_sd : float
        Prior sd of a constant bias rate, unit/s; 0 where no ramp state is wanted.
    identified : tuple of TermEstimate
        The terms behind the choice.
    fates : mapping of str to str
        What became of each term, such as ``quantization``: "kept out of the white density: …".
    """

    axis: str
    unit: str
    white_density: float
    markov: tuple[MarkovState, ...]
    random_walk_density: float
    constant_sd: float
    ramp_sd: float = 0.0
    identified: tuple[TermEstimate, ...] = ()
    fates: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))


@dataclass(frozen=True)
class GnssNoise:
    """GNSS errors the filter assumes: sd north, east, down (m, m/s), update interval (s), gate (sigmas)."""

    position_sd: tuple[float, float, float]
    velocity_sd: tuple[float, float, float] | None
    interval: float
    gate: float
    correlated: tuple[MarkovState, ...] = ()
    reference: str = ""


@dataclass(frozen=True)
class InitialUncertainty:
    """P0 apart from the biases: sd of position (m), velocity (m/s), tilt and heading (rad), with the reason of each."""

    position: float
    velocity: float
    tilt: float
    heading: float
    reasons: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))


@dataclass(frozen=True)
class FilterConfig:
    """Settings of a navigation filter, with the reason of every choice.

    `channels` are keyed by axis (``gyro_x`` … ``accel_z``); a sensor the log lacks is absent, and `notes` says so.
    `findings` are what `diagnose` found, with their extensions, as plain values.
    """

    name: str
    interval: float
    channels: Mapping[str, ChannelNoise]
    initial: InitialUncertainty
    gnss: GnssNoise | None
    inflations: tuple[Inflation, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    notes: tuple[str, ...] = ()
    findings: tuple[Mapping[str, Any], ...] = ()


@dataclass(frozen=True)
class Gain:
    """What an extension of the model is worth, before and after.

    Attributes
    ----------
    split : str
        Where it was measured: ``second record``, ``60/40`` or ``in sample``.
    before, after : float
        Log likelihood a sample of the data held out, nats.
    nats : float
        Log likelihood gained there, all samples together.
    coverage : mapping of str to (float, float)
        Share of the Allan curve (``allan``) and of the spectrum (``psd``) inside the band of refitted replicas.
    user : mapping of str to (float, float)
        Figures a user reads, with their unit in the name, such as ``bias_prediction_60s [rad/s]``.
    """

    split: str
    before: float
    after: float
    nats: float
    coverage: Mapping[str, tuple[float, float]] = field(default_factory=lambda: MappingProxyType({}))
    user: Mapping[str, tuple[float, float]] = field(default_factory=lambda: MappingProxyType({}))


@dataclass(frozen=True)
class Alternative:
    """A cause that explains an alarm nearly as well; `score` is its weight, 1 for as well as the cause named."""

    cause: str
    score: float


@dataclass(frozen=True)
class Finding:
    """One cause of a misfit between data and simulation.

    Attributes
    ----------
    cause : str
        Code of the catalogue, such as ``temperature``.
    channels : tuple of str
        Axes that show it.
    statistic : str
        What gave it away, in words.
    value : float
        Value of that statistic.
    p_value : float
        Chance of such a value without the cause, the search paid for.
    parameters : mapping of str to Coefficient
        SI. Of several channels: pooled where they agree, else those of the channel that shows it best.
    text : str
        The cause in words, with its figures.
    consequence : str
        What it asks of a filter.
    extension : mapping of str to object
        What was added to the model, as plain values.
    gain : Gain or None
        What that is worth.
    alternatives : tuple of Alternative
        Causes within 3 nats.
    inflations : tuple of Inflation
        Settings to be enlarged for it.
    by_channel : mapping of str to mapping
        Parameters of every channel.
    replicates : ndarray or None
        Values of the statistic in replicas without the cause.
    """

    cause: str
    channels: tuple[str, ...]
    statistic: str
    value: float
    p_value: float
    parameters: Mapping[str, Coefficient]
    text: str
    consequence: str = ""
    extension: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    gain: Gain | None = None
    alternatives: tuple[Alternative, ...] = ()
    inflations: tuple[Inflation, ...] = ()
    by_channel: Mapping[str, Mapping[str, Coefficient]] = field(default_factory=lambda: MappingProxyType({}))
    replicates: FloatArray | None = None


@dataclass(frozen=True)
class Unexplained:
    """An alarm that no cause explains."""

    statistic: str
    channels: tuple[str, ...]
    p_value: float


@dataclass(frozen=True)
class Diagnosis:
    """What the simulation of the base model gets wrong.

    Attributes
    ----------
    findings : tuple of Finding
        Named causes, the clearest first.
    unexplained : tuple of Unexplained
        Alarms without a cause.
    notes : tuple of str
        What is worth knowing and harmless.
    models : mapping of str to NoiseModel
        Extended noise model of every axis, SI.
    base : mapping of str to NoiseModel
        Noise model before.
    """

    findings: tuple[Finding, ...]
    unexplained: tuple[Unexplained, ...] = ()
    notes: tuple[str, ...] = ()
    models: Mapping[str, NoiseModel] = field(default_factory=lambda: MappingProxyType({}))
    base: Mapping[str, NoiseModel] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def quiet(self) -> bool:
        """Whether nothing was found."""
        return not self.findings and not self.unexplained

    @property
    def inflations(self) -> tuple[Inflation, ...]:
        """Settings of a filter to be enlarged."""
        return tuple(inflation for finding in self.findings for inflation in finding.inflations)
