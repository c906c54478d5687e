"""A drive on which the filter diverges: nothing is concluded from it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from tuner import pipeline
from tuner.consistency import score_drive
from tuner.types.progress import silent
from tuner.types.records import DataError

DRIVE: Any = SimpleNamespace(source="flight.bin", name="flight")


def _measured(*, diverged):
    found = SimpleNamespace(diverged=diverged, gated=0.77, nis=(SimpleNamespace(ratio=31.4),))
    return SimpleNamespace(consistency=found)


def test_a_drive_on_which_the_filter_diverges_is_refused_in_one_line(monkeypatch):
    config: Any = None
    monkeypatch.setattr(score_drive, "navigate_drive", lambda *_, **__: _measured(diverged=True))
    with pytest.raises(DataError) as refused:
        pipeline.measured_or_reason(DRIVE, config, silent)
    text = str(refused.value)
    assert "\n" not in text
    for said in (
        "flight.bin",
        "77 % of the fixes refused",
        "31.4 ×",
        "nothing is concluded",
    ):
        assert said in text
    assert "check" not in text  # nothing was tried that could be advised
    monkeypatch.setattr(score_drive, "navigate_drive", lambda *_, **__: _measured(diverged=False))
    assert pipeline.measured_or_reason(DRIVE, config, silent)[1] == {}
