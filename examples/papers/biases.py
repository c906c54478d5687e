"""Paper 2, section 1.2 and table 1: the biases of total variance and of Thêo1, for each of five noises.

The paper lays the list of clock noises over the gyro noises in reverse, so that each gets the number of another. The
bias of a statistic is its mean over many records ÷ the Allan variance of the noise; expected values are those of
`examples.papers.expected_variances`.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from examples.papers.expected_variances import PRINTED_THEO1, PRINTED_TOTAL, theo1_ratio, total_ratio
from examples.papers.results import Claim, Curve, Item, Panel, Picture, exact, judge
from examples.papers.sampling import Settings, estimate, realisations, scaled
from examples.papers.subjects import FIBRE_OPTIC_PAPER, NOISE_NAMES, UNIT_NOISES
from examples.papers.theo import less_one
from models.arrays import FloatArray
from models.noise import Term
from tuner.curves.theo import theo1
from tuner.curves.total import total
from tuner.types import Coefficient

PRINTED_FOR: Mapping[str, str] = MappingProxyType(
    {
        "quantization": "rate random walk (random-walk FM)",
        "white": "bias instability (flicker FM)",
        "bias_instability": "angle random walk (white FM)",
        "random_walk": "flicker PM, which no gyro noise is",
        "ramp": "quantization (white PM)",
    }
)
"""Noise whose clock formulas the paper gives to each."""
SIZES = (10, 20, 40, 100, 200, 400)
"""Sizes m of table 1 at which Thêo1 is computed."""
JUDGED_SIZES: Mapping[str, tuple[int, ...]] = MappingProxyType({"ramp": (10, 40, 100, 400)})
"""Sizes m at which Thêo1 is judged, of the other noises 100."""


def fog_bias(settings: Settings) -> Item:
    """Return the bias of total variance at T/2, and table 1: the bias of Thêo1, for each of five noises."""
    rng = settings.rng("fog-bias")
    n, runs = 400, settings.size(6000, 500)
    shares, sizes = np.array([40, 80, 120, 160, 200]), np.array(SIZES)
    clusters = 0.75 * sizes
    claims: list[Claim] = []
    of_total: list[Curve] = []
    of_theo1: list[Curve] = []
    for g, (noise, term) in enumerate(UNIT_NOISES.items()):
        y = realisations(term, n, 1 if noise == "ramp" else runs, rng)
        reference = term.allan_variance(shares.astype(float), interval=1.0)
        totals = total(y, shares) / reference[:, None]
        of_total += _against(
            shares / n,
            totals,
            NOISE_NAMES[noise],
            g,
            [total_ratio(noise, s) for s in shares / n],
            1.0 - PRINTED_TOTAL[noise] * shares / n,
        )
        raw = theo1(y, sizes)
        ratio = term.allan_variance(clusters, interval=1.0)[:, None] / raw.mean(axis=1, keepdims=True)
        a, b, c = PRINTED_THEO1[noise]
        of_theo1 += _against(
            sizes.astype(float),
            ratio,
            "",
            g,
            [theo1_ratio(noise, k) for k in SIZES],
            a + b / sizes**c,
        )
        claims.append(_of_total(noise, totals[-1]))
        claims += [_of_theo1(noise, term, m, raw[SIZES.index(m)]) for m in JUDGED_SIZES.get(noise, (100,))]
    panels = (
        Panel(f"total variance ÷ Allan variance, {runs} records", "τ/T", "ratio", tuple(of_total), "linear"),
        Panel(f"Allan variance ÷ Thêo1, {runs} records (colours as before)", "m", "ratio", tuple(of_theo1)),
    )
    return Item("fog-bias", f"{FIBRE_OPTIC_PAPER}: section 1.2 and table 1", tuple(claims), Picture(panels))


def _of_total(noise: str, ratios: FloatArray) -> Claim:
    """Judge the bias of total variance at T/2, from its ratios to the Allan variance in every record."""
    claimed, true = -50.0 * PRINTED_TOTAL[noise] + 0.0, 100.0 * (total_ratio(noise, 0.5) - 1.0)
    return judge(
        f"{NOISE_NAMES[noise]}: bias of total variance at T/2",
        f"{claimed:.3g} %",
        exact(100.0 * float(ratios[0]) - 100.0, "%") if noise == "ramp" else _per_cent(ratios),
        claimed=claimed,
        derived=(true - 0.6, true + 0.6),
        why=f"{true:+.3g} %: the list of clock noises lies over these in reverse; printed is the value for "
        f"{PRINTED_FOR[noise]}",
    )


def _of_theo1(noise: str, term: Term, m: int, raw: FloatArray) -> Claim:
    """Judge the ratio of the Allan variance to Thêo1 of m samples, from Thêo1 of every record."""
    a, b, c = PRINTED_THEO1[noise]
    printed, true = a + b / m**c, theo1_ratio(noise, m)
    ratios = float(term.allan_variance(0.75 * m, interval=1.0)) / raw
    return judge(
        f"{NOISE_NAMES[noise]}: Allan ÷ Thêo1 at m = {m}",
        f"{printed:.3g}",
        exact(float(ratios[0]), "1") if noise == "ramp" else estimate(ratios, _harmonic_mean),
        claimed=printed,
        derived=(0.995 * true, 1.005 * true),
        why=f"exact {true:.3f}; printed is a + b/mᶜ for {PRINTED_FOR[noise]}",
    )


def _against(
    x: FloatArray, runs: FloatArray, label: str, group: int, expected: list[float], printed: FloatArray
) -> list[Curve]:
    """Return the mean of runs as points, the expected line, and crosses where the paper prints it."""
    return [
        Curve(x, runs.mean(axis=1), label, "points", group=group),
        Curve(x, np.array(expected), "derived" if label and group == 0 else "", "line", group=group),
        Curve(x, printed, "printed" if label and group == 0 else "", "crosses", group=group),
    ]


def _harmonic_mean(ratios: FloatArray) -> float:
    """Return 1 ÷ mean of 1/ratio."""
    return float(1.0 / np.mean(1.0 / ratios))


def _per_cent(ratios: FloatArray) -> Coefficient:
    """Return mean − 1 in per cent."""
    return scaled(estimate(ratios, less_one), 100.0, "%")
