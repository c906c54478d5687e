"""Whether a weak finding is only the residue of a strong, time-varying one.

A compensation is one constant. Where the clocks of a drive differ by two seconds and a tenth of that comes and goes,
the residue has a hundredth of the z² of the delay and shows in every cause with similar sensitivities. So a cause of
few nats beside one whose z² is `MIN_STATISTIC_RATIO` times its own is tested once more with the strong one piecewise
constant in time::

    B_i θ → Σ_p 1(fix i in part p) B_i θ_p          D alike

A weak cause that is no longer significant then cannot be distinguished from a model error of the strong one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tuner.diagnosis.drive.causes.bias_jump import bias_jump
from tuner.diagnosis.drive.hypothesis import FilterRun
from tuner.diagnosis.drive.linear_model.likelihood import NoiseHypothesis, as_configured
from tuner.diagnosis.drive.linear_model.linearized_run import LinearizedRun
from tuner.diagnosis.drive.linear_model.whitened_innovations import whiten
from tuner.diagnosis.drive.score_tests import ScoreTest, columns_of, retest
from tuner.diagnosis.static.outcome import Alarm

FloatArray = NDArray[np.float64]

N_PARTS = 5
"""Parts of a drive between which a strong cause may differ."""
MAX_WEAK_GAIN = 10.0
"""Gain up to which a cause is doubted, nats."""
MIN_STATISTIC_RATIO = 100.0
"""Ratio of two z² from which one cause may leave the other behind: it differs by a tenth of itself."""


def with_piecewise_constants(linearized: LinearizedRun, causes: Sequence[str]) -> LinearizedRun:
    """Return a record with a column more for each constant of causes and each part of the drive but the first."""
    span = max(float(linearized.t[-1] - linearized.t[0]), 1e-9)
    part = np.minimum((N_PARTS * (linearized.t - linearized.t[0]) / span).astype(int), N_PARTS - 1)
    own = [i for cause in causes for i in columns_of(cause, linearized.parameters)]
    names, B, D = list(linearized.parameters), [linearized.B], [linearized.D]
    for p in range(1, N_PARTS):
        inside = (part == p)[:, None, None]
        names += [replace(linearized.parameters[i], name=f"{linearized.parameters[i].name}_{p}") for i in own]
        B.append(np.where(inside, linearized.B[:, :, own], 0.0))
        D.append(np.where(inside, linearized.D[:, :, own], 0.0))
    return replace(
        linearized,
        parameters=tuple(names),
        B=np.concatenate(B, axis=2),
        D=np.concatenate(D, axis=2),
    )


def explained_by_stronger(
    run: FilterRun, known: Sequence[str], alarm: ScoreTest, threshold: float
) -> tuple[str, ...]:
    """Return the strong causes that may leave a weak shift behind; empty where it stands by itself.

    Parameters
    ----------
    run : FilterRun
        Compensated.
    known : sequence of str
        Accepted shifts, the weak one among them.
    alarm : ScoreTest
        Its own test.
    threshold : float
        Chance below which it alarms.
    """
    strong = _stronger(run, known, alarm.cause, alarm.gain, alarm.statistic)
    if not strong:
        return ()
    loose = with_piecewise_constants(run.linearized, strong)
    values = _values(run, alarm.cause)
    again = retest(whiten(as_configured(loose)), loose.parameters, known, alarm.cause, values)
    return strong if again.p_value >= threshold else ()


def causes_stronger_than_jump(run: FilterRun, known: Sequence[str], alarm: Alarm) -> tuple[str, ...]:
    """Return the strong causes that may leave a weak jump of a bias behind; `run` is compensated."""
    return _stronger(run, known, alarm.cause, alarm.gain, alarm.statistic)


def jump_remains(run: FilterRun, known: Sequence[str], strong: Sequence[str], threshold: float) -> bool:
    """Whether a bias jumps in a pass without jumps where strong causes may differ between parts of the drive."""
    loose = with_piecewise_constants(run.linearized, strong)
    columns = tuple(i for cause in known for i in columns_of(cause, loose.parameters))
    noise: NoiseHypothesis = replace(as_configured(loose), columns=columns)
    return bias_jump(noise).alarm.p_value < threshold


def rejection_note(cause: str, gain: float, strong: Sequence[str]) -> str:
    """Say that a cause is none, and why."""
    return (
        f"{cause} of {gain:.1f} nats is too small to tell from model error: it is gone where {', '.join(strong)} may "
        f"differ between {N_PARTS} parts of the drive"
    )


def _stronger(
    run: FilterRun, known: Sequence[str], cause: str, gain: float, statistic: float
) -> tuple[str, ...]:
    """Return the accepted shifts beside which a cause is weak."""
    if gain >= MAX_WEAK_GAIN:
        return ()
    w, names = run.whitened, run.linearized.parameters
    others = [other for other in known if other != cause]
    z2 = {other: retest(w, names, known, other, _values(run, other)).statistic for other in others}
    return tuple(other for other in others if z2[other] > MIN_STATISTIC_RATIO * statistic)


def _values(run: FilterRun, cause: str) -> FloatArray:
    """Return what a pass compensates of a cause."""
    own = columns_of(cause, run.linearized.parameters)
    return run.hypothesis.compensation.vector(run.linearized.parameters[i] for i in own)
