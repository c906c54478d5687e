"""The native YAML loads back to an equal configuration; unreadable ones are refused in one line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from models.noise import GaussMarkov
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.formats import native
from tuner.formats.yaml_text import Inline, Noted, yaml_text
from tuner.synthesis import synthesize
from tuner.types import (
    AppliedNoiseScale,
    BoundUsed,
    ChannelNoise,
    Coefficient,
    Enlargement,
    FilterConfig,
    GnssNoise,
    InitialUncertainty,
    Quantity,
    TermEstimate,
)
from tuner.types.records import DataError

numbers = st.floats(allow_nan=False, allow_infinity=False)
sizes = st.floats(min_value=0.0, allow_nan=False, allow_infinity=False)
positive = st.floats(min_value=1e-300, max_value=1e300)
texts = st.text(max_size=30)
plain = st.recursive(
    st.none() | st.booleans() | st.integers() | numbers | texts,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3),
    max_leaves=8,
)
markov = st.lists(st.builds(GaussMarkov, positive, positive), max_size=3).map(tuple)
coefficients = st.builds(
    Coefficient,
    st.none() | numbers,
    st.none() | st.tuples(numbers, numbers),
    st.none() | numbers,
    texts,
    st.none() | texts,
)
names = st.sampled_from(["white", "bias_instability", "gauss_markov", "arma"])
terms = st.builds(
    TermEstimate, names, st.dictionaries(st.sampled_from(["density", "sd"]), coefficients, max_size=2)
)
mappings = st.dictionaries(texts, plain, max_size=3)
reasons = st.dictionaries(texts, texts, max_size=3)


@st.composite
def channels(draw: st.DrawFn) -> dict[str, ChannelNoise]:
    axes = draw(st.sets(st.sampled_from(["gyro_x", "gyro_z", "accel_y", "wheel"]), max_size=4))
    return {
        axis: ChannelNoise(
            axis,
            "rad/s" if axis.startswith("gyro") else "m/s^2",
            draw(sizes),
            draw(markov),
            draw(sizes),
            draw(sizes),
            draw(sizes),
            tuple(draw(st.lists(terms, max_size=2))),
            draw(reasons),
        )
        for axis in sorted(axes)
    }


quantities = st.builds(
    Quantity,
    st.sampled_from(["gyro_x", "accel", "gnss"]),
    st.sampled_from(["white_density", "white.density", "position_sd"]),
)
codes = st.lists(texts, max_size=2).map(tuple)
inflations = (
    st.builds(BoundUsed, quantities, numbers, texts)
    | st.builds(Enlargement, quantities, numbers, texts, codes)
    | st.builds(AppliedNoiseScale, quantities, numbers, texts, st.none() | st.tuples(numbers, numbers), codes)
)
triples = st.tuples(sizes, sizes, sizes)
configs = st.builds(
    FilterConfig,
    texts,
    positive,
    channels(),
    st.builds(InitialUncertainty, sizes, sizes, sizes, sizes, reasons),
    st.none() | st.builds(GnssNoise, triples, st.none() | triples, positive, positive, markov, texts),
    st.lists(inflations, max_size=3).map(tuple),
    mappings,
    st.lists(texts, max_size=2).map(tuple),
    st.lists(mappings, max_size=2).map(tuple),
)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(configs)
def test_round_trip_is_exact(config: FilterConfig) -> None:
    assert native.loads(native.dumps(config)) == config


def stim300() -> FilterConfig:
    return synthesize(grade_identification(load_grade("stim300")), gnss=load_gnss("rtk"), seed=0)


def test_an_interval_without_an_upper_end_is_read_back() -> None:
    config = stim300()
    open_ended = Coefficient(1e4, (1e3, float("inf")), None, "s", None)
    term = TermEstimate("gauss_markov", {"time_constant": open_ended})
    channel = replace(config.channels["gyro_z"], identified=(term,))
    config = replace(config, channels={**config.channels, "gyro_z": channel})
    assert native.loads(native.dumps(config)).channels["gyro_z"] == channel


OLD_INFLATIONS = """inflations:
  - {quantity: gyro_x.white.density, factor: 0.5, reason: "bounded: half of the 95 % upper limit (x)"}
  - {quantity: gyro_x.white_density, factor: 2.5, reason: "burst: the noise while it lasts"}
  - {quantity: gyro.markov, factor: 1.0, interval: [1.2, 1.6], causes: [unknown], reason: as the drive says}
  - {quantity: gnss.position_sd, factor: 1.0, reason: not identifiable}
"""


def test_inflations_of_files_without_their_kind_are_told_apart() -> None:
    text = native.dumps(replace(stim300(), inflations=())).replace("inflations: []\n", OLD_INFLATIONS)
    bound, larger, drive, unknown = native.loads(text).inflations
    assert bound == BoundUsed(Quantity("gyro_x", "white.density"), 0.5, bound.reason)
    assert larger == Enlargement(Quantity("gyro_x", "white_density"), 2.5, larger.reason)
    assert drive == AppliedNoiseScale(Quantity("gyro", "markov"), 1.0, drive.reason, (1.2, 1.6), ("unknown",))
    assert unknown == AppliedNoiseScale(Quantity("gnss", "position_sd"), 1.0, "not identifiable")


def test_an_inflation_that_names_no_quantity_is_refused() -> None:
    text = native.dumps(replace(stim300(), inflations=())).replace("inflations: []\n", OLD_INFLATIONS)
    with pytest.raises(DataError, match=r"inflations\[2\]\.quantity: expected .*OWNER\.FIELD"):
        native.loads(text.replace("gyro.markov", "gyro"))
    with pytest.raises(DataError, match=r"inflations\[0\]\.kind: expected one of bound_used"):
        native.loads(
            text.replace("{quantity: gyro_x.white.density,", "{quantity: gyro_x.white.density, kind: x,")
        )


def test_text_speaks_customary_units_and_names_its_format() -> None:
    text = native.dumps(stim300())
    assert yaml.safe_load(text)["format"] == "tuner-noise/1"
    assert "# rad/s/√Hz; 0.150 deg/√h" in text
    assert "# m/s^2/√Hz; 102 µg/√Hz" in text


def test_files_are_written_and_read(tmp_path: Path) -> None:
    path = tmp_path / "noise.yaml"
    native.dump(stim300(), path)
    assert native.load(path) == stim300()
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "format: tuner-noise/1",
            "format: other/1",
            "expected a line 'format: tuner-noise/1', got 'other/1'",
        ),
        ("interval: 0.008", "interval: -1", "interval: expected a positive number, got -1"),
        ("ramp_sd: 0.0", "ramp: 0.0", "filter: expected a key 'ramp_sd'"),
        (
            "constant_sd: 1.9",
            "constant_sd: x1.9",
            "sensors.gyro.gyro_x.filter.constant_sd: expected a number",
        ),
        ("constant_sd: 1.9", "constant_sd: -1.9", "filter.constant_sd: expected a number not below 0"),
        ("white_density: ", "white_density: -", "gyro_x.filter.white_density: expected a number not below 0"),
        ("position_sd: [0.02,", "position_sd: [-0.02,", "gnss.position_sd[0]: expected a number not below 0"),
        ("gate: 5.0", "gate: [5.0]", "gnss.gate: expected a positive number"),
        ("position_sd: [0.02, 0.02, 0.03]", "position_sd: [0.02]", "position_sd: expected 3 numbers"),
        ("sensors:", "sensors: [", "mine.yaml: expected YAML"),
    ],
)
def test_a_broken_text_is_refused_in_one_line(old: str, new: str, message: str) -> None:
    text = native.dumps(stim300())
    assert old in text
    with pytest.raises(DataError) as caught:
        native.loads(text.replace(old, new), source="mine.yaml")
    assert message in str(caught.value)
    assert str(caught.value).startswith("mine.yaml")
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="expected a readable YAML"):
        native.load(tmp_path / "absent.yaml")


def test_comments_never_leak_into_values() -> None:
    tree = {
        "a": Noted(1e-7, "first\nsecond # third"),
        "b": Noted(Inline([1.0, None, "x: y"]), "note"),
        "c": {},
    }
    text = yaml_text(tree, header=["one\ntwo"])
    assert yaml.safe_load(text) == {"a": 1e-7, "b": [1.0, None, "x: y"], "c": {}}
    assert text.splitlines()[0] == "# one two"
