"""The block that is written predicts the record it came from; seeds are fixed, bounds are laws or published shares."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from models.noise import GaussMarkov, NoiseModel, RandomWalk, White
from tuner.curves.allan import overlapping_allan
from tuner.identification.predictive.choose_block import choose_block
from tuner.identification.predictive.criteria import follows_curve
from tuner.identification.predictive.curve_fit import fit_curve, raise_random_walk
from tuner.identification.predictive.forecast import compare_forecasts
from tuner.identification.predictive.measured_allan import measured_allan
from tuner.identification.predictive.spectral_excess import spectral_excess
from tuner.types.prediction import BlockSource, MeasuredAllan, NoiseBlock, SpectralExcess

INTERVAL = 0.05
MODEL = NoiseModel((White(1.0), GaussMarkov(0.2, 60.0), RandomWalk(0.004)))
BLOCK = NoiseBlock(1.0, (GaussMarkov(0.2, 60.0),), 0.004)


def record(seed: int, *, hours: float = 1.0, model: NoiseModel = MODEL) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return model.sample(round(hours * 3600.0 / INTERVAL), INTERVAL, rng)


def exact(model: NoiseModel, hours: float = 1.0) -> MeasuredAllan:
    """Return a curve without scatter, with the degrees of freedom of a record."""
    measured = measured_allan([record(0, hours=hours)], INTERVAL)
    assert measured is not None
    variance = model.allan_variance(measured.tau, interval=INTERVAL)
    return MeasuredAllan(INTERVAL, measured.length, measured.tau, variance, measured.dof)


def test_the_allan_variance_of_a_line_is_that_of_a_sinusoid() -> None:
    """A sinusoid of amplitude a has the power a²/2; its Allan variance over whole periods is that of the formula."""
    amplitude, frequency, n = 0.3, 0.56, 400_000
    y = amplitude * np.sin(2.0 * np.pi * frequency * INTERVAL * np.arange(n))
    line = SpectralExcess(np.array([frequency]), np.array([0.5 * amplitude**2]), INTERVAL)
    m = np.array([10, 17, 33, 71, 200])
    np.testing.assert_allclose(line.allan_variance(m * INTERVAL), overlapping_allan(y, m), rtol=2e-3)


def test_the_integral_of_a_line_stays_within_its_amplitude() -> None:
    """∫ a sin(ωt + φ) over h has the variance (2a/ω)² sin²(ωh/2)/2 where the phase is anything."""
    amplitude, frequency, h = 0.3, 0.2, 3.7
    line = SpectralExcess(np.array([frequency]), np.array([0.5 * amplitude**2]), INTERVAL)
    phase = 2.0 * np.pi * (np.arange(10_000) + 0.5) / 10_000
    w = 2.0 * np.pi * frequency
    integral = amplitude / w * (np.cos(phase) - np.cos(w * h + phase))
    assert line.integral_variance(h) == pytest.approx(np.mean(integral**2), rel=1e-6)


def test_a_state_that_becomes_white_noise_keeps_its_allan_variance_at_long_times() -> None:
    fast = NoiseBlock(0.0, (GaussMarkov(2.0, 0.5),)).without_fast_states()
    assert not fast.states
    tau = np.array([500.0])
    expected = GaussMarkov(2.0, 0.5).allan_variance(tau)
    np.testing.assert_allclose(fast.allan_variance(tau, INTERVAL), expected, rtol=2e-3)


def test_white_noise_beside_a_process_of_a_second_is_not_written_too_large() -> None:
    """Density 1 beside a process with the same density at long times: together taken for white noise they give √2."""
    truth = NoiseModel((White(1.0), GaussMarkov(np.sqrt(0.5), 1.0), RandomWalk(0.01)))
    y = truth.sample(100_000, INTERVAL, np.random.default_rng(5))
    written = choose_block([y], INTERVAL, None)
    assert written is not None
    assert written.passes
    assert written.curve.tau[0] == pytest.approx(10.0 * INTERVAL)
    assert written.block.white_density == pytest.approx(1.0, rel=0.15)


def test_an_exact_curve_gives_its_block_back() -> None:
    """A curve that can be fitted exactly: what elimination of components may cost is a tenth of the deviation."""
    truth = NoiseModel((White(1.0), GaussMarkov(0.2, 100.0), RandomWalk(0.004)))
    found = fit_curve(exact(truth, 3.0))
    assert found.white_density == pytest.approx(1.0, rel=0.01)
    tau = exact(truth, 3.0).tau
    ratio = found.allan_variance(tau, INTERVAL) / truth.allan_variance(tau, interval=INTERVAL)
    np.testing.assert_allclose(np.sqrt(ratio[: len(tau) // 2]), 1.0, atol=0.03)
    np.testing.assert_allclose(np.sqrt(ratio[exact(truth, 3.0).judged]), 1.0, atol=0.15)


def test_white_noise_alone_needs_no_other_component() -> None:
    found = fit_curve(exact(NoiseModel((White(1.0),))))
    assert found.white_density == pytest.approx(1.0, rel=5e-3)
    assert not found.states
    assert found.random_walk_density == 0.0


def test_the_random_walk_is_never_lowered_and_keeps_to_the_curve() -> None:
    measured = exact(MODEL)
    for block in (NoiseBlock(1.0, (GaussMarkov(0.2, 60.0),)), BLOCK):
        raised = raise_random_walk(block, measured)
        assert raised.random_walk_density >= block.random_walk_density
        if follows_curve(measured, block.allan_variance(measured.tau, INTERVAL)).passes:
            predicted = raised.allan_variance(measured.tau, INTERVAL)
            assert follows_curve(measured, predicted).passes


def test_white_noise_of_a_minute_predicts_its_own_curve():
    """One axis in 25 did not: its white noise had no interval, and the verdict an exception."""
    rng, interval = np.random.default_rng(1), 0.01
    for _ in range(200):
        measured = measured_allan([rng.standard_normal(6000)], interval)
        assert follows_curve(measured, interval / measured.tau).passes


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_forecasts_tell_a_block_of_another_size(factor: float) -> None:
    """White noise alone: the error of every forecast is in proportion to N, so the ratio is 1/factor."""
    y = record(3, model=NoiseModel((White(1.0),)))
    for found in compare_forecasts([y], INTERVAL, NoiseBlock(factor)):
        windows = 0.9 * 3600.0 / found.horizon
        assert found.ratio * factor == pytest.approx(1.0, abs=3.0 / np.sqrt(2.0 * windows))
        if found.horizon <= 60.0:
            assert found.passes == (factor == 1.0)


def test_the_true_block_is_kept_and_wrong_ones_are_replaced() -> None:
    """Of simulated hours the true model passes in all of 90 (docstring of the criteria): here in five of five."""
    for seed in range(5):
        y = record(seed)
        kept = choose_block([y], INTERVAL, BLOCK)
        assert kept is not None
        assert kept.source is BlockSource.LIKELIHOOD
        assert kept.block.white_density == 1.0
        louder = choose_block([y], INTERVAL, NoiseBlock(2.0, (GaussMarkov(0.2, 60.0),), 0.004))
        assert louder is not None
        assert louder.source is BlockSource.CURVE
        assert louder.rejected is not None
        assert not louder.rejected.passes
        assert louder.passes
        assert louder.block.white_density == pytest.approx(1.0, abs=0.06)


def test_bursts_enter_by_their_share_of_time() -> None:
    """White noise ten times as large for 1 % of the time has N² (1 + 0.01 · 99): N 1.41 times that of the rest."""
    y = record(7, model=NoiseModel((White(1.0),)))
    for start in range(0, len(y), len(y) // 10):
        y[start : start + len(y) // 1000] *= 10.0
    found = choose_block([y], INTERVAL, None)
    assert found is not None
    assert found.passes
    assert found.block.white_density == pytest.approx(np.sqrt(1.99), rel=0.1)


def test_a_line_does_not_pass_for_white_noise() -> None:
    """A line of 0.56 Hz whose Allan variance equals that of the white noise near one second."""
    y = record(11, model=NoiseModel((White(0.1),)))
    y += 0.5 * np.sin(2.0 * np.pi * 0.56 * INTERVAL * np.arange(len(y)))
    excess = spectral_excess([y], INTERVAL)
    assert excess is not None
    assert excess.power.sum() == pytest.approx(0.125, rel=0.05)
    found = choose_block([y], INTERVAL, None)
    assert found is not None
    assert found.passes
    assert found.block.white_density == pytest.approx(0.1, rel=0.1)


def test_white_noise_has_no_excess() -> None:
    """Fifteen windows or more of white noise stay below four times their median: 0 of 20 records."""
    for seed in range(20):
        assert spectral_excess([np.random.default_rng(seed).standard_normal(20_000)], INTERVAL) is None


def test_no_block_is_without_white_noise() -> None:
    """A sensor that passes its samples through a slow filter shows no white noise; no filter takes zero."""
    y = record(2, model=NoiseModel((GaussMarkov(1.0, 0.6),)))
    found = choose_block([y], INTERVAL, None)
    assert found is not None
    assert found.block.white_density == pytest.approx(np.sqrt(2.0 * 0.6), rel=0.15)


def test_white_noise_that_the_likelihood_measured_is_not_bent_by_a_warm_up() -> None:
    """No sum of terms has the curve of an exponential: a fit to it gave 0.77 of the white noise."""
    t = 0.01 * np.arange(65_000)
    y = 10.0 * np.random.default_rng(0).standard_normal(len(t)) - 150.0 * np.exp(-t / 111.0)
    found = choose_block([y], 0.01, NoiseBlock(1.0, (), 1e-3))
    assert found is not None
    assert found.block.white_density == pytest.approx(1.0, rel=0.05)


def test_a_short_record_is_not_judged() -> None:
    assert choose_block([np.random.default_rng(0).standard_normal(200)], INTERVAL, None) is None


def test_stretches_without_a_gap_are_pooled() -> None:
    y = record(5)
    third = len(y) // 3
    found = choose_block([y[:third], y[third : 2 * third], y[2 * third :]], INTERVAL, BLOCK)
    assert found is not None
    assert found.source is BlockSource.LIKELIHOOD


@pytest.mark.skipif("TUNER_DATA" not in os.environ, reason="needs TUNER_DATA")
@pytest.mark.parametrize("sensor", ["gyro", "accel"])
def test_twenty_minutes_of_an_industrial_unit_are_predicted(sensor: str) -> None:
    """Whole chain on samples that nobody here simulated, with a resonance near 0.55 Hz on the accelerometers."""
    with np.load(Path(os.environ["TUNER_DATA"]) / "static" / "adis16405_run1.npz") as file:
        rate = float(str(json.loads(str(file["meta"]))["rate_hz"]).split()[0])
        counts = file[f"{sensor}_counts"][: round(1200.0 * rate)].astype(float)
    for axis in range(3):
        found = choose_block([np.ascontiguousarray(counts[:, axis])], 1.0 / rate, None)
        assert found is not None
        assert found.curve.passes
        assert all(forecast.passes for forecast in found.forecasts)
