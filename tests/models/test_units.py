"""Conversions of units: exact relations between them, round trips, spellings."""

from __future__ import annotations

import doctest
import math

import pytest

from models import units
from models.units import from_si, known_units, time_derivative, to_si, two_sided


@pytest.mark.parametrize("unit", known_units())
def test_round_trip(unit):
    assert from_si(to_si(3.7, unit), unit) == pytest.approx(3.7, rel=1e-15)


@pytest.mark.parametrize(
    ("value", "unit", "equal", "other"),
    [
        (1.0, "deg/√h", 1.0 / 60.0, "deg/s/√Hz"),
        (1.0, "deg/sqrt(h)", 60.0, "deg/h/sqrt(Hz)"),
        (1.0, "deg/√h", 2.908882086657e-4, "rad/√s"),
        (1.0, "deg/h/√Hz", 1.0, "arcsec/√s"),
        (1.0, "deg/h", 1.0, "arcsec/s"),
        (1.0, "deg/s", 3600.0, "deg/h"),
        (1.0, "rad/s", 206264.806247, "deg/h"),
        (1.0, "deg/h^1.5", 8.08022801849e-8, "rad/s^1.5"),
        (1.0, "deg/h^2", 1.34670466975e-9, "rad/s^2"),
        (1.0, "ug", 0.980665, "mGal"),
        (1.0, "µg", 9.80665e-6, "m/s²"),
        (1.0, "mGal", 1e-5, "m/s^2"),
        (1.0, "m/s/√h", 1699.5270, "µg/√Hz"),
        (1.0, "mGal/√Hz", 6e-4, "m/s/sqrt(h)"),
        (1.0, "ft/s/√h", 518.0158, "ug/sqrt(Hz)"),
        (1.0, "ug/√h", 1.634441667e-7, "m/s^2/√s"),
        (0.15, "deg/√h", 0.025, "deg/s*√(0.01)"),
    ],
)
def test_exact_relations(value, unit, equal, other):
    if other.endswith("*√(0.01)"):
        sample_sd = to_si(value, unit) / math.sqrt(0.01)
        assert from_si(sample_sd, "deg/s") == pytest.approx(equal, rel=1e-12)
    else:
        assert from_si(to_si(value, unit), other) == pytest.approx(equal, rel=1e-7)


@pytest.mark.parametrize(
    "spellings",
    [
        ("deg/√h", "deg/sqrt(h)", "deg/h^0.5", "°/√h", "deg / sqrt(h)", "deg/√hr", "deg/h^(1/2)"),
        ("µg/√Hz", "μg/√Hz", "ug/sqrt(Hz)", "ug/√(Hz)", "ug/rtHz"),
        ("m/s²", "m/s^2", "m/s**2"),
        ("rad/√s", "rad/s/√Hz", "rad/s^0.5"),
        ("deg/h^(3/2)", "deg/h^1.5"),
        ("deg/s", "°/s", "deg/sec", "dps"),
        ("mdps/√Hz", "mdeg/s/sqrt(Hz)"),
    ],
)
def test_spellings(spellings):
    assert len({to_si(1.0, s) for s in spellings}) == 1


def test_unknown_unit_lists_the_known():
    with pytest.raises(ValueError, match=r"unknown unit 'furlong'; known are .*deg/sqrt\(h\).*mGal"):
        to_si(1.0, "furlong")


def test_one_and_two_sided():
    bandwidth, density = 50.0, 0.01
    variance = density**2 * bandwidth
    assert two_sided(density) ** 2 * 2.0 * bandwidth == pytest.approx(variance)


@pytest.mark.parametrize("rate", ["rad/s", "m/s^2"])
@pytest.mark.parametrize("power", [-1.0, -0.5, 0.0, 0.5, 1.0])
def test_every_unit_of_a_term_is_known(rate, power):
    assert to_si(1.0, time_derivative(rate, power)) == 1.0


def test_examples_in_the_documentation():
    assert doctest.testmod(units).failed == 0
