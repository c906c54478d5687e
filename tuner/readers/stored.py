"""Identifications on file: what `tuner identify --json` and `tuner tune` stored stands wherever a log does.

A ``noise.yaml`` has the terms of every axis; the JSON of an identification (or of a whole result) also has the mean,
σ(10 s) and the Allan curve. What a file does not have is computed from the sum of its terms.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from tuner.formats import native
from tuner.formats.documents import parse_json, read_text
from tuner.formats.identification import load_identification
from tuner.formats.noise import noise_model
from tuner.types import AllanCurve, ChannelIdentification, Coefficient, Identification, TermEstimate

_RESULT_SCHEMA = "tuner.result/1"
_ALLAN_FLOOR = math.sqrt(2.0 * math.log(2.0) / math.pi)
"""Allan deviation of unit bias instability, 0.664."""


def is_stored(path: Path) -> bool:
    """Return whether a file is a configuration of ours, or JSON."""
    if path.suffix.lower() == ".json":
        return path.is_file()
    try:
        with path.open(encoding="utf-8") as file:
            head = file.read(4096)
    except (OSError, UnicodeDecodeError):
        return False
    return any(line.partition("#")[0].strip() == f"format: {native.FORMAT}" for line in head.splitlines())


def read_stored(path: Path) -> Identification:
    """Read an identification from a ``noise.yaml`` or from JSON.

    Raises
    ------
    DataError
        One line: file, place, expected, found, what to do.
    """
    return _from_json(path) if path.suffix.lower() == ".json" else _from_configuration(path)


def _from_configuration(path: Path) -> Identification:
    config = native.load(path)
    channels = {
        axis: _channel(axis, noise.unit, config.interval, "configuration", noise.identified)
        for axis, noise in config.channels.items()
    }
    return Identification({"name": config.name, "files": [path.name]}, channels, config.notes)


def _from_json(path: Path) -> Identification:
    content = parse_json(read_text(path, expected="readable JSON"), source=str(path))
    if isinstance(content, dict) and content.get("schema") == _RESULT_SCHEMA:
        return load_identification(content.get("identification"), source=f"{path}: identification")
    return load_identification(content, source=str(path))


def _channel(
    axis: str, unit: str, interval: float, method: str, terms: tuple[TermEstimate, ...]
) -> ChannelIdentification:
    """Return an axis whose figures are those of its model."""
    model = noise_model(terms)
    tau = np.geomspace(max(interval, 1e-3), 1e4, 201)
    deviation = np.sqrt(model.allan_variance(tau)) if model.terms else np.zeros(0)
    unknown = Coefficient(None, None, None, unit, "not in the configuration")
    lowest = int(np.argmax(deviation <= 1.01 * deviation.min())) if len(deviation) else 0

    def figure(value: float) -> Coefficient:
        return Coefficient(value, None, None, unit, "of the model, not of data")

    return ChannelIdentification(
        axis=axis,
        unit=unit,
        interval=interval,
        span=0.0,
        method=method,
        model=model,
        terms=terms,
        parameters=(),
        covariance=np.zeros((0, 0)),
        mean=unknown,
        sigma_10s=figure(math.sqrt(float(model.allan_variance(10.0)))) if model.terms else unknown,
        minimum=figure(float(deviation[lowest])) if model.terms else unknown,
        floor=figure(float(deviation[lowest]) / _ALLAN_FLOOR) if model.terms else unknown,
        minimum_tau=float(tau[lowest]),
        allan=AllanCurve("none", np.zeros(0), np.zeros((0, 1)), np.zeros((0, 1)), unit, (axis,)),
    )
