"""Coarse quantization of the samples of a drive: where rounding is no white noise any more.

A step D above the sd σ of the samples of a calm second rounds most of them to one value: a bias below D/2 does not
show at rest, and the rounding error follows the motion instead of being white of variance D²/12.
"""

from __future__ import annotations

import numpy as np

from tuner.segments.quantizer import quantizer_step
from tuner.types.records import Drive

SENSORS = {"gyro": (slice(0, 3), "rad/s"), "accel": (slice(3, 6), "m/s²")}
"""Columns of the samples, and their units, by sensor."""
CALM_QUANTILE = 0.25
"""Quantile of the sds over seconds that stands for a calm one: a vehicle is calm in part of a drive only."""


def coarse_quantizer_notes(drive: Drive) -> tuple[str, ...]:
    """Return one note for each sensor whose quantization is coarse."""
    size = max(2, round(1.0 / float(np.median(np.diff(drive.imu_t)))))
    count = len(drive.rates) // size
    if not count:
        return ()
    sd = np.quantile(drive.rates[: count * size].reshape(count, size, 6).std(axis=1), CALM_QUANTILE, axis=0)
    steps = np.array([quantizer_step([column]) for column in drive.rates.T])
    notes = []
    for sensor, (at, unit) in SENSORS.items():
        step, usual = float(steps[at].max()), float(np.sqrt(np.mean(sd[at] ** 2)))
        if step > usual:
            notes.append(
                f"{sensor}: the samples are rounded to steps of {step:.3g} {unit}, their sd in a calm second is "
                f"{usual:.2g}: biases below half a step do not show at rest, and rounding is no white noise"
            )
    return tuple(notes)
