"""Paper 2, figures 10 and 11: a record of ramp, white noise and quantization, where no single noise rules.

The factor of ThêoBR is the mean of Allan ÷ Thêo1 at τ below a tenth of the record. Where another noise rules beyond,
Thêo1 has another bias there, and the factor does not remove it.
"""

from __future__ import annotations

import numpy as np

from examples.papers.expected_variances import theo1_ratio
from examples.papers.results import Curve, Item, Panel, Picture, judge, untestable
from examples.papers.sampling import Settings, estimate, record_from
from examples.papers.subjects import FIBRE_OPTIC_PAPER
from examples.papers.theo import LABELS, less_one, spread, variances
from examples.papers.unweighted_fit import unweighted_fit
from models.arrays import FloatArray
from models.noise import NoiseModel, Quantization, Ramp, White
from models.units import DEG_PER_HOUR
from tuner.curves import curve
from tuner.types.records import Record


def fog_record(settings: Settings) -> Item:
    """Return figures 10 and 11: 3000 s at 0.3 s of ramp, white noise and quantization, over many records."""
    rng = settings.rng("fog-record")
    n, t0, runs = 10_000, 0.3, settings.size(200, 50)
    white = 0.6 * DEG_PER_HOUR  # (rad/s)√s
    corner, crossing = 3.0, 300.0  # s: quantization meets white noise, white noise meets the ramp
    quantization, ramp = Quantization(white * np.sqrt(corner / 3.0)), Ramp(white * np.sqrt(2.0 / crossing**3))
    model = NoiseModel((quantization, White(white), ramp))
    y = np.stack([model.sample(n, t0, rng) for _ in range(runs)], axis=1)
    m = np.array([9, 12, 18, 30, 60, 120, 240, 480, 990, 1500, 2250, 3000, 4200, 4998, 6000, 7500])
    tau = m * t0
    found, reference = variances(y, m), model.allan_variance(tau)
    bias = {
        (name, at): estimate(
            found[name][np.flatnonzero(m == at)[0]] / model.allan_variance(at * t0), less_one
        )
        for name in LABELS
        for at in (9, 4998)
    }
    one = record_from(y[:, 0], t0)
    slopes = np.array([_squared_ramp(record_from(y[:, k], t0)) for k in settings.steps(runs)]) / ramp.rate**2
    expected = theo_br_ratio(model, n, t0, 4 * 4998 // 3)
    remaining = 1.0 / _mixture_ratio(model, t0, 4 * 4998 // 3)
    claims = (
        judge(
            "bias of Thêo1 at τ = 2.7 s",
            "larger than that of total variance",
            bias["theo1", 9],
            claimed=(0.05, np.inf),
            why="quantization: Thêo1 sums 1/(m/2 − d), a harmonic number",
        ),
        judge(
            "bias of total variance at τ = 2.7 s",
            "smaller than that of Thêo1",
            bias["totdev", 9],
            claimed=(-0.05, 0.05),
            why="total variance has no bias of its own where τ is a small part of T",
        ),
        judge(
            "|bias| of Thêo1 − |bias| of total variance at τ = T/2",
            "negative: total is worse at long τ",
            estimate(np.column_stack([found[k][13] / reference[13] for k in ("theo1", "totdev")]), _worse),
            claimed=(-1.0, 0.0),
            derived=((1.0 - remaining) - 7.0 / 15.0 - 0.03, (1.0 - remaining) - 7.0 / 15.0 + 0.03),
            why=f"the ramp rules: total reads 8/15 (−47 %), Thêo1 {remaining:.3f} ({100.0 * (remaining - 1.0):.0f} %)",
        ),
        judge(
            "bias of ThêoH at τ = T/2",
            "none",
            bias["theobr", 4998],
            claimed=(-0.05, 0.05),
            derived=(expected - 1.04, expected - 0.96),
            why=f"its factor comes from where quantization and white noise rule and is put on the ramp: {expected:.2f} "
            "of the Allan variance. ThêoH is unbiased only where one noise rules at all τ",
        ),
        judge(
            "R² from an unweighted fit to the ThêoH curve ÷ true R²",
            "1: the best method",
            estimate(slopes, np.mean),
            claimed=1.0,
            derived=(0.75 * expected, 1.35 * expected),
            why="a fit to a biased curve keeps the bias; the ramp comes out at about half its rate",
        ),
        untestable(
            "coefficients of table 3", "not in the text", "neither the record nor the numbers were published"
        ),
    )
    names = ("oadev", "totdev", "theo1", "theoh")
    single = [curve(one, name, noise=model) for name in names]
    shown = [
        Curve(c.tau, c.deviation()[:, 0] / DEG_PER_HOUR, label, group=g)
        for g, (c, label) in enumerate(zip(single, ("Allan", "total", "Thêo1", "ThêoH"), strict=True))
    ]
    truth = Curve(tau, np.sqrt(reference) / DEG_PER_HOUR, "true", "dashed", group=5)
    panels = (
        Panel(
            "one record",
            "time, s",
            "rate, deg/h",
            (Curve(one.t, one.y[:, 0] / DEG_PER_HOUR, style="faint"),),
            "linear",
        ),
        Panel("its four curves", "τ, s", "deviation, deg/h", (*shown, truth)),
        Panel(
            f"{runs} records: mean and quartiles ÷ true",
            "τ, s",
            "variance ÷ true Allan variance",
            spread(found, reference, tau),
            "semilogx",
            ((0.1 * n * t0, "ThêoH switches"),),
        ),
    )
    return Item(
        "fog-record", f"{FIBRE_OPTIC_PAPER}: figures 10 and 11, table 3", claims, Picture(panels, columns=3)
    )


def _worse(pair: FloatArray) -> float:
    """Return |bias| of the first column − |bias| of the second."""
    first, second = np.abs(pair.mean(axis=0) - 1.0)
    return float(first - second)


def _squared_ramp(record: Record) -> float:
    """Return R² of the paper's fit to the ThêoH curve, negative where the fit is."""
    found = curve(record, "theoh", noise="white")
    return 2.0 * float(unweighted_fit(found.tau, found.variance[:, 0])[-1])


def theo_br_ratio(model: NoiseModel, n: int, t0: float, m: int) -> float:
    """Return E ThêoBR ÷ Allan variance of a sum of noises: its factor, taken below T/10, over that at m."""
    count = int(np.floor(0.1 * (n + 1) / 3.0 - 3.0)) + 1
    factor = np.mean([_mixture_ratio(model, t0, 12 + 4 * i) for i in range(count)])
    return float(factor / _mixture_ratio(model, t0, m))


def _mixture_ratio(model: NoiseModel, t0: float, m: int) -> float:
    """Return Allan variance ÷ E Thêo1 of a sum of noises."""
    parts = np.array([float(term.allan_variance(0.75 * m * t0)) for term in model.terms])
    return float(parts.sum() / np.sum(parts / [theo1_ratio(term.name, m) for term in model.terms]))
