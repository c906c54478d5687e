"""Outputs of Stable32 (the program of W. J. Riley) with their input series, in TUNER_DATA/reference/stable32.

Compared to one unit of the last printed digit. Data: PHASE.DAT (1001 phases), 1PPS of a GPS receiver against
a maser (phase, 241 218 s) and an OCXO (frequency, 19 982 s).
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tuner.curves.allan import allan, hadamard, modified_allan, overlapping_allan, overlapping_hadamard
from tuner.curves.theo import theo1
from tuner.curves.total import total

STATISTICS: dict[str, Callable[..., np.ndarray]] = {
    "adev": allan,
    "oadev": overlapping_allan,
    "mdev": modified_allan,
    "hdev": hadamard,
    "ohdev": overlapping_hadamard,
    "totdev": total,
    "theo1": theo1,
}

TABLES = [
    ("phasedat", "phase_dat_adev.txt"),
    ("phasedat", "phase_dat_oadev.txt"),
    ("phasedat", "phase_dat_mdev.txt"),
    ("phasedat", "phase_dat_hdev.txt"),
    ("phasedat", "phase_dat_ohdev.txt"),
    ("phasedat", "phase_dat_totdev.txt"),
    ("phasedat", "phase_dat_theo1_alpha0.txt"),
    ("gps", "stable32_ADEV_decade.txt"),
    ("gps", "stable32_OADEV_octave.txt"),
    ("gps", "stable32_MDEV_octave.txt"),
    ("gps", "stable32_HDEV_octave.txt"),
    ("gps", "stable32_OHDEV_octave.txt"),
    ("gps", "stable32_TOTDEV_octave.txt"),
    ("ocxo", "stable32_adev_alltau.txt"),
    ("ocxo", "stable32_oadev_alltau.txt"),
    ("ocxo", "stable32_mdev_alltau.txt"),
    ("ocxo", "stable32_hdev_alltau.txt"),
    ("ocxo", "stable32_ohdev_alltau.txt"),
    ("ocxo", "stable32_totdev_alltau.txt"),
]


def folder(name: str) -> Path:
    root = os.environ.get("TUNER_DATA")
    if not root:
        pytest.skip("TUNER_DATA is not set")
    path = Path(root) / "reference" / "stable32" / name
    if not path.is_dir():
        pytest.skip(f"{path} is absent")
    return path


def rates(name: str) -> np.ndarray:
    path = folder(name)
    if name == "phasedat":
        return np.diff(np.loadtxt(path / "PHASE.DAT"))
    if name == "gps":
        return np.diff(np.loadtxt(path / "gps_1pps_phase_data.txt.gz"))
    return np.loadtxt(path / "ocxo_frequency.txt") / 1e7


@pytest.mark.parametrize(("name", "table"), TABLES)
def test_agrees_to_the_last_printed_digit(name, table):
    path = folder(name) / table
    rows = [
        line.split() for line in path.read_text(encoding="latin-1").splitlines() if line.strip()[:1].isdigit()
    ]
    assert len(rows) >= 10
    m = np.array([int(row[0]) for row in rows])
    printed = np.array([float(row[-2]) for row in rows])
    statistic = (
        table.lower().replace("stable32_", "").replace("phase_dat_", "").split("_")[0].removesuffix(".txt")
    )
    found = np.sqrt(STATISTICS[statistic](rates(name), m))
    digit = 10.0 ** (np.floor(np.log10(printed)) - 4)
    assert np.max(np.abs(found - printed) / digit) <= 1.01
