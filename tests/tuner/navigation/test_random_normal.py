"""Random normal numbers of compiled code: the published generator and the Box–Muller transform."""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy import stats

from tuner.navigation.engine.random_normal import normal_numbers, stream
from tuner.navigation.engine.simd import WIDTH, aligned, as_lanes, as_numbers

WORD = 2**64 - 1


@njit(fastmath=True)
def _draw(state, out):
    for i in range(len(out)):
        drawn = normal_numbers(state)
        for c in range(6):
            out[i, c] = drawn[c]


@njit
def _of_numbers(state, out):
    _draw(as_numbers(state), as_numbers(out))


@njit
def _of_lanes(state, out):
    _draw(as_lanes(state), as_lanes(out))


def drawn(n, seeds):
    state, out = aligned(4, len(seeds)), aligned(n, 6, len(seeds))
    state[:] = np.stack([stream(np.random.default_rng(seed)) for seed in seeds], axis=-1)
    (_of_numbers if len(seeds) == 1 else _of_lanes)(state, out)
    return out


def xoshiro(seed):
    """xoshiro256+ as published, upper 52 bits as numbers in [0, 1)."""
    s = stream(np.random.default_rng(seed)).view(np.uint64).tolist()
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


def test_vectors_draw_what_their_streams_draw_one_by_one():
    seeds = range(WIDTH)
    together = drawn(1000, seeds)
    for w, seed in enumerate(seeds):
        np.testing.assert_allclose(together[:, :, w], drawn(1000, [seed])[:, :, 0], atol=1e-9)


def test_numbers_are_normal_and_independent():
    """Five looks, each beyond its limit once in 10⁵ seeds."""
    z = drawn(20000, range(WIDTH)).ravel()
    n, limit = len(z), stats.norm.isf(0.5e-5)
    assert stats.kstest(z, "norm").pvalue > 1e-5
    for power, mean in ((2, 1.0), (4, 3.0)):
        moment = z**power
        assert abs(moment.mean() - mean) < limit * moment.std() / np.sqrt(n)
    squares = (z**2 - 1.0).reshape(-1, 6, WIDTH)
    pairs = (squares[:, :1] * squares[:, 1:]).sum(axis=(1, 2))  # within a step
    assert abs(pairs.sum()) < limit * np.sqrt((pairs**2).sum())
    streams = (squares[:, :, :1] * squares[:, :, 1:]).sum(axis=(1, 2))
    assert abs(streams.sum()) < limit * np.sqrt((streams**2).sum())
