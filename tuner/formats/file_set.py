"""Files that belong together replace the former ones in one step: a reader sees the old set or the new one.

Where the operating system can exchange two names (Linux), the set is written into a sibling folder, brought to the
disk, and exchanged with the folder that was there. Elsewhere, and for the working folder itself, the files are written
beside the old ones and renamed at once, the one with the digests of the others last: where digests and files differ,
the writing was cut off, and `stale_files` names them.
"""

from __future__ import annotations

import ctypes
import errno
import hashlib
import json
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from tuner.formats.files import (
    STAGE,
    WRITING,
    mode_for,
    named,
    refuse_input,
    remove_abandoned,
    to_disk,
    umask,
    whole_file,
)

MANIFEST = "files"
"""Key of the last file of a set, JSON, under which it has the SHA-256 of the others."""
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2
"""Constants of renameat2(2) of Linux."""


def digests(files: Mapping[str, bytes]) -> dict[str, str]:
    """Return the SHA-256 of each file of a set."""
    return {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}


def write_set(directory: Path, files: Mapping[str, bytes], *, last: str) -> None:
    """Replace the set of files in a folder by another one.

    Parameters
    ----------
    directory : Path
        Made where it does not exist; a link to a folder stays one. Other files in it are kept. A link in the place of
        a file of the set is replaced itself.
    files : mapping of str to bytes
        Content of each file by its name.
    last : str
        The file that has the digests of the others: JSON with the key `MANIFEST`.

    Raises
    ------
    DataError
        Where a file of the set is an input of the running command.
    OSError
        What cannot be written; the old set is then there.
    """
    for name in files:
        refuse_input(directory / name)
    try:
        target = directory.resolve()
    except RuntimeError:  # what Python before 3.13 raises
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(directory)) from None
    target.parent.mkdir(parents=True, exist_ok=True)
    for parent in {target.parent, target}:
        remove_abandoned(parent)
    old = _manifest(target / last) | {last} if target.is_dir() else set()
    gone = old - files.keys()
    others = (
        [p for p in target.iterdir() if p.name not in files and p.name not in gone] if target.is_dir() else []
    )
    plain = all(p.is_file() and not p.is_symlink() for p in others)
    whole = not target.exists() or (plain and target.is_dir() and not _is_within(Path.cwd(), target))
    with WRITING, _uninterrupted(), named(target):
        if not whole or not _exchanged(target, files, others):
            _one_by_one(target, files, last, gone)


def stale_files(path: Path) -> list[str]:
    """Return the files of a set that are missing, or are not those that its last file was written with."""
    try:
        stated = json.loads(path.read_text(encoding="utf-8")).get(MANIFEST, {})
        wrong = [name for name, digest in stated.items() if _digest(path.with_name(name)) != digest]
    except (OSError, ValueError, AttributeError, TypeError):
        return []
    return wrong


def _digest(path: Path) -> str | None:
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else None


def _manifest(path: Path) -> set[str]:
    """Return the names of the files of a stored set, without those that lead out of its folder."""
    try:
        stated = json.loads(path.read_text(encoding="utf-8")).get(MANIFEST, {})
        return {str(name) for name in stated if Path(str(name)).name == str(name)}
    except (OSError, ValueError, AttributeError, TypeError):
        return set()


def _is_within(path: Path, folder: Path) -> bool:
    return path == folder or folder in path.parents


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Have requests to end wait until the set is written: a fraction of a second."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM, signal.SIGHUP})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _exchanged(target: Path, files: Mapping[str, bytes], others: Sequence[Path]) -> bool:
    """Write a set into a sibling folder and exchange it with `target`; False where the system cannot."""
    try:
        stage = Path(tempfile.mkdtemp(prefix=f"{STAGE}{os.getpid()}-", dir=target.parent))
    except OSError:  # the folder above may be closed to us
        return False
    try:
        for name, content in files.items():
            (stage / name).write_bytes(content)
            (stage / name).chmod(mode_for(target / name))
            to_disk(stage / name)
        for path in others:
            try:
                os.link(path, stage / path.name)
            except OSError:  # not every file system has links
                return False
        stage.chmod(target.stat().st_mode & 0o7777 if target.exists() else 0o777 & ~umask())
        to_disk(stage)
        if target.exists():
            if not _exchange(stage, target):
                return False
        else:
            stage.rename(target)
        to_disk(target.parent)
        return True
    finally:
        shutil.rmtree(stage, ignore_errors=True)


def _exchange(one: Path, other: Path) -> bool:
    """Exchange two names in one step, where the system can (Linux from 3.15 on)."""
    if not sys.platform.startswith("linux"):
        return False
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError):
        return False
    return int(rename(_AT_FDCWD, os.fsencode(one), _AT_FDCWD, os.fsencode(other), _RENAME_EXCHANGE)) == 0


def _one_by_one(target: Path, files: Mapping[str, bytes], last: str, gone: set[str]) -> None:
    """Write all files beside the old ones first, then rename them at once, the one with the digests last."""
    target.mkdir(parents=True, exist_ok=True)
    order = [*(name for name in files if name != last), last]
    with tempfile.TemporaryDirectory(prefix=f"{STAGE}{os.getpid()}-", dir=target) as folder:
        for name in order:
            with whole_file(Path(folder) / name) as temporary:
                temporary.write_bytes(files[name])
            (Path(folder) / name).chmod(mode_for(target / name))
        for name in order:
            (Path(folder) / name).replace(target / name)
    for name in gone:
        (target / name).unlink(missing_ok=True)
    to_disk(target)
