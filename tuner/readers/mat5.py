"""MAT files of version 5 to 7: numeric arrays, structs and texts, with every size checked before it is used.

SciPy's reader ends the process on some damaged files, so that the elements are walked here. Objects, functions, sparse
arrays and whatever is damaged within a variable are left out.

Source: MAT-File Format, The MathWorks, R2023b, chapter 1 (facts only).
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tuner.types.records import DataError

HEADER_BYTES = 128
"""Length of the header: 116 of text, 8 of subsystem, 2 of version, 2 of byte order."""
MAX_DEPTH = 16
"""Structs within structs that are followed."""
MAX_ELEMENTS = 100_000
"""Elements of structs and cells in a file that are followed."""
MAX_EXPANSION, FREE_BYTES = 200, 1 << 28
"""Decompressed ÷ compressed that a variable of more than `FREE_BYTES` may have: measured samples stay below 20."""
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_MATRIX_TYPE, _COMPRESSED_TYPE = 14, 15
_STRUCT_CLASS, _CHAR_CLASS, _NUMBER_CLASSES = 2, 4, frozenset(range(6, 16))
_CLASS_TYPES = {
    6: "f8",
    7: "f4",
    8: "i1",
    9: "u1",
    10: "i2",
    11: "u2",
    12: "i4",
    13: "u4",
    14: "i8",
    15: "u8",
}
_TEXT_CODECS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}


class _DamagedError(Exception):
    """An element that is not what its tag says."""


@dataclass
class _Walk:
    """Byte order of a file, and how many elements were followed so far."""

    order: str
    count: int = 0


def read_mat5(data: bytes, *, source: str) -> Iterator[tuple[str, NDArray[np.generic] | str]]:
    """Yield name and value of each numeric array and text; fields of structs are named ``imu/gyro``.

    Raises
    ------
    DataError
        A header that is none, or a file that breaks off in the middle of a variable.
    """
    if len(data) < HEADER_BYTES or data[126:128] not in (b"IM", b"MI"):
        raise DataError(
            f"{source}: cannot be read as a MAT file: expected a header of 128 bytes that ends in IM or MI"
        )
    walk = _Walk("<" if data[126:128] == b"IM" else ">")
    place = HEADER_BYTES
    while place + 8 <= len(data):
        kind, size = (int(n) for n in np.frombuffer(data, walk.order + "u4", 2, place))
        if kind not in (_MATRIX_TYPE, _COMPRESSED_TYPE) or place + 8 + size > len(data):
            raise DataError(
                f"{source}: cannot be read as a MAT file: expected a variable of {size} bytes at byte {place}, got "
                f"kind {kind} and {len(data) - place - 8} bytes; was the file cut off? save it anew"
            )
        body = data[place + 8 : place + 8 + size]
        place += 8 + size
        try:
            if kind == _COMPRESSED_TYPE:
                inner = _decompressed(body)
                if len(inner) < 8 or int(np.frombuffer(inner, walk.order + "u4", 1)[0]) != _MATRIX_TYPE:
                    continue
                body = inner[8:]
            yield from _matrix(body, "", walk, 0)
        except (_DamagedError, zlib.error, ValueError, UnicodeError):
            continue


def _decompressed(body: bytes) -> bytes:
    most = max(FREE_BYTES, MAX_EXPANSION * len(body))
    stream = zlib.decompressobj()
    inner = stream.decompress(body, most)
    if stream.unconsumed_tail:
        raise _DamagedError
    return inner


def _element(body: bytes, place: int, walk: _Walk) -> tuple[int, bytes, int]:
    """Return type and content of the element at a place, and the place behind it."""
    if place + 8 > len(body):
        raise _DamagedError
    kind, size = (int(n) for n in np.frombuffer(body, walk.order + "u4", 2, place))
    if kind >> 16:  # small element: size and type share a word, the content follows at once
        kind, size, start, behind = kind & 0xFFFF, kind >> 16, place + 4, place + 8
        if size > 4:
            raise _DamagedError
    else:
        start, behind = place + 8, place + 8 + size + (-size % 8 if kind != _COMPRESSED_TYPE else 0)
    if start + size > len(body):
        raise _DamagedError
    return kind, body[start : start + size], behind


def _matrix(
    body: bytes, prefix: str, walk: _Walk, depth: int
) -> Iterator[tuple[str, NDArray[np.generic] | str]]:
    """Yield what a matrix element holds."""
    walk.count += 1
    if not body:
        return
    if depth > MAX_DEPTH or walk.count > MAX_ELEMENTS:
        raise _DamagedError
    kind, flags, place = _element(body, 0, walk)
    if kind != 6 or len(flags) != 8:
        raise _DamagedError
    word = int(np.frombuffer(flags, walk.order + "u4", 1)[0])
    content, is_complex = word & 0xFF, bool(word & 0x800)
    kind, dimensions, place = _element(body, place, walk)
    shape = tuple(int(n) for n in np.frombuffer(dimensions, walk.order + "i4"))
    if kind != 5 or not 2 <= len(shape) <= 8 or min(shape) < 0:
        raise _DamagedError
    _, raw_name, place = _element(body, place, walk)
    name = prefix or raw_name.decode("latin-1")
    count = math.prod(shape)
    if content in _NUMBER_CLASSES and not is_complex:
        kind, numbers, _ = _element(body, place, walk)
        if kind not in _TYPES:
            raise _DamagedError
        found = np.frombuffer(numbers, walk.order + _TYPES[kind])
        if len(found) != count:
            raise _DamagedError
        yield name, found.astype(_CLASS_TYPES[content]).reshape(shape, order="F")
    elif content == _CHAR_CLASS:
        kind, text, _ = _element(body, place, walk)
        if kind not in _TEXT_CODECS:
            raise _DamagedError
        codec = _TEXT_CODECS[kind]
        ordered = f"{codec}-{'le' if walk.order == '<' else 'be'}" if codec in ("utf-16", "utf-32") else codec
        yield name, text.decode(ordered, errors="replace")
    elif content == _STRUCT_CLASS:
        yield from _struct(body, place, name, count, walk, depth)


def _struct(
    body: bytes, place: int, name: str, count: int, walk: _Walk, depth: int
) -> Iterator[tuple[str, NDArray[np.generic] | str]]:
    """Yield the fields of a single struct; arrays of structs are left out."""
    _, length, place = _element(body, place, walk)
    _, names, place = _element(body, place, walk)
    width = int(np.frombuffer(length, walk.order + "i4", 1)[0]) if len(length) >= 4 else 0
    if width <= 0 or count != 1:
        return
    for start in range(0, len(names), width):
        field = names[start : start + width].split(b"\0")[0].decode("latin-1")
        kind, inner, place = _element(body, place, walk)
        if kind != _MATRIX_TYPE:
            raise _DamagedError
        yield from _matrix(inner, f"{name}/{field}", walk, depth + 1)
