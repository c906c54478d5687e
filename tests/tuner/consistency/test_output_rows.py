"""Rows that repeat the one before are no rows, and sds of zero are not stated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tuner.consistency.output_rows import with_stated_sds, without_repeats
from tuner.consistency.score_output import score_outputs
from tuner.types.filter_output import filter_output

N = 300
PLACE = np.cumsum(np.random.default_rng(1).standard_normal((N, 3)), axis=0)


def output(place=PLACE, sd=1.0):
    covariance = np.full((len(place), 15, 15), np.nan)
    covariance[:, :3, :3] = sd**2 * np.eye(3)
    return filter_output("out", np.arange(float(len(place))), local=place, covariance=covariance)


def test_every_second_row_that_repeats_is_left_out_and_said():
    found = without_repeats(output(np.repeat(PLACE[::2], 2, axis=0)))
    assert len(found) == N // 2
    assert found.notes == ("out: 50 % of its rows repeat the one before: they are left out",)


def test_a_filter_that_ends_in_no_numbers_diverged():
    """Its rows repeat nothing."""
    place = PLACE.copy()
    place[-50:] = np.nan
    assert score_outputs(
        [output(place)], [filter_output("truth", np.arange(float(N)), local=PLACE)]
    ).consistency.diverged


def test_a_filter_that_hangs_repeats_no_rows():
    """It was honest: the rows in which it stood while the vehicle went on were left out."""
    place = PLACE.copy()
    place[100:] = place[100]
    assert len(without_repeats(output(place))) == N


def test_a_zero_of_one_axis_is_told():
    covariance = output().covariance.copy()
    covariance[:, 2, 2] = 0.0
    (note,) = with_stated_sds(replace(output(), covariance=covariance)).notes
    assert note.startswith("out: sds of position down are zero in all rows")


def test_rows_that_differ_and_a_unit_that_never_moves_stay():
    assert without_repeats(output()).notes == ()
    assert len(without_repeats(output(np.ones((N, 3))))) == N


def test_sds_of_zero_are_told_and_no_filter_diverged_by_them():
    assert with_stated_sds(output()).notes == ()
    found = score_outputs(
        [output(sd=0.0)], [replace(output(PLACE + 0.5), covariance=np.full((N, 15, 15), np.nan))]
    )
    assert any("sds of position are zero in all rows" in note for note in found.notes)
    assert not found.consistency.diverged
    assert found.consistency.errors["position"].values[0] == 0.5
