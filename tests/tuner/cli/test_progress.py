"""Progress messages appear on a terminal and nowhere else."""

from __future__ import annotations

import logging
import os
import re
import subprocess
import sys
import termios
import time
from contextlib import suppress
from types import SimpleNamespace

import pytest

from tuner.cli import progress
from tuner.cli.progress import Messages
from tuner.navigation.engine import compilation
from tuner.stages import counted


@pytest.mark.parametrize(
    ("quiet", "in_memory", "said"), [(True, [], False), (False, [], True), (False, ["()"], False)]
)
def test_compilation_is_reported_unless_quiet_or_over(quiet, in_memory, said, caplog, monkeypatch):
    """What takes its time once it is compiled, or loaded from disk, does not compile."""
    level = logging.getLogger("tuner").level
    monkeypatch.setattr(compilation, "COMPILING_AFTER", 0.05)
    compilation._say.cache_clear()
    function = SimpleNamespace(signatures=[])
    with Messages(quiet).kept(), compilation.compiling(function):
        function.signatures = in_memory
        time.sleep(0.2)
    assert ("compiling the filter" in caplog.text) is said
    assert logging.getLogger("tuner").level == level


PROGRAM = """
import time
from tuner.cli import progress
from tuner.stages import counted, finished, stage
progress.SHOWN_AFTER = 0.0
messages = progress.Messages(QUIET)
with messages.steps():
    stage("measuring the units, whose names are longer than what a line of this terminal holds", 1.0)
    for _ in counted(range(4)):
        time.sleep(0.25)
    messages.say("a message")
    finished()
    print("the answer")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="pseudo-terminals of Linux")
@pytest.mark.parametrize("quiet", [True, False])
def test_on_a_terminal_one_line_says_what_is_done_and_the_time_left_and_goes_before_the_answer(quiet):
    ours, theirs = os.openpty()
    termios.tcsetwinsize(theirs, (24, 80))
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM.replace("QUIET", str(quiet))],
        stdout=subprocess.PIPE,
        stderr=theirs,
        env={**os.environ, "TERM": "xterm"},
    ) as one:
        os.close(theirs)
        shown = b""
        with suppress(OSError):  # that of a terminal whose other end is closed
            while piece := os.read(ours, 65536):
                shown += piece
        assert one.stdout is not None
        assert one.stdout.read() == b"the answer\n"
    os.close(ours)
    lines = re.split(r"[\r\n]+", re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", shown.decode()))
    if quiet:
        assert shown == b""
        return
    assert max(map(len, lines)) <= 80
    assert any(re.match(r"measuring the units.* 50 % about 1 s left", line) for line in lines), lines
    assert "a message" in lines
    assert shown.rfind(b"\x1b[?25h") > shown.rfind(b"\x1b[?25l")  # the cursor is seen again
    assert not lines[-1].strip()


def test_nothing_of_it_is_shown_where_standard_error_is_no_terminal(monkeypatch, capsys):
    monkeypatch.setattr(progress, "SHOWN_AFTER", 0.0)
    with Messages().steps():
        for _ in counted(range(2), "counting"):
            time.sleep(0.01)
    assert capsys.readouterr() == ("", "")
