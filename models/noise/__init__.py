"""A sensor's noise is a flat sum of named terms: `NoiseModel`.

::

    model = White(2e-4) + BiasInstability(1e-5) + RandomWalk(3e-7)
    model.allan_variance([1.0, 10.0, 100.0], interval=0.01)

Spectra, variances and autocovariances of independent terms add. The order of the terms has no meaning:
sums of the same terms are equal. Units and conventions are those of `models`.
"""

from __future__ import annotations

from models.noise.arma import Arma
from models.noise.base import TERMS, NoiseModel, Term
from models.noise.bias_instability import BiasInstability
from models.noise.gauss_markov import GaussMarkov, LowPassWhite
from models.noise.power_law import Quantization, Ramp, RandomWalk, White
from models.noise.sinusoid import Sinusoid

__all__ = [
    "POWER_LAW",
    "TERMS",
    "Arma",
    "BiasInstability",
    "GaussMarkov",
    "LowPassWhite",
    "NoiseModel",
    "Quantization",
    "Ramp",
    "RandomWalk",
    "Sinusoid",
    "Term",
    "White",
]

POWER_LAW = (Quantization, White, BiasInstability, RandomWalk, Ramp)
"""The five terms of IEEE Std 952 whose Allan variance is one power of τ, in the order of their slopes."""
TERMS.extend(
    (Quantization, White, BiasInstability, GaussMarkov, RandomWalk, Ramp, LowPassWhite, Sinusoid, Arma)
)
