"""The page of `tune`: complete in itself, well formed, the same bytes again; in a browser without an error."""

import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise

import pytest

from models.noise import NoiseModel, RandomWalk, White
from tuner.cli.commands.options import stated_command
from tuner.identification import identify
from tuner.report.allan_figure import allan_figure
from tuner.report.axis_figure import axis_figure, part_analysed
from tuner.report.figure_files import rendered
from tuner.report.html_page import write_page
from tuner.report.interactive_figure import charts_of_figure
from tuner.report.page_parts import PICTURE_BYTES, Picture
from tuner.simulation.static import simulate
from tuner.synthesis import synthesize
from tuner.tune_result import TuneResult
from tuner.types import Coefficient, Diagnosis, Finding

AXES = ("gyro_x", "gyro_y")
MODEL = NoiseModel([White(1e-4), RandomWalk(1e-6)])
LARGEST_PAGE = 6_000_000
SVG = b'<svg xmlns="http://www.w3.org/2000/svg"><path d="M 0.123456 1"/><text>0.123456</text></svg>'
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
VOID = {"meta", "img", "input", "link", "br", "hr"}


def test_the_course_of_stamps_since_1970_counts_from_its_begin():
    records, _ = simulate({"gyro_x": MODEL}, duration=300.0, rate=50.0, seed=5)
    begin = 1.7e9 + 0.25
    when = {
        name: Coefficient.known(value, value, value, "s")
        for name, value in (("time", begin + 150.0), ("duration", 2.0))
    }
    step = Finding("step", ("gyro_x",), "a", 9.0, 1e-9, when, "step in gyro_x")
    late = course(replace(records[0], t=records[0].t + begin), [step])
    early = course(records[0], [])
    assert late["traces"][0]["x"] == early["traces"][0]["x"]
    assert max(late["traces"][0]["x"]) > 299.0
    assert (late["x"], early["x"]) == ("time since 1700000000.25 s, s", "time, s")
    (event,) = [one for one in late["traces"] if one["name"] == "step"]
    assert event["x"] == [150.0]
    assert [(one["x0"], one["x1"]) for one in late["shapes"] if one["type"] == "rect"] == [(150.0, 152.0)]


def course(record, findings):
    return charts_of_figure(axis_figure(record, findings=findings))[1]


def made(pictures=1, size=0):
    models = dict.fromkeys(AXES, MODEL)
    records, _ = simulate(models, duration=300.0, rate=50.0, seed=5)
    noise = identify(records, arma=None)
    warned = replace(noise.channels["gyro_x"], warnings=("clusters differ",))
    noise = replace(noise, channels={**noise.channels, "gyro_x": warned})
    when = {"time": Coefficient.known(150.0, 149.0, 151.0, "s")}
    words = "step in gyro_x <script>alert(1)</script>"
    step = Finding("step", ("gyro_x",), "a", 9.0, 1e-9, when, words, drift={"60 s": (31.0, 12.0)})
    found = Diagnosis((step, replace(step, cause="ramp")), base=models, models=models)
    files = {"noise.yaml": "a: <&>\n", "kalibr.yaml": "b: 1\n"}
    config = synthesize(noise, name="a log <&>")
    absent = {"consistency": "why not"}
    result = TuneResult("a log <&>", records, noise, found, None, None, config, None, {}, absent, files)
    drawn = [Picture(step.text, f"finding-{k + 1}-step.svg", SVG + b" " * size) for k in range(pictures)]
    allan = Picture.of(rendered(allan_figure(noise), "allan"), "allan", "Allan deviation")
    return write_page(result, drawn, allan, "tuner tune 'a log'")


@pytest.fixture(scope="module")
def page():
    return made()


def test_the_spectrum_is_that_of_the_part_that_was_analysed():
    records, _ = simulate({"gyro_x": MODEL}, duration=100.0, rate=50.0, seed=5)
    part = part_analysed(records[0], (20.0, 50.0))
    ((start, stop),) = part.segments
    assert (records[0].t[start], stop - start) == (pytest.approx(20.0, abs=0.03), pytest.approx(1500, abs=1))
    assert part_analysed(records[0], None) is records[0]


def test_warnings_are_found_by_their_name_first_of_the_limits(page):
    limits = page[page.index('id="limits"') :]
    assert limits.index("<li>") == limits.index("<li>Warning: gyro x: clusters differ")


class Reader(HTMLParser):
    """Elements in order, with a check that they close in order, and their text."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.open, self.text = [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in {"script", "style"}:
            self.text.append(data)


@pytest.fixture(scope="module")
def read(page):
    return Reader(page)


def test_every_element_is_closed_in_order(read):
    assert read.open == []


def test_nothing_is_loaded_from_elsewhere(read):
    for tag, attributes in read.elements:
        assert tag not in {"link", "iframe", "object"}
        for name in ("src", "href", "srcset", "action"):
            assert not re.match(r"\s*(https?:|//)", attributes.get(name) or "")
    policies = [a["content"] for t, a in read.elements if a.get("http-equiv") == "Content-Security-Policy"]
    assert policies[0].startswith("default-src 'none'")


def test_headings_go_down_by_one(read):
    levels = [int(tag[1]) for tag, _ in read.elements if re.fullmatch("h[1-6]", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))


def test_what_refers_to_another_element_finds_it(read):
    identities = [a["id"] for _, a in read.elements if "id" in a]
    assert len(identities) == len(set(identities))
    for _, attributes in read.elements:
        for name in ("aria-labelledby", "aria-controls", "data-copy"):
            assert attributes.get(name) is None or attributes[name] in identities
        if (attributes.get("href") or "").startswith("#"):
            assert attributes["href"][1:] in identities


def test_tabs_pictures_and_regions_have_names(read):
    tabs = [a for _, a in read.elements if a.get("role") == "tab"]
    assert len(tabs) == sum(a.get("role") == "tabpanel" for _, a in read.elements) == 2
    assert all(a.get("alt") for t, a in read.elements if t == "img")
    regions = [a["aria-label"] for _, a in read.elements if a.get("role") == "region"]
    assert len(regions) == len(set(regions)) > 1
    document = dict(read.elements)
    assert document["html"]["lang"] == "en"


def test_the_page_says_what_matters_and_escapes_what_comes_from_a_file(page, read):
    text = " ".join(" ".join(read.text).split())
    for said in (
        "a log <&>",
        "a: <&>",
        "Verdict: usable",
        "no consistency: why not",
        "31 m",
        "12 m",
        "deg/√h",
    ):
        assert said in text
    assert "tuner tune 'a log'" in text
    assert "<script>alert" not in page


def test_the_same_result_gives_the_same_bytes(page):
    assert made() == page


def test_many_pictures_stand_beside_the_page(page):
    many = made(pictures=8, size=PICTURE_BYTES // 5)
    assert len(page.encode()) < len(many.encode()) < LARGEST_PAGE
    assert '<a href="finding-8-step.svg">' in many


def test_the_command_leaves_out_where_results_go():
    words = ["tune", "a log.npz", "-o", "x", "--json=y", "--seed", "3", "--quiet", "-oz"]
    assert stated_command(words) == "tuner tune 'a log.npz' --seed 3"
    assert stated_command(["tune", "caf\udce9\x1b[31m.npz"]) == "tuner tune 'caf\ufffd\ufffd[31m.npz'"


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
def test_a_browser_shows_it_without_an_error(page, tmp_path):
    data = "document.documentElement.dataset"
    width = f"{data}.over=document.documentElement.scrollWidth-window.innerWidth"
    drawn = f"{data}.drawn=document.querySelectorAll('.main-svg').length"
    later = f"document.addEventListener('drawn',function(){{{width};{drawn}}})"
    click = "document.querySelectorAll('[role=tab]')[1].click()"
    choose = "const d=document.getElementById('dialect');d.value='px4';d.dispatchEvent(new Event('change'))"
    file = tmp_path / "page.html"
    file.write_text(
        page.replace("</body>", f"<script>{click};{choose};{later}</script></body>"), encoding="utf-8"
    )
    done = subprocess.run(
        [
            CHROMIUM,
            *("--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--v=0"),
            *(
                f"--user-data-dir={tmp_path / 'profile'}",
                "--window-size=500,900",
                "--virtual-time-budget=4000",
                "--dump-dom",
            ),
            file.as_uri(),
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    assert "CONSOLE" not in done.stderr
    assert int(re.search('data-over="(-?[0-9]+)"', done.stdout)[1]) <= 0
    assert int(re.search('data-drawn="([0-9]+)"', done.stdout)[1]) >= 3
    ticks = re.findall(r'<g class="ytick"><text[^>]*>([^<]*)<', done.stdout)
    assert "0.5" in ticks, "the density is about 0.3 deg/√h: 0.5 must not be written 5"
    tabs = re.findall(r'role="tab"[^>]*aria-selected="(\w+)"', done.stdout)
    assert tabs == ["false", "true"]
    shown = re.search(r'<pre id="text-other"[^>]*>(.*?)</pre>', done.stdout, re.DOTALL)[1]
    assert "EKF2_GYR_NOISE" in shown
