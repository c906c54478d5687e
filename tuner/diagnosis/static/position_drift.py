"""What a finding is worth to a navigator: how far the position drifts without fixes, with the cause and without it.

A bias that was averaged over the h seconds before an outage of h seconds is wrong by √2 σ(h), σ the Allan deviation:
half the mean square of the difference of neighbouring means. One accelerometer or gyro alone then moves the position,
on the round Earth with Schuler's frequency ω = √(g/R), by

    accelerometer   √2 σ(h) (1 − cos ωh)/ω²           (h²/2 for short h)
    gyro            √2 σ(h) R (h − sin(ωh)/ω)         (g h³/6)

σ is that of the samples; without the cause, that of samples less the signal that was found, or less the Allan variance
of the noise that it adds. Of several axes that are moved most counts.

References
----------
.. [1] D. Titterton and J. Weston, Strapdown Inertial Navigation Technology, 2nd ed., ch. 12 (Schuler-tuned errors).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from models.arrays import FloatArray
from models.earth import SEMI_MAJOR_AXIS
from models.effects import EFFECTS, Samples
from models.noise import GaussMarkov, NoiseModel
from models.noise.arma import Arma
from models.units import STANDARD_GRAVITY
from tuner.curves.allan import overlapping_allan
from tuner.diagnosis.static.causes.temperature import COVARIATE
from tuner.diagnosis.static.channel import BLOCK_COUNT
from tuner.diagnosis.static.model.covariate import code_step, smoothed, typical_repeats
from tuner.segments.error_codes import with_other_rows
from tuner.synthesis.findings import EVENTS, LEFT_OUT, left_out
from tuner.types import Finding
from tuner.types.records import Record

OUTAGES = (60.0, 1000.0)
"""Durations without fixes, s: a tunnel, and a sixth of a Schuler period."""
SHORT_OUTAGE = 10.0
"""Duration of logs in which these do not fit, s: a bridge."""
MIN_MEANS = 4
"""Durations that must fit into a stretch for its Allan deviation to say anything."""


def position_drift(unit: str, deviation: float, duration: float) -> float:
    """Return the position error, m, after a duration, s, from the Allan deviation of a sensor at that time, SI."""
    schuler = np.sqrt(STANDARD_GRAVITY / SEMI_MAJOR_AXIS)
    bias = np.sqrt(2.0) * deviation
    if unit == "rad/s":
        return float(bias * SEMI_MAJOR_AXIS * (duration - np.sin(schuler * duration) / schuler))
    return float(bias * (1.0 - np.cos(schuler * duration)) / schuler**2)


def with_drifts(findings: Sequence[Finding], records: Sequence[Record]) -> tuple[Finding, ...]:
    """Return findings with the drift of position that each causes.

    Parameters
    ----------
    findings : sequence of Finding
        On the samples of `records`.
    records : sequence of Record
        Log that was diagnosed, cut to what is at rest.
    """
    measured: dict[str, Mapping[float, float]] = {}
    return tuple(replace(finding, drift=_drift(finding, records, measured)) for finding in findings)


def left_drifts(
    findings: Sequence[Finding], records: Sequence[Record], models: Mapping[str, NoiseModel]
) -> dict[str, dict[str, tuple[float, float]]]:
    """Return, by axis, the drift as measured less the signals that were found, and as the model has it, m.

    Parameters
    ----------
    findings : sequence of Finding
        On the samples of `records`.
    records : sequence of Record
        Log that was diagnosed, cut to what is at rest.
    models : mapping of str to NoiseModel
        Model of each axis, SI.
    """
    signals = found_signals(findings, records)
    out = {}
    for record in records:
        for axis in (axis for axis in record.axes if axis in models):
            signal = signals[axis][1] if axis in signals else np.zeros(len(record))
            pieces = [record.column(axis)[a:b] - signal[a:b] for a, b in record.segments]
            measured = _allan(pieces, record.interval)
            dt = next((t.interval for t in models[axis].terms if isinstance(t, Arma)), record.interval)
            tau = np.array(
                [max(_samples(h, dt), 1) * dt for h in measured]
            )  # without repeated samples dt is longer
            modelled = models[axis].allan_variance(tau, interval=dt)
            out[axis] = {
                f"{h:g} s": (
                    position_drift(record.unit, np.sqrt(measured[h]), h),
                    position_drift(record.unit, np.sqrt(float(variance)), h),
                )
                for h, variance in zip(measured, modelled, strict=True)
            }
    return out


def _drift(
    finding: Finding, records: Sequence[Record], measured: dict[str, Mapping[float, float]]
) -> dict[str, tuple[float, float]]:
    """Return the drift with and without a cause, m, by the duration in words."""
    drifts: dict[str, tuple[float, float]] = {}
    for record in records:
        for axis in (axis for axis in record.axes if axis in finding.channels):
            if axis not in measured:
                measured[axis] = _allan(record.pieces(axis), record.interval)
            without = _without(finding, record, axis, measured[axis])
            for h, variance in measured[axis].items():
                pair = (
                    position_drift(record.unit, np.sqrt(variance), h),
                    position_drift(record.unit, np.sqrt(without.get(h, variance)), h),
                )
                known = drifts.get(f"{h:g} s", (0.0, 0.0))
                if known == (0.0, 0.0) or pair[0] - pair[1] > known[0] - known[1]:
                    drifts[f"{h:g} s"] = pair
    return drifts


def _samples(h: float, interval: float) -> int:
    """Return the number of samples nearest to a duration."""
    return round(h / interval)


def _allan(pieces: Sequence[FloatArray], interval: float) -> dict[float, float]:
    """Return the Allan variance at each duration that fits, pooled over stretches without a gap."""
    found: dict[float, float] = {}
    for h in (*OUTAGES, SHORT_OUTAGE):
        m = _samples(h, interval)
        if h == SHORT_OUTAGE and found:
            break
        long = [piece for piece in pieces if len(piece) >= MIN_MEANS * m]
        if m >= 1 and long:
            weight = [len(piece) - 2 * m + 1 for piece in long]
            variances = [float(overlapping_allan(piece - piece.mean(), [m])[0]) for piece in long]
            found[h] = float(np.average(variances, weights=weight))
    return found


def _without(
    finding: Finding, record: Record, axis: str, measured: Mapping[float, float]
) -> dict[float, float]:
    """Return the Allan variance with the cause taken out; never more than measured."""
    values = {
        name: c.value
        for name, c in finding.by_channel.get(axis, finding.parameters).items()
        if c.value is not None
    }
    signal = found_signal(finding.cause, values, record, axis)
    if signal is not None:
        pieces = [record.column(axis)[a:b] - signal[a:b] for a, b in record.segments]
        left = _allan(pieces, record.interval)
        return {h: min(variance, left.get(h, variance)) for h, variance in measured.items()}
    fast = np.diff(np.concatenate(record.pieces(axis)))
    white = 0.5 * float(np.mean(fast**2)) * record.interval
    length = sum(stop - start for start, stop in record.segments) * record.interval
    left = {}
    for h, variance in measured.items():
        added = _added(finding.cause, values, h, record.interval, min(white / h, variance), length)
        left[h] = (
            variance - added if added < variance else variance
        )  # a noise above all that was measured says nothing
    return left


def _added(
    cause: str, values: Mapping[str, float], h: float, interval: float, white: float, length: float
) -> float:
    """Return the Allan variance at a duration that a noise adds; of white noise, `white` is the whole."""
    try:
        match cause:
            case "gauss_markov":
                term = GaussMarkov(values["sd"], values["time_constant"])
                return float(term.allan_variance(np.array([h]))[0])
            case "telegraph":
                low, high = values["dwell_low"], values["dwell_high"]
                sd = abs(values["size"]) * np.sqrt(low * high) / (low + high)
                return float(GaussMarkov(sd, low * high / (low + high)).allan_variance(np.array([h]))[0])
            case "spikes":
                return values["rate"] * (values["size"] * interval) ** 2 / h
            case "burst":
                more = values["duration"] / length * (values["variance_ratio"] - 1.0)
                return white * max(more, 0.0) / (1.0 + max(more, 0.0))
    except (KeyError, ValueError):
        pass
    return 0.0


def found_signals(
    findings: Sequence[Finding], records: Sequence[Record]
) -> dict[str, tuple[tuple[str, ...], FloatArray]]:
    """Return, by axis, the causes that add a signal to its samples, and the sum of these signals, shape (n,).

    They follow from time or temperature, so that a user can take them out: warm-up, steps, temperature.
    """
    signals: dict[str, tuple[tuple[str, ...], FloatArray]] = {}
    for record in records:
        for axis in record.axes:
            for finding in (f for f in findings if axis in f.channels):
                effect = EFFECTS.get(finding.cause)
                values = {
                    name: c.value
                    for name, c in finding.by_channel.get(axis, finding.parameters).items()
                    if c.value is not None
                }
                signal = found_signal(finding.cause, values, record, axis)
                if effect is None or not effect.deterministic or signal is None:
                    continue
                causes, total = signals.get(axis, ((), np.zeros_like(signal)))
                signals[axis] = (*causes, finding.cause), total + signal
    return signals


def without_events(record: Record, findings: Sequence[Finding]) -> Record:
    """Return a record without the events and wrong samples that were found, which are no noise, and say so."""
    gone = left_out(findings)
    wrong, notes = [], []
    for one in gone:
        by_axis = one.extension.get(LEFT_OUT)
        for axis, times in by_axis.items() if isinstance(by_axis, Mapping) else ():
            if axis in record.axes:
                rows = np.zeros(len(record), dtype=bool)
                rows[np.searchsorted(record.t, np.array(times) - 0.5 * record.interval)] = True
                wrong.append((rows, (axis,)))
                notes.append(f"{axis}: {rows.sum()} wrong readings left out")
    record = with_other_rows(record, wrong, notes)
    signals = found_signals([one for one in gone if one.cause in EVENTS], [record])
    if not signals:
        return record
    y = record.y.copy(order="F")
    for axis, (_, signal) in signals.items():
        y[:, record.axes.index(axis)] -= signal
    notes = [
        f"{axis}: {', '.join(dict.fromkeys(causes))} taken out before the noise was identified: an event is no noise"
        for axis, (causes, _) in signals.items()
    ]
    return replace(record, y=y, notes=(*record.notes, *notes))


def found_signal(cause: str, values: Mapping[str, float], record: Record, axis: str) -> FloatArray | None:
    """Return the signal that a cause adds to the samples of an axis, shape (n,); None where it adds none."""
    effect = EFFECTS.get(cause)
    if effect is None:
        return None
    celsius = record.covariates.get(COVARIATE)
    if celsius is not None and effect.needs_smooth_temperature:
        celsius = _smooth(celsius)
    samples = Samples(record.t, record.column(axis)[:, None], record.interval, celsius)
    try:
        return effect.drawn(values, samples)
    except (KeyError, TypeError, ValueError):
        return None


def _smooth(celsius: FloatArray) -> FloatArray:
    """Return readings of a thermometer, shape (n,), on the curve that a diagnosis takes for the temperature."""
    size = max(1, len(celsius) // BLOCK_COUNT)
    number = len(celsius) // size
    means = celsius[: number * size].reshape(number, size).mean(axis=1)
    curve = smoothed(means, code_step(celsius), -(-typical_repeats(celsius) // size))
    return np.interp(np.arange(len(celsius)), (np.arange(number) + 0.5) * size, curve)
