"""Φ, process noise and the effect of unknown constants between fixes, with the mechanisation of the compiled filter.

A second run over the steps: from the state that a filter had after each fix, the engine mechanises to the next one and
linearises every covariance step; `propagation_kernels` accumulates what the steps do to the errors.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from models import array_copies, earth, error_state, strapdown, taylor, vector3
from models.array_copies import copy_matrix, copy_row
from models.arrays import FloatArray, IntArray
from models.filter_states import declaration
from tuner.diagnosis.drive.linear_model import propagation_kernels
from tuner.diagnosis.drive.linear_model.propagation_kernels import (
    AccumulatedErrors,
    Columns,
    accumulate,
    new_errors,
    restart,
    set_step,
)
from tuner.navigation.engine import (
    compilation,
    further_couplings,
    layout,
    mechanisation,
    propagation,
    sensor_inputs,
    state,
    transition,
)
from tuner.navigation.engine.compilation import block, checksum, entry
from tuner.navigation.engine.further_couplings import accelerate_down
from tuner.navigation.engine.layout import Layout
from tuner.navigation.engine.mechanisation import (
    calibrate_sample,
    invert_calibration,
    mechanise,
    set_biases,
    start_step,
    take_sample,
)
from tuner.navigation.engine.propagation import set_decay
from tuner.navigation.engine.record_numbers import NUMBERS_CHECKSUM
from tuner.navigation.engine.state import CALIBRATED_ROW, ESTIMATE, VELOCITY_SUM_ROW
from tuner.navigation.engine.transition import linearise, set_sensitivity


class PropagatedErrors(NamedTuple):
    """What happens to the errors before each of k fixes, with n states and p constants.

    Attributes
    ----------
    phi : ndarray, shape (k, n, n)
        Transition.
    white : ndarray, shape (2, k, 9, 9)
        Process noise from the white noise of gyros and accelerometers.
    slow : ndarray, shape (3, k, n, n)
        From the noise that drives gyro biases, accelerometer biases, receiver states.
    constants : ndarray, shape (k, 9, p)
        B of the navigation states.
    prior : ndarray, shape (k, 10)
        State just before each fix.
    x : ndarray, shape (k, n)
        Other estimates there.
    rates : ndarray, shape (k, 6)
        Mean calibrated rate and force in b of the last covariance step before the fix.
    force : ndarray, shape (k, 2, 3)
        Mean specific force in n of the covariance steps before and after it.
    """

    phi: FloatArray
    white: FloatArray
    slow: FloatArray
    constants: FloatArray
    prior: FloatArray
    x: FloatArray
    rates: FloatArray
    force: FloatArray


@block
def _store(lay: Layout, errors: AccumulatedErrors, out: PropagatedErrors, i: int) -> None:
    """Store what has accumulated until fix i."""
    n, W = lay.size, errors.wide
    noise = 2 * n - 9
    out.phi[i] = 0.0
    out.slow[:, i] = 0.0
    copy_matrix(out.phi[i], W[:, :n])
    copy_matrix(out.constants[i], W[:, noise + 36 :])
    for r in range(9):
        for c in range(9):
            for g in range(2):
                out.white[g, i, r, c] = W[r, noise + 9 * g + c]
                out.slow[g, i, r, c] = W[r, noise + 18 + 9 * g + c]
    for j in range(9, n):
        out.phi[i, j, j] = errors.own[j]
        if lay.slope[j] >= 0:
            out.phi[i, j, lay.slope[j]] = errors.tie[j]
        g = lay.row[j] // 3 if lay.row[j] >= 0 else 2
        out.slow[g, i, j, j] = errors.variance[j]
        for r in range(9):
            out.slow[g, i, r, j] = out.slow[g, i, j, r] = W[r, n - 9 + j]


@block
def _restart(m: Any) -> None:
    """Calibrate the sensors by the present estimates, and begin a covariance step."""
    set_biases(m)
    if m.ideal == 0:
        invert_calibration(m)
    start_step(m)


def _cached(number: int) -> Callable[..., None]:
    """Return `propagate`, kept on disk for as long as no source of it changes."""

    def propagate(
        lay: Layout,
        columns: Columns,
        memory: NDArray[np.void],
        covariance: NDArray[np.void],
        inputs: NDArray[np.void],
        dt: FloatArray,
        increments: FloatArray,
        after: IntArray,
        states: FloatArray,
        estimates: FloatArray,
        out: PropagatedErrors,
    ) -> None:
        """Fill `out` from the start, the steps, and the states after each fix (k, 10), (k, n).

        `memory`, `covariance` and `inputs` are the records of `State`; the first contains the start.
        """
        if number == 0:
            return
        m, p, a = memory[0], covariance[0], inputs[0]
        k, n, N, S = len(after), lay.size, m.rows, m.states
        elapsed, last_dt, i, fresh = 0.0, 0.0, 0, True
        errors, force = new_errors(n, columns), np.zeros(3)
        _restart(m)
        for s in range(len(dt) + 1):
            if s > 0:
                d = dt[s - 1]
                take_sample(m, increments, s - 1, d)
                if not lay.ideal:
                    calibrate_sample(m)
                stretch = 2.0 * d * d / (last_dt + d) / last_dt if last_dt > 0.0 else 0.0
                mechanise(m, d, stretch)
                accelerate_down(m, d)
                last_dt = d
                elapsed += d
            due = i < k and after[i] == s
            if elapsed > 0.0 and (due or (s < len(dt) and elapsed + 0.5 * dt[s] > lay.covariance_step)):
                linearise(m, elapsed)
                set_sensitivity(m, elapsed)
                if elapsed != errors.step[0]:
                    errors.step[0] = elapsed
                    set_decay(m, elapsed)
                for r in range(3):
                    force[r] = N[VELOCITY_SUM_ROW + r, 0] / elapsed
                if fresh and i > 0:
                    copy_row(out.force[i - 1, 1], force)
                fresh = False
                set_step(m, p, a, elapsed, errors)
                accumulate(lay, columns, errors, m, elapsed)
                _restart(m)
                elapsed = 0.0
            while i < k and after[i] == s:
                _store(lay, errors, out, i)
                copy_row(out.prior[i], N[:10, 0])
                copy_row(out.x[i], S[ESTIMATE, :n, 0])
                copy_row(out.rates[i], N[CALIBRATED_ROW : CALIBRATED_ROW + 6, 0])
                for side in range(2):
                    copy_row(out.force[i, side], force)
                restart(errors)
                copy_row(N[:, 0], states[i])
                copy_row(S[ESTIMATE, :, 0], estimates[i])
                _restart(m)
                fresh = True
                i += 1
            if i == k:
                break

    compiled: Callable[..., None] = entry(propagate)
    return compiled


propagate = _cached(
    NUMBERS_CHECKSUM ^ checksum(
        array_copies, vector3, taylor, earth, strapdown, error_state, compilation, declaration, further_couplings,
        layout, state, mechanisation, transition,
        sensor_inputs, propagation, propagation_kernels, sys.modules[__name__],
    )
)  # fmt: skip
