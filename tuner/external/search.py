"""The factors with the largest likelihood, by scoring: a run a factor and step gives the derivatives of everything.

With the derivatives of innovations z and their covariance S by the logarithm of a factor, gradient and information of
the Gaussian likelihood are [1]_

    g_i = Σ −½ tr(S⁻¹S_i) + ½ zᵀS⁻¹S_iS⁻¹z − z_iᵀS⁻¹z        F_ij = Σ ½ tr(S⁻¹S_iS⁻¹S_j) + z_iᵀS⁻¹z_j

and the step (F + Λ)⁻¹(g − Λx), Λ being that of a weak prior, a factor of ten either way: what the data do not tell
stays as it is. Steps are halved until the likelihood grows. Intervals allow for vectors that depend on each other: the
gradients of blocks of time scatter as they do [2]_.

References
----------
.. [1] R. F. Stengel, Optimal Control and Estimation (1994), ch. 4.7; S. Gupta & R. Mehra, IEEE Trans. AC 19 (1974).
.. [2] H. White, Maximum likelihood estimation of misspecified models, Econometrica 50 (1982).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.probability import REACH_95
from tuner.external.innovations import Deviations, common
from tuner.external.noise_factors import NOISE_FACTORS
from tuner.types.records import DataError

Run = Callable[[Mapping[str, float]], Deviations]
"""Runs the program with factors by name."""

MAX_RUNS = 40
"""Runs of the program at most: seven steps of four factors, the first run and the last."""
LOG_DIFFERENCE = 0.1
"""Change of the logarithm of a factor that gives derivatives: a tenth is far above the digits that programs write."""
MAX_LOG_STEP = 1.0
"""Largest change of the logarithm of a factor in a step: Gaussian likelihoods are far from parabolas beyond."""
PRIOR_SD = math.log(10.0)
"""Sd of the logarithm of a factor before the data speak."""
MIN_INFORMATION = 1e-3
"""Information below which a factor is taken to have no effect: it then changes the likelihood by less than noise."""
STEP_SHARE = 0.15
"""Step, in sds of a factor, at which the search ends."""
MAX_HALVINGS = 4
"""Times that a step is halved."""
GRADIENT_BLOCKS = 20
"""Parts of the record whose gradients tell how far the likelihood scatters: their variance is then known to a third."""


@dataclass(frozen=True)
class Found:
    """The best factors.

    Attributes
    ----------
    factors : mapping of str to float
        By name.
    sd : mapping of str to float
        Sd of their logarithms; infinite without effect.
    runs : int
        How often the program ran, the last time with the best factors for their scores.
    before, after : Deviations
        Of the whole record, untouched and with the factors.
    converged : bool
        Whether the last step was small.
    """

    factors: Mapping[str, float]
    sd: Mapping[str, float]
    runs: int
    before: Deviations
    after: Deviations
    converged: bool

    def interval(self, name: str) -> tuple[float, float] | None:
        """Return the interval of 95 % of a factor, None without effect."""
        if not math.isfinite(self.sd[name]):
            return None
        wide = math.exp(REACH_95 * self.sd[name])
        return self.factors[name] / wide, self.factors[name] * wide


def search(run: Run, first: Deviations, *, until: float, progress: Callable[[int, int], None]) -> Found:
    """Return the factors with the largest likelihood of what lies before a time.

    Parameters
    ----------
    run : callable
        From factors to what scores them.
    first : Deviations
        What scores the settings as they are: the first run.
    until : float
        End of what is fitted, s; the rest is for the verdict.
    progress : callable
        Called with the runs that are done and at most left to do.

    Raises
    ------
    DataError
        Of a run.
    """
    count = 1

    def at(x: FloatArray) -> Deviations:
        nonlocal count
        progress(count, MAX_RUNS)
        found = run(dict(zip(NOISE_FACTORS, np.exp(x).tolist(), strict=True)))
        count += 1
        return found

    x = np.zeros(len(NOISE_FACTORS))
    now = first
    active = np.ones(len(NOISE_FACTORS), dtype=bool)
    information, scatter = np.zeros((2, len(NOISE_FACTORS), len(NOISE_FACTORS)))
    prior = np.eye(len(NOISE_FACTORS)) / PRIOR_SD**2
    converged = False
    while not converged and count + int(active.sum()) + 1 < MAX_RUNS:
        gradients = np.zeros((GRADIENT_BLOCKS, len(NOISE_FACTORS)))
        moved: list[Deviations | None] = [None] * len(NOISE_FACTORS)
        for i in np.flatnonzero(active):
            moved[i] = at(x + LOG_DIFFERENCE * np.eye(len(NOISE_FACTORS))[i])
        gradients, information = _derivatives(now, moved, until)
        active &= np.diag(information) > MIN_INFORMATION
        if not active.any():
            break
        gradients[:, ~active] = 0.0
        scatter = GRADIENT_BLOCKS / (GRADIENT_BLOCKS - 1) * gradients.T @ gradients
        step = np.linalg.solve(information + prior, gradients.sum(axis=0) - prior @ x)
        step[~active] = 0.0
        sd = np.sqrt(np.diag(np.linalg.inv(information + prior)))
        step *= min(1.0, MAX_LOG_STEP / float(np.abs(step).max()))
        for _ in range(MAX_HALVINGS):
            if count >= MAX_RUNS - 1:
                break
            other = at(x + step)
            if _score(other, now, until) - 0.5 * _penalty(x + step) >= -0.5 * _penalty(x):
                x, now = x + step, other
                break
            step = 0.5 * step
        else:
            converged = True
        converged |= bool((np.abs(step) < STEP_SHARE * sd)[active].all())
    inverse = np.linalg.inv(information + prior)
    wide = np.maximum(np.diag(inverse), np.diag(inverse @ scatter @ inverse))
    sds = np.where(active, np.sqrt(wide), np.inf)
    factors = dict(zip(NOISE_FACTORS, np.exp(x).tolist(), strict=True))
    return Found(
        factors, dict(zip(NOISE_FACTORS, sds.tolist(), strict=True)), count + 1, first, now, converged
    )


def _penalty(x: FloatArray) -> float:
    return float(x @ x) / PRIOR_SD**2


def _score(other: Deviations, one: Deviations, until: float) -> float:
    """Return the log-likelihood of one output less that of another, of what lies before a time."""
    rows, same = common(one, other)
    early = one.t[rows] <= until
    gain = other.rows(same[early]).log_likelihood() - one.rows(rows[early]).log_likelihood()
    return float(gain.sum()) if len(gain) and np.isfinite(gain).all() else -math.inf


def _derivatives(
    now: Deviations, moved: list[Deviations | None], until: float
) -> tuple[FloatArray, FloatArray]:
    """Return the gradient of each block of time and the information; shapes (b, 4), (4, 4)."""
    n = len(now.t)
    good = now.t <= until
    z_by, s_by = np.zeros((len(moved), *now.z.shape)), np.zeros((len(moved), *now.s.shape))
    for i, other in enumerate(moved):
        if other is None:
            continue
        rows, same = common(now, other)
        seen = np.zeros(n, dtype=bool)
        seen[rows] = True
        good &= seen
        z_by[i, rows] = (other.z[same] - now.z[rows]) / LOG_DIFFERENCE
        s_by[i, rows] = (other.s[same] - now.s[rows]) / LOG_DIFFERENCE
    if np.count_nonzero(good) < GRADIENT_BLOCKS:
        raise DataError("--filter: expected outputs of all runs at the same fixes, found too few that agree")
    inverse = np.linalg.inv(now.s[good])
    z = now.z[good]
    whitened = np.einsum("nij,nj->ni", inverse, z)
    turned = np.einsum("nij,pnjk->pnik", inverse, s_by[:, good])
    slope = z_by[:, good]
    each = (
        -0.5 * np.einsum("pnii->pn", turned)
        + 0.5 * np.einsum("ni,pnij,nj->pn", whitened, s_by[:, good], whitened)
        - np.einsum("pni,ni->pn", slope, whitened)
    )
    information = 0.5 * np.einsum("pnij,qnji->pq", turned, turned) + np.einsum(
        "pni,nij,qnj->pq", slope, inverse, slope
    )
    blocks = np.array_split(np.arange(each.shape[1]), GRADIENT_BLOCKS)
    return np.array([each[:, block].sum(axis=1) for block in blocks]), np.asarray(information)
