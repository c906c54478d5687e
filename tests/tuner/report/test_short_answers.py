"""Answers of few lines: what a score says of the filter, what a minimum of a curve is not, which sensor has no rank."""

from types import SimpleNamespace

import pytest

from models.noise import NoiseModel, White
from tuner import compare
from tuner.curves import empirical
from tuner.identification.comparison import ComparedCoefficient, Comparison
from tuner.report.answer_layout import recording_text
from tuner.report.consistency_answer import consistency_answer
from tuner.report.curve_tables import curve_answer
from tuner.report.sensor_answers import _differences, comparison_answer
from tuner.report.terminal import fitted
from tuner.simulation.static import simulate
from tuner.types.consistency import Consistency, Outage, RmsError, Score


def score(name, ratio, freedom):
    return Score(name, freedom * ratio**2, int(freedom), freedom, (0.9 * freedom, 1.1 * freedom))


def rows_of(answer):
    return {line.split("  ")[0]: line.split("  ")[-1].strip() for line in fitted(answer)}


@pytest.mark.parametrize(
    ("ratio", "freedom", "said"),
    [(1.12, 1e4, "honest"), (1.9, 1e4, "optimistic"), (0.5, 1e4, "pessimistic"), (1.35, 2.0, "undecided")],
)
def test_each_row_that_decides_says_what_it_says_of_the_filter(ratio, freedom, said):
    """A row without a star, whose interval excludes 1, was read as a contradiction of the verdict."""
    position, bias = score("position", ratio, freedom), score("gyro_bias", 1.2, 1e4)
    outage = Outage(60.0, 1.0, 1.0, score("outage 60 s", ratio, freedom), 10, (0.5, 2.0))
    found = Consistency(None, (position, bias), (), None, (outage,), {}, 0.0, False, ())
    rows = rows_of(consistency_answer(found))
    assert rows["position, 3-D"] == rows["position after 60 s without fixes"] == said
    assert rows["gyro bias"].endswith(")")  # a bias decides nothing
    undecided = "undecided: too little data; " * (said == "undecided")
    legend = f"honest: 0.67 to 1.5, or explained by chance; {undecided}blank: not judged"
    assert legend in " ".join(line.strip() for line in fitted(consistency_answer(found)))


def test_a_legend_says_what_the_table_has_and_no_more():
    """It told the band of an attitude, and what a blank is, beneath tables without either."""
    attitude = score("attitude", 1.0, 1e4)
    found = Consistency(None, (attitude,), (), None, (), {}, 0.0, False, ())
    legend = "honest: 0.67 to 1.5 (attitude 0.5 to 2), or explained by chance"
    assert legend in rows_of(consistency_answer(found))


def test_without_a_truth_the_distances_to_the_smoother_decide_nothing():
    position, whole = score("position", 1.9, 1e4), score("nis_velocity", 1.9, 1e4)
    distances = {"nis_velocity": RmsError((0.1,), "m/s")}
    found = Consistency(None, (position,), (whole,), None, (), distances, 0.0, False, ())
    rows = rows_of(consistency_answer(found))
    assert rows["position, 3-D, to the smoother"].endswith(")")
    assert rows["velocity innovations (root of NIS)"] == "optimistic"


def test_a_minimum_of_a_curve_is_not_called_bias_instability():
    """ "Least: x 9.13 at 144 s" was read as B."""
    records, _ = simulate({"gyro_x": NoiseModel([White(1e-4)])}, duration=60.0, rate=50.0, seed=1)
    lines = fitted(curve_answer([empirical(records[0], "oadev")], ["oadev of a log"]))
    (minimum,) = (line for line in lines if line.startswith("Minimum, deg/h: x "))
    assert lines[lines.index(minimum) + 1].startswith("A minimum is not bias instability B")
    correlation = fitted(curve_answer([empirical(records[0], "acf")], ["acf of a log"]))
    assert not any("inimum" in line for line in correlation)


def test_a_sensor_of_which_a_term_is_unknown_has_no_rank():
    """ "icm20602 ≥ 35 m, mpu9250 51 m" was read as: the first is better."""
    text = " ".join(" ".join(fitted(comparison_answer(compare("mpu9250", "icm20602")))).split())
    assert (
        "errs by: mpu9250 51 m; icm20602 35 m or more (no rank: its bias random walk is not stated)" in text
    )
    assert text.index("mpu9250 1.6") < text.index("icm20602 ≥ 1.5")
    assert "≥: at least" in text


def test_a_ratio_without_an_interval_is_not_said_to_be_none():
    """Of white noise 184 × as large, written without an interval, "no term differs at 95 %" was said."""
    rows = {"gyro_x": (("white.density", 184.0, None), ("bias_instability.level", 1.02, False))}
    compared = {
        axis: tuple(ComparedCoefficient(name, (), ratio, None, differs) for name, ratio, differs in each)
        for axis, each in rows.items()
    }
    said = _differences(SimpleNamespace(noise=Comparison(("rest", "motion"), {}, compared)))
    assert said.startswith("motion ÷ rest differs in no term at 95 %; without an interval: ")
    assert "white noise of gyro x 184 ×" in said


def test_bias_terms_of_a_sheet_are_no_method_of_a_recording():
    """ "136 s at 100 Hz, by datasheet": nobody knew what is by datasheet."""
    channel = SimpleNamespace(axis="gyro_x", span=136.0, interval=0.01, method="datasheet")
    found = SimpleNamespace(channels={"gyro_x": channel}, source={})
    assert recording_text(found) == "136 s at 100 Hz"
    channel.method = "slopes"
    assert recording_text(found) == "136 s at 100 Hz, by slopes"
