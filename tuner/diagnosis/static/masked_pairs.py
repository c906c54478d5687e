"""Masked pairs: two causes of which neither is found alone, because the noise, refitted, takes up what is left.

When no other test rejects, the noise is fitted under a saturated mean (temperature and its lags, transients,
and the best pair at the noise as fitted): if that gains more than chance at 2 %, all pairs of templates are
scored with this noise, and the likeliest of the best, the noise refitted, is worth a trial.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.probability import chi2_beyond
from tuner.diagnosis.static.causes.base import Extension
from tuner.diagnosis.static.causes.registry import CAUSES
from tuner.diagnosis.static.causes.step import Step
from tuner.diagnosis.static.causes.template import Template
from tuner.diagnosis.static.hypothesis_tests import is_open
from tuner.diagnosis.static.model.dct import block_transform
from tuner.diagnosis.static.model.fitted_channel import FittedChannel, extended

OMNIBUS_LEVEL = 0.02
"""Chance below which a saturated mean is worth a search for pairs: one record in fifty costs that time in vain."""


def likeliest_pair(fitted: FittedChannel) -> tuple[Extension, ...]:
    """Return the likeliest masked pair; nothing where there is no room for one, or nothing promises it."""
    candidates = [] if fitted.count("telegraph") else _candidates(fitted)
    if len(candidates) < 2:
        return ()
    templates = np.stack([c.template(fitted.channel) for c in candidates], axis=1)
    columns = block_transform(templates, fitted.cleaned, fitted.track.singles)
    hint = _best_pairs(fitted, candidates, columns, fitted.fit.expected)
    chosen = sorted({*_saturating(candidates), *hint[0]}) if hint else []
    if not chosen:
        return ()
    full = fitted.refit(columns[:, chosen])
    ratio = max(0.0, 2.0 * (full.log_likelihood - fitted.fit.log_likelihood))
    if chi2_beyond(ratio, len(chosen)) > OMNIBUS_LEVEL:
        return ()
    first = _best_pairs(fitted, candidates, columns, full.expected)
    judged = [(fitted.refit(columns[:, list(pair)]).log_likelihood, pair) for pair in first[:3]]
    pair = max(judged, key=lambda item: item[0])[1]
    one = candidates[pair[0]].likeliest(extended(fitted, candidates[pair[1]]))
    return one, candidates[pair[1]].likeliest(extended(fitted, one))


def _candidates(fitted: FittedChannel) -> list[Template]:
    """Return what is tried of every cause that is still open."""
    out: list[Template] = []
    for code, cause in CAUSES.items():
        if issubclass(cause, Template) and cause.applies(fitted.channel) and is_open(fitted, code):
            out += cause.candidates_in_pairs(fitted.channel)
    return out


def _saturating(candidates: list[Template]) -> list[int]:
    """Return the candidates of a saturated mean: some of everything that is smooth."""
    smooth = [i for i, c in enumerate(candidates) if not isinstance(c, Step)]
    return smooth[:1] + smooth[2::3]


def _best_pairs(
    fitted: FittedChannel, candidates: list[Template], columns: FloatArray, expected: FloatArray
) -> list[tuple[int, int]]:
    """Return the pairs of greatest score at a given noise, the best first; of two steps and of other kinds."""
    singles = fitted.track.singles
    root = 1.0 / np.sqrt(expected[:singles])
    basis, _ = np.linalg.qr(fitted.track.columns * root[:, None])
    target = fitted.track.grid.amplitude[:singles] * root
    target = target - basis @ (basis.T @ target)
    white = columns * root[:, None]
    white = white - basis @ (basis.T @ white)
    gram, score = white.T @ white, white.T @ target
    diagonal = np.diag(gram)
    determinant = np.outer(diagonal, diagonal) - gram**2
    allowed = determinant > 0.02 * np.outer(diagonal, diagonal)
    allowed &= ~_exclusive(candidates)
    square = score**2
    value = np.outer(square, diagonal) + np.outer(diagonal, square) - 2.0 * np.outer(score, score) * gram
    value = np.where(np.triu(allowed, 1), value / np.where(allowed, determinant, 1.0), -np.inf)
    price = np.array([c.choice(fitted.channel) for c in candidates])
    value = value - 2.0 * (price[:, None] + price[None, :])
    order = np.argsort(value, axis=None)[::-1][:40]
    pairs = [(int(i), int(j)) for i, j in zip(*np.unravel_index(order, value.shape), strict=True)]
    kinds: dict[tuple[str, str], tuple[int, int]] = {}
    for pair in pairs:
        kinds.setdefault((candidates[pair[0]].cause, candidates[pair[1]].cause), pair)
    return [pair for pair in kinds.values() if np.isfinite(value[pair])]


def _exclusive(candidates: list[Template]) -> NDArray[np.bool_]:
    """Return which candidates a channel has one of at most, shape (c, c)."""
    codes = [c.cause for c in candidates]
    return np.array(
        [[c.repeats == 1 and code in (c.cause, *c.excludes) for code in codes] for c in candidates]
    )
