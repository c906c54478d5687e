"""Whatever one entry of a stored document is replaced by, it is read or refused in one line, never with a traceback."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.formats.configuration import config_json, load_config
from tuner.formats.diagnosis import diagnosis_json, load_diagnosis
from tuner.formats.documents import json_text
from tuner.formats.identification import identification_json, load_identification
from tuner.synthesis import synthesize
from tuner.types import (
    Alternative,
    Coefficient,
    Diagnosis,
    DriveDiagnosis,
    Enlargement,
    Finding,
    Gain,
    Quantity,
)
from tuner.types.records import DataError

IDENTIFICATION = grade_identification(load_grade("mpu9250"))
CONFIG = synthesize(IDENTIFICATION, gnss=load_gnss("rtk"), seed=0)
FINDING = Finding(
    cause="temperature",
    channels=("gyro_x",),
    statistic="slope",
    value=9.0,
    p_value=1e-6,
    parameters={"slope": Coefficient(1.0, (0.5, 1.5), None, "rad/s/K")},
    text="follows the temperature",
    gain=Gain("60/40", 1.0, 2.0, 3.0, {"psd": (0.1, 0.9)}, {"rms [m]": (2.0, 1.0)}),
    alternatives=(Alternative("ramp", 0.5),),
    inflations=(Enlargement(Quantity("gyro_x", "white_density"), 2.0, "because"),),
)
MODELS = {axis: channel.model for axis, channel in IDENTIFICATION.channels.items()}
DOCUMENTS: dict[str, tuple[dict[str, Any], Callable[..., object]]] = {
    "identification": (identification_json(IDENTIFICATION), load_identification),
    "configuration": (config_json(CONFIG), load_config),
    "diagnosis": (diagnosis_json(Diagnosis((FINDING,), models=MODELS)), load_diagnosis),
    "drive": (diagnosis_json(DriveDiagnosis((FINDING,), CONFIG, CONFIG)), load_diagnosis),
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
