"""White noise alone: no other term is found."""

import numpy as np
import pytest

from tuner.identification import identify_channel
from tuner.types.records import Record

OTHERS = ("quantization", "bias_instability", "random_walk", "ramp", "gauss_markov")


def invented(seed, n):
    y = np.random.default_rng((77, seed)).standard_normal((n, 1))
    record = Record("gyro", np.arange(n) * 0.01, y, ("gyro_x",), "rad/s", 0.01)
    found = identify_channel(record, "gyro_x")
    assert found.term("white").coefficients["density"].value == pytest.approx(0.1, rel=0.1)
    return any(found.term(name) is not None and found.term(name).present for name in OTHERS)


def test_few_inventions_in_a_few_records():
    # at 5 % each, five or more of 8 have probability 2e-5
    assert sum(invented(seed, 20_000) for seed in range(8)) <= 4


@pytest.mark.slow
def test_at_least_95_percent_of_200_records_are_white_alone():
    assert sum(invented(1000 + seed, 100_000) for seed in range(200)) <= 10
