"""What the Allan variances of all samples add to a record of means: its curve down to single samples, and a judgement.

A long log is identified from means (`tuner.readers.block_means`). Its terms predict the Allan variances
of shorter clusters, which were taken from all samples; where these differ, a filter, a line or quantization is hidden
within the means, and a warning says from which cluster time on.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.noise import NoiseModel
from tuner.curves import dof
from tuner.identification.valid_band import CURVE_TOLERANCE, Band
from tuner.types import AllanCurve
from tuner.types.records import Record

AGREEING_SDS = 5.0
"""Sds of an Allan variance within which it agrees with the terms."""


def down_to_samples(allan: AllanCurve, record: Record, model: NoiseModel) -> AllanCurve:
    """Return the curve of one axis of a record with the points of shorter clusters before it."""
    short = record.short_clusters.get(allan.axes[0])
    if short is None:
        return allan
    first = record.interval / record.samples_a_mean
    m = np.array(short.m)
    freedom = dof("adev", short.differences[0] + 1, m, model, interval=first)
    return replace(
        allan,
        tau=np.concatenate([first * m, allan.tau]),
        variance=np.concatenate([np.array(short.variance)[:, None], allan.variance]),
        dof=np.concatenate([freedom[:, None], allan.dof]),
        notes=(*allan.notes, f"clusters shorter than {record.interval:.4g} s: adjoining, not overlapping"),
    )


def band_of_samples(band: Band, allan: AllanCurve, record: Record, model: NoiseModel) -> Band:
    """Return the band that the terms describe in samples of the log, by a curve `down_to_samples`."""
    short = record.short_clusters.get(allan.axes[0])
    if short is None:
        return band
    number, first = len(short.m), record.interval / record.samples_a_mean
    ratio = allan.variance[:number, 0] / model.allan_variance(allan.tau[:number], interval=first)
    tolerated = 2.0 * CURVE_TOLERANCE + AGREEING_SDS * np.sqrt(2.0 / allan.dof[:number, 0])
    apart = np.flatnonzero(np.abs(ratio - 1.0) > tolerated)
    if band.m == 1 and not len(apart):
        return band
    m = record.samples_a_mean * band.m if band.m > 1 else 2 * short.m[apart[-1]]
    return Band(m, min(band.highest, 0.5 / record.interval), float(np.sqrt(ratio[0])))
