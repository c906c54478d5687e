"""A run of `tune` that is ended at any moment, or has no room to write, leaves the old result or the new one."""

from __future__ import annotations

import hashlib
import json
import os
import resource
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from tuner.formats.file_set import stale_files

ENDS = int(os.environ.get("TUNER_KILLS", "200"))
COMMANDS = {
    "tune": ("tune", "{log}", "-o", "{place}"),
    "fleet": ("fleet", "{log}", "{again}", "-o", "{place}"),
    "simulate": ("simulate", "{sheet}", "--hours", "0.5", "-o", "{place}/s.csv"),
    "identify": ("identify", "{log}", "--json", "{place}/i.json", "--figure", "{place}/f.png"),
    "diagnose": ("diagnose", "{log}", "--json", "{place}/d.json", "--page", "{place}/d.html", "--jobs", "2"),
    "check": ("check", "{sheet}", "--runs", "2", "--duration", "60", *("--json", "{place}/c.json")),
    "navigate": ("navigate", "{drive}", "--config", "mpu9250", "-o", "{place}"),
    "export": ("export", "{sheet}", "--to", "kalibr", "-o", "{place}/imu.yaml"),
}
"""Commands that write a folder, files one by one, or a file and its companion; both sources differ in every byte."""


def log(path: Path, sd: float) -> Path:
    rng = np.random.default_rng(16)
    np.savez(path, t=0.01 * np.arange(3000), gyro_x=rng.normal(0.0, sd, 3000), gyro_unit="rad/s")
    return path


def drive(path: Path, sd: float) -> Path:
    """Two minutes: at rest, north with 1 m/s² for 10 s, on; a fix a second."""
    rng = np.random.default_rng(16)
    t, fixes = 0.01 * np.arange(12_000), np.arange(120.0)
    ahead = np.clip(fixes - 30.0, 0.0, 10.0)
    north = 0.5 * ahead**2 + 10.0 * np.clip(fixes - 40.0, 0.0, None)
    accel = rng.normal(0.0, 20.0 * sd, (len(t), 3)) - [0.0, 0.0, 9.81]
    accel[:, 0] += (t >= 30.0) & (t < 40.0)
    np.savez(
        path,
        imu_t=t,
        gyro=rng.normal(0.0, sd, (len(t), 3)),
        accel=accel,
        gnss_t=fixes,
        gnss_llh=np.column_stack([48.0 + north / 111e3, 0.0 * north + 11.0, 0.0 * north + 500.0]),
        gnss_vned=np.column_stack([ahead, 0.0 * ahead, 0.0 * ahead]),
        gnss_pstd=np.ones((len(fixes), 3)),
        meta=json.dumps({"imu_frame": "FRD", "lever_arm_frd_m": [0.0, 0.0, 0.0]}),
    )
    return path


def state(folder: Path) -> tuple[dict[str, str], list[str]]:
    """The digests of the files of a result, and those that do not fit it."""
    last = next((folder / name for name in ("result.json", "fleet.json") if (folder / name).exists()), None)
    if last is not None:
        return json.loads(last.read_text())["files"], stale_files(last)
    files = sorted(p for p in folder.glob("[!.]*") if p.is_file()) if folder.exists() else []
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in files}, []


def leftovers(folder: Path) -> list[str]:
    return sorted(
        p.name for p in [*folder.parent.glob(".*"), *(folder.glob(".*") if folder.exists() else ())]
    )


def started(command: str, source: Path, folder: Path) -> subprocess.Popen[bytes]:
    words = {"log": source, "again": source.with_stem("again"), "sheet": source.stem, "place": folder}
    words["drive"] = source.with_stem(f"{source.stem}-drive")
    arguments = [word.format(**words) for word in COMMANDS[command]]
    return subprocess.Popen(
        [sys.executable, "-m", "tuner", *arguments, *(() if command == "export" else ("--quiet",))],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


def still_at_work(session: int) -> list[str]:
    """Processes of a session that have not ended."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state_, _, group = stat.read_text().rpartition(")")[2].split()[:3]
            found += [stat.parent.name] if int(group) == session and state_ != "Z" else []
    return found


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_runs_that_are_ended_at_any_moment(tmp_path: Path, command: str) -> None:
    """Each file is that of one run or the other; of commands that write a folder, all are of one."""
    log(tmp_path / "again.npz", 3e-3)
    sources = [log(tmp_path / "mpu9250.npz", 1e-3), log(tmp_path / "stim300.npz", 2e-3)]
    for source, sd in zip(sources, (1e-3, 2e-3), strict=True):
        drive(source.with_stem(f"{source.stem}-drive"), sd)
    whole = []
    for number, source in enumerate(sources):
        begin = time.monotonic()
        place = tmp_path / f"whole{number}" / "unit"
        place.parent.mkdir()
        assert started(command, source, place).wait() == 0
        whole.append(state(place)[0])
    length = time.monotonic() - begin
    rng = np.random.default_rng(16)
    folder = tmp_path / "results" / "unit"
    folder.parent.mkdir()
    ended, left = 0, set[str]()
    for round_ in range(ENDS // len(COMMANDS)):
        running = started(command, sources[round_ % 2], folder)
        late = rng.random() < 0.5  # half of them in the last part, where files are written
        time.sleep(float(rng.uniform(0.7 if late else 0.0, 1.1) * length))
        number = [signal.SIGKILL, signal.SIGTERM, signal.SIGINT][round_ % 3]
        running.send_signal(number)
        begin = time.monotonic()
        ended += running.wait(60) != 0
        assert number == signal.SIGKILL or time.monotonic() - begin < 30.0, round_
        time.sleep(0.1)
        assert not still_at_work(running.pid), round_
        digests, stale = state(folder)
        if command in ("tune", "fleet", "navigate"):
            assert digests in ({}, *whole), round_
        else:
            assert all(digest in (w[name] for w in whole) for name, digest in digests.items()), round_
        assert not stale, round_
        assert number == signal.SIGKILL or set(leftovers(folder)) <= left, round_
        left = set(leftovers(folder))  # by runs that were killed; the next that writes removes it
    print(f"{ended} runs of {length:.1f} s were ended; left by kills: {left}")  # noqa: T201
    assert started(command, sources[0], folder).wait() == 0
    assert not leftovers(folder)


@pytest.mark.slow
@pytest.mark.parametrize("limit", [0, 16384, 65536])
def test_no_room_to_write(tmp_path: Path, limit: int) -> None:
    source, folder = log(tmp_path / "one.npz", 1e-3), tmp_path / "out" / "unit"
    assert started("tune", source, folder).wait() == 0
    before = state(folder)
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "tuner",
            "tune",
            str(log(tmp_path / "other.npz", 2e-3)),
            "-o",
            str(folder),
            "--quiet",
        ],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
        capture_output=True,
        check=False,
    )
    assert done.returncode == 2
    assert b"File too large" in done.stderr
    assert str(folder).encode() in done.stderr
    assert b"Traceback" not in done.stderr
    assert (state(folder), leftovers(folder)) == (before, [])
