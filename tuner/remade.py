"""A configuration made a simulation again: the noise that was identified, and the findings hidden in it.

Where a finding carries the noise of its channels without it (`tuner.agreement.findings_for_config`), that noise is
taken; elsewhere the identified terms (`tuner.agreement.agreed`). Causes whose spectrum is part of that noise are not
hidden a second time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from models.effects import EFFECTS, Effect, parse
from models.noise import NoiseModel
from tuner.agreement import IN_THE_NOISE, MARKOV
from tuner.hidden import Hidden
from tuner.navigation.sensor import noise_of_channel
from tuner.records import DataError
from tuner.results import FilterConfig
from tuner.simulation import Channel

TOGETHER = ("attitude", "cross_axis", "timing")
"""Causes that are one in all of their channels; the others are one in each."""
UNPLACED = ("clipping",)
"""Causes that lie at readings, and of the mean reading a configuration says nothing."""


def remade(config: FilterConfig) -> tuple[dict[str, Channel], tuple[Hidden, ...], tuple[str, ...]]:
    """Return what `tuner.simulation.simulate` needs to make a log like the one a configuration comes from.

    Parameters
    ----------
    config : FilterConfig
        Noise and findings.

    Returns
    -------
    channels : dict of str to Channel
        Noise and turn-on bias of every axis.
    hidden : tuple of Hidden
        Findings, as effects.
    notes : tuple of str
        Findings that no static log can be given from what the configuration tells.

    Raises
    ------
    DataError
        A finding of the configuration that cannot be read.
    """
    static = [finding for finding in config.findings if "channels" in finding]
    notes = [
        f"{finding.get('cause')} of the drive is left out"
        for finding in config.findings
        if finding not in static
    ]
    try:
        without = {
            axis: NoiseModel.from_dict(model)
            for finding in static
            for axis, model in finding.get("extension", {}).get("models", {}).items()
        }
        noise = {axis: without.get(axis) or noise_of_channel(c) for axis, c in config.channels.items()}
        hidden: list[Hidden] = []
        for finding in static:
            known = without.keys() >= set(finding["channels"])
            if finding["cause"] in (IN_THE_NOISE if known else ("line", *MARKOV)):
                continue
            for axes, values in _parts(finding):
                effect = _effect(finding["cause"], values) if set(axes) <= noise.keys() else None
                if effect is None:
                    notes.append(f"{finding['cause']} in {', '.join(axes)} is left out")
                else:
                    hidden.append(Hidden(effect, axes))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        msg = f"{config.name}: expected findings as tune writes them, got {error}"
        raise DataError(msg) from None
    channels = {axis: Channel(noise[axis], c.constant_sd) for axis, c in config.channels.items()}
    return channels, tuple(hidden), tuple(notes)


def _parts(finding: Mapping[str, Any]) -> list[tuple[tuple[str, ...], Mapping[str, Any]]]:
    """Return the axes and parameters of each effect that a finding is."""
    axes = tuple(finding["channels"])
    if finding["cause"] in TOGETHER:
        return [(axes, finding["parameters"])]
    return [((axis,), finding.get("by_channel", {}).get(axis, finding["parameters"])) for axis in axes]


def _effect(cause: str, values: Mapping[str, Any]) -> Effect | None:
    """Return a finding as an effect, None where there is none or its parameters are outside of its range."""
    if cause not in EFFECTS or cause in UNPLACED:
        return None
    known = {field.name for field in fields(EFFECTS[cause])}
    told = {name: value["value"] for name, value in values.items() if name in known}
    written = ",".join(f"{name}={value!r}" for name, value in told.items() if value is not None)
    try:
        return parse(f"{cause}:{written}")
    except ValueError:
        return None
