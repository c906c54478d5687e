"""What the truth is, relative to what a filter assumes: the noise of a hypothesis."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ExtraProcess:
    """First-order Gauss–Markov processes of three axes that a filter lacks.

    Attributes
    ----------
    place : str
        ``gyro``, ``accel`` or ``fixes``.
    sd, time_constant : float
        SI.
    """

    place: str
    sd: float
    time_constant: float


@dataclass(frozen=True)
class TrueNoise:
    """What the truth is relative to what a filter assumes.

    Attributes
    ----------
    density : tuple of 4 floats
        True ÷ assumed density of each source of process noise.
    fixes : tuple of 2 floats
        True ÷ assumed sd of position and velocity fixes.
    time_ratio : tuple of 2 floats
        True ÷ assumed time constant of gyro and accelerometer biases of the assumed sd.
    extra : ExtraProcess or None
        What the filter lacks.
    """

    density: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)
    fixes: tuple[float, ...] = (1.0, 1.0)
    time_ratio: tuple[float, ...] = (1.0, 1.0)
    extra: ExtraProcess | None = None
