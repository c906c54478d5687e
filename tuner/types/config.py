"""The settings of a navigation filter: noise densities, Gauss–Markov states, initial uncertainties, GNSS errors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Self

from models.noise import GaussMarkov
from tuner.types.compensation import Compensation
from tuner.types.identification import TermEstimate
from tuner.types.inflation import BoundUsed, Enlargement, Inflation
from tuner.types.number_ranges import NonNegative, Positive, SamplingInterval
from tuner.types.shown import Shown

_SETTINGS = {
    "white": "white_density",
    "low_pass_white": "white_density",
    "random_walk": "random_walk_density",
    "ramp": "ramp_sd",
}
"""Terms with the setting of an axis that they enter; all others enter its states."""


@dataclass(frozen=True)
class ChannelNoise:
    """Noise of one axis as the filter is configured for it (SI).

    Attributes
    ----------
    axis, unit : str
        Channel and unit of its samples.
    white_density : float
        unit/√Hz.
    markov : tuple of GaussMarkov
        Gauss–Markov bias states (a ladder stands for flicker).
    random_walk_density : float
        Drive of the bias random walk, unit/√s; 0 where there is none.
    constant_sd : float
        Prior sd of the turn-on constant.
    ramp_sd : float
        Prior sd of a constant bias rate, unit/s; 0 where no ramp state is wanted.
    identified : tuple of TermEstimate
        The terms behind the choice.
    handling : mapping of str to str
        What became of each term, such as ``quantization``: "kept out of the white density: …".
    """

    axis: str
    unit: str
    white_density: float
    markov: tuple[GaussMarkov, ...]
    random_walk_density: float
    constant_sd: float
    ramp_sd: float = 0.0
    identified: tuple[TermEstimate, ...] = ()
    handling: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))

    def scaled(self, white: float, slow: float) -> Self:
        """Return the noise of the axis with its white density, and with its states and walk, times a factor."""
        return replace(
            self,
            white_density=white * self.white_density,
            random_walk_density=slow * self.random_walk_density,
            markov=tuple(replace(state, sd=slow * state.sd) for state in self.markov),
        )


@dataclass(frozen=True)
class GnssNoise:
    """GNSS errors the filter assumes: sd north, east, down (m, m/s), update interval (s), gate (sigmas).

    `correlated` are Gauss–Markov errors of the position, alike north and east; down their sd is `correlated_down` times
    as large.
    """

    position_sd: tuple[NonNegative, NonNegative, NonNegative]
    velocity_sd: tuple[NonNegative, NonNegative, NonNegative] | None
    interval: SamplingInterval
    gate: Positive
    correlated: tuple[GaussMarkov, ...] = ()
    reference: str = ""
    correlated_down: Positive = 1.0


@dataclass(frozen=True)
class InitialUncertainty:
    """P0 apart from the biases: sd of position (m), velocity (m/s), tilt and heading (rad), with the reason of each."""

    position: NonNegative
    velocity: NonNegative
    tilt: NonNegative
    heading: NonNegative
    reasons: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))


@dataclass(frozen=True, repr=False)
class FilterConfig(Shown):
    """Settings of a navigation filter, with the reason of every choice.

    `channels` are keyed by axis (``gyro_x`` … ``accel_z``); a sensor the log lacks is absent, and `notes` says so.
    `findings` are what `diagnose` found, with their extensions, as plain values. `compensation` is what is taken out of
    a drive before it is filtered, `constants` further states of the filter, names of
    `models.filter_states.named_states`, with the sds of their priors, `time_constants` those of them that are
    first-order processes with another time constant than declared; SI. `worst_case` says by how much the noise is
    larger while a stretch of the record lasts that the settings count by its share of the time. `noise` and
    `noise_in_motion` are white densities by axis at rest and in motion, where a drive showed them to differ: the filter
    has one number, that in motion.
    """

    name: str
    interval: float
    channels: Mapping[str, ChannelNoise]
    initial: InitialUncertainty
    gnss: GnssNoise | None
    inflations: tuple[Inflation, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    notes: tuple[str, ...] = ()
    findings: tuple[Mapping[str, Any], ...] = ()
    compensation: Compensation = field(default_factory=Compensation)
    constants: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    time_constants: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    worst_case: tuple[Enlargement, ...] = ()
    noise: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    noise_in_motion: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    def on_limit(self, axis: str) -> Mapping[str, float]:
        """Return the settings of an axis that a term of which only a 95 % limit is known enters, with the share of it.

        Keys are ``white_density``, ``markov``, ``random_walk_density``, ``ramp_sd``.
        """
        return {
            _SETTINGS.get(one.quantity.field.partition(".")[0], "markov"): one.factor
            for one in self.inflations
            if isinstance(one, BoundUsed) and one.factor > 0.0 and one.quantity.owner == axis
        }

    def bias_on_limit(self, axis: str) -> bool:
        """Return whether the numbers that stand for the wandering bias of an axis rest on a limit."""
        return not {"markov", "random_walk_density"}.isdisjoint(self.on_limit(axis))

    def states_on_limit(self, axis: str) -> tuple[GaussMarkov, ...]:
        """Return the states of an axis that rest on a limit: all but those nearest to measured time constants."""
        if "markov" not in self.on_limit(axis):
            return ()
        channel = self.channels[axis]
        measured = [
            term.coefficients["time_constant"].value
            for term in channel.identified
            if term.present and "time_constant" in term.coefficients
        ]
        own = [
            min(channel.markov, key=lambda state: abs(math.log(state.time_constant / time)), default=None)
            for time in measured
            if time
        ]
        return tuple(state for state in channel.markov if state not in own)
