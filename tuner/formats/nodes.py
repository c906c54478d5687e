"""YAML documents whose errors say file, place, what was expected and what came.

`document` parses a text and checks its ``format`` line; a `Node` is a value that knows its place, so that
every reader of grades, datasheets and configurations fails with one clear line.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

import yaml

from tuner.types.records import DataError


@dataclass(frozen=True)
class Node:
    """A value of a parsed document and its place, such as ``mine.yaml: gnss.interval``."""

    value: Any
    place: str

    def __getitem__(self, key: str) -> Node:
        """Return an entry that must be there."""
        entries = self.mapping()
        if key not in entries:
            self.refuse(f"a key '{key}'", f"keys {', '.join(map(str, entries)) or 'none'}")
        return self.child(key)

    def get(self, key: str) -> Node | None:
        """Return an entry, or None where it is absent or null."""
        return self.child(key) if self.mapping().get(key) is not None else None

    def child(self, key: str) -> Node:
        """Return the entry of a mapping without a check."""
        separator = "." if ": " in self.place else ": "
        return Node(self.value[key], f"{self.place}{separator}{key}")

    def items(self) -> Iterator[tuple[str, Node]]:
        """Yield key and entry of a mapping."""
        for key in self.mapping():
            yield str(key), self.child(key)

    def elements(self) -> tuple[Node, ...]:
        """Return the elements of a list."""
        if not isinstance(self.value, list):
            self.refuse("a list", said(self.value))
        return tuple(Node(value, f"{self.place}[{i}]") for i, value in enumerate(self.value))

    def mapping(self) -> Mapping[str, Any]:
        """Return the value as a mapping."""
        if not isinstance(self.value, dict):
            self.refuse("a mapping", said(self.value))
        return self.value

    def number(self, *, positive: bool = False, signed: bool = True) -> float:
        """Return the value as a finite number; YAML reads ``1e-5`` as text, which is accepted."""
        expected = "a positive number" if positive else "a number" if signed else "a number not below 0"
        if isinstance(self.value, bool) or not isinstance(self.value, int | float | str):
            self.refuse(expected, said(self.value))
        try:
            number = float(self.value)
        except ValueError:
            self.refuse(expected, said(self.value))
        if not math.isfinite(number) or (positive and number <= 0.0) or (not signed and number < 0.0):
            self.refuse(expected, said(self.value))
        return number

    def numbers(self, count: int, *, positive: bool = False, signed: bool = True) -> tuple[float, ...]:
        """Return the value as so many numbers."""
        elements = self.elements()
        if len(elements) != count:
            self.refuse(f"{count} numbers", said(self.value))
        return tuple(element.number(positive=positive, signed=signed) for element in elements)

    def three(self, *, largest: float = math.inf) -> tuple[float, float, float]:
        """Return the value as three numbers, none of them larger."""
        if not isinstance(self.value, list) or len(self.value) != 3:
            self.refuse("three numbers, [x, y, z]", said(self.value))
        x, y, z = self.numbers(3)
        if max(abs(x), abs(y), abs(z)) > largest:
            self.refuse(f"three numbers up to {largest:g}", said(self.value))
        return x, y, z

    def text(self) -> str:
        """Return the value as text."""
        if not isinstance(self.value, str):
            self.refuse("text", said(self.value))
        return self.value

    def only(self, *allowed: str) -> None:
        """Refuse keys that are not known: a misspelt key would be lost in silence."""
        for key in self.mapping():
            if key not in allowed:
                self.refuse(f"keys among {', '.join(allowed)}", repr(key))

    def refuse(self, expected: str, got: str) -> NoReturn:
        """Raise the error that says what is wrong here."""
        msg = f"{self.place}: expected {expected}, got {got}"
        raise DataError(msg)


def said(value: object) -> str:
    """Return a value as a file has it."""
    words = {None: "null", True: "true", False: "false"}
    return words[value] if value is None or isinstance(value, bool) else repr(value)


def parsed(text: str, source: str, expected: str) -> Node:
    """Parse a YAML text, or refuse it with what was expected and the place of the mistake."""
    try:
        return Node(yaml.safe_load(text), source)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        place = "" if mark is None else f" in line {mark.line + 1}, column {mark.column + 1}"
        detail = f"{error.problem}{place}"
    except yaml.YAMLError as error:
        detail = " ".join(str(error).split())
    msg = f"{source}: expected {expected}, got {detail}"
    raise DataError(msg)


def document(text: str, source: str, expected_format: str) -> Node:
    """Parse a YAML text and check its ``format``.

    Parameters
    ----------
    text : str
        The document.
    source : str
        File name for messages.
    expected_format : str
        Such as ``tuner-noise/1``.

    Raises
    ------
    DataError
        Where it is not YAML, not a mapping, or of another format.
    """
    root = parsed(text, source, f"YAML of format {expected_format}")
    value = root.value
    if not isinstance(value, dict) or value.get("format") != expected_format:
        found = value.get("format") if isinstance(value, dict) else None
        root.refuse(f"a line 'format: {expected_format}'", "none" if found is None else repr(found))
    return root
