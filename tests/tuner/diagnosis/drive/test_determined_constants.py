"""Which constants of an installation a drive determines: the others are found, and enter no setting."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from tuner.diagnosis.drive.cause_test import MIN_FACTOR
from tuner.diagnosis.drive.linear_model.whitened_innovations import WhitenedInnovations
from tuner.diagnosis.drive.score_tests import undetermined
from tuner.diagnosis.drive.search import SearchResult
from tuner.navigation.determined import determined_by_halves
from tuner.types import Compensation, Parameter

ARM = tuple(Parameter("lever_arm", axis) for axis in "xyz")
ROWS = 4000


def rows(slope: np.ndarray, truth: np.ndarray, seed: int = 0) -> WhitenedInnovations:
    """Return whitened rows of constants (p,) with slopes (m, p) in unit white noise."""
    noise = np.random.default_rng(seed).standard_normal(len(slope))
    return WhitenedInnovations(np.arange(float(len(slope))), slope @ truth + noise, slope)


def test_a_component_that_moves_hardly_any_row_is_not_determined() -> None:
    # Priors of lever arms are 1 m: rows that know z to 1 m leave it where it was.
    slope = np.random.default_rng(1).standard_normal((ROWS, 3)) * [1.0, 1.0, 1.0 / np.sqrt(ROWS)]
    found = undetermined(rows(slope, np.array([0.5, -0.3, -1.2])), ARM, ("lever_arm",), np.zeros(3))
    assert found == ARM[2:]


def test_a_constant_that_differs_between_the_halves_is_not_determined() -> None:
    slope = np.random.default_rng(1).standard_normal((ROWS, 3))
    w = rows(slope, np.array([0.5, -0.3, -1.2]))
    assert undetermined(w, ARM, ("lever_arm",), np.zeros(3)) == ()
    later = np.where(np.arange(ROWS) < ROWS // 2, 0.0, 1.0)  # x is 1 m more in the second half
    changed = WhitenedInnovations(w.t, w.residual + later * slope[:, 0], w.slope)
    assert undetermined(changed, ARM, ("lever_arm",), np.zeros(3)) == ARM[:1]


def test_a_true_constant_far_outside_its_prior_is_determined() -> None:
    slope = np.random.default_rng(2).standard_normal((ROWS, 3))
    assert undetermined(rows(slope, np.array([8.0, 0.0, 0.0])), ARM, ("lever_arm",), np.zeros(3)) == ()


@pytest.mark.parametrize(("sd", "expected"), [(0.33, True), (0.34, False)])
def test_the_sd_is_at_most_a_third_of_the_prior(sd: float, expected: bool) -> None:
    half = np.zeros(1), np.array([1.5 * sd])
    assert determined_by_halves(half, half, np.array([sd]), 1.0).tolist() == [expected]


def test_a_factor_at_its_bound_and_an_undetermined_constant_enter_no_setting() -> None:
    # Seen: height factor "below 0.0006" applied as 0.02, sds of the fixes × 0.028.
    values = {
        "gnss_noise_scale.position_horizontal": 0.0668,
        "gnss_noise_scale.position_vertical": MIN_FACTOR,
        "gnss_noise_scale.position_horizontal_class_1": MIN_FACTOR,
        "gnss_noise_scale.position_edge_1": 0.01,  # a level in metres, no factor
        "lever_arm.x": 0.5,
        "lever_arm.z": -7.5,
        "time_offset.delay": 0.09,
    }
    nothing: dict[str, Any] = {one.name: () for one in fields(SearchResult)}
    result = SearchResult(**{**nothing, "undetermined": (Parameter("lever_arm", "z"),)})
    assert result.determined(Compensation.parse(values)).as_text() == {
        "gnss_noise_scale.position_horizontal": 0.0668,
        "gnss_noise_scale.position_edge_1": 0.01,
        "lever_arm.x": 0.5,
        "time_offset.delay": 0.09,
    }
