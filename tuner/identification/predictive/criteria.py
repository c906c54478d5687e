"""When a block predicts what was measured: its Allan deviation, and the errors of its own forecasts.

*Curve*: predicted ÷ measured Allan deviation within 0.8 … 1.25, widened by two sds of chance, at 95 % of the cluster
times and within 0.7 … 1.4 at all, up to a thirtieth of the record. White noise passes in 99 % of records of a minute to
an hour (without the widening 96 to 99 %, an axis in fifty); at the longest cluster time 0.7 is 2.6 sd away.

*Forecasts*: true ÷ predicted rms error of the integral of the samples, some seconds ahead, of a Kalman filter that
has the block. With n windows in the record the ratio has a relative sd of 1/√(2n), which widens 0.8 … 1.25.
"""

from __future__ import annotations

import numpy as np

from models.arrays import FloatArray
from tuner.types.prediction import INNER_LIMIT, CurveComparison, ForecastComparison, MeasuredAllan


def follows_curve(
    measured: MeasuredAllan, predicted: FloatArray, *, shortest: float = 0.0
) -> CurveComparison:
    """Compare a predicted Allan variance, shape (q,), with the measured one from a shortest cluster time, s, on."""
    judged = measured.judged & (measured.tau >= shortest)
    if not judged.any():
        judged = measured.judged
    ratio = np.sqrt(predicted[judged] / measured.variance[judged])
    return CurveComparison(measured.tau[judged], ratio, 1.0 / np.sqrt(2.0 * measured.dof["white"][judged]))


def forecast_comparison(horizon: float, ratio: float, length: float) -> ForecastComparison:
    """Return a ratio with its bounds for a record of some length, s, of which a tenth is not judged."""
    scatter = 1.0 / np.sqrt(2.0 * 0.9 * length / horizon)
    widened = 1.0 + 2.0 * scatter
    return ForecastComparison(
        horizon, ratio, float(1.0 / (INNER_LIMIT * widened)), float(INNER_LIMIT * widened)
    )
