"""Speed of the filter: ratios to numpy with filterpy, taken in this one run.

    python benchmarks/filter.py [SECONDS] [RUNS]

Times are processor time of one thread; only the ratios mean anything elsewhere. SECONDS of the drive defaults
to 600, RUNS of the Monte-Carlo study to 48; both are scaled to an hour and to a hundred runs. "alone" is one
filter, "among many" each of RUNS that fly together, both without sensor noise; predict is the same with no fix.
Then the filter with a lever arm, with scale factors among the states, and where the gate refuses each tenth fix.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from filterpy.kalman import KalmanFilter

from models.trajectory.catalogue import TRAJECTORIES
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.navigation import engine
from tuner.navigation import reference_filter as reference
from tuner.navigation.data import Fixes
from tuner.navigation.settings import filter_settings
from tuner.simulation.imu import sensor_of_config
from tuner.simulation.monte_carlo import simulate
from tuner.simulation.scenario import scenario
from tuner.synthesis import synthesize
from tuner.types import FilterConfig

INTERVAL = 0.01
LEVER_ARM = (0.3, -0.2, -1.0)
SCALE_FACTORS = {"gyro_scale": 0.01, "accel_scale": 0.01}


def seconds(work: Callable[[], object], repeats: int = 3) -> float:
    """Return the best processor time of some runs after a first one that compiles."""
    work()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def plain(config: FilterConfig) -> FilterConfig:
    """Return the configuration with fifteen states."""
    channels = {axis: replace(c, markov=()) for axis, c in config.channels.items()}
    assert config.gnss is not None
    return replace(config, channels=channels, gnss=replace(config.gnss, correlated=()))


def refused(fixes: Fixes) -> Fixes:
    """Return the fixes with each tenth 100 m too high."""
    off = np.arange(len(fixes.t)) % 10 == 9
    return replace(fixes, llh=fixes.llh + np.outer(off, [0.0, 0.0, 100.0]))


def predict_alone(size: int) -> float:
    """Return the time of one filterpy predict with a fixed matrix, s."""
    kf = KalmanFilter(dim_x=size, dim_z=6)
    kf.F, kf.Q = np.eye(size) + 1e-3, np.eye(size) * 1e-6
    return seconds(lambda: [kf.predict() for _ in range(2000)]) / 2000


def main(duration: float, runs: int) -> None:
    config = synthesize(grade_identification(load_grade("mpu9250")), gnss=load_gnss("spp"))
    receiver = load_gnss("spp")
    plan = scenario(TRAJECTORIES["city"](duration), receiver, INTERVAL)
    short = scenario(TRAJECTORIES["city"](20.0), receiver, INTERVAL)
    none = np.zeros((0, 2))
    print(f"{'':34s}{'states':>7s}{'ns/sample':>11s}{'1 h':>9s}{'ratio':>9s}")
    for title, believed in (("fifteen states", plain(config)), ("default ladder", config)):
        sensor = sensor_of_config(config)
        for step in (INTERVAL, 0.1):
            settings = filter_settings(believed, covariance_step=step)
            fixes = Fixes(
                plan.times,
                plan.after,
                plan.truth.llh,
                plan.truth.vel_n,
                np.tile([1.5, 1.5, 3.0, 0.05, 0.05, 0.1], (len(plan.times), 1)),
            )
            no_fixes = Fixes(*(part[:0] for part in (fixes.t, fixes.after, fixes.llh, fixes.vel_n, fixes.sd)))
            keep = short.after[-1]
            few = Fixes(
                fixes.t[: len(short.times)],
                short.after,
                short.truth.llh,
                short.truth.vel_n,
                fixes.sd[: len(short.times)],
            )
            slow = seconds(lambda s=settings, f=few: reference.run(s, short.start, short.steps, f), 1) / keep
            name = f"{title}, covariance every {step:g} s"
            print(f"{name:34s}{settings.size:7d}")
            lever_arm = filter_settings(believed, covariance_step=step, lever_arm=LEVER_ARM)
            scale = filter_settings(believed, covariance_step=step, constants=SCALE_FACTORS)
            for what, own, given in (
                ("predict", settings, no_fixes),
                ("filter", settings, fixes),
                ("lever arm", lever_arm, fixes),
                ("scale factors", scale, fixes),
                ("gate", settings, refused(fixes)),
            ):
                alone = seconds(lambda s=own, f=given: engine.run(s, plan.start, plan.steps, f))
                many = seconds(
                    lambda s=own, f=given: engine.run_together(s, [plan.start] * runs, plan.steps, [f] * runs)
                )
                for number, spent in (("alone", alone), ("among many", many / runs)):
                    each = spent / len(plan.steps.dt)
                    ratio = f"{slow / each:8.0f}×" if given is fixes else ""
                    line = f"  {what} {number}"
                    print(f"{line:34s}{'':7s}{1e9 * each:11.0f}{each * 360000:8.3f}s{ratio}")
            study = replace(plan, outages=none)
            spent = seconds(lambda s=settings, p=study, u=sensor: simulate(s, u, p, runs=runs, seed=1), 1)
            print(
                f"{'  100 runs of an hour with noise':34s}{spent / runs * 3600.0 / duration * 100.0:26.1f}s"
            )
        bare = predict_alone(settings.size)
        print(f"{'  filterpy predict alone':34s}{settings.size:7d}{1e9 * bare:11.0f}")


if __name__ == "__main__":
    main(*(float(a) for a in sys.argv[1:2] or ["600"]), *(int(a) for a in sys.argv[2:3] or ["48"]))
