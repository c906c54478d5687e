"""`check` with filterpy: both engines agree on the same runs, and a difference between them is found and named."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

import tuner
from tuner.cli import run
from tuner.consistency import compare_engines
from tuner.navigation import engine
from tuner.report.consistency_answer import engine_line
from tuner.types.consistency import EngineComparison
from tuner.types.records import DataError


def checked(**options):
    return tuner.check("mpu9250", duration=60.0, runs=3, seed=4, **options)


def test_both_engines_agree_on_the_first_runs_and_the_scores_stay(monkeypatch):
    """6000 samples a run, 12 500 in all: two runs of three. Rounding leaves 1e-11 to 1e-8 of an sd, never nothing."""
    monkeypatch.setattr(compare_engines, "COMPARED_STEPS", 12_500)
    found, usual = checked(engine="filterpy"), checked()
    assert usual.engines is None
    assert found.consistency == usual.consistency
    assert found.honest == usual.honest
    assert (found.engines.runs, found.engines.simulated) == (2, 3)
    assert found.engines.agree
    assert 0.0 < found.engines.difference < 1e-8


@pytest.mark.parametrize(
    "change",
    [{"gravity_excess": 1e-3}, {"covariance_step": 0.5}, {"lever_arm": (0.01, 0.0, 0.0)}],
    ids=["mechanisation", "covariance", "fixes"],
)
def test_engines_that_differ_are_named_with_place_and_size(monkeypatch, change):
    """Gravity 1e-3 m/s² too large, steps of P of 0.5 s, a lever arm of 1 cm: none would show in a score."""
    compiled = engine.run
    monkeypatch.setattr(engine, "run", lambda settings, *data: compiled(replace(settings, **change), *data))
    found = checked(engine="filterpy")
    assert not found.engines.agree
    assert not found.honest
    line = engine_line(found.engines)
    assert line.startswith(f"Engines differ: filterpy and compiled in {found.engines.state}, ")
    assert f"run {found.engines.run} at {found.engines.t:g} s" in line
    assert "agree" not in line


def test_the_command_says_that_engines_differ_and_strict_fails(monkeypatch, capsys):
    compiled = engine.run
    monkeypatch.setattr(
        engine, "run", lambda settings, *data: compiled(replace(settings, gravity_excess=1e-3), *data)
    )
    words = ["check", "mpu9250", "--duration", "60", "--runs", "2", "--quiet", "--strict"]
    assert run([*words, "--engine", "filterpy"]) == 1
    said = capsys.readouterr().out
    assert "Engines differ: filterpy and compiled in " in said
    assert "Engines agree" not in said


def test_an_engine_without_a_number_does_not_agree():
    found = EngineComparison(1, 25, math.nan, "heading", 1, 12.0)
    assert not found.agree
    assert (
        engine_line(found)
        == "Engines differ: filterpy and compiled in heading, nan sd, run 1 at 12 s: trust no score"
    )


def test_filterpy_is_not_compared_with_itself_where_numba_is_missing(monkeypatch):
    """The fallback of the compiled filter is the readable one: they would agree, whatever either computes."""
    monkeypatch.setattr(engine, "_compiled", lambda: None)
    with pytest.raises(DataError, match="expected numba"):
        compare_engines.compare_engines(None, None, None, runs=1, seed=0)


def test_an_unknown_engine_is_refused_in_one_line(capsys):
    with pytest.raises(DataError, match=r"^check: engine: expected 'compiled' or 'filterpy', found 'numpy'$"):
        checked(engine="numpy")
    assert run(["check", "mpu9250", "--engine", "numpy"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
