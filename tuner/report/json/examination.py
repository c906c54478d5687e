"""JSON of an examination, in the form ``tuner.examination/1``."""

from __future__ import annotations

import math
from typing import Any

from tuner.examination.examine import Examination
from tuner.formats.codec import dump
from tuner.report.examination_answer import examination_verdict


def examination_json(found: Examination) -> dict[str, Any]:
    """Return the repairs of a drive, the noise of its streams, and what it could not have shown."""
    return {
        "schema": "tuner.examination/1",
        "source": {"drive": found.mended.source, "digest": found.mended.digest},
        "verdict": examination_verdict(found),
        "repairs": dump(found.repairs),
        "noise": dump(found.noise),
        "vibration": {name: list(pair) for name, pair in found.vibration.items()},
        "unseen": list(found.unseen),
        "delays": {
            name: {"value": one.value, "interval": list(one.interval), "unit": "s"}
            for name, one in (
                *((f"receiver{when}", one) for when, one in found.clock.delays.items()),
                ("velocities", found.clock.lag),
            )
            if math.isfinite(one.sd)
        },
    }
