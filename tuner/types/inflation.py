"""Numbers of a configuration that are not the plain estimate: bounds used, enlargements, noise scales of a drive.

All three name a quantity and carry the factor that the configuration has on it, with the reason in words.
"""

from __future__ import annotations

from dataclasses import dataclass

from tuner.types.quantity import Quantity


@dataclass(frozen=True)
class BoundUsed:
    """A number taken from an upper limit, because the data give no estimate.

    Attributes
    ----------
    quantity : Quantity
        Coefficient of an identified term.
    factor : float
        Share of the 95 % upper limit that is used.
    reason : str
        Why there is no estimate.
    """

    quantity: Quantity
    factor: float
    reason: str


@dataclass(frozen=True)
class Enlargement:
    """A number made larger than its estimate.

    Attributes
    ----------
    quantity : Quantity
        Setting of the filter, or coefficient of an identified term.
    factor : float
        Used value ÷ estimate.
    reason : str
        Why.
    causes : tuple of str
        Codes of the findings that ask for it, where there are any.
    time_share : float or None
        Share of the record, 0 … 1, in which the cause makes the noise larger than its rms over the record; None for
        what is not noise of a record.
    """

    quantity: Quantity
    factor: float
    reason: str
    causes: tuple[str, ...] = ()
    time_share: float | None = None


@dataclass(frozen=True)
class AppliedNoiseScale:
    """What a configuration makes of the estimate of a noise setting from a drive (`NoiseScaleEstimate`).

    Attributes
    ----------
    quantity : Quantity
        Setting of the filter, of a sensor or of the receiver.
    factor : float
        Factor in the configuration; 1 where the drive does not contradict the stated value.
    reason : str
        The estimate and its causes in words.
    interval : (float, float) or None
        Its 95 % interval, of the same estimate; None where there is none.
    causes : tuple of str
        Codes of what accounts for that factor, ``unknown`` for what nothing does.
    """

    quantity: Quantity
    factor: float
    reason: str
    interval: tuple[float, float] | None = None
    causes: tuple[str, ...] = ()


Inflation = BoundUsed | Enlargement | AppliedNoiseScale
"""Any record of a number that is not the plain estimate."""
