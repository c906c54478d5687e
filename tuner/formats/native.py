"""Our own configuration: a YAML a person can read and `tuner.types.FilterConfig` can be made from again.

Numbers are SI and exact, ``loads(dumps(c)) == c``; customary units stand in comments. Layout of
``tuner-noise/1``::

    sensors: SENSOR: AXIS: {unit, identified: [terms], filter: {white_density, markov, …}, fates}
    initial: P0 with reasons      gnss: R and gate      findings: […]
    compensation: {NAME: value}   constants: {STATE: sd of its prior}
    inflations: [{quantity, factor, reason, …}]         provenance: {…}       notes: […]
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from models.effects.drive import EFFECTS as DRIVE_EFFECTS
from models.noise import GaussMarkov
from tuner.formats.customary_units import customary_unit, digits, in_customary, phrase, pretty
from tuner.formats.files import write_text
from tuner.formats.nodes import Node, document
from tuner.formats.yaml_text import Inline, Noted, yaml_text
from tuner.types import (
    AppliedNoiseScale,
    BoundUsed,
    ChannelNoise,
    Coefficient,
    Compensation,
    Enlargement,
    FilterConfig,
    GnssNoise,
    Inflation,
    InitialUncertainty,
    Parameter,
    Quantity,
    TermEstimate,
)
from tuner.types.records import DataError

FORMAT = "tuner-noise/1"

T = TypeVar("T")

_HEADER = (
    "Noise of an inertial sensor and the filter settings that follow from it.",
    "SI units: rad, s, m; densities are two-sided; intervals and limits are of 95 %.",
    "Comments behind numbers: customary units.",
)


def dumps(config: FilterConfig) -> str:
    """Return a configuration as YAML.

    Parameters
    ----------
    config : FilterConfig
        Provenance must hold plain YAML values (str, bool, int, float, None, lists, string-keyed mappings).

    Returns
    -------
    str
        Text that `loads` turns back into an equal configuration.
    """
    sensors: dict[str, dict[str, Any]] = {}
    for axis, channel in config.channels.items():
        sensors.setdefault(axis.rpartition("_")[0] or axis, {})[axis] = _channel(channel)
    tree = {
        "format": FORMAT,
        "name": config.name,
        "interval": Noted(config.interval, f"s; {1.0 / config.interval:.6g} Hz"),
        "sensors": sensors,
        "initial": _initial(config.initial),
        "gnss": None if config.gnss is None else _gnss(config.gnss),
        **({"compensation": config.compensation.as_text()} if config.compensation else {}),
        **({"constants": dict(config.constants)} if config.constants else {}),
        "findings": [dict(finding) for finding in config.findings],
        "inflations": [_inflation(inflation) for inflation in config.inflations],
        "provenance": dict(config.provenance),
        "notes": config.notes,
    }
    return yaml_text(tree, header=_HEADER)


def dump(config: FilterConfig, path: Path) -> None:
    """Write a configuration to a file, whole or not at all."""
    write_text(path, dumps(config))


def loads(text: str, *, source: str = "configuration") -> FilterConfig:
    """Return the configuration of a YAML text.

    Parameters
    ----------
    text : str
        YAML of format ``tuner-noise/1``.
    source : str, optional
        File name for messages.

    Raises
    ------
    DataError
        One line: file, place, expected, found.
    """
    root = document(text, source, FORMAT)
    channels = {
        axis: _read_channel(axis, node)
        for _, sensor in root["sensors"].items()
        for axis, node in sensor.items()
    }
    gnss = root.get("gnss")
    return FilterConfig(
        root["name"].text(),
        root["interval"].number(positive=True),
        channels,
        _read_initial(root["initial"]),
        None if gnss is None else _read_gnss(gnss),
        inflations=_list(root, "inflations", _read_inflation),
        provenance=_mapping(root, "provenance"),
        notes=_list(root, "notes", Node.text),
        findings=_list(root, "findings", Node.mapping),
        compensation=_compensation(root),
        constants=_numbers(root, "constants"),
    )


def load(path: Path) -> FilterConfig:
    """Read a configuration file."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        msg = f"{path}: expected a readable YAML file of format {FORMAT}, got {error}"
        raise DataError(msg) from None
    return loads(text, source=str(path))


def _channel(channel: ChannelNoise) -> dict[str, Any]:
    def noted(value: float, quantity: str, per: str) -> Noted:
        shown = _in_words(value, quantity, channel.unit) if value else "none"
        return Noted(value, f"{channel.unit}{per}; {shown}")

    def state(markov: GaussMarkov) -> Noted:
        return Noted(_state(markov), f"{channel.unit}, s; {_in_words(markov.sd, 'level', channel.unit)}")

    return {
        "unit": channel.unit,
        "identified": [_term(term, channel.unit) for term in channel.identified],
        "filter": {
            "white_density": noted(channel.white_density, "white.density", "/√Hz"),
            "markov": [state(markov) for markov in channel.markov],
            "random_walk_density": noted(channel.random_walk_density, "random_walk.density", "/√s"),
            "constant_sd": noted(channel.constant_sd, "level", ""),
            "ramp_sd": noted(channel.ramp_sd, "ramp.rate", "/s"),
        },
        "fates": dict(channel.fates),
    }


def _in_words(value: float, quantity: str, unit: str) -> str:
    return f"{digits(in_customary(value, quantity, unit))} {pretty(customary_unit(quantity, unit))}"


def _term(term: TermEstimate, unit: str) -> dict[str, Any]:
    entries: dict[str, Any] = {"term": term.name}
    for name, coefficient in term.coefficients.items():
        told = {key: entry for key, entry in vars(coefficient).items() if entry is not None}
        entries[name] = Noted(Inline(told), phrase(coefficient, f"{term.name}.{name}", unit))
    return entries


def _state(markov: GaussMarkov) -> Inline:
    return Inline({"sd": markov.sd, "time_constant": markov.time_constant})


def _initial(initial: InitialUncertainty) -> dict[str, Any]:
    return {
        "position": Noted(initial.position, "m"),
        "velocity": Noted(initial.velocity, "m/s"),
        "tilt": Noted(initial.tilt, f"rad; {digits(math.degrees(initial.tilt))}°"),
        "heading": Noted(initial.heading, f"rad; {digits(math.degrees(initial.heading))}°"),
        "reasons": dict(initial.reasons),
    }


def _gnss(gnss: GnssNoise) -> dict[str, Any]:
    velocity = None if gnss.velocity_sd is None else Inline(gnss.velocity_sd)
    return {
        "position_sd": Noted(Inline(gnss.position_sd), "m; north, east, down"),
        "velocity_sd": Noted(velocity, "m/s; north, east, down"),
        "interval": Noted(gnss.interval, "s"),
        "gate": Noted(gnss.gate, "sigmas"),
        "correlated": [Noted(_state(markov), "m, s") for markov in gnss.correlated],
        **({"correlated_down": gnss.correlated_down} if gnss.correlated_down != 1.0 else {}),
        "reference": gnss.reference,
    }


def _inflation(inflation: Inflation) -> dict[str, Any]:
    interval = inflation.interval if isinstance(inflation, AppliedNoiseScale) else None
    causes = () if isinstance(inflation, BoundUsed) else inflation.causes
    noted = {"interval": Noted(Inline(interval), "95 %, asked for by the drive as it stands")}
    return {
        "quantity": str(inflation.quantity),
        "kind": next(kind for kind, found in _INFLATIONS.items() if isinstance(inflation, found)),
        "factor": inflation.factor,
        **(noted if interval else {}),
        **({"causes": list(causes)} if causes else {}),
        "reason": inflation.reason,
    }


_INFLATIONS: Mapping[str, type[Inflation]] = {
    "bound_used": BoundUsed,
    "enlargement": Enlargement,
    "noise_scale": AppliedNoiseScale,
}
"""Value of the key ``kind`` of an inflation; files of version 0.1 lack the key."""


def _read_channel(axis: str, node: Node) -> ChannelNoise:
    settings = node["filter"]
    return ChannelNoise(
        axis,
        node["unit"].text(),
        settings["white_density"].number(signed=False),
        _list(settings, "markov", _read_markov),
        settings["random_walk_density"].number(signed=False),
        settings["constant_sd"].number(signed=False),
        settings["ramp_sd"].number(signed=False),
        _list(node, "identified", _read_term),
        _mapping(node, "fates"),
    )


def _read_markov(node: Node) -> GaussMarkov:
    return GaussMarkov(node["sd"].number(positive=True), node["time_constant"].number(positive=True))


def _read_term(node: Node) -> TermEstimate:
    coefficients = {name: _read_coefficient(entry) for name, entry in node.items() if name != "term"}
    return TermEstimate(node["term"].text(), coefficients)


def _read_interval(node: Node) -> tuple[float, float]:
    """Return both ends; the upper one is infinite where the data set no limit."""
    ends = node.elements()
    if len(ends) == 2 and ends[1].value == math.inf:
        return ends[0].number(), math.inf
    low, high = node.numbers(2)
    return low, high


def _read_coefficient(node: Node) -> Coefficient:
    value, interval, upper, reason = (node.get(key) for key in ("value", "interval", "upper", "reason"))
    limits = _read_interval(interval) if interval else None
    return Coefficient(
        value.number() if value else None,
        limits,
        upper.number() if upper else None,
        node["unit"].text(),
        reason.text() if reason else None,
    )


def _read_initial(node: Node) -> InitialUncertainty:
    return InitialUncertainty(
        node["position"].number(signed=False),
        node["velocity"].number(signed=False),
        node["tilt"].number(signed=False),
        node["heading"].number(signed=False),
        _mapping(node, "reasons"),
    )


def _read_gnss(node: Node) -> GnssNoise:
    position = node["position_sd"].numbers(3, signed=False)
    velocity = node.get("velocity_sd")
    speeds = velocity.numbers(3, signed=False) if velocity else None
    down = node.get("correlated_down")
    return GnssNoise(
        (position[0], position[1], position[2]),
        (speeds[0], speeds[1], speeds[2]) if speeds else None,
        node["interval"].number(positive=True),
        node["gate"].number(positive=True),
        _list(node, "correlated", _read_markov),
        node["reference"].text(),
        1.0 if down is None else down.number(positive=True),
    )


def _read_inflation(node: Node) -> Inflation:
    interval, causes = node.get("interval"), node.get("causes")
    ends = interval.numbers(2) if interval else None
    names = tuple(cause.text() for cause in causes.elements()) if causes else ()
    try:
        quantity = Quantity.parse(node["quantity"].text())
    except ValueError as error:
        node["quantity"].refuse(str(error), repr(node["quantity"].value))
    factor, reason = node["factor"].number(), node["reason"].text()
    kind = _kind(node, factor, reason)
    if kind == "bound_used":
        return BoundUsed(quantity, factor, reason)
    if kind == "enlargement":
        return Enlargement(quantity, factor, reason, names)
    return AppliedNoiseScale(quantity, factor, reason, (ends[0], ends[1]) if ends else None, names)


def _kind(node: Node, factor: float, reason: str) -> str:
    """Return the kind of an inflation; in a file without that key, by what only one of the three has."""
    kind = node.get("kind")
    if kind is not None:
        if kind.value not in _INFLATIONS:
            kind.refuse(f"one of {', '.join(_INFLATIONS)}", repr(kind.value))
        return kind.text()
    if reason.startswith("bounded"):
        return "bound_used"
    return "noise_scale" if node.get("interval") or node.get("causes") or factor == 1.0 else "enlargement"


def _list(node: Node, key: str, read: Callable[[Node], T]) -> tuple[T, ...]:
    entry = node.get(key)
    return () if entry is None else tuple(read(element) for element in entry.elements())


def _mapping(node: Node, key: str) -> Mapping[str, Any]:
    entry = node.get(key)
    return {} if entry is None else entry.mapping()


def _numbers(node: Node, key: str) -> Mapping[str, float]:
    entry = node.get(key)
    return {} if entry is None else {name: value.number() for name, value in entry.items()}


def _compensation(root: Node) -> Compensation:
    """Return the compensation of a drive; refuse a cause or a parameter that is not declared."""
    entry = root.get("compensation")
    if entry is None:
        return Compensation()
    values = {}
    for name, value in entry.items():
        cause, _, part = name.partition(".")
        effect = DRIVE_EFFECTS.get(cause)
        if effect is None or not part:
            constant = ", ".join(DRIVE_EFFECTS)
            value.refuse(f"CAUSE.NAME, with a cause of a drive ({constant})", repr(name))
        if not effect.is_parameter_of_compensation(part):
            value.refuse(f"a parameter of '{cause}' that can be taken out of a drive", repr(name))
        values[Parameter(cause, part)] = value.number()
    return Compensation(values)
