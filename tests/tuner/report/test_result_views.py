"""Results in a notebook: frames hold the numbers of the result, datasets its axes, figures and tables are made."""

from __future__ import annotations

import copy
import pickle
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import tuner
from tuner.consistency.choose_grade import GradeChoice, RankedGrade
from tuner.consistency.compare_sensors import SensorComparison
from tuner.identification.comparison import compare_identifications
from tuner.readers.logs_in_memory import arrays_of_frame
from tuner.report.figure_files import figure_bytes
from tuner.report.html_page import write_sections_page
from tuner.report.interactive_figure import charts_of_figure
from tuner.report.result_views import VIEWS, page_of
from tuner.synthesis.load_config import load_config
from tuner.types import Diagnosis, Finding
from tuner.types.consistency import Consistency, Score
from tuner.types.records import DataError
from tuner.types.shown import Shown
from tuner.types.verdict import Severity, Verdict, VerdictCode

RATE, COUNT = 50.0, 4000


@pytest.fixture(scope="module")
def frame():
    samples = np.random.default_rng(5).normal(0.0, 0.1, (COUNT, 1))
    index = pd.date_range("2026-01-01", periods=COUNT, freq="20ms")
    return pd.DataFrame(samples, columns=["gyro_x [deg/s]"], index=index)


@pytest.fixture(scope="module")
def noise(frame):
    return tuner.identify(frame, arma=None)


def test_a_frame_is_read_in_its_units_on_its_clock(frame, noise):
    # White noise of sd s at rate f has N = s/√f; 95 % of 1/√(2n) and five times that.
    density = np.radians(0.1) / np.sqrt(RATE)
    for channel in noise.channels.values():
        assert channel.interval == pytest.approx(1.0 / RATE)
        assert channel.model.white_density() == pytest.approx(density, rel=5.0 / np.sqrt(2.0 * COUNT))
    (record,) = tuner.read({"gyro_x": frame["gyro_x [deg/s]"].to_numpy()}, rate=RATE, gyro_unit="deg/s")
    np.testing.assert_allclose(record.y, tuner.read(frame)[0].y)
    named = frame.reset_index(drop=True)
    named.index = pd.Index(np.arange(COUNT) / RATE, name="t")
    assert "t" in arrays_of_frame(named)
    assert tuner.read(named)[0].interval == pytest.approx(1.0 / RATE)


def test_results_can_be_pickled_and_copied(frame, noise):
    for one in (tuner.read(frame), noise, tuner.synthesize(noise), tuner.plan(noise)):
        for again in (pickle.loads(pickle.dumps(one)), copy.deepcopy(one)):
            assert repr(again) == repr(one)


def test_what_a_table_cannot_be_is_refused(frame):
    with pytest.raises(DataError, match="expected numbers"):
        tuner.read({"gyro_x": frame["gyro_x [deg/s]"].to_numpy(), "name": np.array(["a"] * COUNT)}, rate=RATE)
    with pytest.raises(DataError, match="rate=HZ"):
        tuner.read({"gyro_x": frame["gyro_x [deg/s]"].to_numpy()}, gyro_unit="deg/s")


def test_a_data_frame_and_a_dataset_hold_the_numbers(noise):
    table = noise.to_pandas().set_index(["axis", "coefficient"])
    white = noise.channels["gyro_x"].term("white").coefficients["density"]
    assert tuple(table.loc[("gyro_x", "white.density"), ["value", "low", "high"]]) == (
        white.value,
        *white.interval,
    )
    assert noise.plot()._repr_png_().startswith(b"\x89PNG")
    data = noise.to_xarray()
    assert float(data["value"].sel(axis="gyro_x", coefficient="white.density")) == white.value
    curve = noise.channels["gyro_x"].allan
    assert curve.to_xarray()["deviation"].sel(axis="gyro_x").values == pytest.approx(curve.deviation()[:, 0])


SCORES = (Score("nees", 20.0, 15, 300.0, (13.0, 17.0)), Score("outage 60 s", 2.0, 2, 40.0, (1.0, 3.0)))


def shown(kind, noise, frame):
    config = load_config("icm20602", gnss="rtk")
    record = tuner.read(frame)[0]
    grade = RankedGrade("icm20602", config, 4.0)
    made = {
        "Identification": lambda: noise,
        "FilterConfig": lambda: config,
        "AllanCurve": lambda: tuner.curve(record, "adev"),
        "Spectrum": lambda: tuner.curve(record, "psd"),
        "Correlogram": lambda: tuner.curve(record, "acf"),
        "Diagnosis": lambda: Diagnosis((STEP,)),
        "Consistency": lambda: Consistency(SCORES[0], (), (), None, (), {}, 0.0, diverged=False),
        "SensorComparison": lambda: SensorComparison(
            compare_identifications(["one", "other"], [noise, noise]), (), "rtk", (None, None)
        ),
        "GradeChoice": lambda: GradeChoice(60.0, 5.0, "rtk", False, (grade,), grade, 1.3),
        "StaticTestPlan": lambda: tuner.plan(noise),
    }
    return made[kind]()


STEP = Finding("step", ("gyro_x",), "a test", 9.0, 1e-9, {}, "step in gyro_x", drift={"60 s": (31.0, 12.0)})
KINDS = (
    "Identification FilterConfig AllanCurve Spectrum Correlogram Diagnosis Consistency SensorComparison GradeChoice "
    "StaticTestPlan"
)


@pytest.mark.parametrize("kind", KINDS.split())
def test_each_result_has_tables_numbers_and_a_figure(kind, noise, frame):
    result = shown(kind, noise, frame)
    assert isinstance(result.to_pandas(), pd.DataFrame)
    assert result._repr_html_().lstrip().startswith("<")
    answer = repr(result).split("\n")
    assert 2 <= len(answer) <= 25, "print shows what the command does, not every array"
    assert all(len(line) <= 80 for line in answer), answer
    assert "--verbose" not in repr(result)
    page = page_of({"Part": result}, "A title", "tuner something")
    assert '<html lang="en">' in page
    assert "tuner something" in page
    assert not re.search(r'(src|href)="http', page.partition("<script")[0])
    assert "default-src 'none'" in page
    assert "data-chart=" in page, "nothing to read values off"
    assert len(page.encode()) < 6_000_000


def test_a_comparison_repeats_what_limits_the_terms_of_a_source(noise):
    warned = {a: replace(one, warnings=("too few clusters (3)",)) for a, one in noise.channels.items()}
    both = compare_identifications(["one", "other"], [replace(noise, channels=warned), noise])
    said = repr(SensorComparison(both, (), "rtk", (None, None))).split("\n")
    assert [line for line in said if "too few" in line] == ["one: Warning: gyro x: too few clusters (3)"]


def test_every_result_that_shows_itself_has_a_view():
    assert set(Shown.__subclasses__()) <= set(VIEWS)


def test_errors_without_a_unit_are_named_without_an_underscore():
    score = tuner.score([[1.0, 2.0]] * 30, [[1.0, 1.0]] * 30, names=["heading", "speed"])
    rows = [line.split()[:2] for line in repr(score).splitlines()]
    assert ["heading", "1.00"] in rows
    assert ["speed", "2.00"] in rows


def test_the_verdict_stands_first_on_a_page():
    good = Consistency(replace(SCORES[0], mean=15.0), (), (), None, (), {}, 0.0, diverged=False)
    bad = replace(good, diverged=True, verdicts=(Verdict(VerdictCode.NOT_FINITE, Severity.DIVERGED),))
    for found, words in ((good, "Verdict: honest: "), (bad, "Verdict: do not use: the filter diverged")):
        page = write_sections_page("A title", [], "", found.honesty)
        assert words in page.partition("</header>")[0]


def test_a_chart_has_the_numbers_the_names_and_the_spans_of_its_figure():
    figure = Figure()
    panel = figure.subplots()
    panel.plot([1.0, 10.0], [2.0, np.nan], "--", color="#1f5fa8", label="measured")
    panel.fill_between([1.0, 2.0], [0.0, 0.0], [1.0, 1.0], color="#1f5fa8", alpha=0.2)
    panel.axvline(3.0, color="0.2", label="limit")
    panel.axhspan(-1.0, 1.0, color="0.85")
    panel.set_yticks([0, 1], ["one", "other"])
    panel.set(xscale="log", xlabel="t, s", xlim=(1.0, 100.0))
    (chart,) = charts_of_figure(figure)
    band, line, limit = chart["traces"]
    assert (line["x"], line["y"], line["line"]["dash"]) == ([1.0, 10.0], [2.0, None], "dash")
    assert line["line"]["color"] == "--measured"
    assert band["fill"] == "toself"
    assert limit["name"] == "limit"
    assert [shape["type"] for shape in chart["shapes"]] == ["rect", "line"]
    assert chart["names"]["y"] == {"at": [0.0, 1.0], "text": ["one", "other"]}
    assert chart["xrange"] == [0.0, 2.0]
    panel.imshow(np.zeros((2, 2)))
    assert charts_of_figure(figure) is None


def test_a_figure_drawn_again_has_the_same_bytes():
    def drawn() -> bytes:
        figure = Figure()
        figure.subplots().plot([1.0, 2.0], [2.0, 3.0], "o")
        return figure_bytes(figure, ".svg")

    assert drawn() == drawn()


def test_every_verb_returns_what_can_be_shown():
    assert {kind.__name__ for kind in VIEWS} >= {"TuneResult", "Check", "DriveResult", "OutputScore", "Fleet"}
    assert all(hasattr(kind, "plot") for kind in VIEWS)


def test_a_page_of_a_clean_log_has_no_empty_chart():
    assert "<figure" not in page_of({"Part": Diagnosis(())}, "A title", "tuner something")
