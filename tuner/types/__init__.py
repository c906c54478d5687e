"""What was found: the frozen results every room hands to the next.

Numbers are SI; every number a user sees is a `Coefficient`: a value with its 95 % interval, or an upper limit
with the reason why there is no more. Results import none of the code that makes them.
"""

from __future__ import annotations

from tuner.process import allow_pickled_mappings
from tuner.types.coefficient import LEVEL, Coefficient
from tuner.types.compensation import Compensation, Parameter
from tuner.types.config import (
    ChannelNoise,
    FilterConfig,
    GnssNoise,
    InitialUncertainty,
)
from tuner.types.curves import AllanCurve, Correlogram, Spectrum
from tuner.types.diagnosis import (
    Alternative,
    Diagnosis,
    DriveDiagnosis,
    Finding,
    Gain,
    Inseparable,
    NoiseScaleEstimate,
    Unexplained,
)
from tuner.types.identification import (
    ArmaFit,
    Candidate,
    ChannelIdentification,
    Identification,
    PooledChannel,
    PooledCoefficient,
    SeriesTest,
    TermEstimate,
)
from tuner.types.inflation import AppliedNoiseScale, BoundUsed, Enlargement, Inflation
from tuner.types.quantity import Quantity

allow_pickled_mappings()

__all__ = [
    "LEVEL",
    "AllanCurve",
    "Alternative",
    "AppliedNoiseScale",
    "ArmaFit",
    "BoundUsed",
    "Candidate",
    "ChannelIdentification",
    "ChannelNoise",
    "Coefficient",
    "Compensation",
    "Correlogram",
    "Diagnosis",
    "DriveDiagnosis",
    "Enlargement",
    "FilterConfig",
    "Finding",
    "Gain",
    "GnssNoise",
    "Identification",
    "Inflation",
    "InitialUncertainty",
    "Inseparable",
    "NoiseScaleEstimate",
    "Parameter",
    "PooledChannel",
    "PooledCoefficient",
    "Quantity",
    "SeriesTest",
    "Spectrum",
    "TermEstimate",
    "Unexplained",
]
