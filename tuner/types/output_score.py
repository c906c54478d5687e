"""Which fault of a filter explains its errors, and by how much."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType


@dataclass(frozen=True)
class OutputCause:
    """One fault that explains the errors of a filter better than none.

    Attributes
    ----------
    cause : str
        Code: ``gnss_noise_scale`` (R), ``imu_noise_scale`` (Q), ``noise_scale`` (both), ``time_constant``,
        ``missing_state``, ``correlated_gnss``, ``time_offset``, ``lever_arm``, ``gnss_frame``, ``mounting``,
        ``unit_of_sds``.
    size : float
        How large it is, in `unit`: of scales, true ÷ assumed sd; of vectors, the length.
    interval : (float, float)
        95 %.
    unit : str
        SI.
    gain : float
        Log likelihood above that of the unchanged filter, nats, less the price of its parameters.
    parameters : mapping of str to (value, low, high)
        Its parts, each with its 95 % interval.
    subject : str
        Which part of the filter it is about, such as ``gyro bias noise``; empty where the code says it.
    alternatives : tuple of OutputCause
        What the errors do not distinguish from it, the likeliest first.
    constant : bool
        Whether it is a constant between the estimate and its truth, found before any noise.
    """

    cause: str
    size: float
    interval: tuple[float, float]
    unit: str
    gain: float
    parameters: Mapping[str, tuple[float, float, float]] = field(default_factory=lambda: MappingProxyType({}))
    subject: str = ""
    alternatives: tuple[OutputCause, ...] = ()
    constant: bool = False


@dataclass(frozen=True)
class TimeOffset:
    """By how much the stamps of an estimate are late, s, with its 95 % interval."""

    value: float
    interval: tuple[float, float]
    removed: bool
