"""A drive without a heading is refused with what was measured: the sd of the heading, and the speeds of the fixes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from tuner.navigation.drive import alignment
from tuner.types.records import DataError, Gnss


def test_the_refusal_quotes_speeds_and_heading(monkeypatch: pytest.MonkeyPatch) -> None:
    """Speeds of 0 … 15 m/s were called hardly any change."""
    t = np.arange(0.0, 60.0)
    north = np.linspace(0.0, 15.0, len(t))
    vel = np.column_stack([north, 0.0 * t, 0.0 * t])
    gnss = Gnss(t, np.zeros((len(t), 3)), vel, np.full((len(t), 3), np.nan), np.full((len(t), 3), np.nan))
    found = SimpleNamespace(heading_sd=np.radians(75.0))
    monkeypatch.setattr(alignment, "align_once", lambda *_, **__: found)
    with pytest.raises(DataError, match=r"heading to 75°, .*speed of the fixes is 0.375 to 14.6 m/s"):
        alignment.align(None, gnss)  # type: ignore[arg-type]
    unknown = SimpleNamespace(heading_sd=np.radians(5.09e7))  # more than a turn is no knowledge
    for nothing in (None, unknown):
        monkeypatch.setattr(alignment, "align_once", lambda *_, nothing=nothing, **__: nothing)
        with pytest.raises(DataError, match="no part of the drive determines the heading"):
            alignment.align(None, gnss)  # type: ignore[arg-type]
