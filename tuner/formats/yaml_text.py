"""YAML text with comments, which PyYAML cannot write.

A tree of mappings, lists and scalars becomes block text; `Noted` adds a comment to an entry and `Inline`
keeps a mapping or list on one line. Floats are written so that reading gives the same number.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

_PLAIN = re.compile(r"[A-Za-z_](?:[A-Za-z0-9_./ ()^*-]*[A-Za-z0-9_./()^*-])?")
_RESERVED = frozenset({"true", "false", "null", "yes", "no", "on", "off", "y", "n"})


@dataclass(frozen=True)
class Noted:
    """A value with a comment behind it."""

    value: Any
    note: str


@dataclass(frozen=True)
class Inline:
    """A mapping or list on one line."""

    value: Any


def yaml_text(tree: Mapping[str, Any], *, header: Sequence[str] = ()) -> str:
    """Return a tree as YAML.

    Parameters
    ----------
    tree : mapping
        Mappings, lists, tuples, str, bool, int, float, None; any of them within `Noted` or `Inline`.
    header : sequence of str
        Comment lines before the text.
    """
    return "".join(f"{line}\n" for line in (*(comment(line) for line in header), *_block(tree, "")))


def comment(text: str) -> str:
    """Return a comment line; line breaks become spaces."""
    return f"# {' '.join(text.split())}".rstrip()


def scalar(value: Any) -> str:
    """Return a scalar as YAML that reads back equal."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return _float(float(value))
    return _string(str(value))


def _float(value: float) -> str:
    text = repr(value)
    if "e" in text and "." not in text:
        text = text.replace("e", ".0e")
    return {"inf": ".inf", "-inf": "-.inf", "nan": ".nan"}.get(text, text)


def _string(value: str) -> str:
    if _PLAIN.fullmatch(value) and value.lower() not in _RESERVED:
        return value
    quoted = json.dumps(value, ensure_ascii=False)
    return "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in quoted)


def _flow(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_string(str(k))}: {_flow(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_flow(v) for v in value) + "]"
    return scalar(value)


def _block(tree: Any, indent: str) -> Iterator[str]:
    if isinstance(tree, Mapping):
        for key, value in tree.items():
            yield from _entry(f"{indent}{_string(str(key))}:", value, indent)
    else:
        for value in tree:
            yield from _element(value, indent)


def _entry(lead: str, value: Any, indent: str) -> Iterator[str]:
    note = ""
    if isinstance(value, Noted):
        note, value = f"  {comment(value.note)}", value.value
    if isinstance(value, Mapping | list | tuple) and value:
        yield lead + note
        yield from _block(value, indent + "  ")
    else:
        yield f"{lead} {_flow(value.value if isinstance(value, Inline) else value)}{note}"


def _element(value: Any, indent: str) -> Iterator[str]:
    bare = value.value if isinstance(value, Noted) else value
    if isinstance(bare, Mapping) and bare:
        lines = list(_block(bare, indent + "  "))
        yield f"{indent}- {lines[0][len(indent) + 2 :]}"
        yield from lines[1:]
    else:
        yield from _entry(f"{indent}-", value, indent)
