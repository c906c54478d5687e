"""Linear covariance by source: which noise an error of the filter comes from.

The gains K are those of the filter's own P. Each source, alone, then goes through the same Φ and the same
gains::

    P_g ← Φ P_g Φᵀ + Q_g              P_g ← (I − KH) P_g (I − KH)ᵀ + K R_g Kᵀ              Σ P_g = P

A source that the filter does not know, as a bias of another time constant, has states of its own at the end
of x: with neither prior nor drive in P, they get no gain, and what they do to the filter's errors is exact.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tuner.navigation.engine.run import Flight, Given, fly, kept
from tuner.navigation.engine.simd import WIDTH
from tuner.navigation.engine.types import Layout, own_of, sensed_states, total_rows
from tuner.navigation.engine.workspace import memory

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class Nominal(NamedTuple):
    """A noise-free flight and its fixes; k of them, e kept."""

    state: FloatArray  # (10,), true start
    dt: FloatArray  # (m,), s
    increments: FloatArray  # (m, 6), perfect
    after: IntArray  # (k,), steps done
    t: FloatArray  # (k,), s
    fixes: FloatArray  # (k, 6), perfect
    available: IntArray  # (k,), 1 position only, 2 with velocity
    withheld: NDArray[np.bool_]  # (k,)
    slot: IntArray  # (k,), row that keeps a fix, −1 for none


def trace_sources(
    lay: Layout,
    initial: FloatArray,
    rate: FloatArray,
    white: FloatArray,
    drive: FloatArray,
    fix_sd: FloatArray,
    nominal: Nominal,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Carry the covariance of every source along a noise-free flight.

    Source 0 is all of them: the filter's own P, from which the gains come.

    Parameters
    ----------
    lay : Layout
        The filter; sensors ideal along the nominal flight.
    initial, rate, white, drive, fix_sd : ndarray, shapes (g, n), (g, n), (g, 6), (g, n), (g, 6)
        Variances at the start, inverse time constants, 1/s, squared densities and sds of fixes of every source.
    nominal : Nominal
        The flight.

    Returns
    -------
    covariance : ndarray, shape (e, g, 15, 15)
        Of navigation errors and total biases after the fixes that are kept.
    innovation : ndarray, shape (e, g, 6, 6)
        Covariances of their innovations.
    aided : ndarray, shape (n, n)
        The filter's own P after the last fix that was used.
    """
    feed, first = sensed_states(lay.row)
    lay = lay._replace(feed=feed, first=first, total=total_rows(lay.row, lay.source))
    n, e, g = lay.size, int(nominal.slot.max()) + 1, len(initial)
    out, out_s, aided = np.zeros((e, g, 15, 15)), np.zeros((e, g, 6, 6)), np.zeros((n, n))
    shown = np.repeat(nominal.fixes[None], WIDTH, axis=0)
    trusted = np.zeros(len(nominal.after), dtype=bool)
    flight = Flight(nominal.dt, nominal.increments, False, len(nominal.dt), float(rate.max()))
    # Eight at a time, the filter itself among each.
    for begin in range(1, max(g, 2), WIDTH - 1):
        among = [0, *range(begin, min(begin + WIDTH - 1, g))]
        w = len(among)
        m = memory(lay, WIDTH)
        m.state[:] = nominal.state[:, None]
        m.P[range(n), range(n), :w] = initial[among].T
        m.rate[:, :w], m.white[:, :w], m.drive[:, :w] = rate[among].T, white[among].T, drive[among].T
        sds = np.repeat(fix_sd[among, None], len(trusted), axis=1)
        fixes = Given(
            nominal.after,
            nominal.t,
            shown,
            sds,
            nominal.available,
            nominal.withheld,
            trusted,
            nominal.slot,
            True,
        )
        room = kept(w, e, n)
        room.S[:] = 0.0
        fly(lay, m, own_of(n), flight, fixes, room)
        out[:, among], out_s[:, among] = room.P.swapaxes(0, 1), room.S.swapaxes(0, 1)
        aided = room.aided[..., 0]
    return out, out_s, aided
