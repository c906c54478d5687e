"""What a first run compiles while it reads and identifies, so that nobody waits for it later."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext

from tuner.jobs import beside


@contextmanager
def compiled_ahead(*, log: bool, check: bool) -> Iterator[None]:
    """Compile what is not on disk yet: what a log needs, on all processors, and beside it the filter of the check.

    Parameters
    ----------
    log : bool
        There are samples to identify and diagnose; without them nothing is compiled ahead.
    check : bool
        The configuration will be checked.
    """
    if not log:
        yield
        return
    from tuner.diagnosis.static.compiled_ahead import compile_ahead  # loads the compiler

    with nullcontext() if not check or _has_compiled_filter() else beside(_compile_filter):
        compile_ahead()
        yield


def _has_compiled_filter() -> bool:
    """Return whether the filter of the check is on disk, or cannot be compiled: where it is used, that is said."""
    try:
        from tuner.navigation.engine.ahead import is_stored  # loads the compiler

        return is_stored()
    except Exception:
        return True


def _compile_filter() -> None:
    """Compile the filter of the check."""
    from tuner.navigation.engine.ahead import compile_variant

    compile_variant()
