"""Standard deviations that a receiver reports: their relation to the true ones, by class of fix and as a function.

Fixes fall into classes where the level ρ of the reported sds (`tuner.navigation.fix_sd_model`) jumps, as between
fixed, float and single solutions: gaps of its logarithm in the sorted values; or by the solution that the receiver
states. For position and for velocity, four models compete by the likelihood less ½ ln n a parameter::

    factor     a r                  one number for all: the base
    classes    a_c r                one for each class by level
    solutions  a_c r                one for each stated solution
    power      a r (ρ/ρ₀)^(b−1)     ρ₀ the geometric mean of ρ; b = 0: the report says nothing

Each is tested against the base by the likelihood ratio, χ² of the numbers it adds; a score test of the same degrees
of freedom comes first and saves the fits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from models.arrays import FloatArray, IntArray
from tuner.diagnosis.drive.cause_test import CauseTest, scaled_factor
from tuner.diagnosis.drive.linear_model.noise_fit import NoiseFit, maximize_likelihood
from tuner.diagnosis.drive.linear_model.noise_parameters import (
    BLOCKS,
    EXPONENT_ENDING,
    NO_LEVELS,
    ROW_GROUPS,
    ReportedLevels,
    names_of_block,
    noise_parameters,
    weights,
)
from tuner.diagnosis.static.outcome import TestResult
from tuner.linear_run.likelihood import NoiseHypothesis, evaluate, evaluate_with_gradient
from tuner.linear_run.linearized_run import LinearizedRun
from tuner.navigation.fix_sd_model import (
    FixSdModel,
    class_count,
    class_edges_of,
    class_solutions_of,
    fix_sd_model,
    sd_levels,
)
from tuner.types import Coefficient
from tuner.types.records import SOLUTIONS

CLASS_KINDS = ("classes", "solutions")
"""Kinds of models with factors by class: by level, and by stated solution."""
MIN_LOG_GAP = np.log(2.0)
"""Gap of the log of the reported sd between two classes: a factor of 2; chosen as less is gradual."""
MIN_CLASS_SHARE = 0.03
"""Least share of the fixes in a class by level; chosen so that single fixes of odd sd make no class."""
MIN_CLASS_FIXES = 30
"""Least number of fixes in a class: the sd of one row is then known to 1/√60 = 13 %."""
MIN_SD_RATIO = 1.2
"""Ratio of the 95 % to the 5 % quantile of the reported sd from which a model of it can be fitted.

Chosen because below it an exponent hardly changes the sds.
"""
MIN_POWER_ADVANTAGE = 3.0
"""Nats by which a power law must be likelier than classes, where there are some.

A likelihood ratio of 20: between two sharp classes both models are alike.
"""
MIN_SCORE_STATISTIC = 6.0
"""Score statistic from which a fit is worth its time: χ²₁ exceeds 6 by chance in 1.4 %."""


@dataclass(frozen=True)
class ReportedSdModel:
    """Relation of the true sds of a receiver to the reported ones.

    Attributes
    ----------
    block : str
        ``position`` or ``velocity``.
    kind : str
        Name of the best model.
    fits : mapping of str to NoiseFit
        Of every model that was tried.
    p_value : float
        Of the base against it; 1 for the base itself.
    levels : ReportedLevels
        Classes and levels of the fixes.
    edges, solutions : tuple of float
        Levels at which the classes from the second on begin; the stated solutions of all classes.
    """

    block: str
    kind: str
    fits: dict[str, NoiseFit]
    p_value: float
    levels: ReportedLevels
    edges: tuple[float, ...] = ()
    solutions: tuple[float, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters of the best model, horizontal and vertical separately."""
        rows = names_of_block(ROW_GROUPS, self.block)
        if self.kind in CLASS_KINDS:
            count = len(self.solutions) or len(self.edges) + 1
            return tuple(f"{row}_class_{c}" for c in range(count) for row in rows)
        return (*rows, f"{self.block}{EXPONENT_ENDING}") if self.kind == "power" else rows

    def values(self, fit: NoiseFit) -> dict[str, float]:
        """Return the model as values of a compensation, the fit being of `names`."""
        out = {name: fit.factor(name) for name in self.names if not name.endswith(EXPONENT_ENDING)}
        out |= {f"{self.block}_edge_{c}": edge for c, edge in enumerate(self.edges, 1)}
        out |= {f"{self.block}_solution_{c}": number for c, number in enumerate(self.solutions)}
        if self.kind == "power":
            more = float(fit.estimate[fit.number(f"{self.block}{EXPONENT_ENDING}")])
            out[f"{self.block}{EXPONENT_ENDING}"] = 1.0 + more
            out[f"{self.block}_typical"] = float(np.exp(self.levels.typical[self.block]))
        return out


def class_edges(level: FloatArray) -> tuple[float, ...]:
    """Return the levels between classes, from levels (k,), NaN where there is none."""
    order = np.sort(np.log(level[np.isfinite(level) & (level > 0.0)]))
    least = max(MIN_CLASS_FIXES, int(MIN_CLASS_SHARE * len(order)))
    edges, start = [], 0
    for i in np.flatnonzero(np.diff(order) > MIN_LOG_GAP).tolist():
        if i + 1 - start >= least and len(order) - i - 1 >= least:
            edges.append(float(np.exp(0.5 * (order[i] + order[i + 1]))))
            start = i + 1
    return tuple(edges)


def stated_solutions(solution: FloatArray) -> tuple[float, ...]:
    """Return the stated solutions that are classes, from those of fixes (k,); none where there are not two."""
    number, count = np.unique(solution[np.isfinite(solution)], return_counts=True)
    found = number[count >= MIN_CLASS_FIXES].tolist()
    return tuple(found) if len(number) > 1 and found else ()


def reported_levels(linearized: LinearizedRun, values: Mapping[str, float]) -> ReportedLevels:
    """Return classes and levels of the fixes of a run, edges and typical levels as in a compensation."""
    classes: dict[str, IntArray] = {}
    logs: dict[str, FloatArray] = {}
    typical = {}
    for block, columns in BLOCKS.items():
        level = sd_levels(linearized.reported_sd[:, list(columns)])
        classes[block] = fix_sd_model(values, block).classes(level, linearized.solution)
        logs[block] = np.log(level)
        typical[block] = float(np.log(values.get(f"{block}_typical", 1.0)))
    return ReportedLevels(classes, logs, typical)


def edge_coefficients(values: Mapping[str, float]) -> dict[str, Coefficient]:
    """Return what the classes of reported sds are in a compensation, for a finding: levels or stated solutions."""
    stated = {
        f"{block}_solution_{c}": Coefficient(
            number, None, None, "1", f"class {c}: {SOLUTIONS.get(int(number), 'another')}"
        )
        for block in BLOCKS
        for c, number in enumerate(class_solutions_of(values, block))
    }
    return stated | {
        f"{block}_edge_{c}": Coefficient(edge, None, None, unit, "reported sd from which this class begins")
        for block, unit in (("position", "m"), ("velocity", "m/s"))
        for c, edge in enumerate(class_edges_of(values, block), 1)
    }


def has_sd_model(values: Mapping[str, float], block: str) -> bool:
    """Whether a compensation has classes or an exponent for a block."""
    return class_count(values, block) > 1 or f"{block}{EXPONENT_ENDING}" in values


def sd_model_parameters(values: Mapping[str, float]) -> tuple[str, ...]:
    """Return the parameters of the fixes in a compensation: a factor of every group of rows, or one for each class."""
    out: list[str] = []
    for block in BLOCKS:
        rows = names_of_block(ROW_GROUPS, block)
        count = class_count(values, block)
        out += rows if count == 1 else [f"{row}_class_{c}" for c in range(count) for row in rows]
        if f"{block}{EXPONENT_ENDING}" in values:
            out.append(f"{block}{EXPONENT_ENDING}")
    return tuple(out)


def sd_model_factor(values: Mapping[str, float], name: str) -> float:
    """Return the value of a parameter of the model of reported sds: a factor, true ÷ reported, or the exponent.

    Parameters
    ----------
    values : mapping of str to float
        Values of a compensation.
    name : str
        One of `sd_model_parameters`.
    """
    plain = name.partition("_class_")[0]
    own = values.get(name, 1.0)
    return own if plain == name else own * values.get(plain, 1.0)


def updated_values(values: Mapping[str, float], fit: NoiseFit) -> dict[str, float]:
    """Return the values of a compensation after a fit of its `sd_model_parameters`."""
    out = {}
    for name in fit.parameters.names:
        key, more = name, float(fit.estimate[fit.number(name)])
        out[key] = (
            values[key] + more
            if name.endswith(EXPONENT_ENDING)
            else scaled_factor(values, key, float(np.exp(more)))
        )
    return out


def choose_sd_model(noise: NoiseHypothesis, block: str) -> ReportedSdModel | None:
    """Choose the model of the reported sds of a block; None where they do not vary, or are not there.

    Parameters
    ----------
    noise : NoiseHypothesis
        Before the test; the models multiply its sds.
    block : str
        ``position`` or ``velocity``.
    """
    columns = list(BLOCKS[block])
    counted = noise.counted[:, columns].all(axis=1)
    if np.count_nonzero(counted) < 2 * MIN_CLASS_FIXES:
        return None
    level, stated = sd_levels(noise.linearized.reported_sd[:, columns]), noise.linearized.solution
    low, high = np.quantile(level[counted], (0.05, 0.95))
    models: dict[str, FixSdModel] = {}
    if high >= MIN_SD_RATIO * low:
        models = {"power": FixSdModel()}
        if edges := class_edges(np.where(counted, level, np.nan)):
            models["classes"] = FixSdModel(edges=edges)
    if solutions := stated_solutions(np.where(counted, stated, np.nan)):
        models["solutions"] = FixSdModel(solutions=solutions)
    log, typical = np.log(level), float(np.mean(np.log(level[counted])))
    of_kind = {
        kind: ReportedLevels({block: model.classes(level, stated)}, {block: log}, {block: typical})
        for kind, model in models.items()
    }
    candidates: dict[str, tuple[str, ...]] = {
        kind: tuple(f"{block}_class_{c}" for c in range(len(model.solutions) or len(model.edges) + 1))
        for kind, model in models.items()
        if kind in CLASS_KINDS
    }
    if "power" in models:
        candidates["power"] = (block, f"{block}{EXPONENT_ENDING}")
    if not any(_worth_a_fit(noise, names, of_kind[kind]) for kind, names in candidates.items()):
        return None
    of_kind["factor"] = NO_LEVELS
    candidates = {"factor": (block,), **candidates}
    fits = {
        kind: maximize_likelihood(noise, noise_parameters(names, of_kind[kind]))
        for kind, names in candidates.items()
    }
    price = 0.5 * float(np.log(3 * np.count_nonzero(counted)))
    score = {name: fit.log_likelihood - price * len(fit.estimate) for name, fit in fits.items()}
    by_class = max((score[kind] for kind in CLASS_KINDS if kind in score), default=-np.inf)
    if "power" in score and score["power"] < by_class + MIN_POWER_ADVANTAGE:
        # Between two sharp classes any power does the same.
        score["power"] = -np.inf
    best = max(score, key=lambda name: score[name])
    more = len(fits[best].estimate) - 1
    ratio = max(0.0, 2.0 * (fits[best].log_likelihood - fits["factor"].log_likelihood))
    p_value = float(chi2.sf(ratio, more)) if more else 1.0
    chosen = models.get(best, FixSdModel())
    return ReportedSdModel(block, best, fits, p_value, of_kind[best], chosen.edges, chosen.solutions)


def reported_sd_test(noise: NoiseHypothesis, block: str) -> CauseTest | None:
    """Test whether more than one factor relates the true sds of a block to the reported ones; None where one is enough.

    Parameters
    ----------
    noise, block
        As of `choose_sd_model`.
    """
    model = choose_sd_model(noise, block)
    if model is None or model.kind == "factor":
        return None
    fit, best = (
        maximize_likelihood(noise, noise_parameters(model.names, model.levels)),
        model.fits[model.kind],
    )
    base = model.fits["factor"]
    ratio = 2.0 * (best.log_likelihood - base.log_likelihood)
    price = 0.5 * float(np.log(noise.count)) * len(fit.estimate)
    gain = fit.log_likelihood - evaluate(noise).value - price
    alternative = "factors by class of fix" if model.kind in CLASS_KINDS else "a power of the reported sd"
    title = f"likelihood ratio of {alternative}"
    p_value = min(1.0, len(BLOCKS) * model.p_value)

    def described() -> Mapping[str, Coefficient]:
        return {name: coefficient(fit, name) for name in model.names}

    return CauseTest(
        TestResult("gnss_noise_scale", p_value, gain, ratio, title), fit.noise, described, model.values(fit)
    )


def coefficient(fit: NoiseFit, name: str, scale: float = 1.0) -> Coefficient:
    """Return a parameter of a model with its interval: a factor times `scale`, or an exponent with `scale` added."""
    if not name.endswith(EXPONENT_ENDING):
        return fit.coefficient(name, scale=scale)
    j = fit.number(name)
    value, half = scale + float(fit.estimate[j]), 1.96 * float(np.sqrt(fit.covariance[j, j]))
    return Coefficient.known(value, value - half, value + half, "1")


def _worth_a_fit(noise: NoiseHypothesis, names: tuple[str, ...], levels: ReportedLevels) -> bool:
    """Whether the scores of a model's parameters, without that of a common factor, are worth a fit."""
    _, gradient = evaluate_with_gradient(noise)
    slope = noise_parameters(names, levels).slopes(noise, np.zeros(len(names)), gradient)
    own = 2.0 * np.where(noise.counted, gradient.precision * noise.sd**2, 0.0) ** 2
    pulls = np.stack([weights(name, len(own), levels).ravel() for name in names])
    information = (pulls * own.ravel()) @ pulls.T
    block = next(iter(levels.classes))
    common = np.zeros((len(own), 6))
    common[:, list(BLOCKS[block])] = 1.0
    whole = float(np.sum(own * common))
    if whole <= 0.0:
        return False
    total = float(np.sum(np.where(noise.counted, gradient.by_sd, 0.0) * common))
    full = float(slope @ np.linalg.pinv(information, hermitian=True) @ slope)
    return full - total**2 / whole > MIN_SCORE_STATISTIC
