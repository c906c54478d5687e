"""Progress messages appear on a terminal and nowhere else."""

from __future__ import annotations

import logging
import time

import pytest
from rich.console import Console

from tuner.cli import progress
from tuner.cli.progress import Messages
from tuner.jobs import counted, each, limited, watched
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


@pytest.mark.parametrize("processors", [1, 2])
def test_the_outermost_loop_tells_how_far_it_is(processors):
    told = []
    with limited(processors), watched(lambda done, total: told.append((done, total))):
        each(lambda n: list(counted(range(n))), [1, 2, 3])
    assert told == [(0, 3), (1, 3), (2, 3), (3, 3)]


@pytest.mark.parametrize(("terminal", "quiet"), [(True, False), (True, True), (False, False)])
def test_a_long_loop_has_a_bar_with_the_time_left_on_a_terminal_only(terminal, quiet, monkeypatch, capsys):
    console = Console(stderr=True, force_terminal=terminal, width=80)
    monkeypatch.setattr(progress, "Console", lambda **_: console)
    monkeypatch.setattr(progress, "SHOWN_AFTER", 0.0)
    with Messages(quiet).steps():
        for _ in counted(range(3)):
            time.sleep(0.01)
    shown = capsys.readouterr()
    assert shown.out == ""
    assert ("working" in shown.err and "%" in shown.err) is (terminal and not quiet)
