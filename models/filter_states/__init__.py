"""The states that a filter may have beside position, velocity and attitude, by name; open to other packages."""

from __future__ import annotations

from models.filter_states.built_in import BUILT_IN
from models.filter_states.declaration import (
    Coupling,
    FilterState,
    Origin,
    Process,
    check_declaration,
    process,
)
from models.registry import Registry, RegistryError

__all__ = [
    "FILTER_STATES",
    "Coupling",
    "FilterState",
    "Origin",
    "Process",
    "named_state",
    "named_states",
    "process",
]

FILTER_STATES: Registry[FilterState] = Registry(
    "filter state", "tuner.filter_states", name_of=lambda state: state.name, check=check_declaration
)
"""All declared states, in the order in which a filter has them."""
FILTER_STATES.extend(BUILT_IN)

NAMED_ORIGINS = (Origin.NAME, Origin.AXIS_SLOPE)
"""Origins of states that a configuration names."""


def named_states() -> tuple[str, ...]:
    """Return the names of the states that a configuration or a user can ask for."""
    return tuple(name for name, state in FILTER_STATES.items() if state.origin in NAMED_ORIGINS)


def named_state(name: str) -> FilterState:
    """Return the declaration of a state that a configuration names.

    Raises
    ------
    RegistryError
        Where it is not declared, or follows from other parts of a configuration; one line.
    """
    state = FILTER_STATES[name]
    if state.origin not in NAMED_ORIGINS:
        raise RegistryError(f"filter state '{name}' cannot be named: it follows from {state.origin.value}")
    return state
