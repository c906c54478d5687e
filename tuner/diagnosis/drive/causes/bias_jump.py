"""A jump of a bias: score of an impulse in the bias states after every fix, from one backward recursion.

For an impulse δ in three bias states just after fix k, score s_k and information N_k come with the backward recursion
of the likelihood [2]_; with them the statistic of Willsky and Jones [1]_::

    Λ_k = s_kᵀ N_k⁻¹ s_k ~ χ²₃,    δ = N_k⁻¹ s_k,    var δ = N_k⁻¹

for every k at the cost of one. The scan over k is allowed for by Davies' bound [3]_: with V, the sum of |Δ√Λ| over the
scan, P(max Λ > u) ≤ P(χ²₃ > u) + V u e^{−u/2} / (2^{3/2} Γ(3/2)). An accepted jump is three further columns of B.

References
----------
.. [1] A. S. Willsky, H. L. Jones, A generalized likelihood ratio approach to the detection and estimation of jumps
   in linear systems, IEEE Trans. Automatic Control 21 (1976).
.. [2] P. de Jong, J. Penzer, Diagnosing shocks in time series, J. Amer. Statist. Assoc. 93 (1998).
.. [3] R. B. Davies, Hypothesis testing when a nuisance parameter is present only under the alternative,
   Biometrika 74 (1987): several degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import gamma
from scipy.stats import chi2

from models.arrays import FloatArray
from models.effects.drive.imu import BiasJump as Effect
from models.filter_states.declaration import NAVIGATION_STATES
from tuner.diagnosis.drive.cause_test import CauseTest, not_significant
from tuner.diagnosis.drive.causes.base import NoiseCause
from tuner.diagnosis.drive.hypothesis import FilterRun, Hypothesis, Jump
from tuner.diagnosis.static.outcome import TestResult
from tuner.linear_run.likelihood import NoiseHypothesis, evaluate, evaluate_with_gradient
from tuner.linear_run.linearized_run import LinearizedRun
from tuner.types import Coefficient, Parameter

BIAS_JUMP = "bias_jump"
"""Code of the cause."""
SENSORS = {"gyro": (slice(0, 3), "rad/s"), "accel": (slice(3, 6), "m/s^2")}
"""Bias states whose impulses are scored, and their units, by sensor."""
MAX_JUMPS = 2
"""Most jumps that are named: of more, a slow change of the bias is the likelier explanation."""
MAX_JUMP_SIZE = {"gyro": 0.05, "accel": 1.0}
"""Size of a jump, rad/s and m/s², from which it is not credible.

10⁴ °/h and 0.1 g: chosen beyond what a sensor in working order does; larger ones are faults of the data.
"""
N_EDGE_FIXES = 5
"""Fixes at either end of the run that are left out: there a jump cannot be separated from the prior of the biases."""
CHI2_1_QUANTILE_95 = 3.841
"""Drop of the statistic within which a time is in its 95 % interval: the 95 % quantile of χ²₁."""
_SINGULAR_VALUE_CUTOFF = 1e-9
"""Relative singular value of an information matrix below which a direction is unobservable; chosen near rounding."""


@dataclass(frozen=True)
class JumpScan:
    """Statistic, size and covariance of a jump of one sensor after every fix; shapes (k,), (k, 3), (k, 3, 3)."""

    statistic: FloatArray
    size: FloatArray
    covariance: FloatArray


def bias_jump(noise: NoiseHypothesis) -> CauseTest:
    """Test the biases for one jump; `jump_sensor` says of which sensor."""
    title = "likelihood ratio of a jump of a bias"
    settled = replace(
        noise, linearized=replace(noise.linearized, scored=np.ones(len(noise.linearized.t), dtype=bool))
    )
    _, gradient = evaluate_with_gradient(settled)
    known = np.isfinite(gradient.score).all() and np.isfinite(gradient.information).all()
    if gradient.score.shape[1] < 6 or not known:  # numbers that are lost in rounding decide nothing
        return not_significant(BIAS_JUMP, noise, 1.0, 0.0, title)
    inside = np.flatnonzero(noise.linearized.scored)
    inside = inside[(inside >= N_EDGE_FIXES) & (inside < len(noise.linearized.t) - N_EDGE_FIXES)]
    if not len(inside):
        return not_significant(BIAS_JUMP, noise, 1.0, 0.0, title)
    scans = {
        sensor: scan(gradient.score[:, at], gradient.information[:, at, at])
        for sensor, (at, _) in SENSORS.items()
    }
    sensor = max(scans, key=lambda name: float(scans[name].statistic[inside].max()))
    jumps = scans[sensor]
    k = int(inside[np.argmax(jumps.statistic[inside])])
    ratio = float(jumps.statistic[k])
    p_value = min(1.0, len(SENSORS) * davies_bound(ratio, np.sqrt(jumps.statistic[inside])))
    price = 1.5 * np.log(noise.count) + np.log(len(SENSORS) * len(inside))
    result = TestResult(BIAS_JUMP, p_value, 0.5 * ratio - float(price), ratio, title)
    within_interval = inside[jumps.statistic[inside] > ratio - CHI2_1_QUANTILE_95]
    return CauseTest(
        result,
        with_jump(noise, k, sensor),
        lambda: _coefficients(noise.linearized, jumps, k, within_interval, sensor),
    )


def scan(score: FloatArray, information: FloatArray) -> JumpScan:
    """Return the statistics of impulses with scores (k, 3) and informations (k, 3, 3)."""
    scale = np.sqrt(np.maximum(np.diagonal(information, axis1=1, axis2=2), 0.0))
    scale = np.where(scale > 0.0, scale, 1.0)
    inverse = np.linalg.pinv(
        information / (scale[:, :, None] * scale[:, None, :]), rcond=_SINGULAR_VALUE_CUTOFF, hermitian=True
    )
    inverse = inverse / (scale[:, :, None] * scale[:, None, :])
    size = np.einsum("kij,kj->ki", inverse, score)
    return JumpScan(np.sum(size * score, axis=1), size, inverse)


def davies_bound(ratio: float, root: FloatArray) -> float:
    """Return the bound on the probability that a scan of χ²₃ exceeds `ratio`; `root` are its square roots (k,)."""
    variation = float(np.abs(np.diff(root)).sum())
    crossings = variation * ratio * np.exp(-0.5 * ratio) / (2.0**1.5 * gamma(1.5))
    return float(min(1.0, chi2.sf(ratio, 3) + crossings))


def with_jump(noise: NoiseHypothesis, k: int, sensor: str) -> NoiseHypothesis:
    """Return the hypothesis with a jump after fix k: three more columns ``bias_jump.SENSOR_x`` …, free."""
    linearized = noise.linearized
    n, p = linearized.transition.shape[1], linearized.B.shape[2]
    at = SENSORS[sensor][0]
    impulse = np.zeros((len(linearized.t), n, 3))
    impulse[k + 1] = linearized.transition[k + 1][
        :, NAVIGATION_STATES + at.start : NAVIGATION_STATES + at.stop
    ]
    more = replace(
        linearized,
        parameters=(*linearized.parameters, *(Parameter(BIAS_JUMP, f"{sensor}_{axis}") for axis in "xyz")),
        B=np.concatenate([linearized.B, impulse], axis=2),
        D=np.concatenate([linearized.D, np.zeros((len(linearized.t), 6, 3))], axis=2),
    )
    return replace(noise, linearized=more, columns=(*noise.columns, p, p + 1, p + 2))


def jump_sensor(noise: NoiseHypothesis) -> str:
    """Return the sensor of the last jump of a noise hypothesis."""
    return noise.linearized.parameters[noise.columns[-1]].name.partition("_")[0]


def _coefficients(
    linearized: LinearizedRun, jumps: JumpScan, k: int, within_interval: NDArray[np.intp], sensor: str
) -> Mapping[str, Coefficient]:
    last = min(int(within_interval.max()) + 1, len(linearized.t) - 1)
    middle = 0.5 * float(linearized.t[k] + linearized.t[k + 1])
    out = {
        "time": Coefficient.known(
            middle, float(linearized.t[within_interval.min()]), float(linearized.t[last]), "s"
        )
    }
    sd = np.sqrt(np.diag(jumps.covariance[k]))
    for axis, value, spread in zip("xyz", jumps.size[k].tolist(), sd.tolist(), strict=True):
        low, high = value - 1.96 * spread, value + 1.96 * spread
        out[axis] = Coefficient.known(value, low, high, SENSORS[sensor][1])
    return out


class BiasJump(NoiseCause):
    """One jump of the biases of the gyros or of the accelerometers."""

    cause = BIAS_JUMP
    effect = Effect
    channels = ("imu",)
    meaning = "a bias jumped, at {time}, by {}"
    consequence = "raise the drive of the bias at that time, or restart the filter"
    view = "slow means"

    @classmethod
    def test(cls, run: FilterRun, noise: NoiseHypothesis, threshold: float) -> tuple[CauseTest, ...]:  # noqa: ARG003
        """Test for one more jump, unless as many as are credible are accepted."""
        return (bias_jump(noise),) if len(run.hypothesis.jumps) < MAX_JUMPS else ()

    @classmethod
    def is_credible(cls, test: CauseTest) -> bool:
        """Whether the jump is of a size that is met in practice."""
        size = np.abs(evaluate(test.noise).theta[-3:]).max()
        return bool(size < MAX_JUMP_SIZE[jump_sensor(test.noise)])

    @classmethod
    def accepted(cls, run: FilterRun, test: CauseTest) -> Hypothesis:
        """Return the hypothesis of a run with the jump added."""
        time = test.describe()["time"].value
        assert time is not None
        jump = Jump(time, jump_sensor(test.noise), evaluate(test.noise).theta[-3:])
        return replace(run.hypothesis, jumps=(*run.hypothesis.jumps, jump))

    @classmethod
    def without(cls, final: Hypothesis, base: Hypothesis) -> Hypothesis:
        """Return the final hypothesis with the jumps of the first one."""
        return replace(final, jumps=base.jumps)
