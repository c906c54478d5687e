"""Reads the numbers of an export as the program that takes it does: YAML, JSON, XML, parameters, Python, MATLAB."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import Any

import yaml


def from_yaml(text: str, *place: str) -> Mapping[str, Any]:
    """Return the mapping at a place of a YAML document, OpenCV's head line or not."""
    found = yaml.safe_load(text.removeprefix("%YAML:1.0\n"))
    for key in place:
        found = found[key]
    return found


def from_json(text: str, *place: str) -> Mapping[str, Any]:
    """Return the mapping at a place of a JSON document."""
    found = json.loads(text)
    for key in place:
        found = found[key]
    return found


def from_parameters(text: str) -> dict[str, float]:
    """Return NAME -> value of ``NAME,VALUE`` or of QGroundControl's tab-separated lines."""
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    split = [line.split("\t")[2:4] if "\t" in line else line.split(",") for line in lines]
    return {name: float(value) for name, value in split}


def from_assignments(text: str) -> dict[str, list[float]]:
    """Return name -> numbers of assignments of vectors in Python or MATLAB, or of calls with one vector."""
    found = re.findall(r"(\w+)\W+?(?:np\.\w+\()?\[(.*?)\]", text)
    return {name: [float(x) for x in row.split(",")] for name, row in found}


def from_ini(text: str) -> dict[str, float]:
    """Return key -> third word of a line, as GINav takes it."""
    lines = [line.split() for line in text.splitlines() if not line.startswith("#")]
    return {words[0]: float(words[2]) for words in lines}


def from_xml(text: str, place: str) -> dict[str, float]:
    """Return tag -> value of the children of an element."""
    root = ET.fromstring(text)
    element = root if place == "." else root.find(place)
    assert element is not None
    return {child.tag: float(child.text or "nan") for child in element}
