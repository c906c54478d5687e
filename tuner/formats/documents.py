"""JSON and YAML text to plain values, refused in one line where it cannot be parsed, and plain values to JSON text."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from tuner.formats.guard import reason
from tuner.types.records import DataError

MAX_TEXT_BYTES = 1 << 27
"""Size of a JSON or YAML document: results of many axes have some megabytes."""
MAX_YAML_DEPTH = 50
"""Lists and mappings within one another: our own documents have 8."""
MAX_YAML_NODES = 1_000_000
"""Entries of a YAML document, each reference counted as what it refers to."""


def json_text(content: Mapping[str, Any]) -> str:
    """Return `content` as JSON text; NaN and infinities become null, arrays become lists."""
    return json.dumps(plain(content), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def plain(value: Any) -> Any:
    """Return nested values as lists and Python's own numbers, with null for NaN and infinity."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [plain(v) for v in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def parse_json(text: str, *, source: str) -> Any:
    """Return the content of a JSON text, or refuse it with the place of the mistake."""
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        begin = f"{text[:40]!r}: " if "\n" not in text else ""
        raise DataError(
            f"{source}: expected JSON, got {begin}{error.msg} in line {error.lineno}, column {error.colno}"
        ) from None
    except (ValueError, RecursionError) as error:
        found = "lists or mappings nested too deeply" if isinstance(error, RecursionError) else reason(error)
        raise DataError(f"{source}: expected JSON, got {found}") from None


def parse_yaml(text: str, *, source: str, expected: str) -> Any:
    """Return the content of a YAML text, or refuse it with what was expected and the place of the mistake."""
    try:
        return _yaml_content(text)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        place = "" if mark is None else f" in line {mark.line + 1}, column {mark.column + 1}"
        found = f"{error.problem}{place}"
    except RecursionError:
        found = "lists or mappings nested too deeply"
    except Exception as error:  # PyYAML's constructors raise many kinds
        found = reason(error)
    raise DataError(f"{source}: expected {expected}, got {found}")


class _Loader(yaml.SafeLoader):
    """Reads YAML without dates: what looks like one is text."""


_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in known if tag != "tag:yaml.org,2002:timestamp"]
    for first, known in yaml.SafeLoader.yaml_implicit_resolvers.items()
}


def _yaml_content(text: str) -> Any:
    """Return the content of a YAML text; one that refers to itself, or grows by references, is refused."""
    loader = _Loader(text)
    try:
        node = loader.get_single_node()
        if node is None:
            return None
        _count_nodes(node, {}, set())
        return loader.construct_document(node)
    finally:
        loader.dispose()


def _count_nodes(node: yaml.Node, known: dict[int, int], above: set[int]) -> int:
    """Return how many nodes a node stands for, each reference counted as what it refers to."""
    if id(node) in known:
        return known[id(node)]
    if id(node) in above:
        raise ValueError("an entry that contains itself")
    if len(above) > MAX_YAML_DEPTH:
        raise RecursionError
    members: list[yaml.Node] = []
    if isinstance(node, yaml.SequenceNode):
        members = node.value
    elif isinstance(node, yaml.MappingNode):
        members = [part for pair in node.value for part in pair]
        names = [key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
        if len(set(names)) < len(names):
            twice = next(name for at, name in enumerate(names) if name in names[:at])
            raise ValueError(
                f"the entry {twice!r} twice, in the block from line {node.start_mark.line + 1} on"
            )
    count = 1 + sum(_count_nodes(member, known, above | {id(node)}) for member in members)
    if count > MAX_YAML_NODES:
        raise ValueError(f"more than {MAX_YAML_NODES} entries, references counted")
    known[id(node)] = count
    return count


def read_text(path: Path, *, expected: str) -> str:
    """Return the text of a file, or refuse what is no readable UTF-8."""
    try:
        if path.stat().st_size > MAX_TEXT_BYTES:
            raise DataError(
                f"{path}: expected {expected}, got {path.stat().st_size} bytes, more than {MAX_TEXT_BYTES}"
            )
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise DataError(f"{path}: no such file") from None
    except OSError as error:
        raise DataError(
            f"{path}: expected {expected}, found what cannot be read: {error.strerror or reason(error)}"
        ) from None
    except ValueError as error:
        if isinstance(error, DataError):
            raise
        raise DataError(f"{path}: expected {expected}, got {reason(error)}") from None


def parse_format(text: str, *, source: str, expected_format: str) -> Any:
    """Return the content of a YAML text whose entry ``format`` must be as expected."""
    content = parse_yaml(text, source=source, expected=f"YAML of format {expected_format}")
    stated = content.get("format") if isinstance(content, dict) else None
    if stated != expected_format:
        found = "none" if stated is None else repr(stated)
        raise DataError(f"{source}: expected a line 'format: {expected_format}', got {found}")
    return content
