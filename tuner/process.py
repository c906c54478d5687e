"""Memory that is free to this process, that it holds or has freed, and mappings that other processes take.

Memory of finished work serves the next: by default the C library of Linux gives large arrays back one by one. An array
of a long record is then taken from the system anew each time, page by page, each page cleared first: a third of the
processor time of a log of gigabytes. Where the C library is another one, `keep_freed_memory` and `return_freed_memory`
have no effect.

References
----------
.. [1] mallopt(3) and malloc_trim(3) of the GNU C library.
"""

from __future__ import annotations

import copyreg
import ctypes
import math
import os
import sys
from pathlib import Path
from types import MappingProxyType
from typing import Any

CGROUPS = (
    ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
    ("/sys/fs/cgroup/memory/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.usage_in_bytes"),
)
"""Limit and use of a container under Linux, in both versions of its interface."""
_TRIM_THRESHOLD, _MMAP_MAX = -1, -4
"""M_TRIM_THRESHOLD and M_MMAP_MAX of malloc.h."""
_MOST_BYTES = (1 << 31) - 1
"""The largest threshold that can be stated."""


def free_memory() -> float:
    """Return the bytes that a process can take without harm to others; infinity where the system does not tell."""
    free = [_of_machine(), *(_number(limit) - _number(used, 0.0) for limit, used in CGROUPS)]
    try:
        import resource
    except ImportError:  # Windows
        return min(free)
    limits = [resource.getrlimit(kind)[0] for kind in (resource.RLIMIT_AS, resource.RLIMIT_DATA)]
    return min(free + [float(limit) for limit in limits if limit != resource.RLIM_INFINITY])


def used_memory() -> float:
    """Return the bytes of the machine's memory that this process holds; not a number where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except (OSError, ValueError, IndexError):
        return math.nan
    return float(pages * os.sysconf("SC_PAGE_SIZE"))


def keep_freed_memory() -> None:
    """Let this process keep what it frees for its next arrays: for a process that is ours alone."""
    if (library := _c_library()) is not None:
        library.mallopt(_MMAP_MAX, 0)
        library.mallopt(_TRIM_THRESHOLD, _MOST_BYTES)


def return_freed_memory() -> None:
    """Give the system what this process has freed: before copies of it are made, and where it only waits."""
    if (library := _c_library()) is not None:
        library.malloc_trim(0)


def allow_pickled_mappings() -> None:
    """Let `pickle` and `copy` make a read-only mapping again from what it holds, which they refuse by themselves."""
    copyreg.pickle(MappingProxyType, _of_mapping)


def _of_machine() -> float:
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return 1024.0 * float(next(line for line in lines if line.startswith("MemAvailable:")).split()[1])
    except (OSError, StopIteration, ValueError, IndexError):
        pass
    try:
        return 0.5 * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # Windows
        return math.inf


def _number(path: str, otherwise: float = math.inf) -> float:
    try:
        return float(Path(path).read_text(encoding="ascii"))
    except (OSError, ValueError):
        return otherwise


def _c_library() -> ctypes.CDLL | None:
    """Return the GNU C library of this process; None where it runs with another one."""
    if sys.platform != "linux":
        return None
    library = ctypes.CDLL(None)
    return library if hasattr(library, "mallopt") and hasattr(library, "malloc_trim") else None


def _of_mapping(mapping: MappingProxyType[Any, Any]) -> tuple[Any, ...]:
    return _read_only, (dict(mapping),)


def _read_only(content: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(content)
