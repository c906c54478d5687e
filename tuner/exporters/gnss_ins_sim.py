"""gnss-ins-sim: a Python dictionary of IMU errors, in that simulator's customary units.

gyro_b deg/h, gyro_arw deg/√h, gyro_b_stability deg/h (σ), gyro_b_corr s, accel_b m/s², accel_vrw m/s/√h,
accel_b_stability m/s² (σ), accel_b_corr s. The correlation time must be finite: with ``inf`` it draws white
noise.
"""

from __future__ import annotations

from models.units import from_si
from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import STATES_IN_WHITE, provenance
from tuner.exporters.scripts import commented, vector
from tuner.exporters.triad_values import longest_time, triad, triple
from tuner.synthesis.equivalent_models import equivalent_markov_sd, equivalent_white_density
from tuner.types import ChannelNoise, FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return a Python module with ``imu_err``."""
    time = longest_time(config)

    def density(channel: ChannelNoise) -> float:
        return equivalent_white_density(channel, memory=target.memory)

    def sd(channel: ChannelNoise) -> float:
        return equivalent_markov_sd(channel, time, memory=target.memory)

    lines = []
    for sensor, level, walk, key in (
        ("gyro", "deg/h", "deg/sqrt(h)", "arw"),
        ("accel", "m/s^2", "m/s/sqrt(h)", "vrw"),
    ):
        channels = triad(config, sensor)
        if not channels:
            continue
        entries = (
            (f"{sensor}_b", lambda c, u=level: from_si(c.constant_sd, u), f"{level}; one turn-on sd"),
            (f"{sensor}_{key}", lambda c, u=walk: from_si(density(c), u), f"{walk}; N"),
            (f"{sensor}_b_stability", lambda c, u=level: from_si(sd(c), u), f"{level}; σ"),
            (f"{sensor}_b_corr", lambda _: time, "s; T"),
        )
        for name, quantity, note in entries:
            values, words = triple(channels, quantity, note)
            lines.append(f'    "{name}": np.array({vector(values)}),  # {words}\n')
    header = (
        *provenance(config, "gnss-ins-sim IMU errors"),
        f"one T = {time:g} s; σ lets the bias wander as far in {target.memory:g} s as the modelled one",
        STATES_IN_WHITE,
    )
    return commented(header, "#") + "import numpy as np\n\nimu_err = {\n" + "".join(lines) + "}\n"


DIALECT = Dialect("gnss-ins-sim", "gnss-ins-sim IMU errors (Python)", "deg/h, deg/√h, m/s², m/s/√h, s", write)
