"""Effects as text: ``code:name=value,name=value`` in SI units, to an effect and back.

The parameters of an effect are the fields of its class; the numbers of a list are parted by ``/``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, fields
from typing import Any, ClassVar, TypeVar

Parameter = float | int | str | tuple[float, ...]
Kind = TypeVar("Kind", bound="Written")


@dataclass(frozen=True)
class Written:
    """A code and parameters."""

    name: ClassVar[str]

    def parameters(self) -> dict[str, Parameter]:
        """Return the parameters that are set, by name."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return {key: value for key, value in values.items() if value is not None}

    def __str__(self) -> str:
        parts = (f"{key}={_written(value)}" for key, value in self.parameters().items())
        return f"{self.name}:{','.join(parts)}"


def kind(code: str, kinds: Mapping[str, type[Kind]]) -> type[Kind]:
    """Return the class of a cause; ValueError names the codes there are."""
    if code not in kinds:
        raise ValueError(f"an effect must be one of {', '.join(kinds)}; got '{code}'")
    return kinds[code]


def parse(text: str, kinds: Mapping[str, type[Kind]]) -> Kind:
    """Read an effect such as ``line:frequency=12.5,amplitude=0.01``.

    Parameters
    ----------
    text : str
        Code, colon, ``name=value`` parted by commas, in SI units; ``str(effect)`` writes this form.
    kinds : mapping of str to type
        Class of every cause, by its code.

    Raises
    ------
    ValueError
        One line that names what is wrong and what is allowed.
    """
    code, _, rest = text.strip().partition(":")
    effect = kind(code.strip(), kinds)
    known: dict[str, Field[Any]] = {f.name: f for f in fields(effect)}
    values: dict[str, Parameter] = {}
    for part in filter(None, (p.strip() for p in rest.split(","))):
        name, equals, value = (p.strip() for p in part.partition("="))
        if not equals or name not in known:
            raise ValueError(f"'{code}' takes {', '.join(f'{k}=VALUE' for k in known)}; got '{part}'")
        values[name] = _value(code, known[name], value)
    missing = [k for k, f in known.items() if f.default is MISSING and k not in values]
    if missing:
        raise ValueError(f"'{code}' needs {', '.join(f'{k}=VALUE' for k in missing)}; got '{text.strip()}'")
    return effect(**values)


def _written(value: Parameter) -> str:
    if isinstance(value, tuple):
        return "/".join(map(_written, value))
    return str(value) if isinstance(value, int | str) else repr(float(value))


def _value(code: str, parameter: Field[Any], text: str) -> Parameter:
    declared = str(parameter.type)
    try:
        if declared == "str":
            return text
        if declared.startswith("tuple"):
            return tuple(float(part) for part in text.split("/") if part)
        number = float(text)
        if declared == "int" and not number.is_integer():
            raise ValueError
        return int(number) if declared == "int" else number
    except ValueError:
        wanted = {"int": "an integer", "tuple[float, ...]": "numbers parted by '/'"}.get(declared, "a number")
        raise ValueError(f"'{parameter.name}' of '{code}' must be {wanted}, got '{text}'") from None
