"""No damaged file ends in a traceback, a hang or nonsense: it is read, or refused in one line.

``TUNER_FUZZ=N`` sets the number of files of the slow run, ``TUNER_FUZZ_SEED`` its seed; what fails is kept in
``fuzz-failures/`` in the working folder.
"""

from __future__ import annotations

import os
import time
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from fuzz.damage import damaged
from fuzz.seeds import Seed, seeds

from tuner.readers import child_process
from tuner.types.one_line import printable
from tuner.types.records import DataError

QUICK = 12
"""Damaged files of each seed in the usual run."""
SLOW = int(os.environ.get("TUNER_FUZZ", "100000"))
LONGEST = 20.0
"""Seconds after which a file counts as a hang."""


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small files are read within a second, or never."""
    monkeypatch.setattr(child_process, "LONGEST_LISTING", 2.0)


def outcome(seed: Seed, content: bytes, path: Path) -> str:
    """Read a damaged file and say what happened: ``read``, ``refused``, or a complaint."""
    path.write_bytes(content)
    begin = time.monotonic()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            seed.read(path)
        found = "read"
    except DataError as error:
        message = str(error)
        found = "refused" if message and "\n" not in printable(message) else f"no line: {message!r}"
    except Exception as error:
        found = f"traceback: {type(error).__name__}: {error}"
    return found if time.monotonic() - begin < LONGEST else f"hang: {time.monotonic() - begin:.0f} s"


def run(count: int, seed: int, folder: Path, kept: Path | None = None) -> tuple[Counter[str], list[str]]:
    """Damage and read `count` files of every kind in turn; return how they ended, and the complaints."""
    ends: Counter[str] = Counter()
    complaints = []
    every = seeds()
    for number in range(count):
        one = every[number % len(every)]
        content = damaged(one.content, np.random.default_rng([seed, number]), text=one.text)
        (folder / one.name.partition(".")[0]).mkdir(exist_ok=True)
        found = outcome(one, content, folder / one.name.partition(".")[0] / one.name)
        ends[f"{one.name}: {found.partition(':')[0]}"] += 1
        if found not in ("read", "refused"):
            complaints.append(f"{one.name}, seed {seed}, number {number}: {found}")
            if kept is not None:
                kept.mkdir(exist_ok=True)
                (kept / f"{number}-{one.name}").write_bytes(content)
    return ends, complaints


@pytest.mark.parametrize("one", seeds(), ids=lambda one: one.name)
def test_the_seeds_themselves_are_read(one: Seed, tmp_path: Path) -> None:
    assert outcome(one, one.content, tmp_path / one.name) == "read"


def test_damaged_files_are_read_or_refused(tmp_path: Path) -> None:
    ends, complaints = run(QUICK * len(seeds()), 1, tmp_path)
    assert not complaints, complaints[:5]
    assert min(ends[f"{one.name}: refused"] for one in seeds()) > 0


@pytest.mark.slow
def test_many_damaged_files_are_read_or_refused(tmp_path: Path) -> None:
    seed = int(os.environ.get("TUNER_FUZZ_SEED", "16"))
    ends, complaints = run(SLOW, seed, tmp_path, Path("fuzz-failures"))
    print(dict(sorted(ends.items())))  # noqa: T201
    assert not complaints, complaints[:20]
