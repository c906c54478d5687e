"""Slower source: one of a lower rate, of which each reading stands in the log until the next one comes.

Where the two rates are as small whole numbers, readings change at the same rows of every P. By chance m changes would
fall into the same q of P rows with the probability ::

    C(P, q) (q/P)^m

the choice of the rows paid for, and that of P. That says which rows are new, whatever the noise and its quantizer; a
reading that equals the one before by chance is new, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln

from models.arrays import BoolArray, FloatArray
from tuner.types.records import Record

MAX_SMALL_PERIOD = 16
"""Longest period with several new rows, samples: ratios of rates such as 5 : 2 and 16 : 5."""
FIRST_CHANGES = 4096
"""Changes that show that most logs have no pattern."""
MAX_P_VALUE = 1e-12
"""Chance of a pattern that counts; a minute of readings has less."""


@dataclass(frozen=True)
class SlowerSource:
    """Rows of a log that repeat the reading before, at a period.

    Attributes
    ----------
    period, number : int
        Rows after which the pattern comes again, and new readings among them.
    p_value : float
        Chance of such a pattern, more than 0.
    copies : ndarray of bool, shape (n,)
        Rows without a new reading.
    """

    period: int
    number: int
    p_value: float
    copies: BoolArray


def find_slower_source(record: Record) -> SlowerSource | None:
    """Return the pattern in which rows of a record, all axes of it, have new readings; None where there is none."""
    steps = np.rint(np.diff(record.t, prepend=record.t[0]) / record.interval)
    place = np.cumsum(steps).astype(np.int64)
    moved = np.concatenate(([True], np.any(np.diff(record.y, axis=0) != 0.0, axis=1)))
    inside = np.zeros(len(record), dtype=bool)
    for start, stop in record.segments:
        inside[start + 1 : stop] = True
    changes = place[moved & inside]
    if len(changes) < 2 or 2 * len(changes) > 1.9 * np.count_nonzero(inside):
        return None
    usual = int(np.bincount(np.diff(changes)).argmax())
    best: tuple[float, int, BoolArray] | None = None
    for period in sorted({*range(2, MAX_SMALL_PERIOD + 1), max(usual, 2)}):
        if np.bincount(changes[:FIRST_CHANGES] % period, minlength=period).all():
            continue
        new = np.bincount(changes % period, minlength=period) > 0
        number = int(np.count_nonzero(new))
        log_choices = float(gammaln(period + 1.0) - gammaln(number + 1.0) - gammaln(period - number + 1.0))
        chance = log_choices + len(changes) * float(np.log(number / period))
        if best is None or chance < best[0]:
            best = chance, period, new
    if best is None:
        return None
    chance, period, new = best
    p_value = float(np.exp(np.clip(chance + np.log(MAX_SMALL_PERIOD), -690.0, 0.0)))
    if p_value > MAX_P_VALUE:
        return None
    return SlowerSource(period, int(np.count_nonzero(new)), p_value, inside & ~new[place % period])


def new_readings(
    record: Record, axis: str, pieces: Sequence[FloatArray], copies: BoolArray | None
) -> tuple[FloatArray, ...]:
    """Return samples of an axis without repetitions, by their rows, or else all that equal the one before."""
    if copies is None:
        return tuple(piece[np.diff(piece, prepend=np.nan) != 0.0] for piece in pieces)
    y = record.column(axis)
    return tuple(y[start:stop][~copies[start:stop]] for start, stop in record.segments)
