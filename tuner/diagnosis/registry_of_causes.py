"""A registry of causes, whose effects can be hidden in simulated data by the same codes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from inspect import isclass
from typing import Any, TypeVar

from models.registry import Registry

C = TypeVar("C", bound=type[Any])


class RegistryOfCauses(Registry[C]):
    """Causes by code; the effect of each stands in the registry of effects by the same code.

    Parameters
    ----------
    kind, group : str
        As of `Registry`.
    base : type
        Class of which every cause is a subclass.
    effects : Registry
        Where the effects of causes are declared.
    lacking : callable
        Returns the names of what a declaration needs and does not have; raises TypeError where it is of no known kind.
    """

    def __init__(
        self,
        kind: str,
        group: str,
        *,
        base: type,
        effects: Registry[Any],
        lacking: Callable[[Any], list[str]],
    ) -> None:
        def check(declared: Any) -> None:
            if not (isclass(declared) and issubclass(declared, base)):
                raise TypeError(
                    f"expected a subclass of {base.__module__}.{base.__qualname__}, got {declared!r}"
                )
            if missing := lacking(declared):
                raise TypeError(f"the class needs {', '.join(missing)}")
            effect: Any = getattr(declared, "effect", None)
            if effect is not None and effect.name != getattr(declared, "cause", None):
                raise ValueError(f"its effect has the code '{effect.name}'; give both the same")

        super().__init__(kind, group, name_of=lambda cause: cause.cause, check=check)
        self._effects = effects

    def add(self, declaration: C) -> C:
        """Add a cause, and its effect to those of simulations."""
        added: Any = super().add(declaration)
        if added.effect is not None:
            self._effects.add(added.effect)
        return declaration

    @contextmanager
    def added(self, declaration: C) -> Iterator[C]:
        """Declare a cause and its effect for the length of a ``with`` block."""
        with super().added(declaration):
            if declaration.effect is None:
                yield declaration
            else:
                with self._effects.added(declaration.effect):
                    yield declaration
