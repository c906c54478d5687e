"""Paper 3, figures 3–5: preparation of a record, tests of stationarity, ARMA model.

ARMA(1,1) with φ = 0.476425 and θ = −0.455909 has the autocorrelation ρ₁ = (1 + φθ)(φ + θ)/(1 + 2φθ + θ²) = 0.0208:
white noise but for five parts in ten thousand of its variance. φ is known to sd (1 + φθ)√(1 − φ²)/(|φ + θ| √n) =
33.5/√n, so that six digits of it mean nothing.

How long a record must be to tell it from white noise follows from what a sample adds to 2 ln L: ln(γ₀/σ²) = 5.44 · 10⁻⁴
for the model itself, −ln(1 − ρ₁²) = 4.31 · 10⁻⁴ for the best single coefficient; BIC charges ln n for each. White noise
is left for one coefficient with the probability of a non-central χ²₁ beyond ln n: 3 % at n = 2000, 42 % at 20 000, half
at 23 000; the second coefficient pays from n = 100 000 on.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.stats import ncx2

from examples.papers.results import Claim, Curve, Item, Panel, Picture, exact, judge, rounded
from examples.papers.sampling import Settings, estimate, record_from, share_of
from examples.papers.subjects import MEMS_PAPER
from examples.papers.two_group_allan import PRINTED_MEAN, PRINTED_VARIANCE
from models.arrays import FloatArray
from models.noise.arma import Arma
from tuner.curves import acf, pacf
from tuner.identification.arma import coefficient_covariance, fit_arma, one_step
from tuner.identification.arma_preprocess import (
    remove_trend,
    replace_outliers,
    reverse_arrangements,
    sigma_outliers,
)

PHI, THETA = 0.476425, -0.455909
"""Equation 16."""
MODEL = Arma((PHI,), (THETA,), PRINTED_VARIANCE, 0.01)
"""The ARMA model of equation 16, at 100 Hz."""
PRINTED_Z = 0.2141
"""Statistic of the reverse arrangements test that the paper prints."""


def mems_arma(settings: Settings) -> Item:
    """Return figures 3–5, table 2 and equation 16."""
    rng = settings.rng("mems-arma")
    runs = settings.size(100, 50)
    orders = {
        n: _orders(n, settings, count, rng) for n, count in ((2000, runs), (20_000, settings.size(200, 20)))
    }
    series = MODEL.sample(2000, 0.01, rng)
    raw = _raw(series, rng)
    clean = replace_outliers(raw, sigma_outliers(raw))
    prepared = remove_trend(clean - clean.mean())[1]
    record = record_from(prepared, 0.01)
    lags = (0.01 * np.arange(31)).tolist()
    correlation, partial = acf(record, lag=lags), pacf(record, lag=lags)
    claims = (
        *_of_preparation(settings, rng),
        *_of_correlation(settings, rng),
        *_of_orders(orders),
        *_of_model(settings, rng),
    )
    time, part = record.t[:100], slice(0, 100)
    predicted = one_step(prepared, (PHI,), (THETA,))
    panels = (
        Panel(
            "figure 3: raw and prepared",
            "time, s",
            "deg/s",
            (
                Curve(record.t, raw - PRINTED_MEAN, "raw − 3.0478", "faint", group=1),
                Curve(record.t, prepared, "prepared", "faint", group=0),
            ),
            "linear",
        ),
        Panel(
            "figure 4: correlation, 2000 samples",
            "lag, s",
            "correlation",
            (
                Curve(correlation.lag[1:], correlation.value[1:, 0], "autocorrelation", "points", group=0),
                Curve(partial.lag[1:], partial.value[1:, 0], "partial", "points", group=1),
                *(
                    Curve(correlation.lag[1:], np.full(30, sign * correlation.band), label, "dotted", group=5)
                    for sign, label in ((1.0, "95 % band of white noise"), (-1.0, ""))
                ),
            ),
            "linear",
        ),
        Panel(
            "figure 5: 100 points and the model",
            "time, s",
            "deg/s",
            (
                Curve(time, prepared[part], "data", group=0),
                Curve(time, predicted[part], "prediction from the past", group=1),
                Curve(time, MODEL.sample(100, 0.01, rng), "another sample of the model", "dotted", group=2),
            ),
            "linear",
        ),
    )
    return Item(
        "mems-arma", f"{MEMS_PAPER}: figures 3–5, table 2, eq. 16", claims, Picture(panels, columns=3)
    )


def _raw(series: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return a series with the mean of figure 2, a trend and a few outliers."""
    raw = PRINTED_MEAN + series + 2e-5 * np.arange(len(series))
    raw[rng.choice(len(raw), 8, replace=False)] += 0.6 * rng.choice([-1.0, 1.0], 8)
    return raw


def _of_preparation(settings: Settings, rng: np.random.Generator) -> list[Claim]:
    """Judge outlier rejection and the test of reverse arrangements."""
    runs = settings.size(4000, 500)
    clean = rng.standard_normal((runs, 400))
    left = np.array(
        [np.var(np.delete(row, np.flatnonzero(sigma_outliers(row)))) / np.var(row) for row in clean]
    )
    walks = np.cumsum(rng.standard_normal((runs, 400)), axis=1)
    passed = {
        "white": [abs(reverse_arrangements(row).statistic) <= 1.96 for row in clean],
        "walk": [abs(reverse_arrangements(row).statistic) <= 1.96 for row in walks],
        "detrended": [abs(reverse_arrangements(remove_trend(row)[1]).statistic) <= 1.96 for row in walks],
    }
    return [
        judge(
            "variance that 3σ rejection leaves of clean Gaussian data",
            "removes gross errors only: 1",
            estimate(left, np.mean),
            claimed=1.0,
            derived=(0.971, 0.976),
            why="0.27 % of clean samples lie beyond 3σ, and they carry 2.7 % of the variance",
        ),
        judge(
            "possible Z of 10 groups that is nearest to 0.2141",
            "Z = 0.2141",
            exact(_nearest(PRINTED_Z), "1"),
            claimed=rounded(PRINTED_Z, 4),
            derived=2.0 / np.sqrt(125.0),
            why="with 10 groups |A − 22.5| is a half integer and √31.25 = 5.59, so Z is a multiple of 0.0894, with or "
            "without the correction of ½: 0.1789, 0.2683, never 0.2141 (30 groups with the ½ would give it)",
        ),
        judge(
            "white noise that passes |Z| ≤ 1.96",
            "95 %",
            share_of(np.array(passed["white"])),
            claimed=(0.94, 0.98),
            why="10 groups allow few values: the size is a little below 5 %",
        ),
        judge(
            "random walks that fail the test",
            "not stationary: all",
            share_of(~np.array(passed["walk"])),
            claimed=(0.95, 1.0),
            derived=(0.4, 0.7),
            why="the test sees monotone trends only: about half of all random walks have none",
        ),
        judge(
            "random walks that fail after the trend is removed",
            "not stationary: all",
            share_of(~np.array(passed["detrended"])),
            claimed=(0.95, 1.0),
            derived=(0.0, 0.05),
            why="the straight line takes what the test looks for: passing it after a detrend is no news",
        ),
    ]


def _nearest(wanted: float, groups: int = 10) -> float:
    """Return the |Z| nearest to the one wanted, of all that so many groups can give, with or without the ½."""
    excess = np.abs(np.arange(groups * (groups - 1) // 2 + 1) - groups * (groups - 1) / 4.0)
    every = np.concatenate([excess, excess + 0.5, np.abs(excess - 0.5)])
    every = every / np.sqrt(groups * (2.0 * groups**2 + 3.0 * groups - 5.0) / 72.0)
    return float(every[np.argmin(np.abs(every - wanted))])


def _of_correlation(settings: Settings, rng: np.random.Generator) -> list[Claim]:
    """Judge the correlograms."""
    runs, n = settings.size(400, 60), 2000
    outside, first = [], []
    for _ in range(runs):
        found = acf(record_from(MODEL.sample(n, 0.01, rng), 0.01), lag=(0.01 * np.arange(21)).tolist())
        outside.append(np.mean(np.abs(found.value[1:, 0]) > found.band))
        first.append(float(found.value[1, 0]))
    rho = _first_correlation()
    return [
        judge(
            "lags 1 … 20 whose correlation leaves the band of white noise, n = 2000",
            "both correlograms tail off clearly",
            estimate(np.array(outside), np.mean),
            claimed=(0.15, 1.0),
            derived=(0.03, 0.08),
            why=f"the printed model has ρ₁ = {rho:.4f}, half the band of ±0.044: a correlogram of white noise",
        ),
        judge(
            "autocorrelation of the printed model at lag 1",
            "visible",
            estimate(np.array(first), np.mean),
            claimed=(0.044, 1.0),
            derived=(rho - 0.002, rho + 0.002),
            why="(1 + φθ)(φ + θ)/(1 + 2φθ + θ²): the roots nearly cancel",
        ),
    ]


def _orders(
    n: int, settings: Settings, runs: int, rng: np.random.Generator
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
    """Return, of every record of n samples of the printed model: called white; (1,1) by BIC; (1,1) by AIC."""
    white, by_bic, by_aic = [], [], []
    for _ in settings.steps(runs):
        fit = fit_arma([MODEL.sample(n, 0.01, rng)], 0.01, "deg/s")
        aic = fit.scores_by("aic")
        white.append(fit.white)
        by_bic.append(min(fit.scores, key=lambda order: fit.scores[order]) == (1, 1))
        by_aic.append(min(aic, key=lambda order: aic[order]) == (1, 1))
    return np.array(white), np.array(by_bic), np.array(by_aic)


def _of_orders(
    orders: Mapping[int, tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]],
) -> list[Claim]:
    """Judge the choice of the order."""
    gains = np.log(_power() / PRINTED_VARIANCE), -np.log1p(-(_first_correlation() ** 2))
    claims = []
    for n, (white, by_bic, by_aic) in orders.items():
        gained, single = (n * gain for gain in gains)
        kept, size = stays_white(n), str(n) if n < 10_000 else f"{n:_}".replace("_", " ")
        claims += [
            judge(
                f"records of the printed model called white, n = {size}",
                "none: ARMA(1,1)",
                share_of(white),
                claimed=(0.0, 0.05),
                derived=(kept - 0.03, kept + 0.01),
                why=f"the best single coefficient gains {single:.1f} in 2 ln L on average and costs ln n = "
                f"{np.log(n):.1f}: χ²₁ of non-centrality {single:.1f} stays below that in {100.0 * kept:.0f} %",
            ),
            judge(
                f"records whose BIC is smallest at (1,1), n = {size}",
                "(1,1)",
                share_of(by_bic),
                claimed=(0.5, 1.0),
                derived=(0.0, 0.1),
                why=f"both coefficients gain {gained:.1f} on average and cost {2.0 * np.log(n):.1f}; the second one, "
                f"{gained - single:.1f} for {np.log(n):.1f}, pays from 100 000 samples on",
            ),
            judge(
                f"records whose AIC is smallest at (1,1), n = {size}",
                "(1,1)",
                share_of(by_aic),
                claimed=(0.5, 1.0),
                derived=(0.02, 0.35),
                why="AIC adds coefficients at will: it rarely stops at (1,1)",
            ),
        ]
    return claims


def stays_white(n: int) -> float:
    """Return the probability that BIC prefers white noise to one coefficient, for n samples of equation 16."""
    return float(ncx2.cdf(np.log(n), 1, -n * np.log1p(-(_first_correlation() ** 2))))


def _power() -> float:
    """Return the variance γ₀ of equation 16."""
    return float(MODEL.autocovariance(0.0))


def _first_correlation() -> float:
    """Return ρ₁ of equation 16."""
    return float(MODEL.autocovariance(MODEL.interval)) / _power()


def _of_model(settings: Settings, rng: np.random.Generator) -> list[Claim]:
    """Judge equation 16 and the overlay of figure 5."""
    n = 20_000
    sd = float(np.sqrt(coefficient_covariance((PHI,), (THETA,), n)[0, 0]))
    closed = (1.0 + PHI * THETA) * np.sqrt(1.0 - PHI**2) / abs(PHI + THETA) / np.sqrt(n)
    power, explained, gain = _power(), [], []
    for _ in range(settings.size(400, 50)):
        y = MODEL.sample(n, 0.01, rng)
        innovations = y - one_step(y, (PHI,), (THETA,))
        explained.append(1.0 - np.var(innovations) / np.var(y))
        gain.append(
            np.sum(y**2) / power
            - np.sum(innovations**2) / PRINTED_VARIANCE
            + n * np.log(power / PRINTED_VARIANCE)
        )
    share = 1.0 - PRINTED_VARIANCE / power
    return [
        judge(
            "2 ln L of equation 16 less that of white noise, n = 20 000",
            f"more than BIC charges: 2 ln n = {2.0 * np.log(n):.1f}",
            estimate(np.array(gain), np.mean),
            claimed=(2.0 * np.log(n), np.inf),
            derived=(
                0.99 * n * np.log(power / PRINTED_VARIANCE),
                1.01 * n * np.log(power / PRINTED_VARIANCE),
            ),
            why="n ln(γ₀/σ²), 5.44 · 10⁻⁴ a sample: it pays for two coefficients from 39 000 samples on",
        ),
        judge(
            "standard deviation of φ from 20 000 samples",
            "0.476425: six digits",
            exact(sd, "1"),
            claimed=(0.0, 5e-7),
            derived=(0.999 * closed, 1.001 * closed),
            why="33.5/√n; sd 0.1 would need 110 000 samples, six digits 10¹⁵",
        ),
        judge(
            "variance of the data that the model explains (100-point overlay)",
            "data and model basically agree",
            estimate(np.array(explained), np.mean),
            claimed=(0.5, 1.0),
            derived=(share - 1e-4, share + 1e-4),
            why=f"1 − σ²/var x = {share:.1e}: prediction from the past is zero but for 2 % of a sd, and "
            "another sample of the model agrees with nothing",
        ),
    ]
