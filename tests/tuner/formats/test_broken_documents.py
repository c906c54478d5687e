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
