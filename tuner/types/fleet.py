"""Many units of one sensor: what each log shows, which limits it keeps, which units are outlying, and their spread."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

from tuner.types.coefficient import Coefficient
from tuner.types.identification import PooledCoefficient
from tuner.types.shown import Shown


@dataclass(frozen=True)
class UnitMeasurement:
    """What the log of one unit shows.

    Attributes
    ----------
    digest : str
        SHA-256 of the log.
    rate : float
        Samples a second, Hz.
    span : float
        Time covered by the samples at rest, s.
    units : mapping of str to str
        SI unit of each channel, such as ``gyro_x``; ``accel`` stands for the length of the specific force.
    quantities : mapping of str to Coefficient
        By channel and symbol, such as ``gyro_x.N``; see `tuner.production.quantities`.
    further : tuple of str
        Noise terms that the log shows beside N, B and K.
    notes : tuple of str
        Repairs and assumptions of the reader.
    assumptions : tuple of str
        What nobody stated of the log and was assumed, as of `Record`.
    unit_unstated : bool
        Whether nothing tells the unit of a sensor, as of `Record`.
    contradicted : tuple of str
        What of the log the samples speak against, as of `Record`.
    causes : mapping of str to str
        What a person must see, in words, by what it is; see `tuner.production.slow_changes`.
    """

    digest: str
    rate: float
    span: float
    units: Mapping[str, str]
    quantities: Mapping[str, Coefficient]
    further: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    assumptions: tuple[str, ...] = ()
    unit_unstated: bool = False
    contradicted: tuple[str, ...] = ()
    causes: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    schema: Literal["tuner.unit/3"] = "tuner.unit/3"


@dataclass(frozen=True)
class Limit:
    """Largest magnitude that a quantity may have, SI: of every axis of a sensor (``gyro``, ``accel``, ``temperature``).

    `basis` says what it is derived from where nobody stated it: a sheet, or gravity.
    """

    sensor: str
    symbol: str
    largest: float
    basis: str = ""


@dataclass(frozen=True)
class Outlier:
    """A quantity in which a unit stands apart from the fleet.

    Attributes
    ----------
    quantity : str
        Such as ``gyro_x.N``.
    value, median : float
        Of the unit and of the fleet, SI.
    score, threshold : float
        Distance from the median in robust standard deviations, and what the most distant of a sound fleet exceeds
        rarely.
    """

    quantity: str
    value: float
    median: float
    score: float
    threshold: float


@dataclass(frozen=True)
class FleetUnit:
    """One log of a fleet.

    Attributes
    ----------
    name, file : str
        Of the unit and of its log.
    measurement : UnitMeasurement or None
        None where the log cannot be used.
    error : str or None
        Why not, in one line.
    verdict : str
        ``FAIL`` beyond a limit by more than the interval, or where the samples cannot be those of a sensor in order;
        ``LOOK`` where it stands apart or something must be seen; ``OPEN`` where the log does not show that a limit is
        kept, and, with limits or without, where nothing states the unit of the gyroscopes; ``PASS``; ``ERROR`` where
        the log cannot be used; else empty without limits and data sheet.
    broken : tuple of str
        What breaks or leaves open which limit, in words.
    outliers : tuple of Outlier
        Quantities in which it stands apart.
    advice : tuple of str
        What the outlying quantities have in common, such as a mistaken unit, with what to do.
    """

    name: str
    file: str
    measurement: UnitMeasurement | None
    error: str | None = None
    verdict: str = ""
    broken: tuple[str, ...] = ()
    outliers: tuple[Outlier, ...] = ()
    advice: tuple[str, ...] = ()


@dataclass(frozen=True, repr=False)
class Fleet(Shown):
    """All units, in the order of their files.

    Attributes
    ----------
    name : str
        Of the fleet.
    units : tuple of FleetUnit
        One a log.
    limits : tuple of Limit
        As given, and those that follow from a data sheet and from gravity.
    spread : mapping of str to PooledCoefficient
        Mean and unit-to-unit spread by quantity, without outlying units.
    channel_units : mapping of str to str
        SI unit of each channel.
    comparisons : int
        Numbers that were tested for standing apart; the thresholds allow for all of them together.
    measured : int
        Units that were measured now; the others were found in the store, or could not be read.
    """

    name: str
    units: tuple[FleetUnit, ...]
    limits: tuple[Limit, ...]
    spread: Mapping[str, PooledCoefficient] = field(default_factory=lambda: MappingProxyType({}))
    channel_units: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    comparisons: int = 0
    measured: int = 0
