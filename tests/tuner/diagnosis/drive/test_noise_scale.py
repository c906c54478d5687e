"""Scale of R and Q from a drive: one where they are right, the true factor where they are not.

Seeds are the first that were tried. Bounds on counts are binomial at 1e-5 for a test that keeps its level exactly.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import beta, binom

from tests.cramer_rao import spectral_bound
from tests.tuner.diagnosis.drive.replicas import Source
from tuner.diagnosis.drive.causes.bias_jump import bias_jump, jump_sensor, with_jump
from tuner.diagnosis.drive.causes.correlated_gnss import correlated_gnss
from tuner.diagnosis.drive.causes.gnss_outliers import ROWS_OF_CAUSE, mask, outliers
from tuner.diagnosis.drive.causes.noise_scale import gnss_noise, imu_noise, noise_scores
from tuner.diagnosis.drive.linear_model import noise_fit
from tuner.diagnosis.drive.linear_model.noise_fit import NoiseFit, maximize_likelihood
from tuner.diagnosis.drive.linear_model.noise_parameters import ROW_GROUPS, noise_parameters, present
from tuner.linear_run.likelihood import NoiseHypothesis, as_configured, evaluate
from tuner.linear_run.linearized_run import NOISE_GROUPS, LinearizedRun
from tuner.linear_run.whitened_innovations import whiten
from tuner.types import Parameter

REJECTION_P_VALUE = 7e-4


def fit_noise(noise: NoiseHypothesis, prior_sd: Mapping[str, float] | None = None) -> NoiseFit:
    """Factors of R and Q, all together."""
    names = present(noise, (*ROW_GROUPS, *NOISE_GROUPS))
    return maximize_likelihood(noise, noise_parameters(names), prior_sd=prior_sd or {})


def seldom(p_values: np.ndarray, level: float) -> bool:
    """Whether no more p-values lie below a level than a test that keeps it shows in all but 1e-5 of studies."""
    return bool(np.count_nonzero(p_values < level) <= binom.isf(1e-5, len(p_values), level))


def claims(noise: NoiseHypothesis) -> dict[str, float]:
    scores, masked = noise_scores(noise), mask(noise)
    every = [gnss_noise(noise, scores), imu_noise(noise, scores), bias_jump(noise)]
    every += [outliers(noise, masked, cause) for cause in ROWS_OF_CAUSE]
    every.append(correlated_gnss(noise, evaluate(noise)))
    return {test.result.cause: test.result.p_value for test in every}


def study(linearized: LinearizedRun, n: int) -> dict[str, np.ndarray]:
    source = Source.of(as_configured(linearized))
    drawn = [claims(as_configured(source.draw(np.random.default_rng(seed)))) for seed in range(n)]
    return {cause: np.array([one[cause] for one in drawn]) for cause in drawn[0]}


def test_quiet_where_all_is_right(short_drive: LinearizedRun) -> None:
    for cause, p_values in study(short_drive, 60).items():
        for level in (0.2, 0.05, 0.01):
            assert seldom(p_values, level), (cause, level)


@pytest.mark.slow
def test_levels_are_kept(short_drive: LinearizedRun) -> None:
    for cause, p_values in study(short_drive, 600).items():
        assert np.mean(p_values < 1e-2) <= 0.02, cause
        assert np.mean(p_values < 1e-3) <= 3e-3, cause


def test_a_search_from_far_off_reaches_the_likelihood_of_the_truth(
    city_drive: LinearizedRun, monkeypatch
) -> None:
    """Noise wrong by factors of 4 to 6: begun at one, a search ended 540 nats below that from the guess of a part."""
    true = noise_parameters(tuple(TRUE)).change(as_configured(city_drive), np.log([4.0, 0.3, 6.0, 5.0]))
    noise = as_configured(Source.of(true).draw(np.random.default_rng(1)))
    monkeypatch.setattr(noise_fit, "MIN_PART_FIXES", 100)
    found = fit_noise(noise)
    there = noise_parameters(tuple(TRUE)).change(noise, np.log([4.0, 0.3, 6.0, 5.0]))
    assert found.log_likelihood > evaluate(there).value
    assert found.log_likelihood - evaluate(noise).value > 1e4


TRUE = {"position_horizontal": 1.4, "velocity_vertical": 0.7, "gyro_white": 2.5, "accel_bias": 2.0}


def test_factors_are_found(short_drive: LinearizedRun) -> None:
    """Mean of 12 estimates within 4.5 standard errors, each group that the drive holds."""
    truth = noise_parameters(tuple(TRUE)).change(as_configured(short_drive), np.log(list(TRUE.values())))
    source = Source.of(truth)
    fits = [fit_noise(as_configured(source.draw(np.random.default_rng(seed)))) for seed in range(12)]
    for name in (*ROW_GROUPS, "gyro_white"):
        pulls = [
            (fit.estimate[fit.number(name)] - np.log(TRUE.get(name, 1.0)))
            / np.sqrt(fit.covariance[fit.number(name), fit.number(name)])
            for fit in fits
        ]
        assert abs(np.mean(pulls)) < 4.5 / np.sqrt(len(pulls)), name
    assert not fits[0].identifiable("accel_white"), "white noise of the accelerometers does not show at 1 Hz"


@pytest.mark.slow
def test_intervals_cover(city_drive: LinearizedRun) -> None:
    """Nominal 95 %: 700 intervals together within 2.5 %, which is three standard errors, each alone above 86 %."""
    truth = noise_parameters(tuple(TRUE)).change(as_configured(city_drive), np.log(list(TRUE.values())))
    source, inside = (
        Source.of(truth),
        dict.fromkeys((*ROW_GROUPS, "gyro_white", "gyro_bias", "accel_bias"), 0),
    )
    runs = 100
    for seed in range(runs):
        fit = fit_noise(as_configured(source.draw(np.random.default_rng(seed))))
        for name in inside:
            c, value = fit.coefficient(name), TRUE.get(name, 1.0)
            inside[name] += value < c.upper if c.interval is None else c.interval[0] < value < c.interval[1]
    assert abs(sum(inside.values()) / (runs * len(inside)) - 0.95) < 0.025
    assert min(inside.values()) > 0.86 * runs


def test_a_prior_is_kept_until_the_drive_contradicts(city_drive: LinearizedRun) -> None:
    source = Source.of(noise_parameters(("gyro_white",)).change(as_configured(city_drive), np.log([3.0])))
    noise = as_configured(source.draw(np.random.default_rng(0)))
    free, tied = fit_noise(noise), fit_noise(noise, prior_sd={"gyro_white": 0.05})
    assert 1.0 < tied.factor("gyro_white") < free.factor("gyro_white")
    scores = noise_scores(noise)
    exact, vague = (
        imu_noise(noise, scores),
        imu_noise(noise, scores, prior_sd=dict.fromkeys(NOISE_GROUPS, 1.0)),
    )
    assert exact.result.p_value < REJECTION_P_VALUE < vague.result.p_value
    assert {"gyro", "accel"} <= set(exact.describe())


def test_a_jump_is_found_and_named(city_drive: LinearizedRun) -> None:
    source = Source.of(as_configured(city_drive))
    size = np.array([0.03, 0.02, 0.0])
    hidden = with_jump(source.noise, 450, "accel").linearized
    alone = replace(hidden, B=hidden.B[:, :, -3:], D=hidden.D[:, :, -3:])
    drawn = replace(source, noise=replace(source.noise, linearized=alone)).draw(
        np.random.default_rng(0), size
    )
    noise = as_configured(replace(drawn, B=city_drive.B, D=city_drive.D))
    test = bias_jump(noise)
    assert test.result.p_value < REJECTION_P_VALUE
    assert jump_sensor(test.noise) == "accel"
    gained = evaluate(test.noise).value - evaluate(noise).value
    assert gained == pytest.approx(0.5 * test.result.statistic, rel=1e-6)
    estimates = test.describe()
    assert abs(estimates["time"].value - city_drive.t[450]) < 20.0
    # Sds of the three sizes where the time is known: from the innovations' change with each, without the scan of times.
    jump = replace(alone, parameters=hidden.parameters[-3:])
    slope = whiten(as_configured(jump)).slope
    sds = np.sqrt(np.diag(np.linalg.inv(slope.T @ slope)))
    for axis, value, sd in zip("xyz", size, sds, strict=True):
        c = estimates[axis]
        assert abs(c.value - value) < 6.0 * sd
        assert c.interval[1] - c.interval[0] == pytest.approx(2.0 * 1.96 * sd, rel=0.5)
    assert test.result.gain > imu_noise(noise, noise_scores(noise)).result.gain


def with_errors(linearized: LinearizedRun, errors: np.ndarray, seed: int) -> NoiseHypothesis:
    """Draw a record whose fixes have further errors (k, 6)."""
    hidden = replace(
        linearized,
        D=errors[:, :, None],
        B=np.zeros((*linearized.B.shape[:2], 1)),
        parameters=(Parameter("error", "x"),),
    )
    drawn = Source.of(as_configured(hidden)).draw(np.random.default_rng(seed), np.ones(1))
    return as_configured(replace(drawn, D=linearized.D, B=linearized.B, parameters=linearized.parameters))


@pytest.mark.parametrize("cause", list(ROWS_OF_CAUSE))
def test_outliers_are_masked_and_named(city_drive: LinearizedRun, cause: str) -> None:
    rng = np.random.default_rng(5)
    errors = np.zeros((900, 6))
    which = rng.choice(900, 9, replace=False)
    rows = ROWS_OF_CAUSE[cause]
    errors[which, rows] = 7.0 * rng.choice([-1.0, 1.0], (9, 3)) * city_drive.sd[which, rows]
    noise = with_errors(city_drive, errors, 1)
    masked = mask(noise)
    tests = {kind: outliers(noise, masked, kind) for kind in ROWS_OF_CAUSE}
    assert tests[cause].result.p_value < 1e-9
    other = next(kind for kind in ROWS_OF_CAUSE if kind != cause)
    assert tests[other].result.p_value > REJECTION_P_VALUE
    out = np.flatnonzero(~tests[cause].noise.rows[:, rows.start])
    assert set(which) <= set(out)
    assert len(out) <= 10
    estimates = tests[cause].describe()
    assert estimates["fraction"].value == pytest.approx(len(out) / 900)
    low, high = estimates["fraction"].interval
    assert (low, high) == pytest.approx(
        tuple(beta.ppf((0.025, 0.975), (len(out), len(out) + 1), (901 - len(out), 900 - len(out)))), rel=0.5
    )
    assert tests[cause].result.gain > gnss_noise(noise, noise_scores(noise)).result.gain


def test_velocities_of_half_a_drive_are_wrong(city_drive: LinearizedRun) -> None:
    errors = np.zeros((900, 6))
    errors[300:750, 3:5] = np.random.default_rng(2).normal(0.0, 8.0, (450, 2))
    noise = with_errors(city_drive, errors, 3)
    masked = mask(noise)
    test = outliers(noise, masked, "gnss_velocity")
    assert test.result.p_value < 1e-9
    assert np.count_nonzero(masked.out[300:750, 1]) > 420
    assert np.count_nonzero(masked.out[:, 0]) < 3
    assert test.result.gain > gnss_noise(noise, noise_scores(noise)).result.gain
    assert outliers(noise, masked, "gnss_outliers").result.p_value > REJECTION_P_VALUE


def test_outliers_are_not_a_wrong_noise(city_drive: LinearizedRun) -> None:
    """Twice the noise on all fixes: the robust scale takes it out of the test of outliers."""
    source = Source.of(
        noise_parameters(("position", "velocity")).change(as_configured(city_drive), np.log([2.0, 2.0]))
    )
    noise = as_configured(source.draw(np.random.default_rng(0)))
    masked = mask(noise)
    assert min(outliers(noise, masked, cause).result.p_value for cause in ROWS_OF_CAUSE) > REJECTION_P_VALUE
    test = gnss_noise(noise, noise_scores(noise))
    assert test.result.p_value < 1e-9
    for name, c in test.describe().items():
        rows = 1800 if name.endswith("horizontal") else 900
        assert c.value == pytest.approx(2.0, rel=6.0 / np.sqrt(2.0 * rows)), (
            name
        )  # of a sd from so many errors


def receiver_spectrum(f: np.ndarray, white: float, sd: float, time: float) -> np.ndarray:
    """Two-sided density of fixes at 1 Hz: white noise and a first-order autoregression."""
    a = np.exp(-1.0 / time)
    return white**2 + sd**2 * (1.0 - a * a) / np.abs(1.0 - a * np.exp(-2j * np.pi * f)) ** 2


def test_correlated_positions_are_found_and_named(city_drive: LinearizedRun) -> None:
    truth = replace(as_configured(city_drive), markov_sd=np.array([0.6, 0.6, 1.1]), markov_time=20.0)
    noise = as_configured(Source.of(truth).draw(np.random.default_rng(0)))
    test = correlated_gnss(noise, evaluate(noise))
    assert test.result.p_value < 1e-6
    scores = noise_scores(noise)
    assert test.result.gain > max(gnss_noise(noise, scores).result.gain, imu_noise(noise, scores).result.gain)
    estimates = test.describe()
    # The best estimate from 900 fixes of two axes, of one and of three.
    horizontal = spectral_bound(receiver_spectrum, (1.0, 0.6, 20.0), 900, 1.0)
    vertical = spectral_bound(receiver_spectrum, (1.8, 1.1, 20.0), 900, 1.0)
    for name, value, sd in (
        ("sd", 0.6, horizontal[1] / np.sqrt(2.0)),
        ("sd_vertical", 1.1, vertical[1]),
        ("time_constant", 20.0, horizontal[2] / np.sqrt(3.0)),
    ):
        assert abs(np.log(estimates[name].value / value)) < 6.0 * sd, name
        low, high = np.log(estimates[name].interval)
        assert high - low > 0.9 * 2.0 * 1.96 * sd, name
    again = noise_scores(test.noise)
    assert gnss_noise(test.noise, again).result.p_value > REJECTION_P_VALUE


def test_wrong_noise_is_not_correlation(city_drive: LinearizedRun) -> None:
    source = Source.of(noise_parameters(("position",)).change(as_configured(city_drive), np.log([1.5])))
    noise = as_configured(source.draw(np.random.default_rng(0)))
    assert correlated_gnss(noise, evaluate(noise)).result.p_value > REJECTION_P_VALUE


def test_a_correlation_must_be_worth_its_price(short_drive: LinearizedRun) -> None:
    """Three parameters for n innovations cost 3/2 ln n (Schwarz): what raises the likelihood by less is no gain."""
    seen = 0
    for seed in range(6):
        truth = replace(as_configured(short_drive), markov_sd=np.array([0.35, 0.35, 0.6]), markov_time=10.0)
        noise = as_configured(Source.of(truth).draw(np.random.default_rng(seed)))
        result = correlated_gnss(noise, evaluate(noise)).result
        price = 1.5 * np.log(np.count_nonzero(noise.counted[:, :3]))
        if (
            0.0 < result.statistic < price
        ):  # half of it, and at most as much again by the scale of white noise
            seen += 1
            assert result.gain < 0.0
    assert seen > 0
