"""GTSAM: a Python function that returns ``PreintegrationCombinedParams``; its "covariances" are densities.

accelerometerCovariance N² (m/s²)²/Hz, gyroscopeCovariance N² (rad/s)²/Hz, biasAccCovariance and biasOmegaCovariance
K²; the code takes care of dt itself. ``integrationCovariance``, whose default of 1 m²/s means 1 m after 1 s, is set
to 1e-12. Releases up to 4.2 add ``biasAccOmegaInt`` as noise of every step, by default 1: zeros; 4.3 has no such
setting. The turn-on sds are a prior of the first bias.

Source: borglab/gtsam gtsam/navigation/CombinedImuFactor.cpp (integrateMeasurement), PreintegrationParams.h.
"""

from __future__ import annotations

from models.units import STANDARD_GRAVITY
from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.scripts import commented, vector
from tuner.exporters.triad_values import limited, triad, triple
from tuner.types import FilterConfig

_INTEGRATION_COVARIANCE = 1e-12
"""Error of the integration itself, m²/s: small beside any noise, and enough to keep the covariance regular."""


def write(config: FilterConfig, target: Target) -> str:
    """Return a Python module with ``params()``."""
    lines = []
    priors = []
    for sensor, noise, bias in (
        ("accel", "Accelerometer", "BiasAcc"),
        ("gyro", "Gyroscope", "BiasOmega"),
    ):
        channels = triad(config, sensor)
        white, _ = triple(channels, lambda c: target.white_density(c) ** 2, "")
        drive, _ = triple(channels, lambda c: target.bias(c) ** 2, "")
        prior, _ = triple(channels, lambda c: c.constant_sd, "")
        priors += prior
        lines.append(f"p.set{noise}Covariance(np.diag({vector(white)}))  # N²\n")
        lines.append(
            f"p.set{bias}Covariance(np.diag({vector(drive)}))  # {limited(config, channels, 'K²')}\n"
        )
    lines += [
        f"p.setIntegrationCovariance({_INTEGRATION_COVARIANCE!r} * np.eye(3))  # the default is 1 m after 1 s\n",
        'if hasattr(p, "setBiasAccOmegaInit"):  # up to 4.2 noise of every step, by default 1\n',
        "    p.setBiasAccOmegaInit(np.zeros((6, 6)))\n",
        "return p\n",
    ]
    header = provenance(config, "GTSAM preintegration parameters", target)
    start = (
        "import gtsam\nimport numpy as np\n\n\ndef params():\n"
        '    """Return parameters for a frame with z up that does not turn; densities in SI.\n\n'
        "    Of tactical grades setOmegaCoriolis has to take the Earth's rate out.\n"
        "    A GPSFactor takes the errors of fixes as white: where they last, its sds are too small.\n"
        '    """\n'
        f"    p = gtsam.PreintegrationCombinedParams.MakeSharedU({STANDARD_GRAVITY})  # m/s²\n"
    )
    bias = (
        "\n\ndef bias_prior():\n"
        '    """Return the noise of a prior on the first bias: its turn-on sds, m/s² and rad/s."""\n'
        f"    return gtsam.noiseModel.Diagonal.Sigmas(np.array({vector(priors)}))\n"
    )
    return commented(header, "#") + start + "".join(f"    {line}" for line in lines) + bias


DIALECT = Dialect(
    "gtsam",
    "GTSAM preintegration parameters (Python)",
    "(rad/s)²/Hz, (rad/s²)²/Hz, (m/s²)²/Hz, (m/s³)²/Hz",
    write,
)
