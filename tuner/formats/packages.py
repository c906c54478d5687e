"""How a package that is lacking is installed, in the environment that lacks it."""

from __future__ import annotations

import shutil
import sys
from importlib import metadata
from pathlib import Path

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


def python() -> str:
    """Return how the interpreter at hand is called: ``python`` where that is it, else its path."""
    usual = shutil.which("python")
    return "python" if usual is not None and Path(usual).samefile(sys.executable) else sys.executable
