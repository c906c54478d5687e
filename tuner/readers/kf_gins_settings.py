"""Settings of KF-GINS (``kf-gins.yaml``) as a filter configuration, so that one filter runs in both programs.

Each axis becomes one Gauss–Markov state; what the initial sd exceeds it by is a constant; scale factors are states.
`tuner.exporters.kf_gins` writes such files.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from models.noise import GaussMarkov
from models.units import to_si
from tuner.types import ChannelNoise, FilterConfig, InitialUncertainty
from tuner.types.records import DataError

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
