"""Another program as a command line: its mistakes are one line, and nothing of it outlives the run."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from pathlib import Path

import pytest

from tuner.cli import run
from tuner.external.program import Program, program_of
from tuner.types.records import DataError


def python(code: str, *, limit: float = 20.0) -> Program:
    return Program((sys.executable, "-S", "-c", code), limit)


def test_placeholders_stand_for_paths(tmp_path: Path) -> None:
    program = program_of("cp {config} {output}.txt", time_limit=10.0)
    assert program.names("output")
    assert not program.names("drive")
    (tmp_path / "settings").write_text("noise", encoding="utf-8")
    program.run({"config": tmp_path / "settings", "output": tmp_path / "out"}, tmp_path)
    assert (tmp_path / "out.txt").read_text(encoding="utf-8") == "noise"


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("filter {drive}", r"expected \{config\}"),
        ("filter {config} {out}", r"found \{out\}"),
        ("filter '{config}", "No closing quotation"),
    ],
)
def test_a_command_that_cannot_be_meant_is_refused(command: str, words: str) -> None:
    with pytest.raises(DataError, match=words):
        program_of(command, time_limit=1.0)


def test_a_program_that_fails_is_told_with_its_last_line(tmp_path: Path) -> None:
    code = "import sys; print('first', file=sys.stderr); print('no fixes\\x1b[0m\\n', file=sys.stderr); sys.exit(3)"
    with pytest.raises(DataError, match=r"exit status 3: no fixes.*$") as told:
        python(code).run({}, tmp_path)
    assert "\x1b" not in str(told.value)
    with pytest.raises(DataError, match="exit status 1: only here"):
        python("import sys; print('only here'); sys.exit(1)").run({}, tmp_path)
    with pytest.raises(DataError, match="no-such-filter: expected a program, found none that starts"):
        Program(("no-such-filter",), 1.0).run({}, tmp_path)


def test_a_program_that_takes_too_long_is_ended_with_its_children(tmp_path: Path) -> None:
    code = "import os, time; os.fork(); open(f'pid{os.getpid()}', 'w'); time.sleep(60)"
    with pytest.raises(DataError, match=r"within 1 s, found none: --filter-timeout"):
        python(code, limit=1.0).run({}, tmp_path)
    ended(tmp_path)


def test_an_interrupt_ends_the_program(tmp_path: Path) -> None:
    def interrupt() -> None:
        while not list(tmp_path.glob("pid*")):
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    before = signal.signal(
        signal.SIGINT, signal.default_int_handler
    )  # a shell starts background jobs without it
    threading.Thread(target=interrupt).start()
    with pytest.raises(KeyboardInterrupt):
        python("import os, time; open(f'pid{os.getpid()}', 'w'); time.sleep(60)").run({}, tmp_path)
    signal.signal(signal.SIGINT, before)
    ended(tmp_path)


def ended(folder: Path) -> None:
    """Expect the processes that left their number in a folder to be gone, or to be about to go."""
    for path in folder.glob("pid*"):
        status = Path(f"/proc/{path.name.removeprefix('pid')}/stat")
        for _ in range(200):
            if not status.exists() or status.read_text(encoding="utf-8").split()[2] == "Z":
                break
            time.sleep(0.01)
        else:
            pytest.fail(f"{path.name} still runs")


def test_the_options_belong_together(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["tune", "icm20602", "--filter", "f {config}", "-o", str(tmp_path / "a")]) == 2
    assert "--filter: expected --drive DRIVE and --to DIALECT" in capsys.readouterr().err
    assert run(["tune", "icm20602", "--to", "no-filter", "-o", str(tmp_path / "a")]) == 2
    assert "no-filter" in capsys.readouterr().err
    assert not (tmp_path / "a").exists()
