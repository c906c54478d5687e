# mypy: disable-error-code="no-untyped-call, untyped-decorator, misc"
"""One column of a covariance, of numbers or lanes, through one step of the error dynamics.

A times nine rows goes block by block in the order of `models.error_state`: attitude, velocity, position, each from
what is before it; Γ times the errors of the six sensors comes on the way, and S gives these from the states.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from models.vector3 import add, cross, scale, transform
from tuner.navigation.engine.numba_pipeline import compiled
from tuner.navigation.engine.simd import LANES
from tuner.navigation.engine.tracing import straight
from tuner.navigation.engine.types import SMALLEST, Layout


class Step(NamedTuple):
    """What advances a column: matrices of `models.error_state` times dt, the force times dt/2, −C dt."""

    f_rr: Any
    f_vr: Any
    f_vv: Any
    f_ar: Any
    f_av: Any
    omega: Any
    push: Any
    turn: Any
    half: Any


_SIDES = ((1, 0, 1),) * 3
_FILLED = Step(
    ((1, 0, 1), (1, 1, 1), (0, 0, 0)),
    _SIDES,
    ((1, 1, 1), (1, 1, 1), (1, 1, 0)),
    _SIDES,
    ((0, 1, 0), (1, 0, 0), (0, 1, 0)),
    (1, 1, 1),
    (1, 1, 1),
    ((1, 1, 1),) * 3,
    1,
)
"""What of a step is not nought."""


def _numbers(filled: Any, of: Any) -> list[Any]:
    """Return what is not nought of a tuple of tuples."""
    if not isinstance(filled, tuple):
        return [of] if filled else []
    return [number for f, o in zip(filled, of, strict=True) for number in _numbers(f, o)]


def _refilled(filled: Any, numbers: Iterator[Any]) -> Any:
    """Return the tuple of tuples again."""
    if not isinstance(filled, tuple):
        return next(numbers) if filled else 0.0
    parts = [_refilled(part, numbers) for part in filled]
    return Step(*parts) if isinstance(filled, Step) else tuple(parts)


NUMBERS = len(_numbers(_FILLED, _FILLED))
"""How many numbers a step has."""


@straight
def keep(step: Any, memory: Any) -> None:
    """Set the numbers of the step of one filter, shape (NUMBERS,)."""
    if memory.kind.dtype is not LANES:
        for k, number in enumerate(_numbers(_FILLED, step)):
            memory[k] = number


@straight
def kept(step: Any, memory: Any) -> Any:
    """Return a step that of one filter is read where it is wanted: as lanes its numbers find no room in registers."""
    if memory.kind.dtype is LANES:
        return step
    return _refilled(_FILLED, (memory[k] for k in range(NUMBERS)))


@straight
def _row(m: Any, r: int, s: Any) -> Any:
    """Return row r of a matrix times six numbers."""
    return m[r, 0] * s[0] + m[r, 1] * s[1] + m[r, 2] * s[2] + m[r, 3] * s[3] + m[r, 4] * s[4] + m[r, 5] * s[5]


@straight
def unmixed(lay: Layout, inverse: Any, s: Any) -> Any:
    """Return A⁻¹ s as rates and forces."""
    if lay.ideal:
        return (s[0], s[1], s[2]), (s[3], s[4], s[5])
    return (
        (_row(inverse, 0, s), _row(inverse, 1, s), _row(inverse, 2, s)),
        (_row(inverse, 3, s), _row(inverse, 4, s), _row(inverse, 5, s)),
    )


@straight
def column_of(M: Any, c: int) -> Any:
    """Return the first nine rows of a column as three triples."""
    return (M[0, c], M[1, c], M[2, c]), (M[3, c], M[4, c], M[5, c]), (M[6, c], M[7, c], M[8, c])


@straight
def set_triple(M: Any, c: int, first: int, y: Any) -> None:
    """Set three rows of a column."""
    for k in range(3):
        M[first + k, c] = y[k]


@straight
def tilted(column: Any, rate: Any, step: Any) -> Any:
    """Return the attitude rows of A times a column of nine, plus Γ times rate errors."""
    r, v, a = column
    y = add(transform(step.f_ar, r), transform(step.f_av, v))
    return add(a, add(y, add(transform(step.turn, rate), cross(a, step.omega))))


@straight
def pushed(column: Any, after: Any, force: Any, fall: Any, step: Any) -> Any:
    """Return the velocity rows, from the attitude `after` it, with force errors and `fall` downwards."""
    r, v, a = column
    y = add(transform(step.f_vr, r), transform(step.f_vv, v))
    y = add(y, add(transform(step.turn, force), cross(add(a, after), step.push)))
    return add(v, (y[0], y[1], y[2] + fall))


@straight
def moved(column: Any, after: Any, step: Any) -> Any:
    """Return the position rows, from the velocity `after` it."""
    r, v, _ = column
    return add(r, add(transform(step.f_rr, r), scale(step.half, add(v, after))))


@straight
def _by_biases(slant: Any, M: Any, c: int) -> Any:
    """Return what the biases add to S times column c of M."""
    return (
        slant[9] * M[9, c],
        slant[10] * M[10, c],
        slant[11] * M[11, c],
        slant[12] * M[12, c],
        slant[13] * M[13, c],
        slant[14] * M[14, c],
    )


@compiled
def _with_others(lay: Layout, r: int, y: Any, slant: Any, M: Any, c: int) -> Any:
    """Return row r of S times column c of M, of which y is the part of the biases."""
    for k in range(lay.first[r], lay.first[r + 1]):
        s = lay.feed[k]
        y += slant[s] * M[s, c]
    return y


@compiled
def all_sensed(lay: Layout, slant: Any, M: Any, c: int) -> Any:
    """Return S times column c of M."""
    y = _by_biases(slant, M, c)
    if lay.size == SMALLEST:
        return y
    return (
        _with_others(lay, 0, y[0], slant, M, c),
        _with_others(lay, 1, y[1], slant, M, c),
        _with_others(lay, 2, y[2], slant, M, c),
        _with_others(lay, 3, y[3], slant, M, c),
        _with_others(lay, 4, y[4], slant, M, c),
        _with_others(lay, 5, y[5], slant, M, c),
    )
