"""KF-GINS ``kf-gins.yaml``: white noise and Gauss–Markov biases with one correlation time.

arw deg/√h = N·(180/π)·60, vrw m/s/√h = N·60, gbstd deg/h = σ·(180/π)·3600, abstd mGal = σ/1e-5,
corrtime h = T/3600; the filter forms 2σ²/T. Its one T is the longest time constant of the configuration (1 h
without any), and each σ is refitted at that T so that the bias wanders as far over the memory as the modelled
one. Initial sds are the turn-on constants; the sd of scale factors is assumed: a static log does not show it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from models.units import from_si
from tuner.exporters.figures import Exporter, Target, longest_time, provenance, triad, triple
from tuner.exporters.yamltext import Inline, Noted, yaml_text
from tuner.results import ChannelNoise, FilterConfig
from tuner.synthesis.equivalents import equivalent_markov_sd

SCALE_FACTOR_SD = 300.0
"""Scale-factor sd, ppm: assumed, as a static log cannot show it."""


def write(config: FilterConfig, target: Target) -> str:
    """Return the ``imunoise`` and initial-bias entries of KF-GINS."""
    time_constant = longest_time(config)
    gyro, accel = triad(config, "gyro"), triad(config, "accel")

    def sd(channel: ChannelNoise) -> float:
        return equivalent_markov_sd(channel, time_constant, memory=target.memory)

    noise: dict[str, Any] = {}
    start: dict[str, Any] = {}
    if gyro:
        noise["arw"] = _axes(gyro, lambda c: from_si(c.white_density, "deg/sqrt(h)"), "deg/√h; N·(180/π)·60")
        noise["gbstd"] = _axes(gyro, lambda c: from_si(sd(c), "deg/h"), "deg/h; σ·(180/π)·3600")
        noise["gsstd"] = _scale()
        start["initbgstd"] = _axes(gyro, lambda c: from_si(c.constant_sd, "deg/h"), "deg/h; turn-on sd")
    if accel:
        noise["vrw"] = _axes(accel, lambda c: from_si(c.white_density, "m/s/sqrt(h)"), "m/s/√h; N·60")
        noise["abstd"] = _axes(accel, lambda c: from_si(sd(c), "mGal"), "mGal; σ/1e-5")
        noise["asstd"] = _scale()
        start["initbastd"] = _axes(accel, lambda c: from_si(c.constant_sd, "mGal"), "mGal; turn-on sd")
    noise["corrtime"] = Noted(time_constant / 3600.0, "h; T/3600, one for all states")
    header = (
        *provenance(config, "KF-GINS: entries of kf-gins.yaml"),
        f"one T = {time_constant:g} s for all states (the longest in the configuration, or 1 h); each σ lets "
        f"the bias wander as far in {target.memory:g} s (assumed memory of the filter) as the modelled one",
    )
    return yaml_text({"imunoise": noise, **start}, header=header)


def _axes(channels: tuple[ChannelNoise, ...], quantity: Callable[[ChannelNoise], float], note: str) -> Noted:
    values, words = triple(channels, quantity, note)
    return Noted(Inline(values), words)


def _scale() -> Noted:
    return Noted(Inline([SCALE_FACTOR_SD] * 3), "ppm; assumed, a static log does not show it")


EXPORTER = Exporter("kf-gins", "KF-GINS kf-gins.yaml", "deg/√h, m/s/√h, deg/h, mGal, ppm, h", write)
