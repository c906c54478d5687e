"""Vibration: a narrow-band resonance, an AR(2) process added to the noise.

Statistic: means of w = 8, 16 … 16384 neighbouring ordinates of the periodogram of the residuals over the mean of
those beside them, 16 w on either side and half a window away, so that a resonance does not raise its own level. With
m of these the ratio has Fisher's law F(2w, 2m). Every width has the same share of the false alarms, and so has every
window of a width. Where that is promising, the likelihood ratio of the fitted resonance may be the clearer of the two:
χ²₂ for each window as wide as the resonance.
Extension: frequency, quality and standard deviation by the likelihood of the ordinates about the peak, over a
level that may slope.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from scipy.special import betainc, betaln

from models.arrays import SAMPLES_AT_ONCE, BoolArray, FloatArray, SignedArray
from models.effects.static.spectral import Vibration as Effect
from models.noise import Term
from models.noise.arma import Arma
from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.null_distributions import COST_OUTSIDE, curvature, maximum, minimum
from tuner.diagnosis.static.outcome import NO_GAIN, TestResult
from tuner.diagnosis.static.spectrum.background import FIRST_ORDINATE, local_level
from tuner.diagnosis.static.spectrum.fisher_scoring import sizes
from tuner.diagnosis.static.spectrum.shape import ShapeTest

WINDOWS = tuple(8 * 2**k for k in range(12))
"""Widths of the windows, ordinates, in octaves: a resonance of any width fills half of one of them."""
LEVEL_WIDTHS = 16
"""Widths of a window from which its level is taken, on either side.

The level is then √32 times better known than it.
"""
REFIT_P_VALUE = 0.03
"""P-value of a window below which a resonance is fitted; chosen above any threshold.

The likelihood ratio may be clearer.
"""
NEIGHBOUR_COUNT = 200
"""Ordinates about one whose median separates a line from a resonance: it is known to 1/(ln 2 √200) = 10 %."""
MAX_CYCLES, MAX_QUALITY = 0.499, 1e5
"""Largest frequency × interval, and quality, of a resonance: beyond, its poles are those of a line."""
MIN_QUALITY = 3.0
"""Quality below which a resonance is a matter of the broad shape of the spectrum: half power is a third of f wide."""
MIN_PARAMETER_CHANGE = 0.1
"""Sds by which a parameter must move for the model to be fitted again; a tenth costs 0.005 nats."""
MAX_ORDINATE = 25.0
"""Largest ordinate that counts, in units of its neighbours: exponential ones exceed 25 by 1e-11, lines do."""


@dataclass(frozen=True)
class Vibration(Extension):
    """An AR(2) resonance, standard deviation in scales."""

    cause = "vibration"
    effect = Effect
    group = "fast spectrum"
    shares = 3
    view = "peak"
    repeats = 4
    meaning = "a narrow-band resonance: a peak of the spectrum, wider than a line"
    consequence = (
        "distrust this band: damp or notch it; "
        "where it cannot be removed it calls for a two-state shaping filter"
    )
    frequency: float
    quality: float
    sd: float

    def arma(self, interval: float) -> Arma:
        """Return the process as an ARMA term in scales."""
        first, second = self.recursion(interval)
        rho = first / (1.0 - second)
        return Arma((first, second), (), self.sd**2 * (1.0 - second**2) * (1.0 - rho**2), interval)

    def pole(self, interval: float) -> tuple[float, float]:
        """Return the radius and the angle of the poles."""
        angle = 2.0 * np.pi * self.frequency * interval
        return float(np.exp(-0.5 * angle / self.quality)), angle

    def recursion(self, interval: float) -> tuple[float, float]:
        """Return φ₁, φ₂ (`models.effects.static.spectral.Vibration`)."""
        r, angle = self.pole(interval)
        return 2.0 * r * float(np.cos(angle)), -r * r

    def power(self, f: FloatArray, interval: float) -> FloatArray:
        """Return its spectrum, c/(|1 − r exp i(θ − x)|² |1 − r exp i(θ + x)|²) with poles r exp ±iθ, x = 2πfΔ."""
        out = np.empty(len(f))
        for first in range(0, len(f), SAMPLES_AT_ONCE):
            part = slice(first, first + SAMPLES_AT_ONCE)
            out[part] = resonance(half_angles(f[part], interval), interval, *self.pole(interval), self.sd)
        return out

    def overlaps(self, fitted: FittedChannel) -> bool:
        """Return whether a resonance that was accepted already lies under this one, or its size is not known."""
        unknown = self.values["sd"].upper > 3.0 * self.sd
        return unknown or bool(taken(fitted, np.array([self.frequency]))[0])

    def refit(self, fitted: FittedChannel, index: int) -> Vibration:  # noqa: ARG002
        """Fit the resonance again, over the noise as fitted with it, whose level may slope beside it."""
        dt, n = fitted.channel.interval, len(fitted.coefficients)
        df = 0.5 / (n * dt)
        reach = max(6.0 * self.frequency / self.quality, 200.0 * df)
        first, last = (int((self.frequency + sign * reach) / df) for sign in (-1, 1))
        first, last = max(FIRST_ORDINATE, first), min(n - 1, last)
        size = max(1, (last - first) // 400)
        number = (last - first) // size
        around = slice(max(first - NEIGHBOUR_COUNT, 0), min(last + NEIGHBOUR_COUNT, n - 1))
        beside = fitted.expected_power.between(around.start, around.stop)
        square = _lines_cut(fitted.coefficients[1:][around] ** 2 / beside, MAX_ORDINATE) * beside
        mean = square[first - around.start :][: number * size].reshape(number, size).mean(axis=1)
        f = np.asarray((first + 1 + (np.arange(number) + 0.5) * size - 0.5) * df, dtype=float)
        expected = fitted.expected_power.means(first, size, number)
        other = np.maximum(expected - self.power(f, dt), 1e-3 * expected)
        place = (f - f.mean()) / (f[-1] - f[0])
        level = np.stack((other * (0.5 - place), other * (0.5 + place)))
        count, halves = float(size), half_angles(f, dt)

        def peak(x: FloatArray) -> FloatArray:
            frequency, quality = np.exp(np.clip(x, -20.0, 20.0)).tolist()
            pole = Vibration(min(frequency, MAX_CYCLES / dt), min(max(quality, 0.5), MAX_QUALITY), 1.0).pole(
                dt
            )
            return np.asarray(resonance(halves, dt, *pole, 1.0))

        def cost(x: FloatArray) -> float:
            return sizes(mean, count, np.vstack((level, peak(x))), np.zeros(number))[2]

        def whole(x: FloatArray) -> float:
            return sizes(mean, count, level, np.exp(2.0 * x[2]) * peak(x[:2]))[2]

        start = np.log([self.frequency, self.quality, self.sd])
        x, _ = minimum(cost, [start[:2].tolist()], scale=0.02, tolerance=1e-3)
        variance = sizes(mean, count, np.vstack((level, peak(x))), np.zeros(number))[0][-1]
        x = np.append(x, 0.5 * np.log(max(variance, 1e-12)))
        covariance = curvature(whole, x)
        sd = np.sqrt(np.diag(covariance))
        moved = np.abs(x - start)
        settled = bool(np.all(moved < MIN_PARAMETER_CHANGE * sd))
        return self if settled or moved[0] > 1.0 / self.quality else _fitted(x, sd)

    def terms(self, interval: float) -> tuple[Term, ...]:
        """Return the process as a noise term."""
        return (self.arma(interval),)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def half_angles(f: FloatArray, interval: float) -> FloatArray:
    """Return sine and cosine of πfΔ, shape (2, b)."""
    out = np.empty((2, f.size))
    for at in range(f.size):
        s = np.sin(np.pi * interval * f[at])
        out[0, at], out[1, at] = s, np.sqrt(max(1.0 - s * s, 0.0))
    return out


@numba.njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[misc, unused-ignore]
def resonance(halves: FloatArray, interval: float, r: float, angle: float, sd: float) -> FloatArray:
    """Return the spectrum of a resonance of poles r exp ±i angle and standard deviation `sd`, shape (b,).

    `halves` are the `half_angles` of its frequencies.
    """
    out = np.empty(halves.shape[1])
    rho = 2.0 * r * np.cos(angle) / (1.0 + r * r)
    size = interval * sd * sd * (1.0 - r**4) * (1.0 - rho * rho)
    least, sine, cosine = (1.0 - r) ** 2, np.sin(0.5 * angle), np.cos(0.5 * angle)
    for at in range(out.size):
        s, c = halves[0, at], halves[1, at]
        near, far = sine * c - cosine * s, sine * c + cosine * s
        out[at] = size / ((least + 4.0 * r * near * near) * (least + 4.0 * r * far * far))
    return out


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _level_cost(mean: FloatArray, level: float, slope: float, place: FloatArray, peak: FloatArray) -> float:
    """Return Σ ln E + P/E of ordinates P, shape (b,), with E = exp(level) (1 + slope · place) (1 + peak)."""
    total, scale = 0.0, np.exp(level)
    for at in range(mean.size):
        expected = scale * (1.0 + slope * place[at]) * (1.0 + peak[at])
        total += np.log(expected) + mean[at] / expected
    return total


def test(fitted: FittedChannel, tested: ShapeTest) -> TestResult:
    """Search the spectrum of the residuals for a resonance over the best monotonic spectrum."""
    df = 1.0 / (len(fitted.e) * fitted.channel.interval)
    number = len(fitted.periodogram)
    f = df * np.arange(1.0, number + 1.0)
    total = np.empty(number + 1)
    total[0] = 0.0
    np.cumsum(_lines_cut(fitted.periodogram / tested.background(f), MAX_ORDINATE), out=total[1:])
    widths = [width for width in WINDOWS if width <= number // 24]
    best = (np.inf, 8, FIRST_ORDINATE, 1.0)
    for width in widths:
        start = np.arange(FIRST_ORDINATE, number - width, width // 2)
        ratio, beside = _over_neighbours(total, start, width)
        ratio[taken(fitted, (start + 1 + 0.5 * width) * df)] = 1.0
        largest = _largest(ratio, 8)
        nats = -np.array([_log_tail(ratio[i], width, beside[i]) for i in largest])
        at = largest[int(np.argmax(nats))]
        log_chance = np.log(len(widths) * len(start)) - float(nats.max())
        if log_chance < best[0]:
            best = (log_chance, width, int(start[at]), float(ratio[at]))
    log_chance, width, at, mean = best
    p_value = float(np.exp(min(log_chance, 0.0)))
    centre, half = (at + 1 + 0.5 * width) * df, 0.5 * width * df
    name = f"mean of {width} ordinates of the spectrum ÷ their neighbourhood"
    if p_value > REFIT_P_VALUE:
        return TestResult("vibration", min(1.0, 2.0 * p_value), NO_GAIN, mean, name)
    gain, found = extension(fitted, tested.background(f), centre, half)
    covered = float(np.clip(found.frequency / found.quality / df, WINDOWS[0], widths[-1]))
    price = float(np.log(len(widths) * 2.0 * number / covered))
    p_value = min(1.0, 2.0 * min(p_value, float(np.exp(price - max(gain, 0.0)))))
    if found.quality < MIN_QUALITY or found.overlaps(fitted):
        gain = -np.inf
    return TestResult("vibration", p_value, gain - price, mean, name, lambda: (found,))


def taken(fitted: FittedChannel, frequency: FloatArray) -> BoolArray:
    """Return which frequencies lie within the width of an accepted resonance: its form is no further one."""
    inside = np.zeros(len(frequency), dtype=bool)
    for x in fitted.extensions:
        if isinstance(x, Vibration):
            inside |= np.abs(frequency - x.frequency) < x.frequency / x.quality
    return inside


def _over_neighbours(total: FloatArray, start: SignedArray, width: int) -> tuple[FloatArray, FloatArray]:
    """Return the means of windows over those of the ordinates beside them, and how many these are, shape of `start`.

    `total` holds the running sums of the ordinates.
    """
    last = len(total) - 1
    gap = width // 2

    def sums(first: SignedArray, stop: SignedArray) -> tuple[FloatArray, FloatArray]:
        stop = np.maximum(first, stop)
        return total[stop] - total[first], (stop - first).astype(float)

    below, number_below = sums(np.maximum(start - gap - LEVEL_WIDTHS * width, FIRST_ORDINATE), start - gap)
    above, number_above = sums(
        np.minimum(start + width + gap, last), np.minimum(start + width + gap + LEVEL_WIDTHS * width, last)
    )
    number = number_below + number_above
    inside = (total[start + width] - total[start]) / width
    return inside * number / (below + above), number


def _largest(values: FloatArray, number: int) -> SignedArray:
    """Return the places of the largest values, these last."""
    some = np.argpartition(values, -min(number, len(values)))[-number:]
    return some[np.argsort(values[some])]


def wide(tested: ShapeTest, fitted: FittedChannel) -> TestResult:
    """Test for a resonance too wide to be compared with its neighbourhood: it competes with filters and colours."""
    name = "excess of the fast spectrum over white noise"
    if tested.resonance is None:
        return TestResult("vibration", tested.any_p_value, NO_GAIN, 0.0, name)
    peak = tested.resonance
    scale = np.array([1.0, 1.0, 0.5])
    spread = scale * np.sqrt(np.diag(peak.covariance))
    found = _fitted(scale * peak.x - [np.log(tested.data.interval), 0.0, 0.0], spread)
    ratio = 2.0 * (tested.null.cost - peak.cost)
    gain = -np.inf if found.quality < MIN_QUALITY or found.overlaps(fitted) else tested.gain(peak)
    return TestResult("vibration", tested.any_p_value, gain, ratio, name, lambda: (found,))


def _lines_cut(power: FloatArray, cap: float) -> FloatArray:
    """Return ordinates, none above `cap` times the level of its near neighbours: lines are not resonances."""
    return power if np.isinf(cap) else np.minimum(power, cap * local_level(power, NEIGHBOUR_COUNT))


def _log_tail(ratio: float, width: float, reference: float) -> float:
    """Return the log of the chance that F(2w, 2m) exceeds a ratio."""
    x = reference / (reference + width * ratio)
    tail = float(betainc(reference, width, x))
    if tail > 1e-280:
        return float(np.log(tail))
    log_density = reference * np.log(x) + (width - 1.0) * np.log1p(-x) - betaln(reference, width)
    return float(log_density - np.log(reference))


def rival(fitted: FittedChannel, frequency: float, height: float) -> TestResult | None:
    """Return the test result of a resonance that explains a peak of the spectrum better than a line of that height.

    A line is one high ordinate, a resonance several: of exponential law, they gain the more the more there are.
    """
    n, dt = len(fitted.e), fitted.channel.interval
    gain, found = extension(fitted, np.ones_like(fitted.periodogram), frequency, 8.0 / (n * dt), cap=np.inf)
    if gain < height + float(np.log(n)) or not MIN_QUALITY < found.quality < frequency * n * dt:
        return None
    name = "likelihood of a resonance in place of a line"
    p_value = float(np.exp(-gain)) * n
    if fitted.count("vibration") >= Vibration.repeats:
        return TestResult("vibration", p_value, 0.0, gain, f"{name}, at {found.frequency:.4g} Hz")
    return TestResult("vibration", p_value, gain, gain, name, lambda: (found,))


def lead_over_line(fitted: FittedChannel, frequency: float, height: float) -> float:
    """Return the log likelihood of a resonance less that of a line of this height at a frequency; −∞ where it is one.

    A resonance narrower than an ordinate is a line.
    """
    span = len(fitted.e) * fitted.channel.interval
    background = np.broadcast_to(1.0, fitted.periodogram.shape)
    gain, found = extension(fitted, background, frequency, 8.0 / span, cap=np.inf)
    return gain - height if found.quality < frequency * span else -np.inf


def extension(
    fitted: FittedChannel, background: FloatArray, middle: float, half: float, *, cap: float = MAX_ORDINATE
) -> tuple[float, Vibration]:
    """Return the resonance next to a window of frequency middle ± half, Hz, and the log likelihood it gains.

    `background` is the power beside it ÷ that of the residual at the Fourier frequencies.
    """
    dt, n = fitted.channel.interval, len(fitted.periodogram)
    df = 1.0 / (len(fitted.e) * dt)
    reach = max(12.0 * half, 100.0 * df)
    first, last = max(FIRST_ORDINATE, int((middle - reach) / df)), min(n, int((middle + reach) / df))
    size = max(1, (last - first) // 500)
    number = (last - first) // size
    around = slice(
        max(first // NEIGHBOUR_COUNT - 1, 0) * NEIGHBOUR_COUNT,
        (last // NEIGHBOUR_COUNT + 2) * NEIGHBOUR_COUNT,
    )
    power = _lines_cut(fitted.periodogram[around] / background[around], cap)
    mean = power[first - around.start :][: number * size].reshape(number, size).mean(axis=1)
    f = np.asarray((first + 0.5 + (np.arange(number) + 0.5) * size) * df, dtype=float)
    beside = background[around]
    there = np.interp(f, df * np.arange(around.start + 1.0, around.start + 1.0 + len(beside)), beside)
    white = fitted.spread**2 * fitted.power_at(f) * there
    place, none, halves = (f - middle) / reach, np.zeros(number), half_angles(f, dt)

    def cost(x: FloatArray) -> float:
        frequency, quality, sd = np.exp(x[:3])
        if not (
            abs(frequency - middle) < reach
            and 0.5 < quality < MAX_QUALITY
            and frequency < MAX_CYCLES / dt
            and abs(x[4]) < 0.9
        ):
            return COST_OUTSIDE
        peak = resonance(halves, dt, *Vibration(frequency, quality, sd).pole(dt), sd) / white
        return size * float(_level_cost(mean, x[3], x[4], place, peak))

    def flat(x: FloatArray) -> float:
        return size * float(_level_cost(mean, x[0], x[1], place, none)) if abs(x[1]) < 0.9 else COST_OUTSIDE

    excess = max(float(np.mean(np.maximum(mean - np.median(mean), 0.0))), 1e-3)
    sd = np.sqrt(2.0 * (last - first) * df * excess * float(np.mean(white)))
    level = float(np.log(np.median(mean)))
    starts = [[np.log(middle), np.log(middle / w), np.log(sd), level, 0.0] for w in (0.5 * half, 2.0 * half)]
    x, covariance, value = maximum(cost, starts, scale=0.05, tolerance=1e-3)
    null = minimum(flat, [[level, 0.0]], scale=0.05, tolerance=1e-3)[1]
    # The peak is one over the level beside it, which is far below what the noise takes a strong peak for.
    turned = np.eye(3, 5)
    turned[2, 3] = 0.5
    found = turned @ x
    found[2] += 0.5 * np.log1p(x[4] * (np.exp(x[0]) - middle) / reach)
    return null - value, _fitted(found, np.sqrt(np.diag(turned @ covariance @ turned.T)))


def _fitted(x: FloatArray, spread: FloatArray) -> Vibration:
    """Return the resonance of fitted logs of frequency, quality and sd, with their standard deviations."""
    frequency, quality, sd = np.exp(x).tolist()
    return Vibration(
        frequency,
        quality,
        sd,
        values={
            "frequency": Value.log(frequency, float(spread[0]), "Hz"),
            "quality": Value.log(quality, float(spread[1])),
            "sd": Value.log(sd, float(spread[2]), "{u}"),
        },
    )
