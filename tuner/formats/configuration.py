"""Filter configurations as plain values, format ``tuner-noise/1``: the content of a ``noise.yaml`` and of JSON results.

Layout::

    sensors: SENSOR: AXIS: {unit, identified: [terms], filter: {white_density, markov, …}, fates}
    initial: P0 with reasons      gnss: R and gate      findings: […]
    compensation: {NAME: value}   constants: {STATE: sd of its prior}   time_constants: {STATE: s}
    inflations, worst_case: [{quantity, kind, factor, reason, …}]   provenance: {…}       notes: […]
    noise, noise_in_motion: {AXIS: white density at rest, in motion}, where a drive showed them to differ
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, Self

from models.filter_states import named_state
from models.noise import GaussMarkov
from models.registry import RegistryError
from tuner.formats.codec import dump, load, stored_form
from tuner.formats.document_errors import refuse
from tuner.formats.noise_terms import require_possible
from tuner.types import (
    ChannelNoise,
    Compensation,
    Enlargement,
    FilterConfig,
    GnssNoise,
    Inflation,
    InitialUncertainty,
    TermEstimate,
)
from tuner.types.number_ranges import NonNegative, Positive, SamplingInterval

FORMAT: Literal["tuner-noise/1"] = "tuner-noise/1"


def config_json(config: FilterConfig) -> dict[str, Any]:
    """Return a configuration as plain values, every number in full."""
    content: dict[str, Any] = dump(config)
    return content


def load_config(content: object, *, source: str) -> FilterConfig:
    """Return the configuration of plain values.

    Raises
    ------
    DataError
        One line: file, place, expected, found.
    """
    return load(content, FilterConfig, source=source)


@dataclass(frozen=True, kw_only=True)
class _FilterForm:
    """What a filter needs of one axis."""

    white_density: NonNegative
    markov: tuple[GaussMarkov, ...] = ()
    random_walk_density: NonNegative
    constant_sd: NonNegative
    ramp_sd: NonNegative


@dataclass(frozen=True, kw_only=True)
class _AxisForm:
    """One axis, whose name is its key."""

    unit: str
    identified: tuple[TermEstimate, ...] = ()
    filter: _FilterForm
    fates: Mapping[str, str] = field(default_factory=dict)


@stored_form(FilterConfig)
@dataclass(frozen=True, kw_only=True)
class _ConfigForm:
    """A configuration, its axes sorted by sensor."""

    format: Literal["tuner-noise/1"] = FORMAT
    name: str
    interval: SamplingInterval
    sensors: Mapping[str, Mapping[str, _AxisForm]]
    initial: InitialUncertainty
    gnss: GnssNoise | None
    compensation: Compensation = field(default_factory=Compensation)
    constants: Mapping[str, NonNegative] = field(default_factory=dict)
    time_constants: Mapping[str, Positive] = field(default_factory=dict)
    findings: tuple[Mapping[str, Any], ...] = ()
    inflations: tuple[Inflation, ...] = ()
    worst_case: tuple[Enlargement, ...] = ()
    noise: Mapping[str, NonNegative] = field(default_factory=dict)
    noise_in_motion: Mapping[str, NonNegative] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, config: FilterConfig, /) -> Self:
        """Return the form of a configuration."""
        sensors: dict[str, dict[str, _AxisForm]] = {}
        for axis, channel in config.channels.items():
            sensors.setdefault(axis.rpartition("_")[0] or axis, {})[axis] = _AxisForm(
                unit=channel.unit,
                identified=channel.identified,
                filter=_FilterForm(
                    white_density=channel.white_density,
                    markov=channel.markov,
                    random_walk_density=channel.random_walk_density,
                    constant_sd=channel.constant_sd,
                    ramp_sd=channel.ramp_sd,
                ),
                fates=channel.handling,
            )
        same = {key: value for key, value in vars(config).items() if key != "channels"}
        return cls(sensors=sensors, **same)

    def restored(self) -> FilterConfig:
        """Return the configuration."""
        for key, states in (("constants", self.constants), ("time_constants", self.time_constants)):
            for name in states:
                try:
                    named_state(name)
                except RegistryError as error:
                    refuse("a declared filter state", str(error), key)
        for name in self.time_constants:
            if name not in self.constants:
                refuse("a state that is among 'constants' too", repr(name), "time_constants")
        for sensor, axes in self.sensors.items():
            for axis, form in axes.items():
                if form.unit not in {"rad/s", "m/s^2"}:
                    refuse("'rad/s' or 'm/s^2'", repr(form.unit), "sensors", sensor, axis, "unit")
                numbers = vars(form.filter) | {
                    "markov": max((one.sd for one in form.filter.markov), default=0.0)
                }
                for key, number in numbers.items():
                    require_possible(number, form.unit, "sensors", sensor, axis, "filter", key)
        channels = {
            axis: ChannelNoise(
                axis, form.unit, **vars(form.filter), identified=form.identified, handling=form.fates
            )
            for sensor in self.sensors.values()
            for axis, form in sensor.items()
        }
        same = {key: value for key, value in vars(self).items() if key not in {"sensors", "format"}}
        return FilterConfig(channels=channels, **same)
