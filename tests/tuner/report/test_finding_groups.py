"""Findings are grouped, ranked by the drift of position, and told once; nothing is lost on the way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.noise import NoiseModel, White
from tuner.diagnosis.static.causes.lowpass import LowPass
from tuner.diagnosis.static.position_drift import position_drift, with_drifts
from tuner.diagnosis.static.spectrum.filters import MEAN_CUTOFFS
from tuner.formats.parameter_words import parameter_words
from tuner.report.finding_groups import comb_spacing, finding_groups
from tuner.report.groups_in_words import certainty, findings_in_words, group_in_words
from tuner.report.unexplained_words import unexplained_lines
from tuner.simulation.static import simulate
from tuner.types import Alternative, Coefficient, Finding, Gain, Unexplained

HOUR = 3600.0


def finding(cause: str, *axes: str, drift: float = 1.1, gain: Gain | None = None, **values: float) -> Finding:
    parameters = {name: Coefficient.known(v, 0.9 * v, 1.1 * v, "SI") for name, v in values.items()}
    return Finding(
        cause,
        axes,
        "statistic",
        9.0,
        1e-9,
        parameters,
        f"{cause} said so",
        gain=gain,
        drift={"60 s": (drift, 1.0)},
    )


def test_findings_are_ranked_by_the_drift_that_they_cause():
    told = findings_in_words(
        [
            finding("heavy_tails", "gyro_x", drift=1.0),
            finding("lowpass", "gyro_x", drift=1.009),
            finding("step", "gyro_y", drift=2.0, time=100.0),
            finding("warmup", "accel_x", drift=5.0),
            finding("clipping", "accel_y", drift=1.0),
        ],
        None,
    )
    assert [line.split()[0] for line in told.felt] == ["Warmup", "Step"]
    assert set(told.idle) == {"lowpass in gyro x", "heavy tails in gyro x", "clipping in accel y"}
    assert (
        "without fixes one axis drifts 5.0 m in 60 s, 1.0 m without this; setting concerned: bias states"
        in told.felt[0]
    )


def test_a_finding_is_worth_the_white_noise_that_it_makes():
    """A burst of 3.47 times the variance in 192.55 s of an hour: √(1 + 2.47 × 0.0535) of the white noise without it."""
    burst = finding("burst", "gyro_y", drift=1.003, start=2652.0, duration=192.55, variance_ratio=3.47)
    quiet = finding("burst", "accel_x", drift=1.0, start=5.0, duration=1800.0, variance_ratio=0.5)
    line = finding(
        "line",
        "gyro_x",
        drift=1.0,
        gain=Gain("60/40", 0.0, 1.0, 9.0, user={"white_density [rad]": (3.0, 2.0)}),
    )
    groups = {group.findings[0].channels[0]: group for group in finding_groups([burst, quiet, line], HOUR)}
    assert groups["gyro_y"].white == pytest.approx(1.064, abs=1e-3)
    assert groups["accel_x"].white == pytest.approx(0.75**0.5)
    assert groups["gyro_x"].worth == pytest.approx(np.log(1.5))
    elsewhere = replace(line, gain=Gain("60/40", 0.0, 1.0, 9.0, user={"white_density [rad]": (0.01, 2.0)}))
    assert finding_groups([elsewhere])[0].worth == 0.0  # one of the sums has its white noise in another term
    assert list(groups) == ["gyro_x", "accel_x", "gyro_y"]
    said = group_in_words(groups["gyro_y"])
    assert said.startswith("Burst in gyro y: ")
    assert ": white noise 1.06 × that without this; no drift at rest" in said


def test_a_filter_that_takes_motion_away_comes_first():
    """A log at rest does not show what it costs; filters of all sensors call for one action."""
    lost = LowPass(0.0, "pole1", 0.22).in_motion(0.1)
    # One pole delays slow motion by its time constant, 1/(2π 0.22 Hz) = 0.72 s.
    assert lost == "motion faster than 0.22 Hz is lost, delay at least 0.7 s: record it unfiltered"
    slow = [
        replace(finding("lowpass", axis, drift=1.0, cutoff=0.22), extension={"in_motion": lost})
        for axis in ("gyro_x", "accel_z")
    ]
    told = findings_in_words([finding("telegraph", "gyro_y", drift=2.5), *slow], None).felt
    assert told[0].startswith("Lowpass in gyro x, accel z: motion faster than 0.22 Hz is lost")
    assert "no drift at rest" in told[0]
    assert told[1].startswith("Telegraph in gyro y")


@pytest.mark.parametrize(
    ("kind", "cutoff", "interval"),
    [("pole1", 12.0, 0.01), ("pole1", 0.22, 1.0), ("mean1", 0.443, 1.0)],
    ids=["above motion", "near the rate", "mean over one interval"],
)
def test_a_filter_faster_than_motion_or_as_slow_as_the_sampling_loses_nothing(kind, cutoff, interval):
    assert not LowPass(0.0, kind, cutoff).in_motion(interval)


@pytest.mark.parametrize(("kind", "width"), [("mean1", 1), ("pole2", 0)])
def test_the_delay_is_that_of_the_filter_at_frequency_zero(kind, width):
    """Moving means delay by half their length, poles of a Butterworth filter by √2/(2π cutoff) for two."""
    interval, cutoff = 1e-2, 0.5
    length = width * MEAN_CUTOFFS[width] / cutoff if width else 0.0
    expected = length / 2.0 if width else np.sqrt(2.0) / (2.0 * np.pi * cutoff)
    # Between samples of the filter: one interval.
    assert LowPass(0.0, kind, cutoff).delay(interval) == pytest.approx(expected, abs=1.5 * interval)


def test_events_are_counted_with_their_share_of_the_time():
    events = [
        finding("burst", "gyro_x", start=100.0 * k, duration=7.2, variance_ratio=3.0) for k in range(14)
    ]
    (line,) = findings_in_words(events, HOUR).felt
    assert "14 events, 2.8 % of the time" in line  # 14 · 7.2 s of 3600 s
    twice = [*events, *(finding("burst", "gyro_y", start=100.0 * k, duration=7.2) for k in range(14))]
    assert "2.8 % of the time" in findings_in_words(twice, HOUR).felt[0]


def test_one_event_in_several_axes_is_told_once():
    step = finding("step", "gyro_x", time=500.0)
    (line,) = findings_in_words([step, finding("burst", "accel_y", start=501.0, duration=30.0)], None).felt
    assert line.startswith("Step and burst in gyro x, accel y: one event at 500")
    assert len(finding_groups([step, finding("burst", "accel_y", start=900.0, duration=30.0)])) == 2


def of_axes(cause: str, name: str, shown: str, **values: Coefficient) -> Finding:
    by_channel = {axis: {name: value} for axis, value in values.items()}
    return replace(finding(cause, *values), parameters=by_channel[shown], by_channel=by_channel)


def test_one_axis_lends_its_number_to_no_other():
    """A slope of y was told of x y z, where x and z have the other sign; an sd in deg/s was told of accelerometers."""
    slope = {
        axis: Coefficient.known(value, value - 1e-4, value + 1e-4, "m/s^2/K")
        for axis, value in {"accel_x": 0.0061, "accel_y": -0.0227, "accel_z": 0.0274}.items()
    }
    (group,) = finding_groups([of_axes("temperature", "slope", "accel_y", **slope)])
    assert group.figures == " (slope -2.31 to +2.79 mg/K)"
    sway = {"gyro_x": Coefficient.known(0.01, 0.009, 0.011, "rad/s")}
    sway |= {"accel_x": Coefficient.known(0.2, 0.1, 0.3, "m/s^2")}
    (group,) = finding_groups([of_axes("motion", "sd", "accel_x", **sway)])
    assert group.figures == " (sd 0.573 deg/s and 20.4 mg)"
    (group,) = finding_groups([finding("step", "gyro_x", time=9.0), finding("step", "gyro_y", time=20.0)])
    assert group.title == "step in gyro x y: 2 events"
    assert group.figures == " (time 9.00 to 20.0 SI)"


def test_axes_share_an_event_only_where_its_times_and_lengths_agree():
    """A step of axis x came 663 s after the events of axis z; both were reported as one event, at the time of z."""
    early, late = finding("step", "gyro_z", time=1000.0), finding("step", "gyro_x", time=1663.0)
    titles = [one.title for one in finding_groups([early, finding("recovery", "gyro_z", time=999.0), late])]
    assert titles == ["step and recovery in gyro z: one event at 999 s", "step in gyro x"]
    unlike = replace(early, parameters={"time": Coefficient.known(1000.0, 999.0, 1001.0, "s")})
    exact = replace(late, parameters={"time": Coefficient.known(1003.0, 1002.9, 1003.1, "s")})
    assert len(finding_groups([unlike, replace(exact, cause="recovery")])) == 2
    (bursts,) = finding_groups(
        [
            finding("burst", "accel_y", start=7.0, duration=2145.0),
            finding("burst", "accel_z", start=7.0, duration=0.8),
        ]
    )
    assert bursts.title == "burst in accel y z: 2 events"


def test_lines_of_one_spacing_are_a_comb():
    lines = [finding("line", "gyro_x", frequency=3.0 + 9.93 * k, amplitude=1e-4) for k in range(385)]
    (told,) = findings_in_words(lines, None).felt
    assert "comb of 385 lines, 9.93 Hz apart" in told
    assert comb_spacing(sorted(np.random.default_rng(1).uniform(0.0, 50.0, 20))) is None


def test_what_held_out_data_contradict_is_doubted():
    harm = finding("heavy_tails", "gyro_x", drift=3.0, gain=Gain("60/40", 0.0, -0.1, -500.0))
    told = findings_in_words([harm, finding("lowpass", "gyro_y", cutoff=12.0)], None)
    assert [line.split()[0] for line in told.felt] == ["Lowpass"]
    assert told.doubted == "Found, but not confirmed by held-out data: heavy tails in gyro x"


def test_a_group_is_no_surer_than_its_findings():
    """ "98 % likely" was told of four frequencies, two of which could as well be another cause."""
    better = Gain("60/40", 0.0, 0.1, 500.0)
    sure = finding("lowpass", "gyro_x", "gyro_y", gain=better)
    open_ = replace(finding("lowpass", "accel_x", gain=better), alternatives=(Alternative("unknown", 1.0),))
    assert certainty([sure, sure]) == "certain"
    assert certainty([sure, open_]) == "50 % likely in accel x, else another cause; certain in gyro x y"
    likely = replace(sure, alternatives=(Alternative("line", 0.02),))
    again = replace(open_, channels=("gyro_x",))
    assert certainty([likely, again]) == "at least 50 % likely, else another cause"
    assert certainty([sure, replace(sure, gain=None)]) == ""


def test_events_that_predict_worse_are_not_certain():
    """Six bursts stood under "predicts WORSE" in the table, and in no line of what is not confirmed."""
    worse = finding("burst", "gyro_z", start=5.0, duration=3.0, gain=Gain("60/40", 0.0, -0.1, -5.4))
    other = replace(finding("burst", "gyro_z", start=90.0, gain=Gain("in sample", 0.0, 0.1, 30.0)))
    assert certainty([worse]) == "not confirmed by held-out data"
    assert certainty([worse, other, other]) == "certain; 1 of 3 not confirmed by held-out data"
    (line,) = findings_in_words([worse], None).felt
    assert line.startswith("Burst in gyro z: not confirmed by held-out data; ")


@pytest.mark.parametrize("unit", ["rad/s", "m/s^2"])
def test_drift_of_a_short_outage_is_that_of_a_bias_on_a_flat_earth(unit: str):
    """h²/2 of an acceleration, g h³/6 of a rate: to (ωh)²/20 of a Schuler period."""
    per_bias = 60.0**2 / 2.0 if unit == "m/s^2" else 9.80665 * 60.0**3 / 6.0
    assert position_drift(unit, 1.0, 60.0) == pytest.approx(np.sqrt(2.0) * per_bias, rel=1e-3)


def test_a_single_finding_has_its_figures():
    rate = Coefficient.known(2e-4, 1.8e-4, 2.2e-4, "rad/s")
    one = replace(finding("line", "gyro_x"), parameters={"amplitude": rate})
    (line,) = findings_in_words([one], None).felt
    assert line.endswith("(amplitude 41.3 ± 4.1 deg/h)")  # 2e-4 rad/s · 3600 · 180/π


def test_a_step_that_was_found_is_worth_the_drift_it_causes():
    """Without the step the Allan deviation at 60 s is that of white noise, N/√60."""
    step, density = 3e-4, 1e-4
    model = NoiseModel((White(density),))
    records, _ = simulate(
        {"gyro_x": model}, duration=1200.0, rate=20.0, seed=4, effects=[f"step@gyro_x:time=600,size={step}"]
    )
    (found,) = with_drifts([finding("step", "gyro_x", time=600.0, size=step)], records)
    with_it, without = found.drift["60 s"]
    assert without == pytest.approx(position_drift("rad/s", density / np.sqrt(60.0), 60.0), rel=0.4)
    # One step of size d adds d² · τ/(3(T − 2τ)) to the overlapping Allan variance.
    added = step**2 * 60.0 / (3.0 * (1200.0 - 120.0))
    assert (with_it**2 - without**2) == pytest.approx(
        position_drift("rad/s", np.sqrt(added), 60.0) ** 2, rel=0.5
    )
    assert "1000 s" not in found.drift


def test_what_is_unexplained_is_one_line_a_statistic_with_its_place_and_what_it_does():
    """The largest axis says where; the axis that drifts most beyond its model, how much."""
    left = [
        Unexplained("shape", ("gyro_x",), 1e-9, 40.0, "at 5 Hz", {"60 s": (1.001, 1.0)}),
        Unexplained("shape", ("gyro_y",), 1e-9, 90.0, "at 7 Hz", {"60 s": (3.0, 2.0), "1000 s": (1.0, 1.0)}),
        Unexplained("levels", ("accel_z",), 1e-9, 400.0, "at 100 s", {"60 s": (1.0, 1.0)}),
    ]
    assert unexplained_lines(left) == [
        "levels in accel z, at 100 s; no more drift than by the model",
        "shape in gyro x y, most in gyro y, at 7 Hz; "
        "position drifts 50 % more after 60 s than by the model in gyro y",
    ]


def test_many_statistics_are_one_line_for_each_part_of_the_samples():
    """The largest of each part; what an axis drifts is said once."""
    drift = {"60 s": (1.5, 1.0)}

    def left(statistic: str, axis: str, nats: float, about: str) -> Unexplained:
        return Unexplained(statistic, (axis,), 1e-9, nats, "", drift, about)

    assert unexplained_lines(
        [
            left("law", "gyro_x", 50.0, "distribution"),
            left("squares", "gyro_x", 70.0, "distribution"),
            left("squares", "gyro_y", 20.0, "distribution"),
            left("means", "gyro_y", 10.0, "distribution"),
            left("shape", "gyro_x", 40.0, "fast spectrum"),
        ]
    ) == [
        "squares in gyro x y, most in gyro x; 2 more statistics of the distribution and the variance "
        "of the noise; position drifts 50 % more after 60 s than by the model in gyro x",
        "shape in gyro x",
    ]


def test_parameters_are_named_in_words():
    """Classes of fixes were position_vertical_class_0: nobody can know which fixes those are."""
    one = Coefficient(1.0, None, None, "1")
    by_solution = {"position_vertical_class_0": one, "position_solution_0": replace(one, value=4.0)}
    assert parameter_words(by_solution) == {
        "position_vertical_class_0": "position vertical of RTK fixed fixes"
    }
    names = ["velocity_horizontal_class_0", "velocity_horizontal_class_1", "time_constant"]
    by_sd = dict.fromkeys(names, one) | {"velocity_edge_1": replace(one, value=0.2)}
    assert list(parameter_words(by_sd).values()) == [
        "velocity horizontal of fixes reported below 0.200 m/s",
        "velocity horizontal of fixes reported to 0.200 m/s and more",
        "time constant",
    ]


def test_rivals_too_weak_to_be_named_end_no_sentence():
    """Two with 0.3 % each: "99 % likely, else " was printed."""
    weak = tuple(Alternative(name, 0.004) for name in ("warmup", "step"))
    one = replace(finding("temperature", "accel_x"), alternatives=weak)
    assert certainty([one]) == "99 % likely"
    clear = replace(one, alternatives=(Alternative("warmup", 0.25),))
    assert certainty([clear]) == "80 % likely, else warmup"
