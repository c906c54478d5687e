"""Freed memory stays with a process that keeps it, and goes back to the system before processes are forked."""

from __future__ import annotations

import subprocess
import sys
import textwrap

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="of the GNU C library")


def said_by(program: str) -> list[int]:
    """Return the numbers that a program of its own prints."""
    words = [sys.executable, "-c", textwrap.dedent(program)]
    return [int(word) for word in subprocess.run(words, capture_output=True, check=True).stdout.split()]


def test_tables_of_a_long_transform_are_forgotten() -> None:
    """A cosine transform of n samples leaves tables of 2 n numbers behind, and they go without another long one.

    SciPy 1.18 keeps none: what the transform itself leaves is no law, what is left in the end is.
    """
    program = """
        import resource
        import numpy as np
        from tuner.curves.long_transforms import without_tables
        from tuner.process import return_freed_memory
        from scipy.fft import dct

        def resident():
            return_freed_memory()
            return int(open("/proc/self/statm").read().split()[1]) * resource.getpagesize()

        y = np.ones(1 << 20)
        without_tables(len(y))
        before = resident()
        dct(y)
        without_tables(len(y))
        print(resident() - before)
    """
    (left,) = said_by(program)
    assert left < 2e6


def test_arrays_take_the_memory_of_those_before_them() -> None:
    """Of ten arrays of 64 MB, one after the other, only the first is taken from the system, page by page."""
    program = """
        import resource
        import numpy as np
        from tuner.process import keep_freed_memory, return_freed_memory

        def resident():
            return int(open("/proc/self/statm").read().split()[1]) * resource.getpagesize()

        keep_freed_memory()
        np.ones(1 << 23)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt, resident()
        for _ in range(10):
            np.ones(1 << 23)
        faults = resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before[0]
        return_freed_memory()
        print(faults, before[1] - resident())
    """
    faults, returned = said_by(program)
    assert faults < 100  # 320 where each takes 32 huge pages anew, 164 000 small ones
    assert returned > 60e6
