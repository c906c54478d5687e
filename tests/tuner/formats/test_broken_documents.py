"""Whatever one entry of a stored document is replaced by, it is read or refused in one line, never with a traceback."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.formats.configuration import config_json, load_config
from tuner.formats.documents import json_text
from tuner.formats.identification import identification_json, load_identification
from tuner.synthesis import synthesize
from tuner.types.records import DataError

IDENTIFICATION = grade_identification(load_grade("mpu9250"))
CONFIG = synthesize(IDENTIFICATION, gnss=load_gnss("rtk"), seed=0)
DOCUMENTS: dict[str, tuple[dict[str, Any], Callable[..., object]]] = {
    "identification": (identification_json(IDENTIFICATION), load_identification),
    "configuration": (config_json(CONFIG), load_config),
}

plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=4,
)


@settings(max_examples=250, deadline=None, derandomize=True)
@given(st.sampled_from(list(DOCUMENTS)), st.data())
def test_one_wrong_entry(name: str, data: st.DataObject) -> None:
    content, read = DOCUMENTS[name]
    content = copy.deepcopy(json.loads(json_text(content)))
    node: Any = content
    while True:
        keys = list(node) if isinstance(node, dict) else range(len(node))
        key = data.draw(st.sampled_from(keys))
        if isinstance(node[key], dict | list) and node[key] and data.draw(st.integers(0, 5)):
            node = node[key]
        else:
            break
    if isinstance(node, dict) and data.draw(st.booleans()):
        del node[key]
    else:
        node[key] = data.draw(plain)
    refused = ""
    try:
        read(content, source="a.json")
    except DataError as error:
        refused = str(error)
    assert refused.startswith("a.json: ") or not refused
    assert "\n" not in refused


DENSITY = {"value": 1.0, "interval": [2.0, 3.0], "upper": None, "unit": "rad/s^0.5"}


@pytest.mark.parametrize(
    ("mistake", "refusal"),
    [
        ({"unit": "deg/s"}, r"gyro_x\.unit: expected 'rad/s' or 'm/s\^2', got 'deg/s'"),
        (
            {"identified": [{"term": "white", "density": DENSITY}]},
            r"identified\[0\]\.density\.value: expected a number within its interval, 2 to 3, got 1",
        ),
    ],
)
def test_units_and_intervals_that_contradict_are_refused(mistake: dict[str, Any], refusal: str) -> None:
    """`export` wrote 1719 deg/√h for (0.423 … 0.426), and took deg/s for m/s²."""
    content = json.loads(json_text(config_json(CONFIG)))
    content["sensors"]["gyro"]["gyro_x"] |= mistake
    with pytest.raises(DataError, match=refusal):
        load_config(content, source="a.yaml")
