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
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.arrays import FloatArray
from tuner.consistency.output_causes.course import Course
from tuner.consistency.output_causes.filter_model import FilterModel, filter_matrices, start_covariance
from tuner.consistency.output_causes.kernels import covariance_recursion, error_likelihood
from tuner.consistency.output_causes.true_noise import ExtraProcess, TrueNoise
from tuner.consistency.output_errors import OutputErrors

MODEL_ERROR = 0.03
"""White error of what is seen, in sds of the filter: its sds are met to some per cent, and turns bend within a step."""
BODY_MODEL_ERROR = 0.1
"""The same of sizes where velocities are along the axes of the body: half of what drives their errors is taken as
noise of what measures them; it may be nearly all, by how often they are measured, and sizes came out 2 to 12 % off."""
REGRESSORS: Mapping[str, slice] = {
    "delay of fixes": slice(0, 1),
    "delay of output": slice(1, 2),
    "lever arm of fixes": slice(2, 5),
    "lever arm of output": slice(5, 8),
    "offset of positions": slice(8, 11),
    "rotation of positions": slice(8, 14),
    "rotation of body": slice(14, 17),
}
"""Constants that may act, and their columns; a rotation is about any point, so that an offset joins it."""
REGRESSOR_COUNT = 17
"""Columns of all of them."""


@dataclass(frozen=True)
class _System:
    """Dynamics, noise and start of the errors and of what drives them; (k, n, n) twice, (n, n)."""

    dynamics: FloatArray
    noise: FloatArray
    start: FloatArray


@dataclass(frozen=True)
class ErrorModel:
    """A run, ready for its likelihood.

    Attributes
    ----------
    model : FilterModel
        What the filter assumes.
    phi, noise : ndarray, shapes (k, n, n), (k, 4, n, n)
        Transition, and process noise of the assumed densities by source.
    gain : ndarray, shape (k, n, 6)
        Gains of the fixes.
    start : ndarray, shape (n, n)
        Covariance at the first epoch.
    seen, variance : ndarray, shapes (k, c)
        What is seen, and the variance of the white error with which it is.
    known : ndarray of bool, shape (k, c)
        Where it is.
    shift : ndarray, shape (k, n)
        Known changes of the errors.
    inputs, outputs : ndarray, shapes (k, n, m), (k, c, m)
        What the constants of `REGRESSORS` do to the errors, and to what is seen of them.
    sds : ndarray, shape (k, 9)
        Of position, velocity and attitude, as predicted.
    course : Course
        The epochs, k of them. Where its velocities are along the axes of the body, the last source of process noise is
        what measures them.
    by_innovations : bool
        Whether innovations are seen.
    """

    model: FilterModel
    phi: FloatArray
    noise: FloatArray
    gain: FloatArray
    start: FloatArray
    seen: FloatArray
    variance: FloatArray
    known: NDArray[np.bool_]
    shift: FloatArray
    inputs: FloatArray
    outputs: FloatArray
    sds: FloatArray
    course: Course
    by_innovations: bool

    def error_of(self, cause: str) -> float:
        """Return how far the model may take the size of a cause from the truth, relative.

        Of a time constant ÷ that assumed, the sds tell what is assumed as well as they do.
        """
        size = BODY_MODEL_ERROR if self.course.of_body else MODEL_ERROR
        return math.hypot(size, float(self.model.log_time_sd.max())) if cause == "time_constant" else size

    @property
    def count(self) -> int:
        """States of the filter: 15, or 21 with scale factors."""
        return len(self.start)

    def deviance(self, true: TrueNoise) -> float:
        """Return −2 ln of the likelihood, up to a constant."""
        return self._likelihood(true, 0)[0]

    def regression(self, true: TrueNoise) -> tuple[float, FloatArray]:
        """Return the same, and the products of whitened data and regressors, shape (1 + m, 1 + m)."""
        return self._likelihood(true, self.inputs.shape[2])

    def variances(self, true: TrueNoise) -> FloatArray:
        """Return the mean variances of the 15 errors in the second half of the run."""
        system = self._by_errors._system(true)
        p, found, half = system.start, np.zeros(15), len(self.course.dt) // 2
        for k in range(len(self.course.dt)):
            p = system.dynamics[k] @ p @ system.dynamics[k].T + system.noise[k]
            if k >= half:
                found += np.diag(p)[:15]
        return found / (len(self.course.dt) - half)

    def response(self, constants: FloatArray) -> FloatArray:
        """Return the mean of the errors of position, velocity and attitude that constants (m,) make; (k, 9)."""
        mean, found = np.zeros(self.count), np.zeros((len(self.course.dt), 9))
        through = self.inputs @ constants
        if self.by_innovations:
            through = -np.einsum("kij,kj->ki", self.gain, self.outputs @ constants)
        dynamics = self._by_errors._own_dynamics
        for k in range(len(self.course.dt)):
            mean = dynamics[k] @ mean + through[k]
            found[k] = mean[:9]
        return found if self.by_innovations else found + self.outputs @ constants

    def _likelihood(self, true: TrueNoise, regressors: int) -> tuple[float, FloatArray]:
        system = self._system(true)
        k, n, _ = system.dynamics.shape
        inputs, shift = np.zeros((k, n, regressors)), np.zeros((k, n))
        inputs[:, : self.count] = self.inputs[:, :, :regressors]
        shift[:, : self.count] = self.shift
        variance = self.variance
        if self.by_innovations:
            variance = variance + np.repeat(true.fixes, 3) ** 2 * self.model.fix_variance
        logs, products = error_likelihood(
            system.dynamics,
            system.noise,
            shift,
            system.start,
            self.seen,
            variance,
            self.known,
            inputs,
            np.ascontiguousarray(self.outputs[:, :, :regressors]),
        )
        return float(logs + products[0, 0]), np.asarray(products)

    @cached_property
    def _by_errors(self) -> ErrorModel:
        """The model of which the errors after the fixes are seen."""
        return replace(self, by_innovations=False) if self.by_innovations else self

    @cached_property
    def _update(self) -> FloatArray:
        """I − K H of what happens to the errors between what is seen of them; I for innovations; shape (k, n, n)."""
        update = np.tile(np.eye(self.count), (len(self.course.dt), 1, 1))
        if not self.by_innovations:
            update[:, :, :6] -= self.gain
        return update

    @cached_property
    def _own_dynamics(self) -> FloatArray:
        """Dynamics of the errors where the filter lacks no process, shape (k, n, n)."""
        return np.asarray(self._update @ self.phi)

    @cached_property
    def _own_noise(self) -> FloatArray:
        """Their noise by source, of the fixes last, shape (4 + 2, k, n, n)."""
        mats = [self._update @ self.noise[:, s] @ np.swapaxes(self._update, -1, -2) for s in range(4)]
        for own in (slice(0, 3), slice(3, 6)):
            part = self.gain[:, :, own] * (not self.by_innovations)
            mats.append((part * self.model.fix_variance[own]) @ np.swapaxes(part, -1, -2))
        return np.stack(mats)

    def _system(self, true: TrueNoise) -> _System:
        if true.extra is None and true.time_ratio == (1.0, 1.0):
            squares = np.array([*true.density, *true.fixes]) ** 2
            noise = np.tensordot(squares, self._own_noise, 1)
            return _System(self._own_dynamics, noise, self.start)
        noise = np.einsum("s,ksij->kij", np.array(true.density) ** 2, self.noise)
        system = _System(self.phi, noise, self.start)
        if true.time_ratio != (1.0, 1.0):
            system = self._with_true_biases(system, true)
        elif true.extra is not None:
            system = self._with_extra(system, true.extra)
        if self.by_innovations:
            return system
        n = system.dynamics.shape[1]
        wide = np.tile(np.eye(n), (len(self.course.dt), 1, 1))
        wide[:, : self.count, : self.count] = self._update
        if true.extra is not None and true.extra.place == "fixes":
            wide[:, : self.count, self.count :] = -self.gain[:, :, :3]
        r = np.repeat(true.fixes, 3) ** 2 * self.model.fix_variance
        after = wide @ system.noise @ np.swapaxes(wide, -1, -2)
        after[:, : self.count, : self.count] += (self.gain * r) @ np.swapaxes(self.gain, -1, -2)
        return _System(wide @ system.dynamics, after, system.start)

    def _widened(self, system: _System, decay: FloatArray, variance: FloatArray) -> _System:
        """Return the system with further stationary first-order states behind those of the filter."""
        more = (0, len(variance))
        dynamics, noise = (np.pad(mats, ((0, 0), more, more)) for mats in (system.dynamics, system.noise))
        start, new = np.pad(system.start, more), range(self.count, self.count + len(variance))
        dynamics[:, new, new] = decay
        noise[:, new, new] = (1.0 - decay**2) * variance
        start[new, new] = variance
        return _System(dynamics, noise, start)

    def _with_extra(self, system: _System, extra: ExtraProcess) -> _System:
        """Return the system with a process that the filter lacks; of a sensor, it acts as the bias does."""
        decay = np.exp(-self.course.dt / extra.time_constant)[:, None] * np.ones(3)
        wide = self._widened(system, decay, np.full(3, extra.sd**2))
        if extra.place != "fixes":
            first = 9 if extra.place == "gyro" else 12
            wide.dynamics[:, :9, self.count :] = self.phi[:, :9, first : first + 3]
        return wide

    def _with_true_biases(self, system: _System, true: TrueNoise) -> _System:
        """Return the system with the true biases, whose time constants are not those assumed."""
        assumed = np.repeat(self.model.time_constant, 3)
        constant = assumed * np.repeat(true.time_ratio, 3)
        scale = np.array(true.density[2:])
        density = np.repeat(scale * self.model.density[2:], 3)
        variance = 0.5 * density**2 * assumed
        decay = np.exp(-self.course.dt[:, None] / constant)
        wide = self._widened(system, decay, variance)
        own, biases = range(9, 15), range(self.count, self.count + 6)
        increment = (1.0 - decay**2) * variance
        wide.dynamics[:, own, biases] = decay - np.exp(-self.course.dt[:, None] / assumed)
        wide.noise[:, :15, :15] -= np.einsum("s,ksij->kij", scale**2, self.noise[:, 2:, :15, :15])
        wide.noise[:, own, own] += increment
        wide.noise[:, own, biases] = wide.noise[:, biases, own] = increment
        known = np.minimum(np.diag(self.start)[9:15], variance)
        wide.start[own, biases] = wide.start[biases, own] = known
        return wide


def error_model(run: OutputErrors, course: Course, model: FilterModel) -> ErrorModel:
    """Return a run with the gains of a filter, ready for the likelihood of its errors, or else of its innovations."""
    phi, noise, start = filter_matrices(
        course, model, start_covariance(run, course, without_attitude=model.without_attitude)
    )
    if course.of_body:
        # Half of what drives errors of a random walk that is measured often is that of the measurements.
        noise[:, 1] *= 0.5
        noise[:, 3] = noise[:, 1]
    n = len(start)
    covariance, gain = covariance_recursion(phi, noise, course.fixed, model.fix_variance, start)
    rows = course.rows[1:]
    sds = np.sqrt(np.einsum("kii->ki", covariance)[:, :9])
    sds[sds == 0.0] = 1.0  # what the filter has no state for has no errors either
    by_fixes, outputs = _regressors(course)
    error = run.error[rows, :9]
    by_innovations = not np.isfinite(error).any()
    shift = np.zeros((len(phi), n))
    if by_innovations:
        seen = run.estimate.innovation[rows]
        known = np.isfinite(seen)
        seen = np.where(known, seen, 0.0)
        # Innovations are of the errors before the fix: the change by the fix belongs to the step after it.
        shift[1:] = -np.einsum("kij,kjl,kl->ki", phi[1:], gain[:-1], seen[:-1])
        inputs = np.zeros((len(phi), n, REGRESSOR_COUNT))
        outputs = by_fixes
        variance = MODEL_ERROR**2 * sds[:, :6] ** 2
    else:
        known = np.isfinite(error)
        seen = np.where(known, error, 0.0)
        inputs = -gain @ by_fixes
        stated = np.einsum("kii->ki", run.covariance)[rows, :9]
        variance = MODEL_ERROR**2 * np.where(stated > 0.0, stated, sds**2)
    return ErrorModel(
        model,
        phi,
        np.ascontiguousarray(noise),
        gain,
        start,
        seen,
        variance,
        known,
        shift,
        np.ascontiguousarray(inputs),
        np.ascontiguousarray(outputs),
        sds,
        course,
        by_innovations,
    )


def _regressors(course: Course) -> tuple[FloatArray, FloatArray]:
    """Return what constants do to fixes, (k, 6, m), and to output errors, (k, 9, m)."""
    k, at = len(course.dt), REGRESSORS
    fixes, outputs = np.zeros((k, 6, REGRESSOR_COUNT)), np.zeros((k, 9, REGRESSOR_COUNT))
    motion = np.concatenate([course.vel, course.acc, course.rate], axis=1)[:, :, None]
    fixes[:, :, at["delay of fixes"]] = -motion[:, :6]
    outputs[:, :, at["delay of output"]] = motion
    arm = np.concatenate([course.body, rotation.skew(course.rate) @ course.body], axis=1)
    fixes[:, :, at["lever arm of fixes"]] = arm
    outputs[:, :6, at["lever arm of output"]] = -arm
    if course.of_body:  # velocities are measured by something else than the positions: nothing moves them
        fixes[:, 3:] = 0.0
        motion_of_body = course.acc - np.cross(course.rate, course.vel)
        outputs[:, 3:6, at["delay of output"]] = motion_of_body[:, :, None]
        outputs[:, 3:6, at["lever arm of output"]] = -rotation.skew(course.rate) @ course.body
    fixes[:, :3, at["offset of positions"]] = np.eye(3)
    place = np.cumsum(course.vel * course.dt[:, None], axis=0)
    turn = np.concatenate([-rotation.skew(place - place.mean(axis=0)), -rotation.skew(course.vel)], axis=1)
    turn[:, 3:] *= not course.of_body
    fixes[:, :, at["rotation of positions"].stop - 3 : at["rotation of positions"].stop] = turn
    outputs[:, 6:, at["rotation of body"]] = course.body
    return fixes, outputs
