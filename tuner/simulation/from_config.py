"""What to simulate for a log or drive like that of a configuration: its identified noise and its findings.

`channels_of_config` makes a static log, `drive_effects_of_config` adds what a drive showed.

Where a finding carries the noise of its channels without it (`tuner.synthesis.findings.findings_for_config`), that
noise is taken; elsewhere the identified terms. Causes whose spectrum is part of that noise are not added a second
time; telegraph noise is added instead of the Gauss–Markov process of its spectrum::

    sd = size √(low high)/(low + high),  1/T = 1/low + 1/high
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from types import MappingProxyType
from typing import Any

from models.effects import EFFECTS, Effect
from models.effects import drive as navigation
from models.effects import parsing as text
from models.effects.drive.base import DriveEffect
from models.effects.parsing import Kind
from models.effects.static.attitude import Attitude
from models.effects.static.base import STAMP
from models.effects.static.sampling import Quantizer
from models.noise import GaussMarkov, NoiseModel, White
from tuner.simulation.effect_spec import PlacedEffect
from tuner.simulation.imu import noise_of_channel
from tuner.simulation.static import Channel, gravity_of
from tuner.types import FilterConfig
from tuner.types.records import DataError

DRIVE = frozenset({"gyro", "accel", "imu", "gnss", "drive"})
"""Channels of what a drive shows."""
BIAS, CORRELATED = "sensor_bias", "correlated_gnss"
"""Causes of a drive that a configuration holds in its noise."""
SAME_PROCESS = 0.02
"""Difference up to which a term is the process of a telegraph's spectrum."""


def channels_of_config(
    config: FilterConfig, *, drive: bool = False
) -> tuple[dict[str, Channel], tuple[PlacedEffect, ...], tuple[str, ...]]:
    """Return what `tuner.simulation.static.simulate` needs to make a log like the one a configuration comes from.

    Parameters
    ----------
    config : FilterConfig
        Noise and findings.
    drive : bool
        Whether a drive is made: without causes that lie in stamps, and with those of `drive_effects_of_config` besides.

    Returns
    -------
    channels : dict of str to Channel
        Noise and turn-on bias of every axis.
    effects : tuple of PlacedEffect
        Findings, as effects.
    notes : tuple of str
        Findings that no static log can be given from what the configuration tells.

    Raises
    ------
    DataError
        A finding of the configuration that cannot be read.
    """
    static = [finding for finding in config.findings if not of_drive(finding)]
    others = [] if drive else [finding for finding in config.findings if of_drive(finding)]
    notes = [f"{finding.get('cause')} of the drive is left out" for finding in others]
    try:
        without = {
            axis: NoiseModel.from_dict(model)
            for finding in static
            for axis, model in finding.get("extension", {}).get("models", {}).items()
        }
        noise = {axis: without.get(axis) or noise_of_channel(c) for axis, c in config.channels.items()}
        effects: list[PlacedEffect] = []
        fixed: set[str] = set()
        stamps: dict[str, PlacedEffect] = {}  # a simulated log has one clock
        for finding in static:
            known = without.keys() >= set(finding["channels"])
            in_noise = _in_the_noise(finding["cause"], fitted_together=known)
            level = finding.get("extension", {}).get("level")
            for cause, axes, values in _parts(finding):
                if in_noise:
                    rest = _beside(noise[axes[0]], values) if cause == "telegraph" else None
                    if rest is None:
                        continue
                    noise[axes[0]] = rest
                if cause == Quantizer.name and "step" in values:
                    noise |= {a: _unrounded(noise[a], values["step"]["value"], config.interval) for a in axes}
                simulated = set(axes) <= noise.keys() and (cause != Attitude.name or len(axes) == 3)
                effect = _effect(cause, values, _about(level, axes[0])) if simulated else None
                if effect is not None and effect.absolute:
                    fixed |= set(axes)
                if effect is None or (drive and effect.stage == STAMP):
                    notes.append(f"{finding['cause']} in {', '.join(axes)} is left out")
                elif effect.stage == STAMP:
                    stamps.setdefault(finding["cause"], PlacedEffect(effect, tuple(noise)))
                else:
                    effects.append(PlacedEffect(effect, axes))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise DataError(f"{config.name}: expected findings as tune writes them, got {error}") from None
    channels = {
        axis: Channel(noise[axis], 0.0 if axis in fixed else c.constant_sd)
        for axis, c in config.channels.items()
    }
    return channels, (*effects, *stamps.values()), tuple(notes)


def _in_the_noise(cause: str, *, fitted_together: bool) -> bool:
    """Return whether the terms of a channel contain a cause: all that are noise where they were fitted with it.

    Otherwise they are those of the identification, which has a term for some causes.
    """
    effect = EFFECTS.get(cause)
    if effect is None:
        return False
    return effect.is_noise if fitted_together else effect.identified_as is not None


def _beside(noise: NoiseModel, values: Mapping[str, Any]) -> NoiseModel | None:
    """Return the noise beside telegraph noise; None where the process of its spectrum is no term of it."""
    size, low, high = (float(values[name]["value"]) for name in ("size", "dwell_low", "dwell_high"))
    twin = abs(size) * math.sqrt(low * high) / (low + high), low * high / (low + high)
    rest = [
        term
        for term in noise.terms
        if not (
            isinstance(term, GaussMarkov)
            and math.isclose(term.sd, twin[0], rel_tol=SAME_PROCESS)
            and math.isclose(term.time_constant, twin[1], rel_tol=SAME_PROCESS)
        )
    ]
    return NoiseModel(rest) if len(rest) < len(noise.terms) else None


def of_drive(finding: Mapping[str, Any]) -> bool:
    """Whether a finding is that of a drive: its channels are no axes, or it is a bias beyond its prior."""
    return finding.get("cause") == BIAS or set(finding.get("channels", ())) <= DRIVE


def drive_effects_of_config(
    config: FilterConfig, *, receiver: bool
) -> tuple[tuple[DriveEffect, ...], tuple[str, ...]]:
    """Return what a drive showed, as effects of a simulated one, and notes on what is none.

    Parameters
    ----------
    config : FilterConfig
        Noise and findings.
    receiver : bool
        Whether the receiver is that of the configuration: what its noise contains is not added a second time.

    Raises
    ------
    DataError
        A finding of the configuration that cannot be read.
    """
    effects, notes = [], []
    for finding in filter(of_drive, config.findings):
        cause = str(finding.get("cause"))
        if cause == BIAS or (cause == CORRELATED and receiver):
            # The prior of the turn-on constants, and the noise of the receiver, hold it.
            continue
        try:
            values = finding["parameters"]
            sensor = {"sensor": _sensor(values)} if cause == "bias_jump" else {}
            effects.append(_made(cause, values, navigation.EFFECTS, sensor))
        except ValueError as error:
            notes.append(f"{cause} of the drive is left out: {error}")
        except (KeyError, TypeError, AttributeError) as error:
            raise DataError(
                f"{config.name}: expected findings as tune writes them, got {cause} without {error}"
            ) from None
    return tuple(effects), tuple(notes)


def _sensor(values: Mapping[str, Any]) -> str:
    """Return the sensor whose bias jumped by the unit of the jump."""
    return "gyro" if values["x"]["unit"] == "rad/s" else "accel"


def _parts(finding: Mapping[str, Any]) -> list[tuple[str, tuple[str, ...], Mapping[str, Any]]]:
    """Return cause, axes and parameters of each effect that a finding is; of a family, the member that was fitted."""
    cause, axes = str(finding["cause"]), tuple(finding["channels"])
    effect = EFFECTS.get(cause)
    if effect is not None and effect.one_for_all:
        return [(cause, axes, finding["parameters"])]
    plain = {"cause": cause, "parameters": finding["parameters"]}
    of_each = {axis: {**plain, "parameters": own} for axis, own in finding.get("by_channel", {}).items()}
    of_each |= finding.get("extension", {}).get("members", {})
    parts = ((axis, of_each.get(axis, plain)) for axis in axes)
    return [(one["cause"], (axis,), one["parameters"]) for axis, one in parts]


def _about(level: float | None, axis: str) -> float | None:
    """Return the level of a log about what a simulated axis reads without a bias."""
    return None if level is None else level - gravity_of(axis)


def _unrounded(noise: NoiseModel, step: float, interval: float) -> NoiseModel:
    """Return noise as it was before a quantizer added step²/12 to the variance of each sample.

    Of white noise at least what a tenth of a step makes is left: with less the quantizer would not move.
    """
    added, least = step**2 * interval / 12.0, 0.01 * step**2 * interval
    return NoiseModel(
        White(math.sqrt(max(term.density**2 - added, min(least, term.density**2))))
        if isinstance(term, White)
        else term
        for term in noise.terms
    )


def _effect(cause: str, values: Mapping[str, Any], level: float | None) -> Effect | None:
    """Return a finding as an effect; one that lies at readings about the `level` of the log, about no bias.

    None where there is no such effect, its parameters are outside of its range, or the level is not known.
    """
    known = EFFECTS.get(cause)
    if known is None or (known.absolute and level is None):
        return None
    if known.absolute:
        values = {name: {**value, "value": value["value"] - level} for name, value in values.items()}
    try:
        return _made(cause, values, EFFECTS)
    except ValueError:
        return None


def _made(
    cause: str,
    values: Mapping[str, Any],
    kinds: Mapping[str, type[Kind]],
    more: Mapping[str, str] = MappingProxyType({}),
) -> Kind:
    """Return a finding as an effect; ValueError where there is none or its parameters are outside of its range."""
    known = {field.name for field in fields(text.kind(cause, kinds))}
    known_values = {name: value["value"] for name, value in values.items() if name in known}
    for name in known:  # a list is found number by number
        listed = sorted(
            key for key in values if key.rpartition("_")[0] == name and key.rpartition("_")[2].isdigit()
        )
        if listed:
            known_values[name] = tuple(values[key]["value"] for key in listed)
    parts = [
        f"{name}={'/'.join(map(repr, value)) if isinstance(value, tuple) else repr(value)}"
        for name, value in known_values.items()
        if value is not None
    ]
    if values and not parts:
        raise ValueError(f"no effect has {', '.join(values)}")
    return text.parse(f"{cause}:{','.join((*parts, *(f'{k}={v}' for k, v in more.items())))}", kinds)
