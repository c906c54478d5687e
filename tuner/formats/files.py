"""Files are written whole or not at all, and are on the disk before they replace what was there."""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tuner.types.records import DataError

STAGE = ".tuner-"
"""Begin of the names of temporary files and folders beside a result; the number of the process follows."""
DEVICES = Path("/dev")
"""Where links such as ``/dev/stdout`` lead to what a process has open."""
WRITING = threading.Lock()
"""Locked while files that belong together are replaced: nothing may end the process then."""
_unfinished: set[Path] = set()
"""Temporary files and folders of this process, for the case that it must end without its usual ways."""

_inputs: list[set[tuple[int, int]]] = []
"""Device and number of each file that the running command reads, by block of `inputs_kept`."""

Put = Callable[[Path, bytes], None]
"""Writes the content of a file, or keeps it to be written with others."""


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; rename it to `path` on success, remove it on any failure.

    The temporary name keeps the suffix, so that libraries that choose the format by it work unchanged. A link is
    replaced itself, and what it leads to stays as it is. Permissions of a file that exists are kept.

    Raises
    ------
    DataError
        If a device, a pipe or a folder has that name, or an input of the running command.
    """
    refuse_input(path)
    if (path.exists() and not path.is_file()) or (path.is_symlink() and path.parent == DEVICES):
        raise DataError(f"{path}: expected the name of a file to write, found a device, a pipe or a folder")
    path.parent.mkdir(parents=True, exist_ok=True)
    remove_abandoned(path.parent)
    prefix = f"{STAGE}{os.getpid()}-{path.stem[:40]}-"
    handle, name = tempfile.mkstemp(prefix=prefix, suffix=path.suffix, dir=path.parent)
    os.close(handle)
    with temporary_place(Path(name)) as temporary, named(path):
        yield temporary
        temporary.chmod(mode_for(path))
        to_disk(temporary)
        temporary.replace(path)
        to_disk(path.parent)


@contextmanager
def inputs_kept(inputs: Iterable[Path] = ()) -> Iterator[None]:
    """Refuse in this block to write over these files, or over any that `keep_input` names."""
    before = _inputs.copy()
    _inputs.append(set())
    try:
        for path in inputs:
            keep_input(path)
        yield
    finally:
        _inputs[:] = before


def keep_input(path: Path) -> None:
    """Note that the running command reads a file; of no effect outside of `inputs_kept`."""
    number = _number_of(path)
    if _inputs and number is not None:
        _inputs[-1].add(number)


def refuse_input(path: Path) -> None:
    """Refuse to write over a file that the running command reads.

    Raises
    ------
    DataError
        One line.
    """
    number = _number_of(path)
    if any(number in kept for kept in _inputs):
        raise DataError(
            f"{path}: expected another file to write, found an input of this command, which would be lost"
        )


def _number_of(path: Path) -> tuple[int, int] | None:
    """Return what tells a file from all others, whatever its name is; None where there is none."""
    try:
        found = path.stat()
    except (OSError, ValueError):
        return None
    return (found.st_dev, found.st_ino) if stat.S_ISREG(found.st_mode) else None


@contextmanager
def named(path: Path) -> Iterator[None]:
    """Name the file in an error of the system that names none, such as that of a full disk."""
    try:
        yield
    except OSError as error:
        if error.filename is None and error.errno is not None:
            raise OSError(error.errno, error.strerror, str(path)) from None
        raise


@contextmanager
def temporary_place(path: Path) -> Iterator[Path]:
    """Remove a file or folder at the end of this block, or of the process (`remove_unfinished`)."""
    _unfinished.add(path)
    try:
        yield path
    finally:
        _remove(path)
        _unfinished.discard(path)


def remove_unfinished() -> None:
    """Remove every temporary file and folder: the process ends at once."""
    for path in tuple(_unfinished):
        _remove(path)


def remove_abandoned(folder: Path) -> None:
    """Remove what processes that were killed while they wrote have left in a folder."""
    for stage in folder.glob(f"{STAGE}*-*") if folder.is_dir() else ():
        process = stage.name.removeprefix(STAGE).partition("-")[0]
        if process.isdigit() and not _is_alive(int(process)):
            _remove(stage)


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write `text` as UTF-8, whole or not at all; halves of characters become ``?``."""
    write_bytes(path, text.encode("utf-8", errors="replace"))


def write_bytes(path: Path, content: bytes) -> None:
    """Write `content`, whole or not at all."""
    with whole_file(path) as temporary:
        temporary.write_bytes(content)


def mode_for(target: Path) -> int:
    """Return the permissions that a file will have: those it has, else those of a new one, also in place of a link."""
    kept = target.exists() and not target.is_symlink()
    return target.stat().st_mode & 0o7777 if kept else 0o666 & ~umask()


def to_disk(path: Path) -> None:
    """Have the content of a file, or the names of a folder, written to the disk, where the system can."""
    with suppress(OSError):  # folders cannot be opened on every system
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def umask() -> int:
    """Return the permissions that new files lack."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
