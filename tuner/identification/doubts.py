"""What a user must doubt of a fit: clusters that no sum of terms describes, a curve that contradicts the sum."""

from __future__ import annotations

from dataclasses import replace

from models.noise import NoiseModel
from tuner.identification.band import TOLERANCE, Band, curve_within
from tuner.identification.leastsquares import misfit
from tuner.identification.octaves import OctaveCurve

DISAGREES = 1e-3
"""Probability below which the Allan curve and the fitted sum are said to disagree."""


def about_band(band: Band, interval: float) -> tuple[str, ...]:
    """Say what part of the record the terms do not describe."""
    if band.m == 1:
        return ()
    part, side = 100.0 * abs(band.ratio - 1.0), "above" if band.ratio > 1.0 else "below"
    return (
        f"clusters shorter than {band.m * interval:.3g} s follow no sum of noise terms (samples {part:.2g} % "
        f"{side} it: a filter in the sensor, vibration or a line): the terms are fitted to longer ones, "
        f"f ≤ {band.highest:.3g} Hz",
    )


def disagreement(whole: OctaveCurve, band: Band, model: NoiseModel) -> tuple[str, ...]:
    """Say where the Allan curve contradicts the fitted sum; in a cut band, where little above it reaches."""
    if not model.terms:
        return ()
    judged = whole if band.m == 1 else curve_within(whole, replace(band, m=4 * band.m))
    found = misfit(judged, model, tolerance=TOLERANCE)
    if found.p_value >= DISAGREES:
        return ()
    part, side = 100.0 * abs(found.ratio - 1.0), "above" if found.ratio > 1.0 else "below"
    return (
        f"the Allan curve disagrees with the sum of terms (χ² = {found.statistic:.3g} on {found.freedom}, "
        f"p = {found.p_value:.1g}), most at τ = {found.tau:.3g} s, where it is {part:.2g} % {side}: "
        "something in the data is not among the terms",
    )
