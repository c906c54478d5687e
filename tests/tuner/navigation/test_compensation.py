"""Names of parameters of causes, and what a compensation may have."""

from __future__ import annotations

import re
from dataclasses import fields, replace

import numpy as np
import pytest

from models import rotation
from models.effects.drive import EFFECTS
from models.registry import RegistryError
from tuner.formats import noise_yaml
from tuner.navigation.compensation import correction
from tuner.types import Compensation, Parameter
from tuner.types.records import DataError

CONSTANT = ("gyro_scale", "accel_scale", "misalignment", "g_sensitivity")


def test_text_and_parameter_are_inverse():
    parameter = Parameter("gnss_noise_scale", "position_horizontal_class_1")
    assert Parameter.parse(str(parameter)) == parameter
    assert str(parameter) == "gnss_noise_scale.position_horizontal_class_1"
    texts = {"time_offset.delay": 0.1, "lever_arm.z": -1.2}
    assert Compensation.parse(texts).as_text() == texts


@pytest.mark.parametrize("text", ["delay", ".delay", "time_offset."])
def test_a_name_without_its_two_parts_is_refused(text):
    with pytest.raises(ValueError, match=re.escape("CAUSE.NAME")):
        Parameter.parse(text)


@pytest.mark.parametrize("cause", CONSTANT)
def test_sensor_error_is_the_derivative_of_the_sensor_matrix(cause):
    """Central differences of measured (ω, f) = A true at A = I."""
    names = [f.name for f in fields(EFFECTS[cause])]
    for name in names:
        step = 1e-4
        up, down = (
            correction(Compensation({Parameter(cause, name): s * step})).sensor_matrix for s in (1.0, -1.0)
        )
        np.testing.assert_allclose((up - down) / (2.0 * step), EFFECTS[cause].sensor_error(name), atol=1e-8)


def test_sensor_errors_are_composed_in_one_order_whatever_that_of_the_file():
    """A = [[R (I + S), G], [0, I + S_a]]: gyros are scaled, then rotated; the sensitivity to force is added."""
    texts = {"g_sensitivity.zy": 2e-4, "misalignment.yaw": 0.03, "gyro_scale.x": 0.01, "accel_scale.z": -0.02}
    expected = np.eye(6)
    expected[:3, :3] = rotation.mat_from_rpy((0.0, 0.0, 0.03)) @ np.diag([1.01, 1.0, 1.0])
    expected[2, 4], expected[5, 5] = 2e-4, 0.98
    backwards = dict(reversed(texts.items()))
    for given in (texts, backwards):
        np.testing.assert_array_equal(correction(Compensation.parse(given)).sensor_matrix, expected)


def test_an_unknown_cause_is_refused_in_one_line():
    with pytest.raises(
        RegistryError, match=r"unknown cause of a drive 'time_ofset' \(did you mean 'time_offset'"
    ):
        correction(Compensation.parse({"time_ofset.delay": 0.1}))


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("time_ofset.delay", "expected CAUSE.NAME, with a cause of a drive"),
        ("time_offset.late", "expected a parameter of 'time_offset' that can be taken out of a drive"),
        ("correlated_gnss.sd", "expected a parameter of 'correlated_gnss' that can be taken out of a drive"),
        ("gnss_noise_scale.position_north", "expected a parameter of 'gnss_noise_scale'"),
    ],
)
def test_a_file_with_an_unknown_parameter_is_refused(drive_config, name, expected):
    """Before, such a key was ignored."""
    config = replace(drive_config, compensation=Compensation.parse({"lever_arm.x": 0.5}))
    text = noise_yaml.dumps(config)
    assert noise_yaml.loads(text).compensation == config.compensation
    with pytest.raises(DataError, match=re.escape(expected)) as error:
        noise_yaml.loads(text.replace("lever_arm.x", name))
    assert "\n" not in str(error.value)
