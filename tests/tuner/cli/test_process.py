"""What a process meets beside its input: streams, signals, mistakes of its own, no place for kernels."""

from __future__ import annotations

import errno
import io
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from rich.table import Table

from tuner import cli
from tuner.cli import process, run
from tuner.cli.progress import Messages
from tuner.report.terminal import show

CURVE = [sys.executable, "-m", "tuner", "curve"]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "we$ird$.npz"
    np.savez(
        path, t=0.01 * np.arange(900), gyro_x=np.random.default_rng(5).normal(0, 1e-3, 900), gyro_unit="rad/s"
    )
    return path


def test_own_mistakes_are_one_line_and_status_3(
    log: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("a\x1b[31m\nb")

    monkeypatch.setattr("tuner.readers.read", broken)
    assert run(["curve", str(log), "--quiet"]) == 3
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert "a mistake of this program, not of the input: ZeroDivisionError" in line
    assert "report it" in line
    assert "\x1b" not in line


def test_a_message_that_cannot_be_written_is_no_verdict(monkeypatch: pytest.MonkeyPatch) -> None:
    class Full(io.StringIO):
        def write(self, _text: str) -> int:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(sys, "stderr", Full())
    assert run(["curve", "nowhere.npz"]) == 2


def test_a_folder_named_by_escape_sequences_is_printed_without(capsys: pytest.CaptureFixture[str]) -> None:
    table = Table("x")
    table.add_row("\x1b]0;x\x07")
    show(["Page: out\x1b[31m/report.html", table])
    Messages().say("wrote \x1b[31m\nx")
    shown = capsys.readouterr()
    assert "Page: out\ufffd[31m/report.html" in shown.out
    assert not any(c in shown.out + shown.err for c in "\x1b\x07")
    assert shown.err.count("\n") == 1


def test_a_reader_of_tables_may_leave_and_know_no_greek(log: Path) -> None:
    """The heading has a tau, which code page 1252 lacks; nobody reads beyond the fifth line."""
    done = subprocess.run(
        f"{' '.join(CURVE)} '{log}' --json '{log.with_suffix('.json')}' --quiet | head -5; exit ${{PIPESTATUS[0]}}",
        env=os.environ | {"PYTHONIOENCODING": "cp1252"},
        shell=True,
        executable="/bin/bash",
        capture_output=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"?, s" in done.stdout, done.stdout
    assert log.with_suffix(".json").stat().st_size > 1000


def test_a_request_to_end(tmp_path: Path) -> None:
    running = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "tuner",
            "simulate",
            "mpu9250",
            "--hours",
            "20",
            "-o",
            str(tmp_path / "log.csv"),
        ],
        stderr=subprocess.PIPE,
    )
    time.sleep(2.0)
    running.send_signal(signal.SIGTERM)
    _, said = running.communicate(timeout=30)
    assert (running.returncode, said.splitlines()[-1]) == (
        143,
        b"tuner: terminated; no file is left half-written",
    )
    assert list(tmp_path.iterdir()) == []


EARLY = """
import os, signal, sys
class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == "numpy":
            os.kill(os.getpid(), signal.SIGINT)
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell starts its background jobs without it
sys.meta_path.insert(0, Interrupting())
from tuner.__main__ import start
start()
"""


def test_an_interrupt_while_the_program_is_imported_is_one_line() -> None:
    done = subprocess.run([sys.executable, "-c", EARLY], capture_output=True, check=False)
    assert (done.returncode, done.stderr.split(b"\n")) == (130, [b"", b"tuner: interrupted", b""])


DROPPED = """
import os, signal, time
from tuner.cli.process import termination
class Dropping:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGTERM)
with termination():
    Dropping()
    time.sleep(60.0)
"""


def test_a_request_that_comes_in_a_destructor_is_answered_in_one_line() -> None:
    done = subprocess.run([sys.executable, "-c", DROPPED], capture_output=True, check=False, timeout=30)
    assert (done.returncode, done.stderr.count(b"\n")) == (143, 2), done.stderr


def test_no_place_for_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(process, "_cache_is_writable", lambda: False)
    with process.kernel_cache():
        folder = Path(os.environ["NUMBA_CACHE_DIR"])
        assert folder.is_dir()
    assert not folder.exists()
    assert cli.COMMANDS


BUSY = """
import signal, sys, threading, time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tuner.cli.process import termination
from tuner.formats.files import WRITING, whole_file
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell starts its background jobs without it
with termination(), ThreadPoolExecutor(1) as threads, whole_file(Path(sys.argv[1]) / "result.json") as temporary:
    threads.submit(time.sleep, 60.0)  # as a compiled call on another processor: the pool waits for its end
    with WRITING:
        end = time.monotonic() + 1.0
        while not (Path(sys.argv[1]) / "set").exists():
            try:
                print("ready", flush=True)
                time.sleep(max(0.0, end - time.monotonic()))
                (Path(sys.argv[1]) / "set").touch()
            except BaseException:
                pass
    temporary.write_text("half")
    raise KeyboardInterrupt
"""


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_no_call_that_lasts_holds_up_an_end(tmp_path: Path, number: signal.Signals, status: int) -> None:
    """Nor does an end come while a set is replaced, or leave a temporary file."""
    running = subprocess.Popen(
        [sys.executable, "-c", BUSY, str(tmp_path)], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert running.stdout is not None
    running.stdout.readline()
    running.send_signal(number)
    begin = time.monotonic()
    _, said = running.communicate(timeout=50)
    assert (running.returncode, time.monotonic() - begin < 20.0) == (status, True)
    assert said.decode().splitlines()[-1].endswith("; no file is left half-written")
    assert [path.name for path in tmp_path.iterdir()] == ["set"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["score", "{log}", "--truth", "{log}"], "expected an estimate and a truth of the same position"),
        (
            ["identify", "{log}", "--figure", "a.bmp"],
            "expected a file that ends in .png, .svg, .pdf, got 'a.bmp'",
        ),
    ],
)
def test_what_cannot_be_done_is_no_mistake_of_the_program(
    log: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    assert run([word.format(log=log) for word in arguments]) == 2
    assert said in capsys.readouterr().err
