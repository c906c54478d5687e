"""JSON of a filter on a measured drive, in the form ``tuner.consistency/1``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tuner.consistency.score_drive import DriveResult
from tuner.navigation.drive.vehicle_constraints import constraint_counts
from tuner.report.json.consistency import consistency_json
from tuner.types.records import Drive


def navigation_json(found: DriveResult, drive: Drive, *, notes: Sequence[str], seed: int) -> dict[str, Any]:
    """Return scores of a filter on a measured drive, with its final estimates of constants and its constraints."""
    source = {
        "drive": drive.source,
        "digest": drive.digest,
        "config": found.config.name,
        "states": found.settings.size,
        "fixes": sum(len(stretch.fixes) for stretch in found.stretches),
        "estimates": {
            name: [{"value": value, "sd": sd} for value, sd in values]
            for name, values in found.estimates.items()
        },
        "constraints": {name: vars(one) for name, one in constraint_counts(found.solutions).items()},
        "seed": seed,
    }
    return consistency_json(found.consistency, source=source, notes=notes)
