"""What the truth is, relative to what a filter assumes: the noise of a hypothesis."""

from __future__ import annotations

from dataclasses import dataclass

from models.noise import GaussMarkov


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
    extra : (str, GaussMarkov) or None
        Processes of three axes that the filter lacks, of ``gyro``, ``accel`` or ``fixes``, SI.
    """

    density: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)
    fixes: tuple[float, ...] = (1.0, 1.0)
    time_ratio: tuple[float, ...] = (1.0, 1.0)
    extra: tuple[str, GaussMarkov] | None = None
