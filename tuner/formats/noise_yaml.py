"""Our own configuration file: a YAML a person can read, from which an equal `tuner.types.FilterConfig` is made.

Layout: `tuner.formats.configuration`. Numbers are SI and carry the digits of `tuner.formats.digits`; customary units
stand in comments. What was read is written again as the same text, ``dumps(loads(text)) == text``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from models.filter_states import FILTER_STATES
from models.noise import GaussMarkov
from models.units import from_si
from tuner.formats import codec
from tuner.formats.configuration import FORMAT, config_json, load_config
from tuner.formats.customary_units import customary_unit, digits, in_customary, phrase, pretty
from tuner.formats.digits import CLOCK_DIGITS, rounded_content
from tuner.formats.documents import parse_format, read_text
from tuner.formats.files import write_text
from tuner.formats.yaml_text import Inline, Noted, yaml_text
from tuner.types import (
    ChannelNoise,
    FilterConfig,
    GnssNoise,
    Inflation,
    InitialUncertainty,
    TermEstimate,
)
from tuner.types.borrowed import borrowed, white_is_measured

__all__ = ["FORMAT", "as_written", "dump", "dumps", "load", "loads"]

_HEADER = (
    "Noise of an inertial sensor and the filter settings that follow from it.",
    "SI units: rad, s, m; densities are two-sided; intervals and limits are of 95 %.",
    "Comments behind numbers: customary units.",
)

ON_LIMIT = "; rests on a 95 % limit, not measured"
"""Behind a number that the log did not show."""
NOT_STATED = "not stated: left out"
"""Behind the 0 of a term that neither log nor sheet speaks of: it is no measured zero."""


def dumps(config: FilterConfig) -> str:
    """Return a configuration as YAML.

    Parameters
    ----------
    config : FilterConfig
        Provenance must hold plain YAML values (str, bool, int, float, None, lists, string-keyed mappings).

    Returns
    -------
    str
        Text that `loads` turns back into the configuration `as_written`.
    """
    config = as_written(config)
    span = float(config.provenance.get("span") or 0.0)
    lent = borrowed(config)
    sensors: dict[str, dict[str, Any]] = {}
    for axis, channel in config.channels.items():
        sensors.setdefault(axis.rpartition("_")[0] or axis, {})[axis] = _channel(
            config, channel, span, lent.get(axis, ""), measured=white_is_measured(config, axis)
        )
    tree = {
        "format": FORMAT,
        "name": config.name,
        "interval": Noted(config.interval, f"s; {1.0 / config.interval:.6g} Hz"),
        "sensors": sensors,
        **_rest_and_motion(config),
        "initial": _initial(config.initial),
        "gnss": None if config.gnss is None else _gnss(config.gnss),
        **({"compensation": config.compensation.as_text()} if config.compensation else {}),
        **({"constants": _constants(config)} if config.constants else {}),
        **({"time_constants": dict(config.time_constants)} if config.time_constants else {}),
        "findings": [dict(finding) for finding in config.findings],
        "inflations": [_inflation(inflation) for inflation in config.inflations],
        **({"worst_case": [_inflation(one) for one in config.worst_case]} if config.worst_case else {}),
        "provenance": dict(config.provenance),
        "notes": config.notes,
    }
    return yaml_text(tree, header=_HEADER)


def as_written(config: FilterConfig) -> FilterConfig:
    """Return a configuration with the digits that a file carries: what `loads` makes of its text."""
    content = config_json(config)
    precise = ("interval", "provenance")
    times = {key: rounded_content(content[key], digits=CLOCK_DIGITS) for key in precise}
    return load_config({**rounded_content(content), **times}, source=config.name)


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
    return load_config(parse_format(text, source=source, expected_format=FORMAT), source=source)


def load(path: Path) -> FilterConfig:
    """Read a configuration file."""
    text = read_text(path, expected=f"a readable YAML file of format {FORMAT}")
    return loads(text, source=str(path))


def _channel(
    config: FilterConfig, channel: ChannelNoise, span: float, lent: str = "", *, measured: bool = True
) -> dict[str, Any]:
    """Return the entries of an axis; `span`, s, is that of the log, 0 where none is known.

    `lent` is the built-in sensor whose terms stand in, of white noise too unless that is measured.
    """
    identified = {term.name for term in channel.identified}
    limits, states_on_limit = config.on_limit(channel.axis), config.states_on_limit(channel.axis)
    assumed = f"; ASSUMED from {lent}, not yours" if lent else ""

    def noted(value: float, quantity: str, per: str, *, limit: bool = False) -> Noted:
        unstated = NOT_STATED if quantity.partition(".")[0] not in identified else "no state"
        shown = _in_words(value, quantity, channel.unit) if value else unstated
        borrowed_value = assumed if value and not (measured and quantity == "white.density") else ""
        return Noted(
            value, f"{channel.unit}{per}; {shown}{ON_LIMIT if limit and value else ''}{borrowed_value}"
        )

    def state(markov: GaussMarkov) -> Noted:
        on_limit = ON_LIMIT if markov in states_on_limit else assumed
        slow = (
            "; longer than the log: extrapolated"
            if 0.0 < span < markov.time_constant and not on_limit
            else ""
        )
        words = f"{channel.unit}, s; {_in_words(markov.sd, 'level', channel.unit)}{on_limit}{slow}"
        return Noted(_state(markov), words)

    return {
        "unit": channel.unit,
        "identified": [_term(term, channel.unit) for term in channel.identified],
        "filter": {
            "white_density": noted(
                channel.white_density, "white.density", "/√Hz", limit="white_density" in limits
            ),
            "markov": [state(markov) for markov in channel.markov],
            "random_walk_density": noted(
                channel.random_walk_density,
                "random_walk.density",
                "/√s",
                limit="random_walk_density" in limits,
            ),
            "constant_sd": noted(channel.constant_sd, "level", ""),
            "ramp_sd": noted(channel.ramp_sd, "ramp.rate", "/s", limit="ramp_sd" in limits),
        },
        "fates": dict(channel.handling),
    }


def _rest_and_motion(config: FilterConfig) -> dict[str, dict[str, Noted]]:
    """Return the white densities at rest and in motion, where the filter has one number for both."""

    def densities(values: Mapping[str, float], when: str) -> dict[str, Noted]:
        return {
            axis: Noted(value, f"{config.channels[axis].unit}/√Hz; {when}") for axis, value in values.items()
        }

    if not config.noise_in_motion:
        return {}
    return {
        "noise": densities(config.noise, "white, at rest"),
        "noise_in_motion": densities(config.noise_in_motion, "white, in motion: what the filter has"),
    }


def _in_words(value: float, quantity: str, unit: str) -> str:
    return f"{digits(in_customary(value, quantity, unit))} {pretty(customary_unit(quantity, unit))}"


def _term(term: TermEstimate, unit: str) -> dict[str, Any]:
    entries: dict[str, Any] = {"term": term.name}
    for name, coefficient in term.coefficients.items():
        stated = {key: entry for key, entry in codec.dump(coefficient).items() if entry is not None}
        entries[name] = Noted(Inline(stated), phrase(coefficient, f"{term.name}.{name}", unit))
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


def _constants(config: FilterConfig) -> dict[str, Noted]:
    """Return the further states with the sds of their priors, in their customary units too."""
    answer = {}
    for name, sd in config.constants.items():
        state = FILTER_STATES[name]
        unit = pretty(state.unit) if state.unit != "1" else "sd"
        shown = (
            f"; {digits(from_si(sd, state.customary_unit))} {state.customary_unit}"
            if state.customary_unit
            else ""
        )
        answer[name] = Noted(sd, f"{unit}{shown}")
    return answer


def _inflation(inflation: Inflation) -> dict[str, Any]:
    content: dict[str, Any] = codec.dump(inflation)
    if content["interval"]:
        content["interval"] = Noted(Inline(content["interval"]), "95 %, of the drive with all findings")
    if content.get("time_share"):
        content["time_share"] = Noted(
            content["time_share"], "share of the record in which the noise is larger"
        )
    return {key: entry for key, entry in content.items() if entry or key not in {"interval", "causes"}}
