"""How a package that is lacking is installed, in the environment that lacks it."""

from __future__ import annotations

import shutil
import sys
from importlib import metadata
from pathlib import Path

from tuner.formats.guard import reason

NAME = "ins-noise-tuner"


def install(extra: str, lacking: str) -> str:
    """Return the command that installs what an extra of this package needs; `lacking` where no metadata name it.

    This package stands on no index: its own name installs nothing. The requirement is that of its metadata.
    """
    try:
        stated = metadata.requires(NAME) or []
    except metadata.PackageNotFoundError:
        stated = []
    wanted = [
        text.partition(";")[0].strip() for text in stated if f"extra == '{extra}'" in text.replace('"', "'")
    ]
    return f"{python()} -m pip install {' '.join(repr(text) for text in wanted) or lacking}"


def lacking(error: ImportError, extra: str) -> str:
    """Return which package is needed and how it is installed: ``needs h5py, which is not installed: …``.

    An error that names no package, or that of one which is there and fails to load, is quoted.
    """
    if isinstance(error, ModuleNotFoundError) and error.name:
        return f"needs {error.name}, which is not installed: {install(extra, error.name)}"
    return f"needs a package that cannot be loaded ({reason(error)}): {install(extra, extra)}"


def python() -> str:
    """Return how the interpreter at hand is called: ``python`` where that is it, else its path."""
    usual = shutil.which("python")
    return "python" if usual is not None and Path(usual).samefile(sys.executable) else sys.executable
