"""Settings of KF-GINS (``kf-gins.yaml``) as a filter configuration, so that one filter runs in both programs.

Each axis becomes one Gauss–Markov state; what the initial sd exceeds it by is a constant. Those of a sensor of which
one starts below its sd are the random walks that they are until they have grown. Scale factors are states of the same
time constant, without noise constants.
`tuner.exporters.kf_gins` writes such files.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from models.noise import GaussMarkov
from models.units import to_si
from tuner.formats.codec import load as load_content
from tuner.formats.documents import parse_yaml, read_text
from tuner.formats.guard import input_guard
from tuner.types import ChannelNoise, FilterConfig, InitialUncertainty
from tuner.types.number_ranges import NonNegative, Positive
from tuner.types.records import DataError

_EXPECTED = "a YAML of KF-GINS"

Densities = tuple[Positive, Positive, Positive]
Sds = tuple[NonNegative, NonNegative, NonNegative]


@dataclass(frozen=True, kw_only=True)
class _ImuNoise:
    """The entries of ``imunoise``, in the units of KF-GINS: deg/√h, m/s/√h, deg/h, mGal, ppm, h."""

    arw: Densities
    vrw: Densities
    gbstd: Densities
    abstd: Densities
    gsstd: Sds | None = None
    asstd: Sds | None = None
    corrtime: Positive


@dataclass(frozen=True, kw_only=True)
class _Settings:
    """The entries that a configuration needs; m, m/s, deg, deg/h, mGal, ppm."""

    imunoise: _ImuNoise
    imudatarate: Positive = 200.0
    initposstd: Sds = (1.0, 1.0, 1.0)
    initvelstd: Sds = (0.1, 0.1, 0.1)
    initattstd: Sds = (2.0, 2.0, 2.0)
    initbgstd: Sds | None = None
    initbastd: Sds | None = None
    initsgstd: Sds | None = None
    initsastd: Sds | None = None


def is_settings(path: Path) -> bool:
    """Return whether a file is settings of KF-GINS; False for what is no YAML."""
    if path.suffix not in (".yaml", ".yml"):
        return False
    try:
        content = parse_yaml(read_text(path, expected=_EXPECTED), source=str(path), expected=_EXPECTED)
    except DataError:
        return False
    return isinstance(content, Mapping) and "imunoise" in content


def load(path: Path) -> FilterConfig:
    """Return the configuration of a ``kf-gins.yaml``; it names no receiver: the sds of the fixes hold.

    Raises
    ------
    DataError
        Where an entry is missing or no number.
    """
    content = parse_yaml(read_text(path, expected=_EXPECTED), source=str(path), expected=_EXPECTED)
    stated = load_content(content, _Settings, source=str(path))
    with input_guard(path, f"{_EXPECTED} with numbers of sensors"):
        return _configuration(path.stem, stated)


def _configuration(name: str, stated: _Settings) -> FilterConfig:
    """Return the configuration that settings mean."""
    noise = stated.imunoise
    channels = {}
    for sensor, unit, white, sd, start, units in (
        ("gyro", "rad/s", noise.arw, noise.gbstd, stated.initbgstd, ("deg/sqrt(h)", "deg/h")),
        ("accel", "m/s^2", noise.vrw, noise.abstd, stated.initbastd, ("m/s/sqrt(h)", "mGal")),
    ):
        sds, starts = ([to_si(x, units[1]) for x in values] for values in (sd, start or sd))
        below = any(first < own for first, own in zip(starts, sds, strict=True))
        for axis, density, own, first in zip("xyz", white, sds, starts, strict=True):
            state = GaussMarkov(own, 3600.0 * noise.corrtime)
            constant = first if below else math.sqrt(first**2 - own**2)
            walk, states = (state.driving_density, ()) if below else (0.0, (state,))
            channel = f"{sensor}_{axis}"
            channels[channel] = ChannelNoise(channel, unit, to_si(density, units[0]), states, walk, constant)
    attitude = [to_si(sd, "deg") for sd in stated.initattstd]
    scales = {
        name: 1e-6 * max(of_start or sds)
        for name, sds, of_start in (
            ("gyro_scale", noise.gsstd, stated.initsgstd),
            ("accel_scale", noise.asstd, stated.initsastd),
        )
        if sds is not None
    }
    return FilterConfig(
        name,
        1.0 / stated.imudatarate,
        channels,
        InitialUncertainty(max(stated.initposstd), max(stated.initvelstd), max(attitude[:2]), attitude[2]),
        None,
        notes=("read from settings of KF-GINS",),
        constants=scales,
        time_constants={
            name: 3600.0 * noise.corrtime
            for name, density in (("gyro_scale", noise.gsstd), ("accel_scale", noise.asstd))
            if name in scales and any(density or ())
        },
    )
