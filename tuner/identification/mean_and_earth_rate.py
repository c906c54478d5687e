"""The mean of a channel, what noise does to it, and how much of it is the turning Earth.

Allan variances cannot see a constant. The mean of a record of span T stands for the constant with the
uncertainty √AVAR(T) of the fitted noise: N/√T from white noise, 0.664 B from flicker however long the record,
K √(T/3) from a random walk, which a long record makes worse. s/√n would be right for white noise only.

A gyro at rest also measures the Earth. Its rate has the vertical component Ω sin φ, upwards in the north, and
Ω cos φ horizontally. Accelerometers at rest show which way is up, so that the vertical part can be taken
away; the horizontal part needs a heading, and stays in as a bound.

References
----------
.. [1] P. D. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd
   ed., 5.6.2.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from models.arrays import FloatArray
from models.earth import EARTH_RATE
from models.noise import NoiseModel, Ramp
from models.probability import normal_reach
from tuner.types import LEVEL, Coefficient

_GRAVITY_RANGE = (8.0, 11.5)
"""Length of a specific force that can be gravity alone, m/s²."""


def mean_of_noise(mean: float, model: NoiseModel, span: float, unit: str) -> Coefficient:
    """Return the mean of a record with the interval that the fitted noise gives it.

    Parameters
    ----------
    mean : float
        Mean of all samples, unit.
    model : NoiseModel
        Fitted noise; a ramp is not counted, the mean being that of the middle of the record.
    span : float
        Time covered by samples, s.
    unit : str
        Unit of the samples.
    """
    random = [term for term in model.terms if not isinstance(term, Ramp)]
    variance = sum(float(term.allan_variance(np.array([span]))[0]) for term in random)
    reach = float(normal_reach(LEVEL) * np.sqrt(variance))
    return Coefficient.known(mean, mean - reach, mean + reach, unit)


def without_earth_rate(
    means: Mapping[str, Coefficient], force: FloatArray | None, latitude: float | None
) -> tuple[dict[str, Coefficient], str]:
    """Subtract the Earth's rate, as far as it is known, from three gyro means.

    Parameters
    ----------
    means : mapping of str to Coefficient
        Means of the x, y and z gyros in this order, rad/s.
    force : ndarray, shape (3,), optional
        Mean specific force on the same axes, m/s².
    latitude : float, optional
        Degrees, north positive.

    Returns
    -------
    means : dict of str to Coefficient
        With intervals widened by what could not be taken out.
    note : str
        What was done, in words.
    """
    if latitude is None:
        reason = f"contains the Earth's rate, at most {EARTH_RATE:.3g} rad/s: no latitude was given"
        return {axis: replace(c, reason=reason) for axis, c in means.items()}, f"gyro mean {reason}"
    sine, cosine = float(np.sin(np.radians(latitude))), float(np.cos(np.radians(latitude)))
    length = 0.0 if force is None else float(np.linalg.norm(force))
    if force is None or not _GRAVITY_RANGE[0] < length < _GRAVITY_RANGE[1] or len(means) != 3:
        why = "accelerometers at rest" if len(means) == 3 else "three axes"
        note = f"the gyro means hold the Earth's rate, at most {EARTH_RATE:.3g} rad/s: no {why} to tell up"
        return {axis: _shifted(c, 0.0, EARTH_RATE, note) for axis, c in means.items()}, note
    up = force / length
    answer = {}
    for (axis, coefficient), share in zip(means.items(), up, strict=True):
        vertical = EARTH_RATE * sine * float(share)
        horizontal = EARTH_RATE * cosine * float(np.sqrt(max(1.0 - share**2, 0.0)))
        left = f"±{horizontal:.2g} rad/s of the horizontal may be left"
        reason = f"vertical Earth rate {vertical:.3g} rad/s taken out; {left}"
        answer[axis] = _shifted(coefficient, vertical, horizontal, reason)
    along = float(np.array([c.value or 0.0 for c in means.values()]) @ up)
    note = (
        f"gyro mean along the vertical of the accelerometers {along:.4g} rad/s; the Earth at {latitude:g}° "
        f"gives {EARTH_RATE * sine:.3g}; its horizontal {EARTH_RATE * cosine:.3g} rad/s needs a heading and "
        "widens the intervals"
    )
    return answer, note


def _shifted(coefficient: Coefficient, shift: float, widening: float, reason: str) -> Coefficient:
    if coefficient.value is None or coefficient.interval is None:
        return coefficient
    low, high = coefficient.interval
    value, ends = coefficient.value - shift, (low - shift - widening, high - shift + widening)
    return replace(coefficient, value=value, interval=ends, reason=reason)
