"""Shape of the fast spectrum: white noise that passed a filter, or ARMA colour.

::

    E(f) = w g(f; shape) + q · 4 sin²(πfΔ) + s · slow(f)

in the bins of `tuner.diagnosis.static.spectrum.binned`, with the slow part as fitted up to its size s, w ≥ 0
the white noise and
q ≥ 0 quantization (the base has it: a rise that differenced white noise explains is no finding). The fit may have
taken colour for slow noise, never slow noise for white: 0 ≤ s ≤ 1. The shapes of
`tuner.diagnosis.static.spectrum.filters` and a resonance
compete by likelihood and number of parameters.

Several filters of other order or kind may explain a spectrum equally well, each with a cutoff of its own. The interval
of the cutoff therefore covers all filters that explain it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy.optimize import minimize_scalar

from models.arrays import FloatArray
from models.interval_ends import reach
from models.probability import chi2_beyond
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.null_distributions import COST_OUTSIDE, REGION_NATS, maximum, minimum
from tuner.diagnosis.static.outcome import WORTH_A_FIT
from tuner.diagnosis.static.spectrum.binned import Bins, Sizes, bins, costs, sized
from tuner.diagnosis.static.spectrum.falling_curve import CURVE, falling_curve
from tuner.diagnosis.static.spectrum.filters import (
    COLOURS,
    FILTERS,
    MAX_FREE_NUMBER,
    arma_power,
    colour_arma,
    filter_power,
    filter_powers,
    is_mean,
)
from tuner.diagnosis.static.spectrum.resonance import ResonanceFit, fit_resonance, scan_resonances

SIMPLER_NATS = 5.0
"""Nats within which the simpler shape is taken: it must be less likely by a factor of 150 to be rejected."""
LOW_CUTOFFS, HIGH_CUTOFFS = 10, 20
"""Cutoffs from which the best one is sought: in even ratios below `FOLDING_CUTOFF`, in even steps above.

Chosen so that neighbouring cutoffs lie on the same maximum of the likelihood.
"""
MEAN_CUTOFFS_TRIED = 144
"""The same of one moving mean, 1.5 % apart: the highest of its nulls then moves by two bins.

Of several in a row a quarter: next to their nulls there is too little power for several maxima.
"""
FOLDING_CUTOFF = 0.12
"""Cutoff × interval from which a filter with aliasing can have several likely cutoffs; below, it folds too little."""
QUANTIZATION_LIKE_FILTER = "sampled1x1"
"""Filter (a mean of two samples is one) that is white with quantization beside it: taken where it is clearly better."""
COLOUR_STARTS = 2
"""Searches for a colour, from its likeliest starting points: the likelihood may have a maximum for either sign."""
FIRST_ORDER = ("ar1", "ma1")
"""Colours whose likelihood ratio is the statistic."""
CURVE_P_VALUE = 1e-6
"""P-value below which the filters with a formula are contradicted, and one of any form is tried."""


@dataclass(frozen=True)
class ShapeFit:
    """A fitted shape of the fast spectrum.

    Attributes
    ----------
    name : str
        ``white``, or as in `tuner.diagnosis.static.spectrum.filters` or `falling_curve`.
    x : ndarray, shape (p,)
        Its parameters: the log of a cutoff × interval (of a curve besides as many zeros as its levels are worth), or
        the free numbers of a colour.
    cost : float
        Minus the log likelihood.
    expected : ndarray, shape (b,)
        Expected power.
    rises : bool
        Whether quantization stands beside it: one number more.
    least : float
        Cost with quantization free.
    """

    name: str
    x: FloatArray
    cost: float
    expected: FloatArray
    rises: bool
    least: float

    @property
    def falls(self) -> bool:
        """Whether the spectrum falls all the way to the highest frequency, but for ripple in a stop band."""
        return self.name == CURVE or bool(np.all(np.diff(self.expected) <= 0.0))

    @property
    def even(self) -> bool:
        """Whether the spectrum is monotonic."""
        return self.falls or bool(np.all(np.diff(self.expected) >= 0.0))


def _sized(data: Bins, shape: FloatArray | float, rises: bool = True) -> Sizes:
    """Return the best white noise of a shape, slow noise and, where it rises, quantization."""
    return sized(data, np.vstack((data.white * shape, data.beside(rises))))


def fit_white(data: Bins) -> ShapeFit:
    """Fit white noise, quantization and slow noise."""
    found = _sized(data, 1.0)
    return ShapeFit("white", np.empty(0), found.cost, found.expected, bool(found.size[-1] > 0.0), found.cost)


def fit_filter(data: Bins, name: str, rises: bool = True) -> ShapeFit:
    """Fit a filter by name, quantization free beside it or none.

    From its two likeliest cutoffs: with aliasing the likelihood can have two maxima.
    """
    cost = _filter_cost(data, name, rises)
    low, high = FILTERS[name]
    grid = np.log(_cutoffs_tried(name, low, high))
    powers = _powers_tried(name, data.cycles.tobytes(), data.width)
    value = costs(data, data.white * powers, data.beside(rises))
    edged = np.concatenate(([np.inf], value, [np.inf]))
    lowest = np.flatnonzero((value <= edged[:-2]) & (value <= edged[2:]))
    tried = []
    for at in lowest[np.argsort(value[lowest])][:2]:
        bounds = (grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)])
        tried.append(minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 1e-4}))
    x = float(min(tried, key=lambda result: result.fun).x)
    power = filter_power(name, float(np.exp(x)), data.cycles, data.width)
    fits = [(beside, _sized(data, power, beside)) for beside in ((False, True) if rises else (False,))]
    least = min(found.cost for _, found in fits)
    return _simpler(
        data, [ShapeFit(name, np.array([x]), f.cost, f.expected, beside, least) for beside, f in fits]
    )


def _cutoffs_tried(name: str, low: float, high: float) -> FloatArray:
    """Return the cutoffs × interval from which the best one is sought."""
    if is_mean(name):
        return np.geomspace(low, high, MEAN_CUTOFFS_TRIED if name == "mean1" else MEAN_CUTOFFS_TRIED // 4)
    above = np.linspace(FOLDING_CUTOFF, high, HIGH_CUTOFFS)
    return np.concatenate((np.geomspace(low, FOLDING_CUTOFF, LOW_CUTOFFS, endpoint=False), above))


@lru_cache(maxsize=len(FILTERS))
def _powers_tried(name: str, cycles: bytes, width: float) -> FloatArray:
    """Return the power of a filter with each of these cutoffs, shape (g, b), in bins whose cycles are those bytes."""
    power = filter_powers(name, np.frombuffer(cycles), width)
    return np.stack([power(cutoff) for cutoff in _cutoffs_tried(name, *FILTERS[name]).tolist()])


def _filter_cost(data: Bins, name: str, rises: bool = True) -> Callable[[float], float]:
    power = filter_powers(name, data.cycles, data.width)
    return lambda x: _sized(data, power(float(np.exp(x))), rises).cost


def fit_colour(data: Bins, name: str, rises: bool = True) -> ShapeFit:
    """Fit a colour by name, quantization free beside it or none."""
    cost = _colour_cost(data, name, rises)
    starts = sorted(COLOURS[name][2], key=lambda start: cost(np.array(start)))[:COLOUR_STARTS]
    x, _ = minimum(cost, starts, scale=0.1, tolerance=0.01)
    found = _sized(data, arma_power(*colour_arma(name, x), data.cycles), rises)
    return ShapeFit(name, x, found.cost, found.expected, rises, found.cost)


def _colour_cost(data: Bins, name: str, rises: bool) -> Callable[[FloatArray], float]:
    def cost(x: FloatArray) -> float:
        if np.any(np.abs(x) > MAX_FREE_NUMBER):
            return COST_OUTSIDE
        return _sized(data, arma_power(*colour_arma(name, x), data.cycles), rises).cost

    return cost


def refit_colour(data: Bins, fitted: ShapeFit) -> tuple[FloatArray, FloatArray]:
    """Return the free numbers of a colour and their covariance, white noise free and quantization if it has that."""
    cost = _colour_cost(data, fitted.name, fitted.rises)
    x, covariance, _ = maximum(cost, [fitted.x.tolist()], scale=0.02, tolerance=1e-3)
    return x, covariance


def cutoffs(data: Bins, filters: tuple[ShapeFit, ...]) -> tuple[float, float]:
    """Return the 95 % interval of the log of cutoff × interval over all filters that explain the spectrum."""
    alike = [fitted for fitted in filters if fitted is filters[0] or fitted.name != QUANTIZATION_LIKE_FILTER]
    least = min(fitted.cost for fitted in alike)
    ends = [
        _reach(data, fitted, least + REGION_NATS) for fitted in alike if fitted.cost < least + REGION_NATS
    ]
    return min(end[0] for end in ends), max(end[1] for end in ends)


def _reach(data: Bins, fitted: ShapeFit, goal: float) -> tuple[float, float]:
    """Return where the cost of a filter passes a goal on either side of its best."""
    cost, centre = _filter_cost(data, fitted.name), float(fitted.x[0])

    def end(edge: float) -> float:
        side, most = np.sign(edge - centre), abs(edge - centre)
        return float(centre + side * reach(lambda x: cost(centre + side * x) >= goal, 1e-3, most, 8)[1])

    low, high = np.log(FILTERS[fitted.name]).tolist()
    return end(low), end(high)


def misfit(data: Bins, fitted: ShapeFit) -> float:
    """Return the p-value of the scatter of the bins about the fit."""
    square = 0.5 * data.count * (data.power / fitted.expected - 1.0) ** 2
    return chi2_beyond(square.sum(), len(square) - 3 - len(fitted.x))


@dataclass(frozen=True)
class ShapeTest:
    """Tests of the fast spectrum: white noise as null, and the best filter, colour and resonance.

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
        Best first; empty where no test rejects.
    resonance : ResonanceFit or None
        White noise with a resonance.
    resonance_p_value : float
        Chance of as clear an excess of neighbouring bins.
    """

    data: Bins
    null: ShapeFit
    p_value: float
    misfit: float
    filters: tuple[ShapeFit, ...]
    colours: tuple[ShapeFit, ...]
    resonance: ResonanceFit | None
    resonance_p_value: float

    @property
    def any_p_value(self) -> float:
        """P-value of the least likely of the three statistics."""
        return min(1.0, 3.0 * min(self.p_value, self.misfit, self.resonance_p_value))

    @property
    def misfit_nats(self) -> float:
        """Log likelihood that a power of its own for every bin gains, less its expectation."""
        ratio = self.data.power / self.null.expected
        gained = float(np.sum(self.data.count * (ratio - 1.0 - np.log(ratio))))
        return max(gained - 0.5 * (len(ratio) - 3 - len(self.null.x)), 0.0)

    @property
    def worst(self) -> str:
        """Frequency and size of the largest misfit of the null, in words."""
        deviation = self.data.power / self.null.expected
        at = int(np.argmax(self.data.count * (deviation - 1.0 - np.log(deviation))))
        frequency = self.data.cycles[at] / self.data.interval
        return f"{10.0 * np.log10(deviation[at]):+.2g} dB at {frequency:.3g} Hz"

    def gain(self, fitted: ShapeFit | ResonanceFit) -> float:
        """Return the log likelihood gained over the null, less half the log of the coefficients a further parameter.

        Quantization, which the null may have, is one: a shape that does without it is the simpler.
        """
        return self.null.cost - _price(self.data, fitted, self.null.rises)

    @property
    def filter_gain(self) -> float:
        """Greatest gain of a filter, whatever its aliasing."""
        return max((self.gain(fitted) for fitted in self.filters), default=-np.inf)

    def falls(self, fitted: ShapeFit) -> bool:
        """Return whether the spectrum falls all the way, but for the resonances that are known."""
        return bool(np.all(np.diff(fitted.expected - self.data.peaks) <= 0.0))

    def background(self, f: FloatArray) -> FloatArray:
        """Return the power of the best monotonic spectrum ÷ that of the residual at frequencies, Hz."""
        if self.smooth is None:
            return np.ones_like(f)
        ratio = self.smooth.expected / self.data.model
        return np.asarray(np.interp(f * self.data.interval, self.data.cycles, ratio))

    @cached_property
    def smooth(self) -> ShapeFit | None:
        """The best monotonic spectrum; None where there is none."""
        even = [fitted for fitted in (*self.filters, *self.colours) if fitted.even]
        return min(even, key=lambda fitted: fitted.cost, default=None)


def few_shapes(fitted: FittedChannel) -> ShapeTest:
    """Fit the colours of first order and, where they or the bins reject white noise, the filters.

    That is what the background of a search for narrow resonances needs.
    """
    data = bins(fitted)
    null = fit_white(data)
    if fitted.count("lowpass", "colour"):
        return ShapeTest(data, null, 1.0, misfit(data, null), (), (), None, 1.0)
    first = tuple(fit_colour(data, name) for name in FIRST_ORDER)
    ratio = 2.0 * max(0.0, null.cost - min(f.cost for f in first))
    p_value = min(1.0, 2.0 * chi2_beyond(ratio, 1))
    scatter = misfit(data, null)
    resonance_p_value = scan_resonances(data, null.expected)[0]
    if min(p_value, scatter, resonance_p_value) > WORTH_A_FIT:
        return ShapeTest(data, null, p_value, scatter, (), (), None, resonance_p_value)
    return ShapeTest(data, null, p_value, scatter, fit_filters(data), first, None, resonance_p_value)


def many_shapes(few: ShapeTest) -> ShapeTest:
    """Fit all colours and a resonance besides, where `few_shapes` rejects."""
    if not few.filters:
        return few
    data, first = few.data, {fitted.name: fitted for fitted in few.colours}
    colours = [
        _simpler(data, [fit_colour(data, name, False), first.get(name) or fit_colour(data, name)])
        for name in COLOURS
    ]
    _, middle, width = scan_resonances(data, few.null.expected)
    return replace(few, colours=_ranked(data, colours), resonance=fit_resonance(data, middle, width))


def fit_filters(data: Bins) -> tuple[ShapeFit, ...]:
    """Return the fits of all filters, the best first.

    Where quantization stands beside a filter, its best cutoff without it is another one. That is sought where it could
    be worth more than all others: quantization is then not worth its price.
    """
    fits = [fit_filter(data, name) for name in FILTERS]
    best = min(_price(data, fitted, False) for fitted in fits)
    fits = [
        replace(_simpler(data, [fitted, fit_filter(data, fitted.name, False)]), least=fitted.least)
        if fitted.rises and fitted.least + 0.5 * data.log_count < best
        else fitted
        for fitted in fits
    ]
    fits.sort(
        key=lambda fitted: fitted.least + (SIMPLER_NATS if fitted.name == QUANTIZATION_LIKE_FILTER else 0.0)
    )
    likeliest = min(fits, key=lambda fitted: _price(data, fitted, False))
    curve = _fit_curve(data) if misfit(data, likeliest) < CURVE_P_VALUE else None
    if curve is not None and _price(data, curve, False) < _price(data, likeliest, False):
        return (curve, *fits)
    return tuple(fits)


def _fit_curve(data: Bins) -> ShapeFit | None:
    """Fit a filter of any form, a nat for each level; None where the spectrum does not fall as behind one."""
    found = falling_curve(data)
    if found is None:
        return None
    x = np.zeros(1 + round(2.0 * found.numbers / data.log_count))
    x[0] = np.log(found.cutoff)
    return ShapeFit(CURVE, x, found.cost, found.expected, False, found.cost)


def _price(data: Bins, fitted: ShapeFit | ResonanceFit, rises: bool) -> float:
    """Return the cost and the price of the parameters beyond those of white noise, which `rises` or not."""
    further = len(fitted.x) + (fitted.rises - rises if isinstance(fitted, ShapeFit) else 0)
    return fitted.cost + 0.5 * further * data.log_count


def _simpler(data: Bins, fits: list[ShapeFit]) -> ShapeFit:
    """Return the fit, without quantization or with it, that is worth its price."""
    return min(fits, key=lambda fitted: _price(data, fitted, False))


def _ranked(data: Bins, fits: list[ShapeFit]) -> tuple[ShapeFit, ...]:
    """Return the fits, first the simplest (earliest) of those within `SIMPLER_NATS` of the best."""
    least = min(_price(data, fitted, False) for fitted in fits)
    first = next(fitted for fitted in fits if _price(data, fitted, False) < least + SIMPLER_NATS)
    return (first, *(fitted for fitted in fits if fitted is not first))
