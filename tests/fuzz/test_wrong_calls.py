"""Wrong calls of all verbs end in a DataError, ValueError or TypeError of the project, in one line."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fuzz.wrong_calls import HUGE, outcome, verbs, wrong_calls

import tuner
from tuner import pipeline
from tuner.types.public import public
from tuner.types.records import DataError


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a log of one axis; what `tune` checks where a wrong call is taken is short."""
    monkeypatch.setattr(pipeline, "CHECK_RUNS", 2)
    monkeypatch.setattr(pipeline, "CHECK_DURATION", 60.0)
    path = tmp_path / "log.npz"
    np.savez(path, t=0.01 * np.arange(300), gyro_x=np.random.default_rng(1).normal(0.0, 1e-3, 300))
    return path


def refused(count: int, seed: int, log: Path) -> list[str]:
    """Return what was not refused in one line."""
    calls = wrong_calls(count, seed, log)
    assert min(Counter(call.verb for call in calls).values()) >= count // len(verbs())
    return [f"{call}: {found}" for call in calls if (found := outcome(call)) != "refused"]


def test_wrong_calls_are_refused_in_one_line(log: Path) -> None:
    assert refused(300, 5, log) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_thousand_wrong_calls_are_refused_in_one_line(seed: int, log: Path) -> None:
    assert refused(1000, seed, log) == []


def test_a_refusal_names_verb_argument_expected_and_found() -> None:
    for call, line in (
        (lambda: tuner.tune(horizon=-1.0), "tune: horizon: expected a positive number, found -1.0"),
        (lambda: tuner.check("fog", runs=True), "check: runs: expected a whole number from 2 on, found True"),
        (lambda: tuner.choose(outage=HUGE), "choose: outage: expected a number, found int"),
        (lambda: tuner.compare("fog", b"fog"), r"compare: sources: expected a text, .*, found b'fog'"),
        (
            lambda: tuner.export("fog", "kalibr", step="1"),
            "export: step: expected a positive number or None, found '1'",
        ),
    ):
        with pytest.raises(DataError, match=f"^{line}$"):
            call()
    with pytest.raises(TypeError, match=r"^plan: got an unexpected keyword argument 'hour'$"):
        tuner.plan("fog", hour=1.0)  # type: ignore[call-arg]


def test_what_annotations_allow_is_passed_on() -> None:
    @public("f")
    def f(
        number: float, names: list[str] | None = None, *more: int | np.integer[Any], **rest: object
    ) -> object:
        return number, names, more, rest

    assert f(np.float32(1.0)) == (1.0, None, (), {})
    assert f(3, ["a"], 1, np.int64(2), x=1) == (3, ["a"], (1, 2), {"x": 1})
    for wrong in ((True,), (1.0, "a"), (1.0, ["a", 1]), (1.0, None, 2.5)):
        with pytest.raises(DataError, match=r"^f: "):
            f(*wrong)
