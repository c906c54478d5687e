"""How long a user waits: whole commands, and kernels beside other programs, as the table of docs/speed.md.

    python benchmarks/speed.py [--long] [--jobs N] [--against TABLE] > docs/speed.md

Every row is measured in this one run. Whole commands run as children with a cache of compiled kernels of their own,
filled by a first run whose time has rows too. Wall time means something only while nothing else runs; processor time
(user and system, all processes) and memory (sum over all processes) hardly depend on that. With `--long` also logs of
1.8e7 samples. The real recording is taken from the folder named by TUNER_DATA, KF-GINS is compared by
`benchmarks/kf_gins.py`, peers of the filter by `benchmarks/filter.py`.

With `--against` it ends with status 1 where a row takes more than `MOST_SLOWER` times the processor time, or memory,
that it has in an older table of the same machine: for a job at night, not for the tests.
"""

from __future__ import annotations

import argparse
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np
from memory import LargestMemory  # beside this file

from models.noise import BiasInstability, NoiseModel, RandomWalk, White
from models.trajectory.catalogue import TRAJECTORIES
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.curves.allan import overlapping_allan
from tuner.curves.theo import nearest_theo1_size, theo1, theo_br
from tuner.identification.arma_whittle import fit_orders
from tuner.jobs import usable
from tuner.navigation.settings import filter_settings
from tuner.simulation.imu import sensor_of_config
from tuner.simulation.monte_carlo import simulate as simulate_runs
from tuner.simulation.scenario import scenario
from tuner.simulation.static import simulate
from tuner.synthesis import synthesize

ROOT = Path(__file__).parents[1]
RECORDING = "static/adis16405_run1.npz"
LONG, SHORT = 18_000_000, 1_000_000
MOST_SLOWER = 1.2
"""Ratio of processor times, or memories, that counts as a loss; runs on an idle machine differ by less than 5 %."""
LEAST_COMPARED = 0.02
"""Processor time below which rows are not compared, s: the clock of a process ticks in hundredths."""


@dataclass(frozen=True)
class Row:
    """A measured work: wall and processor time, s, largest memory, MB, and what is wanted."""

    work: str
    wall: float
    processor: float
    memory: float
    wanted: str
    peer: str = ""


def command(words: list[str], cache: Path, jobs: int) -> tuple[float, float, float]:
    """Return wall time, processor time, s, and the largest memory of all its processes together, MB, of a command."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache), "NUMBA_NUM_THREADS": str(jobs)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # byte code is kept, as where the program is installed
    said = cache / "said.txt"
    with said.open("w") as messages:
        before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        process = subprocess.Popen(
            [sys.executable, "-c", "from tuner.cli import main; main()", *words],
            env=environment,
            cwd=cache,
            stdout=subprocess.DEVNULL,
            stderr=messages,
        )
        with LargestMemory(process.pid) as memory:
            status = process.wait()
    wall, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    if status != 0:
        last = said.read_text(encoding="utf-8", errors="replace").splitlines()[-1:]
        sys.exit(f"failed: tuner {' '.join(words)}: {' '.join(last)}")
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return wall, processor, memory.found


def simulated(samples: int, axes: int, folder: Path) -> Path:
    """Write a log of white noise, bias instability and random walk at 100 Hz; three axes each of two sensors."""
    path = folder / f"log-{axes}-{samples}.npz"
    gyro = NoiseModel([White(1e-4), BiasInstability(2e-5), RandomWalk(1e-6)])
    accel = NoiseModel([White(1e-3), BiasInstability(2e-4), RandomWalk(1e-5)])
    names = [f"{sensor}_{axis}" for sensor in ("gyro", "accel") for axis in "xyz"][:axes]
    sensor = {name: gyro if name.startswith("gyro") else accel for name in names}
    records, _ = simulate(sensor, duration=samples / 100.0, rate=100.0, seed=3)
    columns = {axis: record.column(axis) for record in records for axis in record.axes}
    np.savez(path, t=np.arange(samples) / 100.0, **columns)
    return path


def commands(folder: Path, jobs: int, *, long: bool) -> list[Row]:
    """Measure whole commands, first ones with an empty cache first."""
    one, six = simulated(SHORT, 1, folder), simulated(SHORT, 6, folder)
    works = [
        ("`check mpu9250`, first ever", ["check", "mpu9250"], "20 s"),
        ("`check mpu9250`", ["check", "mpu9250"], "4 s"),
        ("first command of the README, nothing compiled", ["tune", "--seed", "1"], "30 s"),
        ("`identify`, 1 × 1e6", ["identify", str(one)], "2 s"),
        ("`identify`, 6 × 1e6", ["identify", str(six)], "3 s"),
        ("`diagnose`, 1 × 1e6, clean", ["diagnose", str(one)], "2 s"),
        ("`tune`, 6 × 1e6", ["tune", str(six)], "9 s, 800 MB"),
    ]
    recording = Path(os.environ.get("TUNER_DATA", "")) / RECORDING
    if recording.is_file():
        works.append(("`tune`, adis16405_run1", ["tune", str(recording)], "15 s"))
    peers: dict[str, float] = {}
    if long:
        log = simulated(LONG, 6, folder)
        wanted = "25 s, 60 s of processor time, 1500 MB"
        works.append(("`tune`, 6 × 1.8e7 NPZ", ["tune", str(log)], wanted))
        table = as_text(log)
        size = table.stat().st_size / 1e9
        reading = read_by_pandas(table)
        work = f"`tune`, {size:.2g} GB of CSV"
        works.append((work, ["tune", str(table)], f"{1.5 * reading + 25.0:.0f} s, 1500 MB"))
        peers[work] = reading
    rows = []
    for number, (work, words, wanted) in enumerate(works):
        cache = folder / ("first" if "nothing compiled" in work else "cache")
        cache.mkdir(exist_ok=True)
        if number > 2:
            command(words, cache, jobs)  # compiles
        wall, processor, memory = command(words, cache, jobs)
        peer = f"pandas reads it in {peers[work]:.3g} s" if work in peers else ""
        rows.append(Row(work, wall, processor, memory, wanted, peer))
    return rows


def as_text(log: Path) -> Path:
    """Write an NPZ log as CSV, SI units in its header."""
    import pandas as pd

    columns = dict(np.load(log))
    units = {"t": "s"} | {
        name: "rad/s" if name.startswith("gyro") else "m/s^2" for name in columns if name != "t"
    }
    path = log.with_suffix(".csv")
    frame = pd.DataFrame({f"{name} [{units[name]}]": values for name, values in columns.items()})
    frame.to_csv(path, index=False, float_format="%.9g")
    return path


def read_by_pandas(path: Path) -> float:
    """Return the wall time of a child that reads a table by pandas, s."""
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-c", f"import pandas; pandas.read_csv({str(path)!r})"], check=True)
    return time.perf_counter() - begin


def timed(work: Callable[[], object], repeats: int = 3) -> tuple[float, float]:
    """Return the least wall and processor time of some runs, s."""
    found = []
    for _ in range(repeats):
        begin, own = time.perf_counter(), time.process_time()
        work()
        found.append((time.perf_counter() - begin, time.process_time() - own))
    return min(found)


def kernels(*, long: bool) -> list[Row]:
    """Measure kernels and, in turn with them, what others take for the same."""
    import allantools
    from statsmodels.tsa.stattools import arma_order_select_ic

    rng = np.random.default_rng(0)
    long_series = rng.standard_normal(LONG if long else SHORT)
    y, six = rng.standard_normal(SHORT), rng.standard_normal((SHORT, 6))
    sizes = np.unique(np.rint(np.geomspace(1, SHORT // 9, 70)).astype(np.int64))[:60]
    series, short = rng.standard_normal(10_000), rng.standard_normal(1_000)
    config = synthesize(grade_identification(load_grade("mpu9250")), gnss=load_gnss("spp"))
    plan = scenario(TRAJECTORIES["city"](3600.0), load_gnss("spp"), 0.01)
    settings, sensor = filter_settings(config), sensor_of_config(config)
    pairs: list[tuple[str, Callable[[], object], str, Callable[[], object], str]] = [
        (
            "overlapping Allan variance, 60 sizes, 1e6",
            lambda: overlapping_allan(y, sizes),
            "allantools",
            lambda: allantools.oadev(y, rate=1.0, data_type="freq", taus=sizes.astype(float)),
            "",
        ),
        (
            "the same, six channels",
            lambda: overlapping_allan(six, sizes),
            "one channel",
            lambda: overlapping_allan(y, sizes),
            "≤ 7.8 × one channel",
        ),
        *(
            (
                f"Thêo1, 60 sizes, {n:.2g}",
                partial(theo1, long_series[:n], nearest_theo1_size(n, np.geomspace(10, n, 60))),
                "allantools, 1e3",
                lambda: allantools.theo1(
                    short, rate=1.0, data_type="freq", taus=np.arange(10.0, 600.0, 10.0)
                ),
                wanted,
            )
            for n, wanted in ((100_000, "1.3 s"), *(((LONG, "2 s"),) if long else ()))
        ),
        (
            "ThêoH, 30 sizes, 1e5",  # beyond a tenth of the record, where it is ThêoBR
            lambda: theo_br(
                long_series[:100_000], nearest_theo1_size(100_000, np.geomspace(20_000, 70_000, 30))
            ),
            "1e6",
            lambda: theo_br(
                long_series[:SHORT], nearest_theo1_size(SHORT, np.geomspace(200_000, 700_000, 30))
            ),
            "≤ 1e6",
        ),
        (
            "100 runs × 1 h with noise",
            lambda: simulate_runs(settings, sensor, plan, runs=100, seed=0),
            "",
            lambda: None,
            "7.4 s",
        ),
        (
            "ARMA orders up to (5, 5), 1e6",
            lambda: fit_orders([y], (5, 5)),
            "",
            lambda: None,
            "0.1 s",
        ),
        (
            "ARMA orders up to (3, 3), 1e4",
            lambda: fit_orders([series]),
            "statsmodels",
            lambda: arma_order_select_ic(series, max_ar=3, max_ma=3),
            "0.03 s",
        ),
    ]
    rows = []
    for work, ours, name, theirs, wanted in pairs:
        ours()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            (wall, processor), (other, _) = timed(ours), timed(theirs, 1)
        rows.append(Row(work, wall, processor, 0.0, wanted, f"{name}: × {other / wall:.3g}" if name else ""))
    return rows


def losses(rows: Sequence[Row], table: str) -> list[str]:
    """Return the rows that take clearly more processor time or memory than in an older table, in words."""
    cells = [
        [cell.strip() for cell in line.strip("|\n").split("|")] for line in table.splitlines() if "|" in line
    ]
    before = {one[0]: one[2:4] for one in cells if len(one) == 6}
    lost = []
    for row in rows:
        for what, now, then in zip(
            ("s of processor time", "MB"),
            (row.processor, row.memory),
            before.get(row.work, ("", "")),
            strict=True,
        ):
            counts = then and (what == "MB" or float(then) > LEAST_COMPARED)
            if counts and now > MOST_SLOWER * float(then):
                lost.append(f"{row.work}: {now:.3g} {what}, {then} before")
    return lost


def machine() -> str:
    """Return processor, number of processors that may be used, system and versions in one line."""
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        lines = [line for line in cpuinfo.read_text().splitlines() if line.startswith("model name")]
        model = lines[0].partition(":")[2].strip() if lines else model
    return f"{model}, {usable()} processors, Python {platform.python_version()}, numpy {np.__version__}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--long", action="store_true")
    parser.add_argument("--jobs", type=int, default=usable())
    parser.add_argument(
        "--against", type=Path, help="older table; status 1 where something takes clearly more"
    )
    asked = parser.parse_args()
    older = (
        "" if asked.against is None else asked.against.read_text(encoding="utf-8")
    )  # it may be written anew
    revision = subprocess.run(
        ["git", "-C", str(ROOT), "describe", "--always", "--dirty"],
        capture_output=True,
        text=True,
        check=False,
    ).stdout.strip()
    with tempfile.TemporaryDirectory() as folder:
        rows = [*commands(Path(folder), asked.jobs, long=asked.long), *kernels(long=asked.long)]
    print("# How long it takes\n")
    print(f"Output of `python benchmarks/speed.py`: {machine()}, {asked.jobs} jobs, load ", end="")
    print(f"{os.getloadavg()[0]:.1f}, {datetime.now(UTC):%Y-%m-%d}, revision {revision or 'unknown'}.\n")
    print("| work | wall, s | processor, s | memory, MB | wanted | beside |")
    print("|---|---|---|---|---|---|")
    for row in rows:
        memory = f"{row.memory:.0f}" if row.memory else ""
        figures = f"{row.wall:.3g} | {row.processor:.3g} | {memory} | {row.wanted} | {row.peer}"
        print(f"| {row.work} | {figures} |")
    lost = [] if asked.against is None else losses(rows, older)
    if lost:
        sys.exit("\n".join(lost))


if __name__ == "__main__":
    main()
