"""Sizes of effects on drives from which 95 % are found, SI.

The size of an effect is the length of its vector of parameters (the ratio less one for noise). Detectability grows
with its square for effects of the mean kind, so the size at which 95 % are found is the median of size · √(d95/d).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from challenge.drives.oracle import GROUPS
from challenge.tables import power, table
from challenge.verdict import Verdict

UNITS = {
    "time_offset": ("ms", 1e3), "velocity_lag": ("ms", 1e3), "lever_arm": ("m", 1.0), "gnss_frame": ("mrad", 1e3),
    "gyro_scale": ("ppm", 1e6), "accel_scale": ("ppm", 1e6), "misalignment": ("mrad", 1e3),
    "g_sensitivity": ("1e-6 rad/s per m/s²", 1e6),
}  # fmt: skip


def sizes(keys: Sequence[dict[str, Any]], verdicts: Sequence[Verdict]) -> str:
    """Return the table of single effects of the mean kind: sizes at which half and 95 % are found, and at 12 nats."""
    found = {v.name: v for v in verdicts}
    rows = []
    for cause in GROUPS:
        mine = [
            k
            for k in keys
            if k["kind"] == "single" and k["effects"][0]["cause"] == cause and k["name"] in found
        ]
        if not mine:
            continue
        nats = np.array([k["effects"][0]["nats"] for k in mine])
        size = np.array([np.linalg.norm(list(k["effects"][0]["parameters"]["drive"].values())) for k in mine])
        unit, factor = UNITS[cause]
        at = float(np.median(size / np.sqrt(nats))) * factor
        half, most = power(nats.tolist(), [found[k["name"]].alarm for k in mine])
        told = [f"{at * np.sqrt(float(d)):.3g}" if d != "–" else "–" for d in (half, most)]
        rows.append((cause, unit, len(mine), *told, half, most, f"{at * np.sqrt(12.0):.3g}"))
    return table(
        ("effect", "unit", "sets", "size found in half", "in 95 %", "d50", "d95", "size at 12 nats"), rows
    )
