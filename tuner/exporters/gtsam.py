"""GTSAM: a Python function that returns ``PreintegrationCombinedParams``; its "covariances" are densities.

accelerometerCovariance N² (m/s²)²/Hz, gyroscopeCovariance N² (rad/s)²/Hz, biasAccCovariance and
biasOmegaCovariance K²; the code takes care of dt itself. The 6×6 prior of the biases is their turn-on
variance (newer releases ignore it with a warning: set the prior of the first bias instead).
"""

from __future__ import annotations

from models.units import STANDARD_GRAVITY
from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.scripts import commented, vector
from tuner.exporters.triad_values import triad, triple
from tuner.synthesis.equivalent_models import equivalent_random_walk, equivalent_white_density
from tuner.types import ChannelNoise, FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return a Python module with ``params()``."""

    def walk(channel: ChannelNoise) -> float:
        return equivalent_random_walk(channel, memory=target.memory) ** 2

    def white_variance(channel: ChannelNoise) -> float:
        return equivalent_white_density(channel, memory=target.memory) ** 2

    lines = []
    priors = []
    for sensor, noise, bias in (
        ("accel", "Accelerometer", "BiasAcc"),
        ("gyro", "Gyroscope", "BiasOmega"),
    ):
        channels = triad(config, sensor)
        if not channels:
            continue
        white, _ = triple(channels, white_variance, "")
        drive, _ = triple(channels, walk, "")
        prior, _ = triple(channels, lambda c: c.constant_sd**2, "")
        priors += prior
        lines.append(f"p.set{noise}Covariance(np.diag({vector(white)}))  # N²\n")
        lines.append(f"p.set{bias}Covariance(np.diag({vector(drive)}))  # K²\n")
    if len(priors) == 6:
        lines.append(f"p.setBiasAccOmegaInit(np.diag({vector(priors)}))  # turn-on variance: accel, gyro\n")
    header = provenance(config, "GTSAM preintegration parameters", walk_memory=target.memory)
    start = (
        "import gtsam\nimport numpy as np\n\n\ndef params():\n"
        '    """Return parameters for a frame with z up; densities in SI."""\n'
        f"    p = gtsam.PreintegrationCombinedParams.MakeSharedU({STANDARD_GRAVITY})  # m/s²\n"
    )
    return commented(header, "#") + start + "".join(f"    {line}" for line in lines) + "    return p\n"


DIALECT = Dialect(
    "gtsam",
    "GTSAM preintegration parameters (Python)",
    "(rad/s)²/Hz, (rad/s²)²/Hz, (m/s²)²/Hz, (m/s³)²/Hz",
    write,
)
