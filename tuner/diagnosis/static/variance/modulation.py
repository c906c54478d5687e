"""Modulation of the noise: a local variance that is periodic, depends on the bias, or changes irregularly.

The mean squares of 256 blocks of residuals are made normal by the cube root of Wilson and Hilferty, with the degrees of
freedom that the measured kurtosis allows; constant, time and temperature, which have a cause of their own
(`tuner.diagnosis.static.causes.variance_drift`), are taken out. Where the model is right the rest d are
independent standard
normal numbers, and::

    periodic   max over f of the regression of d on cos and sin, χ²₂ each, f = 1, 1.5 … 64 cycles a record
    by bias    regression of d on the slow track s, χ²₁; s = Cβ + (E_slow/E)(a − Cβ) in the cosine domain
    irregular  Σ d², χ², less the larger of the two

With a quantizer step of more than two white sd the second is not tested: there rounding causes it. None of them has a
cause in the catalogue: they are reported as unexplained.

References
----------
.. [1] E. B. Wilson, M. M. Hilferty, The distribution of chi-square, PNAS 17 (1931).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.fft import idct

from models.arrays import FloatArray
from models.noise import NoiseModel, Quantization, White
from models.probability import chi2_beyond
from tuner.diagnosis.static.causes.temperature import COVARIATE
from tuner.diagnosis.static.causes.variance_drift import middles, on_blocks
from tuner.diagnosis.static.model.dct import block_transform
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.null_distributions import any_of, variance_deviate
from tuner.diagnosis.static.outcome import TestResult
from tuner.diagnosis.static.variance.local_variance import LEVEL_BLOCKS, block_variance
from tuner.diagnosis.static.variance.normal_blocks import law_in_blocks
from tuner.diagnosis.static.variance.quantized_noise import is_coarse

CYCLES = 0.5 * np.arange(2, LEVEL_BLOCKS // 2 + 1)
"""Cycles in the record that are tried, in steps of half a cycle: the resolution of a finite record."""
MIN_BLOCK_SHARE = 0.5
"""Share of the usual number of samples from which a block counts; chosen so that its variance is at most doubled."""


def test(fitted: FittedChannel) -> tuple[TestResult, TestResult, TestResult]:
    """Test the local variance of the blocks against periods, against the bias, and against being even."""
    deviate, basis = _deviates(fitted)
    periodic, cycles = _periodic(deviate, basis)
    bias = _beside(bias_track(fitted), basis)
    by_bias = float(bias @ deviate) ** 2
    scatter = float(deviate @ deviate) - max(periodic, by_bias)
    chance = 1.0 if is_coarse(fitted) else chi2_beyond(by_bias, 1)
    freedom = int(np.count_nonzero(deviate)) - basis.shape[1] - 2
    period = fitted.channel.span / cycles
    return (
        replace(
            _unnamed("periodic variance", any_of(chi2_beyond(periodic, 2), len(CYCLES)), periodic,
                     "the variance of the white noise swells and ebbs"),
            place=f"with a period of {period:.4g} s",
        ),
        _unnamed("variance by bias", chance, by_bias,
                 "the variance of the white noise moves with the bias"),
        replace(
            _unnamed("irregular variance", chi2_beyond(scatter, freedom), scatter,
                     f"the variance of the white noise changes irregularly between {LEVEL_BLOCKS} parts of the record"),
            misfit=0.5 * max(scatter - freedom, 0.0),
            place=_worst_part(fitted, deviate),
        ),
    )  # fmt: skip


def _worst_part(fitted: FittedChannel, deviate: FloatArray) -> str:
    """Return the time of the part of the record whose variance is farthest off, in words."""
    worst, part = int(np.argmax(np.abs(deviate))), len(fitted.channel) / LEVEL_BLOCKS
    first, last = (fitted.channel.time(place * part) for place in (worst, worst + 1))
    kind = "largest" if deviate[worst] > 0.0 else "least"
    return f"{kind} between {first:.6g} and {last:.6g} s"


def _unnamed(family: str, p_value: float, statistic: float, name: str) -> TestResult:
    return TestResult(family, p_value, 0.0, statistic, name)


def _deviates(fitted: FittedChannel) -> tuple[FloatArray, FloatArray]:
    """Return the deviates of the blocks, shape (`LEVEL_BLOCKS`,), and the orthonormal columns taken out."""
    square, weight, kappa = block_variance(fitted)
    filled = weight > MIN_BLOCK_SHARE * float(np.median(weight))
    level = float(weight[filled] @ square[filled] / weight[filled].sum())
    deviate = np.where(filled, variance_deviate(square / level, 2.0 * weight / kappa), 0.0)
    known = [np.ones(LEVEL_BLOCKS), middles() - 0.5]
    if COVARIATE in fitted.channel.covariates:
        known.append(on_blocks(fitted.channel, fitted.channel.covariates[COVARIATE]))
    basis = np.empty((LEVEL_BLOCKS, 0))
    for column in known:
        basis = np.column_stack((basis, _beside(column * filled, basis)))
    return deviate - basis @ (basis.T @ deviate), basis


def _beside(column: FloatArray, basis: FloatArray) -> FloatArray:
    """Return the unit vector of a column beside orthonormal ones; zeros where nothing is left of it."""
    size = float(np.linalg.norm(column))
    rest = column - basis @ (basis.T @ column)
    rest = rest - basis @ (basis.T @ rest)
    left = float(np.linalg.norm(rest))
    return rest / left if left > 1e-3 * size > 0.0 else np.zeros(len(column))


def _periodic(deviate: FloatArray, basis: FloatArray) -> tuple[float, float]:
    """Return the largest χ²₂ of a cosine and a sine, and the number of their cycles in the record."""
    turn = 2.0 * np.pi * CYCLES[:, None] * middles()
    waves = np.stack((np.cos(turn), np.sin(turn)), axis=1)
    waves = waves - (waves @ basis) @ basis.T
    gram = waves @ waves.transpose(0, 2, 1)
    score = waves @ deviate
    value = np.einsum("ni,nij,nj->n", score, np.linalg.pinv(gram, rcond=1e-3, hermitian=True), score)
    best = int(np.argmax(value))
    return float(value[best]), float(CYCLES[best])


def bias_track(fitted: FittedChannel) -> FloatArray:
    """Return the slow part of the samples as the model sees it, at the variance blocks, shape (`LEVEL_BLOCKS`,)."""
    track, fit = fitted.track, fitted.fit
    low = slice(0, LEVEL_BLOCKS - 1)
    slow = NoiseModel(t for t in fit.terms() if not isinstance(t, White | Quantization))
    power = slow.psd(track.grid.frequency[low], interval=fitted.channel.interval)
    means = track.columns[low] @ fit.beta
    law = block_transform(law_in_blocks(fitted)[:, None], fitted.cleaned, LEVEL_BLOCKS - 1)[:, 0]
    coefficients = means + power / fit.expected[low] * (track.grid.amplitude[low] - law - means)
    return np.asarray(idct(np.concatenate(([0.0], coefficients)), norm="ortho"))
