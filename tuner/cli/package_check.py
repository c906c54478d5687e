"""Both package names are common words: make sure that the `models` Python finds is ours."""

from __future__ import annotations

import importlib.util
from pathlib import Path


def foreign_models() -> str | None:
    """Return one line that says which other `models` is in the way, or None if ours is found first."""
    spec = importlib.util.find_spec("models")
    where = Path(spec.origin) if spec and spec.origin else None
    if (
        where is not None
        and (where.parent / "noise" / "__init__.py").is_file()
        and (where.parent / "strapdown.py").is_file()
    ):
        return None
    found = f"{where or 'none'}"
    return (
        f"package 'models': expected the one installed with tuner, found {found}; "
        "start tuner from another folder, or rename that package"
    )
