"""What all static effects have in common: text form, validation, random draws, identity, channels."""

from __future__ import annotations

import numpy as np
import pytest

from models.effects import EFFECTS, Samples, draw, hide, parse
from models.effects.static.distribution import HeavyTails
from models.effects.static.events import Spikes, Step
from models.effects.static.sampling import Clipping, Duplicates, Quantizer, Timing
from models.effects.static.spectral import Line

INTERVAL = 0.01
CODES = tuple(EFFECTS)

REPORTED = {
    "line": {"frequency", "amplitude"},
    "vibration": {"frequency", "quality", "sd"},
    "lowpass": {"cutoff"},
    "colour": {"ar", "ma"},
    "temperature": {"slope"},
    "thermal_lag": {"slope", "time_constant", "prompt_slope"},
    "step": {"time", "size"},
    "recovery": {"time", "size", "time_constant"},
    "warmup": {"amplitude", "time_constant"},
    "telegraph": {"size", "dwell_low", "dwell_high"},
    "gauss_markov": {"sd", "time_constant"},
    "spikes": {"rate", "size"},
    "heavy_tails": {"excess_kurtosis"},
    "burst": {"start", "duration", "variance_ratio"},
    "variance_drift": {"slope"},
    "comb": {"spacing", "sd"},
    "skewed_noise": {"skewness"},
    "periodic_variance": {"period", "depth"},
    "temperature_squared": {"curvature"},
    "temperature_rate": {"slope"},
    "hysteresis": {"slope", "width"},
    "duplicates": {"fraction"},
    "timing": {"gap_count", "jitter_sd", "clock_ratio"},
    "clipping": {"low", "high"},
    "lattice": {"step", "deadband"},
    "overflow": {"low", "high"},
    "cross_axis": {"correlation"},
    "attitude": {"tilt"},
    "motion": {"start", "duration"},
}

NOTHING = (
    "line:frequency=3,amplitude=0",
    "vibration:frequency=3,quality=10,sd=0",
    "colour:",
    "temperature:slope=0",
    "thermal_lag:slope=0,time_constant=100",
    "step:time=10,size=0",
    "recovery:time=10,size=0,time_constant=3",
    "warmup:amplitude=0,time_constant=30",
    "telegraph:size=0,dwell_low=1,dwell_high=1",
    "gauss_markov:sd=0,time_constant=10",
    "spikes:rate=0,size=5",
    "spikes:rate=1,size=0",
    "heavy_tails:excess_kurtosis=0",
    "burst:start=5,duration=10,variance_ratio=1",
    "variance_drift:slope=0",
    "comb:spacing=0.7,sd=0",
    "skewed_noise:skewness=0",
    "periodic_variance:period=3,depth=0",
    "temperature_squared:curvature=0",
    "temperature_rate:slope=0",
    "hysteresis:slope=0,width=1",
    "duplicates:fraction=0",
    "timing:",
    "clipping:low=-1e9",
    "overflow:low=-1e9,high=1e9",
    "cross_axis:correlation=0",
    "attitude:tilt=0",
    "motion:start=5,duration=10,sd=0",
)


def block(n: int = 4000, k: int = 3, seed: int = 1) -> Samples:
    t = np.arange(n) * INTERVAL
    white = np.random.default_rng(seed).standard_normal((n, k))
    gravity = np.array([0.1, -0.2, -9.8])[:k]
    return Samples(t, gravity + white, INTERVAL, 25.0 + 0.1 * t, white)


def drawn(code: str, seed: int) -> object:
    return draw(code, np.random.default_rng(seed), white_sd=1.0, interval=INTERVAL, span=40.0)


def test_every_static_cause_is_there_with_the_names_that_findings_use():
    assert set(EFFECTS) == set(REPORTED)
    for code, effect in EFFECTS.items():
        assert effect.name == code
        assert REPORTED[code] <= set(effect.__dataclass_fields__)


@pytest.mark.parametrize("code", CODES)
@pytest.mark.parametrize("seed", range(5))
def test_text_and_back(code, seed):
    effect = drawn(code, seed)
    assert parse(str(effect)) == effect


@pytest.mark.parametrize("code", CODES)
def test_draws_are_usable_reproducible_and_change_the_data(code):
    clean = block()
    for seed in range(3):
        effect = drawn(code, seed)
        assert effect == drawn(code, seed)
        first = effect.apply(clean, np.random.default_rng(seed))
        again = effect.apply(clean, np.random.default_rng(seed))
        np.testing.assert_array_equal(first.y, again.y)
        assert np.all(np.isfinite(first.y))
        assert np.all(np.diff(first.t) > 0)
        if code not in {"spikes", "step", "duplicates", "clipping"}:  # may miss so short a block
            assert first.y.shape != clean.y.shape or np.any(first.y != clean.y)


@pytest.mark.parametrize("code", CODES)
def test_input_is_left_alone(code):
    clean, twin = block(), block()
    drawn(code, 0).apply(clean, np.random.default_rng(0))
    np.testing.assert_array_equal(clean.y, twin.y)
    np.testing.assert_array_equal(clean.t, twin.t)
    np.testing.assert_array_equal(clean.white, twin.white)


@pytest.mark.parametrize("text", NOTHING)
def test_zero_amplitude_is_the_identity(text):
    clean = block()
    same = parse(text).apply(clean, np.random.default_rng(0))
    np.testing.assert_allclose(same.y, clean.y, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(same.t, clean.t)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("lines:frequency=1", "must be one of line, vibration, .*; got 'lines'"),
        (
            "line:f=1,amplitude=2",
            "'line' takes frequency=VALUE, amplitude=VALUE, phase=VALUE, modulation_frequency=VALUE, "
            "modulation_depth=VALUE; got 'f=1'",
        ),
        ("line:frequency", "'line' takes .*; got 'frequency'"),
        ("line:frequency=1", "'line' needs amplitude=VALUE; got 'line:frequency=1'"),
        ("line:frequency=fast,amplitude=1", "'frequency' of 'line' must be a number, got 'fast'"),
        ("timing:gap_count=1.5", "'gap_count' of 'timing' must be an integer, got '1.5'"),
        ("colour:ar=0.1;0.2", "'ar' of 'colour' must be numbers parted by '/', got '0.1;0.2'"),
        ("colour:ar=1.01", r"'ar' must be stationary .*, got \(1.01,\)"),
        ("line:frequency=-1,amplitude=1", "'frequency' must be positive, got -1.0"),
        ("line:frequency=1,amplitude=-1", "'amplitude' must not be negative, got -1.0"),
        ("line:frequency=nan,amplitude=1", "'frequency' must be positive, got nan"),
        ("step:time=1,size=inf", "'size' must be finite, got inf"),
        ("duplicates:fraction=1", "'fraction' must be at least 0.0 and below 1.0, got 1.0"),
        ("clipping:", "'low' or 'high' must be given, got neither"),
        ("clipping:low=2,high=1", "'low' must be below 'high', 1.0, got 2.0"),
        ("overflow:low=2,high=1", "'low' must be below 'high', 1.0, got 2.0"),
        ("cross_axis:correlation=-0.1", "'correlation' must be at least 0.0 and below 1.0, got -0.1"),
    ],
)
def test_bad_text_gets_one_clear_line(text, says):
    with pytest.raises(ValueError, match=f"^.*{says}$"):
        parse(text)


@pytest.mark.parametrize(
    ("text", "k", "says"),
    [
        ("vibration:frequency=60,quality=5,sd=1", 1, "'frequency' must be below half the rate, 50.0 Hz"),
        ("attitude:tilt=0.1", 2, "'attitude' needs the three channels of a triad, got 2"),
        ("cross_axis:correlation=0.1", 1, "'cross_axis' needs two channels or more, got 1"),
        ("spikes:rate=101,size=1", 1, "'rate' must not exceed the sampling rate, 100.0 Hz, got 101.0"),
        ("timing:gap_count=1000", 1, "'gap_count' must leave room in 4000 samples, at most 666, got 1000"),
    ],
)
def test_effects_that_do_not_fit_the_block_say_so(text, k, says):
    with pytest.raises(ValueError, match=says):
        parse(text).apply(block(k=k), np.random.default_rng(0))


def test_thermal_effects_need_a_temperature():
    cold = Samples(np.arange(10) * INTERVAL, np.zeros((10, 1)), INTERVAL)
    for text in ("temperature:slope=1", "thermal_lag:slope=1,time_constant=2"):
        with pytest.raises(ValueError, match="needs a block with a temperature"):
            parse(text).apply(cold, np.random.default_rng(0))


def test_a_block_checks_its_shapes():
    t = np.arange(10) * INTERVAL
    with pytest.raises(ValueError, match="'t' and 'y' must have shapes"):
        Samples(t, np.zeros(10), INTERVAL)
    with pytest.raises(ValueError, match="'temperature' must have shape"):
        Samples(t, np.zeros((10, 1)), INTERVAL, temperature=np.zeros(9))
    with pytest.raises(ValueError, match="'white' must have the shape"):
        Samples(t, np.zeros((10, 2)), INTERVAL, white=np.zeros((10, 1)))
    with pytest.raises(ValueError, match="'interval' must be positive, got 0"):
        Samples(t, np.zeros((10, 1)), 0.0)


def test_hidden_effects_stay_in_their_channels():
    clean = block()
    dirty = hide(clean, [(Step(10.0, 1.0), [1]), (HeavyTails(1.0), [1, 2])], np.random.default_rng(0))
    np.testing.assert_array_equal(dirty.y[:, 0], clean.y[:, 0])
    assert np.any(dirty.white[:, 2] != clean.white[:, 2])
    slow = dirty.y - dirty.white - (clean.y - clean.white)
    np.testing.assert_allclose(slow[:, 1], np.where(clean.t >= 10.0, 1.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(slow[:, 2], 0.0, atol=1e-12)


def test_order_of_mention_does_not_matter_across_stages():
    """The lattice is the last thing a spike meets, however they are named."""
    clean = block()
    chain = [(Quantizer(0.5), [0, 1, 2]), (Clipping(-3.0, 3.0), [0, 1, 2]), (Spikes(20.0, 7.3), [0, 1, 2])]
    dirty = hide(clean, chain, np.random.default_rng(0))
    np.testing.assert_array_equal(dirty.y, 0.5 * np.round(2.0 * dirty.y))
    assert dirty.y.max() <= 3.0
    assert dirty.y.min() >= -3.0


def test_hide_refuses_channels_that_are_not_there_and_clocks_of_some():
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match="'columns' must be some of 0 … 2, got \\[3\\]"):
        hide(block(), [(Line(3.0, 1.0), [3])], rng)
    with pytest.raises(ValueError, match="'timing' acts on all 3 channels at once, got \\[0\\]"):
        hide(block(), [(Timing(1), [0])], rng)
    held = hide(block(), [(Duplicates(0.5), [0])], rng)
    assert np.any(held.y[1:, 0] == held.y[:-1, 0])
    assert not np.any(held.y[1:, 1] == held.y[:-1, 1])


def test_noise_of_a_measured_block_is_found_by_a_moving_mean():
    """With the white part unknown, effects on it act on the fast part alone: a slow curve comes through."""
    t = np.arange(20000) * INTERVAL
    slow = 50.0 * np.sin(2 * np.pi * t / 100.0)
    measured = Samples(t, (slow + np.random.default_rng(3).standard_normal(len(t)))[:, None], INTERVAL)
    louder = parse("burst:start=0,duration=1e9,variance_ratio=4").apply(measured, np.random.default_rng(0))
    rest = louder.y[200:-200, 0] - slow[200:-200]
    assert rest.var() == pytest.approx(4.0, rel=0.1)
