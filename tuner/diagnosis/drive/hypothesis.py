"""A hypothesis about a drive (configuration, compensation, fixes left out), and the filter run under it.

`run_filter` takes the compensation out of the drive, aligns, filters, and linearises the run. Everything is in the
axes of the sensor, whatever its mounting.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from models.arrays import BoolArray, FloatArray
from models.effects.drive.gnss import middle_of
from models.filter_states.built_in import CORRELATED_VELOCITY
from models.noise import GaussMarkov
from tuner.diagnosis.drive.cause_test import CauseTest, scaled_factor
from tuner.diagnosis.drive.linear_model.linearize import linearize
from tuner.diagnosis.drive.linear_model.noise_parameters import ROW_GROUPS
from tuner.linear_run.likelihood import as_configured
from tuner.linear_run.linearized_run import NOISE_GROUPS, LinearizedRun
from tuner.linear_run.whitened_innovations import WhitenedInnovations, whiten
from tuner.navigation.compensation import (
    compensate,
    compensate_settings,
    corrected_stamps,
    correction,
)
from tuner.navigation.data import Solution
from tuner.navigation.drive.run import Stretch, initial_estimates, navigate, prepare, reported_sds
from tuner.navigation.drive.thinning import irregular_rows
from tuner.navigation.fix_sd_model import GNSS_NOISE_SCALE, FixSdModel
from tuner.navigation.settings import FilterSettings, filter_settings
from tuner.types import Compensation, FilterConfig, Parameter
from tuner.types.clock import Clock
from tuner.types.records import Drive

MAX_FIXES = 1000
"""Fixes that a diagnosis uses, of more of them: its cost grows with them, while constants are known well
enough.
"""


NEGLIGIBLE_CHANGE = 0.05
"""Relative difference of values that changes a filter's innovations by less than their scatter.

It is the accuracy of an sd from two hundred fixes, 1/√400.
"""


@dataclass(frozen=True)
class Jump:
    """A jump of the bias of a sensor, ``gyro`` or ``accel``: time, s, and change, shape (3,)."""

    time: float
    sensor: str
    size: FloatArray


@dataclass(frozen=True)
class Hypothesis:
    """Configuration, compensation, jumps and fixes left out under which a drive is filtered.

    Attributes
    ----------
    config : FilterConfig
        Noise of the sensor and of the receiver.
    compensation : Compensation
        What is taken out of the drive.
    position_out, velocity_out : ndarray of bool, shape (k,)
        Fixes of the drive whose position (and velocity), or velocity alone, is left out.
    not_looked_at : ndarray of bool, shape (k,)
        Fixes by which the drive is aligned, and that are not filtered: there are enough others.
    jumps : tuple of Jump
        Jumps of biases, on the clock of the inertial unit.
    errors_in_variables_bias : ndarray, shape (p,), optional
        Bias of fitted constants (`errors_in_variables_bias`), subtracted from the innovations.
    """

    config: FilterConfig
    compensation: Compensation
    position_out: BoolArray
    velocity_out: BoolArray
    not_looked_at: BoolArray
    jumps: tuple[Jump, ...] = ()
    errors_in_variables_bias: FloatArray | None = None

    @classmethod
    def first(
        cls, drive: Drive, config: FilterConfig, compensation: Compensation | None = None
    ) -> Hypothesis:
        """Return the hypothesis that a drive is as a configuration says, at most `MAX_FIXES` fixes looked at."""
        none = np.zeros(len(drive.gnss), dtype=bool)
        rest = ~none
        rest[irregular_rows(len(drive.gnss), MAX_FIXES)] = False
        return cls(config, compensation or Compensation(), none, none, rest)

    def with_compensation_of(self, cause: str, other: Hypothesis) -> Hypothesis:
        """Return the hypothesis with one cause compensated as in another one."""
        values = {p: value for p, value in other.compensation.items() if p.cause == cause}
        return replace(self, compensation=self.compensation.without((cause,)).with_values(values))

    def with_noise(self, linearized: LinearizedRun, test: CauseTest) -> Hypothesis:
        """Return the hypothesis with the noise that a test estimates on the run under this one.

        Factors on the sds of the fixes go into the compensation, all else into the configuration.
        """
        noise, config = test.noise, self.config
        ratio = noise.sd / linearized.sd
        factors = test.sd_model or {
            name: float(np.median(ratio[:, list(rows)])) for name, rows in ROW_GROUPS.items()
        }
        before = self.compensation.of(GNSS_NOISE_SCALE)
        values = {
            name: scaled_factor(before, name, factor) if name in ROW_GROUPS else factor
            for name, factor in factors.items()
        }
        config = with_density_factors(
            config, dict(zip(NOISE_GROUPS, noise.process_noise_scale.tolist(), strict=True))
        )
        if np.any(noise.markov_sd > 0.0) and config.gnss is not None:
            level, down = float(np.sqrt(np.mean(noise.markov_sd[:2] ** 2))), float(noise.markov_sd[2])
            state = GaussMarkov(level or down, float(noise.markov_time))
            gnss = replace(config.gnss, correlated=(*config.gnss.correlated, state))
            config = replace(config, gnss=replace(gnss, correlated_down=down / (level or down)))
        changed = {Parameter(GNSS_NOISE_SCALE, name): value for name, value in values.items() if value != 1.0}
        return replace(self, config=config, compensation=self.compensation.with_values(changed))

    def with_values(self, values: Mapping[Parameter, float]) -> Hypothesis:
        """Return the hypothesis with further values of the compensation, or others."""
        return replace(self, compensation=self.compensation.with_values(values))

    def is_equivalent_to(self, other: Hypothesis) -> bool:
        """Whether a filter would hardly differ under another hypothesis."""
        parameters = tuple(self.compensation.keys() | other.compensation.keys())
        return (
            self.config is other.config
            and {(j.time, j.sensor) for j in self.jumps} == {(j.time, j.sensor) for j in other.jumps}
            and np.array_equal(self.position_out, other.position_out)
            and np.array_equal(self.velocity_out, other.velocity_out)
            and np.allclose(
                self.compensation.vector(parameters),
                other.compensation.vector(parameters),
                rtol=NEGLIGIBLE_CHANGE,
                atol=0.0,
            )
        )

    def with_all_fixes(self) -> Hypothesis:
        """Return the hypothesis with no fix left out."""
        none = np.zeros_like(self.position_out)
        return replace(self, position_out=none, velocity_out=none)


def with_density_factors(config: FilterConfig, factor: Mapping[str, float]) -> FilterConfig:
    """Return the configuration with its densities times factors by group."""
    if all(value == 1.0 for value in factor.values()):
        return config
    channels = {
        axis: noise.scaled(factor[f"{axis[:-2]}_white"], factor[f"{axis[:-2]}_bias"])
        for axis, noise in config.channels.items()
    }
    return replace(config, channels=channels)


@dataclass(frozen=True)
class FilterRun:
    """A filter run over a drive under a hypothesis.

    Attributes
    ----------
    hypothesis : Hypothesis
        What is supposed of the drive.
    settings : FilterSettings
        The filter.
    stretches, solutions : tuples
        What was filtered, and the results.
    linearized : LinearizedRun
        The linear model of the run.
    index : ndarray of int, shape (k,)
        Fix of the drive behind every fix of the linearised run.
    notes : tuple of str
        What alignment and checks report.
    """

    hypothesis: Hypothesis
    settings: FilterSettings
    stretches: tuple[Stretch, ...]
    solutions: tuple[Solution, ...]
    linearized: LinearizedRun
    index: NDArray[np.intp]
    notes: tuple[str, ...]

    @cached_property
    def whitened(self) -> WhitenedInnovations:
        """Whitened innovations and sensitivities as configured, the errors-in-variables bias subtracted."""
        w, bias = whiten(as_configured(self.linearized)), self.hypothesis.errors_in_variables_bias
        return w if bias is None else replace(w, residual=w.residual - w.slope @ bias)


def in_sensor_axes(drive: Drive) -> Drive:
    """Return the drive with its lever arm in the axes of the sensor and no mounting."""
    if drive.mounting is None:
        return drive
    arm = drive.lever_arm
    if arm is not None:
        x, y, z = (drive.mounting @ np.array(arm)).tolist()
        arm = (x, y, z)
    return replace(drive, mounting=None, lever_arm=arm)


def filter_settings_of(drive: Drive, hypothesis: Hypothesis) -> FilterSettings:
    """Return the filter of a hypothesis for a compensated drive, with the sds that the receiver reports."""
    arm = drive.lever_arm or (0.0, 0.0, 0.0)
    own = hypothesis.config.constants
    constants = {name: own[name] for name in (CORRELATED_VELOCITY.name,) if name in own}
    settings = filter_settings(hypothesis.config, constants=constants, lever_arm=arm)
    settings = replace(settings, fix_sd_models=(FixSdModel(), FixSdModel()))
    return compensate_settings(settings, hypothesis.compensation)


def corrected_drive(drive: Drive, hypothesis: Hypothesis) -> Drive:
    """Return the drive as a hypothesis has it: compensated, without jumps, without the fixes left out."""
    drive = replace(compensate(drive, hypothesis.compensation), clock=Clock())  # that is the hypothesis's own
    gnss = drive.gnss
    for jump in hypothesis.jumps:
        first = 0 if jump.sensor == "gyro" else 3
        rates = drive.rates.copy()
        rates[drive.imu_t > jump.time, first : first + 3] -= jump.size
        drive = replace(drive, rates=rates)
    if hypothesis.velocity_out.any():
        gnss = replace(gnss, vel_n=np.where(hypothesis.velocity_out[:, None], np.nan, gnss.vel_n))
    if hypothesis.position_out.any():
        gnss = gnss.rows(~hypothesis.position_out)
    return replace(drive, gnss=gnss)


def run_filter(drive: Drive, hypothesis: Hypothesis) -> FilterRun:
    """Filter a drive in sensor axes under a hypothesis.

    Raises
    ------
    DataError
        Where the drive cannot be aligned.
    """
    corrected = corrected_drive(drive, hypothesis)
    settings = filter_settings_of(corrected, hypothesis)
    stamps = corrected_stamps(drive.gnss.t, correction(hypothesis.compensation))
    aligned, notes = prepare(corrected, settings)
    stretches = tuple(_looked_at(one, stamps, hypothesis.not_looked_at) for one in aligned)
    solutions = navigate(stretches, settings, np.zeros((0, 2)))
    starts = [
        initial_estimates(settings, stretch, solutions[i - 1] if i else None)
        for i, stretch in enumerate(stretches)
    ]
    indices = [_nearest(stamps, solution.t) for solution in solutions]
    reported = reported_sds(drive.gnss, settings)
    linearized = linearize(
        settings,
        stretches,
        solutions,
        starts[0][1],
        [x for x, _ in starts],
        [reported[index] for index in indices],
        middle_of(stamps),
    )
    return FilterRun(hypothesis, settings, stretches, solutions, linearized, np.concatenate(indices), notes)


def _looked_at(stretch: Stretch, stamps: FloatArray, left_out: BoolArray) -> Stretch:
    """Return an aligned stretch without the fixes that are not looked at; its first one stays."""
    kept = ~left_out[_nearest(stamps, stretch.fixes.t)]
    kept[:1] = True
    return replace(stretch, fixes=stretch.fixes.rows(np.flatnonzero(kept)))


def _nearest(stamps: FloatArray, t: FloatArray) -> NDArray[np.intp]:
    """Return the numbers of the rising stamps nearest to times."""
    after = np.clip(np.searchsorted(stamps, t), 1, len(stamps) - 1)
    return np.asarray(after - (np.abs(stamps[after - 1] - t) < np.abs(stamps[after] - t)))
