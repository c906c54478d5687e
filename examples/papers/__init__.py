"""The three papers behind this project: their figures, tables and statements, reproduced and judged.

Their authors published no logs. Each item simulates data to a paper's settings, runs the functions that a user runs,
and compares: `Item.claims` with verdicts that follow from intervals, `Item.figure` with what the paper shows.

1. Li Qi et al.: Allan variance of a ring laser gyro and of a MEMS gyro.
2. Xu Dongsheng et al.: ThêoH of a fibre-optic gyro.
3. Zhang Meng et al.: Allan variance of two groupings and ARMA model of a MEMS gyro.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Mapping, Sequence
from types import MappingProxyType

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")  # as `tuner`: before numpy is imported

from examples.papers.results import Claim, Item
from examples.papers.sampling import Settings

__all__ = ["ITEMS", "Claim", "Item", "Settings", "chosen", "run"]

ITEMS: Mapping[str, str] = MappingProxyType(
    {
        "rlg-static": "laser",
        "rlg-vs-mems": "laser",
        "rlg-dynamic": "turning",
        "lowpass-n": "lowpass",
        "example-curve": "segments",
        "method-table": "methods",
        "kf-parameters": "outage",
        "test-design": "segments",
        "fog-edf": "degrees_of_freedom",
        "fog-sim": "theo",
        "fog-bias": "biases",
        "fog-record": "mixture",
        "mems-allan": "two_group_allan",
        "mems-arma": "timeseries",
    }
)
"""Module of each item; its function has the name of the item, with underscores."""


def chosen(names: Sequence[str]) -> tuple[str, ...]:
    """Return the items of these names in their order, each once; ``all`` stands for every item."""
    return tuple(name for name in ITEMS if name in names or "all" in names)


def run(name: str, settings: Settings) -> Item:
    """Reproduce one item of `ITEMS`."""
    module = importlib.import_module(f"examples.papers.{ITEMS[name]}")
    item = getattr(module, name.replace("-", "_"))(settings)
    assert isinstance(item, Item)
    return item
