"""GINav ``.ini``: power spectral densities; the code multiplies them by the sampling interval.

psd_gyro rad²/s = N², psd_acce m²/s³ = N², psd_bg rad²/s³ = K², psd_ba m²/s⁵ = K², init_bg_unc rad/s, init_ba_unc m/s²,
sample_rate Hz. Its parser looks for a key in the first 14 characters and takes the third word of the line.

Source: kaichen686/GINav src/read_file/decode_cfg.m, src/ins/ins_init.m (ins.Q, ins.P), src/ins/ins_time_updata.m.
"""

from __future__ import annotations

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.scripts import commented
from tuner.exporters.triad_values import initial_bias_sd, rms, triad, walk, white
from tuner.types import FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return the lines of the INS options that follow from the sensor."""
    gyro, accel = triad(config, "gyro"), triad(config, "accel")
    figures = {
        "init_bg_unc": rms(gyro, initial_bias_sd, "rad/s; constant and states together"),
        "init_ba_unc": rms(accel, initial_bias_sd, "m/s^2; constant and states together"),
        "psd_gyro": white(gyro, "rad^2/s; N^2", target, lambda n: n**2),
        "psd_acce": white(accel, "m^2/s^3; N^2", target, lambda n: n**2),
        "psd_bg": walk(config, gyro, "rad^2/s^3; K^2", target, lambda k: k**2),
        "psd_ba": walk(config, accel, "m^2/s^5; K^2", target, lambda k: k**2),
    }
    lines = [f"sample_rate   =     {target.rate:<24.10g} % imu sample rate (Hz)\n"]
    lines += [f"{key:<14}=     {figure.value:<24.9g} % {figure.note}\n" for key, figure in figures.items()]
    header = provenance(config, "GINav: entries of the INS options", target)
    return commented(header, "#") + "".join(lines)


DIALECT = Dialect(
    "ginav", "GINav configuration", "Hz, rad/s, m/s², rad²/s, m²/s³, rad²/s³, m²/s⁵", write, shared=True
)
