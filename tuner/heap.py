"""Memory of finished work serves the next: by default the C library of Linux gives large arrays back one by one.

An array of a long record is then taken from the system anew each time, page by page, each page cleared first: a third
of the processor time of a log of gigabytes. Where the C library is another one, nothing here has an effect.

References
----------
.. [1] mallopt(3) and malloc_trim(3) of the GNU C library.
"""

from __future__ import annotations

import ctypes
import sys

_TRIM_THRESHOLD, _MMAP_MAX = -1, -4
"""M_TRIM_THRESHOLD and M_MMAP_MAX of malloc.h."""
_MOST_BYTES = (1 << 31) - 1
"""The largest threshold that can be stated."""


def keep_freed_memory() -> None:
    """Let this process keep what it frees for its next arrays: for a process that is ours alone."""
    if (library := _c_library()) is not None:
        library.mallopt(_MMAP_MAX, 0)
        library.mallopt(_TRIM_THRESHOLD, _MOST_BYTES)


def return_freed_memory() -> None:
    """Give the system what this process has freed: before copies of it are made, and where it only waits."""
    if (library := _c_library()) is not None:
        library.malloc_trim(0)


def _c_library() -> ctypes.CDLL | None:
    """Return the GNU C library of this process; None where it runs with another one."""
    if sys.platform != "linux":
        return None
    library = ctypes.CDLL(None)
    return library if hasattr(library, "mallopt") and hasattr(library, "malloc_trim") else None
