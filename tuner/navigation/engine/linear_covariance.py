"""Linear covariance by source: which noise an error of the filter comes from.

The gains K are those of the filter's own P. Each source, alone, then goes through the same Φ and the same
gains::

    P_g ← Φ P_g Φᵀ + Q_g              P_g ← (I − KH) P_g (I − KH)ᵀ + K R_g Kᵀ              Σ P_g = P

A source that the filter does not know, as a bias of another time constant, has states of its own at the end
of x: with neither prior nor process noise in P, they get no gain, and what they do to the filter's errors is exact.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray, IntArray
from tuner.navigation.engine.filter_steps import SensorInput, run_filters
from tuner.navigation.engine.fixes import AFTER, AVAILABLE, SLOT, WITHHELD, FixBatch, new_output
from tuner.navigation.engine.layout import BATCH_SIZE, Layout
from tuner.navigation.engine.state import DRIVING_DENSITY, RATE, WHITE_ROW, new_state


class Nominal(NamedTuple):
    """A noise-free run and its fixes; k of them, e kept."""

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
    process_noise: FloatArray,
    fix_sd: FloatArray,
    nominal: Nominal,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Propagate the covariance of every source along a noise-free run.

    Source 0 is all of them: the filter's own P, from which the gains come.

    Parameters
    ----------
    lay : Layout
        The filter; its sensors are ideal along the nominal run.
    initial, rate, white, process_noise, fix_sd : ndarray, shapes (g, n), (g, n), (g, 6), (g, n), (g, 6)
        Variances at the start, inverse time constants, 1/s, squared densities and sds of fixes of every source.
    nominal : Nominal
        The noise-free run and its fixes.

    Returns
    -------
    covariance : ndarray, shape (e, g, 15, 15)
        Of navigation errors and total biases after the fixes that are kept.
    innovation : ndarray, shape (e, g, 6, 6)
        Covariances of their innovations.
    aided : ndarray, shape (n, n)
        The filter's own P after the last fix that was used.
    """
    n, e, g = lay.size, int(nominal.slot.max()) + 1, len(initial)
    out, out_s, aided = np.zeros((e, g, 15, 15)), np.zeros((e, g, 6, 6)), np.zeros((n, n))
    values = np.repeat(nominal.fixes[None], BATCH_SIZE, axis=0)
    flags = np.zeros((len(nominal.after), 5), dtype=np.int64)
    flags[:, AFTER], flags[:, AVAILABLE] = nominal.after, nominal.available
    flags[:, WITHHELD], flags[:, SLOT] = nominal.withheld, nominal.slot
    sensed = SensorInput(nominal.dt, nominal.increments, False, np.zeros((1, 6, BATCH_SIZE)), len(nominal.dt))
    # So many at a time, the filter itself first among them.
    for begin in range(1, max(g, 2), BATCH_SIZE - 1):
        among = [0, *range(begin, min(begin + BATCH_SIZE - 1, g))]
        w = len(among)
        m = new_state(lay, BATCH_SIZE)
        m.rows[:10] = nominal.state[:, None]
        m.P[range(n), range(n), :w] = initial[among].T
        m.states[RATE, :n, :w], m.states[DRIVING_DENSITY, :n, :w] = rate[among].T, process_noise[among].T
        m.rows[WHITE_ROW : WHITE_ROW + 6, :w] = white[among].T
        sds = np.repeat(fix_sd[among + [0] * (BATCH_SIZE - w), None], len(flags), axis=1)
        fixes = FixBatch(nominal.t, values, sds, flags)
        output = new_output(BATCH_SIZE, e, lay)
        run_filters(lay, m, sensed, fixes, output, shared=True)
        out[:, among] = output.P[:w, :, :15, :15].swapaxes(0, 1)
        out_s[:, among] = output.S[:w].swapaxes(0, 1)
        aided = output.aided
    return out, out_s, aided
