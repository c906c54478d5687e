"""JSON and YAML text to plain values, refused in one line where it cannot be parsed, and plain values to JSON text."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from tuner.types.records import DataError


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
        msg = f"{source}: expected JSON, got {begin}{error.msg} in line {error.lineno}, column {error.colno}"
        raise DataError(msg) from None


def parse_yaml(text: str, *, source: str, expected: str) -> Any:
    """Return the content of a YAML text, or refuse it with what was expected and the place of the mistake."""
    try:
        return yaml.safe_load(text)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        place = "" if mark is None else f" in line {mark.line + 1}, column {mark.column + 1}"
        found = f"{error.problem}{place}"
    except (yaml.YAMLError, ValueError) as error:
        found = " ".join(str(error).split())
    msg = f"{source}: expected {expected}, got {found}"
    raise DataError(msg)


def read_text(path: Path, *, expected: str) -> str:
    """Return the text of a file, or refuse what is no readable UTF-8."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        msg = f"{path}: expected {expected}, got {error}"
        raise DataError(msg) from None


def parse_format(text: str, *, source: str, expected_format: str) -> Any:
    """Return the content of a YAML text whose entry ``format`` must be as expected."""
    content = parse_yaml(text, source=source, expected=f"YAML of format {expected_format}")
    stated = content.get("format") if isinstance(content, dict) else None
    if stated != expected_format:
        found = "none" if stated is None else repr(stated)
        msg = f"{source}: expected a line 'format: {expected_format}', got {found}"
        raise DataError(msg)
    return content
