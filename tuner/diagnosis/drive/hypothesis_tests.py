"""The tests of all causes on one filter run, and the hypothesis that each would lead to.

Causes that are constants shift the innovations and come from `score_tests`; those of the noise and of single fixes
make another noise hypothesis of the linearised run (`CauseTest`). `hypothesis_with` turns that into a hypothesis
about the drive: factors on the sds of the receiver or a model of them, densities, correlated states, fixes left out.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models.noise import GaussMarkov
from tuner.diagnosis.drive.cause_test import CauseTest
from tuner.diagnosis.drive.causes.bias_jump import CAUSE as JUMP
from tuner.diagnosis.drive.causes.bias_jump import bias_jump, jump_sensor
from tuner.diagnosis.drive.causes.correlated_gnss import correlated_gnss
from tuner.diagnosis.drive.causes.gnss_outliers import ROWS_OF_CAUSE, mask, outliers
from tuner.diagnosis.drive.causes.noise_scale import gnss_noise, imu_noise, joint_noise, noise_scores
from tuner.diagnosis.drive.causes.reported_sd import has_sd_model, reported_sd_test, scaled_factor
from tuner.diagnosis.drive.hypothesis import FilterRun, Hypothesis, Jump
from tuner.diagnosis.drive.linear_model.likelihood import NoiseHypothesis, as_configured, evaluate
from tuner.diagnosis.drive.linear_model.linearized_run import NOISE_GROUPS
from tuner.diagnosis.drive.linear_model.noise_parameters import BLOCKS, ROW_GROUPS
from tuner.diagnosis.drive.linear_model.noise_prior import static_prior
from tuner.diagnosis.drive.linear_model.whitened_innovations import WhitenedInnovations
from tuner.diagnosis.drive.score_tests import ScoreTest, score_tests
from tuner.diagnosis.static.outcome import Alarm
from tuner.navigation.fix_sd_model import CAUSE as GNSS_NOISE_SCALE
from tuner.types import ChannelNoise, Coefficient, FilterConfig, Parameter

FloatArray = NDArray[np.float64]

STRONG_P_VALUE = 1e-9
"""Chance below which a shift is significant whatever the noise."""
MIN_GAIN = 1.0
"""Gain from which a cause is named, nats."""
MAX_JUMPS = 2
"""Most jumps that are named; more of them are another thing."""
MAX_JUMP_SIZE = {"gyro": 0.05, "accel": 1.0}
"""Size of a jump of a bias, rad/s and m/s², from which it is rejected: something else is wrong."""
SCORE_TEST_TITLE = "score of the sensitivity of the innovations"


@dataclass(frozen=True)
class Candidate:
    """A cause that may explain a pass.

    Attributes
    ----------
    alarm : Alarm
        How surely.
    scored : ScoreTest or None
        Of a cause that shifts innovations.
    claim : CauseTest or None
        Of any other.
    """

    alarm: Alarm
    scored: ScoreTest | None = None
    claim: CauseTest | None = None

    @property
    def cause(self) -> str:
        """Code of the cause."""
        return self.alarm.cause

    @property
    def credible(self) -> bool:
        """Whether a cause of the size that it would have to be is met in practice."""
        if self.scored is None and self.cause == JUMP and self.claim is not None:
            size = np.abs(evaluate(self.claim.noise).theta[-3:]).max()
            return bool(size < MAX_JUMP_SIZE[jump_sensor(self.claim.noise)])
        return self.scored is None or self.scored.credible

    def is_significant(self, threshold: float) -> bool:
        """Whether the family alarms and its cause gains."""
        return self.alarm.p_value < threshold and self.alarm.gain > MIN_GAIN


def noise_hypothesis_of(run: FilterRun, accepted: tuple[str, ...]) -> NoiseHypothesis:
    """Return the noise for which the filter of a pass was configured, with accepted shifts free."""
    names = run.linearized.parameters
    columns = tuple(i for i, parameter in enumerate(names) if parameter.cause in accepted)
    return replace(as_configured(run.linearized), columns=columns)


def candidates(
    run: FilterRun, w: WhitenedInnovations, accepted: tuple[str, ...], threshold: float
) -> tuple[Candidate, ...]:
    """Return what families say of a pass; accepted shifts are fitted beside every test.

    What shifts innovations leaks into all noise, and wrong noise makes weak shifts look sure. Where a shift is strong,
    noise and jumps are asked with all shifts free, so that none of them leaks: what is still sure is named before any
    shift; then strong shifts. Where none is, noise and jumps come first, both beside single fixes; weak shifts are
    listened to last. A family that comes later is not asked, or taken for silent, while an earlier one alarms.
    """
    linearized = run.linearized
    noise = noise_hypothesis_of(run, accepted)
    shifts = [score_candidate(one) for one in score_tests(w, linearized.parameters, accepted)]
    if any(one.is_significant(STRONG_P_VALUE) for one in shifts):
        free = replace(noise, columns=tuple(range(len(linearized.parameters))))
        fixes, others = _test_fixes_and_noise(run, free, threshold)
        if any(one.is_significant(STRONG_P_VALUE) for one in others):
            return (*fixes, *others)
        return (*shifts, *_test_fixes(noise, threshold))
    fixes, others = _test_fixes_and_noise(run, noise, threshold)
    if any(one.is_significant(threshold) for one in (*fixes, *others)):
        return (*fixes, *others)
    return (*shifts, *fixes, *others)


def _test_fixes(noise: NoiseHypothesis, threshold: float) -> tuple[Candidate, ...]:
    """Return what single fixes say; where positions and velocities both alarm they have one hypothesis."""
    linearized = noise.linearized
    every = replace(noise, rows=noise.rows | (linearized.available & linearized.scored[:, None]))
    masked = mask(every)
    told = [_candidate(outliers(every, masked, cause)) for cause in ROWS_OF_CAUSE]
    if all(one.is_significant(threshold) for one in told):
        both = replace(every, rows=masked.rows(every))
        told = [_candidate(replace(one.claim, noise=both)) for one in told if one.claim is not None]
    return tuple(told)


def _test_fixes_and_noise(
    run: FilterRun, noise: NoiseHypothesis, threshold: float
) -> tuple[tuple[Candidate, ...], ...]:
    """Return what single fixes say, and what the noise and jumps of biases say; two families at a time.

    The kernels of the likelihood let other threads run. What a line search says is not for the user, and scipy keeps it
    to itself in one thread only.
    """
    with warnings.catch_warnings(), ThreadPoolExecutor(max_workers=2) as pool:
        warnings.filterwarnings("ignore", "The line search|Rounding errors", RuntimeWarning)
        correlated = pool.submit(lambda: correlated_gnss(noise, evaluate(noise)))
        factors = pool.submit(_test_noise_scales, run, noise)
        fixes = pool.submit(_test_fixes, noise, threshold)
        jumps = [pool.submit(bias_jump, noise)] if len(run.hypothesis.jumps) < MAX_JUMPS else []
        claims = (*factors.result(), correlated.result(), *(jump.result() for jump in jumps))
        return fixes.result(), tuple(_candidate(claim) for claim in claims)


def _test_noise_scales(run: FilterRun, noise: NoiseHypothesis) -> tuple[CauseTest, ...]:
    """Return what is said of factors on the noise, and of laws of the reported sds."""
    told, prior = noise_scores(noise), static_prior(run.hypothesis.config.channels)
    factors = joint_noise(noise, told, prior_sd=prior)
    if factors is None:
        factors = gnss_noise(noise, told), imu_noise(noise, told, prior_sd=prior)
    asked = [
        block for block in BLOCKS if not has_sd_model(run.hypothesis.compensation.of(GNSS_NOISE_SCALE), block)
    ]
    laws = [claim for block in asked if (claim := reported_sd_test(noise, block)) is not None]
    return (*factors, *laws)


def _candidate(claim: CauseTest) -> Candidate:
    return Candidate(claim.alarm, claim=claim)


def score_candidate(scored: ScoreTest) -> Candidate:
    """Return the candidate of a cause that shifts innovations."""
    alarm = Alarm(scored.cause, scored.p_value, scored.gain, scored.statistic, SCORE_TEST_TITLE)
    return Candidate(alarm, scored=scored)


def hypothesis_with(run: FilterRun, claim: CauseTest) -> Hypothesis:
    """Return the hypothesis of a pass with what a claim holds true besides."""
    was, linearized, noise = run.hypothesis, run.linearized, claim.noise
    if claim.alarm.cause == JUMP:
        theta = evaluate(noise).theta[-3:]
        time = claim.describe()["time"].value
        assert time is not None
        return replace(was, jumps=(*was.jumps, Jump(time, jump_sensor(noise), theta)))
    ratio = noise.sd / linearized.sd
    factors = claim.law or {name: float(np.median(ratio[:, list(rows)])) for name, rows in ROW_GROUPS.items()}
    before = was.compensation.of(GNSS_NOISE_SCALE)
    values = {
        name: scaled_factor(before, name, factor) if name in ROW_GROUPS else factor
        for name, factor in factors.items()
    }
    config = _scaled_densities(
        was.config, dict(zip(NOISE_GROUPS, noise.process_noise_scale.tolist(), strict=True))
    )
    if np.any(noise.markov_sd > 0.0) and config.gnss is not None:
        level, down = float(np.sqrt(np.mean(noise.markov_sd[:2] ** 2))), float(noise.markov_sd[2])
        state = GaussMarkov(level or down, float(noise.markov_time))
        gnss = replace(config.gnss, correlated=(*config.gnss.correlated, state))
        config = replace(config, gnss=replace(gnss, correlated_down=down / (level or down)))
    position, velocity = was.position_out.copy(), was.velocity_out.copy()
    if claim.alarm.cause in ROWS_OF_CAUSE:
        dropped = linearized.available & linearized.scored[:, None] & ~noise.rows
        position[run.index[dropped[:, :3].any(axis=1)]] = True
        velocity[run.index[dropped[:, 3:].any(axis=1)]] = True
    changed = {Parameter(GNSS_NOISE_SCALE, name): value for name, value in values.items() if value != 1.0}
    return replace(
        was,
        config=config,
        compensation=was.compensation.with_values(changed),
        position_out=position,
        velocity_out=velocity,
    )


def _scaled_densities(config: FilterConfig, factor: Mapping[str, float]) -> FilterConfig:
    """Return the configuration with its densities times factors by group."""

    def channel(axis: str, noise: ChannelNoise) -> ChannelNoise:
        white, slow = factor[f"{axis[:-2]}_white"], factor[f"{axis[:-2]}_bias"]
        return replace(
            noise,
            white_density=white * noise.white_density,
            random_walk_density=slow * noise.random_walk_density,
            markov=tuple(replace(state, sd=slow * state.sd) for state in noise.markov),
        )

    if all(value == 1.0 for value in factor.values()):
        return config
    return replace(config, channels={axis: channel(axis, noise) for axis, noise in config.channels.items()})


def coefficients(
    parameters: tuple[Parameter, ...], value: FloatArray, covariance: FloatArray
) -> dict[str, Coefficient]:
    """Return estimates with their normal intervals, by parameter name."""
    sd = np.sqrt(np.diag(covariance))
    return {
        parameter.name: Coefficient.known(
            float(v), float(v - 1.96 * s), float(v + 1.96 * s), UNITS[parameter.cause]
        )
        for parameter, v, s in zip(parameters, value, sd, strict=True)
    }


UNITS = {
    "time_offset": "s",
    "velocity_lag": "s",
    "lever_arm": "m",
    "gnss_frame": "rad",
    "gyro_scale": "1",
    "accel_scale": "1",
    "misalignment": "rad",
    "g_sensitivity": "rad/s/(m/s^2)",
    "gravity": "m/s^2",
}
"""Unit of the parameters of a cause."""
