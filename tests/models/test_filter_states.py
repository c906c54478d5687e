"""Declarations of filter states are checked, and what is not declared is refused in one line."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from models.filter_states import FILTER_STATES, Coupling, FilterState, named_state, process
from models.registry import RegistryError
from models.state_layout import AxisNoise, error_model

WHITE = AxisNoise(3e-5)
SUPPLY = FilterState(
    "supply_bias",
    ("",),
    "m/s^2",
    "bias by the supply voltage",
    tuple(
        Coupling("", f"accel_{axis}", factor=factor)
        for axis, factor in zip("xyz", (1.0, -0.5, 2.0), strict=True)
    ),
)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"name": "Height bias"}, "expected a name of lower-case letters"),
        ({"components": ("x", "x")}, "components must be names that differ"),
        ({"meaning": ""}, "unit and meaning must not be empty"),
        ({"customary_unit": "parsec"}, "customary_unit 'parsec' is none of"),
        ({"time_constant": 0.0}, "time_constant must be positive"),
        (
            {"time_constant": 9.0, "walk_density": 1.0},
            "walk_density is that of a state without a time constant",
        ),
        ({"couplings": ()}, "couplings must say what it adds to"),
        ({"couplings": (Coupling("y", "accel_x"),)}, "a coupling names the component 'y'"),
        ({"couplings": (Coupling("", "accel"),)}, "a coupling goes into 'accel', known are gyro_x"),
        ({"couplings": (Coupling("", "position_down", "rate_x"),)}, "only sensors may have one of"),
        (
            {"couplings": (Coupling("", "accel_x", factor=math.nan),)},
            "the factor of a coupling must be finite",
        ),
    ],
)
def test_a_contradicting_declaration_is_refused_in_one_line(change, complaint):
    with pytest.raises(RegistryError, match=rf"^filter state '[^\n]*': {complaint}[^\n]*$"):
        FILTER_STATES.add(replace(SUPPLY, **change))


def test_what_is_no_declaration_is_refused():
    with pytest.raises(RegistryError, match=r"^filter state: a declaration must state its name"):
        FILTER_STATES.add(3.0)


def test_states_that_follow_from_the_noise_of_an_axis_cannot_be_asked_for():
    with pytest.raises(RegistryError, match=r"^unknown filter state 'gravty' \(did you mean 'gravity'\?\)"):
        named_state("gravty")
    with pytest.raises(RegistryError, match="'gyro_bias' cannot be named: it follows from sensors"):
        error_model([WHITE] * 3, [WHITE] * 3, constants=("gyro_bias",))


def test_the_slope_of_a_state_that_a_filter_lacks_is_refused():
    slope = replace(SUPPLY, name="supply_slope", couplings=(), slope_of="supply_bias")
    with FILTER_STATES.added(SUPPLY), FILTER_STATES.added(slope):
        model = error_model([WHITE] * 3, [WHITE] * 3, constants=("supply_bias", "supply_slope"))
        assert model.slopes[model.layout["supply_bias"]] == model.layout.start("supply_slope")
        with pytest.raises(ValueError, match="'supply_slope' is the slope of 'supply_bias': expected 1"):
            error_model([WHITE] * 3, [WHITE] * 3, constants=("supply_slope",))


def test_a_state_is_stationary_with_the_sd_of_its_prior():
    """σ² = q² T/2 of a first-order process; a constant, and a walk, have no such sd."""
    own = process(replace(SUPPLY, time_constant=50.0), 3.0)
    assert own.driving_density**2 * own.time_constant / 2.0 == pytest.approx(9.0)
    assert process(SUPPLY, 3.0).driving_density == 0.0
    assert process(replace(SUPPLY, walk_density=2.0), 3.0).driving_density == 2.0
    assert process(SUPPLY, 3.0, 200.0).time_constant == 200.0
    with pytest.raises(ValueError, match="must be positive"):
        process(SUPPLY, 3.0, 0.0)


def test_states_of_a_filter_follow_those_of_this_project():
    with FILTER_STATES.added(SUPPLY):
        model = error_model([WHITE] * 3, [WHITE] * 3, constants=("supply_bias", "gravity"))
    assert [name for name, _ in model.layout.blocks][3:] == [
        "gyro_bias",
        "accel_bias",
        "gravity",
        "supply_bias",
    ]
