"""Settings after a drive: a factor, its interval and its reason are of one estimate, and nothing that is a bound."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tuner.diagnosis.drive.config_after_drive import as_estimated, config_after_drive, with_records
from tuner.diagnosis.drive.diagnose import ExaminedDrive
from tuner.diagnosis.drive.hypothesis import with_density_factors
from tuner.diagnosis.drive.noise_factors import with_recorded_factors
from tuner.diagnosis.drive.noise_scale_estimates import words
from tuner.invariants import Claims, violations
from tuner.report.claims import inflation_statements
from tuner.synthesis.rest_and_motion import with_rest_and_motion
from tuner.types import (
    AppliedNoiseScale,
    Coefficient,
    Compensation,
    DriveDiagnosis,
    FilterConfig,
    NoiseScaleEstimate,
    Quantity,
)
from tuner.types.judgement import Judgement, Use

PLAIN = {
    "gyro_white": Coefficient.known(14.5, 13.0, 16.1, "1"),
    "gyro_bias": Coefficient.bounded(7.83, "1", "indistinguishable from none"),
    "accel_bias": Coefficient.bounded(9.0, "1", "indistinguishable from none"),
    "position": Coefficient.known(0.9, 0.8, 1.01, "1"),
}
NAMED = {
    "gyro_white": Coefficient.known(7.7, 6.89, 8.6, "1"),
    "gyro_bias": Coefficient.known(3.52, 1.56, 5.69, "1"),
    "accel_bias": Coefficient.bounded(8.26, "1", "indistinguishable from none"),
    "position": Coefficient.known(0.391, 0.369, 0.414, "1"),
}
"""As a drive gave them: the settings had × 6.81, × 1, × 0.0088 and × 0.412 beside these reasons."""


@pytest.fixture
def examined(drive_config: FilterConfig) -> ExaminedDrive:
    scales = [
        NoiseScaleEstimate(name, 1.0, "1", PLAIN[name], NAMED[name], ("unknown",), True, "") for name in NAMED
    ]
    scales = [replace(one, text=words(one)) for one in scales]
    sds = Compensation.parse(
        {"gnss_noise_scale.position_horizontal": 0.5, "gnss_noise_scale.position_vertical": 0.3}
    )
    wrong = {"gyro_white": 6.81, "accel_white": 1.0, "gyro_bias": 1.0, "accel_bias": 0.0088}
    before = replace(
        drive_config,
        channels={
            axis: replace(one, random_walk_density=1e-6) for axis, one in drive_config.channels.items()
        },
    )
    after = replace(with_density_factors(before, wrong), compensation=sds)
    counted = np.ones((50, 6), dtype=bool)
    rows = SimpleNamespace(reported_sd=np.ones((50, 6)), counted=counted, solution=np.full(50, np.nan))
    search: Any = SimpleNamespace(base=None, final=SimpleNamespace(linearized=rows))
    found = DriveDiagnosis((), before, after, noise_scales=tuple(scales))
    return ExaminedDrive(cast(Any, SimpleNamespace(source="a drive", digest="")), search, found)


def of(config: FilterConfig) -> dict[str, AppliedNoiseScale]:
    return {str(one.quantity): one for one in config.inflations if isinstance(one, AppliedNoiseScale)}


def broken(config: FilterConfig) -> tuple[str, ...]:
    return violations(Claims(Judgement(Use.USABLE), statements=tuple(inflation_statements(config))))


def test_factor_interval_and_reason_are_of_one_estimate(examined: ExaminedDrive) -> None:
    before, after = examined.diagnosis.before, as_estimated(examined, examined.diagnosis.after)
    gyro, accel = after.channels["gyro_x"], after.channels["accel_x"]
    assert gyro.white_density == pytest.approx(7.7 * before.channels["gyro_x"].white_density)
    assert accel.random_walk_density == pytest.approx(1e-6)  # only bounded: as stated
    values = after.compensation.of("gnss_noise_scale")
    assert values["position_horizontal"] / values["position_vertical"] == pytest.approx(0.5 / 0.3)
    assert (2 * values["position_horizontal"] ** 2 + values["position_vertical"] ** 2) / 3 == pytest.approx(
        0.391**2
    )
    config = with_records(examined, after)
    records = of(config)
    assert {name: one.factor for name, one in records.items()} == {
        "gyro.white_density": 7.7,
        "gyro.markov": 1.0,
        "accel.markov": 1.0,
        "gnss.position_sd": 0.391,
    }
    assert records["gyro.white_density"].interval == (6.89, 8.6)
    assert "14.5" not in records["gyro.white_density"].reason
    assert "3.52" not in records["gyro.markov"].reason
    assert broken(config) == ()


def test_as_it_began_everything_is_as_stated(examined: ExaminedDrive) -> None:
    config = config_after_drive(examined, kept=False)
    assert {one.factor for one in of(config).values()} == {1.0}
    assert broken(config) == ()


def test_factors_for_outages_are_listed_once_with_the_whole_factor(examined: ExaminedDrive) -> None:
    """Seen: "gnss.position_sd × 0.20" twice, called an enlargement."""
    config = with_records(examined, as_estimated(examined, examined.diagnosis.after))
    alike = of(with_recorded_factors(config, {"position_horizontal": 0.2, "position_vertical": 0.2}))
    assert alike["gnss.position_sd"].factor == pytest.approx(0.2 * 0.391)
    differing = with_recorded_factors(config, {"position_horizontal": 0.2, "white": 3.0})
    assert of(differing)["gnss.position_sd_horizontal"].factor == pytest.approx(0.2 * 0.391)
    assert of(differing)["gyro.white_density"].factor == pytest.approx(3.0 * 7.7)
    assert broken(differing) == ()


def test_the_handling_of_terms_states_the_densities_that_are_written(examined: ExaminedDrive) -> None:
    """Seen: "N² = 6.599e-08" beside a white density of 0.00175."""
    rest, drive = examined.diagnosis.before, examined.diagnosis.after
    handling = {
        "white": "drives the angle with N² = 4e-08",
        "gauss_markov": "one state: sd 2e-05 rad/s, 100 s",
    }
    stated = {axis: replace(one, handling=handling) for axis, one in rest.channels.items()}
    found = with_rest_and_motion(replace(rest, channels=stated), drive).channels["gyro_x"].handling
    assert found["white"] == f"drives the angle with N² = {4e-08 * 6.81**2:.4g}"
    assert found["gauss_markov"] == handling["gauss_markov"]


def test_records_that_contradict_themselves_are_told(examined: ExaminedDrive) -> None:
    quantity = Quantity("gyro", "white_density")
    outside = AppliedNoiseScale(quantity, 6.81, "× 6.81 in a drive", (12.97, 16.12))
    other = AppliedNoiseScale(quantity, 6.81, "× 7.7 (6.89 … 8.6)", (6.0, 8.6))
    for records in ((outside,), (other,), (replace(outside, interval=None),) * 2):
        assert broken(replace(examined.diagnosis.before, inflations=records))
