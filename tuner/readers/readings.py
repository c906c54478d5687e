"""Which readings of a log are left where one is refused: each is tried on the samples before it is recommended.

A reading is tried as its user would pass it, by the reader itself, on the beginning of the log. There nothing counts
as stated: units, gravity, the Earth's rate, noise, steps and clock must all fit, and a further sensor that does not
brings its own readings into the same line. Where none is left, samples that are no rates are tried (sums, half and
double size): no option reads these, and the line says what they may be.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.units import STANDARD_GRAVITY
from tuner.readers.assemble import checked, even, plan_of
from tuner.readers.columns import Listing, Part
from tuner.readers.options import Options
from tuner.readers.refusal import EVEN, Change, Refusal
from tuner.readers.unit_evidence import GRAVITY_TOLERANCE, sizes_of
from tuner.types.records import DataError, Record

Block = NDArray[Any]

TRIED_ROWS = 1 << 16
"""Rows at the beginning of a log on which a reading is tried: its sizes are then known to 1 %."""
FEW_ROWS = 1 << 10
"""Rows from which samples are taken for sums or of another size: of sums the first ones have the finest digits."""
MAX_JOINED = 3
"""Changes that make one reading at most: clock, accelerometers and gyroscopes."""
MAX_NAMED = 5
"""Readings named at most."""


@dataclass(frozen=True)
class Other:
    """Samples that are not what they are called: what they may be, how rates are made of them, and their units."""

    words: str
    made: Callable[[str, Block], Block]
    changes: tuple[Change, ...] = (Change(),)


OTHERS = (
    Other(
        "gyro may hold sums, the angle turned since the start: its differences, divided by the interval, are rates of "
        "a unit at rest",
        lambda name, y: np.diff(y, axis=0, prepend=y[:1]) if name == "gyro" else y,
        tuple(Change({"gyro": unit}, requested="sums") for unit in ("rad", "deg", "arcsec")),
    ),
    Other("the samples may be half of what was measured: twice as large they fit", lambda _, y: 2.0 * y),
    Other("the samples may be twice what was measured: half as large they fit", lambda _, y: 0.5 * y),
)


def advised(refusal: Refusal, listing: Listing, options: Options) -> str:
    """Return the line of a refusal with the readings that are left, or what the samples may be instead."""
    part = _beginning(listing)

    def attempt(change: Change) -> None:
        _try(part, with_change(options, change))

    if left := _left(refusal, attempt, Change()):
        named = [str(change) for change in left[:MAX_NAMED]]
        more = f" ({len(left) - MAX_NAMED} more readings fit)" if len(left) > MAX_NAMED else ""
        return f"{refusal}: pass {', or '.join(named)}{more}"
    if not refusal.changes:
        return str(refusal)
    return f"{refusal}; {_other_samples(part, options) or 'no reading fits all that the samples show'}"


def with_change(options: Options, change: Change) -> Options:
    """Return options with a change, to be judged without regard to who states a unit."""
    return replace(
        options,
        unit={**options.unit, **change.unit},
        scale={**options.scale, **change.scale},
        columns={**(options.columns or {}), **change.columns} or None,
        tried=True,
        requested=change.requested,
    )


def _left(refusal: Refusal, attempt: Callable[[Change], None], base: Change, joined: int = 1) -> list[Change]:
    """Return the readings that pass every judgement, in the order of the changes."""
    left: list[Change] = []
    for change in refusal.changes:
        if change.clashes(base):
            continue
        whole = base.with_(change)
        if change.requested == "rate" and base == Change():
            left.append(whole)
            continue
        try:
            attempt(whole.with_(EVEN) if change.requested == "rate" else whole)
            left.append(whole)
        except Refusal as further:
            if joined < MAX_JOINED:
                left += _left(further, attempt, whole, joined + 1)
        except DataError:
            continue
    return left


def _other_samples(part: Listing, options: Options) -> str:
    """Return what samples may be that fit in no unit, "" where that shows nothing, either."""
    for other in OTHERS:
        for change in other.changes:
            try:
                records = _try(part, with_change(options, change), other.made)
            except DataError:
                continue
            # A size that is advised must fit as a calibrated unit does.
            norms = [sizes_of(one).norm for one in records if one.name == "accel" and len(one.axes) == 3]
            if all(abs(norm / STANDARD_GRAVITY - 1.0) < GRAVITY_TOLERANCE for norm in norms):
                return other.words
    return ""


def _try(
    listing: Listing, options: Options, made: Callable[[str, Block], Block] | None = None
) -> tuple[Record, ...]:
    """Return the beginning of a log as read; `made` changes the samples of each sensor before they are judged."""
    plan = plan_of(listing, options)

    def load(groups: Sequence[Sequence[Part]]) -> tuple[Block, ...]:
        names = [sensor.name for sensor in plan.layout.sensors]
        blocks = listing.load(groups)
        assert made is not None
        samples = (made(n, b[:FEW_ROWS].astype(float)) for n, b in zip(names, blocks, strict=False))
        return (*samples, *(block[:FEW_ROWS] for block in blocks[len(names) :]))

    changed = listing if made is None else replace(listing, load=load)
    return checked(changed, plan, even(changed, plan, "", options), options)


def _beginning(listing: Listing) -> Listing:
    """Return the first rows of a log, read once for each choice of columns."""
    read: dict[tuple[tuple[Part, ...], ...], tuple[Block, ...]] = {}

    def load(groups: Sequence[Sequence[Part]]) -> tuple[Block, ...]:
        key = tuple(tuple(group) for group in groups)
        if key not in read:
            blocks = (
                listing.load(groups)
                if listing.stream is None
                else next(listing.stream(groups, TRIED_ROWS), ())
            )
            read[key] = tuple(block[:TRIED_ROWS] for block in blocks)
        return tuple(block.copy(order="F") for block in read[key])

    return replace(listing, load=load, stream=None)
