"""Shape of the fast spectrum: white noise that passed a filter, or ARMA colour.

The squared coefficients above a hundredth of the rate are averaged in 128 even bins; their law is that of a gamma
variable about::

    E(f) = w g(f; shape) + q · 4 sin²(πfΔ) + s · slow(f)

with the slow part as fitted up to its size s ≥ 0, w ≥ 0 the white noise, q ≥ 0 quantization (the base has
it: a rise that differenced white noise explains is no finding). Shapes compete by likelihood: poles of a
filter (an AR of first or second order with gain 1 at 0, with or without the zeros of the bilinear map), and
ARMA colour.

References
----------
.. [1] G. E. P. Box, G. M. Jenkins, Time Series Analysis, ch. 3, 6.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.signal import butter
from scipy.stats import chi2, norm

from models.effects.spectral import LowPass, Vibration
from models.noise import Quantization, White
from tuner.diagnosis.cosine import CAP
from tuner.diagnosis.residual import Residual, gain_of
from tuner.diagnosis.statistics import curvature

FloatArray = NDArray[np.float64]
Shape = Callable[[FloatArray, FloatArray], FloatArray]

BINS = 128
CLOSE = 5.0
"""Nats within which the simpler shape is taken."""
LOWEST = 0.01
"""Lowest frequency, share of the rate."""


@dataclass(frozen=True)
class Bins:
    """Mean powers in even bins.

    Attributes
    ----------
    cycles : ndarray, shape (b,)
        Frequency × interval.
    power, count : ndarray, shape (b,)
        Mean square and number of coefficients.
    white, rest : ndarray, shape (b,)
        Shape of the white noise so far, and power of everything but white noise and quantization.
    start : (float, float)
        White and quantization power of the fit.
    """

    cycles: FloatArray
    power: FloatArray
    count: FloatArray
    white: FloatArray
    rest: FloatArray
    start: tuple[float, float]


@dataclass(frozen=True)
class ShapeFit:
    """A fitted shape.

    Attributes
    ----------
    name : str
        ``white``, ``pole``, ``butter1`` … or ``ar1``, ``ma1``, ``arma11``, ``ar2``.
    x, covariance : ndarray, shapes (p,), (p, p)
        Parameters of the shape.
    cost : float
        Minus the log likelihood.
    expected : ndarray, shape (b,)
        Expected power.
    slow : float
        Share of the slow noise that is left: the fit without the shape may have used it for the shape.
    """

    name: str
    x: FloatArray
    covariance: FloatArray
    cost: float
    expected: FloatArray
    slow: float


def bins(found: Residual) -> Bins:
    """Return the fast spectrum of a residual in bins."""
    square = found.coefficients[1:] ** 2
    expected, dt = found.power, found.channel.interval
    n = len(square)
    edges = np.linspace(2.0 * LOWEST * n, n, BINS + 1).astype(int)
    level = found.spread**2 * CAP
    square = np.minimum(square, level * expected)
    count = np.diff(edges).astype(float)
    mean = np.add.reduceat(square, edges[:-1])[:BINS] / count
    cycles = 0.25 * (edges[:-1] + edges[1:]) / n
    terms = found.fit.terms()
    white = sum(t.density**2 for t in terms if isinstance(t, White))
    quantization = sum((t.increment_sd / dt) ** 2 * dt for t in terms if isinstance(t, Quantization))
    shape = gain_of(found.extensions, cycles / dt, dt)
    total = np.add.reduceat(expected, edges[:-1])[:BINS] / count
    rest = np.maximum(total - white * shape - quantization * rise(cycles), 0.0)
    return Bins(cycles, mean, count, shape, rest, (white, quantization))


def rise(cycles: FloatArray) -> FloatArray:
    """Return the shape of quantization, 4 sin²(πfΔ)."""
    shape: FloatArray = 4.0 * np.sin(np.pi * cycles) ** 2
    return shape


def fit(data: Bins, name: str) -> ShapeFit:
    """Fit a shape by name, white noise and quantization free."""
    shape, starts, bounds = SHAPES[name]
    weight = 0.5 * data.count
    quantized = rise(data.cycles)
    scale = data.start[0] + data.start[1]

    def expected(x: FloatArray) -> FloatArray:
        form = data.white * shape(x[3:], data.cycles)
        out: FloatArray = (
            scale * (np.exp(x[0]) * form + max(x[1], 0.0) * quantized) + max(x[2], 0.0) * data.rest
        )
        return np.maximum(out, 1e-12 * scale)

    def cost(x: FloatArray) -> float:
        return deviance(weight, data.power, expected(x))

    best = None
    for start in starts:
        x0 = np.array([np.log(max(data.start[0] / scale, 1e-3)), data.start[1] / scale, 1.0, *start])
        found = minimize(cost, x0, method="L-BFGS-B", bounds=[(-8.0, 5.0), (0.0, 20.0), (0.0, 3.0), *bounds])
        if best is None or found.fun < best.fun:
            best = found
    assert best is not None
    return ShapeFit(name, best.x[3:], np.empty((0, 0)), float(best.fun), expected(best.x), float(best.x[2]))


def hump_scan(data: Bins, null: ShapeFit) -> tuple[float, float, float]:
    """Return the chance of the clearest excess of 1 … 16 bins over the null, its middle and width, cycles."""
    weight = 0.5 * data.count
    total = np.concatenate(([0.0], np.cumsum(weight * (data.power / null.expected - 1.0))))
    mass = np.concatenate(([0.0], np.cumsum(weight)))
    best, tests = (0.0, 0.25, 0.01), 0
    for width in (1, 2, 4, 8, 16):
        z = (total[width:] - total[:-width]) / np.sqrt(mass[width:] - mass[:-width])
        tests += len(z)
        at = int(np.argmax(z))
        if z[at] > best[0]:
            bin_width = float(data.cycles[1] - data.cycles[0])
            best = (float(z[at]), float(data.cycles[at : at + width].mean()), width * bin_width)
    return float(min(1.0, tests * norm.sf(best[0]))), best[1], best[2]


def fit_hump(data: Bins, middle: float, width: float) -> ShapeFit:
    """Fit white noise, quantization and an AR(2) hump next to a frequency, cycles."""
    weight, quantized = 0.5 * data.count, rise(data.cycles)
    scale = data.start[0] + data.start[1]

    def expected(x: FloatArray) -> FloatArray:
        level = scale * (np.exp(x[3]) * data.white + max(x[4], 0.0) * quantized) + max(x[5], 0.0) * data.rest
        return np.asarray(level + hump_power(x[:3], data.cycles, scale))

    def cost(x: FloatArray) -> float:
        return deviance(weight, data.power, expected(x))

    base = [np.log(max(data.start[0] / scale, 1e-3)), data.start[1] / scale, 1.0]
    bounds = [
        (np.log(0.002), np.log(0.495)),
        (np.log(2.0), np.log(200.0)),
        (-16.0, 6.0),
        (-8.0, 5.0),
        (0.0, 20.0),
        (0.0, 3.0),
    ]
    best = None
    for share in (0.5, 1.5):
        quality = max(middle / (share * width), 1.0)
        start = np.array([np.log(middle), np.log(quality), np.log(0.2 * share * width), *base])
        found = minimize(cost, start, method="L-BFGS-B", bounds=bounds)
        if best is None or found.fun < best.fun:
            best = found
    assert best is not None
    return ShapeFit(
        "hump",
        best.x[:3],
        curvature(cost, best.x)[:3, :3],
        float(best.fun),
        expected(best.x),
        float(best.x[5]),
    )


def hump_power(x: FloatArray, cycles: FloatArray, scale: float) -> FloatArray:
    """Return the power of a hump: x = ln of frequency (cycles), quality, variance ÷ (scale × rate)."""
    frequency, quality, variance = np.exp(np.clip(x, -20.0, 10.0))
    ar = Vibration(min(float(frequency), 0.4999), float(quality), 1.0).recursion(1.0)
    rho = ar[0] / (1.0 - ar[1])
    return np.asarray(scale * variance * (1.0 - ar[1] ** 2) * (1.0 - rho**2) * _arma(ar, (), cycles))


def deviance(weight: FloatArray, power: FloatArray, level: FloatArray) -> float:
    """Return minus the log likelihood of mean powers about a level, 0 where they agree."""
    ratio = power / level
    return float(weight @ (ratio - 1.0 - np.log(ratio)))


def spread(data: Bins, fitted: ShapeFit) -> FloatArray:
    """Return the covariance of the parameters of a fitted shape, white noise and quantization free."""
    shape, weight = SHAPES[fitted.name][0], 0.5 * data.count
    scale = data.start[0] + data.start[1]
    quantized = rise(data.cycles)
    data = replace(data, rest=fitted.slow * data.rest)

    def cost(x: FloatArray) -> float:
        form = data.white * shape(x, data.cycles) * scale
        level = _levels(form, quantized * scale, data, weight)
        return deviance(weight, data.power, level)

    return curvature(cost, fitted.x)


def _levels(form: FloatArray, quantized: FloatArray, data: Bins, weight: FloatArray) -> FloatArray:
    """Return the expected power with the best white noise and quantization for a given form."""
    size = np.array([1.0, 0.0])
    for _ in range(30):
        level = np.maximum(size[0] * form + size[1] * quantized + data.rest, 1e-12 * form.max())
        shapes = np.stack((form, quantized))
        w = weight / level**2
        matrix = (shapes * w) @ shapes.T
        target = (shapes * w) @ (data.power - data.rest)
        new = np.linalg.solve(matrix + 1e-12 * np.trace(matrix) * np.eye(2), target)
        if new[1] < 0:
            new = np.array([target[0] / matrix[0, 0], 0.0])
        new[0] = max(new[0], 1e-3)
        if np.allclose(new, size, rtol=1e-10, atol=1e-13):
            break
        size = new
    return np.asarray(size[0] * form + size[1] * quantized + data.rest)


def misfit(data: Bins, fitted: ShapeFit) -> float:
    """Return the chance that the bins scatter about the fit as much as they do."""
    square = 0.5 * data.count * (data.power / fitted.expected - 1.0) ** 2
    return float(chi2.sf(square.sum(), len(square) - 3 - len(fitted.x)))


def _arma(ar: Sequence[float], ma: Sequence[float], cycles: FloatArray) -> FloatArray:
    z = np.exp(-2j * np.pi * cycles)
    above = np.polynomial.polynomial.polyval(z, [1.0, *ma])
    below = np.polynomial.polynomial.polyval(z, [1.0, *(-a for a in ar)])
    return np.asarray(np.abs(above / below) ** 2)


def _white(_: FloatArray, cycles: FloatArray) -> FloatArray:
    return np.ones_like(cycles)


def filter_arma(name: str, cutoff: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return AR and MA coefficients of a low-pass filter; `cutoff` is its half-power frequency × interval."""
    order = int(name[-1])
    if name.startswith("pole"):
        a = LowPass(cutoff, order).denominator(1.0)
        return tuple((-a[1:]).tolist()), ()
    b, a = butter(order, min(2.0 * cutoff, 0.999))
    return tuple((-a[1:]).tolist()), tuple((b[1:] / b[0]).tolist())


def _filter(name: str) -> Shape:
    def gain(x: FloatArray, cycles: FloatArray) -> FloatArray:
        ar, ma = filter_arma(name, float(np.exp(x[0])))
        shape = _arma(ar, ma, cycles)
        return shape / (((1.0 + sum(ma)) / (1.0 - sum(ar))) ** 2)

    return gain


def _ar1(x: FloatArray, cycles: FloatArray) -> FloatArray:
    return _arma((float(np.tanh(x[0])),), (), cycles)


def _ma1(x: FloatArray, cycles: FloatArray) -> FloatArray:
    return _arma((), (float(np.tanh(x[0])),), cycles)


def _arma11(x: FloatArray, cycles: FloatArray) -> FloatArray:
    return _arma((float(np.tanh(x[0])),), (float(np.tanh(x[1])),), cycles)


def _ar2(x: FloatArray, cycles: FloatArray) -> FloatArray:
    return _arma(ar2(x), (), cycles)


def _arma21(x: FloatArray, cycles: FloatArray) -> FloatArray:
    return _arma(ar2(x[:2]), (float(np.tanh(x[2])),), cycles)


def ar2(x: FloatArray) -> tuple[float, float]:
    """Return stationary AR(2) coefficients of two free numbers (partial correlations tanh x)."""
    first, second = np.tanh(x)
    return float(first * (1.0 - second)), float(second)


_FREE = (-4.0, 4.0)
_CUTOFF = (np.log(0.002), np.log(0.6))
SHAPES: dict[str, tuple[Shape, list[list[float]], list[tuple[float, float]]]] = {
    "white": (_white, [[]], []),
    "ar1": (_ar1, [[0.1], [-0.1]], [_FREE]),
    "ma1": (_ma1, [[0.1], [-0.1]], [_FREE]),
    "arma11": (_arma11, [[0.5, -0.4], [-0.5, 0.4], [0.2, 0.2]], [_FREE] * 2),
    "ar2": (_ar2, [[0.1, 0.1], [-0.1, 0.1], [0.3, -0.3]], [_FREE] * 2),
    "arma21": (_arma21, [[0.3, -0.1, -0.2], [-0.3, 0.1, 0.2]], [_FREE] * 3),
    "pole1": (_filter("pole1"), [[np.log(0.3)], [np.log(0.1)]], [_CUTOFF]),
    "pole2": (_filter("pole2"), [[np.log(0.3)], [np.log(0.1)]], [_CUTOFF]),
    "butter1": (_filter("butter1"), [[np.log(0.3)], [np.log(0.1)]], [(np.log(0.002), np.log(0.49))]),
    "butter2": (_filter("butter2"), [[np.log(0.3)], [np.log(0.1)]], [(np.log(0.002), np.log(0.49))]),
}
"""Shape, starting points and bounds of its parameters, by name."""
FILTERS = ("pole1", "pole2", "butter1", "butter2")
COLOURS = ("ar1", "ma1", "arma11", "ar2", "arma21")


@dataclass(frozen=True)
class ShapeTest:
    """The null and the best shape of every class.

    Attributes
    ----------
    data : Bins
        What was fitted.
    null : ShapeFit
        White noise and quantization.
    p_value : float
        Chance of a first-order colour as clear as the best one.
    misfit : float
        Chance of bins that scatter about the null as much.
    filters, colours : tuple of ShapeFit
        Best first; empty where nothing alarms.
    hump : ShapeFit or None
        White noise with a hump.
    hump_p_value : float
        Chance of as clear an excess of neighbouring bins.
    """

    data: Bins
    null: ShapeFit
    p_value: float
    misfit: float
    filters: tuple[ShapeFit, ...]
    colours: tuple[ShapeFit, ...]
    hump: ShapeFit | None
    hump_p_value: float

    def falling(self, fitted: ShapeFit) -> bool:
        """Return whether a fitted spectrum falls all the way to the highest frequency."""
        return bool(np.all(np.diff(fitted.expected) <= 0.0))

    def gain(self, fitted: ShapeFit) -> float:
        """Return the log likelihood gained over the null, less half the log of the coefficients a parameter."""
        return self.null.cost - fitted.cost - 0.5 * len(fitted.x) * float(np.log(self.data.count.sum()))


def shape_test(found: Residual) -> ShapeTest:
    """Fit the shapes to the fast spectrum of a residual; the many only where the few alarm."""
    data = bins(found)
    null = fit(data, "white")
    first = {name: fit(data, name) for name in ("ar1", "ma1")}
    ratio = 2.0 * max(0.0, null.cost - min(f.cost for f in first.values()))
    p_value = min(1.0, 2.0 * float(chi2.sf(ratio, 1)))
    scatter = misfit(data, null)
    hump_p_value, middle, width = hump_scan(data, null)
    if min(p_value, scatter, hump_p_value) > 1e-3:
        return ShapeTest(data, null, p_value, scatter, (), (), None, hump_p_value)
    filters = [fit(data, name) for name in FILTERS]
    colours = [first.get(name) or fit(data, name) for name in COLOURS]

    def price(fitted: ShapeFit) -> float:
        return fitted.cost + 0.5 * len(fitted.x) * float(np.log(data.count.sum()))

    hump = fit_hump(data, middle, width)
    ranked = _ranked(filters, price), _ranked(colours, price)
    return ShapeTest(data, null, p_value, scatter, *ranked, hump, hump_p_value)


def _ranked(fits: list[ShapeFit], price: Callable[[ShapeFit], float]) -> tuple[ShapeFit, ...]:
    """Return the fits, first the simplest (earliest) of those that cannot be told from the best."""
    least = min(price(fitted) for fitted in fits)
    first = next(fitted for fitted in fits if price(fitted) < least + CLOSE)
    return (first, *(fitted for fitted in fits if fitted is not first))
