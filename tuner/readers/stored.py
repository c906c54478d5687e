"""Identifications on file: what `tuner identify --json` and `tuner tune` wrote stands wherever a log does.

A ``noise.yaml`` tells the terms of every axis; the JSON of an identification (or of a whole result) also tells
the mean, σ(10 s) and the Allan curve. What a file does not tell is taken from the sum of its terms.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from models.noise import TERMS, NoiseModel
from tuner.formats import native
from tuner.formats.nodes import Node
from tuner.types import AllanCurve, ChannelIdentification, Coefficient, Identification, TermEstimate
from tuner.types.records import DataError

SCHEMA = "tuner.identification/1"
_RESULT = "tuner.result/1"
_FLOOR = math.sqrt(2.0 * math.log(2.0) / math.pi)
"""Allan deviation of unit bias instability, 0.664."""


def is_written(path: Path) -> bool:
    """Tell whether a file is a configuration of ours, or JSON."""
    if path.suffix.lower() == ".json":
        return path.is_file()
    try:
        with path.open(encoding="utf-8") as file:
            head = file.read(4096)
    except (OSError, UnicodeDecodeError):
        return False
    return any(line.partition("#")[0].strip() == f"format: {native.FORMAT}" for line in head.splitlines())


def read_written(path: Path) -> Identification:
    """Read an identification from a ``noise.yaml`` or from JSON.

    Raises
    ------
    DataError
        One line: file, place, expected, found.
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
    try:
        root = Node(json.loads(path.read_text(encoding="utf-8")), str(path))
    except (OSError, ValueError) as error:
        msg = f"{path}: expected readable JSON, got {error}"
        raise DataError(msg) from None
    schema = root.mapping().get("schema")
    if schema == _RESULT:
        root, schema = root["identification"], root["identification"].mapping().get("schema")
    if schema != SCHEMA:
        root.refuse(f"the schema {SCHEMA} or {_RESULT}", repr(schema))
    channels = {axis: _read_channel(axis, node) for axis, node in root["channels"].items()}
    return Identification(dict(root["source"].mapping()), channels, ())


def _read_channel(axis: str, node: Node) -> ChannelIdentification:
    unit = node["unit"].text()
    rate = node.get("rate_hz")
    tau = node["minimum"].get("tau")
    allan = [np.array([v.number() for v in node["allan"][k].elements()]) for k in ("tau", "deviation", "dof")]
    curve = AllanCurve("oadev", allan[0], allan[1][:, None] ** 2, allan[2][:, None], unit, (axis,))
    return ChannelIdentification(
        axis=axis,
        unit=unit,
        interval=1.0 / rate.number(positive=True) if rate else 0.0,
        span=node["span_s"].number(),
        method=node["method"].text(),
        terms=(terms := tuple(_estimates(node["terms"]))),
        model=_model(terms),
        parameters=(),
        covariance=np.zeros((0, 0)),
        minimum_tau=tau.number() if tau else math.nan,
        mean=_coefficient(node["mean"]),
        sigma_10s=_coefficient(node["sigma_10s"]),
        minimum=_coefficient(node["minimum"]),
        floor=_coefficient(node["floor"]),
        allan=curve,
    )


def _estimates(terms: Node) -> Iterator[TermEstimate]:
    for name, node in terms.items():
        if name not in TERMS:
            terms.refuse(f"terms among {', '.join(TERMS)}", repr(name))
        for entry in node.elements() if isinstance(node.value, list) else (node,):
            found = {key: _coefficient(coefficient) for key, coefficient in entry.items()}
            if any(c.value is not None or c.upper is not None for c in found.values()):
                yield TermEstimate(name, found)


def _coefficient(node: Node) -> Coefficient:
    value, interval, upper, reason = (node.get(key) for key in ("value", "interval", "upper", "reason"))
    low, high = interval.numbers(2) if interval else (math.nan, math.nan)
    return Coefficient(
        value.number() if value else None,
        (low, high) if interval else None,
        upper.number() if upper else None,
        node["unit"].text(),
        reason.text() if reason else None,
    )


def _model(terms: tuple[TermEstimate, ...]) -> NoiseModel:
    """Return the sum of the terms that have values."""
    present = (t for t in terms if t.present and t.name in TERMS)
    return NoiseModel(
        tuple(TERMS[t.name](**{name: c.value for name, c in t.coefficients.items()}) for t in present)
    )


def _channel(
    axis: str, unit: str, interval: float, method: str, terms: tuple[TermEstimate, ...]
) -> ChannelIdentification:
    """Return an axis whose figures are those of its model."""
    model = _model(terms)
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
        floor=figure(float(deviation[lowest]) / _FLOOR) if model.terms else unknown,
        minimum_tau=float(tau[lowest]),
        allan=AllanCurve("none", np.zeros(0), np.zeros((0, 1)), np.zeros((0, 1)), unit, (axis,)),
    )
