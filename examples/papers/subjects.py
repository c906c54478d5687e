"""The three papers by title, and the five noises that all of them treat."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from models.noise import BiasInstability, Quantization, Ramp, RandomWalk, Term, White

RING_LASER_PAPER = "Li Qi et al., noise of ring laser gyroscopes by Allan variance"
FIBRE_OPTIC_PAPER = "Xu Dongsheng et al., ThêoH of fibre-optic gyros"
MEMS_PAPER = "Zhang Meng et al., MEMS gyro: Allan variance and ARMA"

UNIT_NOISES: Mapping[str, Term] = MappingProxyType(
    {
        "quantization": Quantization(1.0),
        "white": White(1.0),
        "bias_instability": BiasInstability(1.0),
        "random_walk": RandomWalk(1.0),
        "ramp": Ramp(1.0),
    }
)
"""Each noise with coefficient 1."""

NOISE_NAMES: Mapping[str, str] = MappingProxyType(
    {
        "quantization": "quantization",
        "white": "angle random walk",
        "bias_instability": "bias instability",
        "random_walk": "rate random walk",
        "ramp": "ramp",
    }
)
"""Names of the noises in the papers."""
