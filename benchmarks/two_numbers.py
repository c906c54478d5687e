"""Why a filter with two numbers an axis needs others than those measured: prints docs/how-to/two-numbers.md.

    python benchmarks/two_numbers.py > docs/how-to/two-numbers.md

and draws the figure beside it. Exact covariances of `tuner.synthesis.projection`, no simulation.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from pathlib import Path

import matplotlib as mpl
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
mpl.use("svg")

from matplotlib import pyplot as plt

from models.noise.bias_instability import ALLAN_FLOOR
from tuner.synthesis.load_config import load_config
from tuner.synthesis.projection import (
    AUTOPILOT,
    CAMERA,
    GNSS,
    LIDAR,
    RTK,
    Aiding,
    Projected,
    errors_by_prediction,
    projected,
)
from tuner.types import ChannelNoise

FIGURE = Path(__file__).parents[1] / "docs" / "how-to" / "two-numbers.svg"
GRADE = "icm20602"
FACTORS = np.geomspace(1.0, 30.0, 40)

HEAD = """# Two numbers for a filter: why neither the measured ones nor ten times as much

A filter with white noise N and a random walk K of each bias cannot hold flicker (bias instability B). Entered as
measured, N and K predict errors that are too small; so people multiply by ten. Below is what such a filter errs ÷ what
it predicts, by exact covariance of both (`tuner.synthesis.projection`), for the built-in grade {grade}: position,
velocity and (gyro) angle with fixes, and position 10 and 60 s after the last one; smallest and largest of them, and the
last. 1 is right, above 1 the filter trusts itself too much.

- *measured*: N of the grade, and the K that an hour of rest cannot tell from B (half of the Allan floor at 1000 s);
- *× 10*: ten times both;
- *tuner*: the two numbers that `tuner export` writes, chosen for the fixes that the filter gets, with their ratio to N.

| fixes | sensor | measured | × 10 | tuner |
|---|---|---|---|---|"""

TAIL = """
![true ÷ predicted over the factor on N](two-numbers.svg)

The figure multiplies N alone (gyro, GNSS at 1 Hz): where one error is predicted rightly, another is not, as white noise
grows with the root of the time and flicker faster. It takes another K as well, and which pair is right depends on
the fixes: often fixed filters (cameras) need less white noise than rarely fixed ones, as slow noise has less
time to grow. With both, the errors of this
grade lie within some 15 % of what is predicted, each axis with numbers of its own.

The same holds for one Gauss–Markov state. Hand-tuned KF-GINS settings of four sensors with RTK positions (i2Nav
awesome-gins-datasets) have bias sds of 2.5 to 20 × B; those chosen here by the covariance alone differ from
them by a median factor of {hand:.2f}.

```sh
tuner export icm20602 --to kalibr
```

`python benchmarks/two_numbers.py > docs/how-to/two-numbers.md` writes this page."""


def measured(channel: ChannelNoise) -> Projected:
    """Return N, and half of the walk whose Allan deviation at 1000 s is the floor of the flicker."""
    level = (
        next(one for one in channel.identified if one.name == "bias_instability").coefficients["level"].value
    )
    return Projected(channel.white_density, 0.5 * ALLAN_FLOOR * level * math.sqrt(3.0 / 1000.0))


def cell(channel: ChannelNoise, aiding: Aiding, pair: Projected) -> str:
    """Return the range of true ÷ predicted, and that after 60 s."""
    found = list(errors_by_prediction(channel, aiding, pair).values())
    return f"{min(found):.2f} … {max(found):.2f}; {found[-1]:.2f}"


def rows() -> Iterator[str]:
    """Yield the lines of the table."""
    config = load_config(GRADE)
    for aiding in (GNSS, AUTOPILOT, RTK, LIDAR, CAMERA):
        for axis in ("gyro_x", "accel_x"):
            channel = config.channels[axis]
            one, best = measured(channel), projected(channel, aiding)
            ten = Projected(10.0 * one.white_density, 10.0 * one.bias)
            ratio = f"{cell(channel, aiding, best)} (N × {best.white_density / one.white_density:.1f})"
            cells = (cell(channel, aiding, one), cell(channel, aiding, ten), ratio)
            yield f"| {aiding.words} | {axis.partition('_')[0]} | {' | '.join(cells)} |"


def draw() -> None:
    """Draw true ÷ predicted of each error over the factor on N."""
    channel = load_config(GRADE).channels["gyro_x"]
    one, best = measured(channel), projected(channel, GNSS)
    curves = [
        errors_by_prediction(channel, GNSS, Projected(f * one.white_density, one.bias)) for f in FACTORS
    ]
    chosen = errors_by_prediction(channel, GNSS, best)
    plt.rcParams["svg.hashsalt"] = "two-numbers"
    figure, axes = plt.subplots(figsize=(7.0, 3.6), layout="constrained")
    for name in curves[0]:
        (line,) = axes.loglog(
            FACTORS, [curve[name] for curve in curves], label=name.removesuffix(" after the last fix")
        )
        axes.plot(best.white_density / one.white_density, chosen[name], "o", color=line.get_color())
    axes.axhline(1.0, color="0.6", lw=0.8)
    axes.set(xlabel="factor on N; dots: both numbers as tuner writes them", ylabel="true ÷ predicted error")
    axes.legend(title=f"gyro of {GRADE}")
    figure.savefig(FIGURE, metadata={"Date": None})


def hand_tuned() -> float:
    """Return the median factor between hand-tuned settings and these."""
    from tests.reference.test_tuned_filters import TABLE, predicted

    logs = [math.log(tuned / predicted(level, walk)) for level, tuned, walk in TABLE.values()]
    return math.exp(float(np.median(logs)))


if __name__ == "__main__":
    draw()
    print("\n".join((HEAD.format(grade=GRADE), *rows(), TAIL.format(hand=hand_tuned()))))
