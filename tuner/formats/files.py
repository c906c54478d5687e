"""Files are written whole or not at all, and are on the disk before they replace what was there."""

from __future__ import annotations

import os
import shutil
import tempfile
import threading
from collections.abc import Callable, Iterator
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
        If a device, a pipe or a folder has that name.
    """
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
