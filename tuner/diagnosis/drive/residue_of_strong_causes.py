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

from models.arrays import FloatArray
from tuner.diagnosis.drive.causes.bias_jump import bias_jump
from tuner.diagnosis.drive.hypothesis import FilterRun
from tuner.diagnosis.drive.score_tests import ScoreTest, columns_of, retest
from tuner.diagnosis.static.outcome import TestResult
from tuner.linear_run.likelihood import NoiseHypothesis, as_configured
from tuner.linear_run.linearized_run import LinearizedRun
from tuner.linear_run.whitened_innovations import whiten

N_PARTS = 5
"""Parts of a drive between which a strong cause may differ; chosen to follow slow changes with few parameters."""
MAX_WEAK_GAIN = 10.0
"""Gain up to which a cause may be a residue, nats; chosen so that clear causes need no second test."""
MIN_STATISTIC_RATIO = 100.0
"""Ratio of two z² from which one cause may leave the other as its residue: it varies by a tenth of itself."""


def with_piecewise_constants(linearized: LinearizedRun, causes: Sequence[str]) -> LinearizedRun:
    """Return a run with a further column for each constant of some causes and each part of the drive but the first."""
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
    run: FilterRun, fitted: Sequence[str], test: ScoreTest, threshold: float
) -> tuple[str, ...]:
    """Return the strong causes whose residue a weak one may be; empty where it is significant beside them.

    Parameters
    ----------
    run : FilterRun
        Compensated.
    fitted : sequence of str
        Accepted constant causes, the weak one among them.
    test : ScoreTest
        Test of the weak one.
    threshold : float
        p value below which it is significant.
    """
    strong = _stronger(run, fitted, test.cause, test.gain, test.statistic)
    if not strong:
        return ()
    piecewise = with_piecewise_constants(run.linearized, strong)
    values = _values(run, test.cause)
    again = retest(whiten(as_configured(piecewise)), piecewise.parameters, fitted, test.cause, values)
    return strong if again.p_value >= threshold else ()


def causes_stronger_than_jump(run: FilterRun, fitted: Sequence[str], test: TestResult) -> tuple[str, ...]:
    """Return the strong causes whose residue a weak jump of a bias may be; the run is compensated."""
    return _stronger(run, fitted, test.cause, test.gain, test.statistic)


def jump_remains(run: FilterRun, fitted: Sequence[str], strong: Sequence[str], threshold: float) -> bool:
    """Whether a jump of a bias stays significant where strong causes may differ between parts of the drive."""
    piecewise = with_piecewise_constants(run.linearized, strong)
    columns = tuple(i for cause in fitted for i in columns_of(cause, piecewise.parameters))
    noise: NoiseHypothesis = replace(as_configured(piecewise), columns=columns)
    return bias_jump(noise).result.p_value < threshold


def model_error_note(cause: str, gain: float, strong: Sequence[str]) -> str:
    """Return the note that a cause is not distinguished from model error, and why."""
    return (
        f"{cause} of {gain:.1f} nats is too small to be distinguished from model error: it is not significant where "
        f"{', '.join(strong)} may differ between {N_PARTS} parts of the drive"
    )


def _stronger(
    run: FilterRun, fitted: Sequence[str], cause: str, gain: float, statistic: float
) -> tuple[str, ...]:
    """Return the accepted constant causes beside which a cause is weak."""
    if gain >= MAX_WEAK_GAIN:
        return ()
    w, names = run.whitened, run.linearized.parameters
    others = [other for other in fitted if other != cause]
    z2 = {other: retest(w, names, fitted, other, _values(run, other)).statistic for other in others}
    return tuple(other for other in others if z2[other] > MIN_STATISTIC_RATIO * statistic)


def _values(run: FilterRun, cause: str) -> FloatArray:
    """Return the compensated values of a cause."""
    own = columns_of(cause, run.linearized.parameters)
    return run.hypothesis.compensation.vector(run.linearized.parameters[i] for i in own)
