"""Whatever bytes and whatever values: each reader and document gives a result or one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from fuzz.seeds import seeds
from fuzz.test_damage import outcome
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

FIXED = settings(
    max_examples=11,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=12),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)
CELLS = st.floats(width=32).map(repr) | st.integers(-(10**20), 10**20).map(str) | st.text(max_size=6)
NAMES = st.sampled_from(["t", "gyro_x", "gyro_y [deg/s]", "accel_z", "time_ms", "w", "", "a"]) | st.text(
    max_size=8
)
DOCUMENTS = [one for one in seeds() if one.name.endswith((".yaml", ".json"))]


def fine(found: str) -> bool:
    return found in ("read", "refused")


@pytest.mark.parametrize("one", seeds(), ids=lambda one: one.name)
@FIXED
@given(data=st.data())
def test_bytes(tmp_path: Path, one: Any, data: st.DataObject) -> None:
    head = data.draw(st.integers(0, 300))
    content = one.content[:head] + data.draw(st.binary(max_size=300))
    assert fine(outcome(one, content, tmp_path / one.name))


@pytest.mark.parametrize("one", DOCUMENTS, ids=lambda one: one.name)
@FIXED
@given(data=st.data())
def test_values_in_documents(tmp_path: Path, one: Any, data: st.DataObject) -> None:
    """A document whose one entry, at any depth, is another value; JSON is YAML, too."""
    import yaml

    content = yaml.safe_load(one.content)
    place = content
    while isinstance(place, dict | list) and place:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        key = data.draw(st.sampled_from(keys))
        if not isinstance(place[key], dict | list) or not place[key] or data.draw(st.integers(0, 3)) == 0:
            place[key] = data.draw(VALUES)
            break
        place = place[key]
    text = json.dumps(content, default=str)
    assert fine(outcome(one, text.encode("utf-8", errors="replace"), tmp_path / one.name))


@FIXED
@given(names=st.lists(NAMES, min_size=1, max_size=5), rows=st.lists(st.lists(CELLS, max_size=6), max_size=12))
def test_tables(tmp_path: Path, names: list[str], rows: list[list[str]]) -> None:
    (one,) = (seed for seed in seeds() if seed.name == "log.csv")
    text = "\n".join([",".join(names), *map(",".join, rows)])
    assert fine(outcome(one, text.encode("utf-8", errors="replace"), tmp_path / one.name))
