"""The parsers of the consumers on what we write: OpenCV, yaml-cpp, XML."""

from __future__ import annotations

import shutil
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.consumers.examples import EXAMPLES, text_of
from tests.consumers.numbers import from_yaml
from tuner.exporters import DIALECTS

OPENCV = [name for name in DIALECTS if text_of("walk", name).startswith("%YAML:1.0")]
OTHERS = ["kalibr", "liosam", "liosam-ros2", "lvi-sam", "fastlio", "fastlio-ros2", "fast-livo2", "point-lio"]
OTHERS += ["kf-gins", "ob-gins", "dm-vio", "robot-localization", "isaac-visual-slam"]


def leaves(tree: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """Yield place and value of every number and text of a document."""
    if isinstance(tree, dict):
        for key, value in tree.items():
            yield from leaves(value, f"{place}/{key.removeprefix('/')}" if place else str(key))
    elif isinstance(tree, list):
        for k, value in enumerate(tree):
            yield from leaves(value, f"{place}/{k}")
    else:
        yield place, tree


@pytest.mark.parametrize("example", list(EXAMPLES))
@pytest.mark.parametrize("dialect", OPENCV)
def test_opencv_reads_every_number(dialect: str, example: str) -> None:
    cv2 = pytest.importorskip("cv2", reason="OpenCV is not installed (pip install opencv-python-headless)")
    text = text_of(example, dialect)
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)

    def node(place: str) -> Any:
        found, *rest = place.split("/")
        current = storage.getNode(found)
        for key in rest:
            current = current.at(int(key)) if current.isSeq() else current.getNode(key)
        return current

    for place, value in leaves(dict(from_yaml(text))):
        found = node(place)
        assert not found.empty(), place
        if isinstance(value, str):
            assert found.string() == value
        else:
            assert found.real() == pytest.approx(value)
            # ORB-SLAM3 asks isReal() of noises, and isInt() of the frequency of files without version.
            assert found.isInt() == isinstance(value, int), place


READER = r"""
#include <yaml-cpp/yaml.h>
#include <cstdio>
#include <string>
static void walk(const YAML::Node& node, const std::string& place) {
  if (node.IsMap())
    for (const auto& entry : node) {
      std::string key = entry.first.as<std::string>();
      if (!place.empty() && key[0] == '/') key.erase(0, 1);
      walk(entry.second, place.empty() ? key : place + "/" + key);
    }
  else if (node.IsSequence())
    for (std::size_t k = 0; k < node.size(); ++k) walk(node[k], place + "/" + std::to_string(k));
  else
    std::printf("%s\t%.17g\n", place.c_str(), node.as<double>(-1e300));
}
int main(int count, char** paths) {
  for (int k = 1; k < count; ++k) { std::printf("%s\n", paths[k]); walk(YAML::LoadFile(paths[k]), ""); }
}
"""


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Compile a program that prints every number as yaml-cpp reads it."""
    folder = tmp_path_factory.mktemp("yaml-cpp")
    (folder / "reader.cpp").write_text(READER)
    compiler = shutil.which("g++") or shutil.which("c++")
    if compiler is None:
        pytest.skip("no C++ compiler")
    command = [compiler, "-O0", "reader.cpp", "-o", "reader", "-lyaml-cpp"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.skip("yaml-cpp is not installed (libyaml-cpp-dev)")
    return folder / "reader"


@pytest.mark.parametrize("example", list(EXAMPLES))
def test_yaml_cpp_reads_every_number(reader: Path, example: str, tmp_path: Path) -> None:
    paths = {name: tmp_path / f"{name}.yaml" for name in OTHERS}
    for name, path in paths.items():
        path.write_text(text_of(example, name), encoding="utf-8")
    said = subprocess.run([reader, *paths.values()], capture_output=True, text=True, check=True).stdout
    for name, path in paths.items():
        block = said.split(f"{path}\n")[1].split(str(tmp_path))[0]
        found = dict(line.split("\t") for line in block.splitlines())
        expected = dict(leaves(dict(from_yaml(text_of(example, name)))))
        assert found.keys() == expected.keys(), name
        for place, value in expected.items():
            if not isinstance(value, str):
                assert float(found[place]) == pytest.approx(value), f"{name} {place}"


@pytest.mark.parametrize("dialect", ["gazebo", "rotors"])
def test_sdf_is_well_formed_and_has_numbers_alone(dialect: str) -> None:
    root = ET.fromstring(text_of("flicker", dialect))
    values = [element.text for element in root.iter() if len(element) == 0]
    assert len(values) > 8
    assert all(float(value or "nan") >= 0.0 for value in values)


def test_gazebo_uses_the_elements_of_sdf() -> None:
    # http://sdformat.org/spec: sensor/imu/{angular_velocity,linear_acceleration}/{x,y,z}/noise[@type]
    root = ET.fromstring(text_of("flicker", "gazebo"))
    assert root.tag == "imu"
    assert [child.tag for child in root] == ["angular_velocity", "linear_acceleration"]
    known = {
        "mean",
        "stddev",
        "bias_mean",
        "bias_stddev",
        "dynamic_bias_stddev",
        "dynamic_bias_correlation_time",
        "precision",
    }
    for noise in root.iter("noise"):
        assert noise.get("type") == "gaussian"
        assert {child.tag for child in noise} <= known


# Range and default by PX4/PX4-Autopilot src/modules/ekf2/{module,params_gyro_bias,params_accel_bias}.yaml and
# ArduPilot/ardupilot libraries/AP_NavEKF3/AP_NavEKF3.cpp (@Range, *_DEFAULT).
METADATA = {
    "px4": {
        "EKF2_GYR_NOISE": (1e-4, 0.1, 0.015),
        "EKF2_ACC_NOISE": (0.01, 1.0, 0.35),
        "EKF2_GYR_B_NOISE": (0.0, 0.01, 0.001),
        "EKF2_ACC_B_NOISE": (0.0, 0.01, 0.003),
        "EKF2_GBIAS_INIT": (0.0, 0.2, 0.1),
        "EKF2_ABIAS_INIT": (0.0, 0.5, 0.2),
    },
    "ardupilot": {
        "EK3_GYRO_P_NSE": (1e-4, 0.1, 0.015),
        "EK3_ACC_P_NSE": (0.01, 1.0, 0.35),
        "EK3_GBIAS_P_NSE": (1e-5, 1e-3, 1e-3),
        "EK3_ABIAS_P_NSE": (1e-5, 0.02, 0.02),
    },
}


@pytest.mark.parametrize("dialect", list(METADATA))
def test_parameters_say_stock_value_and_whether_they_are_in_range(dialect: str) -> None:
    text = text_of("walk", dialect)
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    values = {}
    for line in lines:
        name, value = line.split("\t")[2:4] if dialect == "px4" else line.split(",")
        values[name] = float(value)
    kept = {name for name in METADATA[dialect] if name.endswith("BIAS_INIT")}  # one switch-on shows no spread
    assert values.keys() == METADATA[dialect].keys() - kept
    for name, (low, high, stock) in METADATA[dialect].items():
        said = next(line for line in text.splitlines() if line.startswith(f"# {name}:"))
        assert f"stock {stock:g}" in said
        if name in kept:
            assert "keep stock" in said
            continue
        assert ("WARNING" in said) == (not low <= values[name] <= high)
        assert 0.0 <= values[name] <= 1.0  # to which the firmware constrains
