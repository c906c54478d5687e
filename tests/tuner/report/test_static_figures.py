"""Figures and words of the findings of a static log: one figure for each cause."""

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.signal import lfilter

from models.effects import EFFECTS as SIGNALS
from models.effects import Samples
from models.noise import Arma, NoiseModel, RandomWalk, White
from tuner.diagnosis import diagnose
from tuner.diagnosis.static.causes.vibration import Vibration
from tuner.diagnosis.static.model.dct import inverse, transform
from tuner.formats.customary_units import digits_to
from tuner.identification import identify
from tuner.report.allan_figure import allan_figure
from tuner.report.diagnosed_axis import diagnosed_axis
from tuner.report.diagnosis_answer import diagnosis_answer
from tuner.report.figure_files import TIME_LABEL, Sketch, draw_all, figure_bytes, label_plainly, lay_out
from tuner.report.static_diagnosis_figures import finding_figures
from tuner.report.static_diagnosis_tables import finding_tables, hidden_effect_lines
from tuner.report.two_level_path import two_level_path
from tuner.report.unexplained_words import unexplained_lines
from tuner.simulation.static import simulate
from tuner.types import Coefficient, Diagnosis, Finding, Gain, Unexplained

MODEL = NoiseModel([White(1e-4), RandomWalk(1e-6)])
EFFECTS = {
    "line": {"frequency": 12.5, "amplitude": 2e-4},
    "vibration": {"frequency": 20.0, "quality": 20.0, "sd": 3e-4},
    "lowpass": {"cutoff": 25.0},
    "temperature": {"slope": 2e-5},
    "thermal_lag": {"slope": 5e-5, "time_constant": 60.0},
    "step": {"time": 150.0, "size": 3e-4},
    "warmup": {"amplitude": 6e-4, "time_constant": 50.0},
    "telegraph": {"size": 4e-4, "dwell_low": 5.0, "dwell_high": 5.0},
    "burst": {"start": 100.0, "duration": 40.0, "variance_ratio": 3.0},
    "variance_drift": {"slope": 2e-3},
    "spikes": {"rate": 0.05, "size": 0.02},
    "heavy_tails": {"excess_kurtosis": 1.0},
    "clipping": {"low": -3e-3, "high": 3e-3},
    "duplicates": {"fraction": 0.05},
    "timing": {"gap_count": 2.0, "jitter_sd": 1e-4, "clock_ratio": 1.0},
    "cross_axis": {"correlation": 0.3},
    "motion": {"start": 100.0, "duration": 20.0},
}
"""Parameters of a finding of every view."""


def record(*hidden, seed=1):
    return simulate({"gyro_x": MODEL}, duration=300.0, rate=100.0, seed=seed, effects=hidden)[0]


def finding(cause, values):
    parameters = {name: Coefficient.known(v, 0.9 * v, 1.1 * v, "SI") for name, v in values.items()}
    return Finding(cause, ("gyro_x",), "a statistic", 10.0, 1e-12, parameters, f"{cause} in gyro_x: said so")


def draw_findings(records, found, replicas=0):
    """Return captions and SVG of the figures of a diagnosis, by their names."""
    sketches = finding_figures(records, found, replicas)
    files = draw_all([partial(one.files, (".svg",)) for one in sketches])
    return {one.name: (one.caption, files[f"{one.name}.svg"].decode()) for one in sketches}


@pytest.mark.parametrize("cause", EFFECTS)
def test_every_cause_has_a_picture(cause):
    found = Diagnosis((finding(cause, EFFECTS[cause]),), base={"gyro_x": MODEL}, models={"gyro_x": MODEL})
    ((name, (caption, svg)),) = draw_findings(record(), found, replicas=2).items()
    assert cause in caption
    assert cause in name
    assert "measured" in svg
    assert "gyro_x" in svg


def test_findings_of_one_cause_and_channels_share_a_picture():
    moves = tuple(finding("motion", {"start": s, "duration": 5.0}) for s in (20.0, 80.0, 150.0))
    found = Diagnosis(moves, base={"gyro_x": MODEL}, models={"gyro_x": MODEL})
    assert len(draw_findings(record(), found)) == 1


def test_what_is_unexplained_has_a_picture_for_each_part_of_the_samples():
    """Residuals over time and their law, their spectrum, the time course: two statistics of one part share one."""
    parts = (
        ("law", "distribution"),
        ("squares", "distribution"),
        ("shape", "fast spectrum"),
        ("course", "slow part"),
    )
    left = tuple(Unexplained(name, ("gyro_x",), 1e-9, 40.0, about=about) for name, about in parts)
    found = Diagnosis((), left, base={"gyro_x": MODEL}, models={"gyro_x": MODEL})
    captions, shown = zip(*draw_findings(record(), found).values(), strict=True)
    assert list(captions) == unexplained_lines(left)
    wanted = ("variance of the residuals", "spectrum of the residuals", "Allan deviation")
    assert all(words in svg for words, svg in zip(wanted, shown, strict=True))


def test_the_signal_of_a_line_is_the_line(tmp_path):
    with_line, without = record("line@gyro_x:frequency=12.5,amplitude=2e-4"), record()
    difference = with_line[0].y[:, 0] - without[0].y[:, 0]
    t, y = with_line[0].t, with_line[0].y[:, 0]
    made = SIGNALS["line"].drawn(EFFECTS["line"], Samples(t, y[:, None], with_line[0].interval))
    # Each quadrature errs by sd √(2/n) = 1e-3 √(2/30000) = 8e-6: six of them on 2e-4.
    assert np.max(np.abs(made - difference)) < 7e-5


def test_a_signal_of_another_cause_is_taken_out_of_the_view():
    step, slope = finding("step", EFFECTS["step"]), finding("temperature", EFFECTS["temperature"])
    found = Diagnosis((step, slope), base={"gyro_x": MODEL}, models={"gyro_x": MODEL})
    one = diagnosed_axis(record("step@gyro_x:time=150,size=3e-4"), "gyro_x", found)
    np.testing.assert_allclose(one.without_others("temperature") + one.signals["step"], one.y)
    np.testing.assert_allclose(one.signal, one.signals["step"] + one.signals["temperature"])


@pytest.mark.parametrize("parts", [{}, {"gyro_x": (130.0, 300.0)}])
def test_only_the_picture_of_motion_shows_the_motion(parts):
    log = record("motion@gyro_x:start=100,duration=20,sd=0.5")
    moved = finding("motion", {"start": 98.0, "duration": 24.0})
    known = {"gyro_x": MODEL}
    found = Diagnosis((moved,), base=known, models=known, parts=parts, left_out=((98.0, 122.0),))
    still, moving = (diagnosed_axis(log, "gyro_x", found, moving=moving) for moving in (False, True))
    # White noise of 1e-4 /√Hz at 100 Hz has sd 1e-3.
    assert np.std(still.y) < 2e-3 < 0.05 < np.std(moving.y)
    assert len(moving.y) > 29_000
    assert still.t[0] == pytest.approx(130.0 if parts else 0.0, abs=0.02)


def test_a_time_course_counts_from_the_begin_of_the_recording():
    """Also of the part of it that was analysed, with the stamp of its begin in the label."""
    begin = 1.7e9
    (log,) = record()
    log = replace(log, t=log.t + begin)
    step = finding("step", {"time": begin + 150.0, "size": 3e-4})
    parts = {"gyro_x": (begin + 130.0, begin + 300.0)}
    (sketch,) = finding_figures(
        [log], Diagnosis((step,), base={"gyro_x": MODEL}, models={"gyro_x": MODEL}, parts=parts)
    )
    _, course = json.loads(sketch.files((".json",))["finding-1-step.json"])
    assert course["x"] == "time since 1700000000 s, s"
    assert 130.0 <= min(course["traces"][0]["x"]) < 132.0 < 297.0 < max(course["traces"][0]["x"]) <= 300.0


def test_a_sketch_says_when_its_time_begins():
    def draw(panel):
        panel.plot([0.0, 1.0], [0.0, 1.0])
        panel.set_xlabel(TIME_LABEL)

    for origin, label in ((0.0, "time, s"), (1752003261.854, "time since 1752003261.854 s, s")):
        sketch = Sketch("a", "b", [draw], (1, 1), origin=origin)
        (chart,) = json.loads(sketch.files((".json",))["a.json"])
        assert chart["x"] == label


def test_what_was_hidden_is_judged_in_words():
    line = {"cause": "line", "channels": ["gyro_x"], "parameters": {"frequency": 12.5}}
    words = [
        hidden_effect_lines([{**line, "found": found, "named": named}])[0]
        for found, named in ((True, ["line"]), (False, ["vibration"]), (False, []))
    ]
    assert words[0].endswith("line in gyro x is hidden in it: found")
    assert words[1].endswith("detected, but named as vibration")
    assert words[2].endswith("not found")


def test_what_channels_do_not_share_is_reported_of_each():
    hidden = ("line@gyro_x:frequency=12.5,amplitude=3e-4", "line@gyro_y:frequency=12.5,amplitude=1e-4")
    records, _ = simulate(
        {"gyro_x": MODEL, "gyro_y": MODEL}, duration=300.0, rate=100.0, seed=3, effects=hidden
    )
    found = diagnose(records)
    (line,) = found.findings
    assert line.channels == ("gyro_x", "gyro_y")
    assert set(line.of_each("amplitude")) == {"gyro_x", "gyro_y"}
    assert not line.of_each("frequency")
    text, (cell,) = line.text, finding_tables(found.findings, "")[0].columns[2].cells
    assert text.count("in gyro_x") == 2
    assert text.count(" deg/h in gyro_y") == cell.count("deg/h in gyro_y") == 1
    assert cell.count("frequency") == 1


@pytest.mark.parametrize(
    ("cause", "nats", "split", "said"),
    [
        ("heavy_tails", -3.0, "60/40", 1),
        ("heavy_tails", 3.0, "60/40", 0),
        ("heavy_tails", -3.0, "in sample", 0),
        ("burst", -3.0, "60/40", 0),
    ],
)
def test_a_gain_below_nothing_is_not_left_without_a_word(cause, nats, split, said):
    one = replace(finding(cause, EFFECTS[cause]), gain=Gain(split, 0.0, nats / 1e4, nats))
    told = [line for line in diagnosis_answer(Diagnosis((one,))).whole if isinstance(line, str)]
    assert sum("not confirmed" in line for line in told) == said


def test_an_interval_far_narrower_than_its_value_is_not_shown_empty():
    sharp = replace(
        finding("line", EFFECTS["line"]),
        parameters={"frequency": Coefficient.known(20.0000004, 19.9999989, 20.0000019, "Hz")},
    )
    ((cell,),) = [list(finding_tables([sharp], "")[0].columns[2].cells)]
    assert cell == "frequency 20.000000 ± 1.5e-06 Hz"
    assert digits_to(1.465e-4, 9.1e-6) == "0.000147"


@pytest.mark.parametrize("suffix", [".svg", ".png"])
def test_the_same_figure_has_the_same_bytes(suffix):
    """No date, and names of its parts that do not change from one run to the next."""
    noise = identify(record(), arma=None)
    drawn = [figure_bytes(allan_figure(noise), suffix) for _ in range(2)]
    assert drawn[0] == drawn[1]
    assert b"<dc:date>" not in drawn[0]


def test_panels_are_laid_out_as_with_every_tick():
    figure, whole = Figure((11.0, 4.4), layout="constrained"), Figure((11.0, 4.4), layout="constrained")
    for each in (figure, whole):
        panels = each.subplots(1, 3)
        for panel, decades in zip(panels, (0.5, 1.5, 5.0), strict=True):
            panel.plot(np.geomspace(0.01, 50.0, 49), np.geomspace(1.0, 10.0**decades, 49))
            panel.set(xscale="log", yscale="log", xlabel="time, s", ylabel="a, b")
    lay_out(figure)
    whole.get_layout_engine().execute(whole)
    assert [p.get_position().bounds for p in figure.axes] == [p.get_position().bounds for p in whole.axes]
    assert figure.axes[2].xaxis.get_minorticklocs().size


def test_labels_of_decades_are_plain_text():
    figure = Figure()
    panel = figure.subplots()
    panel.set(xscale="log", yscale="log", xlim=(3e-4, 2e3), ylim=(2.0, 5.0))
    label_plainly(figure)
    assert [panel.xaxis.get_major_formatter()(10.0**k) for k in (-3, 0, 12)] == ["10⁻³", "10⁰", "10¹²"]
    minor = panel.yaxis.get_minor_formatter()
    minor.set_locs(panel.yaxis.get_minorticklocs())
    assert minor(3.0) == "3×10⁰"


def test_the_drawn_path_of_a_telegraph_is_the_one_that_was_put_in():
    """Levels two noise sds apart for 20 means each: a mean alone tells 84 %, the path nearly all."""
    rng = np.random.default_rng(4)
    state = np.cumsum(rng.random(600) < 1.0 / 20.0) % 2
    path = two_level_path(3.0 + 2.0 * state + rng.normal(0.0, 1.0, 600), 0.5, 2.0, (10.0, 10.0))
    levels = np.unique(path)
    assert levels[1] - levels[0] == pytest.approx(2.0)
    assert levels[0] == pytest.approx(3.0, abs=0.3)
    assert np.mean((path > levels.mean()) == (state == 1)) > 0.92


def test_a_resonance_hides_no_variance_that_swells():
    """White noise of depth 0.3 beside a narrow resonance of ten times its power: the swell shows once that is known."""
    rng, n, dt = np.random.default_rng(3), 30_000, 0.01
    t = dt * np.arange(n)
    pole = 0.995 * np.exp(2j * np.pi * 0.2)
    ar = (float(2.0 * pole.real), float(-(abs(pole) ** 2)))
    ring = lfilter([1.0], [1.0, -ar[0], -ar[1]], rng.normal(size=n))
    size = np.sqrt(10.0) / ring.std()
    y = size * ring + np.exp(0.15 * np.cos(2.0 * np.pi * t / 10.0)) * rng.normal(size=n)
    (log,) = record()
    log = replace(log, t=t, y=y[:, None], interval=dt)
    known = NoiseModel([White(np.sqrt(dt)), Arma(ar, (), size**2, dt)])
    swell = finding("periodic_variance", {"period": 10.0, "depth": 0.3})
    subject = diagnosed_axis([log], "gyro_x", Diagnosis((swell,), base={}, models={"gyro_x": known}))

    def depth(e):
        return 2.0 * np.mean(e * e * np.cos(2.0 * np.pi * t / 10.0)) / np.mean(e * e)

    f = np.arange(1.0, n) / (2.0 * n * dt)
    share = float(
        np.mean(dt / known.psd(f, interval=dt))
    )  # of the residuals that is the white noise; the rest rings
    assert depth(subject.left) == pytest.approx(
        0.297 * share, abs=0.058
    )  # 2 I₁(0.3)/I₀(0.3); 5 sd of 30 000 squares
    assert depth(subject.fitted.e) < 0.5 * depth(subject.left)


def test_residuals_in_a_picture_are_those_of_the_whole_spectrum():
    """Also beside a resonance that is narrower than the places between which the rest of the spectrum is linear."""
    (log,) = simulate({"gyro_x": MODEL}, duration=600.0, rate=100.0, seed=1)[0]
    ring = Vibration(20.0, 2000.0, 1e-3)
    model = NoiseModel([*MODEL.terms, *ring.terms(log.interval)])
    found = finding("vibration", {"frequency": 20.0, "quality": 2000.0, "sd": 1e-3})
    subject = diagnosed_axis([log], "gyro_x", Diagnosis((found,), base={}, models={"gyro_x": model}))
    a = transform(subject.y - subject.signal, log.interval)
    f = np.arange(1.0, len(a)) / (2.0 * len(a) * log.interval)
    exact = inverse(np.append(0.0, a[1:] / np.sqrt(model.psd(f, interval=log.interval))), 1.0)
    assert np.allclose(subject.left * np.std(exact), exact * np.std(subject.left), atol=1e-3 * np.std(exact))


def test_a_model_of_fewer_samples_is_in_no_picture_of_all():
    """Repeated samples were dropped before the colour was fitted; its picture ended in a traceback."""
    model = NoiseModel([Arma((0.5,), (), 1e-6, 0.037)])
    assert diagnosed_axis(record(), "gyro_x", Diagnosis((), base={}, models={"gyro_x": model})) is None
