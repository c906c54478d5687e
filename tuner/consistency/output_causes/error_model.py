"""How likely the errors of a filter are, where something that it assumes is wrong: the likelihood of every hypothesis.

With the gains K of a filter (`filter_model`) its errors obey a linear model, whatever the truth is::

    e⁻ = Φ e⁺ + w        e⁺ = e⁻ − K (H e⁻ + v)        w ~ Q_true, v ~ R_true

so that they have a likelihood for any true noise, for processes that the filter lacks and for constants that act
through the fixes or on the output. The errors of position, velocity and attitude are seen with a small white error,
which stands for what the linear model leaves out. Without a truth the innovations z = H e⁻ + v are seen, and K z is
known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from tuner.consistency.constants import IN_FIXES, OF_FILTER
from tuner.consistency.output_causes.course import Course
from tuner.consistency.output_causes.filter_model import (
    FilterModel,
    filter_matrices,
    filter_run,
    start_covariance,
)
from tuner.consistency.output_causes.true_noise import TrueNoise
from tuner.consistency.output_errors import OutputErrors
from tuner.linear_run.likelihood import NoiseHypothesis, covariances, evaluate
from tuner.linear_run.linearized_run import LinearizedRun

MODEL_ERROR = 0.03
"""White error of what is seen, in sds of the filter: its sds are met to some per cent, and turns bend within a step."""
BODY_MODEL_ERROR = 0.1
"""The same of sizes where velocities are along the axes of the body: half of what drives their errors is taken as
noise of what measures them; it may be nearly all, by how often they are measured, and sizes came out 2 to 12 % off."""


@dataclass(frozen=True)
class ErrorModel:
    """A run, ready for its likelihood.

    Attributes
    ----------
    model : FilterModel
        What the filter assumes.
    course : Course
        The epochs, k of them. Where its velocities are along the axes of the body, the last source of process noise is
        what measures them.
    phi, gain, update : ndarray, shapes (k, n, n), (k, n, 6), (k, n, n)
        Transition, gains of the fixes, I − K H.
    errors : LinearizedRun
        The errors after the fixes, driven by four sources of process noise and two of fixes, all as assumed; B and D
        are what the constants of `OF_FILTER` do to them. What is seen of them has a white error.
    seen : LinearizedRun
        The same, or the innovations where no errors are known.
    places : tuple of slice
        Columns of B and D of each of `OF_FILTER`.
    """

    model: FilterModel
    course: Course
    phi: FloatArray
    gain: FloatArray
    update: FloatArray
    errors: LinearizedRun
    seen: LinearizedRun
    places: tuple[slice, ...]

    @property
    def by_innovations(self) -> bool:
        """Whether innovations are seen."""
        return self.seen is not self.errors

    def error_of(self, cause: str) -> float:
        """Return how far the model may take the size of a cause from the truth, relative.

        Of a time constant ÷ that assumed, the sds tell what is assumed as well as they do.
        """
        size = BODY_MODEL_ERROR if self.course.motion.of_body else MODEL_ERROR
        return math.hypot(size, float(self.model.log_time_sd.max())) if cause == "time_constant" else size

    def under(self, true: TrueNoise, *, of_errors: bool = False) -> NoiseHypothesis:
        """Return what is seen, or the errors in any case, under other noise."""
        run, update, scale = self.errors, self.update, [*true.density, *true.fixes]
        sd = run.sd
        if self.by_innovations and not of_errors:
            run, scale = self.seen, scale[:4]
            update = np.broadcast_to(np.eye(len(run.initial)), update.shape)
            sd = np.sqrt(run.sd**2 + np.repeat(true.fixes, 3) ** 2 * self.model.fix_variance)
        found, dt = NoiseHypothesis(run, sd, np.array(scale), run.used), self.course.dt[:, None]
        if true.time_ratio != (1.0, 1.0):
            # The true biases join, beside the errors of those of the assumed time constants.
            assumed, own = np.repeat(self.model.time_constant, 3), update[:, :, 9:15]
            variance = 0.5 * np.repeat(scale[2:4] * self.model.density[2:], 3) ** 2 * assumed
            decay = np.exp(-dt / (assumed * np.repeat(true.time_ratio, 3)))
            cross = np.zeros((len(run.initial), 6))
            cross[range(9, 15), range(6)] = np.minimum(np.diag(self.errors.initial)[9:15], variance)
            scale[2:4] = 0.0, 0.0
            found = replace(found, process_noise_scale=np.array(scale))
            return _widened(
                found, decay, variance, own * (decay - np.exp(-dt / assumed))[:, None], own, cross
            )
        if true.extra is None:
            return found
        place, process = true.extra
        decay = np.exp(-dt / process.time_constant) * np.ones(3)
        into = -self.gain[:, :, :3]
        push = into * decay[:, None]
        if place != "fixes":  # of a sensor, it acts as the bias does
            first = 9 if place == "gyro" else 12
            into, push = 0.0 * into, update[:, :, :9] @ self.phi[:, :9, first : first + 3]
        return _widened(found, decay, np.full(3, process.sd**2), push, into, np.zeros((len(run.initial), 3)))

    def deviance(self, true: TrueNoise) -> float:
        """Return −2 ln of the likelihood."""
        return -2.0 * evaluate(self.under(true)).value

    def variances(self, true: TrueNoise) -> FloatArray:
        """Return the mean variances of the 15 errors in the second half of the run."""
        noise = self.under(true, of_errors=True)
        p = covariances(replace(noise, rows=np.zeros_like(noise.rows)))
        return np.asarray(np.einsum("kii->ki", p)[len(p) // 2 :, :15].mean(axis=0))


def _widened(
    noise: NoiseHypothesis,
    decay: FloatArray,
    variance: FloatArray,
    push: FloatArray,
    into: FloatArray,
    cross: FloatArray,
) -> NoiseHypothesis:
    """Return the noise of a run with m further stationary first-order states behind its own.

    Parameters
    ----------
    noise : NoiseHypothesis
        Of n states.
    decay, variance : ndarray, shapes (k, m), (m,)
        Of the further states.
    push, into : ndarray, shapes (k, n, m)
        What they, and the noise that drives them, do to the others.
    cross : ndarray, shape (n, m)
        Covariance with the others at the start.
    """
    run, (k, n, m) = noise.linearized, push.shape
    transition, both = np.zeros((k, n + m, n + m)), np.zeros((k, n + m, m))
    transition[:, :n, :n], transition[:, :n, n:], both[:, :n] = run.transition, push, into
    transition[:, range(n, n + m), range(n, n + m)] = decay
    both[:, n:] = np.eye(m)
    q = (both * ((1.0 - decay**2) * variance)[:, None]) @ np.swapaxes(both, -1, -2)
    q[:, :n, :n] += noise.process_noise
    more = (0, m)
    wide = replace(
        run,
        transition=transition,
        noise={"all": q},
        H=np.pad(run.H, ((0, 0), (0, 0), more)),
        B=np.pad(run.B, ((0, 0), more, (0, 0))),
        correction=np.pad(run.correction, ((0, 0), more)),
        initial=np.block([[run.initial, cross], [cross.T, np.diag(variance)]]),
        sparse_cache={},
    )
    return replace(noise, linearized=wide, process_noise_scale=np.ones(1))


def error_model(run: OutputErrors, course: Course, model: FilterModel) -> ErrorModel:
    """Return a run with the gains of a filter, ready for the likelihood of its errors, or else of its innovations."""
    phi, noise, start = filter_matrices(
        course, model, start_covariance(run, course, without_attitude=model.without_attitude)
    )
    if course.motion.of_body:
        # Half of what drives errors of a random walk that is measured often is that of the measurements.
        noise[:, 1] *= 0.5
        noise[:, 3] = noise[:, 1]
    covariance, gain = filter_run(course, model, phi, noise, start)
    rows, (k, n) = course.rows[1:], phi.shape[:2]
    update = np.tile(np.eye(n), (k, 1, 1))
    update[:, :, :6] -= gain
    sources = {str(s): update @ noise[:, s] @ np.swapaxes(update, -1, -2) for s in range(4)}
    for name, own in (("position fixes", slice(0, 3)), ("velocity fixes", slice(3, 6))):
        part = gain[:, :, own]
        sources[name] = (part * model.fix_variance[own]) @ np.swapaxes(part, -1, -2)
    sds = np.sqrt(np.einsum("kii->ki", covariance)[:, :9])
    sds[sds == 0.0] = 1.0  # what the filter has no state for has no errors either
    stated = np.einsum("kii->ki", run.covariance)[rows, :9]
    by_fixes, outputs, places = _regressors(course)
    error = run.error[rows, :9]
    known, white = np.isfinite(error), MODEL_ERROR * np.sqrt(np.where(stated > 0.0, stated, sds**2))
    h, zeros = np.tile(np.eye(9, n), (k, 1, 1)), np.zeros((k, n))
    errors = LinearizedRun(
        run.t[rows], update @ phi, sources, h, np.nan_to_num(error), white, white, known, known, zeros, start, (),
        np.ascontiguousarray(-gain @ by_fixes), outputs, np.zeros(k, dtype=bool),
    )  # fmt: skip
    seen = errors
    if not known.any():
        there = np.isfinite(run.estimate.innovation[rows])
        innovation = np.nan_to_num(run.estimate.innovation[rows])
        seen = replace(
            errors,
            transition=phi,
            noise={str(s): np.ascontiguousarray(noise[:, s]) for s in range(4)},
            H=np.ascontiguousarray(h[:, :6]),
            innovation=innovation,
            sd=MODEL_ERROR * sds[:, :6],
            available=there,
            used=there,
            # Innovations are of the errors before the fix, by which the filter changes its estimate.
            correction=np.einsum("kij,kj->ki", gain, innovation),
            B=np.zeros_like(errors.B),
            D=by_fixes,
            sparse_cache={},
        )
    return ErrorModel(model, course, phi, gain, update, errors, seen, places)


def _regressors(course: Course) -> tuple[FloatArray, FloatArray, tuple[slice, ...]]:
    """Return what `OF_FILTER` do to fixes, (k, 6, m), and to output errors, (k, 9, m), and their columns."""
    each = [one.columns(course.motion) for one in OF_FILTER]
    through = [one.subject in IN_FIXES for one in OF_FILTER]
    fixes = np.concatenate([-of[:, :6] * fix for of, fix in zip(each, through, strict=True)], axis=2)
    if course.motion.of_body:
        # Velocities are measured by something else than the positions: nothing moves them.
        fixes[:, 3:] = 0.0
    outputs = np.concatenate([of * (not fix) for of, fix in zip(each, through, strict=True)], axis=2)
    ends = np.cumsum([0, *(of.shape[2] for of in each)]).tolist()
    return fixes, outputs, tuple(map(slice, ends[:-1], ends[1:]))
