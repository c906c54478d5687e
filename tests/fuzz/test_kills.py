"""A run of `tune` that is ended at any moment, or has no room to write, leaves the old result or the new one."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tuner.formats.file_set import stale_files

ENDS = int(os.environ.get("TUNER_KILLS", "200"))
RUN = [sys.executable, "-m", "tuner", "tune"]


def log(path: Path, sd: float) -> Path:
    rng = np.random.default_rng(16)
    np.savez(path, t=0.01 * np.arange(3000), gyro_x=rng.normal(0.0, sd, 3000), gyro_unit="rad/s")
    return path


def state(folder: Path) -> tuple[dict[str, str], list[str]]:
    """The digests of a result, and the files that do not fit it."""
    last = folder / "result.json"
    return (json.loads(last.read_text())["files"], stale_files(last)) if last.exists() else ({}, [])


def leftovers(folder: Path) -> list[str]:
    return sorted(
        p.name for p in [*folder.parent.glob(".*"), *(folder.glob(".*") if folder.exists() else ())]
    )


def tuned(source: Path, folder: Path) -> subprocess.Popen[bytes]:
    arguments = [*RUN, str(source), "-o", str(folder), "--quiet"]
    return subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


@pytest.mark.slow
def test_runs_that_are_ended_at_any_moment(tmp_path: Path) -> None:
    sources = [log(tmp_path / "one.npz", 1e-3), log(tmp_path / "other.npz", 2e-3)]
    whole = []
    for number, source in enumerate(sources):
        begin = time.monotonic()
        assert tuned(source, tmp_path / f"whole{number}").wait() == 0
        whole.append(state(tmp_path / f"whole{number}")[0])
    length = time.monotonic() - begin
    rng = np.random.default_rng(16)
    folder = tmp_path / "results" / "unit"
    ended = 0
    for round_ in range(ENDS):
        running = tuned(sources[round_ % 2], folder)
        late = rng.random() < 0.5  # half of them in the last part, where files are written
        time.sleep(float(rng.uniform(0.7 if late else 0.0, 1.1) * length))
        number = [signal.SIGKILL, signal.SIGTERM, signal.SIGINT][round_ % 3]
        running.send_signal(number)
        ended += running.wait(30) != 0
        digests, stale = state(folder)
        assert digests in ({}, *whole), round_
        assert not stale, round_
        if number != signal.SIGKILL:
            assert not leftovers(folder), round_
    print(f"{ended} of {ENDS} runs of {length:.1f} s were ended; left: {leftovers(folder)}")  # noqa: T201
    assert tuned(sources[0], folder).wait() == 0
    assert not leftovers(folder)


@pytest.mark.slow
@pytest.mark.parametrize("limit", [0, 16384])
def test_no_room_to_write(tmp_path: Path, limit: int) -> None:
    source, folder = log(tmp_path / "one.npz", 1e-3), tmp_path / "out" / "unit"
    assert tuned(source, folder).wait() == 0
    before = state(folder)
    done = subprocess.run(
        [*RUN, str(log(tmp_path / "other.npz", 2e-3)), "-o", str(folder), "--quiet"],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
        capture_output=True,
        check=False,
    )
    assert done.returncode == 2
    assert b"File too large" in done.stderr
    assert b"Traceback" not in done.stderr
    assert (state(folder), leftovers(folder)) == (before, [])
