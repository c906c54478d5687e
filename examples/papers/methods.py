"""Paper 1, table 1: measured errors of six methods on seven noises, which the paper rates by stars.

Every record holds an hour at 10 Hz of unit white noise and one further noise; every method gives the coefficient of the
latter, and its error is the rms of estimate ÷ truth − 1 over many records. A method reads what it can:

- Allan variance: weighted fit of the sum of both terms; of a sinusoid the excess at its peak, σ = 0.7246 A.
- Spectrum: fit of the sum to the logarithm of the spectrum; of a line the power above its neighbours.
- N-second averages: their variance v, all of it taken for the noise wanted.
- Correlation: −dt² r(1) of quantization, the exponential of a Markov process, the cosine of a line.
- Regression: the slope of a straight line, and what it leaves.
- Time plot: ends, heights and bands, as an eye reads them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from scipy.optimize import curve_fit, least_squares
from scipy.stats import norm

from examples.papers.results import Claim, Item, Picture, Table, judge
from examples.papers.sampling import Settings, estimate, record_from
from examples.papers.subjects import RING_LASER_PAPER
from models.arrays import FloatArray
from models.noise import (
    BiasInstability,
    GaussMarkov,
    NoiseModel,
    Quantization,
    Ramp,
    RandomWalk,
    Sinusoid,
    Term,
    White,
)
from tuner.curves import acf, psd
from tuner.curves.allan import overlapping_allan
from tuner.curves.series import averages, nsec
from tuner.identification.allan_leastsquares import fit
from tuner.identification.allan_octaves import OctaveCurve
from tuner.identification.arma_preprocess import remove_trend

Method = Callable[[FloatArray], float]

SAMPLING_INTERVAL, RECORD_SPAN, LINE_FREQUENCY, MARKOV_TIME = 0.1, 3600.0, 0.05, 60.0
"""s; Hz of the line, s of the Markov process."""
NOISES: Mapping[str, Term] = MappingProxyType(
    {
        "quantization": Quantization(1.0),
        "angle random walk": White(1.0),
        "bias instability": BiasInstability(0.3),
        "rate random walk": RandomWalk(0.03),
        "ramp": Ramp(3e-4),
        "periodic": Sinusoid(1.0, LINE_FREQUENCY),
        "Markov": GaussMarkov(0.5, MARKOV_TIME),
    }
)
BEST_METHOD: Mapping[str, str] = MappingProxyType(
    {
        "quantization": "Allan",
        "angle random walk": "Allan",
        "bias instability": "Allan",
        "rate random walk": "Allan",
        "ramp": "regression",
        "periodic": "spectrum",
        "Markov": "correlation",
    }
)
"""Method with three stars; the text keeps the stars but not their columns, which follow from their number."""
MAX_EQUAL_RATIO = 1.1
"""Ratio of errors up to which a method is as good as another."""


def method_table(settings: Settings) -> Item:
    """Return table 1 with measured errors."""
    rng = settings.rng("method-table")
    runs = settings.size(60, 5)
    errors = {noise: {name: np.empty(runs) for name in methods} for noise, methods in METHODS.items()}
    for step in settings.steps(len(METHODS) * runs):
        noise, k = tuple(METHODS)[step // runs], step % runs
        term = NOISES[noise]
        model = NoiseModel((term,)) if isinstance(term, White) else White(1.0) + term
        true = float(getattr(term, term.PARAMETERS[0]))
        y = model.sample(round(RECORD_SPAN / SAMPLING_INTERVAL), SAMPLING_INTERVAL, rng)
        for name, method in METHODS[noise].items():
            errors[noise][name][k] = method(y) / true - 1.0
    rows = ("Allan", "spectrum", "N-second averages", "correlation", "regression", "time plot")
    cells = np.array([[_rms(errors[noise].get(row, np.array([np.nan]))) for noise in NOISES] for row in rows])
    known = 100.0 / np.sqrt(2.0 * runs)
    title = f"rms error of the coefficient over {runs} records, known to {known:.0f} % of itself (–: no way to get it)"
    table = Table(title, rows, tuple(NOISES), cells)
    claims = tuple(_claim(noise, errors[noise]) for noise in NOISES)
    title = f"{RING_LASER_PAPER}: table 1"
    return Item("method-table", title, claims, Picture((table,), columns=1))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _claim(noise: str, errors: Mapping[str, FloatArray]) -> Claim:
    """Compare the method with most stars with the best of the others."""
    starred = BEST_METHOD[noise]
    others = {name: _rms(values) for name, values in errors.items() if name != starred}
    best = min(others, key=lambda name: others[name])
    pair = np.column_stack([errors[starred], errors[best]])
    own = _rms(errors[starred])
    ratio = estimate(pair, lambda p: _rms(p[:, 0]) / _rms(p[:, 1]))
    beaten = own > MAX_EQUAL_RATIO * others[best] and ratio.interval is not None and ratio.interval[0] > 1.0
    return judge(
        f"{noise}: error of {starred} ÷ error of the best other, {best}",
        f"☆☆☆ for {starred}: the best",
        ratio,
        claimed=(0.0, MAX_EQUAL_RATIO),
        derived=(MAX_EQUAL_RATIO, np.inf) if beaten else None,
        why=f"measured: {starred} {100.0 * own:.2g} %, {best} {100.0 * others[best]:.2g} %"
        + (f": {best} is better" if beaten else ""),
    )


def _allan(term: Term) -> Method:
    start = NoiseModel((term,)) if isinstance(term, White) else White(1.0) + term

    def method(y: FloatArray) -> float:
        found = fit(OctaveCurve.of((y,), SAMPLING_INTERVAL), start).model.terms[-1]
        return float(getattr(found, found.PARAMETERS[0]))

    return method


def _allan_line(y: FloatArray) -> float:
    m = np.array([1, round(0.37101 / LINE_FREQUENCY / SAMPLING_INTERVAL)])
    first, peak = overlapping_allan(y, m)
    return float(np.sqrt(max(peak - first / m[1], 0.0)) / 0.72461)


def _spectrum(term: Term) -> Method:
    start = NoiseModel((term,)) if isinstance(term, White) else White(1.0) + term

    def method(y: FloatArray) -> float:
        found = psd(record_from(y, SAMPLING_INTERVAL))
        logs, weight = np.log(found.density[:, 0]), np.sqrt(found.dof / 2.0)

        def residual(theta: FloatArray) -> FloatArray:
            model = start.with_values(np.exp(theta))
            return np.asarray(
                (np.log(model.psd(found.frequency, interval=SAMPLING_INTERVAL)) - logs) * weight
            )

        theta = least_squares(residual, np.log(start.values()), bounds=(-20.0, 20.0)).x
        term_of = start.with_values(np.exp(theta)).terms[-1]
        return float(getattr(term_of, term_of.PARAMETERS[0]))

    return method


def _spectrum_line(y: FloatArray) -> float:
    found = psd(record_from(y, SAMPLING_INTERVAL))
    f, density = found.frequency, found.density[:, 0]
    near = (f > 0.8 * LINE_FREQUENCY) & (f < 1.25 * LINE_FREQUENCY)
    around = (f > 0.3 * LINE_FREQUENCY) & (f < 3.0 * LINE_FREQUENCY)
    power = np.trapezoid(density[near] - np.median(density[around & ~near]), f[near])
    return float(2.0 * np.sqrt(max(power, 0.0)))


def _averages(tau: float, coefficient: Callable[[float], float]) -> Method:
    return lambda y: coefficient(float(nsec(y, [round(tau / SAMPLING_INTERVAL)])[0]))


def _correlation(y: FloatArray, longest: float) -> tuple[FloatArray, FloatArray]:
    """Return lags, s, and autocovariance from lag 1 on."""
    lags = SAMPLING_INTERVAL * np.arange(1, round(longest / SAMPLING_INTERVAL))
    found = acf(record_from(y, SAMPLING_INTERVAL), lag=lags.tolist())
    return found.lag, found.value[:, 0] * float(np.var(y))


def _correlation_quantization(y: FloatArray) -> float:
    return float(SAMPLING_INTERVAL * np.sqrt(max(-_correlation(y, 0.25)[1][0], 0.0)))


def _correlation_line(y: FloatArray) -> float:
    lag, covariance = _correlation(y, 200.0 + 1.5 * SAMPLING_INTERVAL)
    return float(
        np.sqrt(max(float(4.0 * np.mean(covariance * np.cos(2.0 * np.pi * LINE_FREQUENCY * lag))), 0.0))
    )


def _correlation_markov(y: FloatArray) -> float:
    lag, covariance = _correlation(y, 3.0 * MARKOV_TIME)
    start = (max(float(covariance[:50].mean()), 1e-3), MARKOV_TIME)
    bounds = ([1e-6, 1.0], [100.0, 1e4])
    (power, _), _ = curve_fit(lambda t, a, c: a * np.exp(-t / c), lag, covariance, start, bounds=bounds)
    return float(np.sqrt(power))


def _regression_ramp(y: FloatArray) -> float:
    return remove_trend(y)[0] / SAMPLING_INTERVAL


def _regression_white(y: FloatArray) -> float:
    return float(np.std(remove_trend(y - y.mean())[1]) * np.sqrt(SAMPLING_INTERVAL))


def _plot_white(y: FloatArray) -> float:
    return float(np.ptp(y) / (2.0 * norm.isf(0.5615 / len(y))) * np.sqrt(SAMPLING_INTERVAL))


def _plot_ramp(y: FloatArray) -> float:
    tenth = len(y) // 10
    return float((y[-tenth:].mean() - y[:tenth].mean()) / (0.9 * RECORD_SPAN))


def _plot_line(y: FloatArray) -> float:
    return float(0.5 * np.ptp(averages(y, round(0.1 / LINE_FREQUENCY / SAMPLING_INTERVAL))))


METHODS: Mapping[str, Mapping[str, Method]] = MappingProxyType(
    {
        "quantization": {
            "Allan": _allan(NOISES["quantization"]),
            "spectrum": _spectrum(NOISES["quantization"]),
            "N-second averages": _averages(
                SAMPLING_INTERVAL, lambda v: SAMPLING_INTERVAL * float(np.sqrt(v / 2.0))
            ),
            "correlation": _correlation_quantization,
        },
        "angle random walk": {
            "Allan": _allan(NOISES["angle random walk"]),
            "spectrum": _spectrum(NOISES["angle random walk"]),
            "N-second averages": _averages(10.0, lambda v: float(np.sqrt(10.0 * v))),
            "correlation": lambda y: float(np.std(y) * np.sqrt(SAMPLING_INTERVAL)),
            "regression": _regression_white,
            "time plot": _plot_white,
        },
        "bias instability": {
            "Allan": _allan(NOISES["bias instability"]),
            "spectrum": _spectrum(NOISES["bias instability"]),
            "N-second averages": _averages(100.0, lambda v: float(np.sqrt(v))),
        },
        "rate random walk": {
            "Allan": _allan(NOISES["rate random walk"]),
            "spectrum": _spectrum(NOISES["rate random walk"]),
            "N-second averages": _averages(100.0, lambda v: float(np.sqrt(6.0 * v / RECORD_SPAN))),
        },
        "ramp": {
            "Allan": _allan(NOISES["ramp"]),
            "N-second averages": _averages(100.0, lambda v: float(np.sqrt(12.0 * v)) / RECORD_SPAN),
            "regression": _regression_ramp,
            "time plot": _plot_ramp,
        },
        "periodic": {
            "Allan": _allan_line,
            "spectrum": _spectrum_line,
            "N-second averages": _averages(2.0, lambda v: float(np.sqrt(2.0 * v))),
            "correlation": _correlation_line,
            "time plot": _plot_line,
        },
        "Markov": {
            "Allan": _allan(NOISES["Markov"]),
            "spectrum": _spectrum(NOISES["Markov"]),
            "N-second averages": _averages(20.0, lambda v: float(np.sqrt(v))),
            "correlation": _correlation_markov,
        },
    }
)
"""What each method has to offer for each noise."""
