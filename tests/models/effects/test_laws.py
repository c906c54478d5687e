"""Each static effect follows its stated distribution. Bands are of 5 sigma: below 1e-5 false failures each."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from models.effects import Samples
from models.effects.static.attitude import Attitude
from models.effects.static.distribution import Burst, CrossAxis, HeavyTails, VarianceDrift
from models.effects.static.events import Motion, Spikes, Step, Telegraph
from models.effects.static.sampling import Clipping, Duplicates, Quantizer, Timing
from models.effects.static.spectral import Colour, CorrelatedDrift, Line, LowPass, Vibration
from models.effects.static.thermal import TemperatureSlope, ThermalLag, Warmup

INTERVAL = 0.01
SIGMAS = 5.0


def silent(n: int, k: int = 1) -> Samples:
    t = np.arange(n) * INTERVAL
    return Samples(t, np.zeros((n, k)), INTERVAL, white=np.zeros((n, k)))


def noisy(n: int, k: int = 1, seed: int = 5) -> Samples:
    t = np.arange(n) * INTERVAL
    white = np.random.default_rng(seed).standard_normal((n, k))
    return Samples(t, white, INTERVAL, white=white)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def overlapped_allan_variance(y: np.ndarray, m: int) -> float:
    x = np.concatenate(([0.0], np.cumsum(y - y.mean())))
    second = x[2 * m :] - 2.0 * x[m:-m] + x[: -2 * m]
    return float(np.mean(second**2)) / (2.0 * m * m)


def assert_spectrum(y: np.ndarray, density: np.ndarray) -> None:
    """Compare band means of the periodogram (Fourier bins 1 … n/2 − 1) with a two-sided density, unit²/Hz.

    A mean of m bins of a Gaussian process has the relative sd 1/√m (bins are exponential).
    """
    n = len(y)
    ratio = (np.abs(np.fft.rfft(y)) ** 2 * INTERVAL / n)[1 : n // 2] / density
    for band in np.array_split(ratio, 24):
        assert band.mean() == pytest.approx(1.0, abs=SIGMAS / np.sqrt(len(band)) + 2e-3)


def fourier(n: int) -> np.ndarray:
    return np.arange(1, n // 2) / (n * INTERVAL)


# ---- spectral


def test_line_has_its_peak_and_its_allan_bump():
    """Periodogram A²n/4 on a Fourier frequency; AVAR(τ) = A² sin⁴(πfτ)/(πfτ)² for frequencies ≪ rate."""
    n, amplitude = 200_000, 0.3
    frequency = 400 / (n * INTERVAL)
    y = Line(frequency, amplitude).apply(silent(n), rng()).y[:, 0]
    power = np.abs(np.fft.rfft(y)) ** 2 / n
    assert np.argmax(power) == 400
    assert power[400] == pytest.approx(amplitude**2 * n / 4.0, rel=1e-9)
    for m in (50, 100, 186, 250, 400):
        x = np.pi * frequency * m * INTERVAL
        expected = amplitude**2 * np.sin(x) ** 4 / x**2
        assert overlapped_allan_variance(y, m) == pytest.approx(expected, rel=2e-2)


def test_line_keeps_its_phase_and_shares_a_drawn_one():
    t = silent(1000, 2).t
    np.testing.assert_allclose(Line(3.0, 2.0, 0.0).signal(t), 2.0 * np.sin(6.0 * np.pi * t), atol=1e-12)
    y = Line(3.0, 2.0).apply(silent(1000, 2), rng(1)).y
    np.testing.assert_array_equal(y[:, 0], y[:, 1])
    assert np.any(y != Line(3.0, 2.0).apply(silent(1000, 2), rng(2)).y)


@pytest.mark.parametrize(("frequency", "quality"), [(12.0, 8.0), (30.0, 12.0), (4.0, 10.0)])
def test_vibration_is_the_ar2_of_its_frequency_and_quality(frequency, quality):
    n, sd = 400_000, 0.7
    effect = Vibration(frequency, quality, sd)
    y = effect.apply(silent(n), rng(3)).y[:, 0]
    phi1, phi2 = effect.recursion(INTERVAL)
    rho = phi1 / (1.0 - phi2)
    driving = sd**2 * (1.0 - phi2**2) * (1.0 - rho**2)
    z = np.exp(-2j * np.pi * fourier(n) * INTERVAL)
    assert_spectrum(y, driving * INTERVAL / np.abs(1.0 - phi1 * z - phi2 * z**2) ** 2)
    width = frequency / quality  # half power: ± half a bandwidth from the middle
    middle, side = (np.abs(1.0 - phi1 * z - phi2 * z**2) ** -2.0 for z in _circle(frequency, width))
    assert side / middle == pytest.approx(0.5, rel=0.12)


def _circle(frequency: float, width: float) -> tuple[complex, complex]:
    return tuple(np.exp(-2j * np.pi * f * INTERVAL) for f in (frequency, frequency + 0.5 * width))


def test_vibration_is_stationary_from_its_first_sample():
    """Ensemble variance of the first sample: χ² of 4000 runs, relative sd √(2/4000)."""
    effect, generator = Vibration(10.0, 50.0, 2.0), rng(4)
    first = np.array([effect.signal(2, INTERVAL, generator) for _ in range(4000)])
    phi1, phi2 = effect.recursion(INTERVAL)
    assert first.var(axis=0) == pytest.approx(4.0, rel=SIGMAS * np.sqrt(2 / 4000))
    assert np.corrcoef(first.T)[0, 1] == pytest.approx(phi1 / (1.0 - phi2), abs=0.05)


@pytest.mark.parametrize(("cutoff", "order"), [(12.0, 1), (45.0, 1), (20.0, 2)])
def test_lowpass_shapes_the_spectrum_of_what_it_filters(cutoff, order):
    n = 300_000
    effect = LowPass(cutoff, order)
    out = effect.apply(noisy(n), rng())
    assert_spectrum(out.y[:, 0], INTERVAL * effect.gain(fourier(n), INTERVAL))
    np.testing.assert_allclose(out.white, out.y, atol=5.0)  # both filtered, from different starts
    np.testing.assert_allclose(out.white[300:], out.y[300:], atol=1e-9)


def test_lowpass_gain_is_that_of_the_continuous_filter_where_it_is_well_sampled():
    for order in (1, 2, 3):
        effect = LowPass(0.5, order)
        assert effect.gain(np.array([0.0]), INTERVAL)[0] == pytest.approx(1.0)
        f = np.array([0.1, 0.5, 1.0])
        np.testing.assert_allclose(
            effect.gain(f, INTERVAL), 1.0 / (1.0 + (f / 0.5) ** (2 * order)), rtol=0.02
        )


def test_lowpass_passes_a_constant():
    level = Samples(np.arange(50) * INTERVAL, np.full((50, 1), -9.8), INTERVAL)
    np.testing.assert_allclose(LowPass(10.0).apply(level, rng()).y, -9.8, rtol=1e-14)


@pytest.mark.parametrize(("ar", "ma"), [((-0.4,), ()), ((0.5, -0.3), (0.2,)), ((), (-0.5,))])
def test_colour_is_the_arma_of_its_coefficients(ar, ma):
    n = 300_000
    effect = Colour(ar, ma)
    out = effect.apply(noisy(n), rng())
    assert_spectrum(out.y[:, 0], INTERVAL * effect.gain(fourier(n), INTERVAL))


def test_gauss_markov_has_its_variance_and_time_constant():
    """exp(−lag/T) autocovariance, from 3000 independent paths: sd of a product mean below sd²√(2/3000)."""
    effect, generator = CorrelatedDrift(0.5, 0.2), rng(6)
    paths = np.array([effect.signal(61, INTERVAL, generator) for _ in range(3000)])
    for lag in (0, 1, 20, 60):
        measured = np.mean(paths[:, 0] * paths[:, lag])
        expected = 0.25 * np.exp(-lag * INTERVAL / 0.2)
        assert measured == pytest.approx(expected, abs=SIGMAS * 0.25 * np.sqrt(2 / 3000))


# ---- thermal


def test_temperature_slope_is_recovered_by_regression_exactly():
    n = 5000
    t = np.arange(n) * INTERVAL
    celsius = 25.0 + 3.0 * np.sin(t / 7.0)
    y = TemperatureSlope(-0.02).apply(Samples(t, np.full((n, 2), 4.0), INTERVAL, celsius), rng()).y
    slope, offset = np.polyfit(celsius - celsius[0], y[:, 1], 1)
    assert slope == pytest.approx(-0.02, rel=1e-12)
    assert offset == pytest.approx(4.0, rel=1e-12)


def test_thermal_lag_follows_a_step_and_a_ramp_as_a_first_order_lag():
    n = 20_000
    t = np.arange(n) * INTERVAL
    effect = ThermalLag(2.0, 10.0)
    step = np.where(t > 0, 1.0, 0.0)
    step[0] = 0.0
    after = t - INTERVAL  # the input holds its value from the second sample on
    expected = np.where(t > 0, 2.0 * (1.0 - np.exp(-after / 10.0)), 0.0)
    np.testing.assert_allclose(effect.signal(step, INTERVAL), expected, atol=1e-9)
    ramp = effect.signal(0.1 * t, INTERVAL)
    assert ramp[-1] == pytest.approx(2.0 * 0.1 * (t[-1] - 10.0), rel=1e-3)


def test_thermal_lag_without_lag_is_the_slope():
    celsius = 20.0 + np.cumsum(rng(1).standard_normal(500))
    quick = ThermalLag(0.3, INTERVAL / 100.0).signal(celsius, INTERVAL)
    np.testing.assert_allclose(quick[1:], TemperatureSlope(0.3).signal(celsius)[:-1], atol=1e-9)


def test_warmup_decays_by_e_in_a_time_constant():
    t = 1000.0 + np.arange(1001) * 0.1
    y = Warmup(-0.4, 25.0).signal(t)
    assert y[0] == -0.4
    assert y[250] == pytest.approx(-0.4 / np.e, rel=1e-12)
    np.testing.assert_allclose(y[1:] / y[:-1], np.exp(-0.1 / 25.0), rtol=1e-12)


# ---- events


def test_step_is_where_it_says():
    y = Step(3.0, -2.0).apply(silent(1000), rng()).y[:, 0]
    np.testing.assert_array_equal(y, np.where(silent(1000).t >= 3.0, -2.0, 0.0))


def test_telegraph_dwells_are_exponential_with_their_means():
    """Dwells of a long path: means within 5 sd, exponential by Kolmogorov–Smirnov (p > 1e-5)."""
    low, high = 0.6, 0.2
    path = Telegraph(0.8, low, high).signal(np.arange(2_000_000) * 0.001, rng(7))
    assert set(np.unique(path)) == {0.0, 0.8}
    edges = np.flatnonzero(np.diff(path))
    dwells, levels = np.diff(edges) * 0.001, path[edges[:-1] + 1]
    for level, mean in ((0.0, low), (0.8, high)):
        chosen = dwells[levels == level]
        assert chosen.mean() == pytest.approx(mean, rel=SIGMAS / np.sqrt(len(chosen)) + 0.005)
        smooth = chosen + rng(8).uniform(-0.0005, 0.0005, len(chosen))
        assert stats.kstest(smooth[:1000], stats.expon(scale=mean).cdf).pvalue > 1e-5
    assert np.mean(path > 0) == pytest.approx(high / (low + high), abs=0.03)


def test_telegraph_has_the_spectrum_of_a_gauss_markov_process():
    """Autocovariance size² p(1 − p) exp(−lag(1/low + 1/high)) over 4000 stationary paths; 5 sd of a mean."""
    effect, generator, t = Telegraph(2.0, 0.5, 1.5), rng(9), np.arange(60) * INTERVAL
    paths = np.array([effect.signal(t, generator) for _ in range(4000)])
    p = 0.75
    assert paths[:, 0].mean() == pytest.approx(2.0 * p, abs=SIGMAS * 2.0 * np.sqrt(p * (1 - p) / 4000))
    centred = paths - 2.0 * p
    for lag in (0, 10, 30, 59):
        product = centred[:, 0] * centred[:, lag]
        expected = 4.0 * p * (1 - p) * np.exp(-lag * INTERVAL * (1 / 0.5 + 1 / 1.5))
        assert product.mean() == pytest.approx(expected, abs=SIGMAS * product.std() / np.sqrt(4000))


def test_spikes_are_poisson_of_their_size():
    n = 1_000_000
    y = Spikes(0.05, 9.0).apply(silent(n), rng(10)).y[:, 0]
    assert set(np.unique(y)) == {-9.0, 0.0, 9.0}
    expected = 0.05 * n * INTERVAL
    assert np.count_nonzero(y) == pytest.approx(expected, abs=SIGMAS * np.sqrt(expected))


def test_motion_stays_in_its_stretch_and_has_its_sd():
    y = Motion(100.0, 800.0, 3.0).apply(silent(100_000, 2), rng(11)).y
    assert not np.any(y[:10_000])
    assert not np.any(y[90_000:])
    middle = y[40_000:60_000]  # about 500 independent values of a 1 Hz sway
    assert middle.std(axis=0) == pytest.approx(3.0, rel=0.25)
    assert np.abs(np.diff(y, axis=0)).max() < 1.0  # smooth


# ---- distribution


def test_heavy_tails_have_their_kurtosis_and_leave_the_variance():
    """κ = 6/(ν − 4) at ν = 16, whose own sampling error needs the eighth moment of t: 5 sd of replicas."""
    kappa, n = 0.5, 400_000
    replicas = []
    for seed in range(12):
        out = HeavyTails(kappa).apply(noisy(n, seed=seed), rng(100 + seed))
        replicas.append((out.y.var(), stats.kurtosis(out.y[:, 0])))
    variance, kurtosis = np.array(replicas).T
    assert variance.mean() == pytest.approx(1.0, abs=SIGMAS * np.sqrt((2 + kappa) / (12 * n)))
    assert kurtosis.mean() == pytest.approx(kappa, abs=SIGMAS * kurtosis.std(ddof=1) / np.sqrt(12) + 0.01)


def test_heavy_tails_are_student():
    y = HeavyTails(2.0).apply(noisy(20_000), rng(12)).y[:, 0]
    nu = 7.0
    assert stats.kstest(y * np.sqrt(nu / (nu - 2.0)), stats.t(nu).cdf).pvalue > 1e-5


def test_burst_multiplies_the_variance_inside_and_only_there():
    clean = noisy(200_000)
    out = Burst(500.0, 600.0, 2.5).apply(clean, rng())
    inside = (clean.t >= 500.0) & (clean.t < 1100.0)
    np.testing.assert_array_equal(out.y[~inside], clean.y[~inside])
    np.testing.assert_allclose(out.y[inside], np.sqrt(2.5) * clean.y[inside], rtol=1e-12)


def test_variance_drift_doubles_in_its_time():
    clean = noisy(1001)
    out = VarianceDrift(np.log(2.0) / 1.0).apply(clean, rng())
    log_ratio = np.log2((out.y / clean.y) ** 2)[:, 0]
    np.testing.assert_allclose(np.diff(log_ratio), INTERVAL, rtol=1e-6)
    assert log_ratio[500] == pytest.approx(0.0, abs=1e-9)


def test_cross_axis_correlates_every_pair_and_leaves_the_variances():
    n = 200_000
    out = CrossAxis(0.3).apply(noisy(n, 3), rng(13)).y
    correlation = np.corrcoef(out.T)[np.triu_indices(3, 1)]
    np.testing.assert_allclose(correlation, 0.3, atol=SIGMAS * (1 - 0.09) / np.sqrt(n))
    np.testing.assert_allclose(out.var(axis=0), 1.0, atol=SIGMAS * np.sqrt(2 / n))


# ---- sampling


def test_duplicates_hold_the_wanted_fraction_in_all_channels():
    n, fraction = 200_000, 0.15
    y = Duplicates(fraction).apply(noisy(n, 2), rng(14)).y
    same = y[1:] == y[:-1]
    np.testing.assert_array_equal(same[:, 0], same[:, 1])
    assert same[:, 0].mean() == pytest.approx(fraction, abs=SIGMAS * np.sqrt(fraction / n))


def test_clipping_is_never_exceeded_and_leaves_the_rest():
    clean = noisy(20_000)
    y = Clipping(-2.5, 1.5).apply(clean, rng()).y
    assert y.max() == 1.5
    assert y.min() == -2.5
    between = (clean.y > -2.5) & (clean.y < 1.5)
    np.testing.assert_array_equal(y[between], clean.y[between])
    assert Clipping(high=1.0).apply(clean, rng()).y.min() == clean.y.min()


def test_quantizer_gives_multiples_and_adds_step_squared_over_12():
    """Sheppard: variance 1 + step²/12 for step ≤ 2 sd (to 1e-2·step², 5 sd of a variance of 4e5 samples)."""
    n = 400_000
    for step in (0.1, 1.0, 2.0):
        y = Quantizer(step).apply(noisy(n), rng()).y
        codes = y / step
        np.testing.assert_allclose(codes, np.round(codes), atol=1e-9)
        expected = 1.0 + step**2 / 12.0
        assert y.var() == pytest.approx(expected, abs=SIGMAS * expected * np.sqrt(2 / n) + 0.01 * step**2)


def test_quantizer_dead_band_reads_zero():
    clean = noisy(5000)
    y = Quantizer(0.1, 0.35).apply(clean, rng()).y
    np.testing.assert_array_equal(y == 0.0, np.abs(clean.y) < 0.35)


def test_timing_gaps_jitter_and_clock():
    n = 100_000
    out = Timing(gap_count=40, gap_samples=7).apply(noisy(n), rng(15))
    steps = np.round(np.diff(out.t) / INTERVAL).astype(int)
    assert np.count_nonzero(steps > 1) == 40
    assert set(steps) == {1, 8}
    assert len(out.y) == n - 280
    assert out.breaks == tuple(np.flatnonzero(steps > 1) + 1)
    again = Timing(gap_count=1).apply(out, rng(17))
    assert set(np.round(np.diff(again.t)[np.array(again.breaks) - 1] / INTERVAL)) <= {6, 8, 13}
    assert len(again.breaks) in (40, 41)
    jittered = Timing(jitter_sd=5e-4).apply(noisy(n), rng(16)).t
    steps = np.diff(jittered)
    assert steps.std() == pytest.approx(5e-4 * np.sqrt(2.0), rel=SIGMAS / np.sqrt(n))
    lag1 = np.corrcoef(steps[1:], steps[:-1])[0, 1]
    assert lag1 == pytest.approx(-0.5, abs=SIGMAS / np.sqrt(n))
    slow = Timing(clock_ratio=1.001).apply(noisy(n), rng()).t
    assert slow[-1] - slow[0] == pytest.approx(1.001 * (n - 1) * INTERVAL, rel=1e-12)


# ---- geometry


def test_attitude_turns_gravity_and_keeps_its_length():
    t = np.arange(1001) * INTERVAL
    gravity = np.array([0.3, -0.1, -9.8])
    y = Attitude(0.2).apply(Samples(t, np.tile(gravity, (1001, 1)), INTERVAL), rng()).y
    np.testing.assert_allclose(np.linalg.norm(y, axis=1), np.linalg.norm(gravity), rtol=1e-12)
    np.testing.assert_allclose(y[:, 0], 0.3)
    angle = np.arctan2(y[:, 1], -y[:, 2]) - np.arctan2(-0.1, 9.8)
    np.testing.assert_allclose(angle, -0.2 * t / t[-1], atol=1e-12)
