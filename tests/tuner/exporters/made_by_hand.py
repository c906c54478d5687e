"""A configuration made by hand, and what each dialect writes of it.

N = 2e-4 rad/s/√Hz and 3e-3 m/s²/√Hz, one Gauss–Markov state each, 100 Hz.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace

import pytest
import yaml

from models.noise import GaussMarkov
from tuner.exporters import export
from tuner.formats.digits import DEFAULT_DIGITS
from tuner.types import ChannelNoise, Enlargement, FilterConfig, GnssNoise, InitialUncertainty, Quantity

DT = 0.01

STEP = 0.008

TIME = 1800.0

N_GYRO, S_GYRO, B_GYRO = 2e-4, 5e-5, 1e-3

N_ACCEL, S_ACCEL, B_ACCEL = 3e-3, 4e-4, 0.05


def channel(axis: str, white: float, sd: float, constant: float, unit: str) -> ChannelNoise:
    return ChannelNoise(axis, unit, white, (GaussMarkov(sd, TIME),), 0.0, constant)


def make(*, spread: float = 0.0) -> FilterConfig:
    factors = dict(zip("xyz", (1.0 - spread, 1.0, 1.0 + spread), strict=True))
    gyro = [channel(f"gyro_{a}", f * N_GYRO, S_GYRO, B_GYRO, "rad/s") for a, f in factors.items()]
    accel = [channel(f"accel_{a}", f * N_ACCEL, S_ACCEL, B_ACCEL, "m/s^2") for a, f in factors.items()]
    return FilterConfig(
        "made by hand",
        DT,
        {c.axis: c for c in (*gyro, *accel)},
        InitialUncertainty(1.0, 0.1, 0.005, 0.1),
        GnssNoise((1.0, 1.0, 2.0), None, 1.0, 5.0),
        inflations=(Enlargement(Quantity("gyro_x", "white.density"), 1.5, "vibration"),),
    )


CONFIG = make()

K_GYRO, K_ACCEL = S_GYRO * math.sqrt(2.0 / TIME), S_ACCEL * math.sqrt(2.0 / TIME)


def walking(config: FilterConfig) -> FilterConfig:
    """Return the same with the walk that the states are at first, which most dialects can hold."""
    channels = {
        axis: replace(
            one,
            markov=(),
            random_walk_density=math.hypot(
                one.random_walk_density, *(state.driving_density for state in one.markov)
            ),
            constant_sd=math.hypot(one.constant_sd, *(state.sd for state in one.markov)),
        )
        for axis, one in config.channels.items()
    }
    return replace(config, channels=channels)


ONE_STATE = ("native", "gazebo", "gnss-ins-sim", "matlab", "rotors", "airsim")


def written(dialect: str, config: FilterConfig = CONFIG) -> str:
    return export(config if dialect in ONE_STATE else walking(config), dialect, step=STEP)


def entries(dialect: str, config: FilterConfig = CONFIG) -> dict:
    return yaml.safe_load(written(dialect, config).removeprefix("%YAML:1.0\n"))


def near(value: object) -> object:
    """Return what equals a value, or a list of values, to its six digits."""
    return pytest.approx(value, rel=0.51 * 10.0 ** (1 - DEFAULT_DIGITS))


def python_values(text: str) -> dict[str, list[float]]:
    return {
        name: [float(x) for x in row.split(",")]
        for name, row in re.findall(r"(\w+)\W+?(?:np\.\w+\()?\[(.*?)\]", text)
    }
