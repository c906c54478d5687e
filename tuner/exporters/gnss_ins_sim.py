"""gnss-ins-sim: a Python dictionary of IMU errors, in that simulator's customary units.

gyro_b deg/h, gyro_arw deg/√h, gyro_b_stability deg/h (σ), gyro_b_corr s, accel_b m/s², accel_vrw m/s/√h,
accel_b_stability m/s² (σ), accel_b_corr s. The correlation time must be finite: with ``inf`` it draws white
noise. σ and T are those of `tuner.exporters.one_state`; the state starts at zero.

Source: Aceinna/gnss-ins-sim gnss_ins_sim/pathgen/pathgen.py (acc_gen, gyro_gen, bias_drift), sim/imu_model.py.
"""

from __future__ import annotations

from models.units import from_si
from tuner.exporters.dialect import Dialect, Target, longest_time
from tuner.exporters.header import provenance
from tuner.exporters.one_state import drawn_words, simulated_state
from tuner.exporters.scripts import commented, vector
from tuner.exporters.triad_values import triad, triple
from tuner.types import FilterConfig


def write(config: FilterConfig, _: Target) -> str:
    """Return a Python module with ``imu_err``."""
    preferred = longest_time(config)
    states = {axis: simulated_state(c, preferred=preferred) for axis, c in config.channels.items()}
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
            (f"{sensor}_{key}", lambda c, u=walk: from_si(c.white_density, u), f"{walk}; N"),
            (f"{sensor}_b_stability", lambda c, u=level: from_si(states[c.axis].sd, u), f"{level}; σ"),
            (f"{sensor}_b_corr", lambda c: states[c.axis].time_constant, "s; T"),
        )
        for name, quantity, note in entries:
            values, words = triple(channels, quantity, note)
            lines.append(f'    "{name}": np.array({vector(values)}),  # {words}\n')
    header = (
        *provenance(config, "gnss-ins-sim IMU errors"),
        *drawn_words(states),
    )
    return commented(header, "#") + "import numpy as np\n\nimu_err = {\n" + "".join(lines) + "}\n"


DIALECT = Dialect("gnss-ins-sim", "gnss-ins-sim IMU errors (Python)", "deg/h, deg/√h, m/s², m/s/√h, s", write)
