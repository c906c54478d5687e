"""Parameters of the causes of a drive, and the values of them that are taken out of a drive before it is filtered."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar, Self

import numpy as np

from models.arrays import FloatArray
from tuner.types.dotted_name import DottedName


@dataclass(frozen=True, order=True)
class Parameter(DottedName):
    """One parameter of one cause.

    Files and messages write it as ``CAUSE.NAME``; `parse` and `str` turn one into the other.

    Attributes
    ----------
    cause : str
        Code of the cause, such as ``lever_arm``.
    name : str
        An axis (``x``) or another name of a parameter (``delay``), as findings have it.

    Raises
    ------
    ValueError
        Where one of the two is empty, or the cause holds a dot.
    """

    kind: ClassVar[str] = "a parameter must be named CAUSE.NAME, such as time_offset.delay"
    cause: str
    name: str


@dataclass(frozen=True, eq=False)
class Compensation(Mapping[Parameter, float]):
    """Values of parameters, SI, that are taken out of a drive; a parameter that is not in it changes nothing.

    `tuner.navigation.compensation` says what each of them means and takes it out.

    Attributes
    ----------
    by_parameter : mapping of Parameter to float
        The values.
    """

    by_parameter: Mapping[Parameter, float] = field(default_factory=lambda: MappingProxyType({}))

    @classmethod
    def parse(cls, texts: Mapping[str, float]) -> Self:
        """Return the compensation that names such as ``lever_arm.x`` and values make."""
        return cls({Parameter.parse(text): float(value) for text, value in texts.items()})

    def as_text(self) -> dict[str, float]:
        """Return names such as ``lever_arm.x`` and values, as files have them."""
        return {str(parameter): value for parameter, value in self.items()}

    def __getitem__(self, parameter: Parameter) -> float:
        return self.by_parameter[parameter]

    def __iter__(self) -> Iterator[Parameter]:
        return iter(self.by_parameter)

    def __len__(self) -> int:
        return len(self.by_parameter)

    @property
    def causes(self) -> tuple[str, ...]:
        """Codes of the causes that it has parameters of, in order of their first."""
        return tuple(dict.fromkeys(parameter.cause for parameter in self))

    def value(self, cause: str, name: str) -> float:
        """Return one value, 0 where there is none."""
        return self.get(Parameter(cause, name), 0.0)

    def vector(self, parameters: Iterable[Parameter]) -> FloatArray:
        """Return the values of p parameters, 0 where there is none; shape (p,)."""
        return np.array([self.get(parameter, 0.0) for parameter in parameters])

    def of(self, cause: str) -> dict[str, float]:
        """Return the values of one cause by the names of its parameters."""
        return {parameter.name: value for parameter, value in self.items() if parameter.cause == cause}

    def with_values(self, values: Mapping[Parameter, float]) -> Compensation:
        """Return the compensation with further values, or others."""
        return Compensation({**self, **values})

    def without(self, causes: Collection[str]) -> Compensation:
        """Return the compensation without some causes."""
        return Compensation({p: value for p, value in self.items() if p.cause not in causes})
