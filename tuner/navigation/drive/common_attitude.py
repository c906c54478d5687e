"""Attitude of a unit at one time, and its biases, from windows of a drive together.

Readings of a window say something of the attitude at its start and of the biases (`tuner.examination.fit`). The gyros
join the windows: with the attitude C₀ at the wanted time, the rotation R_k of the unit from then to the start of window
k by the gyros less their bias b_g, and the turn E_k of north, east, down in this time,

    C_k = E_k C₀ R_k(b_g)      φ_k = E_k φ₀ − E_k C₀ D_k δb_g      D_k = ∫ R dt

so that three small angles φ₀ and six biases are common to all windows; other unknowns of a window are eliminated.
Gauss–Newton finds the common ones. What a window would gain with values of its own has a Student distribution: a window
may be wrong. Covariances are those of the model and of the scatter of windows (sandwich; White 1982) together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models import rotation
from models.arrays import FloatArray, IntArray
from tuner.examination.fit import Fit, Linear, Placed, Problem
from tuner.examination.streams import Streams
from tuner.examination.windows import (
    ACCEL_BIAS,
    GYRO_BIAS,
    TURN,
    WINDOW_LENGTH,
    Inertial,
    Windows,
    averaged,
    motion_of,
    of_the_earth,
)

COMMON_UNKNOWNS = 9
"""What windows have in common: three angles, biases of accelerometers and of gyros."""
WINDOW_FREEDOM = 4.0
"""Degrees of freedom of the distribution of windows, and of the biases of gyros about their prior."""
MOST_STEPS, LEAST_GAIN = 20, 1e-3
"""Steps of Gauss–Newton, and the gain of one below which they end, nats."""
LARGEST_TURN, LEAST_SHARE = 0.5, 0.02
"""Turn of a step, rad, up to which it is taken as a whole, and the least share of it that is tried."""
VERTICAL_STARTS = 0.0, -1.0, 1.0, -2.0, 2.0, -3.0, 3.0
"""Biases of the vertical gyro to begin from, in prior sds."""
AMBIGUOUS_TURN = 0.1
"""Turn of a window by a bias of one prior sd from which several are tried, rad."""
RIVAL_NATS = 12.5
"""Log-likelihood ratio from which another heading is excluded, that of five sds, nats."""
FIXED_PRECISION = 1e12
"""Precision of what a window does not have for itself."""
LEAST_INFORMATION = 1e-9
"""Information of what nothing determines."""


@dataclass(frozen=True)
class BiasPrior:
    """What is known of the biases of accelerometers and gyros before any motion.

    Attributes
    ----------
    mean, sd : ndarray, shape (6,)
        m/s², rad/s.
    rest : tuple of ndarray or None
        Mean of the gyros at rest at the wanted time, shape (3,), rad/s, and its covariance, shape (3, 3).
    """

    mean: FloatArray
    sd: FloatArray
    rest: tuple[FloatArray, FloatArray] | None = None


@dataclass(frozen=True)
class Attitude:
    """Attitude and biases that windows have in common.

    Attributes
    ----------
    t : float
        Stamp of a sample, s.
    mat : ndarray, shape (3, 3)
        From the axes of the unit to north, east, down at this time.
    bias : ndarray, shape (6,)
        Of accelerometers and gyros, m/s², rad/s.
    covariance : ndarray, shape (9, 9)
        Of small turns in north, east, down, rad, and of the biases.
    cost : float
        Minus the logarithm of the likelihood, but for what all answers have in common, nats.
    """

    t: float
    mat: FloatArray
    bias: FloatArray
    covariance: FloatArray
    cost: float


def attitude_at(
    streams: Streams, windows: Windows, found: Fit, t: float, prior: BiasPrior
) -> Attitude | None:
    """Return the likeliest attitude at a time, s, from the fit of windows; None where none was fitted."""
    problem = Problem.of(streams, windows)
    return _Joint.of(problem, found, averaged(streams.imu), t, prior).solved() if len(found.begin) else None


@dataclass(frozen=True)
class _Step:
    """Attitude and biases, the next step from them, shape (9,), its gain, nats, their covariance and cost."""

    mat: FloatArray
    bias: FloatArray
    step: FloatArray
    gain: float
    covariance: FloatArray
    cost: float


@dataclass(frozen=True)
class _Joint:
    """Windows, and how they hang together."""

    problem: Problem
    found: Fit
    imu: Inertial
    at: IntArray  # (w + 1,) samples at the wanted time and at the start of each window
    turned: FloatArray  # (w, 3, 3): E
    earth: FloatArray  # (3,) rate of the Earth in north, east, down, rad/s
    prior: BiasPrior

    @staticmethod
    def of(problem: Problem, found: Fit, imu: Inertial, t: float, prior: BiasPrior) -> _Joint:
        times = np.append(t, problem.windows.begin)
        rows = np.clip(np.searchsorted(imu.t, times - 1e-9), 0, len(imu.t) - 1)
        some = slice(rows.min(), rows.max() + 1)
        rates, carried, _ = of_the_earth(problem.places, problem.speeds)
        turned = [np.eye(3)]
        between = np.vstack([rates[:1], 0.5 * (rates[1:] + rates[:-1])])
        for turn in rotation.mat_from_rotvec(-between * np.diff(times)[:, None]):
            turned.append(turn @ turned[-1])
        own = Inertial(imu.t[some], imu.rates[some], imu.many)
        return _Joint(
            problem, found, own, rows - rows.min(), np.array(turned[1:]), (carried - rates)[0], prior
        )

    def rotated(self, bias: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return R and D of each window by the gyros less a bias, shape (w, 3, 3)."""
        step = np.diff(self.imu.t)[:, None]
        mats = rotation.mat_from_quat(_attitudes((self.imu.rates[1:, :3] - bias) * step))
        sums = np.zeros_like(mats)
        np.cumsum(0.5 * (mats[1:] + mats[:-1]) * step[..., None], axis=0, out=sums[1:])
        here, others = self.at[0], self.at[1:]
        back = mats[here].T
        return back @ mats[others], back @ (sums[others] - sums[here])

    def equations(
        self, mats: FloatArray, turned: FloatArray, arms: FloatArray, bias: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return what windows say of φ₀ and biases about the attitudes `mats` and a bias, as `Problem.eliminated`.

        `turned` are E, `arms` E C₀ D.
        """
        x = self.found.solution.copy()
        x[:, TURN], x[:, ACCEL_BIAS], x[:, GYRO_BIAS] = 0.0, bias[:3], bias[3:]
        whole = x.copy()
        whole[:, TURN] = -arms @ bias[3:]
        precision = self.found.precision.copy()
        for common in (TURN, ACCEL_BIAS, GYRO_BIAS):
            precision[:, common] = FIXED_PRECISION

        def linear(one: Placed) -> Linear:
            motion = motion_of(one.at, mats, x)
            seen, k = one.stream.seen(motion)[1], one.at.window
            gyro = seen[..., GYRO_BIAS] - seen[..., TURN] @ arms[k]
            more = np.concatenate([seen[..., TURN] @ turned[k], seen[..., ACCEL_BIAS], gyro], axis=-1)
            return one.linear(motion, whole, more)

        return self.problem.eliminated(self.found, linear, precision, COMMON_UNKNOWNS)

    def solved(self) -> Attitude:
        """Return the answer by steps from the window that is surest of the heading, over ever more windows about it."""
        still = np.zeros_like(self.turned)
        own = rotation.mat_from_rotvec(self.found.solution[:, TURN]) @ self.found.attitude
        a, b, squares = self.equations(own, still + np.eye(3), still, np.zeros(6))
        inverse = np.linalg.inv(a + LEAST_INFORMATION * np.eye(COMMON_UNKNOWNS))
        least = squares - np.einsum("wi,wij,wj->w", b, inverse, b)
        start = int(np.argmin(inverse[:, 2, 2]))
        order = np.argsort(np.abs(np.arange(len(own)) - start), kind="stable")
        answers = []
        for first in self._first_biases(own[start][2]):
            mat = self.turned[start].T @ own[start] @ self.rotated(first[3:])[0][start].T
            bias, many = first, 1
            while many < 2 * len(own):
                many *= 2
                here = self._stepped(mat, bias, least, order[:many])
                mat, bias = here.mat, here.bias
            answers.append(here)
        best = min(answers, key=lambda one: one.cost)
        for turn in rotation.mat_from_rotvec([[0.0, 0.0, 0.5 * k * np.pi] for k in (1, 2, 3)]):
            answers.append(self._stepped(turn @ best.mat, best.bias, least, order))
        best = min(answers, key=lambda one: one.cost)
        # the heading may be that of any answer that is hardly less likely: a vehicle that moves evenly has many
        rivals = [one.mat @ best.mat.T for one in answers if one.cost < best.cost + RIVAL_NATS]
        covariance = best.covariance.copy()
        covariance[2, 2] += np.max(rotation.rotvec_from_mat(np.array(rivals))[:, 2] ** 2)
        return Attitude(float(self.imu.t[self.at[0]]), best.mat, best.bias, covariance, best.cost)

    def _first_biases(self, down: FloatArray) -> list[FloatArray]:
        """Return biases to begin from: gravity tells turns about level axes; about the vertical several may fit."""
        mean = self.prior.mean
        if self.prior.rest is not None:
            return [np.append(mean[:3], self.prior.rest[0])]
        about = np.append(np.zeros(3), float(self.prior.sd[3:].max()) * down)
        several = float(self.prior.sd[3:].max()) * WINDOW_LENGTH > AMBIGUOUS_TURN
        return [mean + k * about for k in (VERTICAL_STARTS if several else (0.0,))]

    def _stepped(self, mat: FloatArray, bias: FloatArray, least: FloatArray, some: IntArray) -> _Step:
        """Return the answer of some windows by steps that raise the likelihood."""
        here = self._at(mat, bias, least, some)
        for _ in range(MOST_STEPS):
            if here.gain < LEAST_GAIN:
                break
            share = min(1.0, LARGEST_TURN / max(float(np.linalg.norm(here.step[:3])), LEAST_INFORMATION))
            there = here
            while there.cost >= here.cost and share > LEAST_SHARE:
                turn = rotation.mat_from_rotvec(share * here.step[None, :3])[0]
                there = self._at(turn @ here.mat, here.bias + share * here.step[3:], least, some)
                share *= 0.4
            if there.cost >= here.cost:
                break
            here = there
        return here

    def _at(self, mat: FloatArray, bias: FloatArray, least: FloatArray, some: IntArray) -> _Step:
        turn, arm = self.rotated(bias[3:])
        attitude = self.turned @ mat
        information, score, squares = self.equations(attitude @ turn, self.turned, attitude @ arm, bias)
        now = np.append(np.zeros(3), bias)
        left = score - np.einsum("wij,j->wi", information, now)
        far = np.maximum(squares - (score + left) @ now - least, 0.0)[some]
        weight = (WINDOW_FREEDOM + COMMON_UNKNOWNS) / (WINDOW_FREEDOM + far)
        each = weight[:, None] * left[some]
        a = np.einsum("w,wij->ij", weight, information[some])
        y = each.sum(axis=0)
        z = (bias - self.prior.mean) / self.prior.sd
        known = (
            np.repeat([1.0, (WINDOW_FREEDOM + 3.0) / (WINDOW_FREEDOM + z[3:] @ z[3:])], 3) / self.prior.sd**2
        )
        a[range(3, 9), range(3, 9)] += known
        y[3:] += known * (self.prior.mean - bias)
        cost = 0.5 * (WINDOW_FREEDOM + COMMON_UNKNOWNS) * float(
            np.log1p(far / WINDOW_FREEDOM).sum()
        ) + 0.5 * float(z[:3] @ z[:3])
        cost += 0.5 * (WINDOW_FREEDOM + 3.0) * float(np.log1p(z[3:] @ z[3:] / WINDOW_FREEDOM))
        if self.prior.rest is not None:
            mean, covariance = self.prior.rest
            inverse, off = np.linalg.inv(covariance), mean - mat.T @ self.earth - bias[3:]
            by = np.hstack([mat.T @ rotation.skew(self.earth), np.zeros((3, 3)), np.eye(3)])
            a += by.T @ inverse @ by
            y += by.T @ inverse @ off
            cost += 0.5 * float(off @ inverse @ off + np.linalg.slogdet(covariance)[1])
        inverse = np.asarray(np.linalg.inv(a + LEAST_INFORMATION * np.eye(COMMON_UNKNOWNS)))
        scatter = each @ inverse
        step = inverse @ y
        return _Step(mat, bias, step, 0.5 * float(y @ step), inverse + scatter.T @ scatter, cost)


def _attitudes(angles: FloatArray) -> FloatArray:
    """Return the attitudes before, between and after turns (n, 3), rad; shape (n + 1, 4)."""
    quat = np.vstack([[1.0, 0.0, 0.0, 0.0], rotation.quat_from_rotvec(angles)])
    reach = 1
    while reach < len(quat):
        quat[reach:] = rotation.quat_multiply(quat[:-reach], quat[reach:])
        reach *= 2
    return np.asarray(quat / np.linalg.norm(quat, axis=1, keepdims=True))
