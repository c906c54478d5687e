"""A drive without a heading is refused with what was measured: the sd of the heading, and the speeds of the fixes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from tuner.navigation.data import Steps
from tuner.navigation.drive import alignment
from tuner.types.records import DataError, Gnss


def test_the_refusal_quotes_speeds_and_heading(monkeypatch: pytest.MonkeyPatch) -> None:
    """Speeds of 0 … 15 m/s were called hardly any change."""
    t = np.arange(0.0, 60.0)
    north = np.linspace(0.0, 15.0, len(t))
    vel = np.column_stack([north, 0.0 * t, 0.0 * t])
    gnss = Gnss(t, np.zeros((len(t), 3)), vel, np.full((len(t), 3), np.nan), np.full((len(t), 3), np.nan))
    steps = Steps(0.0, np.full(600, 0.1), np.zeros((600, 6)))
    for sd, words in (
        (np.radians(75.0), r"heading to 75°, .*speed of the fixes is 0.375 to 14.6 m/s"),
        (np.radians(5e7), "no part of the drive determines the heading"),  # more than a turn is no knowledge
        (None, "expected 4 fixes or more in 10 s of inertial samples without a gap, found one in 1 s"),
    ):
        found = None if sd is None else SimpleNamespace(covariance=np.eye(9) * sd**2)
        monkeypatch.setattr(alignment, "_likeliest", lambda *_, found=found: (found, False))
        with pytest.raises(DataError, match=words):
            alignment.align(steps, gnss, bias_sd=np.ones(6))
