"""The settings of a filter in few rows: axes that agree within their intervals share one; customary units."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass, replace
from math import isclose
from statistics import fmean

from tuner.formats.customary_units import customary_unit, digits, in_customary, pretty, with_interval
from tuner.report.agreeing_rows import joined_rows
from tuner.synthesis.prediction import FITTED
from tuner.types import BoundUsed, ChannelNoise, Coefficient, FilterConfig

SAME_RELATIVE = 1e-3
"""Relative difference up to which a setting is the identified value itself: files keep six digits."""
EXTRAPOLATED = "†"
"""Behind a time constant that is longer than the log: its state continues what shorter ones show."""
SHOWN_DIGITS = 2
"""Digits in which numbers without an interval must be the same to share a row."""


@dataclass(frozen=True)
class Setting:
    """One number as the filter gets it, in its customary unit.

    Attributes
    ----------
    used : tuple of float
        What each axis of the row gets.
    low, high : float or None
        95 % interval over these axes; None where the number has none of its own.
    bounded : bool
        Whether some of them are half of a 95 % limit, or time constants longer than the log.
    """

    used: tuple[float, ...]
    low: float | None = None
    high: float | None = None
    bounded: bool = False

    @property
    def text(self) -> str:
        """The number with its interval, both ends where it is not symmetric; a star where it is only bounded.

        A dash where the filter has no such term: neither log nor sheet speaks of it, which is no measured zero.
        """
        if not any(self.used):
            return "–"
        lowest, highest = digits(min(self.used)), digits(max(self.used))
        if self.low is None or self.high is None or self.bounded:
            return (lowest if lowest == highest else f"{lowest} to {highest}") + "*" * self.bounded
        value = fmean(self.used)
        return with_interval(value, self.low, self.high, between=" to ")

    def agrees(self, other: Setting) -> bool:
        """Whether both may be one number."""
        if self.low is None or self.high is None or other.low is None or other.high is None:
            return digits(fmean(self.used), SHOWN_DIGITS) == digits(fmean(other.used), SHOWN_DIGITS)
        return self.low <= other.high and other.low <= self.high

    def joined(self, other: Setting) -> Setting:
        """Return the number of both."""
        ends = (self.low, self.high, other.low, other.high)
        known = [end for end in ends if end is not None]
        low, high = (min(known), max(known)) if len(known) == len(ends) else (None, None)
        return Setting(self.used + other.used, low, high, self.bounded or other.bounded)


@dataclass(frozen=True)
class SettingsRow:
    """Settings of the filter for axes of one sensor that agree.

    Attributes
    ----------
    axes : tuple of str
        Channels.
    unit : str
        SI unit of their samples.
    white, walk : Setting
        Density of the white noise and of the random walk of the bias.
    states : tuple of (Setting, Setting)
        Sd and time constant, s, of each bias state.
    fitted : bool
        Whether the numbers are fitted to the Allan curve.
    """

    axes: tuple[str, ...]
    unit: str
    white: Setting
    walk: Setting
    states: tuple[tuple[Setting, Setting], ...]
    fitted: bool

    @property
    def bias(self) -> str:
        """The bias states, those of one sd together: ``20.3 ± 2.2 at 1, 10, 100 s``."""
        times: dict[str, list[str]] = {}
        for sd, time in self.states:
            shown = "/".join(dict.fromkeys(_seconds(t) for t in time.used))
            times.setdefault(sd.text, []).append(shown + EXTRAPOLATED * (time.bounded and not sd.bounded))
        return "; ".join(f"{sd} at {', '.join(at)} s" for sd, at in times.items()) or "none"

    def agrees(self, other: SettingsRow) -> bool:
        """Whether all numbers of both may be the same."""
        if (self.unit, self.fitted, len(self.states)) != (other.unit, other.fitted, len(other.states)):
            return False
        pairs = [(self.white, other.white), (self.walk, other.walk)]
        pairs += [
            pair for a, b in zip(self.states, other.states, strict=True) for pair in zip(a, b, strict=True)
        ]
        return all(a.agrees(b) for a, b in pairs)

    def joined(self, other: SettingsRow) -> SettingsRow:
        """Return the row of the axes of both."""
        states = tuple(
            (a.joined(b), s.joined(t)) for (a, s), (b, t) in zip(self.states, other.states, strict=True)
        )
        white, walk = self.white.joined(other.white), self.walk.joined(other.walk)
        return replace(self, axes=self.axes + other.axes, white=white, walk=walk, states=states)


def settings_rows(config: FilterConfig) -> list[SettingsRow]:
    """Return the settings, one row for axes that agree; in the order of the axes."""
    bounded = {str(one.quantity) for one in config.inflations if isinstance(one, BoundUsed)}
    span = float(config.provenance.get("span") or 0.0)
    return joined_rows(_row(channel, bounded, span) for channel in config.channels.values())


def _seconds(time: float) -> str:
    text = digits(time)
    return text.rstrip("0").removesuffix(".") if "." in text else text


def units_of(unit: str) -> tuple[str, str, str]:
    """Return the customary units of white noise, bias states and random walk of a sensor."""
    white, level, walk = (
        pretty(customary_unit(q, unit)) for q in ("white.density", "level", "random_walk.density")
    )
    return white, level, walk


def _row(channel: ChannelNoise, bounded: Set[str], span: float) -> SettingsRow:
    walk = _setting(channel, channel.random_walk_density, "random_walk")
    if f"{channel.axis}.random_walk.density" in bounded:
        walk = _half_limit(walk)
    white = _setting(channel, channel.white_density, "white")
    if white.low is None and f"{channel.axis}.white.density" in bounded:
        white = _half_limit(white)
    ladder_bounded = f"{channel.axis}.bias_instability.level" in bounded
    states = [
        (
            _state_sd(channel, s.sd, s.time_constant),
            Setting((s.time_constant,), bounded=0.0 < span < s.time_constant),
        )
        for s in channel.markov
    ]
    return SettingsRow(
        (channel.axis,),
        channel.unit,
        white,
        walk,
        tuple((_half_limit(sd) if ladder_bounded and sd.low is None else sd, time) for sd, time in states),
        FITTED in channel.handling.values(),
    )


def _half_limit(setting: Setting) -> Setting:
    return Setting(setting.used, 0.0, 2.0 * setting.used[0], bounded=True)


def _setting(channel: ChannelNoise, value: float, term: str) -> Setting:
    """Return a density, with the interval of the term that it is."""
    quantity = f"{term}.density"
    found = _identified(channel, term, "density", value)
    used = (in_customary(value, quantity, channel.unit),)
    if found is None or found.interval is None:
        return Setting(used)
    low, high = (in_customary(end, quantity, channel.unit) for end in found.interval)
    return Setting(used, low, high)


def _state_sd(channel: ChannelNoise, sd: float, time: float) -> Setting:
    """Return the sd of a bias state; those of the ladder have the relative interval of the flicker behind them."""
    used = (in_customary(sd, "level", channel.unit),)
    if FITTED in channel.handling.values():
        return Setting(used)
    own = _identified(channel, "gauss_markov", "sd", sd)
    slow = _identified(channel, "gauss_markov", "time_constant", time)
    flicker = _identified(channel, "bias_instability", "level")
    source = own if own is not None and slow is not None else flicker
    if source is None or source.interval is None or not source.value:
        return Setting(used)
    low, high = (used[0] * end / source.value for end in source.interval)
    return Setting(used, low, high)


def _identified(
    channel: ChannelNoise, term: str, parameter: str, value: float | None = None
) -> Coefficient | None:
    """Return a coefficient that the log determined, of a given value where one is given."""
    for estimate in channel.identified:
        found = estimate.coefficients.get(parameter) if estimate.name == term else None
        if found is None or found.value is None:
            continue
        if value is None or isclose(found.value, value, rel_tol=SAME_RELATIVE):
            return found
    return None
