"""The arrays of an NPZ archive, read one at a time, with every size checked before memory is taken."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from tuner.formats.guard import input_guard, reason
from tuner.readers.columns import FREE_BYTES, MAX_EXPANSION, StoredArray
from tuner.types.records import DataError

MAX_MEMBERS = 10_000
"""Arrays in one archive that are listed."""


def stored_arrays(path: Path) -> tuple[Mapping[str, StoredArray], Mapping[str, str]]:
    """Return the arrays of an archive by name, and what cannot be read with the reason.

    Members that are no arrays, are encrypted or damaged, or state a size that is not theirs stand among the second.

    Raises
    ------
    DataError
        What is no archive.
    """
    arrays: dict[str, StoredArray] = {}
    unread: dict[str, str] = {}
    if not zipfile.is_zipfile(path):
        raise DataError(
            f"{path}: cannot be read as NPZ: expected an archive of arrays, got something else or a part of one"
        )
    with input_guard(path, "NPZ, an archive of arrays"), zipfile.ZipFile(path) as archive:
        for member in archive.infolist()[:MAX_MEMBERS]:
            name = member.filename.removesuffix(".npy")
            if name == member.filename:
                unread[name] = "no array"
                continue
            try:
                arrays[name] = _stored(path, archive, member)
            except Exception as error:  # zipfile raises many kinds; one bad member does not spoil the others
                unread[name] = reason(error)
    return arrays, unread


def _stored(path: Path, archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> StoredArray:
    """Return an array whose header was read; refuse what its member cannot hold."""
    with archive.open(member) as file:
        shape, turned, dtype, begin = _header(file)
    if dtype.hasobject:
        raise ValueError("objects, not numbers")
    size = math.prod(shape) * dtype.itemsize
    if begin + size != member.file_size:
        raise ValueError(f"its header states {size} bytes, the archive {member.file_size - begin}")
    if size > max(FREE_BYTES, MAX_EXPANSION * member.compress_size):
        raise ValueError(f"{size} bytes packed into {member.compress_size}")

    def read() -> NDArray[Any]:
        with input_guard(f"{path}: {member.filename}", "an array"):
            with zipfile.ZipFile(path) as again, again.open(member) as file:
                file.read(begin)
                flat = np.frombuffer(file.read(size), dtype)
            return flat.reshape(shape, order="F" if turned else "C")

    def pieces(count: int, last: bool) -> Iterator[NDArray[Any]]:
        """Yield entries along an axis; the file is open as often as runs of them lie apart in it."""
        at = (len(shape) - 1) if last else 0
        whole = shape[at]
        along_file = turned == (at == len(shape) - 1) or len(shape) == 1
        runs = 1 if along_file else math.prod(shape) // max(whole, 1)
        across = math.prod(shape) // max(whole, 1) if along_file else 1
        with input_guard(f"{path}: {member.filename}", "an array"), ExitStack() as opened:
            files = []
            for run in range(runs):
                again = opened.enter_context(zipfile.ZipFile(path))
                file = opened.enter_context(again.open(member))
                file.seek(begin + run * whole * dtype.itemsize)
                files.append(file)
            for start in range(0, whole, count):
                n = min(count, whole - start)
                flat = [np.frombuffer(f.read(n * across * dtype.itemsize), dtype) for f in files]
                if any(len(part) != n * across for part in flat):
                    raise ValueError(f"ends after {start} of {whole} entries")
                yield flat[0].reshape(n, across) if along_file else np.column_stack(flat)

    return StoredArray(shape, dtype, read, pieces)


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any], int]:
    """Return shape, whether columns come first, type and length of the header of an ``.npy``."""
    version = np.lib.format.read_magic(file)
    if version == (1, 0):
        shape, turned, dtype = np.lib.format.read_array_header_1_0(file)
    else:
        shape, turned, dtype = np.lib.format.read_array_header_2_0(file)
    if any(n < 0 for n in shape):
        raise ValueError(f"a shape of {shape}")
    return shape, turned, dtype, file.tell()
