"""How much memory is free, of the machine or of the container that the process runs in, and how much it holds."""

from __future__ import annotations

import math
import os
from pathlib import Path

CGROUPS = (
    ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
    ("/sys/fs/cgroup/memory/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.usage_in_bytes"),
)
"""Limit and use of a container under Linux, in both versions of its interface."""


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
