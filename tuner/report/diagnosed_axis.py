"""One axis of a log as the figures of a diagnosis need it: samples, residuals, and the signals that were found.

Some causes are signals that can be drawn over the data: a line (phase by least squares), a bias by temperature, a
warm-up, a step. The effect of the cause (`models.effects`) makes them from the parameters of a finding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isclose

import numpy as np

from models.arrays import FloatArray
from models.effects import EFFECTS, Samples
from models.noise import Arma, NoiseModel
from tuner.diagnosis.static.causes.motion import Motion
from tuner.diagnosis.static.causes.vibration import Vibration
from tuner.diagnosis.static.channel import Channel, channel
from tuner.diagnosis.static.model.dct import inverse, transform
from tuner.diagnosis.static.model.expected_power import spectrum_knots
from tuner.diagnosis.static.model.fitted_channel import FittedChannel, fit_channel
from tuner.diagnosis.static.model.series_statistics import robust_sd
from tuner.types import Coefficient, Diagnosis, Finding
from tuner.types.records import DataError, Record

TEMPERATURE_COVARIATE = "temperature"
PEAK_WIDTHS, KNOTS_IN_A_PEAK = 100.0, 1 << 13
"""Widths of a resonance on either side of it within which its spectrum has knots of its own, and how many.

Farther off it is a hundredth of a percent of its peak; with forty a width a chord errs by 1e-4.
"""


@dataclass(frozen=True)
class DiagnosedAxis:
    """One axis of a log with its residuals and findings; what takes long is computed where a figure shows it.

    Attributes
    ----------
    record : Record
        Its log.
    ready : Channel
        The axis as it was analysed; short gaps are bridged.
    before, after : NoiseModel
        Noise without and with what was found.
    findings : tuple of Finding
        All findings in the axis.
    """

    record: Record
    ready: Channel
    before: NoiseModel
    after: NoiseModel
    findings: tuple[Finding, ...]

    @cached_property
    def t(self) -> FloatArray:
        """Time, s, shape (n,)."""
        return self.ready.times(np.arange(len(self.ready)))

    @cached_property
    def y(self) -> FloatArray:
        """Samples less their median, SI, shape (n,)."""
        return self.ready.y * self.ready.scale

    @cached_property
    def temperature(self) -> FloatArray | None:
        """Temperature, °C, shape (n,), where it was recorded."""
        blocks = self.ready.covariates.get(TEMPERATURE_COVARIATE)
        return None if blocks is None else np.repeat(blocks, self.ready.block)

    @cached_property
    def fitted(self) -> FittedChannel:
        """The fit without any finding, with its residuals `e`, shape (n,), of unit variance."""
        return fit_channel(self.ready)

    @cached_property
    def left(self) -> FloatArray:
        """Residuals of the noise with everything that was found in the spectrum, of unit variance, shape (n,).

        Their distribution, and their variance over time, are not those of a resonance that is known.
        """
        if not self.after.terms:
            return self.fitted.e
        interval = self.ready.interval
        a = transform(self.y - self.signal, interval)
        order, knots = np.arange(1.0, len(a)), _knots(self, len(a))
        power = self.after.psd(knots / (2.0 * len(a) * interval), interval=interval)
        a[0] = 0.0
        a[1:] /= np.sqrt(np.interp(order, knots, power))
        e = inverse(a, 1.0)
        return e / robust_sd(e)

    def expected(self, f: FloatArray) -> FloatArray:
        """Return the spectrum of the residuals at frequencies `f`, Hz, if the noise is `after`; 1 if it is the fit."""
        power = self.fitted.power_at(f) * (self.ready.scale * self.fitted.spread) ** 2
        return np.asarray(self.after.psd(f, interval=self.ready.interval) / power)

    @cached_property
    def signals(self) -> Mapping[str, FloatArray]:
        """Signals that were found, by cause, SI, shape (n,)."""
        signals: dict[str, FloatArray] = {}
        samples = Samples(self.t, self.y[:, None], self.ready.interval, self.temperature)
        for one in self.findings:
            effect, values = EFFECTS.get(one.cause), parameters(one, self.ready.axis)
            made = None if effect is None else effect.drawn(values, samples)
            if made is not None:
                signals[one.cause] = signals.get(one.cause, 0.0) + (made - made.mean())
        return signals

    @property
    def signal(self) -> FloatArray:
        """Sum of all signals, shape (n,)."""
        return sum(self.signals.values(), np.zeros_like(self.y))

    def without_others(self, cause: str) -> FloatArray:
        """Return the samples without the signals of other causes, shape (n,)."""
        return self.y - sum((s for c, s in self.signals.items() if c != cause), np.zeros_like(self.y))

    def values(self, cause: str) -> list[dict[str, float]]:
        """Return the parameters of every finding of a cause in this axis."""
        return [parameters(f, self.ready.axis) for f in self.findings if f.cause == cause]


def parameters(finding: Finding, axis: str) -> dict[str, float]:
    """Return the values of a finding in one axis."""
    known: Mapping[str, Coefficient] = finding.by_channel.get(axis, finding.parameters)
    return {name: c.value for name, c in known.items() if c.value is not None}


def diagnosed_axis(
    records: Sequence[Record], axis: str, diagnosis: Diagnosis, *, moving: bool = False
) -> DiagnosedAxis | None:
    """Return one axis made ready as it was analysed, or None where it cannot be; `moving` shows the whole log."""
    record = next((r for r in records if axis in r.axes), None)
    if record is None:
        return None
    try:
        ready = channel(record, axis)
    except DataError:
        return None
    if not moving:
        ready = _analysed(ready, diagnosis) or ready
    findings = tuple(f for f in diagnosis.findings if axis in f.channels)
    before, after = (models.get(axis, NoiseModel()) for models in (diagnosis.base, diagnosis.models))
    if any(isinstance(term, Arma) and not isclose(term.interval, ready.interval) for term in after.terms):
        return None  # a model of what is new among repeated samples
    return DiagnosedAxis(record, ready, before, after, findings)


def _knots(one: DiagnosedAxis, n: int) -> FloatArray:
    """Return the places, of 1 … n − 1, between which the spectrum with what was found is as good as linear."""
    peaks = []
    for found in one.values(Vibration.cause):
        place = 2.0 * n * one.ready.interval * found["frequency"]
        reach = PEAK_WIDTHS * place / found["quality"]
        low, high = (float(np.clip(end, 1, n - 1)) for end in (place - reach, place + reach))
        inside = np.linspace(low, high, KNOTS_IN_A_PEAK)
        peaks.append(inside if high - low > KNOTS_IN_A_PEAK else np.arange(np.ceil(low), high))
    return np.unique(np.concatenate((spectrum_knots(1, n), *peaks)))


def _analysed(whole: Channel, diagnosis: Diagnosis) -> Channel | None:
    """Return what was analysed of a channel: its part at rest, or all of it without stretches of motion."""
    if whole.axis in diagnosis.parts:
        begin, end = (round(whole.place(t)) for t in diagnosis.parts[whole.axis])
        return whole.part(max(begin, 0), min(end, len(whole)))
    still = whole
    for stretch in diagnosis.left_out:
        begin, end = (min(max(round(whole.place(t)), 0), len(whole)) for t in stretch)
        still = Motion(begin, end, values={}).including(begin, end, len(whole)).clean_samples(still)
    return still
