"""What is read back is equal: load(dump(x)) == x, through JSON without NaN or infinity; others hold what they show."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models.noise import TERMS, NoiseModel
from tests.tuner.formats.arbitrary_results import (
    codes,
    configs,
    curves,
    gains,
    identifications,
    models_by_axis,
    noise_scales,
    numbers,
    outages,
    positive_scores,
    scores,
    some_findings,
    some_scores,
    texts,
    unexplained,
    verdicts,
)
from tuner.formats import noise_yaml
from tuner.formats.codec import dump
from tuner.formats.configuration import config_json, load_config
from tuner.formats.consistency import scores_json
from tuner.formats.curves import curves_json
from tuner.formats.diagnosis import diagnosis_json
from tuner.formats.documents import json_text
from tuner.formats.identification import identification_json, load_identification
from tuner.types import (
    AllanCurve,
    ChannelIdentification,
    Coefficient,
    Correlogram,
    Diagnosis,
    DriveDiagnosis,
    FilterConfig,
    Identification,
    Inseparable,
    Spectrum,
    TermEstimate,
)
from tuner.types.consistency import Consistency, RmsError, Whiteness
from tuner.types.records import DataError

thorough = settings(max_examples=30, deadline=None, derandomize=True)


def same(left: Any, right: Any) -> bool:
    """Return whether two values are equal, NaN equal to itself; a variance within one rounding of its root."""
    if dataclasses.is_dataclass(left) and not isinstance(left, NoiseModel):
        names = [field.name for field in dataclasses.fields(left)]
        return type(left) is type(right) and all(same(getattr(left, n), getattr(right, n)) for n in names)
    if isinstance(left, np.ndarray):
        return left.shape == right.shape and np.allclose(left, right, rtol=4e-16, atol=0.0, equal_nan=True)
    if isinstance(left, Mapping):
        return list(left) == list(right) and all(same(left[key], right[key]) for key in left)
    if isinstance(left, tuple):
        return len(left) == len(right) and all(map(same, left, right))
    if isinstance(left, float) and math.isnan(left):
        return isinstance(right, float) and math.isnan(right)
    return bool(left == right)


def stored(content: Mapping[str, Any]) -> Any:
    """Return what is read from the JSON text of a document."""
    return json.loads(json_text(content))


@thorough
@given(identifications())
def test_identification(found: Identification) -> None:
    assert same(load_identification(stored(identification_json(found)), source="a.json"), found)


@thorough
@given(configs)
def test_configuration_as_json(config: FilterConfig) -> None:
    assert load_config(stored(config_json(config)), source="a.json") == config


@thorough
@given(configs)
def test_configuration_as_yaml_is_written_again_as_it_was_read(config: FilterConfig) -> None:
    text = noise_yaml.dumps(config)
    assert noise_yaml.dumps(noise_yaml.loads(text)) == text


@thorough
@given(configs)
def test_configuration_as_yaml_has_rounded_numbers_and_all_else(config: FilterConfig) -> None:
    found = noise_yaml.loads(noise_yaml.dumps(config))
    assert json.dumps(structure(config_json(found))) == json.dumps(structure(config_json(config)))


def structure(content: Any) -> Any:
    """Return plain values with every number that is not whole replaced by its sign."""
    if isinstance(content, dict):
        return {key: structure(entry) for key, entry in content.items()}
    if isinstance(content, list):
        return [structure(entry) for entry in content]
    return math.copysign(1.0, content) if isinstance(content, float) else content


@thorough
@given(st.builds(Diagnosis, some_findings, unexplained, codes, models_by_axis, models_by_axis))
def test_diagnosis(found: Diagnosis) -> None:
    content = stored(diagnosis_json(found))
    assert content["quiet"] == found.quiet
    assert len(content["findings"]) == len(found.findings)


@thorough
@given(
    st.builds(
        DriveDiagnosis,
        some_findings,
        configs,
        configs,
        unexplained,
        st.lists(st.builds(Inseparable, codes, texts), max_size=2).map(tuple),
        codes,
        st.none() | gains,
        st.lists(noise_scales, max_size=2).map(tuple),
    )
)
def test_diagnosis_of_a_drive(found: DriveDiagnosis) -> None:
    content = stored(diagnosis_json(found))
    assert content["credited"] == found.credited
    assert [one["factor"] for one in content["demands"]] == [dump(one.plain) for one in found.noise_scales]


axes = st.tuples(numbers, numbers, numbers)
unitless = st.builds(RmsError, axes)
rms = st.builds(RmsError, axes, st.sampled_from(("m", "m/s", "rad")))


@thorough
@given(
    st.builds(
        Consistency,
        st.none() | scores("nees"),
        some_scores("position", "velocity"),
        some_scores("nis", "nis_position") | some_scores("nis_velocity"),
        st.none() | st.builds(Whiteness, texts, st.integers(1, 10), numbers, positive_scores),
        st.lists(outages, max_size=2).map(tuple),
        st.dictionaries(texts, unitless, max_size=2)
        | st.dictionaries(
            st.sampled_from(("position", "velocity", "nis_position", "heading")), rms, max_size=3
        ),
        numbers,
        st.booleans(),
        st.lists(verdicts, max_size=3).map(tuple),
    )
)
def test_consistency(found: Consistency) -> None:
    content = stored(scores_json(found))
    assert content["consistent"] == found.consistent
    assert [one["score"] for one in content["outage"]] == [dump(one.score) for one in found.shown.outages]


@thorough
@given(curves())
def test_curves(curve: AllanCurve | Spectrum | Correlogram) -> None:
    channels = stored(curves_json([curve]))["channels"]
    assert list(channels) == list(curve.axes)
    name, values = (
        ("deviation", curve.deviation())
        if isinstance(curve, AllanCurve)
        else ("density", curve.density)
        if isinstance(curve, Spectrum)
        else ("value", curve.value)
    )
    for axis, column in zip(curve.axes, values.T, strict=True):
        assert same(np.array(channels[axis][name], dtype=float), column)


def example() -> Identification:
    coefficient = Coefficient(1e-3, (1e-4, math.inf), None, "rad/s^0.5")
    unknown = Coefficient(None, None, None, "rad/s")
    white = TERMS["white"](1e-3)
    channel = ChannelIdentification(
        axis="gyro_x",
        unit="rad/s",
        interval=0.01,
        span=10.0,
        method="likelihood",
        model=NoiseModel((white,)),
        terms=(TermEstimate("white", {"density": coefficient}),),
        parameters=(),
        covariance=np.zeros((0, 0)),
        mean=unknown,
        sigma_10s=unknown,
        minimum=unknown,
        floor=unknown,
        minimum_tau=math.nan,
        allan=AllanCurve(
            "oadev", np.array([1.0]), np.array([[1e-6]]), np.array([[9.0]]), "rad/s", ("gyro_x",)
        ),
    )
    return Identification({}, {"gyro_x": channel})


def test_what_an_older_document_lacks_follows_from_the_rest() -> None:
    content = stored(identification_json(example()))
    for later in ("interval_s", "model"):
        del content["channels"]["gyro_x"][later]
    del content["notes"]
    assert same(load_identification(content, source="a.json"), example())


@pytest.mark.parametrize(
    ("break_it", "message"),
    [
        (lambda c: c.update(schema="tuner.curve/1"), "a.json: schema: expected 'tuner.identification/1'"),
        (lambda c: c["channels"]["gyro_x"].pop("mean"), "a.json: channels.gyro_x: expected a key 'mean'"),
        (
            lambda c: c["channels"]["gyro_x"]["terms"].update(whte={}),
            "a.json: channels.gyro_x.terms: expected terms among quantization, white",
        ),
        (
            lambda c: c["channels"]["gyro_x"]["model"].update(white={"density": -1.0}),
            "a.json: channels.gyro_x.model: 'density' must be positive, got -1.0",
        ),
        (
            lambda c: c["channels"]["gyro_x"]["parameters"].append("white.density"),
            "a.json: channels.gyro_x.log_covariance: expected 1 × 1 numbers, got 0",
        ),
    ],
)
def test_a_bad_identification_is_refused_with_the_place(break_it: Any, message: str) -> None:
    content = stored(identification_json(example()))
    break_it(content)
    with pytest.raises(DataError) as caught:
        load_identification(content, source="a.json")
    assert message in str(caught.value)
    assert str(caught.value).endswith("; write the file anew with 'tuner identify LOG --json FILE'")
