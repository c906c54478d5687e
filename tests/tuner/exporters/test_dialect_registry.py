"""A dialect is one declaration in one file, of this project or of another package."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from models.registry import Registry, RegistryError
from tuner.catalogue.grades import grade_identification, load_grade
from tuner.cli import run
from tuner.exporters import DIALECTS, Dialect, export
from tuner.synthesis import synthesize

PAGE = Path(__file__).parents[3] / "docs" / "extending" / "dialect.md"
TEMPLATE = re.search(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL).group(1)
CONFIG = synthesize(grade_identification(load_grade("stim300")), seed=0)


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Lay a package with the template of the page, as pip would, and forget its dialect afterwards."""
    fresh: Registry[Dialect] = Registry("dialect", "tuner.dialects", name_of=lambda dialect: dialect.name)
    fresh.extend(DIALECTS.values())
    (tmp_path / "other_filter.py").write_text(TEMPLATE, encoding="utf-8")
    facts = tmp_path / "other_filter-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: other-filter\nVersion: 1.0\n")
    (facts / "entry_points.txt").write_text("[tuner.dialects]\nmy-filter = other_filter:DIALECT\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "other_filter", raising=False)
    for module in ("tuner.exporters", "tuner.exporters.dialect"):
        monkeypatch.setattr(sys.modules[module], "DIALECTS", fresh)


def test_the_template_is_a_dialect_of_30_lines_at_most() -> None:
    code = [line for line in TEMPLATE.splitlines() if line.strip()]
    assert len(code) <= 30


@pytest.mark.usefixtures("package")
def test_a_dialect_of_another_package_is_written_like_the_others() -> None:
    found = yaml.safe_load(export(CONFIG, "my-filter"))["imu_noise"]
    theirs = yaml.safe_load(export(CONFIG, "15-state"))["Q_per_second"]  # with the same fixes
    assert found["gyro_n"] ** 2 == pytest.approx(theirs["attitude"][0], rel=1e-5)
    assert found["accel_k"] ** 2 == pytest.approx(theirs["accel_bias"][0], rel=1e-5)


@pytest.mark.usefixtures("package")
def test_a_dialect_of_another_package_is_listed_and_exported_by_the_command(tmp_path: Path) -> None:
    listed, out = tmp_path / "list.json", tmp_path / "mine.yaml"
    assert run(["export", "--list", "--quiet", "--json", str(listed)]) == 0
    dialects = json.loads(listed.read_text())["dialects"]
    assert next(iter(dialects)) == "native"
    assert list(dialects)[-1] == "my-filter"
    assert run(["export", "stim300", "--to", "my-filter", "-o", str(out), "--quiet"]) == 0
    assert "imu_noise" in yaml.safe_load(out.read_text())


def test_rate_and_step_of_the_target_are_options(tmp_path: Path) -> None:
    def written(dialect: str, *options: str) -> str:
        out = tmp_path / "export"
        assert run(["export", "stim300", "--to", dialect, "-o", str(out), "--quiet", *options]) == 0
        return out.read_text()

    # A grade of 250 Hz in a VINS of 500 Hz: its noise a sample is √2 larger.
    slow, fast = (yaml.safe_load(written("vins", "--rate", rate)[10:])["gyr_n"] for rate in ("250", "500"))
    assert fast / slow == pytest.approx(2.0**0.5, rel=1e-5)
    assert "dt = 0.008 s" in written("px4", "--step", "0.008")
    assert run(["export", "stim300", "--to", "vins", "--rate", "0"]) == 2


def test_a_configuration_of_gyros_alone_is_refused_with_the_remedy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gyros = {axis: channel for axis, channel in CONFIG.channels.items() if axis.startswith("gyro")}
    path = tmp_path / "noise.yaml"
    path.write_text(export(replace(CONFIG, channels=gyros), "native"), encoding="utf-8")
    assert run(["export", str(path), "--to", "kalibr"]) == 2
    said = capsys.readouterr().err.strip()
    assert "kalibr needs gyroscopes and accelerometers, found no accelerometers" in said
    assert "--complete GRADE" in said
    assert "\n" not in said
    assert run(["export", str(path), "--to", "px4", "-o", str(tmp_path / "px4.params")]) == 0
    # A file of comments alone was "wrote px4.params", to be loaded into a vehicle.
    assert ": no parameter, as each keeps its stock value" in capsys.readouterr().err


def test_an_unknown_dialect_is_refused_by_the_command_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["export", "stim300", "--to", "kalibre"]) == 2
    said = capsys.readouterr().err.strip()
    assert "unknown dialect 'kalibre' (did you mean 'kalibr'?); known are native, kalibr," in said
    assert "\n" not in said


@pytest.mark.usefixtures("package")
def test_a_package_that_cannot_be_loaded_is_named_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "other_filter.py").write_text("import a_package_that_is_not_there\n")
    assert run(["export", "--list"]) == 2
    said = capsys.readouterr().err.strip()
    assert "dialect 'my-filter' of package 'other-filter' cannot be loaded" in said
    assert "\n" not in said


@pytest.mark.parametrize(
    ("name", "title", "message"),
    [
        ("My Filter", "a title", "expected a name of lower-case letters"),
        ("mine", "", "expected a title, units and a function 'write'"),
    ],
)
def test_an_incomplete_dialect_is_refused(name: str, title: str, message: str) -> None:
    with pytest.raises(RegistryError, match=message):
        DIALECTS.add(Dialect(name, title, "SI", lambda config, _: config.name))
    with pytest.raises(RegistryError, match="expected a Dialect, got str"):
        DIALECTS.add("kalibr-2")
