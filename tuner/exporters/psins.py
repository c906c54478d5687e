"""PSINS: a MATLAB line ``imuerrset(…)`` in its customary units, for filters with bias noise (kfinit186).

eb deg/h, db ug (initial sd of the bias), web deg/√h, wdb ug/√Hz (N), sqrtR0G deg/h, sqrtR0A ug, TauG, TauA s. The
code forms the driving density sqrtR0·√(2/Tau); the filter's bias is a random walk with it while ``ins.tauG`` is left
at infinity. So sqrtR0 = K √(T/2) for the K that stands for the bias, with a T of a day.

Source: WangShanpeng/PSINS base/imu/imuerrset.m, base/kf/kfinit.m (kfinit186), kfinit0.m, base/base1/insinit.m, etm.m.
"""

from __future__ import annotations

from collections.abc import Callable

from models.units import from_si
from tuner.exporters.dialect import LASTING_TIME, WALK_SD, Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.scripts import commented, vector
from tuner.exporters.triad_values import initial_bias_sd, limited, triad, triple
from tuner.types import ChannelNoise, FilterConfig

_MICRO_G = 1e-6 * 9.7803267715
"""Its glv.ug, m/s²: of the gravity at the equator (base/glvf.m)."""


def write(config: FilterConfig, target: Target) -> str:
    """Return a script that defines ``imuerr``."""
    gyro, accel = triad(config, "gyro"), triad(config, "accel")
    quantities: tuple[tuple[str, tuple[ChannelNoise, ...], Callable[[ChannelNoise], float], str], ...] = (
        ("eb", gyro, lambda c: from_si(initial_bias_sd(c), "deg/h"), "deg/h; constant and states together"),
        ("db", accel, lambda c: initial_bias_sd(c) / _MICRO_G, "ug; constant and states together"),
        ("web", gyro, lambda c: from_si(target.white_density(c), "deg/sqrt(h)"), "deg/√h; N"),
        ("wdb", accel, lambda c: target.white_density(c) / _MICRO_G, "ug/√Hz; N"),
        (
            "sqrtR0G",
            gyro,
            lambda c: from_si(WALK_SD * target.bias(c), "deg/h"),
            limited(config, gyro, "deg/h; K·√(T/2)"),
        ),
        ("TauG", gyro, lambda _: LASTING_TIME, "s; T"),
        (
            "sqrtR0A",
            accel,
            lambda c: WALK_SD * target.bias(c) / _MICRO_G,
            limited(config, accel, "ug; K·√(T/2)"),
        ),
        ("TauA", accel, lambda _: LASTING_TIME, "s; T"),
    )
    lines = []
    for name, channels, quantity, note in quantities:
        values, words = triple(channels, quantity, note)
        lines.append(f"{name} = {vector(values)}'; % {words}\n")
    names = ", ".join(name for name, *_ in quantities)
    header = (
        *provenance(config, "PSINS error settings", target),
        "of the filters of kfinit only those with bias noise, such as kfinit186, use sqrtR0G and sqrtR0A",
    )
    return commented(header, "%") + "".join(lines) + f"imuerr = imuerrset({names});\n"


DIALECT = Dialect(
    "psins", "PSINS imuerrset (MATLAB script)", "deg/h, ug, deg/√h, ug/√Hz, deg/h, s, ug, s", write
)
