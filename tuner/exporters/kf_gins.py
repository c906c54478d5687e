"""KF-GINS ``kf-gins.yaml``: white noise and Gauss–Markov biases with one correlation time.

arw deg/√h = N·(180/π)·60, vrw m/s/√h = N·60, gbstd deg/h = σ·(180/π)·3600, abstd mGal = σ/1e-5, corrtime h = T/3600;
the filter forms 2σ²/T and lets the variance fade, while it keeps its estimate. It has one T for biases, which wander,
and for scale factors, which do not: with that of a bias, a constant of 3 % wanders by 0.01 g within a minute. So T
is a day: biases are random walks, σ = K·√(T/2), scale factors are constants without noise, and what is
known of both is in the sds of the start. N and K are those of `tuner.synthesis.projection`. The one state is the
whole bias, so its initial sd is that of constant and states together; the sds of scale factors are those of the grade
that the configuration comes from, or of the built-in one whose noise is nearest: a static log does not show them.

`tuner.readers.kf_gins_settings` reads such a file back; `tuner.exporters.kf_gins_drive` writes the drive beside it.

Source: i2Nav-WHU/KF-GINS src/kf-gins/gi_engine.cpp (constructor, initialize, insPropagation, stateFeedback),
src/kf_gins.cpp.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from models.units import from_si
from tuner.exporters.dialect import LASTING_TIME, WALK_SD, Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.scale_factors import scale_factor
from tuner.exporters.triad_values import initial_bias_sd, limited, triad, triple
from tuner.formats.digits import rounded
from tuner.formats.yaml_text import Inline, Noted, yaml_text
from tuner.synthesis.projection import RTK
from tuner.types import ChannelNoise, FilterConfig

TITLE = "KF-GINS: entries of kf-gins.yaml"
"""First line of the file."""
CONSTANT = Noted(Inline([0.0] * 3), "ppm; constants: what is not known of them is in the sd of the start")
"""Noise that drives a scale factor."""


def write(config: FilterConfig, target: Target) -> str:
    """Return the entries of KF-GINS that follow from a configuration: noise, and sds of the start."""
    return yaml_text(entries(config, target), header=provenance(config, TITLE, target))


def entries(config: FilterConfig, target: Target) -> dict[str, Any]:
    """Return the entries as a tree for `yaml_text`."""
    gyro, accel = triad(config, "gyro"), triad(config, "accel")
    noise: dict[str, Any] = {}
    start: dict[str, Any] = {}
    if gyro:
        noise["arw"] = _axes(
            gyro, lambda c: from_si(target.white_density(c), "deg/sqrt(h)"), "deg/√h; N·(180/π)·60"
        )
        noise["gbstd"] = _axes(
            gyro,
            lambda c: from_si(WALK_SD * target.bias(c), "deg/h"),
            limited(config, gyro, "deg/h; K·√(T/2)·(180/π)·3600"),
        )
        noise["gsstd"] = CONSTANT
        start["initsgstd"] = _scale(config, "gyro_scale")
        start["initbgstd"] = _axes(
            gyro, lambda c: from_si(initial_bias_sd(c), "deg/h"), "deg/h; constant and states together"
        )
    if accel:
        noise["vrw"] = _axes(accel, lambda c: from_si(target.white_density(c), "m/s/sqrt(h)"), "m/s/√h; N·60")
        noise["abstd"] = _axes(
            accel,
            lambda c: from_si(WALK_SD * target.bias(c), "mGal"),
            limited(config, accel, "mGal; K·√(T/2)/1e-5"),
        )
        noise["asstd"] = CONSTANT
        start["initsastd"] = _scale(config, "accel_scale")
        start["initbastd"] = _axes(
            accel, lambda c: from_si(initial_bias_sd(c), "mGal"), "mGal; constant and states together"
        )
    noise["corrtime"] = Noted(
        rounded(LASTING_TIME / 3600.0), "h; T, one for all states: biases walk, scale factors stay"
    )
    first = config.initial
    tilt, heading = rounded(math.degrees(first.tilt)), rounded(math.degrees(first.heading))
    start["initposstd"] = Noted(Inline([rounded(first.position)] * 3), "m; north, east, down")
    start["initvelstd"] = Noted(Inline([rounded(first.velocity)] * 3), "m/s; north, east, down")
    start["initattstd"] = Noted(Inline([tilt, tilt, heading]), "deg; roll, pitch, yaw")
    return {"imunoise": noise, **start}


def _axes(channels: tuple[ChannelNoise, ...], quantity: Callable[[ChannelNoise], float], note: str) -> Noted:
    values, words = triple(channels, quantity, note)
    return Noted(Inline(values), words)


def _scale(config: FilterConfig, name: str) -> Noted:
    sd, reason = scale_factor(config, name)
    return Noted(Inline([rounded(1e6 * sd)] * 3), f"ppm; {reason}")


DIALECT = Dialect("kf-gins", "KF-GINS kf-gins.yaml", "deg/√h, m/s/√h, deg/h, mGal, ppm, h", write, aiding=RTK)
