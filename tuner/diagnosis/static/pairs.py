"""Pairs that hide each other: neither alarms alone, because the noise, refitted, swallows what is left.

When nothing alarms, the noise is fitted under a saturated mean (temperature and its lags, transients, and
the best pair at the noise as fitted): if that gains more than chance at 2 %, all pairs of templates are
scored with this noise, and the best pair is judged by a likelihood ratio with the noise refitted, χ²₂ times
the number of pairs that differ.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from tuner.diagnosis.static.causes import step, temperature, thermal_lag, warmup
from tuner.diagnosis.static.causes.base import Extension
from tuner.diagnosis.static.model.dct import block_transform
from tuner.diagnosis.static.model.null_distributions import SHRINK
from tuner.diagnosis.static.model.residual import Residual, extended, without
from tuner.diagnosis.static.model.score_scan import step_column
from tuner.diagnosis.static.outcome import Alarm

FloatArray = NDArray[np.float64]

OMNIBUS = 0.02
STEPS = 96
"""Places of a step that are tried."""
TRANSIENTS = (0, 2, 4, 6, 8, 10, 12)
"""Numbers of the time constants that are tried."""
PRICE = {"temperature": 1.0, "thermal_lag": 3.0, "warmup": 5.0, "step": 60.0}
"""How many templates of a kind differ."""


@dataclass(frozen=True)
class _Candidate:
    cause: str
    column: FloatArray
    number: int


def test(found: Residual) -> Alarm | None:
    """Search for a masked pair; None where there is no room for one."""
    candidates = [] if found.found("telegraph") else _candidates(found)
    if len(candidates) < 2:
        return None
    columns = block_transform(
        np.stack([c.column for c in candidates], axis=1), found.repaired, found.track.singles
    )
    hint = _best_pairs(found, candidates, columns, found.fit.expected)
    chosen = sorted({*_saturating(candidates), *hint[0]}) if hint else []
    if not chosen:
        return None
    full = found.refit(columns[:, chosen])
    ratio = max(0.0, 2.0 * (full.log_likelihood - found.fit.log_likelihood))
    if float(chi2.sf(ratio, len(chosen))) > OMNIBUS:
        return None
    first = _best_pairs(found, candidates, columns, full.expected)
    judged = [(found.refit(columns[:, list(pair)]).log_likelihood, pair) for pair in first[:3]]
    value, pair = max(judged, key=lambda item: item[0])
    ratio = max(0.0, 2.0 * (value - found.fit.log_likelihood))
    price = float(np.prod([PRICE[candidates[i].cause] for i in pair]))
    p_value = min(1.0, price * float(chi2.sf(SHRINK * ratio, 2)))
    gain = 0.5 * ratio - float(np.log(price)) - 0.5 * float(np.log(found.channel.blocks))
    return Alarm(
        "pair",
        p_value,
        gain,
        ratio,
        "likelihood ratio of a pair of slow templates",
        lambda: _extensions(found, [candidates[i] for i in pair]),
    )


def upgrade(found: Residual, threshold: float) -> tuple[int, Alarm] | None:
    """Return the one slow extension that a pair should replace, and the alarm of that pair; None where there is none.

    One of two effects that hide each other may have been accepted alone, in the shape of both.
    """
    slow = [i for i, x in enumerate(found.extensions) if x.cause in PRICE]
    if len(slow) != 1:
        return None
    fewer = without(found, slow[0])
    pair = test(fewer)
    if pair is None:
        return None
    ratio = pair.statistic - 2.0 * max(0.0, found.fit.log_likelihood - fewer.fit.log_likelihood)
    p_value = min(1.0, PRICE["step"] * float(chi2.sf(SHRINK * max(ratio, 0.0), 1)))
    if p_value > threshold or 0.5 * ratio < np.log(PRICE["step"]) + 0.25 * np.log(found.channel.blocks):
        return None
    return slow[0], replace(pair, p_value=min(pair.p_value, p_value))


def _candidates(found: Residual) -> list[_Candidate]:
    channel = found.channel
    out: list[_Candidate] = []
    if temperature.COVARIATE in channel.covariates and not found.found("temperature", "thermal_lag"):
        out.append(_Candidate("temperature", temperature.centred(channel), 0))
        lags = thermal_lag.lags(channel)
        out += [_Candidate("thermal_lag", thermal_lag.lagged(channel, lags[i]), i) for i in (2, 4, 6)]
    if not found.found("warmup"):
        constants = warmup.constants(channel)
        out += [_Candidate("warmup", warmup.transient(channel, constants[i]), i) for i in TRANSIENTS]
    if found.found("step") < step.Step.repeats:
        places = np.linspace(0.02, 0.98, STEPS) * channel.blocks
        out += [_Candidate("step", step_column(found, int(m)), int(m)) for m in places]
    return out


def _saturating(candidates: list[_Candidate]) -> list[int]:
    """Return the candidates of a saturated mean: some of everything but steps."""
    smooth = [i for i, c in enumerate(candidates) if c.cause != "step"]
    return smooth[:1] + smooth[2::3]


def _best_pairs(
    found: Residual, candidates: list[_Candidate], columns: FloatArray, expected: FloatArray
) -> list[tuple[int, int]]:
    """Return the pairs of greatest score at a given noise, the best first; of two steps and of other kinds."""
    singles = found.track.singles
    root = 1.0 / np.sqrt(expected[:singles])
    basis, _ = np.linalg.qr(found.track.columns * root[:, None])
    target = found.track.grid.amplitude[:singles] * root
    target = target - basis @ (basis.T @ target)
    white = columns * root[:, None]
    white = white - basis @ (basis.T @ white)
    gram, score = white.T @ white, white.T @ target
    diagonal = np.diag(gram)
    determinant = np.outer(diagonal, diagonal) - gram**2
    allowed = determinant > 0.02 * np.outer(diagonal, diagonal)
    thermal = np.array([c.cause in ("temperature", "thermal_lag") for c in candidates])
    transient = np.array([c.cause == "warmup" for c in candidates])
    allowed &= ~np.outer(thermal, thermal) & ~np.outer(transient, transient)
    square = score**2
    value = np.outer(square, diagonal) + np.outer(diagonal, square) - 2.0 * np.outer(score, score) * gram
    value = np.where(np.triu(allowed, 1), value / np.where(allowed, determinant, 1.0), -np.inf)
    price = np.log([PRICE[c.cause] for c in candidates])
    value = value - 2.0 * (price[:, None] + price[None, :])
    order = np.argsort(value, axis=None)[::-1][:40]
    pairs = [(int(i), int(j)) for i, j in zip(*np.unravel_index(order, value.shape), strict=True)]
    kinds: dict[tuple[str, str], tuple[int, int]] = {}
    for pair in pairs:
        kinds.setdefault((candidates[pair[0]].cause, candidates[pair[1]].cause), pair)
    return [pair for pair in kinds.values() if np.isfinite(value[pair])]


def _extensions(found: Residual, chosen: list[_Candidate]) -> tuple[Extension, ...]:
    """Return the extensions of a pair, each refined with the other one in the model."""
    first = _rough(found, chosen[1])
    one = _fine(extended(found, first), chosen[0])
    other = _fine(extended(found, one), chosen[1])
    return one, other


def _rough(found: Residual, candidate: _Candidate) -> Extension:
    channel = found.channel
    if candidate.cause == "temperature":
        return temperature.Temperature()
    if candidate.cause == "thermal_lag":
        return thermal_lag.ThermalLag(float(thermal_lag.lags(channel)[candidate.number]))
    if candidate.cause == "warmup":
        return warmup.Warmup(float(warmup.constants(channel)[candidate.number]))
    return step.Step(candidate.number * channel.block)


def _fine(found: Residual, candidate: _Candidate) -> Extension:
    channel = found.channel
    if candidate.cause == "thermal_lag":
        return thermal_lag.extension(found, float(thermal_lag.lags(channel)[candidate.number]))
    if candidate.cause == "warmup":
        return warmup.extension(found, float(warmup.constants(channel)[candidate.number]))
    if candidate.cause == "step":
        return step.near(found, candidate.number, channel.blocks // STEPS)
    return temperature.Temperature()
