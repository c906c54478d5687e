"""Errors-in-variables bias of fitted constants, by simulation–extrapolation.

Sensitivities S are computed along the filter's own trajectory and from the measured rates, which contain the same
noise as the whitened innovations W: E SᵀW is not 0 where no cause is present. Where a drive has little information on
a constant, as slopes of 0.03 have on gravity, and attitudes are as uncertain, that bias grows with the length of the
drive: on an hour with gyros of 2°/√h it is 3.5 sds for gravity and 2.4 for scale factors of the gyros. Adding the
configured noise to the drive once more shows it, as in the first step of simulation–extrapolation [1]_::

    θ = (λ + Sᵀ S)⁻¹ (S₁ − S)ᵀ (W₁ − W)

with constants in sds of their priors and λ small, so that nothing is subtracted where a drive has no information. One
addition determines the bias to a tenth of a sd.

References
----------
.. [1] J. R. Cook, L. A. Stefanski, Simulation-extrapolation estimation in parametric measurement error models,
   J. Amer. Statist. Assoc. 89 (1994).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.arrays import BoolArray, FloatArray
from models.earth import llh_displaced
from tuner.diagnosis.drive.causes.base import prior_sds
from tuner.diagnosis.drive.hypothesis import FilterRun, run_filter
from tuner.linear_run.likelihood import as_configured, evaluate
from tuner.navigation.drive.run import reported_sds
from tuner.navigation.settings import ACCELS, GYROS
from tuner.types.records import DataError, Drive

ADDED_NOISE_SEED = 0
"""Seed of the noise that is added: the same drive gives the same diagnosis."""
PRIOR_RIDGE = 0.05
"""λ: information, in units of the prior's, below which the bias of a constant is not corrected.

Chosen small, so that only constants that the drive hardly observes keep their bias.
"""
MAX_CHANGE = 7.0
"""Largest change of a whitened innovation that counts: five sds of the difference of two."""


def errors_in_variables_bias(drive: Drive, run: FilterRun) -> FloatArray:
    """Return the bias of the constants of a run, (p,); zeros where the noisier drive cannot be aligned.

    Parameters
    ----------
    drive : Drive
        In the axes of the sensor.
    run : FilterRun
        Of the drive.
    """
    try:
        other = run_filter(
            with_more_noise(drive, run, np.random.default_rng(ADDED_NOISE_SEED)), run.hypothesis
        )
    except DataError:
        return np.zeros(len(run.linearized.parameters))
    white, slope, rows = _whitened(run)
    white_1, slope_1, rows_1 = _whitened(other)
    rows &= rows_1
    prior = prior_sds(run.linearized.parameters)
    s = slope[rows] * prior
    pull = (slope_1[rows] * prior - s).T @ np.clip(white_1[rows] - white[rows], -MAX_CHANGE, MAX_CHANGE)
    return np.asarray(prior * np.linalg.solve(PRIOR_RIDGE * np.eye(len(prior)) + s.T @ s, pull))


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
    from scipy.signal import lfilter  # a sixth of a second to load

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
