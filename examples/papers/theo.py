"""Paper 2, figures 6–9: what Allan, total, Thêo1 and ThêoH variances do to noise that is known.

The bias of a statistic is its mean over many records ÷ the Allan variance of the noise; its spread decides the
degrees of freedom, ν = 2 (mean ÷ standard deviation)².
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from examples.papers.expected_variances import PRINTED_TOTAL, theo1_ratio, total_ratio
from examples.papers.results import Claim, Curve, Item, Panel, Picture, Range, judge
from examples.papers.sampling import Settings, estimate, ratio_of_means, record_from, relative_sd, scatter
from examples.papers.subjects import FIBRE_OPTIC_PAPER, UNIT_NOISES
from models.arrays import FloatArray, IntArray
from tuner.curves import curve, dof
from tuner.curves.allan import overlapping_allan
from tuner.curves.theo import bias_ratio, theo1
from tuner.curves.total import total

LABELS: Mapping[str, str] = MappingProxyType(
    {"oadev": "Allan", "totdev": "total", "theo1": "Thêo1", "theobr": "ThêoBR"}
)
"""Names of the statistics in the figures."""

QUOTED_RECORDS = 100
"""Records in a smaller study, whose figures are to be met within its scatter."""
QUOTED_RATIO: Mapping[str, Range] = MappingProxyType(
    {"theo1": (0.36, 0.38), "theobr": (0.96, 0.99), "totdev": (0.72, 0.72)}
)
"""Ratio to the Allan variance of random walk at τ = 3 s, of a smaller study."""
QUOTED_SD: Mapping[str, Range] = MappingProxyType(
    {"oadev": (0.68, 0.68), "totdev": (0.58, 0.58), "theobr": (0.46, 0.46), "theo1": (0.39, 0.39)}
)
"""Relative standard deviation of the variances of white noise at τ = 3 s, of a smaller study."""


def variances(y: FloatArray, m: IntArray) -> dict[str, FloatArray]:
    """Return the four variances of every record at τ = m samples, m divisible by 3, shapes (q, runs).

    Parameters
    ----------
    y : ndarray, shape (n, runs)
        Records.
    m : ndarray of int, shape (q,)
        Cluster sizes; NaN where one is too large for the Allan variance.
    """
    fits = m <= len(y) // 2
    allan = np.full((m.size, y.shape[1]), np.nan)
    allan[fits] = overlapping_allan(y, m[fits])
    raw = theo1(y, 4 * m // 3)
    ratio = np.array([bias_ratio(column) for column in y.T])
    return {"oadev": allan, "totdev": total(y, m), "theo1": raw, "theobr": raw * ratio}


def fog_sim(settings: Settings) -> Item:
    """Return figures 6–9: unit white noise, n = 1000, t0 = 0.01 s, and its running sum."""
    rng = settings.rng("fog-sim")
    n, t0, runs = 1000, 0.01, settings.size(4000, 400)
    white = rng.standard_normal((n, runs))
    records = {"white": white, "random_walk": np.cumsum(white, axis=0)}
    m = np.array([9, 12, 18, 30, 48, 75, 120, 180, 240, 300, 390, 480, 570, 660, 750])
    tau, at = m * t0, int(np.flatnonzero(m == 300)[0])
    found = {noise: variances(y, m) for noise, y in records.items()}
    panels: list[Panel] = []
    titles = {"white": "angle random walk", "random_walk": "rate random walk"}
    for noise, y in records.items():
        one = record_from(y[:, 0], t0)
        single = [curve(one, name) for name in ("oadev", "totdev", "theo1", "theoh")]
        names = ("Allan", "total", "Thêo1", "ThêoH")
        panels += [
            Panel(titles[noise], "time, s", "rate", (Curve(one.t, y[:, 0], style="faint"),), "linear"),
            Panel(
                f"{titles[noise]}: one record",
                "τ, s",
                "deviation",
                tuple(
                    Curve(c.tau, c.deviation()[:, 0], name, group=g)
                    for g, (c, name) in enumerate(zip(single, names, strict=True))
                ),
            ),
            Panel(
                f"{runs} records: mean and quartiles ÷ Allan variance",
                "τ, s",
                "variance ÷ expected Allan variance",
                spread(found[noise], _mean_allan(noise, m), tau),
                "semilogx",
                ((3.0, "τ = 3 s"),),
            ),
        ]
    claims = _of_statistics(found, at, n, rng)
    return Item("fog-sim", f"{FIBRE_OPTIC_PAPER}: figures 6–9", claims, Picture(tuple(panels), columns=3))


def _of_statistics(
    found: Mapping[str, Mapping[str, FloatArray]], at: int, n: int, rng: np.random.Generator
) -> tuple[Claim, ...]:
    """Judge bias and spread at τ = 3 s, row `at` of the variances found for each noise."""
    white, walk = ({name: v[at] for name, v in found[noise].items()} for noise in ("white", "random_walk"))
    ratio = {name: np.column_stack([v, walk["oadev"]]) for name, v in walk.items()}
    expected = {
        name: float(np.sqrt(2.0 / dof(name, n, 400 if "theo" in name else 300, "white")[0]))
        for name in LABELS
    }

    allan_sd = relative_sd(white["oadev"])
    return (
        judge(
            "random walk, τ = 3 s: Thêo1 ÷ Allan variance",
            "biased",
            estimate(ratio["theo1"], ratio_of_means),
            claimed=(0.0, 0.95),
            why=f"exactly 1/{theo1_ratio('random_walk', 400):.2f} = {1.0 / theo1_ratio('random_walk', 400):.3f}"
            + _aside(ratio["theo1"], ratio_of_means, QUOTED_RATIO["theo1"], rng),
        ),
        judge(
            "random walk, τ = 3 s: ThêoBR (so ThêoH) ÷ Allan variance",
            "unbiased: 1",
            estimate(ratio["theobr"], ratio_of_means),
            claimed=(0.95, 1.05),
            why="one noise rules at every τ, so the ratio taken at short τ holds at long τ"
            + _aside(ratio["theobr"], ratio_of_means, QUOTED_RATIO["theobr"], rng),
        ),
        judge(
            "random walk, τ = 3 s: total ÷ Allan variance",
            "unbiased: a = 0",
            estimate(ratio["totdev"], ratio_of_means),
            claimed=1.0,
            derived=total_ratio("random_walk", 0.3),
            why="exactly 1 − 3τ/(4T) = 0.775 at τ/T = 0.3: the factor 0.75 belongs to the random walk"
            + _aside(ratio["totdev"], ratio_of_means, QUOTED_RATIO["totdev"], rng),
        ),
        judge(
            "white noise, τ = 3 s: total ÷ Allan variance",
            "1 − 0.48 τ/T = 0.856",
            estimate(np.column_stack([white["totdev"], white["oadev"]]), ratio_of_means),
            claimed=1.0 - PRINTED_TOTAL["white"] * 0.3,
            derived=(n - 1) / (n - 2),
            why="total variance of white noise has no bias; 0.48 belongs to bias instability",
        ),
        judge(
            "white noise, τ = 3 s: relative sd of the Allan variance",
            "2E = √(2/(N/m − 1)) = 0.926",
            estimate(white["oadev"], relative_sd),
            claimed=float(np.sqrt(2.0 / (n / 300 - 1.0))),
            derived=expected["oadev"],
            why=f"√(2/ν) = {expected['oadev']:.3f} with ν from the covariance of all N − 2m differences, not N/m − 1"
            + _aside(white["oadev"], relative_sd, QUOTED_SD["oadev"], rng),
        ),
        *(
            judge(
                f"white noise, τ = 3 s: relative sd of {LABELS[name]}",
                "smaller than Allan's",
                estimate(white[name], relative_sd),
                claimed=(0.0, allan_sd),
                why=f"√(2/ν) = {expected[name]:.3f} against Allan's {expected['oadev']:.3f}"
                + _aside(white[name], relative_sd, QUOTED_SD[name], rng),
            )
            for name in ("totdev", "theobr", "theo1")
        ),
    )


def _aside(
    runs: FloatArray, statistic: Callable[[FloatArray], float], quoted: Range, rng: np.random.Generator
) -> str:
    """Return words on whether the figure of a smaller study lies within its sampling error."""
    low, high = scatter(runs, statistic, QUOTED_RECORDS, rng)
    first, last = quoted
    holds = "holds" if low <= last and first <= high else "does not hold"
    figure = f"{first:g}" if first == last else f"{first:g}–{last:g}"
    band = f"{low:.2f} … {high:.2f}"
    return f"; the scatter of {QUOTED_RECORDS} records, {band}, {holds} {figure}, expected of a smaller study"


def spread(found: dict[str, FloatArray], reference: FloatArray, tau: FloatArray) -> tuple[Curve, ...]:
    """Return mean and quartiles of each statistic ÷ reference."""
    curves = []
    for group, (name, runs) in enumerate(found.items()):
        fits = ~np.isnan(runs[:, 0])
        shown = runs[fits] / reference[fits, None]
        low, high = np.quantile(shown, [0.25, 0.75], axis=1)
        curves.append(Curve(tau[fits], shown.mean(axis=1), LABELS[name], "line", low, high, group))
    return tuple(curves)


def less_one(values: FloatArray) -> float:
    """Return mean − 1."""
    return float(values.mean() - 1.0)


def _mean_allan(noise: str, m: IntArray) -> FloatArray:
    """Return the Allan variance of unit white noise or of its running sum."""
    return UNIT_NOISES[noise].allan_variance(m.astype(float), interval=1.0)
