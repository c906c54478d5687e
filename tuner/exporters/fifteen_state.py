"""The plain filter of 15 states: Q a second and a step, R and P0 as diagonals, and the Gauss–Markov parameters.

The states are errors of position, velocity and attitude, and biases of gyros and accelerometers, each a random walk::

    Q_per_second  velocity N²  attitude N²  gyro_bias K²  accel_bias K²  (spectral densities, two-sided)
    Q_per_step    the same × the sampling interval: what a filter adds each sample
    R             sd² of a fix, and of errors of the receiver that last, for which there is no state
    P0            sd² at the start; of a bias its constant and its Gauss–Markov states together

The noise of velocity and attitude is that of the axes of the unit; of three that are alike it is that of any. N and K
stand for all terms of the bias (`tuner.synthesis.projection`): N as measured beside a small K predicts too
little drift. A filter with Gauss–Markov states takes `gauss_markov`, its N and K included: b(k+1) = φ b(k) + w,
φ = exp(−dt/T), var w = σ² (1 − φ²). `diagonals` has the same as arrays.

Source: P. D. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed., 14.2.6.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.units import unit_of_samples
from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import initial_bias_sd, limited, triad, triple
from tuner.formats.digits import rounded
from tuner.formats.yaml_text import Inline, Noted, yaml_text
from tuner.types import ChannelNoise, FilterConfig

STATES = ("position", "velocity", "attitude", "gyro_bias", "accel_bias")
"""Names of the states, three each, in order."""
PER_SECOND = {"velocity": "m²/s³", "attitude": "rad²/s", "gyro_bias": "rad²/s³", "accel_bias": "m²/s⁵"}
SQUARES = {
    "position": "m²; north, east, down",
    "velocity": "m²/s²; north, east, down",
    "attitude": "rad²; roll, pitch, yaw",
    "gyro_bias": "rad²/s²; x, y, z",
    "accel_bias": "m²/s⁴; x, y, z",
}
PER_STEP = {name: SQUARES[name].partition(";")[0] for name in PER_SECOND}
"""Units of Q a second, of R and P0, and of Q a step."""


def diagonals(config: FilterConfig, target: Target) -> Mapping[str, FloatArray]:
    """Return Q a second, Q a step and P0, shape (15,), and R, shape (6,), or (0,) without a receiver; SI, by name."""
    gyro, accel = triad(config, "gyro"), triad(config, "accel")
    first, gnss = config.initial, config.gnss
    drive = np.zeros(15)
    for row, channels in ((3, accel), (6, gyro)):
        drive[row : row + 3], _ = triple(channels, lambda c: target.white_density(c) ** 2, "")
    for row, channels in ((9, gyro), (12, accel)):
        drive[row : row + 3], _ = triple(channels, lambda c: target.bias(c) ** 2, "")
    start = np.array([*[first.position] * 3, *[first.velocity] * 3, first.tilt, first.tilt, first.heading])
    biases = [value for channels in (gyro, accel) for value in triple(channels, initial_bias_sd, "")[0]]
    fix = np.zeros(0)
    if gnss is not None:
        lasting = sum(state.sd**2 for state in gnss.correlated)
        down = np.array([1.0, 1.0, gnss.correlated_down**2])
        fix = np.concatenate(
            [np.square(gnss.position_sd) + lasting * down, np.square(gnss.velocity_sd or ())]
        )
    return {
        "Q_per_second": drive,
        "Q_per_step": drive * target.interval,
        "R": fix,
        "P0": np.concatenate([start, biases]) ** 2,
    }


def write(config: FilterConfig, target: Target) -> str:
    """Return the table as YAML."""
    found = diagonals(config, target)

    def rows(values: FloatArray, units: Mapping[str, str]) -> dict[str, Noted]:
        return {
            name: Noted(Inline([rounded(x) for x in values[3 * i : 3 * i + 3].tolist()]), units[name])
            for i, name in enumerate(STATES)
            if name in units and 3 * i < len(values)
        }

    walks = {
        f"{sensor}_bias": limited(config, triad(config, sensor), PER_SECOND[f"{sensor}_bias"])
        for sensor in ("gyro", "accel")
    }
    tree: dict[str, Any] = {
        "states": Inline(list(STATES)),
        "interval": Noted(rounded(target.interval), "s; of a step"),
        "Q_per_second": rows(found["Q_per_second"], {**PER_SECOND, **walks}),
        "Q_per_step": rows(found["Q_per_step"], PER_STEP),
        "gauss_markov": {
            axis: _markov(channel, target.interval) for axis, channel in config.channels.items()
        },
        "P0": rows(found["P0"], SQUARES),
    }
    if len(found["R"]):
        tree["R"] = rows(found["R"], {name: SQUARES[name] for name in STATES[:2]})
    title = "15 states: diagonals of Q, R and P0 in SI units; position has no noise of its own"
    other = "gauss_markov, for filters with these states, stands in place of N and K of Q, not beside them"
    return yaml_text(tree, header=(*provenance(config, title, target), other))


def _markov(channel: ChannelNoise, interval: float) -> dict[str, Any]:
    """Return N, K, and σ, T, φ and the sd of the noise of a step of each Gauss–Markov state of an axis."""
    states = []
    for state in channel.markov:
        phi = math.exp(-interval / state.time_constant)
        step = state.sd * math.sqrt(-math.expm1(-2.0 * interval / state.time_constant))
        numbers = {"sd": rounded(state.sd), "T": rounded(state.time_constant)}
        states.append(Inline({**numbers, "phi": rounded(phi, digits=9), "step_sd": rounded(step)}))
    unit = unit_of_samples(channel.axis)
    return {
        "N": Noted(rounded(channel.white_density), f"{unit}/√Hz"),
        "K": Noted(rounded(channel.random_walk_density), f"{unit}/√s"),
        "states": states,
    }


DIALECT = Dialect(
    "15-state", "Q, R and P0 of a filter of 15 states", "SI, squares; a second and a step", write
)
