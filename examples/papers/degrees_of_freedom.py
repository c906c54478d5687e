"""Paper 2, figures 1–5: equivalent degrees of freedom of five noises, as printed and as they are.

The paper takes the formulas of clock noises and lays their list over gyro noises in reverse: quantization gets those
of random-walk frequency noise, and so on to the ramp, which gets those of white phase noise. A ramp is no noise at
all: every record of it gives the same variance, ν = 2 mean²/var has no meaning.

With N samples, T = N t0 and r = 0.75 m, the formulas for clock noises are (overlapping Allan, total, Thêo1)::

    random-walk FM  (N−2)/m · [(N−1)² − 3m(N−1) + 4m²]/(N−3)²     0.927 T/τ − 0.358
                    (4.4N−2)/(2.9r) · [(4.4N−1)² − 8.6r(4.4N−1) + 11.4r²]/(4.4N−3)²
    flicker FM      5N²/(4m(N+3m))                                1.168 T/τ − 0.222
                    (2N² − 1.3Nr − 3.5r)/(Nr) · r³/(r³+2.3)
    white FM        [3(N−1)/(2m) − 2(N−2)/N] · 4m²/(4m²+5)         1.5 T/τ
                    [(4.1N+0.8)/r − (3.1N+6.5)/N] · r^1.5/(r^1.5+5.2)
    flicker PM      exp √(ln((N−1)/2m) · ln((2m+1)(N−1)/4))       Allan + 2
                    (4.798N² − 6.374Nr + 12.387r)/(√(r+36.6)(N−r)) · r/(r+0.3)
    white PM        (N+1)(N−2m)/(2(N−m))                          Allan + 2
                    0.86(N+1)(N−4r/3)/(N−r) · r/(r+1.14)

Exact degrees of freedom are those of `tuner.curves.difference_dof`.

References
----------
.. [1] W. J. Riley, Handbook of Frequency Stability Analysis, NIST Special Publication 1065, 2008.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from examples.papers.results import Claim, Curve, Item, Panel, Picture, exact, judge
from examples.papers.sampling import Settings, estimate, realisations
from examples.papers.subjects import FIBRE_OPTIC_PAPER, UNIT_NOISES
from models.arrays import FloatArray
from models.noise import Ramp
from tuner.curves import dof
from tuner.curves.allan import overlapping_allan
from tuner.curves.theo import bias_ratio, theo1
from tuner.curves.total import total

SAMPLE_COUNT, T0 = 1000, 0.01
PRINTED_CLOCK_NOISE: Mapping[str, str] = MappingProxyType(
    {
        "quantization": "random-walk FM",
        "white": "flicker FM",
        "bias_instability": "white FM",
        "random_walk": "flicker PM",
        "ramp": "white PM",
    }
)
"""The clock noise whose formulas the paper uses for each noise."""
RIGHT_CLOCK_NOISE: Mapping[str, str] = MappingProxyType(
    {
        "bias_instability": "flicker FM",
        "random_walk": "random-walk FM",
        "white": "white FM",
        "quantization": "white PM",
    }
)
"""The clock noise with the same power law as each gyro noise."""
TITLES: Mapping[str, str] = MappingProxyType(
    {
        "quantization": "1 quantization",
        "white": "2 angle random walk",
        "bias_instability": "3 bias instability",
        "random_walk": "4 rate random walk",
        "ramp": "5 ramp: no noise, no degrees of freedom",
    }
)
"""Numbers and titles of the figures."""
NOISES = {name: term for name, term in UNIT_NOISES.items() if name != "ramp"}
"""Noises that have degrees of freedom."""


def printed_allan(clock: str, n: float, m: FloatArray) -> FloatArray:
    """Return the printed degrees of freedom of the overlapping Allan variance."""
    if clock == "random-walk FM":
        return (n - 2.0) / m * ((n - 1.0) ** 2 - 3.0 * m * (n - 1.0) + 4.0 * m**2) / (n - 3.0) ** 2
    if clock == "flicker FM":
        return 5.0 * n**2 / (4.0 * m * (n + 3.0 * m))
    if clock == "white FM":
        return (1.5 * (n - 1.0) / m - 2.0 * (n - 2.0) / n) * 4.0 * m**2 / (4.0 * m**2 + 5.0)
    if clock == "flicker PM":
        first, second = np.log((n - 1.0) / (2.0 * m)), np.log((2.0 * m + 1.0) * (n - 1.0) / 4.0)
        return np.asarray(np.exp(np.sqrt(np.maximum(first * second, 0.0))))
    return (n + 1.0) * (n - 2.0 * m) / (2.0 * (n - m))


def printed_total(clock: str, n: float, m: FloatArray) -> FloatArray:
    """Return the printed degrees of freedom of total variance."""
    constants = {"random-walk FM": (0.927, 0.358), "flicker FM": (1.168, 0.222), "white FM": (1.5, 0.0)}
    if clock not in constants:
        return printed_allan(clock, n, m) + 2.0
    b, c = constants[clock]
    return b * n / m - c


def printed_theo1(clock: str, n: float, r: FloatArray) -> FloatArray:
    """Return the printed degrees of freedom of Thêo1 at τ = r t0."""
    if clock == "random-walk FM":
        k = 4.4 * n
        return (k - 2.0) / (2.9 * r) * ((k - 1.0) ** 2 - 8.6 * r * (k - 1.0) + 11.4 * r**2) / (k - 3.0) ** 2
    if clock == "flicker FM":
        return (2.0 * n**2 - 1.3 * n * r - 3.5 * r) / (n * r) * r**3 / (r**3 + 2.3)
    if clock == "white FM":
        return ((4.1 * n + 0.8) / r - (3.1 * n + 6.5) / n) * r**1.5 / (r**1.5 + 5.2)
    if clock == "flicker PM":
        scale = np.sqrt(r + 36.6) * (n - r)
        return (4.798 * n**2 - 6.374 * n * r + 12.387 * r) / scale * r / (r + 0.3)
    return 0.86 * (n + 1.0) * (n - 4.0 * r / 3.0) / (n - r) * r / (r + 1.14)


def printed_theoh(clock: str, n: float, m: FloatArray) -> FloatArray:
    """Return the printed degrees of freedom of ThêoH: those of Thêo1 with 0.75 m put for r."""
    return printed_theo1(clock, n, 0.75 * m)


def fog_edf(settings: Settings) -> Item:
    """Return figures 1–5: n = 1000, t0 = 0.01 s."""
    rng = settings.rng("fog-edf")
    runs = settings.size(4000, 400)
    y = {name: realisations(term, SAMPLE_COUNT, runs, rng) for name, term in NOISES.items()}
    factor = np.array([bias_ratio(column) for column in y["white"].T])
    raw = theo1(y["white"], [200, 400])
    white = {"theo1 200": raw[0], "theobr 200": raw[0] * factor, "theobr 400": raw[1] * factor}
    white["total 300"] = total(y["white"], [300])[0]
    claims = (*_of_total(y), *_of_theo1(y["random_walk"], white), *_orders(y, white), _of_ramp())
    panels = tuple(_panel(noise) for noise in TITLES)
    title = f"{FIBRE_OPTIC_PAPER}: figures 1–5"
    return Item("fog-edf", title, claims, Picture(panels, columns=3))


def freedom(values: FloatArray) -> float:
    """Return ν = 2 mean²/var of independent variances."""
    return float(2.0 * np.mean(values) ** 2 / np.var(values, ddof=1))


def _quotient(pair: FloatArray) -> float:
    return freedom(pair[:, 0]) / freedom(pair[:, 1])


def _of_total(y: Mapping[str, FloatArray]) -> list[Claim]:
    """Judge the printed degrees of freedom of total variance at T/2."""
    half = SAMPLE_COUNT // 2
    claims = []
    for noise in NOISES:
        printed = float(printed_total(PRINTED_CLOCK_NOISE[noise], SAMPLE_COUNT, np.array([half]))[0])
        true = float(dof("totdev", SAMPLE_COUNT, [half], noise)[0])
        claims.append(
            judge(
                f"{TITLES[noise][2:]}: ν of total variance at T/2",
                f"{printed:.3g}",
                estimate(total(y[noise], [half])[0], freedom),
                claimed=printed,
                derived=(0.97 * true, 1.03 * true),
                why=f"ν = {true:.3g} by the trace of the quadratic form; printed is the formula of "
                f"{PRINTED_CLOCK_NOISE[noise]}, and this noise is {RIGHT_CLOCK_NOISE[noise]}",
            )
        )
    return claims


def _of_theo1(walk: FloatArray, white: Mapping[str, FloatArray]) -> list[Claim]:
    """Judge the formulas of Thêo1 and ThêoH."""
    m = 960
    printed = float(printed_theo1("random-walk FM", SAMPLE_COUNT, np.array([0.75 * m]))[0])
    true = float(dof("theo1", SAMPLE_COUNT, [m], "random_walk")[0])
    sizes = np.arange(12.0, 900.0, 2.0)
    same = printed_theo1("white FM", SAMPLE_COUNT, 0.75 * sizes) / printed_theoh(
        "white FM", SAMPLE_COUNT, sizes
    )
    at = 200
    freedoms = [float(dof(name, SAMPLE_COUNT, [at], "white")[0]) for name in ("theobr", "theo1")]
    return [
        judge(
            f"random walk: ν of Thêo1 at τ = {0.75 * m * T0:g} s by its formula",
            f"{printed:.3g}",
            estimate(theo1(walk, [m])[0], freedom),
            claimed=printed,
            derived=(0.93 * true, 1.07 * true),
            why=f"the formula falls below zero for m > 0.85 N; the trace gives {true:.3g}",
        ),
        judge(
            "ν printed for Thêo1 ÷ ν printed for ThêoH, same τ",
            "well above 1 at long τ",
            exact(float(same.max()), "1"),
            claimed=(1.05, np.inf),
            derived=1.0,
            why="with τ = 0.75 m t0 the two formulas are one; the figures draw one against τ, the other against m t0",
        ),
        judge(
            "white noise, τ = 1.5 s: ν of ThêoBR ÷ ν of Thêo1",
            "below 1",
            estimate(np.column_stack([white["theobr 200"], white["theo1 200"]]), _quotient),
            claimed=(0.0, 0.95),
            why=f"reproduced for another reason: 1/ν_BR = 1/ν_Thêo1 + var(factor)/2, expected "
            f"{freedoms[0]:.3g}/{freedoms[1]:.3g} = {freedoms[0] / freedoms[1]:.2f}",
        ),
    ]


def _orders(y: Mapping[str, FloatArray], white: Mapping[str, FloatArray]) -> list[Claim]:
    """Judge the order of the statistics that the paper states."""
    m = 160
    pair = np.column_stack([total(y["quantization"], [m])[0], overlapping_allan(y["quantization"], [m])[0]])
    true = [float(dof(name, SAMPLE_COUNT, [m], "quantization")[0]) for name in ("totdev", "oadev")]
    expected = float(
        dof("theobr", SAMPLE_COUNT, [400], "white")[0] / dof("totdev", SAMPLE_COUNT, [300], "white")[0]
    )
    return [
        judge(
            "quantization, τ = 1.6 s: ν of total ÷ ν of overlapping Allan variance",
            "above 1 for every noise",
            estimate(pair, _quotient),
            claimed=(1.0, np.inf),
            derived=(0.95 * true[0] / true[1], 1.05 * true[0] / true[1]),
            why="reflection makes the 2m terms at the ends share the end points: they add scatter, not freedom",
        ),
        judge(
            "white noise, τ = 3 s: ν of ThêoH ÷ ν of total variance",
            "below 1 for quantization, angle random walk and bias instability",
            estimate(np.column_stack([white["theobr 400"], white["total 300"]]), _quotient),
            claimed=(0.0, 1.0),
            derived=(0.93 * expected, 1.07 * expected),
            why=f"expected {expected:.2f}: the printed order is that of the reversed list",
        ),
    ]


def _of_ramp() -> Claim:
    """Judge the degrees of freedom of a ramp."""
    half = SAMPLE_COUNT // 2
    printed = float(printed_total(PRINTED_CLOCK_NOISE["ramp"], SAMPLE_COUNT, np.array([half]))[0])
    records = np.stack(
        [Ramp(1.0).sample(SAMPLE_COUNT, 1.0, np.random.default_rng(k)) for k in range(4)], axis=1
    )
    spread = float(np.std(total(records, [half])[0]))
    return judge(
        "ramp: relative sd of total variance at T/2 over records",
        f"√(2/ν) = {np.sqrt(2.0 / printed):.3g}, from ν = {printed:.3g}",
        exact(spread, "1"),
        claimed=float(np.sqrt(2.0 / printed)),
        derived=0.0,
        why="a ramp is deterministic: every record of it gives the same variance; figure 5 shows white phase noise",
    )


def _panel(noise: str) -> Panel:
    m = np.unique(np.geomspace(12, 480, 40).astype(int) // 3 * 3)
    long = np.unique(np.geomspace(12, 740, 40).astype(int) // 3 * 3)
    names: dict[str, tuple[str, Callable[[str, float, FloatArray], FloatArray], NDArray[np.int64]]] = {
        "oadev": ("Allan", printed_allan, m),
        "totdev": ("total", printed_total, m),
        "theo1": ("Thêo1", lambda clock, n, x: printed_theo1(clock, n, x), long),
        "theobr": ("ThêoH", lambda clock, n, x: printed_theoh(clock, n, x), long),
    }
    curves = []
    for group, (estimator, (label, printed, sizes)) in enumerate(names.items()):
        argument = sizes.astype(float)
        shown = printed(PRINTED_CLOCK_NOISE[noise], SAMPLE_COUNT, argument)
        shown = np.where(shown > 0.3, shown, np.nan)
        curves.append(Curve(argument * T0, shown, f"{label}, printed", "dotted", group=group))
        if noise != "ramp":
            taken = 4 * sizes // 3 if estimator.startswith("theo") else sizes
            curves.append(
                Curve(
                    argument * T0, dof(estimator, SAMPLE_COUNT, taken, noise), f"{label}, exact", group=group
                )
            )
    return Panel(TITLES[noise], "τ, s (printed ThêoH: m t0)", "degrees of freedom", tuple(curves))
