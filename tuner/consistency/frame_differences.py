"""Errors of an estimate whose clock and body may differ from those of its truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tuner.consistency.output_errors import OutputErrors, output_errors
from tuner.consistency.time_alignment import clock_offset, find_time_offset
from tuner.consistency.trajectory_alignment import Alignment, curves_of, half_way_variances
from tuner.types.filter_output import FilterOutput
from tuner.types.output_score import TimeOffset

MIN_COARSE_OFFSET = 0.1
"""Offset, s, from which stamps are shifted before the errors are taken: a smaller one acts linearly on them."""
SURE_INTERVALS = 1.5
"""Half widths of its interval that an offset of the clocks is from zero, where it is reported: three sds."""
MATTERING_SHARE = 0.1
"""Shift of the errors of a state by an offset of the clocks ÷ their sds, from which it is reported."""
MAX_INTERVAL = 3.0
"""Largest half width of the interval of an offset that is applied, s: vehicles that hardly move show none."""
MAX_OFFSET_ROUNDS = 4
"""Times that an offset is fitted again about itself."""


def errors_in_one_frame(
    outputs: Sequence[FilterOutput],
    truths: Sequence[FilterOutput],
    how: Alignment,
    align_time: bool,
    align_body: bool,
) -> tuple[TimeOffset | None, list[OutputErrors]]:
    """Return the offset of the clocks and the errors of each run, without the offset where that is wanted."""
    pairs = list(zip(outputs, truths, strict=True))
    different = {id(truth): truth for truth in truths}
    known = {key: (half_way_variances(truth), curves_of(truth)) for key, truth in different.items()}

    def errors(shifts: Sequence[float | None]) -> list[OutputErrors]:
        return [
            output_errors(
                output,
                truth,
                how=how,
                time_offset=shift,
                one_body=not align_body,
                half_way=known[id(truth)][0],
                curves=known[id(truth)][1],
                tried=shift is not None,
            )
            for (output, truth), shift in zip(pairs, shifts, strict=True)
        ]

    as_stamped = errors([None] * len(pairs))
    coarse = [find_time_offset(output, truth) or 0.0 for output, truth in pairs]
    far = any(abs(value) >= MIN_COARSE_OFFSET for value in coarse)
    offset = clock_offset(errors(coarse), coarse) if far else clock_offset(as_stamped, [0.0] * len(pairs))
    if offset is None or not _is_known(offset, outputs):  # hardly a motion
        return None, as_stamped
    for _ in range(MAX_OFFSET_ROUNDS):  # errors are not linear in it
        shifts = [offset.value] * len(pairs)
        before, found = offset, clock_offset(errors(shifts), shifts)
        if found is None or not _is_known(found, outputs):
            break
        offset = found
        if abs(offset.value - before.value) < 0.1 * (offset.interval[1] - offset.interval[0]):
            break
    if not align_time:
        return offset, as_stamped
    return replace(offset, removed=True), errors([offset.value] * len(pairs))


def _is_known(offset: TimeOffset, outputs: Sequence[FilterOutput]) -> bool:
    """Tell whether an offset can be applied: it is known, and leaves half of each record."""
    half = 0.5 * (offset.interval[1] - offset.interval[0])
    return half < MAX_INTERVAL and abs(offset.value) < 0.5 * min(one.t[-1] - one.t[0] for one in outputs)


def matters(offset: TimeOffset, runs: Sequence[OutputErrors]) -> bool:
    """Tell whether an offset is beyond chance, and shifts the errors of a state by a share of their sds."""
    half = 0.5 * (offset.interval[1] - offset.interval[0])
    if abs(offset.value) < SURE_INTERVALS * half:
        return False
    shift, spread = np.zeros(9), np.zeros(9)
    for run in runs:
        variance, late = np.einsum("kii->ki", run.covariance)[:, :9], run.rate[:, :9] * offset.value
        known = np.isfinite(late) & (variance > 0.0)
        shift += np.where(known, late**2, 0.0).sum(axis=0)
        spread += np.where(known, variance, 0.0).sum(axis=0)
    return bool((shift > MATTERING_SHARE**2 * spread).any())
