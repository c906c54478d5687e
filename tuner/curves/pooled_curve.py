"""One curve of a record: gap-free segments pooled, degrees of freedom added, τ as given or log-spaced.

A segment of n samples contributes its variance with the number of its terms as weight; no term reaches across
a gap.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray, IntArray
from models.noise import NoiseModel
from tuner.curves import allan, theo
from tuner.curves.edf import dof
from tuner.curves.series import noise_types, nsec
from tuner.curves.total import total
from tuner.types import AllanCurve
from tuner.types.records import DataError, Record

Noise = str | Sequence[str] | NoiseModel

DEFAULT_POINTS = 60
"""Cluster times of a curve by default: about ten per decade on six decades."""

THEO_H_SWITCH = 0.1
"""Part of the record at which ThêoH changes from the Allan variance to ThêoBR."""


@dataclass(frozen=True)
class Estimator:
    """Properties of a statistic that pooling of segments needs.

    Attributes
    ----------
    variance : callable
        ``variance(y, m)``.
    terms : callable
        ``terms(n, m)``: how many terms n samples give; none where m is too large.
    useful : float
        The largest m used by default is n / useful, where a few degrees of freedom are left.
    least : int
        Smallest m.
    factor : float
        τ / (m τ0).
    samples : int
        Fewest samples of a segment.
    """

    variance: Callable[[FloatArray, IntArray], FloatArray]
    terms: Callable[[int, IntArray], IntArray]
    useful: float
    least: int = 1
    factor: float = 1.0
    samples: int = 3

    def count(self, n: int, m: IntArray) -> IntArray:
        """Return the terms of a segment of n samples, 0 where it gives none."""
        return np.maximum(self.terms(n, m), 0) if n >= self.samples else np.zeros_like(m)


ESTIMATORS: dict[str, Estimator] = {
    "adev": Estimator(allan.allan, lambda n, m: n // m - 1, 3),
    "oadev": Estimator(allan.overlapping_allan, lambda n, m: n + 1 - 2 * m, 3),
    "twogroup": Estimator(allan.two_group_allan, lambda n, m: (n - m // 2) // m - 1, 3),
    "mdev": Estimator(allan.modified_allan, lambda n, m: n + 2 - 3 * m, 4),
    "hdev": Estimator(allan.hadamard, lambda n, m: n // m - 2, 4),
    "ohdev": Estimator(allan.overlapping_hadamard, lambda n, m: n + 1 - 3 * m, 4),
    "totdev": Estimator(total, lambda n, m: np.where(m < n, n - 1, 0), 2),
    "theo1": Estimator(theo.theo1, lambda n, m: n + 1 - m, 1, theo.MIN_SIZE, 0.75, theo.MIN_SIZE),
    "theobr": Estimator(theo.theo_br, lambda n, m: n + 1 - m, 1, theo.MIN_SIZE, 0.75, theo.MIN_SAMPLES),
    "nsec": Estimator(nsec, lambda n, m: n // m - 1, 3),
}


def curve(
    record: Record,
    estimator: str,
    *,
    tau: Sequence[float] | None = None,
    noise: Noise | None = None,
    switch: float = THEO_H_SWITCH,
) -> AllanCurve:
    """Return one empirical curve of a record, raw: nothing is detrended, rejected or corrected for bias.

    Parameters
    ----------
    record : Record
        Samples.
    estimator : str
        ``adev oadev twogroup mdev hdev ohdev totdev theo1 theobr theoh nsec``.
    tau : sequence of float, optional
        Cluster times in s, one result for each, at the nearest the samples allow; by default about 60,
        log-spaced (``adev``: 2^k samples).
    noise : str, sequence of str (one a cluster time) or NoiseModel, optional
        Noise behind the degrees of freedom; by default identified from each axis at each τ.
    switch : float
        Switch point of ``theoh``, as a part of the longest segment.

    Returns
    -------
    AllanCurve

    Raises
    ------
    DataError
        If a cluster time is out of range or the record too short.
    """
    longest = max(stop - start for start, stop in record.segments)
    if estimator == "theoh":
        return _hybrid(record, longest, tau=tau, noise=noise, switch=switch)
    if estimator not in ESTIMATORS:
        raise ValueError(f"'estimator' must be one of {', '.join([*ESTIMATORS, 'theoh'])}, got {estimator!r}")
    statistic = ESTIMATORS[estimator]
    if tau is None:
        m = default_sizes(estimator, longest)
    else:
        m = _given_clusters(estimator, longest, np.atleast_1d(np.asarray(tau, dtype=float)), record.interval)
    weight = np.zeros(m.size)
    variance = np.zeros((m.size, len(record.axes)))
    freedom = np.zeros((m.size, len(record.axes)))
    types = [
        noise_types(max(record.pieces(axis), key=len), statistic.factor * m) if noise is None else noise
        for axis in record.axes
    ]
    for start, stop in record.segments:
        terms = statistic.count(stop - start, m)
        fits = np.flatnonzero(terms)
        if not fits.size:
            continue
        weight[fits] += terms[fits]
        variance[fits] += terms[fits, None] * statistic.variance(record.y[start:stop], m[fits])
        for j, kind in enumerate(types):
            each = kind if isinstance(kind, (str, NoiseModel)) else [kind[i] for i in fits.tolist()]
            freedom[fits, j] += dof(estimator, stop - start, m[fits], each, interval=record.interval)
    return AllanCurve(
        estimator,
        statistic.factor * m.astype(float) * record.interval,
        variance / weight[:, None],
        freedom,
        record.unit,
        record.axes,
        _notes(estimator, longest, m),
    )


def default_sizes(estimator: str, n: int) -> IntArray:
    """Return the default cluster sizes for n samples: 2^k for ``adev``, about 60 log-spaced for the others.

    Raises
    ------
    DataError
        If the record is too short for any.
    """
    statistic = ESTIMATORS[estimator]
    most = max(int(n / statistic.useful), statistic.least)
    if not statistic.count(n, np.array([statistic.least]))[0]:
        raise DataError(f"{estimator} of {n} samples without a gap: expected a longer record")
    if estimator == "adev":
        m = 2 ** np.arange(int(np.log2(most)) + 1)
    else:
        m = np.rint(np.geomspace(statistic.least, most, DEFAULT_POINTS)).astype(np.int64)
        m = m if statistic.factor == 1.0 else theo.nearest_theo1_size(n, m)
    m = np.unique(m)
    return m[statistic.count(n, m) > 0]


def _given_clusters(estimator: str, n: int, tau: FloatArray, interval: float) -> IntArray:
    """Return the sizes nearest to cluster times in s, or say which one is out of range."""
    statistic = ESTIMATORS[estimator]
    wanted = tau / (statistic.factor * interval)
    possible = (wanted >= statistic.least - 0.5) & (wanted <= n + 0.5)
    wanted = np.where(possible, wanted, statistic.least)
    m = np.rint(wanted).astype(np.int64) if statistic.factor == 1.0 else theo.nearest_theo1_size(n, wanted)
    wrong = tau[~possible | (statistic.count(n, m) == 0)]
    if wrong.size:
        every = np.arange(statistic.least, n + 1)
        feasible = every[statistic.count(n, every) > 0] * statistic.factor * interval
        bounds = f"{feasible[0]:g} to {feasible[-1]:g} s" if feasible.size else "a longer record"
        raise DataError(f"{estimator} at tau {wrong[0]:g} s: expected {bounds}")
    return m


def _hybrid(
    record: Record, longest: int, *, tau: Sequence[float] | None, noise: Noise | None, switch: float
) -> AllanCurve:
    """Return ThêoH: ``oadev`` at τ below the switch point, ``theobr`` from there on."""
    point = switch * longest * record.interval
    if tau is None:
        times = record.interval * np.geomspace(1.0, 0.75 * longest, DEFAULT_POINTS)
        short = np.unique(np.rint(times[times < point] / record.interval)) * record.interval
        long = theo.nearest_theo1_size(longest, times[times >= point] / (0.75 * record.interval))
        times = np.concatenate([short, 0.75 * record.interval * np.unique(long)])
    else:
        times = np.asarray(tau, dtype=float)
    below = times < point
    parts = []
    for name, chosen in (("oadev", np.flatnonzero(below)), ("theobr", np.flatnonzero(~below))):
        if chosen.size:
            each = noise
            if isinstance(noise, Sequence) and not isinstance(noise, str):
                each = [noise[i] for i in chosen.tolist()]
            parts.append((chosen, curve(record, name, tau=times[chosen].tolist(), noise=each)))
    order = np.argsort(np.concatenate([chosen for chosen, _ in parts]))
    return AllanCurve(
        "theoh",
        np.concatenate([part.tau for _, part in parts])[order],
        np.concatenate([part.variance for _, part in parts])[order],
        np.concatenate([part.dof for _, part in parts])[order],
        record.unit,
        record.axes,
        tuple(note for _, part in parts for note in part.notes),
    )


def _notes(estimator: str, n: int, m: IntArray) -> tuple[str, ...]:
    if estimator not in ("theo1", "theobr") or n <= theo.MAX_EXACT_SAMPLES:
        return ()
    notes = []
    strides = theo.stride(n, m)
    if strides.max() > 1:
        notes.append(f"Thêo1 from averages of up to {strides.max()} samples")
    if estimator == "theobr":
        notes.append(f"bias ratio of ThêoBR from averages of {theo.averaged(n)} samples")
    return tuple(notes)
