"""The command line from end to end: files, JSON schemas, exit status, one line for bad input."""

import json
import shlex
from dataclasses import replace

import pytest
import yaml

from models.effects import parse
from tuner import pipeline
from tuner.cli import COMMANDS, run, tuner
from tuner.cli.examples import EXAMPLES
from tuner.formats import noise_yaml
from tuner.formats.configuration import load_config
from tuner.formats.logs import write_log
from tuner.readers import read
from tuner.simulation.effect_spec import read_effect
from tuner.synthesis.prediction import hold_to_records
from tuner.types.prediction import BlockSource


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "unit.npz"
    assert run(["simulate", "mpu9250", "--hours", "0.2", "--seed", "3", "-o", str(path), "--quiet"]) == 0
    return path


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """Two minutes: enough for what does not depend on the length."""
    path = tmp_path_factory.mktemp("short") / "unit.npz"
    assert run(["simulate", "mpu9250", "--hours", "0.03", "--seed", "3", "-o", str(path), "--quiet"]) == 0
    return path


def first_axis(log, to):
    """Write one gyro of a log: what does not depend on the number of axes is tried on one."""
    gyro = read(log)[0]
    write_log([replace(gyro, y=gyro.y[:, :1], axes=gyro.axes[:1])], to)
    return to


@pytest.fixture(scope="module")
def axis(short, tmp_path_factory):
    return first_axis(short, tmp_path_factory.mktemp("axis") / "unit.npz")


@pytest.fixture(scope="module")
def short_check():
    """The closing check of `tune`, of two flights of five minutes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pipeline, "CHECK_RUNS", 2)
        patch.setattr(pipeline, "CHECK_DURATION", 300.0)
        yield


@pytest.fixture(scope="module")
def tuned(log, short_check, tmp_path_factory):
    directory = tmp_path_factory.mktemp("tuned")
    assert (
        run(
            [
                "tune",
                str(log),
                "-o",
                str(directory),
                "--gnss",
                "spp",
                "--datasheet",  # twelve minutes do not show every random walk
                "mpu9250",
                "--quiet",
                "--json",
                str(directory / "all.json"),
            ]
        )
        == 0
    )
    return directory


def said(capsys):
    captured = capsys.readouterr()
    return captured.out, captured.err


@pytest.mark.parametrize("name", list(COMMANDS))
def test_examples_in_the_help_are_lines_that_can_be_typed(name, capsys):
    assert run([name, "--help"]) == 0
    text = said(capsys)[0]
    assert text.startswith(f"Usage: tuner {name}")
    assert "=None" not in text
    assert len(EXAMPLES[name]) == 2
    for line in EXAMPLES[name]:
        assert f"  {line}\n" in text
        program, command, *arguments = shlex.split(line)
        assert (program, command) == ("tuner", name)
        context = tuner.get_command(None, name).make_context(name, arguments)
        context.close()


def test_the_effect_of_an_example_names_all_its_values():
    hidden = [w for line in EXAMPLES["simulate"] for w in shlex.split(line) if "@" in w]
    assert hidden
    for text in hidden:
        effect, axes = read_effect(text, ("gyro_x", "gyro_y"))
        assert parse(effect).name == effect.partition(":")[0]
        assert axes == ("gyro_x",)


def test_a_shell_completes_commands_and_options(monkeypatch, capsys):
    monkeypatch.setenv("_TUNER_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", "tuner cho")
    monkeypatch.setenv("COMP_CWORD", "1")
    with pytest.raises(SystemExit):
        tuner.main(args=[], prog_name="tuner")
    assert "plain,choose" in capsys.readouterr().out


def test_tune_writes_everything_and_names_what_is_absent(tuned):
    files = {path.name for path in tuned.iterdir()}
    assert {"noise.yaml", "kalibr.yaml", "kf-gins.yaml", "allan.png", "allan.svg", "result.json"} <= files
    result = json.loads((tuned / "result.json").read_text())
    written = result.pop("files")
    assert result == json.loads((tuned / "all.json").read_text())
    assert set(written) == files - {"result.json", "all.json"}
    assert result["schema"] == "tuner.result/1"
    for part in ("identification", "diagnosis", "consistency", "config"):
        assert (part in result) != (part in result["absent"])
    assert result["diagnosis"]["schema"] == "tuner.diagnosis/1"


def test_tuned_yaml_is_the_configuration_of_the_result(tuned):
    text = (tuned / "noise.yaml").read_text()
    assert yaml.safe_load(text)["format"] == "tuner-noise/1"
    config = json.loads((tuned / "result.json").read_text())["config"]
    verdict, settings = text[: text.index("# Noise of")], text[text.index("# Noise of") :]
    assert noise_yaml.dumps(load_config(config, source="result.json")) == settings
    said = json.loads((tuned / "result.json").read_text())["verdict"]["use"]
    assert verdict.startswith(f"# Verdict: {said}")


def test_identification_follows_the_contract(tuned):
    found = json.loads((tuned / "result.json").read_text())["identification"]
    assert found["schema"] == "tuner.identification/1"
    assert set(found["channels"]) == {f"{s}_{a}" for s in ("gyro", "accel") for a in "xyz"}
    for channel in found["channels"].values():
        assert channel["rate_hz"] == pytest.approx(100.0)
        assert {"quantization", "white", "bias_instability", "random_walk", "ramp", "gauss_markov"} <= set(
            channel["terms"]
        )
        density = channel["terms"]["white"]["density"]
        assert density["interval"][0] < density["value"] < density["interval"][1]
        for name, term in channel["terms"].items():
            for coefficient in [] if name == "gauss_markov" else term.values():
                assert set(coefficient) >= {"value", "interval", "upper", "unit"}
                assert coefficient["value"] is not None or coefficient["upper"] > 0


def test_identification_finds_the_simulated_white_noise(tuned, log):
    truth = json.loads(log.with_name("unit.key.json").read_text())["channels"]
    found = json.loads((tuned / "result.json").read_text())["identification"]["channels"]
    for axis, channel in found.items():
        expected = truth[axis]["terms"]["white"]["density"]
        # sd(ln N) = 1/√(2n) = 0.26 % at 72 000 samples: six of them.
        assert channel["terms"]["white"]["density"]["value"] == pytest.approx(expected, rel=0.016)


@pytest.mark.parametrize(
    ("name", "key"), [("a.1.npz", "a.1.key.json"), ("a.csv.gz", "a.key.json"), (".a.npz", ".a.key.json")]
)
def test_a_key_has_the_name_of_its_log(tmp_path, name, key):
    assert run(["simulate", "mpu9250", "--hours", "0.001", "-o", str(tmp_path / name), "--quiet"]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {name, key}


def test_json_on_standard_output_is_alone_there(axis, capsys):
    assert run(["identify", str(axis), "--json", "-", "--quiet"]) == 0
    out, err = said(capsys)
    assert json.loads(out)["schema"] == "tuner.identification/1"
    assert err == ""


def test_several_logs_are_pooled(axis, tmp_path, capsys):
    whole = tmp_path / "whole.npz"
    assert run(["simulate", "mpu9250", "--hours", "0.03", "--seed", "4", "-o", str(whole), "--quiet"]) == 0
    other = first_axis(whole, tmp_path / "again.npz")
    assert run(["identify", str(axis), str(other), "--json", "-", "--quiet"]) == 0
    pooled = json.loads(said(capsys)[0])
    assert pooled["records"] == ["unit", "again"]
    white = pooled["channels"]["gyro_x"]["coefficients"]["white.density"]
    assert len(white["values"]) == 2
    assert min(white["values"]) <= white["pooled"]["value"] <= max(white["values"])


def test_curve_gives_one_value_a_tau(log, capsys):
    assert run(["curve", str(log), "--tau", "1,10", "--json", "-", "--quiet"]) == 0
    channel = json.loads(said(capsys)[0])["channels"]["gyro_x"]
    assert channel["tau"] == pytest.approx([1.0, 10.0])
    assert channel["estimator"] == "oadev"
    for low, value, high in zip(channel["lower"], channel["deviation"], channel["upper"], strict=True):
        assert low < value < high


@pytest.mark.parametrize(
    "estimator",
    [
        "adev",
        "twogroup",
        "mdev",
        "hdev",
        "ohdev",
        "totdev",
        "theo1",
        "theobr",
        "theoh",
        "nsec",
        "psd",
        "acf",
        "pacf",
    ],
)
def test_every_estimator_answers(short, capsys, estimator):
    assert run(["curve", str(short), "--estimator", estimator, "--json", "-", "--quiet"]) == 0
    found = json.loads(said(capsys)[0])
    assert found["schema"] == "tuner.curve/1"
    assert set(found["channels"]) == {f"{s}_{a}" for s in ("gyro", "accel") for a in "xyz"}


def test_plan_of_a_grade_and_of_a_log(axis, capsys):
    for source in ("mpu9250", str(axis)):
        assert run(["plan", source, "--accuracy", "0.2", "--hours", "3", "--json", "-", "--quiet"]) == 0
        plan = json.loads(said(capsys)[0])["channels"]["gyro_x"]
        assert plan["parameters"]["white.density"]["shown"]


def test_compare_lists_grades_and_compares(log, capsys):
    assert run(["compare", "--json", "-", "--quiet"]) == 0
    grades = json.loads(said(capsys)[0])["grades"]
    assert {
        "mpu9250",
        "adis16405",
        "adis16465",
        "icm20602",
        "stim300",
        "ln200",
        "kvh1750",
        "rlg",
        "fog",
    } <= set(grades)
    assert run(["compare", "mpu9250", str(log), "--json", "-", "--quiet"]) == 0
    ratio = json.loads(said(capsys)[0])["channels"]["gyro_x"]["coefficients"]["white.density"]["ratio"]
    assert ratio == pytest.approx(1.0, rel=0.02)


def test_identifications_on_file_compare_as_the_log_did(tuned, capsys):
    compared = {}
    for name in ("result.json", "noise.yaml"):
        assert run(["compare", "mpu9250", str(tuned / name), "--json", "-", "--quiet"]) == 0
        compared[name] = json.loads(said(capsys)[0])["channels"]["accel_y"]["coefficients"]
    for name in ("white.density", "random_walk.density", "bias_instability.level"):
        exact, rounded = (compared[file][name]["values"][1] for file in ("result.json", "noise.yaml"))
        if exact["value"] is None:
            assert rounded["upper"] == pytest.approx(exact["upper"], rel=1e-5)
        else:
            half = 0.5 * (exact["interval"][1] - exact["interval"][0])
            assert rounded["value"] == pytest.approx(exact["value"], abs=0.01 * half)
            assert rounded["interval"] == pytest.approx(exact["interval"], abs=0.01 * half)
    assert compared["result.json"]["sigma_10s"]["values"][1]["interval"] is not None
    assert compared["result.json"]["white.density"]["ratio"] == pytest.approx(1.0, rel=0.02)


def test_export_of_a_tuned_configuration(tuned, tmp_path, capsys):
    file = tmp_path / "imu.yaml"
    assert run(["export", str(tuned / "noise.yaml"), "--to", "kalibr", "-o", str(file), "--quiet"]) == 0
    written = yaml.safe_load(file.read_text())
    assert run(["export", str(tuned / "noise.yaml"), "--to", "kalibr", "--quiet"]) == 0
    assert yaml.safe_load(said(capsys)[0]) == written
    assert all(written[key] > 0 for key in written if key != "rostopic")


def test_simulated_logs_read_back_in_every_format(tmp_path, capsys):
    texts = []
    for ending in ("npz", "csv", "csv.gz"):
        path = tmp_path / f"unit.{ending}"
        assert (
            run(["simulate", "stim300", "--hours", "0.02", "--hide", "line", "-o", str(path), "--quiet"]) == 0
        )
        assert run(["curve", str(path), "--tau", "0.1", "--json", "-", "--quiet"]) == 0
        texts.append(json.loads(said(capsys)[0])["channels"]["gyro_x"]["deviation"])
    assert texts[1] == pytest.approx(texts[0])
    assert texts[2] == pytest.approx(texts[0])


def test_a_figure_is_drawn(axis, tmp_path):
    figure = tmp_path / "allan.png"
    assert (
        run(["identify", str(axis), "--figure", str(figure), "--quiet", "--json", str(tmp_path / "x.json")])
        == 0
    )
    assert figure.read_bytes().startswith(b"\x89PNG")


def test_the_page_of_identify_says_what_the_terminal_says(short, tmp_path, capsys, monkeypatch):
    """Of a log whose terms do not predict its curve the page said "usable" and other numbers than the terminal."""

    def by_curve(config, records):
        config, found = hold_to_records(config, records)
        return config, {axis: replace(one, source=BlockSource.CURVE) for axis, one in found.items()}

    monkeypatch.setattr("tuner.synthesis.prediction.hold_to_records", by_curve)
    page = tmp_path / "page.html"
    assert run(["identify", str(first_axis(short, tmp_path / "one.npz")), "--page", str(page)]) == 0
    said = "usable except: gyro x, whose terms do not predict the Allan curve"
    assert said in " ".join(capsys.readouterr().out.split())
    assert said in page.read_text()
