"""The material of a chapter: its numbers are those of the identification, and LaTeX can read it."""

import csv
import json
import re

import numpy as np
import pytest

from models.noise import BiasInstability, NoiseModel, White
from tuner.cli import run
from tuner.formats.file_set import stale_files
from tuner.report.thesis import latex
from tuner.simulation.static import simulate


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A gyro with white noise and flicker, an accelerometer with white noise; its name has signs of LaTeX."""
    path = tmp_path_factory.mktemp("log") / "unit_7 & 8%.npz"
    gyro, accel = NoiseModel((White(1e-4), BiasInstability(2e-5))), NoiseModel((White(1e-3),))
    models = {f"{sensor}_{axis}": one for sensor, one in (("gyro", gyro), ("accel", accel)) for axis in "xyz"}
    records = simulate(models, duration=400.0, rate=50.0, seed=5)[0]
    np.savez(path, t=records[0].t, gyro=records[0].y, accel=records[1].y)
    return path


@pytest.fixture(scope="module")
def chapter(log):
    """Its folder."""
    folder = log.parent / "chapter"
    words = ["identify", str(log), "--gyro-unit", "rad/s", "--accel-unit", "m/s^2", "--thesis", str(folder)]
    assert run(words) == 0
    return folder


def rows(folder, name):
    with (folder / f"{name}.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_every_file_is_there_and_named_by_its_digest(chapter):
    tables = ["measured", "estimators", "levels", "curves", "orders"]
    tables += [f"{name}_{sensor}" for name in ("arma", "tests") for sensor in ("gyro", "accel")]
    wanted = {f"{name}.{suffix}" for name in tables for suffix in ("csv", "tex")} - {"curves.tex"}
    wanted |= {f"{name}.{suffix}" for name in ("allan", "correlograms") for suffix in ("pdf", "png")}
    assert {path.name for path in chapter.iterdir()} == wanted | {"chapter.tex", "identification.json"}
    assert stale_files(chapter / "identification.json") == []
    assert (chapter / "allan.pdf").read_bytes()[:4] == b"%PDF"


def test_latex_can_read_it(chapter):
    """Plain ASCII, so that no engine lacks a letter; groups and environments end; what is cited and put in is there."""
    text = (chapter / "chapter.tex").read_text(encoding="ascii")
    for name in re.findall(r"\\input\{(.*?)\}", text):
        text += (chapter / name).read_text(encoding="ascii")
    for name in re.findall(r"\\includegraphics\[.*?\]\{(.*?)\}", text):
        assert (chapter / name).exists()
    assert sorted(re.findall(r"\\begin\{(\w+)\}", text)) == sorted(re.findall(r"\\end\{(\w+)\}", text))
    bare = re.sub(r"\\[{}]", "", text)
    assert bare.count("{") == bare.count("}")
    assert re.sub(r"\\\$", "", text).count("$") % 2 == 0
    assert not re.search(r"(?<![\\$])_", re.sub(r"\\(input|label)\S*", "", text))
    cited = {key for keys in re.findall(r"\\cite\{(.*?)\}", text) for key in keys.split(",")}
    assert cited == set(re.findall(r"\\bibitem\{(.*?)\}", text))
    for table in re.findall(r"\\begin\{tabular\}\{(\w+)\}(.*?)\\end\{tabular\}", text, flags=re.DOTALL):
        for line in table[1].split(r"\\"):
            if "&" in line:
                assert len(re.findall(r"(?<!\\)&", line)) == len(table[0]) - 1


def test_numbers_are_those_of_the_identification(chapter):
    """N of the gyros in deg/√h and the order of every axis; the least BIC belongs to that order."""
    stored = json.loads((chapter / "identification.json").read_text())
    for row in rows(chapter, "estimators"):
        if row["coefficient"] == "N" and row["estimator"] == "likelihood" and row["axis"].startswith("gyro"):
            terms = stored["channels"][row["axis"]]["terms"]
            si = terms["white"]["density"]["value"]
            assert float(row["value"]) == pytest.approx(np.degrees(si) * 60.0, rel=1e-6)
            assert float(row["lower"]) < float(row["value"]) < float(row["upper"])
    assert {row["estimator"] for row in rows(chapter, "estimators")} == {
        "likelihood",
        "leastsquares",
        "slopes",
    }
    table = (chapter / "estimators.tex").read_text()
    for estimator, head in (("likelihood", 1), ("leastsquares", 2), ("slopes", 3)):
        (value,) = (
            float(row["value"])
            for row in rows(chapter, "estimators")
            if (row["axis"], row["coefficient"], row["estimator"]) == ("gyro_x", "N", estimator)
        )
        line = next(line for line in table.splitlines() if line.startswith(r"gyro\_x N"))
        assert float(line.split("&")[head].split("$")[0]) == pytest.approx(value, rel=2e-3)
    orders = rows(chapter, "orders")
    for axis, channel in stored["channels"].items():
        own = [row for row in orders if row["axis"] == axis]
        assert len(own) == 36
        best = min(own, key=lambda row: float(row["BIC"]))
        if not channel["arma"]["white"]:
            assert (int(best["p"]), int(best["q"])) == (channel["arma"]["p"], channel["arma"]["q"])
        assert float(best["BIC"]) - float(best["AIC"]) == pytest.approx(
            (np.log(channel["arma"]["samples"]) - 2.0) * (int(best["p"]) + int(best["q"]) + 1)
        )
    assert {"ADF", "KPSS", "Ljung–Box", "Jarque–Bera"} <= {
        row["test"].split(" ")[0] for row in rows(chapter, "tests_gyro")
    }


def test_curves_have_every_point(chapter):
    taus = [float(row["tau_s"]) for row in rows(chapter, "curves") if row["axis"] == "gyro_x"]
    assert taus == sorted(taus)
    assert len(taus) > 20


def test_what_has_no_samples_has_no_chapter(tmp_path, log, capsys):
    for words in (["adis16405"], [str(log), str(log)], [str(log), "--method", "slopes"]):
        units = ["--gyro-unit", "rad/s", "--accel-unit", "m/s^2"] if len(words[0]) > 10 else []
        assert run(["identify", *words, *units, "--thesis", str(tmp_path / "chapter")]) == 2
        said = capsys.readouterr().err
        assert (
            "--thesis: it chooses terms" in said
            if "slopes" in words
            else "--thesis: expected one log" in said
        )
        assert not (tmp_path / "chapter").exists()


def test_signs_of_latex():
    assert latex("5 % of x_1 & µg/√Hz ± 2") == r"5 \% of x\_1 \& $\mu$g/$\sqrt{\mathrm{Hz}}$ $\pm$ 2"


def test_a_text_of_the_user_is_kept(tmp_path, log, chapter, capsys):
    """A chapter that somebody wrote, or changed, was written over; a folder without a name was the current one."""
    words = ["identify", str(log), "--gyro-unit", "rad/s", "--accel-unit", "m/s^2", "--thesis"]
    own = tmp_path / "chapter.tex"
    own.write_text("mine")
    for folder, said in (
        (tmp_path, "expected no such file, or one as this command wrote it"),
        (own / "x", "expected a folder, found the file"),
        ("", "expected a folder, found an empty name"),
    ):
        assert run([*words, str(folder)]) == 2
        assert said in capsys.readouterr().err
    assert own.read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["chapter.tex"]
    assert run([*words, str(chapter)]) == 0
