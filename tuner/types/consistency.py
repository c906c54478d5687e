"""Is a filter as uncertain as it says? Scores of its errors, and what the errors consist of."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.probability import chi2_quantile
from tuner.limits import ENGINE_DIFFERENCE
from tuner.types.honesty import honesty
from tuner.types.judgement import Judgement
from tuner.types.shown import Shown
from tuner.types.verdict import Explanation, Verdict


@dataclass(frozen=True)
class Score:
    """A mean of squared errors over the variances that the filter predicts for them.

    Attributes
    ----------
    name : str
        What is scored: ``nees`` or a block of it, ``nis`` or a part of it, ``outage 60 s``.
    mean : float
        Mean of the squares, `dof` where the filter is right.
    dof : int
        Components of one square.
    effective : float
        Degrees of freedom of χ² with the variance of the mean.
    band : (float, float)
        Means that do not speak against the filter.
    certain : float, optional
        Degrees of freedom that are certain where the scatter of few groups tells them, of which the band is; by default
        `effective`.
    """

    name: str
    mean: float
    dof: int
    effective: float
    band: tuple[float, float]
    certain: float | None = None

    @property
    def freedom(self) -> float:
        """Degrees of freedom that band, interval and power of the score rest on."""
        return self.effective if self.certain is None else self.certain

    @property
    def ratio(self) -> float:
        """True rms ÷ predicted sd."""
        return math.sqrt(self.mean / self.dof)

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the ratio."""
        if not 0.0 < self.freedom < math.inf:
            return (0.0, math.inf) if self.freedom <= 0.0 else (self.ratio, self.ratio)
        low, high = (self.freedom / chi2_quantile(p, self.freedom) for p in (0.975, 0.025))
        return self.ratio * math.sqrt(low), self.ratio * math.sqrt(high)

    @property
    def consistent(self) -> bool:
        """Whether the mean lies in the band."""
        return self.band[0] <= self.mean <= self.band[1]


@dataclass(frozen=True)
class Outage:
    """Position after some time without fixes: rms error and prediction, m, over a number of windows.

    `interval` is that of the ratio of the score at 95 %; nothing is known of it where it is not stored.
    """

    seconds: float
    rms: float
    predicted: float
    score: Score
    windows: int
    interval: tuple[float, float] = (0.0, math.inf)


@dataclass(frozen=True)
class Whiteness:
    """The largest autocorrelation of whitened innovations over lags and parts.

    Attributes
    ----------
    part : str
        ``position`` or ``velocity``.
    lag : int
        Epochs.
    correlation : float
        Value there.
    band : float
        Largest absolute value that does not speak against the filter.
    """

    part: str
    lag: int
    correlation: float
    band: float

    @property
    def consistent(self) -> bool:
        """Whether it is inside the band."""
        return abs(self.correlation) <= self.band


ERROR_UNITS = {"position": "m", "velocity": "m/s", "attitude": "rad"}
"""Unit of the errors of each quantity of three axes, in the order of the state."""


@dataclass(frozen=True)
class RmsError:
    """Rms errors of a quantity by axis, in ``m``, ``m/s`` or ``rad``; without a unit where none is known."""

    values: tuple[float, ...]
    unit: str = ""

    @classmethod
    def of(cls, errors: FloatArray, unit: str = "") -> RmsError:
        """Return the rms over the rows of errors, shape (n, k), that are known."""
        return cls(tuple(np.sqrt(np.nanmean(errors**2, axis=0)).tolist()), unit)


@dataclass(frozen=True, repr=False)
class Consistency(Shown):
    """Scores of a filter and the verdicts on them.

    Attributes
    ----------
    nees : Score or None
        None without a reference.
    blocks : tuple of Score
        NEES of position, velocity, attitude, gyro and accelerometer biases.
    nis : tuple of Score
        All, position, velocity.
    whiteness : Whiteness or None
        None where there are too few innovations in a row.
    outages : tuple of Outage
        By length.
    errors : mapping of str to RmsError
        While aided, by the name of the score of the same; without a truth the innovations, as ``nis_position``.
    gated : float
        Share of fixes refused by the gate.
    diverged : bool
        Whether the filter diverged.
    verdicts : tuple of Verdict
        Reasons first, then scores, the largest deviation first.
    """

    nees: Score | None
    blocks: tuple[Score, ...]
    nis: tuple[Score, ...]
    whiteness: Whiteness | None
    outages: tuple[Outage, ...]
    errors: Mapping[str, RmsError]
    gated: float
    diverged: bool
    verdicts: tuple[Verdict, ...] = ()

    @property
    def shown(self) -> Consistency:
        """What may be shown: of a filter that diverged nothing but that, and the share of fixes refused."""
        if not self.diverged:
            return self
        return Consistency(None, (), (), None, (), {}, self.gated, self.diverged, self.verdicts)

    @property
    def has_truth(self) -> bool:
        """Whether errors are known; else the filter is only compared with the fixes, or with a smoother."""
        return not self.errors or not all(name.startswith("nis_") for name in self.errors)

    @property
    def honesty(self) -> Judgement:
        """The verdict: whether the filter is as uncertain as it says."""
        return honesty(self)

    @property
    def scores(self) -> tuple[Score, ...]:
        """All scores of mean squares."""
        first = () if self.nees is None else (self.nees,)
        return (*first, *self.blocks, *self.nis, *(outage.score for outage in self.outages))

    @property
    def consistent(self) -> bool:
        """Whether nothing speaks against the filter."""
        white = self.whiteness is None or self.whiteness.consistent
        scores = all(score.consistent for score in self.scores)
        return white and scores and not self.diverged


@dataclass(frozen=True)
class ErrorBudget:
    """Covariance of the errors of a filter by source, at the e epochs that are scored (SI).

    Attributes
    ----------
    sources : tuple of str
        Names, g of them.
    t : ndarray, shape (e,)
        Times of the fixes, s.
    covariance : ndarray, shape (e, g, 15, 15)
        Of position, velocity, attitude errors and total biases, by source.
    total : ndarray, shape (e, 15, 15)
        The filter's own: for the sources that it is configured for, their sum.
    innovation, innovation_total : ndarray, shapes (e, g, 6, 6), (e, 6, 6)
        The same of innovations.
    aided : ndarray of int
        Epochs with fixes.
    after : mapping of float to ndarray of int
        Epochs so long, s, after the begin of an outage.
    prior, final : ndarray, shapes (n,), (n, n)
        Sds at the start, the filter's own P after its last fix.
    """

    sources: tuple[str, ...]
    t: FloatArray
    covariance: FloatArray
    total: FloatArray
    innovation: FloatArray
    innovation_total: FloatArray
    aided: NDArray[np.intp]
    after: Mapping[float, NDArray[np.intp]]
    prior: FloatArray
    final: FloatArray

    def share(self, epochs: NDArray[np.intp], block: slice) -> FloatArray:
        """Return the share of every source in the variances of a block, mean over epochs; shape (g,), sum 1."""
        parts = np.einsum("egii->egi", self.covariance[epochs])[:, :, block]
        whole = np.einsum("eii->ei", self.total[epochs])[:, None, block]
        return np.asarray((parts / whole).mean(axis=(0, 2)))


@dataclass(frozen=True)
class WeakDirection:
    """States whose errors a trajectory does not distinguish.

    Attributes
    ----------
    states : tuple of str
        The states, the largest part first.
    parts : tuple of float
        Part of each in the direction, a unit vector of errors in units of their sds.
    strength : float
        Eigenvalue of the correlation matrix: the number of states, where they cannot be distinguished at all.
    """

    states: tuple[str, ...]
    parts: tuple[float, ...]
    strength: float


@dataclass(frozen=True)
class Observability:
    """Final ÷ initial sd of every state, and the weak directions, the strongest first."""

    left: Mapping[str, float]
    weak: tuple[WeakDirection, ...]


@dataclass(frozen=True)
class EngineComparison:
    """How far the readable filter and the compiled one are apart on the same simulated runs.

    Attributes
    ----------
    runs, simulated : int
        Runs that both filtered, of those that the compiled one did.
    difference : float
        The largest difference at a fix ÷ sd that the readable filter states; NaN where one states no variance.
    state : str
        Estimate of which it is, or sd of an estimate.
    run : int
        Number of its run, from 1.
    t : float
        Its time from the start, s.
    """

    runs: int
    simulated: int
    difference: float
    state: str
    run: int
    t: float

    @property
    def agree(self) -> bool:
        """Whether rounding explains the difference."""
        return self.difference <= ENGINE_DIFFERENCE


@dataclass(frozen=True, repr=False)
class Check(Shown):
    """The outcome of a Monte-Carlo check of a configuration.

    Attributes
    ----------
    consistency : Consistency
        Scores and verdicts.
    states : int
        States of the filter.
    notes : tuple of str
        What had to be assumed.
    budget : ErrorBudget or None
        Variance by source; where it was wanted or the filter is not consistent.
    observability : Observability or None
        What the trajectory shows of the states; beside the budget.
    explanations : tuple of Explanation
        What would explain the scores of an inconsistent filter, the likeliest first.
    engines : EngineComparison or None
        Whether filterpy gives the same answers; where it was wanted.
    """

    consistency: Consistency
    states: int
    notes: tuple[str, ...]
    budget: ErrorBudget | None = None
    observability: Observability | None = None
    explanations: tuple[Explanation, ...] = ()
    engines: EngineComparison | None = None

    @property
    def honest(self) -> bool:
        """Whether the filter is shown to be honest, and no other engine contradicts its scores."""
        return self.consistency.honesty.good and (self.engines is None or self.engines.agree)
