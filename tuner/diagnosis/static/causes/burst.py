"""Burst: a stretch of larger (or smaller) noise variance.

Statistic: mean squares of the residuals in windows of 64, 128, … samples, three quarters overlapping, made normal by
the cube root of Wilson and Hilferty with the degrees of freedom that the measured kurtosis allows. Every width has the
same share of the false alarms, and so has every window of a width; half of them are counted because neighbours
overlap. Where a window rejects, its edges are fitted and the others are searched again without it, until no window is
beyond `SECOND_P_VALUE`: all such stretches, with more or less variance than the rest, are proposed together. Where
they are more than `MAX_STRETCHES` or cover more than `MAX_RECORD_SHARE` of the record, the variance is not that of
bursts, and only `REPORTED_STRETCHES` are reported. Gain:
likelihood of a variance for each and one for the rest, over that of one for all, with the degrees of freedom that the
kurtosis about these variances allows.
Extension: the residuals inside are divided by the square root of the ratio. What is reported is the ratio of the white
noise itself (`tuner.diagnosis.static.variance.white_share`), and edges by the likelihood of a point of change.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from models.arrays import BoolArray, FloatArray, SignedArray
from models.effects.static.distribution import Burst as Effect
from models.probability import REACH_95, normal_beyond
from tuner.diagnosis.static.causes.base import Extension, Value, stretch_times
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.null_distributions import EDGE_NATS
from tuner.diagnosis.static.model.series_statistics import RESIDUAL_CLIP, robust_sd
from tuner.diagnosis.static.outcome import TestResult
from tuner.diagnosis.static.variance.local_variance import LocalVariance, local_variance
from tuner.diagnosis.static.variance.white_share import dilution

MIN_WINDOW = 64
"""Samples in the narrowest window: with 64 degrees of freedom the cube root of χ² is close to normal."""
SECOND_P_VALUE = 1e-9
"""P-value of a window below which it is proposed together with a clearer one.

Chosen far below the threshold: the noise has not been fitted again without the first one.
"""
MAX_RECORD_SHARE = 0.25
"""Share of the record beyond which another variance is no burst but a variance that changes.

Chosen as a clear minority.
"""
MAX_STRETCHES, REPORTED_STRETCHES = 24, 3
"""Most bursts in one record, and those reported where there are more, or where they cover more than that share.

Chosen so that a list stays readable; a variance that changes more often is a modulation, not events.
"""
WIDER_CLIP_RATIO = 3.0
"""Residuals are cut at so many `RESIDUAL_CLIP`, in their own sds, where sizes are estimated.

Wider than for tests, so that the cut does not bias the variance of a burst.
"""


@dataclass(frozen=True)
class Burst(Extension):
    """Samples first … last − 1 have `ratio` times the variance of the others."""

    cause = "burst"
    effect = Effect
    group = "distribution"
    happens_once = True
    view = "variance"
    repeats = MAX_STRETCHES
    meaning = "the noise is larger (or smaller) for a while: something ran nearby, or a regime changed"
    consequence = (
        "leave the stretch out of the identification; a filter needs the larger noise while it lasts"
    )
    first: int
    last: int
    ratio: float

    @property
    def consequence_as_found(self) -> str:
        """What it means for a filter, by whether the noise is larger or smaller while it lasts."""
        if self.values["variance_ratio"].value >= 1.0:
            return self.consequence
        return "leave the stretch out of the identification; the noise of the rest, which is larger, serves a filter"

    def white_noise_enlargement(
        self,
        before: FittedChannel,  # noqa: ARG002
        after: FittedChannel,
    ) -> tuple[float, str] | None:
        """Return the standard deviation while it lasts ÷ its rms over the record, where the ratio is above 1."""
        ratio = self.values["variance_ratio"].value
        share = (self.last - self.first) / len(after.channel)
        enlarged = float(np.sqrt(ratio / (1.0 + share * (ratio - 1.0))))
        return (enlarged, "burst: the noise while it lasts") if ratio > 1.0 else None

    def enlarged_share(self, channel: Channel) -> float:
        """Return its length ÷ that of the record."""
        return (self.last - self.first) / len(channel)

    def whiten(self, e: FloatArray) -> FloatArray:
        """Bring the stretch to the variance of the rest."""
        out = e.copy()
        out[self.first : self.last] /= np.sqrt(self.ratio)
        return out

    @classmethod
    def test(cls, fitted: FittedChannel) -> TestResult:
        """Scan windows for another variance."""
        local = local_variance(fitted)
        first = _largest_variance(local)
        gain, stretches = 0.0, [(first.start, first.start + first.width)]
        if first.chance < 1e-2:
            gain, stretches = _all(fitted, local, first)
        return TestResult(
            "burst",
            first.chance,
            gain,
            first.mean,
            f"mean square of {first.width} residuals",
            lambda: tuple(extension(fitted, stretches, i) for i in range(len(stretches))),
        )


@dataclass(frozen=True)
class _Window:
    """The window whose local variance is least likely."""

    chance: float
    start: int
    width: int
    mean: float


def _largest_variance(local: LocalVariance) -> _Window:
    """Return the least likely of all windows."""
    n, step = len(local.square), MIN_WINDOW // 4
    total, scatter = (
        np.concatenate(([0.0], np.cumsum(x[: n // step * step].reshape(-1, step).sum(axis=1))))
        for x in (local.square, local.scatter)
    )
    best = _Window(1.0, 0, MIN_WINDOW, 1.0)
    widths = _widths(n)
    for width in widths:
        start = np.arange(0, n - width, width // 4)
        a, b = start // step, (start + width) // step
        mean = (total[b] - total[a]) / width
        freedom = 2.0 * width**2 / np.maximum(scatter[b] - scatter[a], 1e-9)
        deviate = np.abs(local.deviate(mean, freedom * (1.0 - width / n)))
        at = int(np.argmax(deviate))
        chance = normal_beyond(deviate[at]) * len(start) * len(widths)
        if chance < best.chance:
            best = _Window(chance, int(start[at]), width, float(mean[at]))
    return best


def _widths(n: int) -> list[int]:
    """Return the widths of windows of n samples."""
    return [MIN_WINDOW * 2**k for k in range(int(np.log2(n / (3 * MIN_WINDOW))) + 1)]


def _all(fitted: FittedChannel, local: LocalVariance, window: _Window) -> tuple[float, list[tuple[int, int]]]:
    """Return the stretches of another variance, the least likely first, and their gain, nats."""
    known = [x for x in fitted.extensions if isinstance(x, Burst)]
    allowed = REPORTED_STRETCHES if 0 < len(known) <= REPORTED_STRETCHES else MAX_STRETCHES
    stretches: list[tuple[int, int]] = []
    rest = local
    while window.chance < SECOND_P_VALUE or not stretches:
        total = np.concatenate(([0.0], np.cumsum(rest.square)))
        edges = refine(total, window.start, window.start + window.width)[1]
        stretches.append(_beside(_noisier(total, *edges), stretches))
        covered = sum(last - first for first, last in (*stretches, *((x.first, x.last) for x in known)))
        if len(stretches) + len(known) > allowed or covered > MAX_RECORD_SHARE * len(local.square):
            stretches = stretches[:1]
            if len(known) >= REPORTED_STRETCHES:
                return 0.0, stretches
            break
        rest = local.outside(stretches)
        window = _largest_variance(rest)
    square, measured = local.square, local.scatter > 0.0
    if not local.rounded:
        square = np.where(measured, _squares(fitted, stretches), 1.0)
        square /= square[measured].mean()
    return _gain(square, measured, stretches), stretches


def _noisier(total: FloatArray, first: int, last: int) -> tuple[int, int]:
    """Return the edges of a stretch, or of what lies beyond one that is quieter for most of the time, to one end."""
    n = len(total) - 1
    if 2 * (last - first) <= n or (total[last] - total[first]) / (last - first) > total[-1] / n:
        return first, last
    if first < MIN_WINDOW < n - last:
        return last, n
    return (0, first) if n - last < MIN_WINDOW < first else (first, last)


def _beside(edges: tuple[int, int], others: list[tuple[int, int]]) -> tuple[int, int]:
    """Return the edges of a stretch, without what belongs to others."""
    first, last = edges
    for a, b in others:
        if a <= first < b:
            first = b
        if a < last <= b:
            last = a
    return (first, last) if last > first else edges


def _squares(fitted: FittedChannel, stretches: list[tuple[int, int]]) -> FloatArray:
    """Return the squares of the residuals, cut at so many robust deviations of the part of the record they are in."""
    outside = fitted.valid.copy()
    for first, last in stretches:
        outside[first:last] = False
    most = np.full(len(fitted.e), WIDER_CLIP_RATIO * RESIDUAL_CLIP * robust_sd(fitted.e[outside]))
    for first, last in stretches:
        most[first:last] = WIDER_CLIP_RATIO * RESIDUAL_CLIP * robust_sd(fitted.e[first:last])
    return np.asarray(np.minimum(np.abs(fitted.e), most) ** 2)


def _gain(square: FloatArray, measured: BoolArray, stretches: list[tuple[int, int]]) -> float:
    """Return the gain of variances of their own for these stretches, less a price for each."""
    n = len(square)
    inside = np.zeros(n, dtype=bool)
    variance = np.empty(n)
    for first, last in stretches:
        inside[first:last] = True
        variance[first:last] = max(float(square[first:last].mean()), 1e-3)
    variance[~inside] = max(float(square[~inside].mean()), 1e-3)
    kappa = float(np.var(square[measured] / variance[measured]))
    gain = 0.5 * float(n * np.log(square.mean()) - np.sum(np.log(variance)))
    cells = [len(_widths(n)) * 4.0 * n / (last - first) for first, last in stretches]
    return gain * 2.0 / max(kappa, 1e-9) - float(np.sum(np.log(cells) + 0.5 * np.log(n)))


def two_variances(total: FloatArray, first: SignedArray, last: SignedArray) -> FloatArray:
    """Return the log likelihood gained by another variance in samples first … last − 1, same shapes."""
    n = len(total) - 1
    inside = np.asarray(last - first, dtype=float)
    energy = total[last] - total[first]
    outside = np.maximum((total[-1] - energy) / np.maximum(n - inside, 1.0), 1e-12)
    gain = n * np.log(total[-1] / n) - (n - inside) * np.log(outside)
    return np.asarray(0.5 * (gain - inside * np.log(np.maximum(energy / inside, 1e-12))))


def refine(total: FloatArray, first: int, last: int) -> tuple[float, tuple[int, int]]:
    """Return the best edges next to a window, and their gain, nats."""
    n, step = len(total) - 1, max(1, (last - first) // 8)
    gain = float(two_variances(total, np.array(first), np.array(last)))
    while True:
        offsets = step * np.arange(-16, 17)
        a = np.clip(first + offsets, 0, n - 2)[:, None]
        b = np.clip(last + offsets, 2, n)[None, :]
        a, b = np.broadcast_arrays(a, b)
        value = np.where(b - a >= 16, two_variances(total, np.minimum(a, b - 1), b), -np.inf)
        best = np.unravel_index(int(np.argmax(value)), value.shape)
        if value[best] > gain + 1e-6:
            gain, first, last = float(value[best]), int(a[best]), int(b[best])
        elif step > 1:
            step = max(1, step // 4)
        else:
            return gain, (first, last)


def extension(fitted: FittedChannel, stretches: list[tuple[int, int]], which: int) -> Burst:
    """Return one of the stretches with its place, length and ratio of the variances of the white noise itself."""
    first, last = stretches[which]
    square = _squares(fitted, stretches)
    quietly = fitted.valid.copy()
    for a, b in stretches:
        quietly[a:b] = False
    usual = float(square[quietly].mean())
    square[~fitted.valid] = usual
    for a, b in stretches[:which] + stretches[which + 1 :]:
        square[a:b] = usual
    quiet, local = square[quietly], square[first:last]
    ratio = max(float(local.mean() / quiet.mean()), 1.0 / len(local))  # of no noise at all, known to a sample
    kappa = float(np.var(quiet) / quiet.mean() ** 2)
    relative = float(np.sqrt(kappa / len(local) + kappa / len(quiet)))
    total = np.concatenate(([0.0], np.cumsum(square)))
    start = _reach(total, first, last, kappa, move_first=True)
    stop = _reach(total, first, last, kappa, move_first=False)
    outer, inner = (start[0], stop[1]), (start[1], max(stop[0], start[1] + 1))
    return Burst(
        first,
        last,
        ratio,
        values={
            **stretch_times(fitted.channel, (first, last), outer, inner),
            "variance_ratio": _ratio(fitted, ratio, relative, (last - first) / len(square)),
        },
    )


def _ratio(fitted: FittedChannel, seen: float, relative: float, share: float) -> Value:
    """Return the ratio of variances of the white noise, from that of the residuals and its relative deviation."""
    white = dilution(fitted)
    low, value, high = (
        white.undiluted(seen * float(np.exp(k * relative)), share) for k in (-REACH_95, 0.0, REACH_95)
    )
    purer = replace(white, variance=white.variance * (1.0 + REACH_95 * white.error))
    return Value(value, low, high).widened_by(abs(value - purer.undiluted(seen, share)))


def _reach(total: FloatArray, first: int, last: int, kappa: float, *, move_first: bool) -> tuple[int, int]:
    """Return between which samples an edge lies, 95 %: where the likelihood is within `EDGE_NATS` of its best.

    The true edge lies after one sample and not after the next: the sample before the first one belongs to it.
    """
    edge, n = (first, len(total) - 1) if move_first else (last, len(total) - 1)
    width = max(64, last - first)
    place = np.unique(np.clip(np.linspace(edge - width, edge + width, 4001).astype(int), 0, n))
    place = place[place < last - 8] if move_first else place[place > first + 8]
    if not len(place):  # at an end of the record, shorter than that
        return edge, edge
    fixed = np.full(len(place), last if move_first else first)
    value = two_variances(total, place, fixed) if move_first else two_variances(total, fixed, place)
    near = np.flatnonzero(value > value.max() - EDGE_NATS * 0.5 * kappa)
    low, high = place[max(near[0] - 1, 0)], place[min(near[-1] + 1, len(place) - 1)]
    return min(int(low), edge - 1), max(int(high), edge)
