"""KF-GINS ``kf-gins.yaml``: white noise and Gauss–Markov biases with one correlation time.

arw deg/√h = N·(180/π)·60, vrw m/s/√h = N·60, gbstd deg/h = σ·(180/π)·3600, abstd mGal = σ/1e-5,
corrtime h = T/3600; the filter forms 2σ²/T. Its one T is the longest time constant of the configuration (1 h
without any), and each σ is refitted at that T so that the bias wanders as far over the memory as the modelled
one. Its one state is the whole bias, so the initial sd is that of constant and states together; the sd of scale
factors is assumed where the configuration has none: a static log does not show it.

`load` reads such a file back, so that one drive and one configuration run in both programs: one Gauss–Markov state an
axis, what the initial sd exceeds it by as a constant, scale factors as states. `tuner.exporters.kf_gins_drive` writes
the drive beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import yaml

from models.noise import GaussMarkov
from models.units import from_si, to_si
from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.figures import longest_time, triad, triple
from tuner.exporters.header import provenance
from tuner.formats.digits import rounded
from tuner.formats.yaml_text import Inline, Noted, yaml_text
from tuner.synthesis.equivalent_models import equivalent_markov_sd
from tuner.types import ChannelNoise, FilterConfig, InitialUncertainty
from tuner.types.records import DataError

SCALE_FACTOR_SD = 300.0
"""Scale-factor sd, ppm: assumed, as a static log cannot show it."""


def write(config: FilterConfig, target: Target) -> str:
    """Return the entries of KF-GINS that a configuration tells: noise, and sds of the start."""
    return yaml_text(entries(config, target), header=header(config, target))


def header(config: FilterConfig, target: Target) -> tuple[str, ...]:
    """Return the comment lines before the entries."""
    return (
        *provenance(config, "KF-GINS: entries of kf-gins.yaml"),
        f"one T = {longest_time(config):g} s for all states (the longest in the configuration, or 1 h); each σ lets "
        f"the bias wander as far in {target.memory:g} s (assumed memory of the filter) as the modelled one",
    )


def entries(config: FilterConfig, target: Target) -> dict[str, Any]:
    """Return the entries as a tree for `yaml_text`."""
    time_constant = longest_time(config)
    gyro, accel = triad(config, "gyro"), triad(config, "accel")

    def sd(channel: ChannelNoise) -> float:
        return equivalent_markov_sd(channel, time_constant, memory=target.memory)

    noise: dict[str, Any] = {}
    start: dict[str, Any] = {}
    if gyro:
        noise["arw"] = _axes(gyro, lambda c: from_si(c.white_density, "deg/sqrt(h)"), "deg/√h; N·(180/π)·60")
        noise["gbstd"] = _axes(gyro, lambda c: from_si(sd(c), "deg/h"), "deg/h; σ·(180/π)·3600")
        noise["gsstd"] = _scale(config, "gyro_scale")
        start["initbgstd"] = _axes(
            gyro, lambda c: from_si(_turn_on(c), "deg/h"), "deg/h; constant and states together"
        )
    if accel:
        noise["vrw"] = _axes(accel, lambda c: from_si(c.white_density, "m/s/sqrt(h)"), "m/s/√h; N·60")
        noise["abstd"] = _axes(accel, lambda c: from_si(sd(c), "mGal"), "mGal; σ/1e-5")
        noise["asstd"] = _scale(config, "accel_scale")
        start["initbastd"] = _axes(
            accel, lambda c: from_si(_turn_on(c), "mGal"), "mGal; constant and states together"
        )
    noise["corrtime"] = Noted(rounded(time_constant / 3600.0), "h; T/3600, one for all states")
    first = config.initial
    tilt, heading = rounded(math.degrees(first.tilt)), rounded(math.degrees(first.heading))
    start["initposstd"] = Noted(Inline([rounded(first.position)] * 3), "m; north, east, down")
    start["initvelstd"] = Noted(Inline([rounded(first.velocity)] * 3), "m/s; north, east, down")
    start["initattstd"] = Noted(Inline([tilt, tilt, heading]), "deg; roll, pitch, yaw")
    return {"imunoise": noise, **start}


def _turn_on(channel: ChannelNoise) -> float:
    return math.hypot(channel.constant_sd, *(state.sd for state in channel.markov))


def _axes(channels: tuple[ChannelNoise, ...], quantity: Callable[[ChannelNoise], float], note: str) -> Noted:
    values, words = triple(channels, quantity, note)
    return Noted(Inline(values), words)


def _scale(config: FilterConfig, name: str) -> Noted:
    if name in config.constants:
        return Noted(Inline([rounded(1e6 * config.constants[name])] * 3), "ppm")
    return Noted(Inline([SCALE_FACTOR_SD] * 3), "ppm; assumed, a static log does not show it")


INITIAL = {"initposstd": (1.0, "m"), "initvelstd": (0.1, "m/s"), "initattstd": (2.0, "deg")}
"""Initial sds where the file has none."""


def is_settings(content: object) -> bool:
    """Return whether the content of a YAML is settings of KF-GINS."""
    return isinstance(content, Mapping) and "imunoise" in content


def load(path: Path) -> FilterConfig:
    """Return the configuration of a ``kf-gins.yaml``; it names no receiver: the sds of the fixes hold.

    Raises
    ------
    DataError
        Where an entry is missing or no number.
    """
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    noise = content["imunoise"]
    period = _numbers(path, noise, "corrtime", 1)[0] * 3600.0
    channels = {}
    for sensor, unit, white, sd, start, units in (
        ("gyro", "rad/s", "arw", "gbstd", "initbgstd", ("deg/sqrt(h)", "deg/h")),
        ("accel", "m/s^2", "vrw", "abstd", "initbastd", ("m/s/sqrt(h)", "mGal")),
    ):
        density = _numbers(path, noise, white, 3)
        wander = _numbers(path, noise, sd, 3)
        first = _numbers(path, content, start, 3) if start in content else wander
        for i, axis in enumerate("xyz"):
            state = GaussMarkov(to_si(wander[i], units[1]), period)
            constant = math.sqrt(max(to_si(first[i], units[1]) ** 2 - state.sd**2, 0.0))
            name = f"{sensor}_{axis}"
            channels[name] = ChannelNoise(name, unit, to_si(density[i], units[0]), (state,), 0.0, constant)
    position, velocity, attitude = (
        [to_si(v, unit) for v in (_numbers(path, content, key, 3) if key in content else [value] * 3)]
        for key, (value, unit) in INITIAL.items()
    )
    scales = {
        name: 1e-6
        * max(_numbers(path, content, first, 3) if first in content else _numbers(path, noise, key, 3))
        for name, key, first in (("gyro_scale", "gsstd", "initsgstd"), ("accel_scale", "asstd", "initsastd"))
        if key in noise
    }
    return FilterConfig(
        path.stem,
        1.0 / float(content.get("imudatarate", 200.0)),
        channels,
        InitialUncertainty(max(position), max(velocity), max(attitude[:2]), attitude[2]),
        None,
        notes=("read from settings of KF-GINS",),
        constants=scales,
    )


def _numbers(path: Path, content: Mapping[str, Any], key: str, count: int) -> list[float]:
    values = content.get(key)
    values = values if isinstance(values, list) else [values]
    try:
        found = [float(value) for value in values]
    except (TypeError, ValueError):
        found = []
    if len(found) != count:
        msg = f"{path}: expected {count} number{'s' if count > 1 else ''} as {key}, got {content.get(key)!r}"
        raise DataError(msg)
    return found


DIALECT = Dialect("kf-gins", "KF-GINS kf-gins.yaml", "deg/√h, m/s/√h, deg/h, mGal, ppm, h", write)
