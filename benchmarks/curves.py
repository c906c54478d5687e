"""Speed of the empirical curves: ratios to allantools and to physical limits, all taken in this one run.

    python benchmarks/curves.py [SAMPLES]

Times are processor time of one thread (set NUMBA_NUM_THREADS=1) or wall time with more; only the ratios mean
anything elsewhere. SAMPLES defaults to 1.8e7 (5 h at 1 kHz).
"""

from __future__ import annotations

import os
import sys
import time
import warnings
from collections.abc import Callable

import numpy as np
from numba import config, njit

from tuner.curves import empirical
from tuner.curves.allan import overlapping_allan, overlapping_hadamard
from tuner.curves.theo import bias_ratio, nearest_theo1_size, theo1
from tuner.curves.total import total
from tuner.types.records import Record


def seconds(work: Callable[[], object], repeats: int = 3) -> float:
    """Return the best time of some runs after a first one that compiles."""
    clock = time.process_time if config.NUMBA_NUM_THREADS == 1 else time.perf_counter
    work()
    times = []
    for _ in range(repeats):
        start = clock()
        work()
        times.append(clock() - start)
    return min(times)


@njit(fastmath=True, nogil=True)
def _read(x: np.ndarray) -> float:
    total_ = 0.0
    for i in range(x.size):
        total_ += x[i]
    return total_


@njit(fastmath=True, nogil=True)
def _read_again(x: np.ndarray, times: int) -> float:
    half, total_, other = x.size // 2, 0.0, 0.0
    for _ in range(times):
        for i in range(half):  # two sums: one alone waits for its own additions, and reads a tenth less
            total_ += x[i]
            other += x[half + i]
        x[0] += (total_ + other) * 1e-300  # keep every pass
    return total_ + other


def peer(name: str, y: np.ndarray, m: np.ndarray) -> float:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import allantools

        function = getattr(allantools, name)
        start = time.process_time()
        function(y, rate=1.0, data_type="freq", taus=m.astype(float))
        return time.process_time() - start


def line(what: str, own: float, **ratios: float) -> None:
    print(f"{what:44s} {own:9.4f} s   " + "   ".join(f"{name} {value:.3g}" for name, value in ratios.items()))


def main() -> None:
    n = int(float(sys.argv[1])) if len(sys.argv) > 1 else 18_000_000
    rng = np.random.default_rng(0)
    y = rng.standard_normal(n)
    m = np.unique(np.rint(np.geomspace(1, n // 9, 70)).astype(np.int64))[:60]
    print(
        f"{n:g} samples, {m.size} cluster sizes, {config.NUMBA_NUM_THREADS} threads, {os.cpu_count()} cores"
    )

    once = seconds(lambda: _read(y))
    small = rng.standard_normal(2048)
    per_load = seconds(lambda: _read_again(small, 20_000)) / (2048 * 20_000)
    terms = float(np.sum(n + 1 - 2 * m))
    loads = 2.5 * terms * per_load  # two cluster sizes share one of three loads
    line("read the record once (memory)", once)
    line("load every term (first-level cache)", loads)

    own = seconds(lambda: overlapping_allan(y, m))
    line(
        "oadev",
        own,
        **{
            "x allantools": peer("oadev", y, m) / own,
            "of one pass a size": own / (m.size * once),
            "of loads": own / loads,
        },
    )
    own = seconds(lambda: overlapping_hadamard(y, m))
    line("ohdev", own, **{"x allantools": peer("ohdev", y, m) / own})

    short = y[:1_000_000]
    sizes = np.unique(np.rint(np.geomspace(1, 400_000, 60)).astype(np.int64))
    own = seconds(lambda: total(short, sizes))
    line("totdev, 1e6", own, **{"x allantools": peer("totdev", short, sizes) / own})

    thousand = y[:1000]
    even = nearest_theo1_size(1000, np.geomspace(10, 1000, 10))
    own = seconds(lambda: theo1(thousand, even))
    line(f"theo1, 1e3, {even.size} sizes", own, **{"x allantools": peer("theo1", thousand, even) / own})
    for count in (10_000, 100_000, 1_000_000):
        series = y[:count]
        even = nearest_theo1_size(count, np.geomspace(10, count, 60))
        own = seconds(lambda s=series, e=even: theo1(s, e), 1)
        line(f"theo1, {count:g}, 60 sizes", own)
        line(f"bias ratio of ThêoBR, {count:g}", seconds(lambda s=series: bias_ratio(s), 1))

    record = Record("gyro", np.arange(short.size) * 0.01, short, ("gyro_x",), "rad/s", 0.01)
    for name in ("adev", "oadev", "twogroup", "mdev", "hdev", "ohdev", "totdev", "theo1", "theobr", "theoh"):
        line(f"curve {name}, 1e6", seconds(lambda e=name: empirical(record, e), 1))
    for name in ("nsec", "psd", "acf", "pacf"):
        line(f"{name}, 1e6", seconds(lambda e=name: empirical(record, e), 1))


if __name__ == "__main__":
    main()
