"""All kinds of values that documents hold, each with the file that declares how it is stored."""

from tuner.formats import (
    compensation,
    configuration,
    consistency,
    curves,
    diagnosis,
    identification,
    inflation,
    noise_terms,
)

__all__ = [
    "compensation",
    "configuration",
    "consistency",
    "curves",
    "diagnosis",
    "identification",
    "inflation",
    "noise_terms",
]
