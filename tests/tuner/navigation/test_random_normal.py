"""Random normal numbers of compiled code: the published generator, the Box–Muller transform, parallel streams."""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy import stats

from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.navigation.engine.layout import BATCH_SIZE, layout_of
from tuner.navigation.engine.random_normal import normal_numbers, stream
from tuner.navigation.engine.state import new_state
from tuner.navigation.settings import filter_settings
from tuner.synthesis import synthesize

WORD = 2**64 - 1


SETTINGS = filter_settings(synthesize(grade_identification(load_grade("mpu9250")), gnss=load_gnss("spp")))


@njit
def _draw(memory, out):
    m = memory[0]
    for i in range(len(out)):
        normal_numbers(m)
        out[i] = m.numbers[:6]


def drawn(n, seeds):
    state, out = new_state(layout_of(SETTINGS), len(seeds)), np.zeros((n, 6, len(seeds)))
    state.stream[:] = np.stack([stream(np.random.default_rng(seed)) for seed in seeds], axis=-1)
    _draw(state.memory, out)
    return out


def xoshiro(seed):
    """xoshiro256+ as published, upper 52 bits as numbers in [0, 1)."""
    s = stream(np.random.default_rng(seed)).tolist()
    while True:
        yield (((s[0] + s[3]) & WORD) >> 12) / 2.0**52
        late = (s[1] << 17) & WORD
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= late
        s[3] = ((s[3] << 45) & WORD) | (s[3] >> 19)


def test_numbers_are_those_of_the_published_generator():
    uniform = xoshiro(7)
    for row in drawn(200, [7])[:, :, 0]:
        for pair in row.reshape(3, 2):
            radius, turn = np.sqrt(-2.0 * np.log(1.0 - next(uniform))), 2.0 * np.pi * (next(uniform) - 0.5)
            np.testing.assert_allclose(pair, [radius * np.cos(turn), radius * np.sin(turn)], atol=1e-9)


def test_streams_side_by_side_are_those_drawn_alone():
    seeds = range(BATCH_SIZE)
    together = drawn(1000, seeds)
    for w, seed in enumerate(seeds):
        np.testing.assert_allclose(together[:, :, w], drawn(1000, [seed])[:, :, 0], atol=1e-9)


def test_numbers_are_normal_and_independent():
    """Five looks, each beyond its limit once in 10⁵ seeds."""
    z = drawn(20000, range(BATCH_SIZE)).ravel()
    n, limit = len(z), stats.norm.isf(0.5e-5)
    assert stats.kstest(z, "norm").pvalue > 1e-5
    for power, mean in ((2, 1.0), (4, 3.0)):
        moment = z**power
        assert abs(moment.mean() - mean) < limit * moment.std() / np.sqrt(n)
    squares = (z**2 - 1.0).reshape(-1, 6, BATCH_SIZE)
    pairs = (squares[:, :1] * squares[:, 1:]).sum(axis=(1, 2))  # within a step
    assert abs(pairs.sum()) < limit * np.sqrt((pairs**2).sum())
    streams = (squares[:, :, :1] * squares[:, :, 1:]).sum(axis=(1, 2))
    assert abs(streams.sum()) < limit * np.sqrt((streams**2).sum())
