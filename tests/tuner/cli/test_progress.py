"""Progress messages appear on a terminal and nowhere else."""

from __future__ import annotations

import logging
from types import SimpleNamespace

import pytest

from tuner.cli.progress import Messages
from tuner.navigation.engine.numba_pipeline import _Announcer


@pytest.mark.parametrize("quiet", [True, False])
def test_compilation_is_announced_unless_quiet(quiet, caplog):
    announcer, kernel, level = _Announcer(), object(), logging.getLogger("tuner").level
    announcer.kernels.add(kernel)
    event = SimpleNamespace(data={"dispatcher": kernel})
    with Messages(quiet).kept():
        announcer.on_start(event)
        announcer.on_end(event)
    assert ("compiling the filter" in caplog.text) is not quiet
    assert logging.getLogger("tuner").level == level
