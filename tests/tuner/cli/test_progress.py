"""Progress messages appear on a terminal and nowhere else."""

from __future__ import annotations

import logging
import time

import pytest

from tuner.cli.progress import Messages
from tuner.navigation.engine import compilation


@pytest.mark.parametrize("quiet", [True, False])
def test_compilation_is_reported_unless_quiet(quiet, caplog, monkeypatch):
    level = logging.getLogger("tuner").level
    monkeypatch.setattr(compilation, "COMPILING_AFTER", 0.0)
    compilation._announce.cache_clear()
    with Messages(quiet).kept(), compilation.compiling():
        time.sleep(0.2)
    assert ("compiling the filter" in caplog.text) is not quiet
    assert logging.getLogger("tuner").level == level
