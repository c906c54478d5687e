"""Checks of the final residuals where no cause was looked for: what a wrong name gets wrong elsewhere.

A name is accepted because it explains one statistic. If it is right, its model predicts all others: residuals that are
independent, normal and alike at all times and frequencies. Each check is a test of that with a null distribution of its
own; what rejects is unexplained, and makes the names of its kind less certain (`tuner.diagnosis.static.diagnose`)::

    law       Neyman's smooth test [1]_: W = n m'G⁻¹m, χ²₆, m the means of the Legendre polynomials of degree 3 … 8 of
              Φ(e) less what mean and variance of e make of them, G their covariance for normal numbers
              and the same of the means of 8, 32 … residuals
    squares   the spectrum of e² above 64 cycles a record is flat, but for what is left of colour in e, 2 r² with the
              autocorrelation r: Σ d², d the normal deviates of its means in octaves ÷ their common mean
    spectrum  the power in cells of time and frequency is the product of those of its time and of its frequency:
      in time Σ d² over the cells of a grid, for two grids
    times of  spikes come at random: the largest ordinate of the periodogram of their places, over the level of its
    spikes    neighbours, is exponential; samples in a row are one spike
    beside    a line is alone: the mean of the ordinates next to it is that of white noise
    lines
    course    smooth functions of time, its logarithm and the temperature explain no more of the bias: likelihood
              ratio of all of them, the noise refitted; only where a slow cause was accepted, whose course it judges

References
----------
.. [1] J. Neyman, Smooth test for goodness of fit, Skandinavisk Aktuarietidskrift 20 (1937).
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.polynomial.legendre import Legendre, legvander
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft
from scipy.special import ndtr

from models.arrays import FloatArray
from models.probability import chi2_beyond, rounding_variance
from tuner.curves.long_transforms import without_tables
from tuner.diagnosis.static.causes.line import Line
from tuner.diagnosis.static.causes.periodic_variance import MIN_CYCLES
from tuner.diagnosis.static.causes.spikes import Spikes
from tuner.diagnosis.static.causes.temperature import COVARIATE
from tuner.diagnosis.static.causes.template import Template, TimeConstantTemplate
from tuner.diagnosis.static.model.dct import block_transform
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.null_distributions import SLOW_RATIO_FACTOR, variance_deviate
from tuner.diagnosis.static.model.series_statistics import RESIDUAL_CLIP, moment
from tuner.diagnosis.static.outcome import TestResult
from tuner.diagnosis.static.spectrum.background import local_level
from tuner.diagnosis.static.variance.histogram import histogram
from tuner.diagnosis.static.variance.local_variance import local_variance
from tuner.diagnosis.static.variance.quantized_noise import hides_noise

LAW_DEGREES = range(3, 9)
"""Degrees of the polynomials: 3 is skewness, 4 the tails, the higher ones see several peaks and gaps."""
MAX_ROUNDING_SHARE = 0.022
"""Share of the variance of the residuals that is rounding, up to which its own law does not matter.

White noise has it at a step of half an sd, which adds 0.4 to W in 1e6 samples, and 360 at 0.6; where a filter leaves
little but rounding at high frequencies, the law and the squares of that are seen.
"""
MEAN_SIZES, MIN_MEANS = (8, 32, 128, 512), 500
"""Residuals in a mean, and least number of means: with fewer the statistic is no χ² in its tail."""
MAX_ABSENT_SHARE = 0.02
"""Share of a part of the record that was not measured, beyond that of the others, up to which its spectrum is tested.

The noise that stands in the gaps has not the colour of the rest.
"""
COLOUR_LAGS, MIN_CORRELATION_SDS = 256, 4.0
"""Lags to which residuals may be correlated, and least correlation that counts, in sds of that of white noise."""
TIME_FREQUENCY_GRIDS = ((32, 12), (8, 64))
"""Parts of the time and bands of the frequency; for what switches in seconds and for what moves in frequency."""
PARTS_AT_ONCE = 4
"""Parts transformed side by side, which takes half the time of one after the other."""
MIN_ORDINATES = 8
"""Least ordinates of a periodogram in a cell: with 16 degrees of freedom the cube root of χ² is close to normal."""
SIDE_ORDINATES = 8
"""Ordinates on either side of a line; chosen as those that a phase that wanders through the record reaches first."""
MIN_SPIKES = 8
"""Least number of spikes: no ordinate is larger than it, and exp(−8) is no evidence among thousands of ordinates."""
LONGEST_PERIOD = 4
"""Longest period that is looked for ÷ median distance of two spikes: slower changes are a few bursts of them."""
SPIKE_ORDINATES = 64
"""Ordinates whose median is the level of those beside it, which bursts of spikes raise at low frequencies."""
HARMLESS_SHARE = 1e-3
"""Share of the likelihood ratio of the slow causes that may be left of it: no shape is exact to 3 % of its size."""
TRIAL_RATIO = 1.01
"""Ratio of two time constants whose difference is what an error of the fitted one leaves."""
MIN_NEW_SHARE = 1e-2
"""Share of a function that the model must not have, for it to count."""
COURSE_DEGREES = range(2, 5)
"""Degrees of the functions of time, of its logarithm and of the temperature; the first is in the model."""
EARLY_SHARE = 0.01
"""Share of the record from which on the logarithm of time is one: what decays faster is an event."""


def checks(fitted: FittedChannel) -> tuple[TestResult, ...]:
    """Return the results of all checks that apply to a fitted channel."""
    slow = _course(fitted)
    if hides_noise(fitted):
        return slow
    law = (
        (*_law(fitted), *_squares(fitted), *_law_of_means(fitted))
        if _rounding_share(fitted) < MAX_ROUNDING_SHARE
        else ()
    )
    return (*law, _spectrum_in_time(fitted), *_beside_lines(fitted), *_spike_times(fitted), *slow)


def _rounding_share(fitted: FittedChannel) -> float:
    """Return the share of the variance of the residuals that the rounding of the samples makes."""
    rounding = rounding_variance(fitted.channel.quantizer_step) * fitted.channel.interval
    return rounding * float(np.mean(1.0 / fitted.power)) if rounding else 0.0


def _result(cause: str, statistic: float, freedom: int, name: str, place: str, tried: int = 1) -> TestResult:
    """Return the result of a χ² statistic, the least likely of so many."""
    p_value = min(1.0, tried * chi2_beyond(statistic, freedom))
    left = 0.5 * max(statistic - freedom, 0.0)
    return TestResult(cause, p_value, 0.0, statistic, name, misfit=left, place=place)


@cache
def _smooth_functions() -> tuple[FloatArray, FloatArray]:
    """Return the coefficients of 1, z and z² − 1 in each polynomial of Φ(z), shape (6, 3), and G, of the rests."""
    z = np.linspace(-9.0, 9.0, 6001)
    weight = np.exp(-0.5 * z * z)
    weight /= weight.sum()
    values = legvander(2.0 * ndtr(z) - 1.0, max(LAW_DEGREES))[:, min(LAW_DEGREES) :]
    known = np.stack((np.ones_like(z), z, (z * z - 1.0) / np.sqrt(2.0)), axis=1)
    shares = values.T @ (known * weight[:, None])
    rest = values - known @ shares.T
    return shares, rest.T @ (rest * weight[:, None])


def _law(fitted: FittedChannel) -> tuple[TestResult, ...]:
    """Test the law of the residuals; nothing where codes or rails make another one."""
    channel = fitted.channel
    if channel.clipped or channel.missing_codes or channel.deadband > 0.0:
        return ()
    e = fitted.good_clipped
    sd = float(np.sqrt(moment(e, 2) - moment(e, 1) ** 2))
    bins = histogram(fitted.good, clip=RESIDUAL_CLIP, sd=sd)
    z, share = bins.value, bins.count / bins.count.sum()
    statistic = len(e) * _smooth_statistic(z, share)
    moments = [float(share @ z**k) for k in (3, 4)]
    place = f"skewness {moments[0]:+.2g}, excess kurtosis {moments[1] - 3.0:+.2g}"
    return (_result("law", statistic, len(LAW_DEGREES), "distribution of the white noise", place),)


def _smooth_statistic(z: FloatArray, share: FloatArray) -> float:
    """Return Neyman's statistic W ÷ n of numbers of unit variance, shape (b,), with their shares."""
    shares, gram = _smooth_functions()
    known = np.stack((np.ones_like(z), z, (z * z - 1.0) / np.sqrt(2.0)), axis=1)
    values = legvander(2.0 * ndtr(z) - 1.0, max(LAW_DEGREES))[:, min(LAW_DEGREES) :]
    mean = share @ (values - known @ shares.T)
    return float(mean @ np.linalg.solve(gram, mean))


def _law_of_means(fitted: FittedChannel) -> tuple[TestResult, ...]:
    """Test the law of means of the residuals, which events and processes that are not normal bend.

    A mean with gaps is that of the residuals in it, over its own sd; less than half of one is none.
    """
    name, tests = "distribution of the means of residuals", []
    e, valid = fitted.clipped, fitted.valid
    sums, count = np.where(valid, e, np.float32(0.0)).astype(float), valid.astype(float)
    sizes = [size for size in MEAN_SIZES if len(e) >= MIN_MEANS * size]
    for size, before in zip(sizes, (1, *sizes), strict=False):
        ratio = size // before
        sums, count = (
            x[: len(x) // ratio * ratio].reshape(-1, ratio) @ np.ones(ratio) for x in (sums, count)
        )
        enough = 2.0 * count >= size
        means = sums[enough] / np.sqrt(count[enough])
        z = (means - means.mean()) / float(means.std())
        bins = histogram(z)
        statistic = len(z) * _smooth_statistic(bins.value, bins.count / len(z))
        place = (
            f"over {size * fitted.channel.interval:.3g} s, excess kurtosis {float(np.mean(z**4)) - 3.0:+.2g}"
        )
        tests.append(_result("law of means", statistic, len(LAW_DEGREES), name, place, len(sizes)))
    return tuple(sorted(tests, key=lambda test: test.p_value)[:1])


def _squares(fitted: FittedChannel) -> tuple[TestResult, ...]:
    """Test whether the squares of the residuals are independent; nothing where codes make them depend on the bias."""
    local = local_variance(fitted)
    measured = local.scatter > 0.0
    if local.rounded:
        return ()
    x = np.empty(len(measured), np.float32)
    np.subtract(local.square, 1.0, out=x, casting="same_kind")
    x[~measured] = 0.0
    size = next_fast_len(len(x), real=True)
    wave = rfft(x, size)
    without_tables(size)
    power = wave.real**2
    power += wave.imag**2
    del wave
    first, last = int(np.ceil(MIN_CYCLES * size / len(x))), len(power) - 1
    edges = np.unique(np.geomspace(first, last, int(np.log2(last / first)) + 1).astype(int))
    count = np.diff(edges)
    mean = np.add.reduceat(power[: edges[-1]], edges[:-1], dtype=float) / count
    mean /= _squares_of_colour(fitted, 0.5 * (edges[1:] + edges[:-1]) / size)
    relative = mean / float(count @ mean / count.sum())
    deviate = variance_deviate(relative, 2.0 * count * len(x) / size)
    worst = int(np.argmax(np.abs(deviate)))
    longest, shortest = size * fitted.channel.interval / edges[worst : worst + 2]
    place = f"{10.0 * np.log10(relative[worst]):+.2g} dB at periods of {shortest:.3g} … {longest:.3g} s"
    name = "the variance of the white noise changes within short times"
    return (_result("squares", float(deviate @ deviate), len(deviate) - 1, name, place),)


def _squares_of_colour(fitted: FittedChannel, cycles: FloatArray) -> FloatArray:
    """Return the spectrum of the squares of normal numbers as coloured as the residuals, 1 if not; cycles a sample."""
    power = fitted.periodogram
    edges = np.linspace(0, len(power), min(COLOUR_LAGS * 4, len(power)) + 1).astype(int)
    mean = np.add.reduceat(power, edges[:-1], dtype=float) / np.diff(edges)
    lag = np.arange(1, COLOUR_LAGS)
    middle = 0.25 * (edges[1:] + edges[:-1]) / len(power)
    r = np.cos(2.0 * np.pi * np.outer(lag, middle)) @ mean / mean.sum()
    r[np.abs(r) < MIN_CORRELATION_SDS / np.sqrt(2.0 * len(power))] = 0.0
    return np.asarray(1.0 + 2.0 * np.cos(2.0 * np.pi * np.outer(cycles, lag)) @ r**2)


def _spectrum_in_time(fitted: FittedChannel) -> TestResult:
    """Test whether the shape of the fast spectrum stays the same through the record."""
    tests = [_cells(fitted, fitted.clipped, parts, bands) for parts, bands in TIME_FREQUENCY_GRIDS]
    return min(tests, key=lambda test: test.p_value)


def _cells(fitted: FittedChannel, e: NDArray[np.float32], parts: int, bands: int) -> TestResult:
    """Test the power in cells of parts of the time and bands of the frequency."""
    name = "the spectrum of the white noise changes with time"
    size, dt = len(e) // parts, fitted.channel.interval
    lowest = max(int(np.ceil(fitted.track.singles / (2.0 * len(e)) * size)), 2)
    edges = np.unique(np.linspace(lowest, size // 2, bands + 1).astype(int))
    count = np.diff(edges)
    if len(count) < 2 or count.min() < MIN_ORDINATES:
        return TestResult("spectrum in time", 1.0, 0.0, 0.0, name)
    absent = 1.0 - fitted.valid[: parts * size].reshape(parts, size).mean(axis=1)
    measured = np.flatnonzero(absent <= np.median(absent) + MAX_ABSENT_SHARE)
    cell = np.empty((len(measured), len(count)))
    rows = e[: parts * size].reshape(parts, size)
    if len(measured) < parts:
        rows = rows[measured]
    for first in range(0, len(measured), PARTS_AT_ONCE):
        wave = rfft(rows[first : first + PARTS_AT_ONCE], axis=1)[:, : edges[-1]]
        power = wave.real**2 + wave.imag**2
        sums = np.add.reduceat(power, edges[:-1], axis=1, dtype=float)
        cell[first : first + PARTS_AT_ONCE] = sums / count
    for _ in range(2):
        cell = cell / (cell @ count / count.sum())[:, None]
        cell = cell / cell.mean(axis=0)
    deviate = variance_deviate(cell, 2.0 * count)
    at, band = np.unravel_index(int(np.argmax(np.abs(deviate))), deviate.shape)
    begin, end = (fitted.channel.time(float(part) * size) for part in (measured[at], measured[at] + 1))
    low, high = edges[band : band + 2] / (size * dt)
    place = (
        f"{10.0 * np.log10(cell[at, band]):+.2g} dB at {low:.3g} … {high:.3g} Hz "
        f"between {begin:.6g} and {end:.6g} s"
    )
    freedom = (len(measured) - 1) * (len(count) - 1)
    return _result(
        "spectrum in time", float(np.sum(deviate**2)), freedom, name, place, len(TIME_FREQUENCY_GRIDS)
    )


def _beside_lines(fitted: FittedChannel) -> tuple[TestResult, ...]:
    """Test the power next to each line that was accepted; nothing where there are none."""
    frequencies = [x.frequency for x in fitted.extensions if isinstance(x, Line)]
    span, power = fitted.spectrum
    apart = span / fitted.channel.span
    away = apart * np.concatenate((np.arange(-SIDE_ORDINATES, 0), np.arange(1, SIDE_ORDINATES + 1)))
    tests = []
    for f in frequencies:
        at = np.rint(f * span + away).astype(int) - 1
        at = at[(at >= 0) & (at < len(power))]
        place = f"at {f:.6g} Hz"
        statistic = 2.0 * float(power[at].sum())
        tests.append(
            _result("beside lines", statistic, 2 * len(at), "power beside a line", place, len(frequencies))
        )
    return tuple(sorted(tests, key=lambda test: test.p_value)[:1])


def _spike_times(fitted: FittedChannel) -> tuple[TestResult, ...]:
    """Test whether the spikes that were accepted come at a period; nothing where there are none."""
    every = sorted({place for x in fitted.extensions if isinstance(x, Spikes) for place in x.places})
    places = np.array(every)[np.diff(every, prepend=-9) > 1]
    if len(places) < MIN_SPIKES:
        return ()
    n = len(fitted.e)
    size = next_fast_len(n, real=True)
    there = np.zeros(n, np.float32)
    there[places] = 1.0
    wave = rfft(there - there.mean(), size)
    power = (wave.real**2 + wave.imag**2) / len(places)
    if size % 2 == 0:
        power[-1] *= 0.5  # of one degree of freedom, where all others have two
    first = int(np.ceil(size / (LONGEST_PERIOD * np.median(np.diff(places)))))
    power[first:] /= np.maximum(local_level(power[first:], SPIKE_ORDINATES), 1.0)
    at = first + int(np.argmax(power[first:]))
    place = f"every {size * fitted.channel.interval / at:.4g} s or a multiple of that"
    height, tried = float(power[at]), len(power) - first
    name = "spikes come at a period"
    p_value = min(1.0, tried * float(np.exp(-height)))
    left = max(height - float(np.log(tried)), 0.0)
    return (TestResult("times of spikes", p_value, 0.0, height, name, misfit=left, place=place),)


def _coefficients(fitted: FittedChannel, columns: FloatArray) -> FloatArray:
    """Return the coefficients (K, p) of functions on the blocks, shape (M, p)."""
    return block_transform(columns, fitted.cleaned, fitted.track.singles)


def harmless_ratio(fitted: FittedChannel) -> float:
    """Return the likelihood ratio that the slow causes of a model may leave."""
    size = fitted.fit.beta[1:] ** 2 / np.diag(fitted.fit.beta_covariance)[1:]
    return HARMLESS_SHARE * float(size.sum())


def _course(fitted: FittedChannel) -> tuple[TestResult, ...]:
    """Test the course of the bias beside the slow causes that were accepted; nothing where there are none."""
    channel = fitted.channel
    if not any(isinstance(x, Template) for x in fitted.extensions):
        return ()
    time = channel.block_time / channel.span
    inputs = [time, np.log(EARLY_SHARE + time)]
    if any(isinstance(x, Template) and x.covariate for x in fitted.extensions):
        inputs.append(channel.covariates[COVARIATE])
    functions = [
        Legendre.basis(degree, [float(x.min()), float(x.max())])(x)
        for x in inputs
        for degree in COURSE_DEGREES
    ]
    moved = [
        x.at(TRIAL_RATIO * x.time_constant).columns(channel) - x.columns(channel)
        for x in fitted.extensions
        if isinstance(x, TimeConstantTemplate)
    ]
    known = [fitted.track.columns, *(_coefficients(fitted, change) for change in moved)]
    basis = np.linalg.qr(np.concatenate(known, axis=1))[0]
    columns = _coefficients(fitted, np.stack(functions, axis=1))
    columns /= np.linalg.norm(columns, axis=0)
    new, size, _ = np.linalg.svd(columns - basis @ (basis.T @ columns), full_matrices=False)
    new = new[:, size > MIN_NEW_SHARE]
    if not new.shape[1]:
        return ()
    ratio = 2.0 * SLOW_RATIO_FACTOR * (fitted.refit(new).log_likelihood - fitted.fit.log_likelihood)
    ratio = max(ratio - harmless_ratio(fitted), 0.0)
    place = f"beside {', '.join(x.cause for x in fitted.extensions if isinstance(x, Template))}"
    return (_result("course", ratio, new.shape[1], "course of the bias", place),)
