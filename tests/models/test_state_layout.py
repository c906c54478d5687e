"""Layout of an error state: which states there are, where they stand, and what drives them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from models.filter_states import FILTER_STATES, named_states
from models.noise import GaussMarkov
from models.state_layout import AxisNoise, error_model

WHITE = AxisNoise(3e-5)


def test_white_noise_alone_leaves_biases_constant():
    model = error_model([WHITE] * 3, [AxisNoise(1e-3)] * 3)
    assert model.layout.size == 15
    assert np.all(model.driving_density == 0.0)
    assert np.all(np.isinf(model.time_constant))
    np.testing.assert_array_equal(model.gyro_density, [3e-5] * 3)
    np.testing.assert_array_equal(model.accel_density, [1e-3] * 3)


def test_a_gauss_markov_state_has_the_drive_of_its_stationary_variance():
    """dx/dt = −x/T + w of density q has the variance q² T/2."""
    slow, fast = GaussMarkov(2e-5, 300.0), GaussMarkov(1e-5, 20.0)
    axes = [
        AxisNoise(3e-5, markov=(slow, fast)),
        WHITE,
        AxisNoise(3e-5, walk_density=4e-7, bias_time_constant=50.0),
    ]
    model = error_model(axes, [AxisNoise(1e-3)] * 3, gnss_markov=(GaussMarkov(1.0, 60.0),))
    place = model.layout["gyro_markov"]
    assert model.gyro_markov_axes == (0, 0)
    variance = model.driving_density[place] ** 2 * model.time_constant[place] / 2.0
    np.testing.assert_allclose(variance, [slow.sd**2, fast.sd**2])
    bias = model.layout["gyro_bias"]
    np.testing.assert_array_equal(model.driving_density[bias], [0.0, 0.0, 4e-7])
    np.testing.assert_array_equal(model.time_constant[bias], [math.inf, math.inf, 50.0])
    fixes = model.layout["gnss_position"]
    np.testing.assert_allclose(model.driving_density[fixes] ** 2 * 60.0 / 2.0, np.ones(3))


def test_blocks_follow_one_another_without_gaps():
    model = error_model(
        [WHITE] * 3, [WHITE] * 3, constants=named_states(), gnss_markov=(GaussMarkov(1.0, 9.0),)
    )
    ends = [model.layout[name] for name, _ in model.layout.blocks]
    assert [s.start for s in ends] == [0, *(s.stop for s in ends[:-1])]
    assert (
        ends[-1].stop
        == model.layout.size
        == 15 + sum(FILTER_STATES[name].size for name in named_states()) + 3
    )
    assert model.layout.start("position") == 0
    assert error_model([WHITE] * 3, [WHITE] * 3).layout.start("gravity") == -1


@pytest.mark.parametrize(
    ("values", "message"),
    [((-1.0,), "white_density"), ((0.0, -1.0), "walk_density"), ((0.0, 0.0, 0.0), "bias_time_constant")],
)
def test_impossible_noise_is_refused_by_its_name(values, message):
    with pytest.raises(ValueError, match=message):
        AxisNoise(*values)
