"""The numbers of every export in the program that reads it: prints docs/consumers.md.

    python benchmarks/consumers.py > docs/consumers.md

What each program does with a number is a formula of `tests/consumers/filters.py` and `simulators.py`, read in its
source; the tests beside it run the programs that a package index offers.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.consumers.examples import EXAMPLES, LAGS, modelled_allan_variance, text_of
from tests.consumers.filters import FILTERS, Filter
from tests.consumers.simulators import SIMULATORS, Simulator
from tuner.synthesis.error_growth import modelled_growth

CLUSTER_TIMES = np.array([1.0, 3.0, 10.0, 30.0, 100.0, 300.0])

HEAD = """# What the consumers make of our numbers

Every number of `tuner export`, in the program that reads it. The law is: what the program predicts or draws ÷ what
the configuration models = 1. Two configurations are exported at 100 Hz:

- *walk*: white noise and a random walk, N = 2e-4 rad/s/√Hz and 3e-3 m/s²/√Hz, K = 3e-6 rad/s²/√Hz and 5e-5
  m/s³/√Hz. Every filter with a bias can hold it, and the ratio has to be 1.
- *flicker*: the built-in grade icm20602, whose flicker is four Gauss–Markov states in our configuration. No
  consumer has as many. Two numbers, or one state, stand for them: those with which a filter predicts best that gets
  the usual fixes of the program, camera, lidar, RTK or GNSS (`tuner.synthesis.projection`); the header of each export
  states its true ÷ predicted errors. So the ratio of the drift alone differs between them.

This page is written by `python benchmarks/consumers.py > docs/consumers.md`; `pytest tests/consumers` checks it,
and runs GTSAM, gnss-ins-sim, pyins, OpenCV, yaml-cpp and Octave where they are installed. Code that was compiled or
run by hand is named with what it predicted ÷ modelled for *walk* at 1, 10 and 60 s. Line numbers are those of the
snapshots that were read, 2023 to 2026; the numbers are those of *walk*.

## Filters

Sd of an angle (gyro) or velocity (accelerometer) some time after the bias was last estimated, predicted by the filter
÷ modelled; the estimate holds of each state what is the best constant for 96 s.
"""

SIMULATED = """
## Simulators

Allan deviation drawn ÷ modelled at {times} s.
"""

TAIL = """
## What was wrong in circulation

Read in the sources above, against what tables and forums state:

- *GTSAM*: `biasAccOmegaInt` is no prior. Up to 4.2 it is noise of every step, with a default of 1; 4.3 has no such
  setting. `integrationCovariance` has a default of 1 m²/s: 1 m after 1 s.
- *NaveGo*: `gb_sta`, `ab_sta` are values that its filter subtracts, no sds; `gb_dyn` is its first estimate and its
  initial sd, no σ; what it squares into Q is `gb_psd` = σ√(2/T). Its simulator multiplies a rate random walk by dt,
  not by √dt (simulation/noise_rrw.m).
- *PX4, ArduPilot*: the ranges of ground stations are advice; the firmware constrains to 0 … 1. ArduPilot's step
  aims at 12 ms. Here the noise counts as measured in motion: of a log on the bench, none below
  stock is written.
- *robot_localization*: the last six entries of `initial_estimate_covariance` are rates and accelerations of the
  vehicle.
- *ORB-SLAM3*: `IMU.Frequency` is an integer in files without `File.version`, and real in those of version 1.0.
- *FAST-LIVO2*: the variances of its bias walks are fixed in the source; `b_acc_cov` and `b_gyr_cov` are not read.
- *RotorS*: the plugin reads `gyroscopeBiasRandomWalk`, while its own models write `gyroscopeRandomWalk`: their gyro
  walks at the default.
- *AirSim*: "bias stability" is a random walk of the density stability/√Tau; it never comes back.
- *Gazebo*: `bias_mean` and `bias_stddev` are the first value of the drift, and fade with its time constant.
- *gnss-ins-sim*: an infinite correlation time draws white noise, and the state starts at zero.
- *PSINS*: of the filters of `kfinit` only some use the bias noise at all; the bias does not fade while `ins.tauG`
  is infinite.

## Other configurations and rates

By the same formulas, at 10 Hz and 4 kHz, with noise a million times smaller and a thousand times larger, with gyros
or accelerometers alone, two axes of three, unequal axes (rms), without a receiver: white noise and walks come out at
1.00 in every dialect that has a bias. Of the simulators, one state of 100 s comes out within 3 % in gnss-ins-sim,
Gazebo and RotorS, within 12 % in `imuSensor` and within 31 % in AirSim, whose bias never comes back. No number is
infinite or NaN; what cannot be written, an axis without white noise or a sensor that the program needs, is refused in
one line.

## Not written

- *MATLAB* `insfilter…`, `factorIMUParameters`: their pages name covariances in (rad/s)² and (m/s²)², which fits a
  density squared and the variance of a sample alike; neither the code nor a formula for what one step adds is public.
  `imuSensor` is written by its reference page, the one row here that rests on a page alone.
"""


def numbers(program: Filter | Simulator) -> str:
    """Return key and value of the numbers of an export."""
    text = text_of("walk", program.dialect)
    # The first number behind the key: of a YAML or XML entry, a parameter, a vector.
    between = r"(?:\"|Covariance)?\W+?(?:np\.\w+\(\[)?"
    found = {key: re.search(rf"{re.escape(key)}{between}(\d[\d.e+-]*)", text) for key in program.keys.split()}
    return "<br>".join(f"`{key}` {match[1]}" for key, match in found.items() if match)


def growth(program: Filter, example: str) -> str:
    """Return the ratio at each horizon, gyro and accelerometer."""
    cells = []
    for sensor in ("gyro", "accel"):
        channel = EXAMPLES[example]().channels[f"{sensor}_x"]
        predicted = program.growth(text_of(example, program.dialect), sensor, LAGS)
        modelled = modelled_growth(channel, LAGS, memory=LAGS[-1])
        if not program.has_bias:
            if example != "walk":
                return "white noise alone"
            modelled = channel.white_density**2 * LAGS
        cells.append(" ".join(f"{ratio:.2f}" for ratio in np.sqrt(predicted / modelled)))
    return "<br>".join(cells)


def deviation(simulator: Simulator, example: str) -> str:
    """Return the ratio at each cluster time, gyro and accelerometer."""
    cells = []
    for sensor in ("gyro", "accel"):
        drawn = simulator.allan_variance(text_of(example, simulator.dialect), sensor, CLUSTER_TIMES)
        modelled = modelled_allan_variance(EXAMPLES[example]().channels[f"{sensor}_x"], CLUSTER_TIMES)
        cells.append(" ".join(f"{ratio:.2f}" for ratio in np.sqrt(drawn / modelled)))
    return "<br>".join(cells)


def table() -> Iterator[str]:
    """Yield the lines of the page."""
    horizons = ", ".join(f"{lag:g}" for lag in LAGS)
    yield HEAD
    yield f"| dialect | numbers | use | how | *walk* at {horizons} s | *flicker* |"
    yield "|---|---|---|---|---|---|"
    for program in FILTERS:
        how = program.run or "formula"
        cells = (numbers(program), program.use, how, growth(program, "walk"), growth(program, "flicker"))
        yield f"| {program.dialect} | {' | '.join(cells)} |"
    yield SIMULATED.format(times=", ".join(f"{time:g}" for time in CLUSTER_TIMES))
    yield "| dialect | numbers | use | how | *walk* | *flicker* |"
    yield "|---|---|---|---|---|---|"
    for simulator in SIMULATORS:
        cells = (
            numbers(simulator),
            simulator.use,
            deviation(simulator, "walk"),
            deviation(simulator, "flicker"),
        )
        yield f"| {simulator.dialect} | {' | '.join(cells)} |"
    yield TAIL.rstrip()


if __name__ == "__main__":
    print("\n".join(table()))
