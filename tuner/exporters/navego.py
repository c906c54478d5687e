"""NaveGo: a MATLAB script that fills the IMU structure, SI throughout.

arw rad/√s, vrw m/s/√s, gb_sta, ab_sta (turn-on), gb_dyn, ab_dyn (sd σ of the Gauss–Markov bias), gb_corr,
ab_corr (T), gb_psd, ab_psd = σ √(2/T), which is what its filter squares into Q, and g_std, a_std = N/√dt,
sd of a sample.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import STATES_IN_WHITE, provenance
from tuner.exporters.scripts import commented, vector
from tuner.exporters.triad_values import longest_time, triad, triple
from tuner.synthesis.equivalent_models import (
    equivalent_markov_sd,
    equivalent_random_walk,
    equivalent_white_density,
)
from tuner.types import ChannelNoise, FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return a script that defines ``imu``."""
    time = longest_time(config)

    def density(channel: ChannelNoise) -> float:
        return equivalent_white_density(channel, memory=target.memory)

    def sd(channel: ChannelNoise) -> float:
        return equivalent_markov_sd(channel, time, memory=target.memory)

    quantities: tuple[tuple[str, Callable[[ChannelNoise], float], str], ...] = (
        ("{0}rw", density, "{1}/√Hz; N"),
        ("{0}rrw", lambda c: equivalent_random_walk(c, memory=target.memory), "{1}/√s; K"),
        ("{2}_std", lambda c: density(c) / math.sqrt(target.interval), "{1}; N/√dt, sd of a sample"),
        ("{2}b_sta", lambda c: c.constant_sd, "{1}; turn-on sd"),
        ("{2}b_dyn", sd, "{1}; σ"),
        ("{2}b_corr", lambda _: time, "s; T"),
        ("{2}b_psd", lambda c: sd(c) * math.sqrt(2.0 / time), "{1}/√s; σ√(2/T)"),
    )
    lines = []
    for sensor, names in (("gyro", ("a", "rad/s", "g")), ("accel", ("v", "m/s²", "a"))):
        if channels := triad(config, sensor):
            for key, quantity, note in quantities:
                values, words = triple(channels, quantity, note.format(*names))
                lines.append(f"imu.{key.format(*names)} = {vector(values)}; % {words}\n")
    lines.append(f"imu.freq = {target.rate!r}; % Hz\n")
    header = (
        *provenance(config, "NaveGo IMU structure", walk_memory=target.memory),
        f"one T = {time:g} s; σ lets the bias wander as far in {target.memory:g} s as the modelled one",
        STATES_IN_WHITE,
    )
    return commented(header, "%") + "".join(lines)


DIALECT = Dialect(
    "navego",
    "NaveGo IMU structure (MATLAB script)",
    "rad/√s, m/s/√s, rad/s, m/s², s, rad/s/√s, m/s²/√s",
    write,
)
