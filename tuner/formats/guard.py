"""Every fault of an input becomes one printable line; no text from outside reaches a terminal unchecked."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import ParamSpec, TypeVar

from tuner.types.one_line import printable
from tuner.types.records import DataError

P = ParamSpec("P")
R = TypeVar("R")

LONGEST_REASON = 200
"""Characters that the words of a library may take in a message."""


def reason(error: BaseException) -> str:
    """Return what an error of a library says, short and printable; its kind where it says nothing."""
    return printable(str(error), longest=LONGEST_REASON) or type(error).__name__


@contextmanager
def input_guard(source: object, expected: str) -> Iterator[None]:
    """Turn every error of reading an input into a `DataError` that names it and what was expected.

    Libraries raise errors of any kind for damaged files, and a file may state sizes that no memory holds. A missing
    package and an interruption pass unchanged.
    """
    try:
        yield
    except (DataError, ImportError):
        raise
    except FileNotFoundError as error:
        missing = "no such file" if error.filename == str(source) else f"it lacks a file, {reason(error)}"
        msg = f"{source}: {missing}"
        raise DataError(msg) from None
    except MemoryError:
        found = "one that states more than the memory holds; split it, or convert it anew"
    except RecursionError:
        found = "one nested too deeply"
    except Exception as error:  # whatever a library raises for a damaged file
        found = f"{type(error).__name__}: {reason(error)}; is it damaged? save or export it anew"
    else:
        return
    msg = f"{source}: cannot be read as {expected}: {found}"
    raise DataError(msg) from None


def guarded(source: object, expected: str, read: Callable[P, R]) -> Callable[P, R]:
    """Return a function of reading whose errors become `DataError`, as by `input_guard`."""

    def inner(*args: P.args, **kwargs: P.kwargs) -> R:
        with input_guard(source, expected):
            return read(*args, **kwargs)
        raise AssertionError

    return inner
