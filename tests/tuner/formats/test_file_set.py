"""A set of files is the old one or the new one, whatever happens, and what is not of the set stays."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tuner.formats import file_set
from tuner.formats.file_set import MANIFEST, digests, stale_files, write_set
from tuner.formats.files import write_text
from tuner.types.records import DataError

LAST = "result.json"


def made(tag: str, *names: str) -> dict[str, bytes]:
    """A set whose every file begins with its tag."""
    files = {name: f"{tag} {name}\n".encode() * 20_000 for name in names or ("a.yaml", "b.svg", "c.html")}
    return files | {LAST: json.dumps({"tag": tag, MANIFEST: digests(files)}).encode()}


def tags(folder: Path) -> set[str]:
    """The tags of the files of a set."""
    found = {path.read_text()[:40].split(" ")[0] for path in folder.iterdir() if path.name != LAST}
    return found | {json.loads((folder / LAST).read_text())["tag"]}


def leftovers(folder: Path) -> list[str]:
    return [p.name for parent in (folder, folder.parent) for p in parent.glob(".*") if parent.is_dir()]


@pytest.fixture(params=["exchange", "one by one"])
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    if request.param == "one by one":
        monkeypatch.setattr(file_set, "_exchange", lambda *_: False)
    return str(request.param)


def test_a_set_replaces_another(tmp_path: Path, way: str) -> None:
    folder = tmp_path / "out" / "unit"
    write_set(folder, made("old", "a.yaml", "key.json"), last=LAST)
    (folder / "mine.txt").write_text("new mine")
    write_set(folder, made("new"), last=LAST)
    assert sorted(p.name for p in folder.iterdir()) == ["a.yaml", "b.svg", "c.html", "mine.txt", LAST]
    assert tags(folder) == {"new"}
    assert stale_files(folder / LAST) == []
    assert leftovers(folder) == []


def test_permissions_and_links_to_folders_are_kept_and_other_files_are_not_written(
    tmp_path: Path, way: str
) -> None:
    folder, link = tmp_path / "real", tmp_path / "link"
    write_set(folder, made("old"), last=LAST)
    link.symlink_to(folder)
    (folder / "a.yaml").chmod(0o640)
    folder.chmod(0o750)
    (folder / "b.svg").unlink()
    (tmp_path / "elsewhere.svg").write_text("mine")
    (folder / "b.svg").symlink_to(tmp_path / "elsewhere.svg")
    write_set(link, made("new"), last=LAST)
    assert link.is_symlink()
    assert not (folder / "b.svg").is_symlink()
    assert (tmp_path / "elsewhere.svg").read_text() == "mine"
    assert tags(folder) == {"new"}
    assert [(folder / "a.yaml").stat().st_mode & 0o777, folder.stat().st_mode & 0o777] == [0o640, 0o750]


def test_the_working_folder_stays_the_working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    before = tmp_path.stat().st_ino
    for tag in ("old", "new"):
        write_set(Path(), made(tag), last=LAST)
    assert tmp_path.stat().st_ino == before
    assert tags(tmp_path) == {"new"}


def test_a_set_that_was_cut_off_is_recognized(tmp_path: Path) -> None:
    write_set(tmp_path / "out", made("old"), last=LAST)
    (tmp_path / "out" / "b.svg").write_bytes(made("new")["b.svg"])
    (tmp_path / "out" / "c.html").unlink()
    assert stale_files(tmp_path / "out" / LAST) == ["b.svg", "c.html"]


def test_a_set_that_cannot_be_written_leaves_the_old_one(
    tmp_path: Path, way: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_set(tmp_path / "out", made("old"), last=LAST)

    def full(*_: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space"):
        write_set(tmp_path / "out", made("new"), last=LAST)
    assert tags(tmp_path / "out") == {"old"}
    assert leftovers(tmp_path / "out") == []


def test_a_link_to_itself_is_an_error_of_the_system(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(OSError, match="symbolic links"):
        write_set(tmp_path / "loop", {"a.json": b"{}"}, last="a.json")


def test_folders_of_killed_processes_are_removed(tmp_path: Path) -> None:
    (tmp_path / f".tuner-{2**22 + 1}-x").mkdir()
    living = tmp_path / f".tuner-{os.getpid()}-x"
    living.mkdir()
    write_set(tmp_path / "out", made("new"), last=LAST)
    assert leftovers(tmp_path / "out") == [living.name]


def test_a_single_file_keeps_permissions_and_a_link_is_replaced_itself(tmp_path: Path) -> None:
    real, link = tmp_path / "real.json", tmp_path / "link.json"
    real.write_text("old")
    real.chmod(0o600)
    write_text(real, "mine")
    link.symlink_to(real)
    write_text(link, "new")
    assert not link.is_symlink()
    assert link.read_text() == "new"
    assert (real.read_text(), real.stat().st_mode & 0o777) == ("mine", 0o600)


def test_no_pipe_and_no_link_of_the_system_is_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for place in (tmp_path / "pipe", Path("/dev/stdout")):
        with pytest.raises(DataError, match="expected the name of a file"):
            write_text(place, "new")


WRITER = """
import signal, sys
from pathlib import Path
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell starts its background jobs without it
sys.path.insert(0, sys.argv[1])
from test_file_set import LAST, made
from tuner.cli.process import Terminated, termination
from tuner.formats.file_set import write_set
print("ready", flush=True)
with termination():
    try:
        for number in range(100_000):
            write_set(Path(sys.argv[2]), made(f"{sys.argv[3]}{number}"), last=LAST)
    except (KeyboardInterrupt, Terminated):
        pass
"""


def killed(folder: Path, number: signal.Signals, wait: float, *, writers: int = 1) -> None:
    """Have processes write sets without end, and end them after a while."""
    arguments = [sys.executable, "-c", WRITER, str(Path(__file__).parent), str(folder)]
    running = [subprocess.Popen([*arguments, f"p{i}-"], stdout=subprocess.PIPE) for i in range(writers)]
    for one in running:
        assert one.stdout is not None
        one.stdout.readline()
    time.sleep(wait)
    for one in running:
        one.send_signal(number)
    for one in running:
        one.wait(20)
        assert one.stdout is not None
        one.stdout.close()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_ended_while_writing(tmp_path: Path, number: signal.Signals) -> None:
    folder = tmp_path / "out"
    killed(folder, number, 0.3, writers=2)
    assert len(tags(folder)) == 1
    assert stale_files(folder / LAST) == []
    if number == signal.SIGKILL:
        write_set(folder, made("next"), last=LAST)
    assert leftovers(folder) == []


@pytest.mark.slow
def test_many_ends_while_writing(tmp_path: Path) -> None:
    rng = np.random.default_rng(16)
    for round_ in range(200):
        folder = tmp_path / f"{round_ % 5}" / "out"
        killed(
            folder, [signal.SIGTERM, signal.SIGINT, signal.SIGKILL][round_ % 3], float(rng.uniform(0.0, 0.3))
        )
        if folder.exists():
            assert len(tags(folder)) == 1, round_
            assert stale_files(folder / LAST) == []
