"""Synthesis: the handling of every term is stated, no setting is zero, every assumption has its reason."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from models.earth import EARTH_RATE
from models.noise import TERMS, GaussMarkov, NoiseModel, White
from models.units import unit_of_samples
from tests.extension.second_order_gauss_markov import SecondOrderGaussMarkov
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.exporters import export
from tuner.formats import noise_yaml
from tuner.readers.stored_identification import read_stored
from tuner.report.noise_table import states_tables
from tuner.synthesis import BOUND, RULES, bounding_state, inflate, shaping_states, synthesize, turn_on_spread
from tuner.synthesis.channel_noise import channel_noise
from tuner.synthesis.initial_covariance import GRAVITY_SPREAD
from tuner.types import (
    AllanCurve,
    ArmaFit,
    BoundUsed,
    ChannelIdentification,
    Coefficient,
    Enlargement,
    Identification,
    Quantity,
    TermEstimate,
)
from tuner.types.records import DataError

TAU = np.array([0.1, 1.0, 10.0])


def known(value: float, width: float = 0.1) -> Coefficient:
    return Coefficient.known(value, value * (1.0 - width), value * (1.0 + width), "SI")


def bounded(upper: float) -> Coefficient:
    return Coefficient.bounded(upper, "SI", "hidden")


def term(name: str, **coefficients: Coefficient) -> TermEstimate:
    return TermEstimate(name, coefficients)


def channel(
    *terms: TermEstimate, axis: str = "gyro_x", mean: float = 0.0, **changes: object
) -> ChannelIdentification:
    unit = unit_of_samples(axis)
    allan = AllanCurve("oadev", TAU, 1e-8 / TAU[:, None], np.full((3, 1), 100.0), unit, (axis,))
    made = ChannelIdentification(
        axis,
        unit,
        interval=0.01,
        span=3600.0,
        method="likelihood",
        model=NoiseModel([White(1e-4)]),
        terms=terms,
        parameters=(),
        covariance=np.zeros((0, 0)),
        mean=known(mean),
        sigma_10s=known(3e-5),
        minimum=known(1e-5),
        floor=known(1.5e-5),
        minimum_tau=500.0,
        allan=allan,
    )
    return replace(made, **changes)


def found(*channels: ChannelIdentification, **source: object) -> Identification:
    return Identification(source, {c.axis: c for c in channels})


def only(identification: Identification, **options: object):
    config = synthesize(identification, **options)
    (noise,) = config.channels.values()
    return config, noise


BASE = (
    term("quantization", increment_sd=known(1e-6)),
    term("white", density=known(1e-4)),
    term("bias_instability", level=known(1.5e-5)),
    term("random_walk", density=known(1e-7)),
    term("ramp", rate=bounded(1e-12)),
)


def test_the_handling_of_every_term_is_stated() -> None:
    _, noise = only(found(channel(*BASE)))
    assert set(noise.handling) == {t.name for t in BASE}


def test_quantization_never_folds_into_white() -> None:
    _, with_q = only(found(channel(*BASE)))
    _, without = only(found(channel(*BASE[1:])))
    assert with_q.white_density == without.white_density == 1e-4
    assert "kept out of the white density" in with_q.handling["quantization"]


def test_bounded_terms_enter_with_half_their_limit_and_say_so() -> None:
    terms = (
        term("white", density=bounded(2e-4)),
        term("bias_instability", level=bounded(4e-5)),
        term("random_walk", density=bounded(6e-7)),
    )
    config, noise = only(found(channel(*terms)))
    assert noise.white_density == pytest.approx(1e-4)
    settings = ("white_density", "markov", "random_walk_density")
    assert config.on_limit("gyro_x") == dict.fromkeys(settings, 0.5)
    assert config.states_on_limit("gyro_x") == noise.markov
    assert next(iter(states_tables(config)[0].columns[1].cells)).endswith("ASSUMED")
    assert noise.random_walk_density == pytest.approx(3e-7)
    assert noise.markov[0].sd == pytest.approx(math.sqrt(math.log(10.0) / math.pi) * 2e-5)
    assert {str(i.quantity) for i in config.inflations} == {
        "gyro_x.white.density",
        "gyro_x.bias_instability.level",
        "gyro_x.random_walk.density",
    }
    assert all(isinstance(i, BoundUsed) and i.factor == 0.5 for i in config.inflations)
    assert all(i.reason.startswith("bounded") for i in config.inflations)


def test_half_of_a_limit_is_said_alike_in_files_and_in_tables() -> None:
    """A measured Gauss–Markov process beside a bounded flicker: files and tables took all states for measured."""
    axis = channel(
        term("white", density=known(1e-4)),
        term("bias_instability", level=bounded(4e-5)),
        term("gauss_markov", sd=known(5e-5), time_constant=known(23.8061, width=0.5)),
        term("random_walk", density=known(1e-7)),
    )
    config = synthesize(found(axis, channel(*BASE, axis="accel_x")))
    noise = config.channels["gyro_x"]
    (measured,) = (state for state in noise.markov if state.time_constant == 23.8061)
    assert set(config.states_on_limit("gyro_x")) == set(noise.markov) - {measured}
    (walk,) = (one for one in export(config, "kalibr").splitlines() if one.startswith("gyroscope_random"))
    assert "rests on a 95 % limit: x" in walk
    states = [one for one in noise_yaml.dumps(config).splitlines() if "- {sd:" in one and "rad/s" in one]
    assert len(states) == len(noise.markov)
    assert all(("rests on a 95 % limit" in line) != ("23.8061" in line) for line in states)
    cells = str(next(iter(states_tables(config)[0].columns[2].cells))).split("; ")
    assert ["ASSUMED" in one for one in cells] == ["at 23.8" not in one for one in cells]


def test_white_density_comes_from_the_curve_where_no_term_tells_it() -> None:
    config, noise = only(found(channel(term("quantization", increment_sd=known(1e-6)))))
    assert noise.white_density == pytest.approx(0.5e-4)
    assert config.inflations[0].reason.startswith("bounded")


def test_a_term_without_figures_is_left_out_and_listed_so() -> None:
    nothing = Coefficient(None, None, None, "SI", "the fit failed")
    _, noise = only(found(channel(BASE[1], term("bias_instability", level=nothing))))
    assert noise.markov == ()
    assert "left out" in noise.handling["bias_instability"]


def test_gauss_markov_becomes_one_state_each() -> None:
    one = term("gauss_markov", sd=known(2e-5), time_constant=known(100.0))
    two = term("gauss_markov", sd=known(1e-5), time_constant=known(9.0))
    _, noise = only(found(channel(BASE[1], one, two)))
    assert [(s.sd, s.time_constant) for s in noise.markov] == [(2e-5, 100.0), (1e-5, 9.0)]


def test_a_process_shorter_than_a_sample_is_white_noise() -> None:
    """Of N² = σ² dt coth(dt/2T), which is 2σ²T where dt is short against T."""
    fast = term("gauss_markov", sd=known(1e-3), time_constant=known(0.005))
    _, noise = only(found(channel(BASE[1], fast)))
    assert noise.markov == ()
    assert noise.white_density**2 == pytest.approx(1e-4**2 + 1e-6 * 0.01 / math.tanh(1.0))


def test_rule_bound_takes_upper_ends_and_the_bounding_state() -> None:
    markov = term("gauss_markov", sd=known(2e-5, 0.2), time_constant=known(100.0, 0.6))
    config, noise = only(found(channel(BASE[1], BASE[3], markov)), rule=BOUND)
    assert noise.white_density == pytest.approx(1.1e-4)
    assert noise.random_walk_density == pytest.approx(1.1e-7)
    assert noise.markov == (bounding_state((1.6e-5, 2.4e-5), (40.0, 160.0)),)
    assert all(isinstance(i, Enlargement) and i.factor >= 1.0 for i in config.inflations)


def test_ramp_is_a_state_where_present_and_a_bound_where_harmless() -> None:
    _, present = only(found(channel(*BASE[1:4], term("ramp", rate=known(1e-9)))))
    assert present.ramp_sd == 1e-9
    _, harmless = only(found(channel(*BASE)))
    assert harmless.ramp_sd == 0.0
    assert "no state" in harmless.handling["ramp"]
    _, large = only(found(channel(*BASE[1:4], term("ramp", rate=bounded(1e-6)))))
    assert large.ramp_sd == pytest.approx(0.5e-6)


def test_slow_line_becomes_a_state_and_fast_line_does_not() -> None:
    slow = term("sinusoid", amplitude=known(1e-5), frequency=known(1e-3))
    fast = term("sinusoid", amplitude=known(1e-5), frequency=known(20.0))
    _, noise = only(found(channel(BASE[1], slow)))
    assert noise.markov[0].sd == pytest.approx(1e-5 / math.sqrt(2.0))
    _, noise = only(found(channel(BASE[1], fast)))
    assert noise.markov == ()
    assert "no state" in noise.handling["sinusoid"]


def test_arma_is_offered_as_shaping_states() -> None:
    fit = ArmaFit((known(0.9),), (known(-0.2),), 1e-6, 1.0, "rad/s", "bic", {(1, 1): 0.0}, white=False)
    _, noise = only(found(channel(*BASE, arma=fit)))
    assert "offered" in noise.handling["arma"]
    _, bare = only(found(channel(*BASE)))
    assert noise.markov == bare.markov
    transition, noise_covariance, stationary = shaping_states(fit)
    assert stationary == pytest.approx(transition @ stationary @ transition.T + noise_covariance)
    assert stationary[0, 0] == pytest.approx(1e-6 * (1.0 + (0.9 - 0.2) ** 2 / (1.0 - 0.81)))
    white = replace(fit, white=True)
    _, noise = only(found(channel(*BASE, arma=white)))
    assert "nothing to add" in noise.handling["arma"]
    with pytest.raises(ValueError, match="white"):
        shaping_states(white)


@pytest.mark.parametrize("rule", [*RULES, BOUND])
def test_every_rule_makes_a_usable_filter(rule: str) -> None:
    _, noise = only(found(channel(*BASE)), rule=rule)
    assert noise.white_density > 0.0
    assert noise.constant_sd > 0.0
    assert all(s.sd > 0.0 and s.time_constant > 0.0 for s in noise.markov)


def test_horizon_is_the_longest_time_constant() -> None:
    _, noise = only(found(channel(*BASE)), horizon=300.0)
    assert noise.markov[-1].time_constant == pytest.approx(300.0)


def test_bad_requests_are_refused_in_one_line() -> None:
    with pytest.raises(DataError, match="'rule' must be one of"):
        synthesize(found(channel(*BASE)), rule="best")
    with pytest.raises(DataError, match="horizon: expected a positive number, found 0"):
        synthesize(found(channel(*BASE)), horizon=0.0)
    with pytest.raises(DataError, match="no channel"):
        synthesize(found())


def test_constant_comes_from_runs_before_grades_before_means() -> None:
    axes = ("gyro_x", "gyro_y", "gyro_z")
    log = found(*(channel(*BASE, axis=a, mean=2e-3) for a in axes))
    config = synthesize(log)
    assert config.channels["gyro_x"].constant_sd == pytest.approx(2e-3)
    assert "rms of the means" in config.initial.reasons["gyro_x"]
    assert synthesize(log, turn_on={"gyro_x": 5e-4}).channels["gyro_x"].constant_sd == 5e-4
    sheet = synthesize(replace(log, source={"turn_on_sd": {"gyro_x": 7e-4}}))
    assert sheet.channels["gyro_x"].constant_sd == 7e-4


def test_a_configuration_of_limits_alone_keeps_its_turn_on_sd(tmp_path: Path) -> None:
    """What coarse codes hide is written as limits: no term of the axis has a value, and no curve follows from it."""
    one = channel(term("white", density=bounded(1e-3)), mean=2e-3)
    config = synthesize(found(one))
    noise_yaml.dump(config, tmp_path / "noise.yaml")
    again = synthesize(read_stored(tmp_path / "noise.yaml"))
    axis = one.axis
    assert again.channels[axis].constant_sd == pytest.approx(config.channels[axis].constant_sd, rel=1e-4)
    unknown = replace(config.channels[axis], constant_sd=0.0)
    noise_yaml.dump(replace(config, channels={axis: unknown}), tmp_path / "noise.yaml")
    with pytest.raises(DataError, match=f"{axis}: expected a mean, a turn-on sd or a term with a value"):
        synthesize(read_stored(tmp_path / "noise.yaml"))


def test_gyro_constant_is_never_below_earth_rate_without_better_knowledge() -> None:
    _, noise = only(found(channel(*BASE, mean=1e-6)))
    assert noise.constant_sd == EARTH_RATE


def test_accelerometer_constant_is_the_excess_over_gravity() -> None:
    def log(down: float) -> Identification:
        means = {"accel_x": 0.0, "accel_y": 1e-9, "accel_z": down}
        return found(*(channel(*BASE, axis=a, mean=m) for a, m in means.items()))

    assert synthesize(log(-9.90665)).channels["accel_x"].constant_sd == pytest.approx(0.1)
    assert synthesize(log(-9.80665)).channels["accel_x"].constant_sd == GRAVITY_SPREAD


def test_turn_on_spread_is_the_scatter_of_the_means() -> None:
    runs = [found(channel(*BASE, mean=m)) for m in (1.0, 2.0, 3.0)]
    assert turn_on_spread(runs) == {"gyro_x": pytest.approx(1.0)}
    with pytest.raises(ValueError, match="two or more"):
        turn_on_spread(runs[:1])


def test_missing_parts_are_left_out_with_a_reason_and_filled_in_on_request() -> None:
    log = found(channel(*BASE))
    config = synthesize(log)
    assert config.gnss is None
    assert any("accelerometers" in note and "--complete" in note for note in config.notes)
    assert any("--gnss" in note for note in config.notes)
    whole = synthesize(log, complete=load_grade("stim300"), gnss=load_gnss("rtk"))
    assert len(whole.channels) == 6
    assert whole.channels["gyro_y"].white_density == load_grade("stim300").gyro.white.value
    assert whole.gnss == load_gnss("rtk")
    assert whole.initial.position == pytest.approx(math.hypot(0.03, 0.01))
    assert "gyros gyro_y, gyro_z completed from grade stim300" in whole.notes
    assert "accelerometers completed from grade stim300" in whole.notes
    assert whole.channels["gyro_x"] == config.channels["gyro_x"]


def test_initial_position_sd_is_that_of_the_worst_axis_of_a_fix():
    """Horizontal √(2² + 1²), down √(1.5² + (3 · 1)²): the larger of both."""
    receiver = replace(
        load_gnss("spp"),
        position_sd=(2.0, 2.0, 1.5),
        correlated=(GaussMarkov(1.0, 100.0),),
        correlated_down=3.0,
    )
    config = synthesize(grade_identification(load_grade("stim300")), gnss=receiver)
    assert config.initial.position == pytest.approx(math.hypot(1.5, 3.0))


def test_tilt_and_heading_follow_from_the_sensors() -> None:
    config = synthesize(grade_identification(load_grade("fog")))
    accel, gyro = config.channels["accel_x"].constant_sd, config.channels["gyro_x"].constant_sd
    assert config.initial.tilt == pytest.approx(accel / 9.80665)
    assert config.initial.heading == pytest.approx(gyro / (EARTH_RATE * math.cos(math.pi / 4)))
    assert "gravity" in config.initial.reasons["tilt"]
    assert "Earth" in config.initial.reasons["heading"]
    coarse = synthesize(grade_identification(load_grade("mpu9250")))
    assert coarse.initial.heading == pytest.approx(math.radians(10.0))
    assert "another source" in coarse.initial.reasons["heading"]


def test_what_no_sensor_shows_is_assumed_and_called_so() -> None:
    gyro_alone = synthesize(found(channel(*BASE, axis="gyro_x")))
    assert gyro_alone.initial.tilt == pytest.approx(math.radians(2.0))
    assert "2° assumed" in gyro_alone.initial.reasons["tilt"]
    accel_alone = synthesize(found(channel(*BASE, axis="accel_x")))
    assert accel_alone.initial.heading == pytest.approx(math.radians(10.0))
    for name in ("position", "velocity"):
        assert "assumed" in accel_alone.initial.reasons[name]


def test_a_slow_line_is_a_state_of_its_variance_and_corner() -> None:
    """A sin(2πft) has the variance A²/2; a state with the corner frequency f, 1/(2πT) = f, follows it."""
    frequency = 1e-4
    line = TermEstimate("sinusoid", {"amplitude": known(3e-5), "frequency": known(frequency)})
    _, noise = only(found(channel(*BASE, line)))
    (state,) = [s for s in noise.markov if s.sd == pytest.approx(3e-5 / math.sqrt(2.0))]
    assert 2.0 * math.pi * frequency * state.time_constant == pytest.approx(1.0)


def test_inflation_scales_and_is_recorded() -> None:
    config = synthesize(grade_identification(load_grade("stim300")), gnss=load_gnss("rtk"))
    wanted = (
        Enlargement(Quantity("gyro", "white_density"), 3.0, "vibration"),
        Enlargement(Quantity("accel_z", "markov"), 2.0, "temperature"),
        Enlargement(Quantity("gnss", "position_sd"), 4.0, "reported too small"),
    )
    changed = inflate(config, wanted)
    assert changed.channels["gyro_y"].white_density == 3.0 * config.channels["gyro_y"].white_density
    assert changed.channels["accel_z"].markov[0].sd == 2.0 * config.channels["accel_z"].markov[0].sd
    assert changed.channels["accel_x"] == config.channels["accel_x"]
    assert changed.gnss.position_sd == pytest.approx((0.08, 0.08, 0.12))
    assert changed.inflations == (*config.inflations, *wanted)
    with pytest.raises(DataError, match="expected an axis"):
        inflate(config, [Enlargement(Quantity("gyro", "colour"), 2.0, "")])


def test_provenance_is_plain_and_complete() -> None:
    source = {"name": "log.csv", "digest": "ab", "array": np.arange(2.0), "pair": (1, 2)}
    config = synthesize(Identification(source, {"gyro_x": channel(*BASE)}), seed=7)
    assert config.name == "log.csv"
    assert config.provenance["source"]["array"] == [0.0, 1.0]
    assert config.provenance["source"]["pair"] == [1, 2]
    assert config.provenance["rate"] == pytest.approx(100.0)
    assert config.provenance["span"] == 3600.0
    assert config.provenance["seed"] == 7
    assert "numpy" in config.provenance["versions"]


def test_a_term_of_another_package_gets_the_state_that_bounds_its_spectrum() -> None:
    """Of the critically damped process, (4/T³)σ²/(1/T² + ω²)², by a first-order state nowhere below it."""
    own = term("second_order_gauss_markov", sd=known(2e-3), time_constant=known(5.0))
    with TERMS.added(SecondOrderGaussMarkov):
        noise, changes = channel_noise(
            channel(term("white", density=known(1e-4)), own), rule="ladder", horizon=1000.0, constant_sd=1e-3
        )
    (state,) = noise.markov
    omega = np.geomspace(1e-4, 1e3, 2000)
    true = 4.0 * 2e-3**2 / 5.0**3 / (1.0 / 5.0**2 + omega**2) ** 2
    ratio = state.psd(omega / (2.0 * np.pi)) / true
    assert 1.0 - 1e-3 < ratio.min() < 1.1
    (larger,) = (one for one in changes if one.quantity == Quantity("gyro_x", "second_order_gauss_markov.sd"))
    assert isinstance(larger, Enlargement)
    assert larger.factor == pytest.approx(state.sd / 2e-3)
    assert "bounds its spectrum" in noise.handling["second_order_gauss_markov"]


def test_a_term_of_another_package_without_a_size_or_a_bound_is_left_out_with_the_reason() -> None:
    with TERMS.added(SecondOrderGaussMarkov):
        half = term(
            "second_order_gauss_markov", sd=known(2e-3), time_constant=Coefficient(None, None, None, "s")
        )
        noise, _ = channel_noise(
            channel(term("white", density=known(1e-4)), half), rule="ladder", horizon=1e3, constant_sd=1e-3
        )
    assert noise.markov == ()
    assert "left out of the filter: no value of time_constant" in noise.handling["second_order_gauss_markov"]
