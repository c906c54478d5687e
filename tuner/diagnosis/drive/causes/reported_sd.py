"""Standard deviations that a receiver reports: how they stand to the truth, by class of fix and as a function.

Fixes fall into classes where the level ρ of the reported sds (`tuner.navigation.fix_sd_model`) jumps, as between fixed,
float and single solutions: gaps of its logarithm in the sorted values. Of position and of velocity, three laws compete,
the likelihood less ½ ln n a parameter deciding::

    factor     a r                  one number for all: the base
    classes    a_c r                one for each class
    power      a r (ρ/ρ₀)^(b−1)     ρ₀ the geometric mean of ρ; b = 0: the report says nothing

Each is tested against the base by the likelihood ratio, χ² of the numbers it adds; a score of the same freedom comes
first and spares the fits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from tuner.diagnosis.drive.cause_test import Claim
from tuner.diagnosis.drive.linear_model.likelihood import NoiseHypothesis, evaluate, evaluate_with_gradient
from tuner.diagnosis.drive.linear_model.linearized_run import LinearRecord
from tuner.diagnosis.drive.linear_model.noise_fit import Fit, maximise
from tuner.diagnosis.drive.linear_model.noise_parameters import (
    BLOCKS,
    EXPONENT,
    ROWS,
    Said,
    factors,
    of_block,
    weights,
)
from tuner.diagnosis.static.outcome import Alarm
from tuner.navigation.fix_sd_model import CAUSE, edges_in, levels
from tuner.types import Coefficient

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

JUMP = np.log(2.0)
"""Gap of the log of the reported sd that parts two classes."""
SMALLEST = 0.03
"""Least share of the fixes in a class."""
FEWEST = 30
"""Least number of fixes in a class."""
VARIES = 1.2
"""Ratio of the 95 % to the 5 % quantile of the reported sd from which its law can be asked for."""
CLOSE = 3.0
"""Nats by which a power must do better than classes, where there are some."""
PROMISING = 6.0
"""Score statistic from which a fit is worth its time."""
LEAST = 0.02
"""Least factor that is put into a filter: beside correlated errors the white part of smoothed fixes may be nothing, and
a filter configured so refuses every fix once it is off."""


@dataclass(frozen=True)
class ReportedLaw:
    """How the sds of a receiver stand to the truth.

    Attributes
    ----------
    block : str
        ``position`` or ``velocity``.
    law : str
        Name of the best law.
    fits : mapping of str to Fit
        Of every law that was tried.
    gain : float
        Penalised log likelihood of the best law over the base, nats.
    p_value : float
        Chance of so much against the base; 1 for the base itself.
    said : Said
        Classes and levels of the fixes.
    edges : tuple of float
        Levels at which the classes from the second on begin.
    """

    block: str
    law: str
    fits: dict[str, Fit]
    gain: float
    p_value: float
    said: Said
    edges: tuple[float, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters of the best law, horizontal and vertical apart."""
        rows = of_block(ROWS, self.block)
        if self.law == "classes":
            return tuple(f"{row}_class_{c}" for c in range(len(self.edges) + 1) for row in rows)
        return (*rows, f"{self.block}{EXPONENT}") if self.law == "power" else rows

    def values(self, fit: Fit) -> dict[str, float]:
        """Return the law as names of a compensation, `fit` being of `names`."""
        out = {f"{CAUSE}{name}": fit.factor(name) for name in self.names if not name.endswith(EXPONENT)}
        out |= {f"{CAUSE}{self.block}_edge_{c}": edge for c, edge in enumerate(self.edges, 1)}
        if self.law == "power":
            more = float(fit.estimate[fit.number(f"{self.block}{EXPONENT}")])
            out[f"{CAUSE}{self.block}{EXPONENT}"] = 1.0 + more
            out[f"{CAUSE}{self.block}_typical"] = float(np.exp(self.said.typical[self.block]))
        return out


def edges_of(level: FloatArray) -> tuple[float, ...]:
    """Return where classes part, from levels (k,), NaN where there is none."""
    order = np.sort(np.log(level[np.isfinite(level) & (level > 0.0)]))
    least = max(FEWEST, int(SMALLEST * len(order)))
    edges, start = [], 0
    for i in np.flatnonzero(np.diff(order) > JUMP).tolist():
        if i + 1 - start >= least and len(order) - i - 1 >= least:
            edges.append(float(np.exp(0.5 * (order[i] + order[i + 1]))))
            start = i + 1
    return tuple(edges)


def said_by(record: LinearRecord, values: Mapping[str, float]) -> Said:
    """Return classes and levels of the fixes of a record, edges and typical levels as in a compensation."""
    classes: dict[str, IntArray] = {}
    logs: dict[str, FloatArray] = {}
    typical = {}
    for block, columns in BLOCKS.items():
        level = levels(record.reported_sd[:, list(columns)])
        classes[block] = np.searchsorted(np.array(edges_in(values, block)), level).astype(np.int64)
        logs[block] = np.log(level)
        typical[block] = float(np.log(values.get(f"{CAUSE}{block}_typical", 1.0)))
    return Said(classes, logs, typical)


def edges_told(values: Mapping[str, float]) -> dict[str, Coefficient]:
    """Return the levels of reported sds at which classes begin in a compensation, for a finding."""
    return {
        f"{block}_edge_{c}": Coefficient(edge, None, None, unit, "reported sd from which this class begins")
        for block, unit in (("position", "m"), ("velocity", "m/s"))
        for c, edge in enumerate(edges_in(values, block), 1)
    }


def has_law(values: Mapping[str, float], block: str) -> bool:
    """Whether a compensation has classes or an exponent for a block."""
    return bool(edges_in(values, block)) or f"{CAUSE}{block}{EXPONENT}" in values


def names_in(values: Mapping[str, float]) -> tuple[str, ...]:
    """Return the parameters of the fixes that a compensation has a law for: of every row its factor, or one a class."""
    out: list[str] = []
    for block in BLOCKS:
        rows = of_block(ROWS, block)
        count = len(edges_in(values, block)) + 1
        out += rows if count == 1 else [f"{row}_class_{c}" for c in range(count) for row in rows]
        if f"{CAUSE}{block}{EXPONENT}" in values:
            out.append(f"{block}{EXPONENT}")
    return tuple(out)


def factor_in(values: Mapping[str, float], name: str) -> float:
    """Return a factor, true ÷ reported, or the exponent that a compensation has by name of `names_in`."""
    plain = name.partition("_class_")[0]
    own = values.get(f"{CAUSE}{name}", 1.0)
    return own if plain == name else own * values.get(f"{CAUSE}{plain}", 1.0)


def refitted(values: Mapping[str, float], fit: Fit) -> dict[str, float]:
    """Return what a fit of `names_in` makes of the values of a compensation that has them."""
    out = {}
    for name in fit.scales.names:
        key, more = f"{CAUSE}{name}", float(fit.estimate[fit.number(name)])
        out[key] = values[key] + more if name.endswith(EXPONENT) else scaled(values, key, float(np.exp(more)))
    return out


def scaled(values: Mapping[str, float], key: str, more: float) -> float:
    """Return a factor of a compensation times another one, `LEAST` at least."""
    return max(LEAST, values.get(key, 1.0) * more)


def reported_law(noise: NoiseHypothesis, block: str) -> ReportedLaw | None:
    """Choose the law of the reported sds of a block; None where they do not vary, or are not there.

    Parameters
    ----------
    noise : NoiseHypothesis
        Noise assumed so far; the laws multiply its sds.
    block : str
        ``position`` or ``velocity``.
    """
    columns = list(BLOCKS[block])
    counted = noise.counted[:, columns].all(axis=1)
    if np.count_nonzero(counted) < 2 * FEWEST:
        return None
    level = levels(noise.record.reported_sd[:, columns])
    low, high = np.quantile(level[counted], (0.05, 0.95))
    if high < VARIES * low:
        return None
    edges = edges_of(np.where(counted, level, np.nan))
    classes = np.searchsorted(np.array(edges), level).astype(np.int64)
    said = Said({block: classes}, {block: np.log(level)}, {block: float(np.mean(np.log(level[counted])))})
    tried: dict[str, tuple[str, ...]] = {"power": (block, f"{block}{EXPONENT}")}
    if edges:
        tried["classes"] = tuple(f"{block}_class_{c}" for c in range(len(edges) + 1))
    if not any(_promising(noise, names, said) for names in tried.values()):
        return None
    tried = {"factor": (block,), **tried}
    fits = {name: maximise(noise, factors(names, said)) for name, names in tried.items()}
    price = 0.5 * float(np.log(3 * np.count_nonzero(counted)))
    score = {name: fit.log_likelihood - price * len(fit.estimate) for name, fit in fits.items()}
    if "classes" in score and score["power"] < score["classes"] + CLOSE:
        # Between two sharp classes any power does the same.
        score["power"] = -np.inf
    best = max(score, key=lambda name: score[name])
    more = len(fits[best].estimate) - 1
    ratio = max(0.0, 2.0 * (fits[best].log_likelihood - fits["factor"].log_likelihood))
    p_value = float(chi2.sf(ratio, more)) if more else 1.0
    gain = score[best] - score["factor"]
    return ReportedLaw(block, best, fits, gain, p_value, said, edges if best == "classes" else ())


def reported_noise(noise: NoiseHypothesis, block: str) -> Claim | None:
    """Test whether sds of a block stand to the reported ones otherwise than by one factor; None where they do not.

    Parameters
    ----------
    noise, block
        As of `reported_law`.
    """
    law = reported_law(noise, block)
    if law is None or law.law == "factor":
        return None
    fit, best = maximise(noise, factors(law.names, law.said)), law.fits[law.law]
    base = law.fits["factor"]
    ratio = 2.0 * (best.log_likelihood - base.log_likelihood)
    price = 0.5 * float(np.log(noise.count)) * len(fit.estimate)
    gain = fit.log_likelihood - evaluate(noise).value - price
    title = f"likelihood ratio of {'factors by class of fix' if law.law == 'classes' else 'a power of the reported sd'}"
    p_value = min(1.0, len(BLOCKS) * law.p_value)

    def described() -> Mapping[str, Coefficient]:
        return {name: coefficient(fit, name) for name in law.names}

    return Claim(
        Alarm("gnss_noise_scale", p_value, gain, ratio, title), fit.noise, described, law.values(fit)
    )


def coefficient(fit: Fit, name: str, scale: float = 1.0) -> Coefficient:
    """Return a parameter of a law with its interval: a factor times `scale`, or an exponent with `scale` added."""
    if not name.endswith(EXPONENT):
        return fit.coefficient(name, scale=scale)
    j = fit.number(name)
    value, half = scale + float(fit.estimate[j]), 1.96 * float(np.sqrt(fit.covariance[j, j]))
    return Coefficient.known(value, value - half, value + half, "1")


def _promising(noise: NoiseHypothesis, names: tuple[str, ...], said: Said) -> bool:
    """Whether the scores of a law's parameters, that of a common factor taken out, are worth a fit."""
    _, gradient = evaluate_with_gradient(noise)
    slope = factors(names, said).slopes(noise, np.zeros(len(names)), gradient)
    own = 2.0 * np.where(noise.counted, gradient.precision * noise.sd**2, 0.0) ** 2
    pulls = np.stack([weights(name, len(own), said).ravel() for name in names])
    information = (pulls * own.ravel()) @ pulls.T
    block = next(iter(said.classes))
    common = np.zeros((len(own), 6))
    common[:, list(BLOCKS[block])] = 1.0
    whole = float(np.sum(own * common))
    if whole <= 0.0:
        return False
    total = float(np.sum(np.where(noise.counted, gradient.by_sd, 0.0) * common))
    full = float(slope @ np.linalg.pinv(information, hermitian=True) @ slope)
    return full - total**2 / whole > PROMISING
