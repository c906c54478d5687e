"""The codec gives every dataclass back, and refuses a bad document with the place of its first mistake."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from tuner.formats.codec import dump, load, refuse_unknown_keys
from tuner.formats.documents import json_text, parse_json, parse_yaml
from tuner.formats.noise_terms import coefficient_json
from tuner.types import Coefficient
from tuner.types.number_ranges import NonNegative, Positive
from tuner.types.records import DataError


@refuse_unknown_keys
@dataclass(frozen=True)
class Inner:
    sd: NonNegative
    axes: tuple[Positive, Positive] | None = None


@dataclass(frozen=True)
class Document:
    name: str
    rate: Positive
    limits: tuple[float, float]
    parts: Mapping[str, tuple[Inner, ...]]
    table: NDArray[np.float64]
    figure: float = 1.0
    white: bool = False


GOOD = {
    "name": "a",
    "rate": "1e2",
    "limits": [0.5, None],
    "parts": {"x": [{"sd": 0.0}, {"sd": 1, "axes": [1.0, 2.0]}]},
    "table": [[1.0, None], [3, 4]],
    "figure": None,
    "later": "a key of a later version",
}


def test_values_are_read_by_their_types() -> None:
    found = load(GOOD, Document, source="mine.yaml")
    assert found.rate == 100.0
    assert found.limits == (0.5, math.inf)
    assert found.parts == {"x": (Inner(0.0), Inner(1.0, (1.0, 2.0)))}
    assert found.figure == 1.0
    np.testing.assert_array_equal(found.table, [[1.0, np.nan], [3.0, 4.0]])


def test_nan_and_infinity_never_appear() -> None:
    found = load({**GOOD, "figure": 2.0}, Document, source="mine.yaml")
    content = json.loads(json_text(dump(found)))
    assert content["limits"] == [0.5, None]
    assert content["table"] == [[1.0, None], [3.0, 4.0]]
    assert dump(load(content, Document, source="again")) == content


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rate": -1}, "mine.yaml: rate: expected a positive number, got -1"),
        ({"rate": True}, "mine.yaml: rate: expected a positive number, got true"),
        ({"rate": None}, "mine.yaml: rate: expected a positive number, got null"),
        ({"name": 3}, "mine.yaml: name: expected text, got 3"),
        ({"white": "yes"}, "mine.yaml: white: expected true or false, got 'yes'"),
        ({"limits": [1]}, "mine.yaml: limits: expected 2 numbers, got [1]"),
        ({"limits": [1, "x"]}, "mine.yaml: limits: expected a number or null, got 'x'"),
        ({"table": [[1], [2, 3]]}, "mine.yaml: table: expected numbers in lists of equal length"),
        ({"table": 3}, "mine.yaml: table: expected a list of numbers, got 3"),
        ({"parts": []}, "mine.yaml: parts: expected a mapping, got []"),
        ({"parts": {"x": {}}}, "mine.yaml: parts.x: expected a list, got {}"),
        ({"parts": {"x": ["sd"]}}, "mine.yaml: parts.x[0]: expected a mapping, got 'sd'"),
        ({"parts": {"x": [{"sd": 1}, {"sd": -1}]}}, "parts.x[1].sd: expected a number not below 0, got -1"),
        ({"parts": {"x": [{"axes": None}]}}, "parts.x[0]: expected a key 'sd', got keys axes"),
        ({"parts": {"x": [{"sd": 1, "ds": 1}]}}, "parts.x[0]: expected keys among sd, axes, got 'ds'"),
        ({"parts": {"x": [{"sd": 1, "axes": [1, 2, 3]}]}}, "x[0].axes: expected 2 numbers, got [1, 2, 3]"),
        ({"parts": {"x": [{"sd": 1, "axes": [1, 0]}]}}, "x[0].axes[1]: expected a positive number, got 0"),
    ],
)
def test_a_bad_document_is_refused_with_the_place(change: dict[str, object], message: str) -> None:
    with pytest.raises(DataError) as caught:
        load({**GOOD, **change}, Document, source="mine.yaml", advice="correct it")
    assert message in str(caught.value)
    assert str(caught.value).startswith("mine.yaml: ")
    assert str(caught.value).endswith("; correct it")
    assert "\n" not in str(caught.value)


def test_what_is_no_mapping_is_refused_as_a_whole() -> None:
    with pytest.raises(DataError, match=r"^mine\.yaml: expected a mapping, got \[\]$"):
        load([], Document, source="mine.yaml")


def test_text_that_cannot_be_parsed_is_refused_with_line_and_column() -> None:
    with pytest.raises(DataError, match=r"^a\.json: expected JSON, got .* in line 2, column 1$"):
        parse_json("{\n", source="a.json")
    with pytest.raises(DataError, match=r"^a\.yaml: expected settings, got .* in line 1, column 5$"):
        parse_yaml("a: [", source="a.yaml", expected="settings")


def test_an_entry_that_stands_twice_is_refused() -> None:
    """The last of two limits was taken without a word."""
    with pytest.raises(DataError, match="the entry 'N' twice, in the block from line 2 on"):
        parse_yaml("gyro:\n  N: 1\n  B: 2\n  N: 3\n", source="a.yaml", expected="limits")


def test_a_coefficient_has_its_four_keys_and_a_reason_where_there_is_one() -> None:
    known = Coefficient(1.0, (0.5, math.inf), None, "s")
    assert coefficient_json(known) == {"value": 1.0, "interval": [0.5, None], "upper": None, "unit": "s"}
    assert load(coefficient_json(known), Coefficient, source="") == known
    bounded = Coefficient.bounded(2.0, "s", "absent")
    assert coefficient_json(bounded)["reason"] == "absent"
    assert load({"upper": 2.0, "unit": "s", "reason": "absent"}, Coefficient, source="") == bounded
