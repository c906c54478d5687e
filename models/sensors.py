"""Grades of sensors: the figures of a data sheet, each with its source.

A grade is data, not a simulation: `TriadGrade.noise_model` turns the noise of a triad into a `NoiseModel`
of one axis. Numbers are SI; None means that the source is silent. The values live in the YAML files of
``configs/``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from models.noise import BiasInstability, GaussMarkov, NoiseModel, Quantization, Ramp, RandomWalk, Term, White
from models.units import unit_of_samples

V = TypeVar("V", float, GaussMarkov)

KINDS = ("gyro", "accel")


@dataclass(frozen=True)
class Sourced(Generic[V]):
    """A number or a process of a data sheet, and where it comes from.

    Attributes
    ----------
    value : float or GaussMarkov
        SI.
    reference : str
        Data sheet, paper or recording; ``recalled`` where the source was not opened.
    """

    value: V
    reference: str

    def __post_init__(self) -> None:
        if not self.reference.strip():
            raise ValueError(f"'reference' must name the source of {self.value}")


@dataclass(frozen=True)
class TriadGrade:
    """Three like sensors, gyroscopes (rate unit rad/s) or accelerometers (m/s²).

    Attributes
    ----------
    kind : str
        ``gyro`` or ``accel``.
    quantization : Sourced or None
        sd of the increment error Q, unit·s.
    white : Sourced or None
        Two-sided density N, unit/√Hz.
    bias_instability : Sourced or None
        Level B of S = B²/(2πf), unit; a data sheet's Allan minimum is 0.664 B.
    random_walk : Sourced or None
        Density K, unit/√s.
    ramp : Sourced or None
        Rate R, unit/s.
    gauss_markov : tuple of Sourced
        Exponentially correlated biases.
    turn_on_sd : Sourced or None
        sd of the constant bias from one switch-on to the next, unit.
    scale_factor_sd : Sourced or None
        sd of the scale factor error, 1.
    misalignment_sd : Sourced or None
        sd of the misalignment of an axis, rad.
    g_sensitivity_sd : Sourced or None
        sd of the gyro rate per specific force, (rad/s)/(m/s²).
    bandwidth : Sourced or None
        −3 dB frequency, Hz.
    range : Sourced or None
        Full scale, unit.
    """

    kind: str
    quantization: Sourced[float] | None = None
    white: Sourced[float] | None = None
    bias_instability: Sourced[float] | None = None
    random_walk: Sourced[float] | None = None
    ramp: Sourced[float] | None = None
    gauss_markov: tuple[Sourced[GaussMarkov], ...] = ()
    turn_on_sd: Sourced[float] | None = None
    scale_factor_sd: Sourced[float] | None = None
    misalignment_sd: Sourced[float] | None = None
    g_sensitivity_sd: Sourced[float] | None = None
    bandwidth: Sourced[float] | None = None
    range: Sourced[float] | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"'kind' must be one of {', '.join(KINDS)}, got '{self.kind}'")

    @property
    def unit(self) -> str:
        """Unit of the samples."""
        return unit_of_samples(self.kind)

    def noise_model(self) -> NoiseModel:
        """Return the noise of one axis; terms without a figure are absent."""
        sourced: tuple[tuple[Callable[[float], Term], Sourced[float] | None], ...] = (
            (Quantization, self.quantization),
            (White, self.white),
            (BiasInstability, self.bias_instability),
            (RandomWalk, self.random_walk),
            (Ramp, self.ramp),
        )
        single = [term(number.value) for term, number in sourced if number is not None]
        return NoiseModel([*single, *(g.value for g in self.gauss_markov)])


@dataclass(frozen=True)
class SensorGrade:
    """A whole inertial sensor.

    Attributes
    ----------
    key : str
        Name on the command line: lower case, no punctuation.
    title : str
        Name for people.
    rate : Sourced
        Sampling rate, Hz.
    gyro, accel : TriadGrade
        The two triads.
    notes : tuple of str
        What a user must know of the numbers.
    """

    key: str
    title: str
    rate: Sourced[float]
    gyro: TriadGrade
    accel: TriadGrade
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not (self.key.isascii() and self.key.isalnum() and self.key == self.key.lower()):
            raise ValueError(f"'key' must be lower-case letters and digits, got '{self.key}'")
        for kind in KINDS:
            if self.triad(kind).kind != kind:
                raise ValueError(f"'{kind}' must hold a triad of that kind, got '{self.triad(kind).kind}'")

    def triad(self, kind: str) -> TriadGrade:
        """Return the triad ``gyro`` or ``accel``."""
        return {"gyro": self.gyro, "accel": self.accel}[kind]

    def noise_model(self, kind: str) -> NoiseModel:
        """Return the noise of one axis of ``gyro`` or ``accel``."""
        return self.triad(kind).noise_model()
