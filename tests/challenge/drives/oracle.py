"""Detectability of an effect on a drive: expected likelihood gain of a filter that knows the noise, nats.

The error of an estimate (position, velocity, φ-angle, biases) in north, east, down::

    δv' = f × φ + C (δf + b)     φ' = −ω_ie × φ − C (δω + b)     δp' = δv

in steps of 0.1 s. An effect of the mean kind gives the innovations a mean m, d = ½ Σ mᵀ S⁻¹ m: what the states
absorb is not in m. One of the covariance kind gives them the covariance C, and the filter that knows it S₁::

    d = ½ Σ [tr S⁻¹ C − dim + ln |S| − ln |S₁|]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from challenge.drives.earth import SPIN
from challenge.drives.scene import Scene
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

STEP = 0.1
SMALL = 1e-3
FLOOR_TIME = 100.0
"""Time over which a random walk stands for the flicker, s."""
START = (1.0, 0.1, np.radians(0.5), np.radians(3.0))
"""Sds at the start: position in sds of a fix, m/s, tilt, heading."""
GROUPS = {
    "time_offset": 1, "velocity_lag": 1, "lever_arm": 3, "gnss_frame": 3, "gyro_scale": 3, "accel_scale": 3,
    "misalignment": 3, "g_sensitivity": 9, "gravity": 1,
}  # fmt: skip
"""Causes of the mean kind and their numbers of parameters, in the order of the columns."""


def cross(a: FloatArray) -> FloatArray:
    """Return [a ×], (n, 3, 3)."""
    out = np.zeros((len(a), 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -a[:, 2], a[:, 1], -a[:, 0]
    return np.asarray(out - out.transpose(0, 2, 1))


@dataclass(frozen=True)
class Oracle:
    """A linear filter about the truth of a scene."""

    scene: Scene

    @property
    def every(self) -> int:
        """Steps between fixes."""
        return round(1.0 / (STEP * self.scene.gnss_rate))

    @cached_property
    def times(self) -> FloatArray:
        """Times of the fixes, (k,)."""
        return np.arange(1, int(self.scene.duration * self.scene.gnss_rate)) / self.scene.gnss_rate

    @cached_property
    def _middle(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Attitude (n, 3, 3), rates and forces (n, 6), Earth rate (n, 3) in the middle of each step."""
        n = len(self.times) * self.every
        state = self.scene.truth.state(STEP * (np.arange(n) + 0.5))
        attitude = np.einsum("nji,njk->nik", state.local, state.body)
        earth = np.einsum("nji,j->ni", state.local, SPIN)
        return attitude, np.hstack([state.omega, state.force]), earth

    @cached_property
    def _steps(self) -> tuple[FloatArray, FloatArray]:
        """Transition (n, 15, 15) and answer to sensor errors (n, 15, 6) of each step."""
        attitude, felt, earth = self._middle
        f = np.zeros((len(felt), 15, 15))
        f[:, 0:3, 3:6] = np.eye(3)
        f[:, 3:6, 6:9] = cross(np.einsum("nij,nj->ni", attitude, felt[:, 3:]))
        f[:, 3:6, 12:15] = attitude
        f[:, 6:9, 6:9] = -cross(earth)
        f[:, 6:9, 9:12] = -attitude
        g = np.zeros((len(felt), 15, 6))
        g[:, 6:9, :3] = -attitude
        g[:, 3:6, 3:] = attitude
        phi = np.eye(15) + STEP * f + 0.5 * STEP**2 * (f @ f)
        return phi, STEP * g + 0.5 * STEP**2 * (f @ g)

    def _by_fix(self, x: FloatArray) -> FloatArray:
        return x.reshape(len(self.times), self.every, *x.shape[1:])

    @cached_property
    def transition(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Φ and the noise of gyros, accelerometers, biases from fix to fix, (k, 15, 15) each."""
        phi, g = (self._by_fix(x) for x in self._steps)
        s = self.scene
        k = len(self.times)
        total = np.tile(np.eye(15), (k, 1, 1))
        noise = [np.zeros((k, 15, 15)) for _ in range(3)]
        drive = np.zeros((15, 15))
        for first, level in ((9, s.gyro_flicker), (12, s.accel_flicker)):
            own = np.arange(first, first + 3)
            drive[own, own] = (0.664 * level) ** 2 * 3.0 / FLOOR_TIME * STEP
        for j in range(self.every):
            a, b = phi[:, j], g[:, j]
            parts = [
                s.arw**2 / STEP * b[:, :, :3] @ b[:, :, :3].transpose(0, 2, 1),
                s.vrw**2 / STEP * b[:, :, 3:] @ b[:, :, 3:].transpose(0, 2, 1),
                np.broadcast_to(drive, (k, 15, 15)),
            ]
            noise = [a @ old @ a.transpose(0, 2, 1) + new for old, new in zip(noise, parts, strict=True)]
            total = a @ total
        return total, noise[0], noise[1], noise[2]

    @cached_property
    def H(self) -> FloatArray:
        """Derivative of a fix by the error, (k, 6, 15)."""
        state = self.scene.truth.state(self.times)
        attitude = np.einsum("nji,njk->nik", state.local, state.body)
        h = np.zeros((len(self.times), 6, 15))
        h[:, range(6), range(6)] = 1.0
        h[:, :3, 6:9] = cross(attitude @ np.array(self.scene.arm))
        return h

    @cached_property
    def start(self) -> FloatArray:
        """P at the start."""
        s = self.scene
        sd = np.concatenate(
            [START[0] * np.array(s.position_sd), np.full(3, START[1]), [START[2], START[2], START[3]],
             np.full(3, s.gyro_bias), np.full(3, s.accel_bias)]
        )  # fmt: skip
        return np.diag(sd**2)

    @cached_property
    def reported(self) -> FloatArray:
        """Sds of a fix, (6,)."""
        return np.array([*self.scene.position_sd, *self.scene.velocity_sd])

    @cached_property
    def base(self) -> tuple[FloatArray, FloatArray]:
        """Gains (k, 15, 6) and innovation covariances (k, 6, 6) of the filter as it is configured."""
        phi, *noise = self.transition
        q, r, p = sum(noise), np.diag(self.reported**2), self.start
        gains, s = np.empty((len(phi), 15, 6)), np.empty((len(phi), 6, 6))
        for i, h in enumerate(self.H):
            p = phi[i] @ p @ phi[i].T + q[i]
            s[i] = h @ p @ h.T + r
            gains[i] = np.linalg.solve(s[i], h @ p).T
            p = p - gains[i] @ h @ p
            p = 0.5 * (p + p.T)
        return gains, s

    def whitened(self, sensors: FloatArray, fixes: FloatArray) -> FloatArray:
        """Return the means of the whitened innovations, (6 k, p).

        Parameters
        ----------
        sensors : ndarray, shape (n, 6, p)
            Errors of the sensors in every step.
        fixes : ndarray, shape (k, 6, p)
            Errors of the fixes.
        """
        phi, g = (self._by_fix(x) for x in self._steps)
        pull, u = np.zeros((len(self.times), 15, sensors.shape[2])), self._by_fix(sensors)
        for j in range(self.every):
            pull = phi[:, j] @ pull + g[:, j] @ u[:, j]
        total, (gains, s) = self.transition[0], self.base
        mean, error = np.empty_like(fixes), np.zeros((15, sensors.shape[2]))
        for i, h in enumerate(self.H):
            error = total[i] @ error + pull[i]
            mean[i] = fixes[i] - h @ error
            error = error + gains[i] @ mean[i]
        root = np.linalg.cholesky(s)
        return np.asarray(np.linalg.solve(root, mean).reshape(-1, sensors.shape[2]))

    @cached_property
    def columns(self) -> FloatArray:
        """Whitened answers to a unit of every parameter of `GROUPS`, (6 k, p)."""
        attitude, felt, _ = self._middle
        n, k, p = len(felt), len(self.times), sum(GROUPS.values())
        sensors, fixes = np.zeros((n, 6, p)), np.zeros((k, 6, p))
        truth, arm, t = self.scene.truth, np.array(self.scene.arm), self.times
        local = truth.state(t).local

        def antenna(at: FloatArray, where: FloatArray) -> FloatArray:
            x, v = truth.antenna(at, where)
            return np.hstack([np.einsum("nji,nj->ni", local, x), v])

        here = antenna(t, arm)
        fixes[:, :, 0] = (antenna(t - SMALL, arm) - here) / SMALL
        fixes[:, 3:, 1] = fixes[:, 3:, 0]
        for a in range(3):
            fixes[:, :, 2 + a] = antenna(t, arm + np.eye(3)[a]) - here
            fixes[:, 3:, 5 + a] = np.cross(np.eye(3)[a], here[:, 3:])
            sensors[:, a, 8 + a] = felt[:, a]
            sensors[:, 3 + a, 11 + a] = felt[:, 3 + a]
            sensors[:, :3, 14 + a] = np.cross(np.eye(3)[a], felt[:, :3])
            for b in range(3):
                sensors[:, a, 17 + 3 * a + b] = felt[:, 3 + b]
        sensors[:, 3:, 26] = -attitude[:, 2, :]
        return self.whitened(sensors, fixes)

    def jump(self, time: float, size: FloatArray) -> FloatArray:
        """Return the whitened answer to a bias that jumps, (6 k,)."""
        n = len(self.times) * self.every
        late = STEP * (np.arange(n) + 0.5) > time
        sensors = np.where(late[:, None], size, 0.0)[:, :, None]
        return self.whitened(sensors, np.zeros((len(self.times), 6, 1)))[:, 0]

    def mean(self, cause: str, direction: FloatArray) -> FloatArray:
        """Return the whitened answer to a unit of a cause along a direction, (6 k,)."""
        return np.asarray(self.columns[:, group(cause)] @ direction)

    def rival(self, answer: FloatArray, cause: str, *besides: str) -> tuple[str, float]:
        """Return the other cause that explains an answer best, and the nats it leaves unexplained."""
        left: dict[str, float] = {}
        for other in GROUPS:
            if other not in (cause, *besides):
                which = [group(name) for name in (other, *besides) if name in GROUPS]
                x = np.hstack([self.columns[:, w] for w in which])
                scaled = x / np.maximum(np.linalg.norm(x, axis=0), 1e-300)
                rest = answer - scaled @ np.linalg.lstsq(scaled, answer, rcond=1e-10)[0]
                left[other] = 0.5 * float(rest @ rest)
        name = min(left, key=lambda other: left[other])
        return name, left[name]

    def divergence(
        self, noise: FloatArray, fixes: FloatArray, markov_sd: float = 0.0, markov_time: float = 1.0
    ) -> float:
        """Return the nats of a filter that knows the ratios of white noise (2,), of fix errors (6,), a Markov error."""
        phi, qg, qa, qb = self.transition
        q = noise[0] ** 2 * qg + noise[1] ** 2 * qa + qb
        gains, s = self.base
        r = np.diag((fixes * self.reported) ** 2)
        size = 18 if markov_sd else 15
        decay = np.exp(-1.0 / (self.scene.gnss_rate * markov_time))
        true, best = np.zeros((size, size)), np.zeros((size, size))
        true[:15, :15] = best[:15, :15] = self.start
        true[15:, 15:] = best[15:, 15:] = markov_sd**2 * np.eye(size - 15)
        f, h, turned = np.eye(size), np.zeros((6, size)), np.eye(size)
        w = np.zeros((size, size))
        w[15:, 15:] = markov_sd**2 * (1.0 - decay**2) * np.eye(size - 15)
        f[15:, 15:] *= decay
        h[:3, 15:] = np.eye(3)[:, : size - 15]
        total = 0.0
        for i in range(len(phi)):
            f[:15, :15], w[:15, :15], h[:, :15] = phi[i], q[i], self.H[i]
            true, best = f @ true @ f.T + w, f @ best @ f.T + w
            seen, known = h @ true @ h.T + r, h @ best @ h.T + r
            total += np.trace(np.linalg.solve(s[i], seen)) - 6.0
            total += np.linalg.slogdet(s[i])[1] - np.linalg.slogdet(known)[1]
            turned[:15] = np.eye(size)[:15] - gains[i] @ h
            true = turned @ true @ turned.T
            true[:15, :15] += gains[i] @ r @ gains[i].T
            best = best - best @ h.T @ np.linalg.solve(known, h @ best)
            best = 0.5 * (best + best.T)
        return 0.5 * float(total)

    def weights(self, row: int) -> float:
        """Return the median share of reported variance in the innovations of positions (0) or velocities (3)."""
        own = np.arange(row, row + 3)
        inverse = np.linalg.inv(self.base[1][:, own[:, None], own])
        return float(np.median(np.einsum("nii,i->n", inverse, self.reported[own] ** 2) / 3.0))


def group(cause: str) -> slice:
    """Return the columns of a cause."""
    first = 0
    for name, width in GROUPS.items():
        if name == cause:
            return slice(first, first + width)
        first += width
    raise KeyError(cause)
