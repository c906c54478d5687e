"""Published overlapping Allan variances of an ADIS16405 run, `adis_av` of the R package avar (AGPL, quoted).

Table and recording are read from TUNER_DATA (reference/avar_tables.json, static/adis16405_run1.npz).
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from tuner.curves.allan import overlapping_allan


def data(path: str) -> Path:
    root = os.environ.get("TUNER_DATA")
    if not root:
        pytest.skip("TUNER_DATA is not set")
    found = Path(root) / path
    if not found.exists():
        pytest.skip(f"{found} is absent")
    return found


@pytest.mark.parametrize("sensor", ["Gyro", "Accel"])
def test_published_table_is_reproduced(sensor):
    table = json.loads(data("reference/avar_tables.json").read_text())["adis_av"]
    recording = np.load(data("static/adis16405_run1.npz"))
    counts, scale = (("gyro_counts", 0.05), ("accel_counts", 0.00333))[sensor == "Accel"]
    for column, axis in enumerate("XYZ"):
        published = table["axes"][f"{sensor}. {axis}"]
        m = np.rint(np.array(published["levels"]) * table["freq"]).astype(int)
        found = scale**2 * overlapping_allan(recording[counts][:, column], m)
        np.testing.assert_allclose(found, published["allan"], rtol=1e-5)
