"""Rows and sds of an output that are none: rows that repeat the one before, and sds of zero."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tuner.formats.customary_units import percent
from tuner.segments.stand_stills import runs
from tuner.types.filter_output import BLOCKS, FilterOutput

MOST_REPEATS = 3
"""Rows that repeat one before by themselves: a logger that is faster than its filter writes no more."""


def without_repeats(output: FilterOutput) -> FilterOutput:
    """Return an output without rows that state what the one before does, digit for digit, with a note of how many.

    A filter that runs changes its last digits. Where many rows on end repeat, it hangs or rests, and all stay.
    """
    place = output.llh if output.llh is not None else output.local
    stated = [
        one for one in (place, output.vel_n, output.quat_nb) if one is not None and np.isfinite(one).any()
    ]
    if not stated or len(output) < 2:
        return output
    table = np.concatenate(stated, axis=1)
    same = (table[1:] == table[:-1]) | (np.isnan(table[1:]) & np.isnan(table[:-1]))
    again = np.concatenate([[False], same.all(axis=1) & np.isfinite(table[1:]).any(axis=1)])
    repeats = runs(again, [(0, len(again))])
    if (
        not repeats or max(end - begin for begin, end in repeats) > MOST_REPEATS
    ):  # at rest, or a filter that hangs
        return output
    note = f"{percent(float(again.mean()))} of its rows repeat the one before: they are left out"
    return replace(output.rows(~again), notes=(*output.notes, f"{output.name}: {note}"))


def with_stated_sds(output: FilterOutput) -> FilterOutput:
    """Return an output whose sds of zero are not stated, with a note of which: no filter is certain."""
    variance = np.einsum("kii->ki", output.covariance)
    known = np.isfinite(variance)
    zero = known.any(axis=0) & ~(known & (variance != 0.0)).any(axis=0)
    if not zero.any():
        return output
    covariance = output.covariance.copy()
    covariance[:, zero] = np.nan
    covariance[:, :, zero] = np.nan
    said = []
    for i, block in enumerate(BLOCKS):
        own, axes = zero[3 * i : 3 * i + 3], ("north", "east", "down") if i < 3 else ("x", "y", "z")
        where = (
            "" if own.all() else " " + " and ".join(axis for axis, one in zip(axes, own, strict=True) if one)
        )
        said += [f"{block.replace('_', ' ')}{where}"] if own.any() else []
    note = (
        f"{output.name}: sds of {' and '.join(said)} are zero in all rows: taken as not stated; "
        "write what the filter predicts"
    )
    return replace(output, covariance=covariance, notes=(*output.notes, note))
