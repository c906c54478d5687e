"""Compiled functions call their own copies of what is linked into them, when they are compiled as when they are loaded.

Numba marks such copies as replaceable by another of the same name. In the process that compiles, the loader finds
one: the function compiled alone, which LLVM optimised once less and, with `fastmath`, rounds otherwise. A process that
takes the code from disk finds none, so that the first run after an installation differed in the last digits. Copies
that nothing replaces give the same digits in all of them.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from numba.core.codegen import CPUCodeLibrary


@cache
def keep_linked_copies() -> None:
    """Have functions that this process compiles from now on call their own copies."""
    kind: Any = CPUCodeLibrary
    finish = kind._finalize_final_module

    def finish_own(library: Any) -> None:
        for function in library._final_module.functions:
            if function.linkage.name == "linkonce_odr" and not function.is_declaration:
                function.linkage = "internal"
        finish(library)

    kind._finalize_final_module = finish_own
