"""No advice leads to wrong numbers: refusals of logs of known truth, whose advice is followed as it is printed."""

from __future__ import annotations

import os
import re
import warnings
from collections import Counter
from pathlib import Path

import pytest
from fuzz.refusals import judge, spoilt

QUICK = 20
SLOW = int(os.environ.get("TUNER_REFUSALS", "300"))


def ends_of(refusals: int, seed: int, folder: Path) -> tuple[Counter[str], list[str]]:
    """Judge logs until so many were refused: how they ended, and the lines that must not be."""
    ends: Counter[str] = Counter()
    bad: list[str] = []
    for case in spoilt(10 * refusals, seed):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            end, said = judge(case, folder)
        ends[end] += 1
        if end == "wrong" or (end == "no advice" and not re.search(r"\d|YAML", said)):
            bad.append(f"{end}: {case.name}: {said}")
        if sum(ends.values()) - ends["read right"] - ends["read wrong"] == refusals:
            break
    return ends, bad


def test_advice_that_is_followed(tmp_path: Path) -> None:
    ends, bad = ends_of(QUICK, 40, tmp_path)
    assert not bad, bad
    assert ends["right"] > QUICK // 2


@pytest.mark.slow
def test_much_advice_that_is_followed(tmp_path: Path) -> None:
    ends, bad = ends_of(SLOW, 41, tmp_path)
    print(dict(ends))  # noqa: T201
    assert not bad, bad
