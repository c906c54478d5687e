"""The native YAML speaks customary units in comments, and refuses what it cannot read in one line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.diagnosis.drive.noise_factors import with_noise_factors
from tuner.exporters import export
from tuner.formats import noise_yaml
from tuner.formats.yaml_text import Inline, Noted, yaml_text
from tuner.synthesis import synthesize
from tuner.synthesis.load_config import load_config
from tuner.synthesis.rest_and_motion import with_rest_and_motion
from tuner.types import (
    AppliedNoiseScale,
    BoundUsed,
    Coefficient,
    Enlargement,
    FilterConfig,
    Quantity,
    TermEstimate,
)
from tuner.types.records import DataError


def stim300() -> FilterConfig:
    return synthesize(grade_identification(load_grade("stim300")), gnss=load_gnss("rtk"), seed=0)


def test_an_interval_without_an_upper_end_is_read_back() -> None:
    config = stim300()
    open_ended = Coefficient(1e4, (1e3, float("inf")), None, "s", None)
    term = TermEstimate("gauss_markov", {"time_constant": open_ended})
    channel = replace(config.channels["gyro_z"], identified=(term,))
    config = replace(config, channels={**config.channels, "gyro_z": channel})
    text = noise_yaml.dumps(config)
    assert "interval: [1000.0, null]" in text
    for version in (text, text.replace("[1000.0, null]", "[1000.0, .inf]")):
        assert noise_yaml.loads(version).channels["gyro_z"].identified == (term,)


def test_numbers_carry_the_digits_their_interval_supports_and_two_more() -> None:
    config = stim300()
    coefficient = Coefficient(4.3633231299858234e-05, (4.31234e-05, 4.41234e-05), None, "rad/s^0.5", None)
    channel = replace(
        config.channels["gyro_z"], identified=(TermEstimate("white", {"density": coefficient}),)
    )
    text = noise_yaml.dumps(
        replace(config, channels={**config.channels, "gyro_z": channel}, interval=1.0 / 30.0)
    )
    assert "{value: 4.3633e-05, interval: [4.3123e-05, 4.4123e-05], unit: rad/s^0.5}" in text
    assert "white_density: 4.36332e-05" in text
    assert "interval: 0.0333333333 " in text


OLD_INFLATIONS = """inflations:
  - {quantity: gyro_x.white.density, factor: 0.5, reason: "bounded: half of the 95 % upper limit (x)"}
  - {quantity: gyro_x.white_density, factor: 2.5, reason: "burst: the noise while it lasts"}
  - {quantity: gyro.markov, factor: 1.0, interval: [1.2, 1.6], causes: [unknown], reason: as the drive says}
  - {quantity: gnss.position_sd, factor: 1.0, reason: not identifiable}
"""


def test_inflations_of_files_without_their_kind_are_told_apart() -> None:
    text = noise_yaml.dumps(replace(stim300(), inflations=())).replace("inflations: []\n", OLD_INFLATIONS)
    bound, larger, drive, unknown = noise_yaml.loads(text).inflations
    assert bound == BoundUsed(Quantity("gyro_x", "white.density"), 0.5, bound.reason)
    assert larger == Enlargement(Quantity("gyro_x", "white_density"), 2.5, larger.reason)
    assert drive == AppliedNoiseScale(Quantity("gyro", "markov"), 1.0, drive.reason, (1.2, 1.6), ("unknown",))
    assert unknown == AppliedNoiseScale(Quantity("gnss", "position_sd"), 1.0, "not identifiable")


def test_an_inflation_that_names_no_quantity_is_refused() -> None:
    text = noise_yaml.dumps(replace(stim300(), inflations=())).replace("inflations: []\n", OLD_INFLATIONS)
    with pytest.raises(DataError, match=r"inflations\[2\]\.quantity: expected .*OWNER\.FIELD"):
        noise_yaml.loads(text.replace("gyro.markov", "gyro"))
    with pytest.raises(DataError, match=r"inflations\[0\]\.kind: expected one of bound_used"):
        noise_yaml.loads(
            text.replace("{quantity: gyro_x.white.density,", "{quantity: gyro_x.white.density, kind: x,")
        )


def test_text_speaks_customary_units_and_names_its_format() -> None:
    text = noise_yaml.dumps(stim300())
    assert yaml.safe_load(text)["format"] == "tuner-noise/1"
    assert "# rad/s/√Hz; 0.150 deg/√h" in text
    assert "# m/s^2/√Hz; 102 µg/√Hz" in text


def test_files_are_written_and_read(tmp_path: Path) -> None:
    path = tmp_path / "noise.yaml"
    noise_yaml.dump(stim300(), path)
    assert noise_yaml.load(path) == noise_yaml.loads(noise_yaml.dumps(stim300()))
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "format: tuner-noise/1",
            "format: other/1",
            "expected a line 'format: tuner-noise/1', got 'other/1'",
        ),
        ("interval: 0.008", "interval: -1", "interval: expected a number of seconds from 1e-7 to 86400"),
        (
            "interval: 0.008",
            "interval: 1.0e+308",
            "interval: expected a number of seconds from 1e-7 to 86400",
        ),
        ("ramp_sd: 0.0", "ramp: 0.0", "filter: expected a key 'ramp_sd'"),
        (
            "constant_sd: 1.9",
            "constant_sd: x1.9",
            "sensors.gyro.gyro_x.filter.constant_sd: expected a number",
        ),
        ("constant_sd: 1.9", "constant_sd: -1.9", "filter.constant_sd: expected a number not below 0"),
        ("white_density: ", "white_density: -", "gyro_x.filter.white_density: expected a number not below 0"),
        (
            "white_density: ",
            "white_density: 1.0e+308  # ",
            "gyro_x.filter.white_density: expected a number up to 100000",
        ),
        (
            "density: {value: ",
            "density: {value: 1.0e+308, interval: null, unit: rad/s^0.5}  # ",
            "gyro_x.identified[0].density.value: expected a number up to 100000 rad/s^0.5, as no sensor reads more",
        ),
        ("position_sd: [0.02,", "position_sd: [-0.02,", "gnss.position_sd[0]: expected a number not below 0"),
        ("gate: 5.0", "gate: [5.0]", "gnss.gate: expected a positive number"),
        ("position_sd: [0.02, 0.02, 0.03]", "position_sd: [0.02]", "position_sd: expected 3 numbers"),
        ("sensors:", "sensors: [", "mine.yaml: expected YAML"),
        ("term: white", "term: whte", "gyro_x.identified[0]: expected terms among quantization, white"),
        (
            "      - term: white\n          density:",
            "      - term: white\n          sd:",
            "gyro_x.identified[0]: expected coefficients of 'white' among density, got 'sd'",
        ),
    ],
)
def test_a_broken_text_is_refused_in_one_line(old: str, new: str, message: str) -> None:
    text = noise_yaml.dumps(stim300())
    assert old in text
    with pytest.raises(DataError) as caught:
        noise_yaml.loads(text.replace(old, new), source="mine.yaml")
    assert message in str(caught.value)
    assert str(caught.value).startswith("mine.yaml")
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"absent.yaml: no such file$"):
        noise_yaml.load(tmp_path / "absent.yaml")


def test_comments_never_leak_into_values() -> None:
    tree = {
        "a": Noted(1e-7, "first\nsecond # third"),
        "b": Noted(Inline([1.0, None, "x: y"]), "note"),
        "c": {},
    }
    text = yaml_text(tree, header=["one\ntwo"])
    assert yaml.safe_load(text) == {"a": 1e-7, "b": [1.0, None, "x: y"], "c": {}}
    assert text.splitlines()[0] == "# one two"


def test_noise_at_rest_stands_beside_that_in_motion() -> None:
    """White noise of the gyros twice as large on a drive: both are written, read back, and told by the exporters."""
    rest = load_config("stim300", gnss=load_gnss("rtk"))
    drive = with_noise_factors(rest, {"white": 2.0})
    both = with_rest_and_motion(rest, drive)
    assert with_rest_and_motion(rest, rest).noise_in_motion == {}
    read = noise_yaml.loads(noise_yaml.dumps(both))
    for axis, density in read.noise.items():
        assert read.noise_in_motion[axis] == pytest.approx(2.0 * density, rel=1e-5)
        assert read.channels[axis].white_density == read.noise_in_motion[axis]
    assert len(read.noise) == 6
    assert "N is that in motion" in export(read, "kalibr")
    assert "N is that in motion" not in export(rest, "kalibr")


def test_what_rests_on_a_limit_says_so_on_its_line() -> None:
    limits = {"random_walk": "density", "bias_instability": "level"}
    config = stim300()
    channel = config.channels["gyro_z"]
    identified = tuple(
        TermEstimate(name, {field: Coefficient.bounded(1e-6, "rad/s", "record too short")})
        for name, field in limits.items()
    )
    changed = replace(channel, identified=identified, random_walk_density=5e-7)
    halves = tuple(BoundUsed(Quantity("gyro_z", f"{n}.{f}"), 0.5, "short") for n, f in limits.items())
    provenance = {**config.provenance, "span": 50.0}
    one = replace(config, channels={"gyro_z": changed}, provenance=provenance, inflations=halves)
    lines = noise_yaml.dumps(one).splitlines()
    own = [line for line in lines if ("{sd:" in line and "rad/s" in line) or "random_walk_density:" in line]
    assert len(own) == 1 + len(channel.markov)
    assert all("rests on a 95 % limit" in line for line in own)
    three = replace(one, channels={**config.channels, "gyro_z": changed})
    (walk,) = [
        line for line in export(three, "kalibr").splitlines() if line.startswith("gyroscope_random_walk")
    ]
    assert "rests on a 95 % limit: z;" in walk


def test_states_longer_than_the_log_say_so() -> None:
    config = replace(stim300(), provenance={"span": 50.0})
    text = noise_yaml.dumps(config)
    slow = [s for c in config.channels.values() for s in c.markov if s.time_constant > 50.0]
    assert text.count("longer than the log: extrapolated") == len(slow) > 0
