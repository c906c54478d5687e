"""Errors of an estimate whose clock and body may differ from those of its truth, and whether only these differ."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tuner.consistency.output_errors import OutputErrors, output_errors
from tuner.consistency.output_scores import error_scores
from tuner.consistency.time_alignment import MAX_TIME_OFFSET, clock_offset, find_time_offset
from tuner.consistency.trajectory_alignment import Alignment, curves_of, half_way_variances
from tuner.types.consistency import Consistency
from tuner.types.filter_output import FilterOutput
from tuner.types.output_score import OutputCause, TimeOffset

MIN_COARSE_OFFSET = 0.1
"""Offset, s, from which stamps are shifted before the errors are taken: a smaller one acts linearly on them."""
INTERVAL_SDS = 1.96
"""Half width of an interval of 95 %, sds."""
SURE_INTERVALS = 1.5
"""Half widths of its interval that an offset of the clocks is from zero, where it is reported: three sds."""
MATTERING_SHARE = 0.1
"""Shift of the errors of a state by an offset of the clocks ÷ their sds, from which it is reported."""
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
    half_way = {key: half_way_variances(truth) for key, truth in different.items()}
    curves = {key: curves_of(truth) for key, truth in different.items()}

    def errors(shifts: Sequence[float | None]) -> list[OutputErrors]:
        return [
            output_errors(
                output,
                truth,
                how=how,
                time_offset=shift,
                one_body=not align_body,
                half_way=half_way[id(truth)],
                curves=curves[id(truth)],
            )
            for (output, truth), shift in zip(pairs, shifts, strict=True)
        ]

    as_stamped, none = errors([None] * len(pairs)), [0.0] * len(pairs)
    coarse = [find_time_offset(output, truth) or 0.0 for output, truth in pairs]
    far = any(abs(value) >= MIN_COARSE_OFFSET for value in coarse)
    first = clock_offset(errors(coarse), coarse) if far else clock_offset(as_stamped, none)
    if first is None or not _within_search(first):  # hardly a motion
        return None, as_stamped
    offset = first
    for _ in range(MAX_OFFSET_ROUNDS):  # errors are not linear in it
        shifts = [offset.value] * len(pairs)
        before, found = offset, clock_offset(errors(shifts), shifts)
        if found is None or not _within_search(found):
            break
        offset = found
        if abs(offset.value - before.value) < 0.1 * (offset.interval[1] - offset.interval[0]):
            break
    if not align_time:
        return offset, as_stamped
    return replace(offset, removed=True), errors([offset.value] * len(pairs))


def _within_search(offset: TimeOffset) -> bool:
    """Tell whether an offset is known well enough to be applied: it and its interval are in the range of the search."""
    return max(map(abs, offset.interval)) <= MAX_TIME_OFFSET


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


def differences_of_frames(
    outputs: Sequence[FilterOutput],
    truths: Sequence[FilterOutput],
    how: Alignment,
    runs: Sequence[OutputErrors],
    offset: TimeOffset | None,
    found: Consistency,
) -> tuple[OutputCause, ...]:
    """Return an offset of the clocks or a rotation between the bodies where the filter is right without them."""
    late = offset is not None and not offset.removed and matters(offset, runs)
    turned = all(run.body is None and np.isfinite(run.error[:, 6:9]).any() for run in runs)
    for time, body in ((True, False), (False, True), (True, True)):
        if (time and not late) or (body and not turned):
            continue
        shift, without = errors_in_one_frame(
            outputs, truths, how, time or (offset is not None and offset.removed), body
        )
        nees, blocks = error_scores(without)
        scores = [*blocks] if nees is None else [nees, *blocks]
        if not scores or not all(s.consistent for s in scores):
            continue
        named = {s.name: s for s in scores}
        gain = max(
            0.5 * s.effective * (s.mean / s.dof - 1.0 - math.log(s.mean / s.dof))
            for s in found.scores
            if s.name in named or s.name == "nees"
        )
        causes = []
        if time and shift is not None:
            value = shift.value
            causes.append(
                OutputCause(
                    "time_offset",
                    value,
                    shift.interval,
                    "s",
                    gain,
                    {},
                    "stamps of the output or of the truth",
                )
            )
        if body and without[0].body is not None:
            vector, wide = without[0].body.vector, INTERVAL_SDS * without[0].body.sd
            length = float(np.linalg.norm(vector))
            spread = float(np.linalg.norm(wide * vector) / length)
            parts = {
                name: (float(v), float(v - w), float(v + w))
                for name, v, w in zip(("roll", "pitch", "yaw"), vector, wide, strict=True)
            }
            causes.append(
                OutputCause("mounting", length, (length - spread, length + spread), "rad", gain, parts)
            )
        return tuple(causes)
    return ()
