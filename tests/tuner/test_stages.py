"""How far a long computation is: shares of tasks within tasks."""

from __future__ import annotations

import pytest

from tuner.stages import counted, finished, reached, stage, task, watched


@task()
def _inner():
    stage("first", 0.5)
    stage("second", 1.0)


def _failing():
    for _ in counted(range(3)):
        raise KeyError


def test_a_task_within_a_stage_takes_the_share_of_that_stage():
    seen = []
    with watched(lambda *told: seen.append(told)):
        stage("before", 0.2)
        _inner()
        stage("after", 1.0)
        reached(1, 4)
        finished()
    assert seen == [
        ("before", 0.0, 0.2),
        ("first", 0.0, 0.1),
        ("second", 0.1, 0.2),
        ("after", 0.2, 1.0),
        ("after", 0.4, 1.0),
        ("", 1.0, 1.0),
    ]


def test_items_share_their_stage_alike_and_what_they_do_is_part_of_theirs():
    seen = []
    with watched(lambda doing, share, _until: seen.append((doing, round(share, 9)))):
        stage("counting", 0.5)
        for _ in counted(range(2)):
            _inner()
        stage("rest", 1.0)
    assert seen == [
        ("counting", 0.0),
        ("counting", 0.0),
        ("first", 0.0),
        ("second", 0.125),
        ("counting", 0.25),
        ("first", 0.25),
        ("second", 0.375),
        ("rest", 0.5),
    ]


def test_nothing_happens_where_nobody_watches_and_an_error_leaves_the_stage_as_it_was():
    _inner()
    seen = []
    with watched(lambda *told: seen.append(told)):
        stage("outer", 0.5)
        with pytest.raises(KeyError):
            _failing()
        reached(1, 2)
        with watched(None):
            _inner()
    assert seen[-1] == ("outer", 0.25, 0.5)
    assert list(counted("ab")) == ["a", "b"]
