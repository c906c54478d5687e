"""Which noise settings are written for an axis: the likelihood's, those of a fit to the Allan curve, or marked ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from models.arrays import FloatArray
from models.noise.bounded_white_noise import BOUNDED_SHARE, largest_white_density
from tuner.identification.predictive.criteria import follows_curve
from tuner.identification.predictive.curve_fit import fit_curve, raise_random_walk, with_bounded_parts
from tuner.identification.predictive.forecast import compare_forecasts
from tuner.identification.predictive.measured_allan import measured_allan
from tuner.identification.predictive.spectral_excess import octave_bands, spectral_excess
from tuner.types.prediction import (
    FASTEST_STATE,
    BlockSource,
    MeasuredAllan,
    NoiseBlock,
    PredictedBlock,
    SpectralExcess,
)

WHITE_FROM = 10.0
"""Cluster time ÷ time constant from which a fast state that became white noise is judged as such."""


def choose_block(
    pieces: Sequence[FloatArray], interval: float, proposed: NoiseBlock | None
) -> PredictedBlock | None:
    """Return the block to write for one axis; None where the record is too short to judge any.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n_i,)
        Stretches without a gap, at rest.
    interval : float
        Sampling interval, s.
    proposed : NoiseBlock or None
        The likelihood's block without any enlargement.
    """
    measured = measured_allan(pieces, interval)
    if measured is None:
        return None
    found = spectral_excess(pieces, interval)
    excess: tuple[SpectralExcess, ...] = () if found is None else (found,)
    free = fit_curve(measured, excess)
    first: PredictedBlock | None = None
    if proposed is not None:
        kept = with_bounded_parts(proposed, measured, excess, largest_increment_sd=free.increment_sd)
        first = _judged(BlockSource.LIKELIHOOD, kept, measured, pieces)
        if first.passes:
            return first
    white = 0.0 if proposed is None else proposed.white_density
    fitted = _from_curve(BlockSource.CURVE, free, excess, measured, pieces, white)
    bands = octave_bands(interval, float(measured.tau[0]))
    if not fitted.curve.passes and bands:
        both = (*excess, *bands)
        free = fit_curve(measured, both)
        wider = _from_curve(BlockSource.CURVE_WITH_MOTION, free, both, measured, pieces, white)
        if wider.curve.passes:
            fitted = wider
    if first is None:
        return fitted
    return PredictedBlock(
        fitted.source, fitted.block, measured, fitted.curve, fitted.forecasts, first.curve, first.forecasts
    )


def _from_curve(
    source: BlockSource,
    fitted: NoiseBlock,
    excess: Sequence[SpectralExcess],
    measured: MeasuredAllan,
    pieces: Sequence[FloatArray],
    white: float,
) -> PredictedBlock:
    """Return the fitted block with its random walk raised; as it was fitted where only that predicts the record.

    `white` is the white noise of the likelihood, 0 for none. States faster than a filter can follow become white noise.
    Where that predicts the curve at short clusters wrongly, and no block without such states predicts it, it is judged
    from ten of their time constants on.
    """
    fast = [state.time_constant for state in fitted.states if state.time_constant <= FASTEST_STATE]

    def judged(block: NoiseBlock, shortest: float) -> PredictedBlock:
        written = _with_white_noise(block.without_fast_states(), measured, white)
        return _judged(source, written, measured, pieces, shortest=shortest)

    raised, later = raise_random_walk(fitted, measured), WHITE_FROM * max(fast, default=0.0)
    tries = [(raised, 0.0), (fitted, 0.0)]
    if fast:
        slow = fit_curve(measured, excess, slower_than=FASTEST_STATE)
        tries += [(raise_random_walk(slow, measured), 0.0), (slow, 0.0), (raised, later), (fitted, later)]
    results: list[PredictedBlock] = []
    for block, shortest in tries:
        results.append(judged(block, shortest))
        if results[-1].passes:
            return results[-1]
    return results[-2]  # with the random walk raised


def _with_white_noise(block: NoiseBlock, measured: MeasuredAllan, white: float) -> NoiseBlock:
    """Return the block with at least the white noise of the likelihood, or with as much as the Allan curve allows.

    The curve allows the smallest σ(τ)√τ. Half of that is taken where neither shows any white noise. A bias whose course
    is no sum of terms bends a fit to the curve, and the smallest term most.
    """
    largest = largest_white_density(measured.tau, measured.variance)
    known = max(block.white_density, min(white, largest))
    return replace(block, white_density=known if known > 0.0 else BOUNDED_SHARE * largest)


def _judged(
    source: BlockSource,
    block: NoiseBlock,
    measured: MeasuredAllan,
    pieces: Sequence[FloatArray],
    *,
    shortest: float = 0.0,
) -> PredictedBlock:
    predicted = block.allan_variance(measured.tau, measured.interval)
    curve = follows_curve(measured, predicted, shortest=shortest)
    return PredictedBlock(source, block, measured, curve, compare_forecasts(pieces, measured.interval, block))
