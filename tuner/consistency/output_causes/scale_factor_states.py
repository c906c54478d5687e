"""Scale factors among the states of a filter whose output does not state them: six states more, three for each sensor.

Their errors δs turn with the rates and push with the specific force that the unit measures: φ' = −C diag(ω) δs,
v' = −C diag(f) δs. They are taken as first-order processes with the time constant of the gyro biases, as in filters
with one time constant for all; the sds are sought.
"""

from __future__ import annotations

import numpy as np

from models.arrays import FloatArray
from tuner.consistency.output_causes.course import Course


def with_scale_factors(
    course: Course, phi: FloatArray, noise: FloatArray, start: FloatArray, sd: FloatArray, time: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return transition, noise by source and start of 21 states; their noise joins that of the gyro biases.

    Parameters
    ----------
    course : Course
        The epochs.
    phi, noise, start : ndarray, shapes (k, 15, 15), (k, s, 15, 15), (15, 15)
        Without them.
    sd : ndarray, shape (2,)
        Of scale factors of gyros and accelerometers.
    time : float
        Their time constant, s.
    """
    dt = course.dt[:, None, None]
    mat = course.mat_nb
    rate, force = (np.einsum("kji,kj->ki", mat, x) for x in (course.rate, course.force))
    turns, pushes = mat * rate[:, None, :], mat * force[:, None, :]
    wide_phi = np.pad(phi, ((0, 0), (0, 6), (0, 6)))
    # The middle of the step stands for all of it: what φ gains from δs acts on the velocity half a step.
    wide_phi[:, 6:9, 15:18] = -dt * turns
    wide_phi[:, 3:6, 15:18] = 0.5 * phi[:, 3:6, 6:9] @ (-dt * turns)
    wide_phi[:, 3:6, 18:21] = -dt * pushes
    wide_phi[:, 0:3, 18:21] = -0.5 * dt**2 * pushes
    decay = np.exp(-course.dt / time)
    wide_phi[:, range(15, 21), range(15, 21)] = decay[:, None]
    variance = np.repeat(sd**2, 3)
    wide_noise = np.pad(noise, ((0, 0), (0, 0), (0, 6), (0, 6)))
    wide_noise[:, 2, range(15, 21), range(15, 21)] = (1.0 - decay**2)[:, None] * variance
    wide_start = np.pad(start, (0, 6))
    wide_start[range(15, 21), range(15, 21)] = variance
    return wide_phi, wide_noise, wide_start
