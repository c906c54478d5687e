"""From inertial-sensor recordings to navigation-filter settings one can trust.

The verbs, in the order of the work::

    records = tuner.read("static.csv")
    found = tuner.identify(records)
    config = tuner.synthesize(found)
    text = tuner.export(config, "kalibr")

They are imported when first used, so that starting is quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tuner.exporters import export
    from tuner.identification import identify
    from tuner.readers import read
    from tuner.synthesis import synthesize

__all__ = ["export", "identify", "read", "synthesize"]

_HOMES = {
    "read": "tuner.readers",
    "identify": "tuner.identification",
    "synthesize": "tuner.synthesis",
    "export": "tuner.exporters",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        msg = f"module 'tuner' has no attribute {name!r}"
        raise AttributeError(msg)
    return getattr(importlib.import_module(_HOMES[name]), name)
