"""Another program's filter as a command line: run in a folder of its own, with a limit of time.

``{config}``, ``{drive}``, ``{imu}``, ``{gnss}`` and ``{output}`` in the command stand for paths. Words that name a file
below the present folder are made absolute, as the program runs in another one.
"""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import signal
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tuner.types.one_line import printable
from tuner.types.records import DataError

PATH_PLACEHOLDERS = ("config", "drive", "imu", "gnss", "output")
"""What may stand in braces."""
MAX_MESSAGE = 300
"""Characters of a program's last line that are shown."""


@dataclass(frozen=True)
class Program:
    """A command that filters a drive.

    Attributes
    ----------
    words : tuple of str
        The command and its arguments, placeholders in braces.
    time_limit : float
        Longest time of a run, s.
    """

    words: tuple[str, ...]
    time_limit: float

    def names(self, placeholder: str) -> bool:
        """Tell whether the command has a placeholder."""
        return any(f"{{{placeholder}}}" in word for word in self.words)

    def run(self, paths: Mapping[str, Path], folder: Path) -> None:
        """Run the command in a folder.

        Raises
        ------
        DataError
            Where it cannot be started, fails or takes too long, with its last line.
        """
        words = [_filled(word, paths) for word in self.words]
        out, err = folder / "stdout.txt", folder / "stderr.txt"
        with out.open("wb") as standard, err.open("wb") as errors:
            try:
                process = subprocess.Popen(
                    words,
                    cwd=folder,
                    stdin=subprocess.DEVNULL,
                    stdout=standard,
                    stderr=errors,
                    start_new_session=True,
                )
            except OSError as error:
                raise DataError(
                    f"--filter: {words[0]}: expected a program, found none that starts: {error.strerror}"
                ) from None
            try:
                status = process.wait(self.time_limit)
            except subprocess.TimeoutExpired:
                _end(process)
                raise DataError(
                    f"--filter: {words[0]}: expected an end within {self.time_limit:g} s, found none: "
                    "--filter-timeout SECONDS allows more"
                ) from None
            except BaseException:
                _end(process)
                raise
        if status != 0:
            how = f"exit status {status}" if status > 0 else f"signal {-status}"
            raise DataError(
                f"--filter: {words[0]}: {how}: {_last_line(err) or _last_line(out) or 'it printed nothing'}"
            )


def program_of(command: str, *, time_limit: float) -> Program:
    """Return the program of a command line.

    Raises
    ------
    DataError
        Where it has no ``{config}``, or a placeholder that is not known.
    """
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise DataError(f"--filter: expected a command line, found {command!r}: {error}") from None
    named = {name for word in words for name in re.findall(r"\{(\w+)\}", word)}
    if unknown := sorted(named - set(PATH_PLACEHOLDERS)):
        raise DataError(
            f"--filter: expected {', '.join(f'{{{name}}}' for name in PATH_PLACEHOLDERS)}, found {{{unknown[0]}}}"
        )
    if "config" not in named:
        raise DataError(
            "--filter: expected {config}, where the program gets the path of its settings, found none"
        )
    return Program(tuple(_absolute(word) for word in words), time_limit)


def _absolute(word: str) -> str:
    return str(Path(word).absolute()) if not Path(word).is_absolute() and Path(word).is_file() else word


def _filled(word: str, paths: Mapping[str, Path]) -> str:
    for name, path in paths.items():
        word = word.replace(f"{{{name}}}", str(path))
    return word


def _end(process: subprocess.Popen[Any]) -> None:
    """End a program and all that it started."""
    with contextlib.suppress(OSError):
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
    process.wait()


def _last_line(path: Path) -> str:
    """Return the last line that says something, without control characters."""
    lines = path.read_text(encoding="utf-8", errors="replace").replace("\r", "\n").split("\n")
    said = [line.strip() for line in lines if line.strip()]
    return printable(said[-1])[-MAX_MESSAGE:] if said else ""
