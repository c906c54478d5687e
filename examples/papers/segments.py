"""Paper 1, figure 1 with table 2, and equation 19: reading five segments, and designing a test.

Alone, each noise is one straight line, and table 2 reads its coefficient where the line meets τ = √3, 1, 3 or √2; of
flicker the level of the floor ÷ 0.664, at any τ. In a sum the curve lies above each line, so that readings come out
large by the share of the neighbours.

Equation 19 counts n/k clusters as n/k − 1 degrees of freedom of σ. Of a variance with ν degrees of freedom, σ has the
relative standard deviation √(ν/2) Γ(ν/2)/Γ((ν+1)/2) …, near 1/√(2ν); ν follows from the covariance of the differences.
"""

from __future__ import annotations

import numpy as np
from scipy.special import gammaln

from examples.papers.results import Claim, Curve, Item, Panel, Picture, exact, judge
from examples.papers.sampling import Settings, estimate, realisations, record_of, relative_sd, scaled
from examples.papers.subjects import RING_LASER_PAPER
from models.arrays import FloatArray
from models.noise import (
    BiasInstability,
    GaussMarkov,
    NoiseModel,
    Quantization,
    Ramp,
    RandomWalk,
    Sinusoid,
    Term,
    White,
)
from models.noise.bias_instability import ALLAN_FLOOR
from tuner.curves import curve, dof
from tuner.curves.allan import allan, overlapping_allan
from tuner.identification.record_length import plan
from tuner.identification.slopes import Segment, read_segments
from tuner.types import Coefficient

READ_AT = {
    "quantization": ("Q", "τ = √3"),
    "white": ("N", "τ = 1"),
    "bias_instability": ("B", "τ = 0 (table), τ = 1 (text): 0.664 B"),
    "random_walk": ("K", "τ = 3"),
    "ramp": ("R", "τ = √2"),
}
"""Coefficient and cluster time of table 2 at which it is read, by noise."""
CORNERS = (0.3, 30.0, 1000.0, 10_000.0)
"""Where each of the five lines meets the next, s."""


def example_model() -> tuple[NoiseModel, dict[str, float]]:
    """Return five terms with the corners above, a sinusoid and a Gauss–Markov process, and the five coefficients."""
    q_n, n_b, b_k, k_r = CORNERS
    white = 1.0
    level = white / np.sqrt(n_b) / ALLAN_FLOOR
    walk = np.sqrt(3.0 / b_k) * ALLAN_FLOOR * level
    true = {
        "quantization": white * np.sqrt(q_n / 3.0),
        "white": white,
        "bias_instability": level,
        "random_walk": walk,
        "ramp": np.sqrt(2.0 / (3.0 * k_r)) * walk,
    }
    terms: tuple[Term, ...] = (
        Quantization(true["quantization"]),
        White(white),
        BiasInstability(level),
        RandomWalk(walk),
        Ramp(true["ramp"]),
        Sinusoid(2.0, 0.3, 0.0),
        GaussMarkov(0.8 * level, 60.0),
    )
    return NoiseModel(terms), {name: float(value) for name, value in true.items()}


def example_curve(settings: Settings) -> Item:
    """Return figure 1 and table 2: every term alone, then all together, read off as the table says."""
    rng = settings.rng("example-curve")
    interval, n = 0.05, settings.size(10_000_000, 2_000_000)
    model, true = example_model()
    claims = [
        _alone(name, term, settings.size(100, 20), rng)
        for name, term in zip(READ_AT, model.terms, strict=False)
    ]
    record = record_of(model, n, interval, rng)
    found = curve(record, "oadev", noise=model)
    deviation, freedom = found.deviation()[:, 0], found.dof[:, 0]
    exactly = np.sqrt(model.allan_variance(found.tau, interval=interval))
    expected = {s.term: s for s in read_segments(found.tau, exactly, freedom)}
    read = {s.term: s for s in read_segments(found.tau, deviation, freedom)}
    claims += [
        _together(name, read[name], expected[name], true[name])
        for name in READ_AT
        if name in read and name in expected
    ]
    floor = float(np.sqrt(NoiseModel((BiasInstability(1.0),)).allan_variance(np.array([1.0]))[0]))
    claims.append(
        judge(
            "floor of flicker of level B",
            "0.664 B, from σ² ≈ 4B²/9",
            exact(floor, "B"),
            claimed=(0.6635, 0.6645),
            why="exactly √(2 ln 2/π) = 0.6643; 4/9 rounds 2 ln 2/π = 0.4413",
        )
    )
    low, high = (limit[:, 0] for limit in found.interval())
    fine = np.geomspace(found.tau[0], found.tau[-1], 400)
    lines = [
        Curve(
            _without_lobes(term, fine),
            np.sqrt(term.allan_variance(_without_lobes(term, fine))),
            term.name.replace("_", " "),
            "dashed",
            group=group,
        )
        for group, term in enumerate(model.terms)
    ]
    places = {
        "quantization": np.sqrt(3.0),
        "white": 1.0,
        "bias_instability": float(np.sqrt(CORNERS[1] * CORNERS[2])),
        "random_walk": 3.0,
        "ramp": np.sqrt(2.0),
    }
    heights = [true[name] * (floor if name == "bias_instability" else 1.0) for name in places]
    panel = Panel(
        f"all terms, {n * interval:.0f} s",
        "cluster time τ, s",
        "Allan deviation, in units of N = 1",
        (
            *lines,
            Curve(found.tau, exactly, "sum, exact", group=7),
            Curve(found.tau, deviation, "sum, simulated, 95 %", "points", low, high, 7),
            Curve(np.array([*places.values()]), np.array(heights), "Q, N, 0.664 B, K, R", "crosses", group=7),
        ),
        marks=((1.0, "1: N"), (np.sqrt(2.0), "√2: R"), (np.sqrt(3.0), "√3: Q"), (3.0, "3: K")),
    )
    return Item(
        "example-curve", f"{RING_LASER_PAPER}: figure 1, table 2", tuple(claims), Picture((panel,), columns=1)
    )


def test_design(settings: Settings) -> Item:
    """Return equation 19: 25 % at 100 s needs nine clusters, 900 s; beside it what they give."""
    rng = settings.rng("test-design")
    design = plan(NoiseModel((White(1.0),)), interval=1.0, hours=0.25, accuracy=0.25)
    claims = [
        judge(
            "clusters for 25 %",
            "9",
            exact(float(design.clusters), "1"),
            claimed=9.0,
            why="1/√(2(9 − 1)) = 0.25",
        ),
        judge(
            "longest cluster time of 900 s at 25 %",
            "100 s",
            exact(design.longest_tau, "s"),
            claimed=100.0,
            why="900 s/9",
        ),
    ]
    n, m, runs = 900, 100, settings.size(6000, 500)
    clusters = np.unique(np.geomspace(5, 300, 30).astype(int))
    curves = [
        Curve(n / clusters, 1.0 / np.sqrt(2.0 * (n / clusters - 1.0)), "equation 19", "dashed", group=5)
    ]
    noises: dict[str, Term] = {
        "white": White(1.0),
        "bias_instability": BiasInstability(1.0),
        "random_walk": RandomWalk(1.0),
    }
    for group, (name, term) in enumerate(noises.items()):
        y = realisations(term, n, runs, rng)
        for estimator, statistic, style in (
            ("adev", allan, "dotted"),
            ("oadev", overlapping_allan, "line"),
        ):
            freedom = dof(estimator, n, [m], name)
            expected = float(relative_sd_of_sigma(freedom)[0])
            label = {"adev": "2^k", "oadev": "overlapping"}[estimator]
            claims.append(
                judge(
                    f"{name.replace('_', ' ')}: relative sd of σ(100 s) in 900 s, {label}",
                    "25 %",
                    estimate(np.sqrt(statistic(y, [m])[0]), relative_sd),
                    claimed=0.25,
                    derived=(0.96 * expected, 1.04 * expected),
                    why=f"ν = {freedom[0]:.1f} instead of n/k − 1 = 8",
                )
            )
            curves.append(
                Curve(
                    n / clusters,
                    relative_sd_of_sigma(dof(estimator, n, clusters, name)),
                    f"{name.replace('_', ' ')}, {label}",
                    "dotted" if style == "dotted" else "line",
                    group=group,
                )
            )
    panel = Panel(
        "accuracy of σ by the number of clusters", "clusters n/k", "relative sd of σ", tuple(curves)
    )
    item = Picture((panel,), columns=1)
    return Item("test-design", f"{RING_LASER_PAPER}: equation 19", tuple(claims), item)


def relative_sd_of_sigma(freedom: FloatArray) -> FloatArray:
    """Return standard deviation ÷ mean of σ̂ where ν σ̂²/σ² is χ² with ν degrees of freedom."""
    mean = np.exp(gammaln(0.5 * (freedom + 1.0)) - gammaln(0.5 * freedom)) * np.sqrt(2.0 / freedom)
    return np.asarray(np.sqrt(1.0 / mean**2 - 1.0))


def _without_lobes(term: Term, tau: FloatArray) -> FloatArray:
    """Return cluster times, of a sinusoid only those before the second zero of its Allan variance."""
    return tau[tau < 1.99 / term.frequency] if isinstance(term, Sinusoid) else tau


def _alone(name: str, term: Term, runs: int, rng: np.random.Generator) -> Claim:
    """Read a coefficient off the curves of many records of a single noise."""
    symbol, where = READ_AT[name]
    n, noise = 40_000, "random_walk" if name == "ramp" else name
    tau = (0.01 * np.unique(np.rint(np.geomspace(10, n / 40, 30)))).tolist()
    read = np.empty(1 if name == "ramp" else runs)
    for k in range(len(read)):
        found = curve(record_of(term, n, 0.01, rng), "oadev", tau=tau, noise=noise)
        freedom = np.full(len(tau), 1e9) if name == "ramp" else found.dof[:, 0]
        (segment,) = read_segments(found.tau, found.deviation()[:, 0], freedom)
        read[k] = segment.value / float(getattr(term, term.PARAMETERS[0]))
    return judge(
        f"{symbol} alone, read ÷ true",
        f"1, at {where}",
        exact(float(read[0]), "1") if name == "ramp" else estimate(read, np.mean),
        claimed=(0.995, 1.005),
        why="the floor has one level at every τ, no τ to be read at"
        if name == "bias_instability"
        else "the line of this noise alone",
    )


def _together(name: str, read: Segment, expected: Segment, true: float) -> Claim:
    """Read a coefficient off the curve of the sum."""
    symbol, where = READ_AT[name]
    share = expected.value / true
    return judge(
        f"{symbol} in the sum, read ÷ true",
        f"1, at {where}",
        _relative(read, true),
        claimed=1.0,
        derived=(0.98 * share, 1.02 * share),
        why=f"the curve of the sum lies above each line; the exact curve reads {share:.2f}",
    )


def _relative(segment: Segment, true: float) -> Coefficient:
    return scaled(Coefficient.known(segment.value, *segment.interval, ""), 1.0 / true, "1")
