"""Identification of all axes of a log: terms come back with intervals, by every method."""

import json
from dataclasses import replace

import numpy as np
import pytest

from models.noise import BiasInstability, GaussMarkov, NoiseModel, Quantization, RandomWalk, White
from tuner.formats.identification import identification_json
from tuner.identification import identify, identify_channel
from tuner.identification.allan_octaves import OctaveCurve
from tuner.identification.periodogram import cosine_periodogram
from tuner.identification.valid_band import Octaves, find_band
from tuner.types.records import DataError, Record

INTERVAL = 0.01
MODEL = NoiseModel((White(1e-3), BiasInstability(5e-4), RandomWalk(6e-5)))
BASE = {"quantization", "white", "bias_instability", "random_walk", "ramp"}


def record(y, axes=("gyro_x",), unit="rad/s", **rest):
    y = np.asarray(y, dtype=float)
    y = y[:, None] if y.ndim == 1 else y
    return Record(axes[0].split("_")[0], np.arange(len(y)) * INTERVAL, y, axes, unit, INTERVAL, **rest)


def sampled(model=MODEL, seed=1, n=200_000):
    return model.sample(n, INTERVAL, np.random.default_rng(seed))


@pytest.fixture(scope="module")
def channel():
    return identify_channel(record(sampled()), "gyro_x")


@pytest.mark.parametrize("method", ["likelihood", "leastsquares"])
def test_terms_come_back_with_intervals(method):
    found = identify_channel(record(sampled()), "gyro_x", method=method)
    white = found.term("white").coefficients["density"]
    assert white.value == pytest.approx(1e-3, rel=0.01)
    level = found.term("bias_instability").coefficients["level"]
    low, high = level.interval
    assert low < level.value < high
    assert level.value == pytest.approx(5e-4, rel=0.35)
    assert found.method == method
    assert found.warnings == ()


def test_every_base_term_has_an_answer(channel):
    assert {t.name for t in channel.terms} >= BASE
    for term in channel.terms:
        for coefficient in term.coefficients.values():
            assert (coefficient.value is None) != (coefficient.upper is None)
            if coefficient.value is None:
                assert coefficient.reason
    assert len(channel.parameters) == len(channel.covariance)
    assert {t.name for t in channel.model.terms} == {t.name for t in channel.terms if t.present}


def test_methods_agree_on_what_there_is():
    y = record(sampled())
    by_method = {m: identify_channel(y, "gyro_x", method=m) for m in ("slopes", "likelihood")}
    for found in by_method.values():
        assert found.term("white").coefficients["density"].value == pytest.approx(1e-3, rel=0.1)
    assert "slope" in by_method["slopes"].term("white").coefficients["density"].reason


def test_deviation_at_ten_seconds_and_minimum(channel):
    truth = float(np.sqrt(MODEL.allan_variance(np.array([10.0]), interval=INTERVAL)[0]))
    low, high = channel.sigma_10s.interval
    assert abs(channel.sigma_10s.value - truth) < 1.3 * (high - low)
    assert channel.floor.value == pytest.approx(channel.minimum.value / 0.664282, rel=1e-5)
    assert channel.minimum.value == pytest.approx(np.min(channel.allan.deviation()), rel=0.2)


def test_a_falling_curve_bounds_its_minimum():
    found = identify_channel(record(sampled(NoiseModel((White(1e-3),)), 2, 30_000)), "gyro_x")
    if found.minimum.value is None:
        assert found.minimum.upper > 0.0
        assert "still falls" in found.minimum.reason
    assert found.term("bias_instability").coefficients["level"].value is None


def test_short_record_has_no_deviation_at_ten_seconds():
    found = identify_channel(record(sampled(n=1500)), "gyro_x")
    assert found.sigma_10s.value is None
    assert "20 s are needed" in found.sigma_10s.reason


def test_interval_of_the_mean_knows_the_slow_noise():
    # s/√n would be 2e-5; the random walk alone moves the mean of 2000 s by K √(T/3) = 1.5e-3
    found = identify_channel(record(7.0 + sampled()), "gyro_x")
    low, high = found.mean.interval
    assert found.mean.value == pytest.approx(7.0, abs=0.01)
    assert 1e-3 < high - low < 2e-2


def test_scale_and_offset_carry_through(channel):
    other = identify_channel(record(5.0 + 3.0 * sampled()), "gyro_x")
    for term, scaled in zip(channel.terms, other.terms, strict=True):
        assert term.name == scaled.name
        for name, coefficient in term.coefficients.items():
            if coefficient.value is not None and name != "time_constant":
                assert scaled.coefficients[name].value == pytest.approx(3.0 * coefficient.value, rel=1e-3)


def test_terms_can_be_forced():
    found = identify_channel(record(sampled()), "gyro_x", terms=("white", "gauss_markov"))
    assert [t.name for t in found.terms] == ["white", "gauss_markov"]
    with pytest.raises(ValueError, match="nonsense"):
        identify_channel(record(sampled(n=2000)), "gyro_x", terms=("white", "nonsense"))
    with pytest.raises(ValueError, match="'method'"):
        identify_channel(record(sampled(n=2000)), "gyro_x", method="guess")


def test_segments_are_not_joined():
    y = np.concatenate([sampled(seed=3, n=60_000), 1.0 + sampled(seed=4, n=60_000)])
    whole = record(y, segments=((0, 60_000), (60_000, 120_000)))
    found = identify_channel(whole, "gyro_x")
    assert found.span == pytest.approx(1200.0)
    assert np.max(found.allan.deviation()) < 0.1  # the jump of 1 between the segments is not seen


def test_a_low_pass_filter_is_kept_out_of_the_white_noise():
    taps = np.ones(5) / 5.0
    filtered = np.convolve(sampled(NoiseModel((White(1e-3), RandomWalk(3e-5))), 5), taps, "valid")
    found = identify_channel(record(filtered), "gyro_x")
    assert found.term("white").coefficients["density"].value == pytest.approx(1e-3, rel=0.05)
    assert any("filter" in warning for warning in found.warnings)
    hidden = found.term("quantization").coefficients["increment_sd"]
    assert hidden.value is None
    # the samples themselves are the ceiling: σ(τ0) τ0/√3 with its interval
    assert hidden.upper == pytest.approx(found.allan.deviation()[0, 0] * INTERVAL / np.sqrt(3.0), rel=0.05)


@pytest.mark.parametrize(
    "model",
    [
        NoiseModel((White(1.0),)),
        MODEL,
        NoiseModel((Quantization(0.1), White(1.0), RandomWalk(0.03))),
        NoiseModel((White(1.0), GaussMarkov(0.3, 100.0))),
    ],
    ids=["white", "flicker", "quantized", "markov"],
)
def test_clean_noise_keeps_its_whole_band(model):
    records = [[sampled(model, 50 + seed, 60_000)] for seed in range(8)]
    spectra = [Octaves.of_periodogram(cosine_periodogram(record, INTERVAL)) for record in records]
    curves = [Octaves.of_curve(OctaveCurve.of(record, INTERVAL)) for record in records]
    assert sum(find_band(spectrum).m == 1 for spectrum in spectra) >= 7
    assert sum(find_band(curve).m == 1 for curve in curves) >= 7


def test_a_process_of_few_samples_beside_white_noise_is_no_filter():
    """Of 16 samples, seen by 12 000 nats; before, white noise 4.4 times as large, of clusters of 256 samples."""
    found = identify_channel(
        record(sampled(NoiseModel((White(0.1), GaussMarkov(0.8, 16 * INTERVAL))), 7)), "gyro_x"
    )
    assert [t.name for t in found.terms if t.present] == ["white", "gauss_markov"]
    for name, parameter, true in (
        ("white", "density", 0.1),
        ("gauss_markov", "time_constant", 16 * INTERVAL),
    ):
        assert found.term(name).coefficients[parameter].value == pytest.approx(true, rel=0.05)


def test_a_line_is_a_warning_not_a_term():
    y = sampled(seed=6)
    line = y + 2e-3 * np.sin(2.0 * np.pi * 0.5 * np.arange(y.size) * INTERVAL)
    assert identify_channel(record(line), "gyro_x").warnings


def rotating_earth(latitude, heading=0.0):
    """Records of a level unit (forward-right-down) at rest on the turning Earth."""
    rng = np.random.default_rng(7)
    phi, psi = np.radians(latitude), np.radians(heading)
    rate = 7.292115e-5 * np.array([np.cos(phi) * np.cos(psi), -np.cos(phi) * np.sin(psi), -np.sin(phi)])
    gyro = rate + 1e-6 * rng.standard_normal((4000, 3))
    accel = np.array([0.0, 0.0, -9.8]) + 1e-4 * rng.standard_normal((4000, 3))
    return (
        record(gyro, ("gyro_x", "gyro_y", "gyro_z")),
        record(accel, ("accel_x", "accel_y", "accel_z"), "m/s^2"),
    )


def test_vertical_earth_rate_is_taken_out():
    found = identify(rotating_earth(45.0, 30.0), latitude=45.0, arma=None)
    down = found.channels["gyro_z"].mean
    assert down.value == pytest.approx(0.0, abs=2e-7)
    north = found.channels["gyro_x"].mean  # its share needs a heading: it stays, inside the interval
    assert north.value == pytest.approx(7.292115e-5 * np.cos(np.pi / 4) * np.cos(np.pi / 6), rel=0.02)
    assert north.interval[0] < 0.0 < north.interval[1]
    assert "heading" in " ".join(found.notes)


def test_earth_rate_without_attitude_or_latitude_is_a_bound():
    gyro, _ = rotating_earth(45.0)
    gyro = replace(gyro, y=gyro.y[:, 2:], axes=gyro.axes[2:])
    alone = identify((gyro,), latitude=45.0, arma=None).channels["gyro_z"].mean
    assert alone.interval[0] < 0.0 < alone.interval[1]
    without = identify((gyro,), arma=None)
    assert without.channels["gyro_z"].mean.value == pytest.approx(-7.292115e-5 * np.sqrt(0.5), rel=0.01)
    assert "no latitude" in without.channels["gyro_z"].mean.reason


def test_json_has_every_key_and_no_nan():
    gyro = record(
        np.stack([sampled(n=20_000), np.zeros(20_000)], axis=1), ("gyro_x", "gyro_y"), source="a/b.csv"
    )
    for method in ("likelihood", "slopes"):
        found = identify((gyro,), method=method)
        content = json.loads(json.dumps(identification_json(found), allow_nan=False))
        assert content["schema"] == "tuner.identification/1"
        assert content["source"]["name"] == "b"
        assert list(content["channels"]) == ["gyro_x"]
        assert any("gyro_y is constant" in note for note in content["notes"])
        entry = content["channels"]["gyro_x"]
        assert set(entry["terms"]) >= BASE | {"gauss_markov"}
        assert isinstance(entry["terms"]["gauss_markov"], list)
        for name in BASE:
            for coefficient in entry["terms"][name].values():
                assert set(coefficient) >= {"value", "interval", "upper", "unit"}
        assert entry["terms"]["white"]["density"]["unit"] == "rad/s^0.5"
        assert entry["rate_hz"] == pytest.approx(100.0)
        assert set(entry["arma"]) >= {"p", "q", "ar", "ma", "variance", "criterion", "white"}
        assert len(entry["allan"]["tau"]) == len(entry["allan"]["deviation"]) == len(entry["allan"]["dof"])


def test_useless_logs_are_refused_in_one_line():
    constant = record(np.zeros(1000), source="flat.csv")
    with pytest.raises(DataError, match=r"flat\.csv"):
        identify((constant,))
    with pytest.raises(DataError, match="too short"):
        identify((record(np.arange(9.0)),), arma=None)
    double = record(sampled(n=2000))
    with pytest.raises(DataError, match="comes twice"):
        identify((double, replace(double)), arma=None)


@pytest.mark.parametrize("method", ["likelihood", "leastsquares", "slopes"])
@pytest.mark.parametrize("kind", ["shortest", "few levels", "ramp", "spike", "alternating"])
def test_odd_records_have_an_answer(kind, method):
    e = np.random.default_rng(8).standard_normal(3000)
    y = {
        "shortest": e[:16],
        "few levels": np.round(0.2 * e),
        "ramp": np.arange(3000.0),
        "spike": np.where(np.arange(3000) == 1500, 1e6, e),
        "alternating": (-1.0) ** np.arange(3000) + 0.01 * e,
    }[kind]
    arma = "bic" if method == "likelihood" else None  # it knows nothing of the method
    found = identify((record(y),), method=method, arma=arma)
    json.dumps(identification_json(found), allow_nan=False)
    for term in found.channels["gyro_x"].terms:
        for coefficient in term.coefficients.values():
            assert coefficient.upper is None or 0.0 < coefficient.upper < np.inf


def test_a_stretch_stuck_at_one_value_is_left_out():
    y = np.concatenate([np.zeros(3000), sampled(n=3000)])
    found = identify_channel(record(y, segments=((0, 3000), (3000, 6000))), "gyro_x")
    assert found.span == pytest.approx(30.0)
    assert found.term("white").coefficients["density"].value == pytest.approx(1e-3, rel=0.1)
