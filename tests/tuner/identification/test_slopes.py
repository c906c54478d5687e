"""Coefficients from the slopes of the Allan deviation."""

import numpy as np
import pytest

from models.noise import BiasInstability, NoiseModel, Quantization, Ramp, RandomWalk, White
from models.noise.bias_instability import ALLAN_FLOOR
from tuner.identification.slopes import read_segments

TAU = np.geomspace(0.01, 1e5, 120)
MANY = np.full(TAU.size, 1e4)


@pytest.mark.parametrize(
    "term",
    [Quantization(0.3), White(0.02), BiasInstability(0.5), RandomWalk(0.003), Ramp(1e-4)],
    ids=lambda term: term.name,
)
def test_a_term_alone_is_one_segment(term):
    (segment,) = read_segments(TAU, np.sqrt(term.allan_variance(TAU)), MANY)
    assert segment.term == term.name
    assert segment.value == pytest.approx(getattr(term, term.PARAMETERS[0]), rel=1e-9)
    assert segment.tau == pytest.approx((TAU[0], TAU[-1]))


def test_five_segments_of_well_separated_terms():
    model = NoiseModel((Quantization(1e-2), White(1e-2), BiasInstability(1e-3), RandomWalk(1e-5), Ramp(1e-9)))
    tau = np.geomspace(1e-3, 1e10, 400)
    found = read_segments(tau, np.sqrt(model.allan_variance(tau)), np.full(tau.size, 1e6))
    assert [s.term for s in found] == [t.name for t in model.terms]
    assert [s.tau[0] for s in found] == sorted(s.tau[0] for s in found)
    for segment, term in zip(found, model.terms, strict=True):
        truth = getattr(term, term.PARAMETERS[0])
        assert truth <= segment.value < 1.3 * truth  # neighbours only add


def test_floor_of_flicker():
    assert pytest.approx(0.664282, abs=1e-6) == ALLAN_FLOOR


def test_points_with_few_degrees_of_freedom_are_not_read():
    tau = np.geomspace(1.0, 1e4, 60)
    walk = np.sqrt(NoiseModel((White(1.0), RandomWalk(0.03))).allan_variance(tau))
    few = np.where(tau > 30.0, 2.0, 100.0)
    assert [s.term for s in read_segments(tau, walk, few)] == ["white"]
    assert read_segments(tau, walk, np.ones(60)) == ()


def test_interval_narrows_with_degrees_of_freedom():
    deviation = np.sqrt(White(1.0).allan_variance(TAU))
    widths = []
    for v in (10.0, 1000.0):
        (segment,) = read_segments(TAU, deviation, np.full(TAU.size, v))
        low, high = segment.interval
        assert low < segment.value < high
        widths.append(high - low)
    assert widths[1] == pytest.approx(widths[0] / 10.0, rel=0.2)
