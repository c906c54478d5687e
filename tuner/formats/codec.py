"""Dataclasses to plain values and back: one codec for every JSON and YAML document of the project.

`dump` turns a dataclass into mappings, lists, numbers and text; `load` makes the dataclass again, or says in one line
which file, which place in it, what was expected and what was found. The keys of a document are the fields of a
dataclass. Where a document differs from the dataclass it stands for, `store` names a function that returns its entries,
or `stored_form`, of what is read again, another dataclass with the keys of the document.

Rules for numbers:

====================  ==============================================================================================
NaN                   null; a null number is read as NaN, where the field does not refuse it
interval (lo, hi)     an infinite end is null; YAML's ``.inf`` is read too
other infinities      null
array                 nested lists
number as text        ``1e-5``, which YAML 1.1 takes for text, is read as a number
====================  ==============================================================================================

An entry that is null or absent takes the default of its field; where there is no default and None is allowed, None.
Unknown keys are ignored, as later versions add some, except in documents written by hand (`refuse_unknown_keys`).
"""

from __future__ import annotations

import importlib
import math
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from enum import StrEnum
from functools import cache
from typing import (
    Annotated,
    Any,
    Literal,
    Protocol,
    Self,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import cattrs
import numpy as np
from cattrs.cols import is_mapping, mapping_structure_factory
from cattrs.gen import make_dict_structure_fn, override

from tuner.formats.document_errors import Mismatch, place, refuse, shown
from tuner.formats.documents import plain
from tuner.types.number_ranges import Finite, Limits, VectorLimits
from tuner.types.records import DataError

T = TypeVar("T")


class Form(Protocol):
    """A dataclass with the keys of a document, standing for another one."""

    @classmethod
    def of(cls, value: Any, /) -> Self:
        """Return the form of a value."""

    def restored(self) -> Any:
        """Return the value."""


F = TypeVar("F", bound=Form)


def dump(value: Any) -> Any:
    """Return a dataclass as plain values: mappings, lists, text, finite numbers, true, false and null."""
    return plain(_converter().unstructure(value))


def load(content: object, kind: type[T], *, source: str, advice: str = "") -> T:
    """Return the dataclass that plain values stand for.

    Parameters
    ----------
    content : object
        Plain values, as `tuner.formats.documents` returns them.
    kind : type
        The dataclass.
    source : str
        File name for messages.
    advice : str, optional
        What to do about a bad document, for messages.

    Raises
    ------
    DataError
        One line: file, place, expected, found and the advice.
    """
    try:
        return _converter().structure(content, kind)
    except RecursionError:
        line = f"{source}: expected a document, got one nested too deeply"
        raise DataError(f"{line}; {advice}" if advice else line) from None
    except Exception as error:  # hooks of a kind may divide, take roots and look up what the document has
        line = " ".join(_explained(error, content, source).split())
        raise DataError(f"{line}; {advice}" if advice else line) from None


def structured(content: object, kind: Any) -> Any:
    """Return the value of a part of a document, for hooks and forms: errors carry their place upwards."""
    return _converter().structure(content, kind)


def stored_form(kind: type[Any]) -> Callable[[type[F]], type[F]]:
    """Declare the decorated dataclass as the form in which documents have `kind`."""

    def declare(form: type[F]) -> type[F]:
        made: Any = form
        store(
            kind,
            dump=form.of,
            load=lambda content: _CONVERTER.structure(content, made).restored(),
        )
        return form

    return declare


def store(
    kind: Any,
    *,
    dump: Callable[[Any], Any] | None = None,
    load: Callable[[object], Any] | None = None,
) -> None:
    """Declare how documents hold `kind`, a class or a union, where that is not simply its fields.

    `dump` returns entries, which are dumped in turn; `load` gets plain values.
    """
    if dump is not None:
        _CONVERTER.register_unstructure_hook(kind, lambda value: _CONVERTER.unstructure(dump(value)))
    if load is not None:
        _CONVERTER.register_structure_hook(kind, lambda content, _: load(content))


def refuse_unknown_keys(kind: type[T]) -> type[T]:
    """Declare that a misspelt key of `kind` is refused; for documents that people write."""
    _CLOSED.add(kind)
    return kind


@cache
def _converter() -> cattrs.Converter:
    """Return the converter with all kinds declared; they are imported at the first use, as noise models load slowly."""
    importlib.import_module("tuner.formats.document_types")
    return _CONVERTER


def _explained(error: Exception, content: object, source: str) -> str:
    """Return the first mistake of a document in one line."""
    leaf, path = _first(error)
    if isinstance(leaf, KeyError) and path:
        *parent, key = path
        found = _at(content, parent)
        keys = ", ".join(map(str, found)) if isinstance(found, Mapping) and found else "none"
        return f"{place(source, parent)}: expected a key '{key}', got keys {keys}"
    if isinstance(leaf, cattrs.ForbiddenExtraKeysError):
        allowed = ", ".join(field.name for field in fields(leaf.cl))
        return f"{place(source, path)}: expected keys among {allowed}, got {min(leaf.extra_fields)!r}"
    if isinstance(leaf, Mismatch):
        path = (*path, *leaf.path)
    return f"{place(source, path)}: {leaf}"


def _first(
    error: BaseException, path: tuple[str | int, ...] = ()
) -> tuple[BaseException, tuple[str | int, ...]]:
    """Return the first error within nested ones, and the keys that lead to it."""
    for note in getattr(error, "__notes__", ()):
        if isinstance(note, cattrs.AttributeValidationNote):
            path = (*path, note.name)
        elif isinstance(note, cattrs.IterableValidationNote):
            path = (*path, note.index)
    if isinstance(error, cattrs.BaseValidationError):
        return _first(error.exceptions[0], path)
    return error, path


def _at(content: object, path: Sequence[str | int]) -> object:
    found: Any = content
    for step in path:
        found = found[step]
    return found


def _load_number(content: object, _: Any = None) -> float:
    if content is None:
        return math.nan
    return _number(content, "a number")


def _number(content: object, expected: str) -> float:
    if isinstance(content, bool) or not isinstance(content, int | float | str):
        refuse(expected, shown(content))
    try:
        number = float(content)
    except (ValueError, OverflowError):
        refuse(expected, shown(content))
    if not math.isfinite(number):
        refuse(expected, shown(content))
    return number


def _load_limited(content: object, kind: Any) -> float:
    limits: Limits = kind.__metadata__[0]
    number = _number(content, limits.words)
    if not limits.allow(number):
        refuse(limits.words, shown(content))
    return number


def _load_vector(content: object, kind: Any) -> Any:
    limits: VectorLimits = kind.__metadata__[0]
    if not isinstance(content, list | tuple) or len(content) != 3:
        refuse("three numbers, [x, y, z]", shown(content))
    vector = _CONVERTER.structure(content, tuple[Finite, Finite, Finite])
    if max(map(abs, vector)) > limits.largest:
        refuse(f"three numbers up to {limits.largest:g}", shown(content))
    return vector


def _load_interval(content: object, _: Any) -> tuple[float, float]:
    """Return both ends of an interval; null is an end without a limit."""
    if not isinstance(content, list | tuple) or len(content) != 2:
        refuse("2 numbers", shown(content))
    low, high = content
    return (
        -math.inf if low in (None, -math.inf) else _number(low, "a number or null"),
        math.inf if high in (None, math.inf) else _number(high, "a number or null"),
    )


def _load_exactly(kind: type[Any], words: str) -> Callable[[object, Any], Any]:
    def load(content: object, _: Any) -> Any:
        if not isinstance(content, kind) or (kind is int and isinstance(content, bool)):
            refuse(words, shown(content))
        return content

    return load


def _load_array(content: object, _: Any) -> Any:
    if not isinstance(content, list | tuple):
        refuse("a list of numbers", shown(content))
    try:
        return np.array(content, dtype=np.float64)
    except (TypeError, ValueError):
        refuse("numbers in lists of equal length", shown(content))


def _load_literal(content: object, kind: Any) -> Any:
    """Return a text that must be one of those a type names, such as the schema of a document."""
    names = get_args(kind)
    if content not in names:
        words = f"one of {', '.join(names)}" if len(names) > 2 else " or ".join(map(repr, names))
        refuse(words, shown(content))
    return content


def _load_enum(content: object, kind: Any) -> Any:
    """Return a member of an enumeration of texts."""
    names = [member.value for member in kind]
    if content not in names:
        refuse(f"one of {', '.join(names)}", shown(content))
    return kind(content)


def _is_enum(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, StrEnum)


def _is_literal(kind: Any) -> bool:
    return get_origin(kind) is Literal


def _is_array(kind: Any) -> bool:
    return kind is np.ndarray or get_origin(kind) is np.ndarray


def _is_tuple(kind: Any) -> bool:
    return get_origin(kind) is tuple


def _is_limited(kind: Any) -> bool:
    return get_origin(kind) is Annotated and isinstance(kind.__metadata__[0], Limits)


def _is_vector(kind: Any) -> bool:
    return get_origin(kind) is Annotated and isinstance(kind.__metadata__[0], VectorLimits)


def _tuple_factory(kind: Any) -> Callable[[object, Any], Any]:
    """Return the reader of a tuple: a list, of the stated length where there is one."""
    kinds = get_args(kind)
    endless = len(kinds) == 2 and kinds[1] is Ellipsis
    words = "a list" if endless else f"{len(kinds)} numbers"

    def load(content: object, _: Any) -> Any:
        if not isinstance(content, list | tuple) or (not endless and len(content) != len(kinds)):
            refuse(words, shown(content))
        members: list[Any] = []
        errors: list[Exception] = []
        for index, member in enumerate(content):
            of = kinds[0] if endless else kinds[index]
            try:
                members.append(_CONVERTER.structure(member, of))
            except Exception as error:
                error.add_note(cattrs.IterableValidationNote(f"member {index}", index, of))
                errors.append(error)
        if errors:
            raise cattrs.errors.IterableValidationError("members of a list", errors, kind)
        return tuple(members)

    return load


def _mapping_factory(kind: Any) -> Callable[[object, Any], Any]:
    """Return the reader of a mapping, which refuses what is none."""
    inner = mapping_structure_factory(kind, _CONVERTER)

    def load(content: object, _: Any) -> Any:
        if not isinstance(content, Mapping):
            refuse("a mapping", shown(content))
        return inner(content, kind)

    return load


def _dataclass_factory(kind: Any) -> Callable[[object, Any], Any]:
    """Return the reader of a dataclass: null entries take the default, or None where that is allowed."""
    hints = get_type_hints(kind, include_extras=True)
    hooks: dict[str, Any] = {f.name: override(struct_hook=_field_hook(hints[f.name])) for f in fields(kind)}
    inner = make_dict_structure_fn(kind, _CONVERTER, _cattrs_forbid_extra_keys=kind in _CLOSED, **hooks)
    optional = {field.name for field in fields(kind) if _allows_none(hints[field.name])}
    default = {f.name for f in fields(kind) if f.default is not MISSING or f.default_factory is not MISSING}

    def load(content: object, _: Any) -> Any:
        if not isinstance(content, Mapping):
            refuse("a mapping", shown(content))
        given = {k: v for k, v in content.items() if v is not None or k not in default}
        return inner(dict.fromkeys(optional - default) | given, kind)

    return load


def _field_hook(kind: Any) -> Callable[[object, Any], Any]:
    """Return the reader of a field; cattrs by itself leaves out what `Annotated` adds to a type."""
    return lambda content, _: _CONVERTER.structure(content, kind)


def _allows_none(kind: Any) -> bool:
    return get_origin(kind) in (Union, types.UnionType) and type(None) in get_args(kind)


_CLOSED: set[type[Any]] = set()
_CONVERTER = cattrs.Converter()
_CONVERTER.register_structure_hook_factory(is_dataclass, _dataclass_factory)
_CONVERTER.register_structure_hook_factory(is_mapping, _mapping_factory)
_CONVERTER.register_structure_hook_factory(_is_tuple, _tuple_factory)
_CONVERTER.register_structure_hook_func(lambda kind: kind == tuple[float, float], _load_interval)
_CONVERTER.register_structure_hook_func(_is_literal, _load_literal)
_CONVERTER.register_structure_hook_func(_is_enum, _load_enum)
_CONVERTER.register_structure_hook_func(_is_array, _load_array)
_CONVERTER.register_structure_hook_func(_is_limited, _load_limited)
_CONVERTER.register_structure_hook_func(_is_vector, _load_vector)
_CONVERTER.register_structure_hook(float, _load_number)
_CONVERTER.register_structure_hook(str, _load_exactly(str, "text"))
_CONVERTER.register_structure_hook(bool, _load_exactly(bool, "true or false"))
_CONVERTER.register_structure_hook(int, _load_exactly(int, "a whole number"))
_CONVERTER.register_unstructure_hook(np.ndarray, np.ndarray.tolist)
