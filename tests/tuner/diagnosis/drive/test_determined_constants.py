"""Which constants of an installation a drive determines: the others are found, and enter no setting."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from typing import Any, cast

import numpy as np
import pytest

from tuner.diagnosis.drive.cause_test import MIN_FACTOR
from tuner.diagnosis.drive.diagnose import not_named
from tuner.diagnosis.drive.findings import finding, of_first_and_last
from tuner.diagnosis.drive.hypothesis_tests import Candidate
from tuner.diagnosis.drive.plausibility import reasons
from tuner.diagnosis.drive.score_tests import undetermined
from tuner.diagnosis.drive.search import Accepted, SearchResult
from tuner.diagnosis.static.outcome import TestResult
from tuner.linear_run.whitened_innovations import WhitenedInnovations
from tuner.navigation.determined import determined_by_halves
from tuner.report.drive_answer import found_text
from tuner.report.drive_diagnosis_tables import drive_diagnosis_answer, unnamed_noise
from tuner.report.static_diagnosis_tables import finding_tables
from tuner.types import (
    Coefficient,
    Compensation,
    DriveDiagnosis,
    FilterConfig,
    Finding,
    NoiseScaleEstimate,
    Parameter,
)
from tuner.types.records import Drive

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


@pytest.mark.parametrize(("delay", "said"), [(-0.185, "early"), (0.185, "late")])
def test_a_delay_that_the_clock_shows_is_stated_with_its_sign(delay: float, said: str) -> None:
    # Seen: fixes 0.185 s early, "stamps of positions and velocities are late → shift the stamps".
    nothing: dict[str, Any] = {one.name: () for one in fields(SearchResult)}
    one = Accepted(Candidate(TestResult("time_offset", 1e-9, 50.0, 100.0, "score")), {})
    found = {**nothing, "accepted": (one,), "shifts": ("time_offset",)}
    unclear = SearchResult(**{**found, "undetermined": (Parameter("time_offset", "delay"),)})
    shown = unclear.as_measured(
        {"time_offset": {"delay": Coefficient.known(delay, delay - 0.015, delay + 0.015, "s")}}
    )
    named = finding(shown.accepted[0], cast(Drive, None), None, shown.doubted(shown.accepted[0]))
    assert found_text(named) == f"Stamps of positions and velocities are {said}, by 0.185 ± 0.015 s"
    assert f"velocities are {said} (delay {delay} ± 0.015 s)" in named.text


def test_the_delay_of_a_clock_that_drifts_is_that_of_the_first_and_the_last_fix() -> None:
    # Seen: "early, by 0.185 ± 0.015 s" beside "their delay shrinks by 0.00031 s a second".
    def known(cause: str, **values: float) -> Accepted:
        result = TestResult(cause, 1e-9, 50.0, 100.0, "score")
        return Accepted(
            Candidate(result),
            {
                name: Coefficient.known(x, x - 0.1 * abs(x), x + 0.1 * abs(x), "s")
                for name, x in values.items()
            },
        )

    both = known("time_offset", delay=-0.2), known("clock_drift", rate=-2e-4)
    told, drift = of_first_and_last(both, np.array([100.0, 300.0, 600.0]))
    assert drift == both[1]
    named = finding(told, cast(Drive, None), None)
    shown = "Stamps of positions and velocities are early, at 100 s 0.150 ± 0.021 s, at 600 s 0.250 ± 0.021 s"
    assert found_text(named) == shown
    assert of_first_and_last(both[:1], np.array([100.0, 600.0])) == both[:1]


FACTORS = {
    "position_horizontal": Coefficient.bounded(0.0027, "1", "at its bound"),
    "velocity_horizontal_class_0": Coefficient.known(0.6, 0.57, 0.63, "1"),
    "velocity_horizontal_class_1": Coefficient.known(2.0, 0.1, 40.0, "1"),
    "velocity_edge_1": Coefficient(0.05, None, None, "m/s"),
    "velocity_exponent": Coefficient.known(0.02, -0.1, 0.14, "1"),
}


def test_figures_at_their_bound_or_too_wide_are_neither_shown_nor_written() -> None:
    # Seen: "(position horizontal below 0.00475 …) → scale the standard deviations of the fixes".
    nothing: dict[str, Any] = {one.name: () for one in fields(SearchResult)}
    one = Accepted(Candidate(TestResult("gnss_noise_scale", 1e-9, 50.0, 100.0, "likelihood ratio")), FACTORS)
    outcome = SearchResult(**{**nothing, "accepted": (one,)})
    assert outcome.doubted(one) == ("position_horizontal", "velocity_horizontal_class_1")
    named = finding(one, cast(Drive, None), None, outcome.doubted(one))
    drive = DriveDiagnosis((named,), cast(FilterConfig, None), cast(FilterConfig, None))
    cells = [str(list(column.cells)) for column in finding_tables([named], "")[0].columns]
    shown = "\n".join([named.text, re.sub("0x[0-9a-f]+", "", str(drive_diagnosis_answer(drive))), *cells])
    assert "0.0027" not in shown
    assert "40" not in shown
    assert set(named.extension["parameters"]) == set(FACTORS) - set(named.doubted)
    values = {
        "gnss_noise_scale.position_horizontal": 0.03,
        "gnss_noise_scale.velocity_horizontal": 0.5,
        "gnss_noise_scale.velocity_horizontal_class_0": 1.2,
        "gnss_noise_scale.velocity_horizontal_class_1": 4.0,
    }
    assert outcome.determined(Compensation.parse(values)).as_text() == {
        "gnss_noise_scale.velocity_horizontal": 0.5,
        "gnss_noise_scale.velocity_horizontal_class_0": 1.2,
        "gnss_noise_scale.velocity_horizontal_class_1": 2.0,  # as reported: 1/0.5
    }


def test_noise_that_is_only_bounded_is_no_line_of_the_answer() -> None:
    bound = Coefficient.bounded(0.003, "1", "indistinguishable from none")
    scale = NoiseScaleEstimate("position", 1.0, "m", bound, bound, ("unknown",), True, "")
    assert not unnamed_noise([scale], [])


def test_factors_that_may_be_one_beside_one_at_its_bound_name_nothing() -> None:
    # Seen: "position below 0.005, velocity 0.995 ± 0.091 → scale the standard deviations".
    figures = {
        "position_vertical": FACTORS["position_horizontal"],
        "velocity_vertical": Coefficient.known(0.995, 0.9, 1.09, "1"),
    }
    named = Finding("gnss_noise_scale", ("gnss",), "", 9.0, 1e-9, figures, "")
    assert not list(reasons(named, 1000.0))
    named = replace(named, doubted=("position_vertical",))
    assert list(reasons(named, 1000.0)) == ["only position vertical, at a bound"]
    off = figures | {"velocity_vertical": FACTORS["velocity_horizontal_class_0"]}
    assert not list(reasons(replace(named, parameters=off), 1000.0))


def test_a_cause_that_is_named_is_not_among_the_unexplained() -> None:
    # Seen: "not explained: gnss_noise_scale …; with a cause: gnss noise scale".
    tests = [
        Candidate(TestResult(cause, 1e-9, 50.0, 100.0, "likelihood ratio"))
        for cause in ("gnss_noise_scale", "imu_noise_scale")
    ]
    left = not_named(tests, ("gnss_noise_scale", "lever_arm"))
    assert [one.statistic for one in left] == ["imu_noise_scale: likelihood ratio"]
