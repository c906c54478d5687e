"""Whether a weak cause is more than what a strong one leaves that does not stay as it is.

A compensation is one constant. Where the clocks of a drive differ by two seconds, a tenth of which comes and goes, what
stays behind has a hundredth of the z² of the delay, and shows in whatever has a like pull on the innovations. So a
cause of few nats beside one whose z² is `STRONGER` times its own is asked once more with the strong one free to differ
between parts of the drive::

    B_i θ → Σ_p 1(fix i in part p) B_i θ_p          D alike

What falls silent then cannot be told from a model error of the strong one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tuner.diagnosis.drive.causes.bias_jump import bias_jump
from tuner.diagnosis.drive.hypothesis import Pass
from tuner.diagnosis.drive.linear_model.likelihood import NoiseHypothesis, as_configured
from tuner.diagnosis.drive.linear_model.linearized_run import LinearRecord
from tuner.diagnosis.drive.linear_model.whitened_innovations import whitened
from tuner.diagnosis.drive.score_tests import Scored, columns_of, retested
from tuner.diagnosis.static.outcome import Alarm

FloatArray = NDArray[np.float64]

PARTS = 5
"""Parts of a drive between which a strong cause may differ."""
WEAK = 10.0
"""Gain up to which a cause is doubted, nats."""
STRONGER = 100.0
"""Ratio of two z² from which one cause may leave the other behind: it differs by a tenth of itself."""


def loosened(record: LinearRecord, causes: Sequence[str]) -> LinearRecord:
    """Return a record with a column more for each constant of causes and each part of the drive but the first."""
    span = max(float(record.t[-1] - record.t[0]), 1e-9)
    part = np.minimum((PARTS * (record.t - record.t[0]) / span).astype(int), PARTS - 1)
    own = [i for cause in causes for i in columns_of(cause, record.parameters)]
    names, drive, seen = list(record.parameters), [record.drive], [record.seen]
    for p in range(1, PARTS):
        inside = (part == p)[:, None, None]
        names += [f"{record.parameters[i]}_{p}" for i in own]
        drive.append(np.where(inside, record.drive[:, :, own], 0.0))
        seen.append(np.where(inside, record.seen[:, :, own], 0.0))
    return replace(
        record,
        parameters=tuple(names),
        drive=np.concatenate(drive, axis=2),
        seen=np.concatenate(seen, axis=2),
    )


def left_by(found: Pass, known: Sequence[str], alarm: Scored, threshold: float) -> tuple[str, ...]:
    """Return the strong causes that may leave a weak shift behind; empty where it stands by itself.

    Parameters
    ----------
    found : Pass
        Compensated.
    known : sequence of str
        Accepted shifts, the weak one among them.
    alarm : Scored
        Its own test.
    threshold : float
        Chance below which it alarms.
    """
    strong = _stronger(found, known, alarm.cause, alarm.gain, alarm.statistic)
    if not strong:
        return ()
    loose = loosened(found.record, strong)
    values = _values(found, alarm.cause)
    again = retested(whitened(as_configured(loose)), loose.parameters, known, alarm.cause, values)
    return strong if again.p_value >= threshold else ()


def jump_left_by(found: Pass, known: Sequence[str], alarm: Alarm) -> tuple[str, ...]:
    """Return the strong causes that may leave a weak jump of a bias behind; `found` is compensated."""
    return _stronger(found, known, alarm.cause, alarm.gain, alarm.statistic)


def jumps_still(found: Pass, known: Sequence[str], strong: Sequence[str], threshold: float) -> bool:
    """Whether a bias jumps in a pass without jumps where strong causes may differ between parts of the drive."""
    loose = loosened(found.record, strong)
    columns = tuple(i for cause in known for i in columns_of(cause, loose.parameters))
    noise: NoiseHypothesis = replace(as_configured(loose), columns=columns)
    return bias_jump(noise).alarm.p_value < threshold


def doubted(cause: str, gain: float, strong: Sequence[str]) -> str:
    """Say that a cause is none, and why."""
    return (
        f"{cause} of {gain:.1f} nats is too small to tell from model error: it is gone where {', '.join(strong)} may "
        f"differ between {PARTS} parts of the drive"
    )


def _stronger(
    found: Pass, known: Sequence[str], cause: str, gain: float, statistic: float
) -> tuple[str, ...]:
    """Return the accepted shifts beside which a cause is weak."""
    if gain >= WEAK:
        return ()
    w, names = found.whitened, found.record.parameters
    others = [other for other in known if other != cause]
    z2 = {other: retested(w, names, known, other, _values(found, other)).statistic for other in others}
    return tuple(other for other in others if z2[other] > STRONGER * statistic)


def _values(found: Pass, cause: str) -> FloatArray:
    """Return what a pass compensates of a cause."""
    own = columns_of(cause, found.record.parameters)
    return np.array([found.hypothesis.values.get(found.record.parameters[i], 0.0) for i in own])
