"""Errors of sensors and fixes that follow the motion and are in no cause, tested on the innovations of a drive.

A cause takes up what the catalogue lacks: vibration that shifts accelerometers with the speed passes for a scale
factor, an antenna on a bending mast for a delay. So errors of every sensor and fix are tried that are proportional to
what the vehicle does, whatever would make them: speed and its square, acceleration and force along the axes, turn
rates, heading, way, height, and time (ramps, warm-up, steps). Each group G of columns S is a constant amplitude of
three axes; with the evidence of the largest over all spreads of its prior (`g-prior` [1]_)::

    z² = bᵀ I⁻¹ b / c,   b = Sᵀ W,   I = Sᵀ S          ln B = ½ [z² − k − k ln(z²/k)]  where z² > k, else 0

beside all that was found, and in place of each cause that was found: of a constant or a jump as if it had not been
taken out, of noise as if it were as stated. The choice among the groups, and of the spread, is paid for.

References
----------
.. [1] A. Zellner, On assessing prior distributions and Bayesian regression analysis with g-prior distributions, in
       Bayesian Inference and Decision Techniques (1986).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tuner.diagnosis.drive.causes.base import is_noise_scale
from tuner.diagnosis.drive.causes.bias_jump import BIAS_JUMP, SENSORS
from tuner.diagnosis.drive.causes.correlated_gnss import CORRELATED_GNSS
from tuner.diagnosis.drive.causes.correlated_velocity import CAUSE_CODE as CORRELATED_VELOCITY
from tuner.diagnosis.drive.linear_model.kalman_kernels import NAVIGATION_STATES
from tuner.diagnosis.drive.linear_model.likelihood import NoiseHypothesis, as_configured, evaluate
from tuner.diagnosis.drive.linear_model.linearized_run import LinearizedRun
from tuner.diagnosis.drive.linear_model.whitened_innovations import whiten
from tuner.diagnosis.drive.motion_courses import Motion, covariates
from tuner.diagnosis.drive.score_tests import colour_factor, columns_of
from tuner.diagnosis.drive.search import SearchResult
from tuner.types import Parameter

FloatArray = NDArray[np.float64]

SPREAD_COST = 2.0
"""Cost, nats, of choosing the spread of the prior: sizes known to four decades, of which the best takes about e."""
SENSOR_NAMES = {"gyro": "gyroscopes", "accel": "accelerometers"}
STATES = {CORRELATED_GNSS: "gnss_position", CORRELATED_VELOCITY: "correlated_velocity"}
"""States of a filter that causes add."""
WHITE = ("gyro", "accel")
"""Factors on white noise, in the order of `NOISE_GROUPS`."""
NEGLIGIBLE_SD = 1e-6
"""Factor on an sd that makes nothing of it, and leaves covariances positive."""


@dataclass(frozen=True)
class MotionError:
    """An error in no cause: of what, with what it grows, and its evidence, nats."""

    port: str
    grows_with: str
    evidence: float

    @property
    def text(self) -> str:
        """In words."""
        return f"{self.port} that {self.grows_with}"


def bias_columns(linearized: LinearizedRun) -> FloatArray:
    """Return what a bias of one unit between two fixes does to the errors, (k, n, 6): what it does as a state."""
    unit = linearized.transition[:, :, NAVIGATION_STATES : NAVIGATION_STATES + 6].copy()
    unit[:, NAVIGATION_STATES:] = 0.0
    return unit


Columns = tuple[FloatArray, FloatArray]
"""What c amplitudes add to errors between fixes, (k, n, c), and to fixes, (k, 6, c)."""


def groups(linearized: LinearizedRun) -> Iterator[tuple[str, dict[str, Columns]]]:
    """Yield what is wrong, with its columns by what it grows with; causes of the catalogue are left out."""
    motion = Motion.of(linearized)
    courses = covariates(motion)
    k, n = linearized.transition.shape[:2]
    unit = bias_columns(linearized)

    def on_sensors(push: FloatArray, *left_out: str) -> dict[str, Columns]:
        return {
            name: (
                np.concatenate([push * course[:, None, None] for course in of], axis=2),
                np.zeros((k, 6, push.shape[2] * len(of))),
            )
            for name, of in courses.items()
            if not name.startswith(("changes at", *left_out))
        }

    def on_fixes(shift: FloatArray, *only: str) -> dict[str, Columns]:
        return {
            name: (
                np.zeros((k, n, shift.shape[2] * len(of))),
                np.concatenate([shift * course[:, None, None] for course in of], axis=2),
            )
            for name, of in courses.items()
            if name.startswith(only or ("",))
        }

    yield (
        "an error of the gyroscopes",
        on_sensors(unit[:, :, :3], "grows with the force", "grows with the rate"),
    )
    yield "an error of the accelerometers", on_sensors(unit[:, :, 3:])
    for sensors, values in (("gyro", motion.rate), ("accel", motion.force)):
        own = list(columns_of(f"{sensors}_scale", linearized.parameters))
        push, none = linearized.B[:, :, own], np.zeros((k, 6, len(own)))
        felt = values[:, : len(own)]
        yield (
            f"a scale factor of the {SENSOR_NAMES[sensors]}",
            {
                "differs between directions": (push * np.sign(felt)[:, None, :], none),
                "grows with what is measured": (push * np.abs(felt)[:, None, :], none),
            },
        )
    three = np.zeros((k, 3, 3))
    north = np.broadcast_to(np.eye(3), (k, 3, 3))
    for what, rows in (("positions", 0), ("velocities", 3)):
        for axes, mat in (("", north), (" in axes of the vehicle", motion.mat)):
            parts = [mat, three] if rows == 0 else [three, mat]
            yield f"an error of the {what}{axes}", on_fixes(np.concatenate(parts, axis=1))
    in_time = ("changes at", "grows with time")
    for what, cause in (("a lever arm", "lever_arm"), ("a delay of the fixes", "time_offset")):
        own = list(columns_of(cause, linearized.parameters))
        yield what, on_fixes(linearized.D[:, :, own], *in_time)


def _whitened(noise: NoiseHypothesis, columns: Mapping[str, Columns]) -> dict[str, FloatArray]:
    """Return whitened columns (m, c) by name."""
    push = np.concatenate([one[0] for one in columns.values()], axis=2)
    shift = np.concatenate([one[1] for one in columns.values()], axis=2)
    names = tuple(Parameter("column", str(i)) for i in range(push.shape[2]))
    slope = whiten(
        replace(noise, linearized=replace(noise.linearized, parameters=names, B=push, D=shift))
    ).slope
    edges = np.cumsum([one[0].shape[2] for one in columns.values()])[:-1]
    return dict(zip(columns, np.split(slope, edges, axis=1), strict=True))


def _evidence(t: FloatArray, residual: FloatArray, s: FloatArray) -> float:
    """Return the log Bayes factor of columns, nats, the spread of their prior the best one."""
    information, b = s.T @ s, s.T @ residual
    if not np.any(information):
        return 0.0
    step = np.linalg.pinv(information, rcond=1e-9, hermitian=True) @ b
    k = s.shape[1]
    z2 = float(b @ step) / colour_factor(t, residual - s @ step, s)
    return 0.5 * (z2 - k - k * math.log(z2 / k)) if z2 > k else 0.0


@dataclass(frozen=True)
class Innovations:
    """Innovations in which errors are looked for: noise, whitened rows, what is fitted beside, nats to be beaten."""

    noise: NoiseHypothesis
    residual: FloatArray
    beside: FloatArray
    hurdle: float = 0.0

    @cached_property
    def _q(self) -> FloatArray:
        return np.linalg.qr(self.beside)[0]

    def left(self, s: FloatArray) -> FloatArray:
        """Return what is left of columns beside those that are fitted."""
        return np.asarray(s - self._q @ (self._q.T @ s))


def innovations(outcome: SearchResult) -> dict[str, Innovations]:
    """Return the innovations beside all that was found, by "", and as if one cause had not been found, by its code.

    What has to be beaten is the evidence for the cause where it is a constant or a jump, and the likelihood that its
    factors, or its states, gain where it is noise.
    """
    run, noise = outcome.final, as_configured(outcome.final.linearized)
    level, bias = evaluate(noise).value, run.hypothesis.errors_in_variables_bias
    found = dict(_shifts(outcome))
    gains: dict[str, float] = {}
    for one in outcome.accepted:
        gains[one.cause] = max(gains.get(one.cause, 0.0), one.candidate.result.gain)
    out = {}
    for cause, own in {"": noise, **dict(_without_noise(outcome, noise))}.items():
        w = whiten(own)
        residual = w.residual if bias is None else w.residual - w.slope @ bias
        slopes = _whitened(own, {c: columns for c, (columns, _) in found.items()}) if found else {}
        none = np.zeros((len(residual), 0))
        hurdle = level - evaluate(own).value if cause else 0.0
        out[cause] = Innovations(own, residual, np.column_stack([none, *slopes.values()]), hurdle)
        for shift in found if not cause else ():
            others = np.column_stack([none, *(s for c, s in slopes.items() if c != shift)])
            alone = Innovations(own, residual + slopes[shift] @ found[shift][1], others)
            least = _evidence(w.t, alone.left(alone.residual), alone.left(slopes[shift]))
            out[shift] = replace(alone, hurdle=max(least, gains.get(shift, 0.0)))
    return out


def _shifts(outcome: SearchResult) -> Iterator[tuple[str, tuple[Columns, FloatArray]]]:
    """Yield constants and jumps that were found: their columns, and the sizes that were taken out."""
    run, before = outcome.final, outcome.base.hypothesis.compensation
    linearized, after = run.linearized, run.hypothesis.compensation
    for cause in outcome.shifts:
        own = list(columns_of(cause, linearized.parameters))
        names = [linearized.parameters[i] for i in own]
        yield (
            cause,
            ((linearized.B[:, :, own], linearized.D[:, :, own]), after.vector(names) - before.vector(names)),
        )
    if run.hypothesis.jumps:
        unit = bias_columns(linearized)
        later = [
            unit[:, :, SENSORS[jump.sensor][0]] * (linearized.t > jump.time)[:, None, None]
            for jump in run.hypothesis.jumps
        ]
        push = np.concatenate(later, axis=2)
        sizes = np.concatenate([jump.size for jump in run.hypothesis.jumps])
        yield BIAS_JUMP, ((push, np.zeros((len(push), 6, push.shape[2]))), sizes)


def _without_noise(outcome: SearchResult, noise: NoiseHypothesis) -> Iterator[tuple[str, NoiseHypothesis]]:
    """Yield the noise without what each cause of noise changed."""
    linearized, layout = noise.linearized, outcome.final.settings.model.layout
    for one in outcome.accepted:
        if one.cause == "imu_noise_scale":
            factors = [one.parameters[name].value if name in one.parameters else 1.0 for name in WHITE]
            before = np.array([factor or 1.0 for factor in factors] + [1.0, 1.0])
            yield one.cause, replace(noise, process_noise_scale=noise.process_noise_scale / before)
        elif is_noise_scale(one.cause):
            said = linearized.reported_sd
            yield one.cause, replace(noise, sd=np.where(np.isfinite(said), said, noise.sd))
        elif STATES.get(one.cause, "") in layout:
            state = layout[STATES[one.cause]]
            initial = linearized.initial.copy()
            initial[state, :] *= NEGLIGIBLE_SD
            initial[:, state] *= NEGLIGIBLE_SD
            slow = {**linearized.noise, "gnss_position": NEGLIGIBLE_SD**2 * linearized.noise["gnss_position"]}
            yield one.cause, replace(noise, linearized=replace(linearized, initial=initial, noise=slow))


def motion_errors(outcome: SearchResult) -> dict[str, MotionError]:
    """Return the error with the largest evidence beside all that was found, by "", and in place of each cause."""
    return errors_in(innovations(outcome))


def errors_in(looked_at: Mapping[str, Innovations]) -> dict[str, MotionError]:
    """Return the error with the largest evidence in each of some innovations of one run.

    The evidence is less what it has to beat, and what the choice among all groups costs.
    """
    best = {name: MotionError("", "", -math.inf) for name in looked_at}
    count = 0
    first = next(iter(looked_at.values())).noise.linearized
    for port, columns in groups(first):
        count += len(columns)
        whitened: dict[int, dict[str, FloatArray]] = {}
        for name, one in looked_at.items():
            own = whitened.setdefault(id(one.noise), {}) or _whitened(one.noise, columns)
            whitened[id(one.noise)] = own
            rows = one.noise.counted
            t = np.broadcast_to(first.t[:, None], rows.shape)[rows]
            y = one.left(one.residual)
            for grows_with, s in own.items():
                evidence = _evidence(t, y, one.left(s))
                if evidence > best[name].evidence:
                    best[name] = MotionError(port, grows_with, evidence)
    paid = math.log(count) + SPREAD_COST
    return {
        name: replace(one, evidence=one.evidence - looked_at[name].hurdle - paid)
        for name, one in best.items()
    }
