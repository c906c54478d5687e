"""Noise terms from an Allan curve alone."""

import numpy as np
import pytest

from models.noise import BiasInstability, NoiseModel, RandomWalk, White
from tuner.curves import curve
from tuner.identification.from_curve import identify_curve, record_span
from tuner.types import AllanCurve
from tuner.types.records import DataError, Record

TRUTH = NoiseModel((White(1.0), BiasInstability(0.476), RandomWalk(0.06)))


def measured(model, seed, n=200_000, interval=0.01):
    y = model.sample(n, interval, np.random.default_rng(seed))
    record = Record("gyro", np.arange(n) * interval, y[:, None], ("gyro_x",), "rad/s", interval)
    return curve(record, "oadev")


def without_dof(found):
    return AllanCurve(
        "oadev", found.tau, found.variance, np.full_like(found.dof, np.nan), found.unit, found.axes
    )


def test_present_terms_are_found_and_covered():
    channel = identify_curve(measured(TRUTH, 5)).channels["gyro_x"]
    white = channel.term("white").coefficients["density"]
    flicker = channel.term("bias_instability").coefficients["level"]
    # Five standard errors: a false failure has probability below 1e-5.
    for found, truth in ((white, 1.0), (flicker, 0.476)):
        sd = (found.interval[1] - found.interval[0]) / 3.92
        assert abs(found.value - truth) < 5 * sd


def test_white_noise_alone_is_white_alone():
    """Four terms are tried at 5 % in all: six records invent more than three with probability 9e-5."""
    invented = 0
    for seed in range(6):
        channel = identify_curve(measured(NoiseModel((White(2.0),)), seed, n=20_000)).channels["gyro_x"]
        invented += [t.name for t in channel.terms if t.present] != ["white"]
        for term in channel.terms:
            for c in term.coefficients.values():
                assert c.value is not None or c.upper > 0
    assert invented <= 3


def test_without_degrees_of_freedom_intervals_are_wider():
    found = measured(TRUTH, 6)
    known = identify_curve(found, terms=("white", "bias_instability")).channels["gyro_x"]
    unknown = identify_curve(without_dof(found), terms=("white", "bias_instability")).channels["gyro_x"]

    def width(channel):
        low, high = channel.term("white").coefficients["density"].interval
        return high / low

    assert width(unknown) >= width(known)


def test_span_follows_from_the_degrees_of_freedom_of_flicker():
    u = 25.0
    dof = 5 * u**2 / (4 * (u + 3))
    one = AllanCurve(
        "oadev", np.array([1.0, 40.0]), np.ones((2, 1)), np.array([[500.0], [dof]]), "rad/s", ("gyro",)
    )
    assert record_span(one) == pytest.approx(40.0 * u)
    assert record_span(without_dof(one)) == pytest.approx(80.0)


def test_scaling_the_curve_scales_the_amplitudes():
    found = measured(TRUTH, 7, n=20_000)
    scaled = AllanCurve("oadev", found.tau, 9.0 * found.variance, found.dof, found.unit, found.axes)
    a, b = (identify_curve(c).channels["gyro_x"] for c in (found, scaled))
    assert b.model.terms[0].density == pytest.approx(3.0 * a.model.terms[0].density, rel=1e-4)


def test_a_curve_shows_no_constant():
    mean = identify_curve(measured(TRUTH, 8, n=20_000), terms=("white",)).channels["gyro_x"].mean
    assert mean.value is None
    assert "constant" in mean.reason


def test_too_short_a_curve_is_refused():
    short = AllanCurve(
        "oadev", np.array([1.0, 2.0]), np.ones((2, 1)), np.full((2, 1), np.nan), "rad/s", ("gyro",)
    )
    with pytest.raises(DataError, match="octaves"):
        identify_curve(short)


def test_a_filter_in_the_sensor_does_not_bend_the_white_noise():
    """A moving average of eight samples lowers the first octaves; the plateau of the density stays."""
    rng = np.random.default_rng(9)
    n, interval = 200_000, 0.01
    y = np.convolve(rng.standard_normal(n + 7) / np.sqrt(interval), np.ones(8) / 8, mode="valid")
    found = curve(
        Record("gyro", np.arange(n) * interval, y[:, None], ("gyro_x",), "rad/s", interval), "oadev"
    )
    channel = identify_curve(found).channels["gyro_x"]
    # Without its first octaves the curve tells N to about 1 %: five standard errors.
    assert channel.term("white").coefficients["density"].value == pytest.approx(1.0, rel=0.06)
    assert any("below a cluster time of" in warning for warning in channel.warnings)
