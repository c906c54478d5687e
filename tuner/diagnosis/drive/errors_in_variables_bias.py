"""What noise by itself makes of constants: errors in variables.

Sensitivities S are taken along the filter's own way and from the measured rates, which err by the very noise that
makes the whitened innovations W: E SᵀW is not 0 where nothing is hidden. Where a drive says little of a constant, as
slopes of 0.03 say of gravity, and attitudes are as uncertain, that grows with the drive: on an hour with gyros of
2°/√h gravity leans by 3.5 sds, scale factors of the gyros by 2.4. The configured noise, added to the drive once more,
tells it, as in the first step of simulation–extrapolation [1]_::

    θ = (λ + Sᵀ S)⁻¹ (S₁ − S)ᵀ (W₁ − W)

with constants in sds of their priors and λ small: where a drive says nothing, nothing is taken out. One addition
tells it to a tenth of a sd.

References
----------
.. [1] J. R. Cook, L. A. Stefanski, Simulation-extrapolation estimation in parametric measurement error models,
   J. Amer. Statist. Assoc. 89 (1994).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from models.earth import llh_displaced
from tuner.diagnosis.drive.causes.base import prior_sds
from tuner.diagnosis.drive.hypothesis import FilterRun, run_filter
from tuner.diagnosis.drive.linear_model.likelihood import as_configured, evaluate
from tuner.navigation.drive.run import reported_sds
from tuner.navigation.settings import ACCELS, GYROS
from tuner.types.records import DataError, Drive

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SEED = 0
"""Of the noise that is added."""
RIDGE = 0.05
"""Where a drive says less of a constant than this share of what its prior does, nothing is taken out."""
MAX_CHANGE = 7.0
"""Largest change of a whitened innovation that counts: five sds of the difference of two."""


def errors_in_variables_bias(drive: Drive, run: FilterRun) -> FloatArray:
    """Return what noise makes of the constants of a pass, (p,); zeros where the noisier drive cannot be aligned.

    Parameters
    ----------
    drive : Drive
        In sensor axes.
    run : FilterRun
        Of the drive.
    """
    try:
        other = run_filter(with_more_noise(drive, run, np.random.default_rng(SEED)), run.hypothesis)
    except DataError:
        return np.zeros(len(run.linearized.parameters))
    white, slope, rows = _whitened(run)
    white_1, slope_1, rows_1 = _whitened(other)
    rows &= rows_1
    prior = prior_sds(run.linearized.parameters)
    s = slope[rows] * prior
    pull = (slope_1[rows] * prior - s).T @ np.clip(white_1[rows] - white[rows], -MAX_CHANGE, MAX_CHANGE)
    return np.asarray(prior * np.linalg.solve(RIDGE * np.eye(len(prior)) + s.T @ s, pull))


def with_more_noise(drive: Drive, run: FilterRun, rng: np.random.Generator) -> Drive:
    """Return a drive with the configured noise of sensors and receiver added once more."""
    config, rates = run.hypothesis.config, drive.rates.copy()
    step = float(np.median(np.diff(drive.imu_t)))
    for i, axis in enumerate((*GYROS, *ACCELS)):
        channel = config.channels[axis]
        rates[:, i] += channel.white_density / np.sqrt(step) * rng.standard_normal(len(rates))
        if channel.random_walk_density > 0.0:
            walk = np.cumsum(rng.standard_normal(len(rates)))
            rates[:, i] += channel.random_walk_density * np.sqrt(step) * walk
        for state in channel.markov:
            rates[:, i] += state.sd * _markov((len(rates),), step / state.time_constant, rng)
    gnss = drive.gnss
    sd = reported_sds(gnss, run.settings)
    sd[run.index] = run.linearized.sd
    errors = sd * rng.standard_normal(sd.shape)
    if config.gnss is not None:
        step = float(np.median(np.diff(gnss.t)))
        for state in config.gnss.correlated:
            axes = state.sd * np.array([1.0, 1.0, config.gnss.correlated_down])
            errors[:, :3] += axes * _markov((len(gnss), 3), step / state.time_constant, rng)
    fixes = replace(gnss, llh=llh_displaced(gnss.llh, errors[:, :3]), vel_n=gnss.vel_n + errors[:, 3:])
    return replace(drive, rates=rates, gnss=fixes)


def _markov(shape: tuple[int, ...], rate: float, rng: np.random.Generator) -> FloatArray:
    """Return a Gauss–Markov process of variance 1 along the first axis, `rate` in steps by its time constant."""
    drawn = rng.standard_normal(shape)
    drawn[1:] *= np.sqrt(-np.expm1(-2.0 * rate))
    return np.asarray(lfilter([1.0], [1.0, -np.exp(-rate)], drawn, axis=0))


def _whitened(run: FilterRun) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return whitened innovations and sensitivities of every fix of the drive, and the rows that count."""
    noise = as_configured(run.linearized)
    every = evaluate(replace(noise, columns=tuple(range(len(run.linearized.parameters)))))
    root = np.sqrt(every.variance)
    white = (every.innovation + every.sensitivity @ every.theta) / root
    k = len(run.hypothesis.position_out)
    whole = np.zeros((k, 6)), np.zeros((k, 6, len(every.theta))), np.zeros((k, 6), dtype=bool)
    for to, part in zip(whole, (white, every.sensitivity / root[..., None], noise.counted), strict=True):
        to[run.index] = part
    return whole
