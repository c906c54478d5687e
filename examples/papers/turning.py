"""Paper 1, figure 5: a ring laser gyro at a constant rate, and swinging.

The second difference of the angle takes a constant rate away; a swing of period T adds A² sin⁴(πτ/T)/(πτ/T)² to the
Allan variance, lobes between zeros at multiples of T.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.signal import find_peaks

from examples.papers.laser import AXES, LASER_NOISE, SAMPLING_INTERVAL, N, in_degrees_per_hour
from examples.papers.results import Curve, Item, Panel, Picture, exact, judge
from examples.papers.sampling import Settings, record_from, record_of, scaled
from examples.papers.subjects import RING_LASER_PAPER
from models.arrays import FloatArray
from models.units import DEG, DEG_PER_HOUR
from tuner.curves import curve
from tuner.identification import identify_channel
from tuner.segments.stationary import cut_to_still, find_motion
from tuner.types import ChannelIdentification, Coefficient


def rlg_dynamic(settings: Settings) -> Item:
    """Return figure 5: the laser gyro at rest, at a constant rate, and swinging by hand in two intervals."""
    rng = settings.rng("rlg-dynamic")
    n = settings.size(3_600_000, 600_000)
    static = record_of(LASER_NOISE, n, SAMPLING_INTERVAL, rng, axes=AXES)
    constant = replace(static, y=static.y + 10.0 * DEG)
    t = static.t / static.span
    swinging = ((t > 0.3) & (t < 0.4)) | ((t > 0.6) & (t < 0.75))
    swing = np.where(swinging, 20.0 * DEG * np.sin(2.0 * np.pi * 0.1 * static.t), 0.0)
    turning = record_from(
        static.y + swing[:, None] * np.array([1.0, 0.5, -0.7]), SAMPLING_INTERVAL, axes=AXES
    )
    tau = np.geomspace(SAMPLING_INTERVAL, static.span / 5.0, 100).tolist()
    of = {
        name: curve(record, "oadev", tau=tau, noise=LASER_NOISE)
        for name, record in (("static", static), ("constant", constant), ("turning", turning))
    }
    change = float(np.max(np.abs(of["constant"].deviation() / of["static"].deviation() - 1.0)))
    extremes = _extremes(of["turning"].deviation()[:, 0])
    motion = find_motion(turning)
    still = cut_to_still([turning], motion)[0]
    of_still = identify_channel(still, "gyro_x", method="leastsquares")
    of_all = identify_channel(turning, "gyro_x", terms=("quantization", "white"), method="leastsquares")
    found, of_turning = (scaled(_white(c), 1.0 / DEG_PER_HOUR, "(deg/h)√s") for c in (of_still, of_all))
    claims = (
        judge(
            "change of the Allan deviation by a constant rate of 10 deg/s",
            "none",
            exact(change, "1"),
            claimed=(0.0, 1e-6),
            why="the second difference of the angle removes a constant rate, so no Allan variance can find one",
        ),
        judge(
            "extremes of the curve at a varying rate",
            "W or M: three or more",
            exact(float(extremes), "1"),
            claimed=(3.0, np.inf),
            why="each period T of the motion leaves lobes sin⁴(πτ/T)/(πτ/T)² between zeros at multiples of T",
        ),
        judge(
            "white noise found if the motion goes unnoticed",
            "the coefficients are not those of the gyro",
            of_turning,
            claimed=(2.0 * N, np.inf),
            why="a sum of the two terms has no place for the motion and stretches to hold it",
        ),
        judge(
            "share of the record that is refused",
            "check the data by hand",
            exact(motion.share, "1"),
            claimed=None,
            derived=(float(swinging.mean()), float(swinging.mean()) + 12.0 / static.span),
            why=f"the motion is found by itself: {motion.describe()}",
        ),
        judge(
            "white noise from the still parts",
            "none: the Allan variance cannot be used",
            found,
            claimed=None,
            derived=N,
            why="the still parts of the same record give the coefficients of the gyro",
        ),
    )
    shown = slice(0, None, max(1, n // 4000))
    panels = (
        Panel(
            "angle increments of a turning gyro",
            "time, s",
            "increment, 10⁻³ deg",
            (Curve(turning.t[shown], turning.y[shown, 0] * SAMPLING_INTERVAL / DEG * 1e3, "gyro_x"),),
            "linear",
        ),
        Panel(
            "Allan deviation",
            "cluster time τ, s",
            "deg/h",
            (
                in_degrees_per_hour(of["turning"], "varying rate", group=1),
                in_degrees_per_hour(of["static"], "at rest", group=0),
                in_degrees_per_hour(of["constant"], "constant 10 deg/s", "points", group=2),
                in_degrees_per_hour(
                    curve(still, "oadev", noise=LASER_NOISE), "still parts", "dashed", group=3
                ),
            ),
        ),
    )
    return Item("rlg-dynamic", f"{RING_LASER_PAPER}: figure 5, 2.3 (7) and (9)", claims, Picture(panels))


def _white(found: ChannelIdentification) -> Coefficient:
    term = found.term("white")
    assert term is not None
    return term.coefficients["density"]


def _extremes(deviation: FloatArray) -> int:
    """Return how many maxima and minima inside the curve stand out by a tenth of a decade."""
    level = np.log10(deviation)
    return sum(len(find_peaks(sign * level, prominence=0.1)[0]) for sign in (1.0, -1.0))
