"""What a public function is given is what its annotations say, or is refused in one line before it begins."""

from __future__ import annotations

import functools
import inspect
import math
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, ParamSpec, TypeVar, Union, cast, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike

from tuner.types.arguments import described, fault
from tuner.types.number_ranges import Limits
from tuner.types.records import DataError

P = ParamSpec("P")
R = TypeVar("R")

LONGEST_NAME, LONGEST_PATH = 255, 4096
"""Bytes of the name of a file, and of a path, beyond which no usual system takes one."""
WORDS: Mapping[Any, tuple[str, str]] = {
    float: ("a number", "numbers"),
    int: ("a whole number", "whole numbers"),
    bool: ("True or False", "True or False"),
    str: ("a text", "texts"),
    Path: ("a path", "paths"),
    NoneType: ("None", "None"),
    ArrayLike: ("an array of real numbers", "arrays of real numbers"),
    Any: ("anything", "anything"),
    object: ("a table or the name of a file", "tables or names of files"),
}
"""What a value of a type is, in words: one, and several."""
MADE_BY: Mapping[str, str] = {
    "Record": "tuner.read",
    "Identification": "tuner.identify",
    "FilterConfig": "tuner.synthesize",
    "Drive": "tuner.readers.drive.read_drive",
    "SensorGrade": "tuner.catalogue.grades.load_grade",
    "GnssNoise": "tuner.catalogue.grades.load_gnss",
}
"""What makes the results that other functions take."""


def public(verb: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Refuse arguments that the annotations of the decorated function do not allow.

    Numbers must be finite, within the `Limits` of their annotation, and no booleans; texts not blank; names of files
    possible. Defaults are not judged. A parameter whose annotation is imported for type checks alone is left to the
    function, but for names of files.

    Parameters
    ----------
    verb : str
        Name of the function, as its users know it.

    Raises
    ------
    DataError
        By the function: verb, parameter, expected, found.
    TypeError
        By the function: an argument is missing, or it has none of that name.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(function)
        hints = functools.cache(lambda: _hints(inspect.unwrap(function)))

        @functools.wraps(function)
        def inner(*args: P.args, **kwargs: P.kwargs) -> R:
            try:
                given = signature.bind(*args, **kwargs).arguments
            except TypeError as error:
                raise TypeError(f"{verb}: {error}") from None
            for name in given.keys() & hints().keys():
                parameter, hint = signature.parameters[name], hints()[name]
                several = parameter.kind is inspect.Parameter.VAR_POSITIONAL
                for value in given[name] if several else (given[name],):
                    if value is not parameter.default and not fits(value, hint):
                        raise DataError(
                            f"{verb}: {name}: expected {in_words(hint)}, found {described(value)}"
                        )
            return function(*args, **kwargs)

        return inner

    return decorate


def _hints(function: Callable[..., Any]) -> dict[str, Any]:
    """Return the annotations of a function, but for keywords that it passes on; `object` for those of type checks."""
    found: dict[str, Any] = {}
    for name, parameter in inspect.signature(function).parameters.items():
        if parameter.kind is not inspect.Parameter.VAR_KEYWORD:
            found[name] = object
            with suppress(NameError):
                found[name] = eval(parameter.annotation, function.__globals__)
    return found


def fits(value: object, hint: Any) -> bool:
    """Return whether a value, with all that it holds, is what an annotation says."""
    kind, inside = get_origin(hint) or hint, get_args(hint)
    if hint is Any:
        return True
    if hint is object:
        return not isinstance(value, str | Path) or _is_possible(str(value))
    if hint == ArrayLike:
        return _is_array(value)
    if kind in (Union, UnionType):
        return any(fits(value, one) for one in inside)
    if kind is Annotated:
        limits = [one for one in inside[1:] if isinstance(one, Limits)]
        return fits(value, inside[0]) and all(one.allow(float(cast(Any, value))) for one in limits)
    if kind is Literal:
        return isinstance(value, str) and value in inside
    if kind in (float, int):
        kinds = int | np.integer if kind is int else int | np.integer | float | np.floating
        return isinstance(value, kinds) and not isinstance(value, bool) and _is_finite(value)
    if kind in (str, Path):
        return isinstance(value, kind) and _is_possible(str(value))
    if kind is bool:
        return isinstance(value, bool | np.bool_)
    if kind is Callable:
        return callable(value)
    if inside and issubclass(kind, Mapping):
        pairs = value.items() if isinstance(value, Mapping) else [()]
        return all(len(pair) == 2 and all(map(fits, pair, inside)) for pair in pairs)
    if inside and issubclass(kind, Sequence):
        return _is_sequence(value) and all(fits(one, inside[0]) for one in cast(Any, value))
    return isinstance(value, kind) and not fault(value)


def in_words(hint: Any, *, several: bool = False) -> str:
    """Return what an annotation allows, in words: ``a text, a path or None``."""
    kind, inside = get_origin(hint) or hint, get_args(hint)
    if hint in WORDS:
        return WORDS[hint][several]
    if kind in (Union, UnionType):
        return _either([in_words(one, several=several) for one in inside])
    if kind is Annotated:
        limits = [one.words for one in inside[1:] if isinstance(one, Limits)]
        return limits[0] if limits and not several else in_words(inside[0], several=several)
    if kind is Literal:
        return _either([repr(one) for one in inside])
    if kind is Callable:
        return "a function"
    if inside and issubclass(kind, Mapping):
        return f"a mapping of {in_words(inside[0], several=True)} to {in_words(inside[1], several=True)}"
    if inside and issubclass(kind, Sequence):
        return f"a list of {in_words(inside[0], several=True)}"
    name = str(kind.__name__)
    article = "" if several else "an " if name[0] in "AEIOU" else "a "
    return article + name + (f" (of {MADE_BY[name]})" if name in MADE_BY else "")


def _either(words: Sequence[str]) -> str:
    *first, last = dict.fromkeys(words)
    return f"{', '.join(first)} or {last}" if first else last


def _is_finite(number: float | np.number[Any]) -> bool:
    try:
        return math.isfinite(number)
    except OverflowError:
        return False


def _is_array(value: object) -> bool:
    """Return whether a value is an array of real numbers, or becomes one."""
    try:
        return np.asarray(value).dtype.kind in "iuf"
    except (ValueError, TypeError):
        return False


def _is_sequence(value: object) -> bool:
    """Return whether a value is a list, tuple or array of one dimension; texts and bytes are none."""
    several = isinstance(value, Sequence) or getattr(value, "ndim", 0) == 1
    return several and not isinstance(value, str | bytes | bytearray | memoryview)


def _is_possible(text: str) -> bool:
    """Return whether a text is not blank, and a file could have it as its name."""
    try:
        path = os.fsencode(text)
    except UnicodeEncodeError:  # half of a character
        return False
    longest = max(map(len, path.split(b"/")))
    return bool(text.strip()) and "\0" not in text and len(path) <= LONGEST_PATH and longest <= LONGEST_NAME
