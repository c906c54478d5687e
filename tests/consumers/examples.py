"""Configurations that the consumers are tried with, and what they model."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from tests.consumers.filters import STEP
from tuner.exporters import export
from tuner.synthesis.load_config import load_config
from tuner.types import ChannelNoise, FilterConfig, GnssNoise, InitialUncertainty

LAGS = np.array([1.2, 12.0, 96.0])
"""Horizons, s: whole steps of 10, 12 and 8 ms."""


@functools.cache
def walking() -> FilterConfig:
    """Return white noise and a random walk alone, which every filter with a bias can hold: N, K, no state."""
    gyro = [ChannelNoise(f"gyro_{a}", "rad/s", 2e-4, (), 3e-6, 1e-3) for a in "xyz"]
    accel = [ChannelNoise(f"accel_{a}", "m/s^2", 3e-3, (), 5e-5, 0.05) for a in "xyz"]
    channels = {channel.axis: channel for channel in (*gyro, *accel)}
    receiver = GnssNoise((1.0, 1.0, 2.0), None, 1.0, 5.0)
    return moved(FilterConfig("walking", STEP, channels, InitialUncertainty(1.0, 0.1, 0.005, 0.1), receiver))


@functools.cache
def laddered() -> FilterConfig:
    """Return a built-in MEMS grade, whose flicker is four states: no consumer has as many."""
    return moved(replace(load_config("icm20602"), interval=STEP))


def moved(config: FilterConfig) -> FilterConfig:
    """Return a configuration whose white noise was measured in motion: autopilots load it."""
    white = {axis: channel.white_density for axis, channel in config.channels.items()}
    return replace(config, noise=white, noise_in_motion=white)


EXAMPLES = {"walk": walking, "flicker": laddered}


@functools.cache
def text_of(name: str, dialect: str) -> str:
    """Return the export of an example."""
    return export(EXAMPLES[name](), dialect)


def modelled_allan_variance(channel: ChannelNoise, tau: np.ndarray) -> np.ndarray:
    """Return the Allan variance of a channel as configured, unit²."""
    found = channel.white_density**2 / tau + channel.random_walk_density**2 * tau / 3.0
    for state in channel.markov:
        found = found + state.allan_variance(tau)
    return found
