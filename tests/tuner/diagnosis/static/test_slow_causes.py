"""Slow causes: where they begin, what they leave behind, and what has no name."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfilt

from models.effects.static.thermal import behind_play
from models.noise import BiasInstability, NoiseModel, RandomWalk, White
from tuner.diagnosis import diagnose
from tuner.diagnosis.static.causes.temperature import Temperature, warming_alike
from tuner.diagnosis.static.causes.temperature_rate import TemperatureRate
from tuner.diagnosis.static.causes.template import Template
from tuner.diagnosis.static.causes.warmup import Warmup
from tuner.diagnosis.static.channel import channel
from tuner.diagnosis.static.findings import findings, singles
from tuner.diagnosis.static.model.covariate import smoothed, typical_repeats
from tuner.diagnosis.static.model.fitted_channel import fit_channel
from tuner.diagnosis.static.outcome import Accepted, TestResult
from tuner.diagnosis.static.position_drift import found_signal
from tuner.diagnosis.static.search import SearchResult
from tuner.diagnosis.static.shared_shape import with_shared_shape
from tuner.diagnosis.static.slow_shapes import settled
from tuner.simulation.static import Channel, simulate
from tuner.types import Gain
from tuner.types.records import Record

SPAN, RATE = 1200.0, 50.0
COUNT = int(SPAN * RATE)
TIME = np.arange(COUNT) / RATE
CELSIUS = 25.0 + 5.0 * np.sin(2.0 * np.pi * TIME / 700.0 + 0.3)
NOISE = NoiseModel((White(1e-3), BiasInstability(2e-4), RandomWalk(5e-6)))


def record(added: np.ndarray, *, celsius: np.ndarray | None = None, noise: NoiseModel = NOISE) -> Record:
    """Return noise with a signal, shape (n,), added."""
    made = simulate({"gyro_x": Channel(noise)}, duration=SPAN, rate=RATE, seed=4)[0][0]
    covariates = {} if celsius is None else {"temperature": celsius}
    return Record(
        "gyro", made.t, made.y + added[:, None], made.axes, made.unit, made.interval, covariates=covariates
    )


def test_a_large_step_is_placed_to_the_sample_and_leaves_nothing():
    first = 33_337
    (finding,) = diagnose(record(np.where(np.arange(COUNT) >= first, 0.02, 0.0))).findings
    assert finding.cause == "step"
    time = finding.parameters["time"]
    assert abs(time.value - first / RATE) < 0.2
    assert time.interval[1] - time.interval[0] < 1.0


def test_events_have_the_times_of_stamps_that_wander():
    """By even samples they were up to a second beside, in intervals of a sample or two."""
    made, stamps = record(np.zeros(COUNT)), TIME - 5.0 * np.expm1(-TIME / 300.0)
    noisy = np.random.default_rng(6).normal(0.0, 0.01, COUNT) * ((stamps >= 700.0) & (stamps < 750.0))
    moved = made.y[:, 0] + 0.02 * (stamps >= 400.0) + noisy
    interval = float(np.mean(np.diff(stamps)))
    found = diagnose(Record("gyro", stamps, moved, made.axes, made.unit, interval)).findings
    step, burst = (next(f.parameters for f in found if f.cause == cause) for cause in ("step", "burst"))
    for one, true in ((step["time"], 400.0), (burst["start"], 700.0), (burst["duration"], 50.0)):
        assert abs(one.value - true) < 0.2
        assert one.interval[0] - 0.02 <= true <= one.interval[1] + 0.02


def test_a_lag_may_start_out_of_balance():
    """The temperature inside is 8 K off at first: no warm-up beside the lag."""
    phi = np.exp(-1.0 / (150.0 * RATE))
    inside = lfilter([1.0 - phi], [1.0, -phi], CELSIUS, zi=[phi * (CELSIUS[0] + 8.0)])[0]
    (finding,) = diagnose(record(2e-3 * inside, celsius=CELSIUS)).findings
    assert finding.cause == "thermal_lag"
    low, high = finding.parameters["time_constant"].interval
    assert abs(finding.parameters["time_constant"].value - 150.0) < 1.5 * (high - low)  # 6 sd


def test_a_curve_of_the_temperature_has_its_name_and_size():
    away = CELSIUS - CELSIUS.mean()
    found = {f.cause: f for f in diagnose(record(5e-4 * away + 2e-4 * away**2, celsius=CELSIUS)).findings}
    assert set(found) == {"temperature", "temperature_squared"}
    low, high = found["temperature_squared"].parameters["curvature"].interval
    assert abs(found["temperature_squared"].parameters["curvature"].value - 2e-4) < 1.5 * (high - low)  # 6 sd


def test_a_curve_of_the_temperature_of_a_unit_that_warms_is_not_a_warm_up():
    """Its square is an exponential of half the time constant: it was named one, without doubt."""
    celsius = 25.0 - 10.0 * np.expm1(-TIME / 200.0)
    away = celsius - celsius.mean()
    found = diagnose(record(2e-3 * away + 2e-4 * away**2, celsius=celsius)).findings
    assert {f.cause for f in found} == {"temperature", "temperature_squared"}
    assert all("warmup" in {a.cause for a in f.alternatives} for f in found)


def test_a_bias_behind_a_play_of_the_temperature_is_hysteresis():
    signal = 2e-3 * (behind_play(CELSIUS, 2.0) - CELSIUS[0])
    causes = [f.cause for f in diagnose(record(signal, celsius=CELSIUS)).findings]
    assert causes[0] == "hysteresis"
    assert set(causes) <= {"hysteresis", "temperature"}


def test_the_signal_of_a_rate_has_no_steps_of_the_thermometer():
    """A step of 0.125 K between samples would be 6 K/s, a thousand times the largest rate."""
    codes = record(np.zeros(COUNT), celsius=0.125 * np.round(CELSIUS / 0.125))
    signal = found_signal("temperature_rate", {"slope": 1.0}, codes, "gyro_x")
    true = 5.0 * 2.0 * np.pi / 700.0 * np.cos(2.0 * np.pi * TIME / 700.0 + 0.3)
    middle = slice(COUNT // 10, -COUNT // 10)
    assert np.abs(signal - true)[middle].max() < 0.15 * np.abs(true).max()


def test_two_ways_of_a_temperature():
    """Fast changes act more than slow ones: one lag, the slope of slow changes, and another for what is prompt."""
    phi = np.exp(-1.0 / (90.0 * RATE))
    inside = lfilter([1.0 - phi], [1.0, -phi], CELSIUS, zi=[phi * CELSIUS[0]])[0]
    (finding,) = diagnose(record(1e-3 * inside + 4e-3 * (CELSIUS - inside), celsius=CELSIUS)).findings
    assert finding.cause == "thermal_lag"
    for name, true in (("slope", 1e-3), ("prompt_slope", 4e-3), ("time_constant", 90.0)):
        low, high = finding.parameters[name].interval
        assert abs(finding.parameters[name].value - true) < 1.5 * (high - low)  # 6 sd


def test_one_temperature_in_several_axes_is_one_cause():
    """What a thermometer that warms likewise explains as well; an axis with a transient of its own keeps that."""
    warm = 25.0 - 8.0 * np.expm1(-TIME / 250.0)
    own = {
        "x": (Temperature(), -2e-3 * warm),
        "y": (Warmup(250.0), 3e-3 * warm),
        "z": (Warmup(60.0), 0.02 * np.exp(-TIME / 60.0)),
    }
    outcomes = {}
    for axis, (shape, added) in own.items():
        one = channel(record(added, celsius=warm), "gyro_x")
        base, final = fit_channel(one), fit_channel(one, (shape,))
        found = Accepted(shape, TestResult(shape.cause, 1e-20, 40.0, 80.0, "as found"))
        outcomes[axis] = SearchResult(base, final, (found,), ())
    changed = with_shared_shape(outcomes)
    assert set(changed) == {"y"}
    (found,) = changed["y"].accepted
    assert found.extension.cause == "temperature"
    assert [a.cause for a in found.alternatives] == ["warmup"]
    slope = found.extension.values["slope"]
    assert slope.lower < 3e-3 / outcomes["y"].base.channel.scale < slope.upper


def _named(added: np.ndarray, *shapes: Template, held_out: float = 1.0) -> SearchResult:
    """Return the result of a search that named shapes in a record, each with a gain on data held out, nats."""
    one = channel(record(added, celsius=CELSIUS), "gyro_x")
    gain = Gain("60/40", 0.0, 0.0, held_out)
    taken = (Accepted(x, TestResult(x.cause, 1e-20, 40.0, 80.0, "as found"), gain=gain) for x in shapes)
    return SearchResult(fit_channel(one), fit_channel(one, shapes), tuple(taken), ())


def test_an_axis_with_one_of_two_shared_shapes_keeps_it_alone():
    """It was given a slope by temperature whose interval held zero, which held-out data then contradicted."""
    away, rate = 2e-3 * CELSIUS, 0.15 * np.gradient(CELSIUS, TIME)
    outcomes = {
        "x": _named(away + rate, Temperature(), TemperatureRate()),
        "y": _named(rate, TemperatureRate()),
    }
    assert with_shared_shape(outcomes) == {}


def test_what_held_out_data_confirm_in_one_axis_is_not_lost_by_another():
    """Temperature in gyro y of a tag, slope as published, was "not confirmed", beside 58 nats against another axis."""
    axes = {"gyro_x": 37.0, "gyro_y": 3.0, "gyro_z": -58.0}
    every = [
        single
        for axis, nats in axes.items()
        for single in singles(axis, _named(2e-3 * CELSIUS, Temperature(), held_out=nats), NOISE)
    ]
    confirmed, doubted = sorted(findings(every), key=lambda one: -len(one.channels))
    assert confirmed.channels == ("gyro_x", "gyro_y")
    assert doubted.channels == ("gyro_z",)


def test_one_shape_is_named_where_two_explain_no_more():
    """A warm-up beside a thermometer that warms more quickly: it alone explains the record."""
    celsius = 25.0 - 8.0 * np.expm1(-TIME / 60.0)
    one = channel(record(0.02 * np.exp(-TIME / 250.0), celsius=celsius), "gyro_x")
    own = Temperature(), Warmup(245.0)
    taken = [Accepted(x, TestResult(x.cause, 1e-20, 40.0, 80.0, "as found")) for x in own]
    fitted, (found,) = settled(fit_channel(one, own), taken, 1e-4)
    assert found.extension.cause == "warmup"
    assert found.extension.time_constant == pytest.approx(250.0, rel=0.5)
    assert fitted.extensions == (found.extension,)


@pytest.mark.parametrize(
    "celsius",
    [np.full(len(TIME), 25.0), np.interp(TIME, SPAN * np.array([0.2, 0.4, 0.6, 0.9]), [10, 30, 30, 10.0])],
)
def test_a_temperature_that_does_not_warm_is_no_exponential(celsius):
    """A constant one and that of a chamber: what warms is then no temperature."""
    noisy = celsius + 0.01 * np.random.default_rng(3).standard_normal(len(TIME))
    assert warming_alike(channel(record(0.0 * TIME, celsius=noisy), "gyro_x")) == []


def test_a_changing_slope_is_reported_without_a_name():
    diagnosis = diagnose(record(2e-3 * (CELSIUS - 25.0) * (TIME / SPAN - 0.5), celsius=CELSIUS))
    assert diagnosis.findings == ()
    assert any("temperature × time" in u.statistic for u in diagnosis.unexplained)


def test_slow_sway_is_motion():
    inside = (TIME > 500.0) & (TIME < 560.0)
    sway = sosfilt(
        butter(2, [0.1, 3.0], "band", fs=RATE, output="sos"),
        np.random.default_rng(1).standard_normal(inside.sum()),
    )
    y = np.zeros(COUNT)
    y[inside] = 0.2 * sway / sway.std() * np.hanning(len(sway))
    (finding,) = diagnose(record(y)).findings
    assert finding.cause == "motion"
    start, duration = (finding.parameters[k].value for k in ("start", "duration"))
    assert 480.0 < start < 515.0
    assert 545.0 < start + duration < 580.0


@pytest.mark.parametrize(("repeats", "share"), [(1, 0.3), (8, 0.5)])
def test_a_thermometer_is_smoothed_where_its_noise_allows(repeats, share):
    """Curved at the start, noisy and repeated: a share of the noise is left, at the start as well."""
    t = np.linspace(0.0, 1.0, 4096)
    truth = 20.0 - 3.0 * np.exp(-t / 0.1)
    noisy = truth + 0.05 * np.random.default_rng(2).standard_normal(4096)
    readings = 0.01 * np.round(noisy / 0.01)[np.arange(4096) // repeats * repeats]
    curve = smoothed(readings, 0.01, typical_repeats(readings))
    assert np.std(curve - truth) < share * 0.05
    assert abs(curve[0] - truth[0]) < 0.1


def test_the_curve_of_a_coarse_thermometer_follows_a_quick_start():
    """A few readings together are never as far off as half a step: over the first of them, nor is the curve."""
    t = np.arange(360_000) / 125.0
    truth = 28.5 - 1.23 * np.exp(-t / 92.0)
    for seed in range(4):
        noisy = truth + 0.025 * np.random.default_rng(seed).standard_normal(len(t))
        readings = (0.125 * np.round(noisy / 0.125)).reshape(-1, 90).mean(axis=1)
        error = smoothed(readings, 0.125) - truth.reshape(-1, 90).mean(axis=1)
        assert abs(np.mean(error[:16])) < 0.5 * 0.125
        assert np.std(error) < 0.06 * 0.125
