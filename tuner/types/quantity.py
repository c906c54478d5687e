"""The name of one number of a filter configuration or of an identification, such as ``gyro_x.white_density``."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

from tuner.types.dotted_name import DottedName


@dataclass(frozen=True)
class Quantity(DottedName):
    """One number: whose it is, and which.

    Files and messages write it as ``OWNER.FIELD``; `parse` and `str` turn one into the other.

    Attributes
    ----------
    owner : str
        An axis (``gyro_x``), a sensor for its three axes (``gyro``), or ``gnss``.
    field : str
        A setting of the filter (``white_density``, ``markov`` for the sds, ``position_sd``), or a coefficient of an
        identified term (``white.density``).

    Raises
    ------
    ValueError
        Where one of the two is empty, or the owner holds a dot.
    """

    kind: ClassVar[str] = "a quantity must be named OWNER.FIELD, such as gyro_x.white_density"
    owner: str
    field: str

    def axes(self, known: Iterable[str]) -> tuple[str, ...]:
        """Return the axes among the known ones that it belongs to: one, or the three of a sensor."""
        return tuple(axis for axis in known if self.owner in {axis, axis.rpartition("_")[0]})
