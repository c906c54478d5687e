"""Rules of the verdicts on papers, their intervals, and the expected values of corrections."""

from __future__ import annotations

import numpy as np
import pytest

from examples.papers.degrees_of_freedom import printed_allan, printed_theo1, printed_theoh, printed_total
from examples.papers.expected_variances import theo1_ratio, total_ratio
from examples.papers.results import absent, exact, judge, rounded, untestable
from examples.papers.sampling import estimate, mean_of, ratio_of_means, share_of
from examples.papers.segments import relative_sd_of_sigma
from examples.papers.timeseries import MODEL, stays_white
from examples.papers.unweighted_fit import unweighted_fit
from models.noise import BiasInstability, NoiseModel, Quantization, Ramp, RandomWalk, White
from tuner.curves.theo import theo1
from tuner.curves.total import total
from tuner.types import Coefficient

OURS = Coefficient.known(1.0, 0.9, 1.1, "1")


@pytest.mark.parametrize(
    ("claimed", "derived", "verdict"),
    [
        (1.0, None, "reproduced"),
        (1.19, None, "reproduced"),
        (1.21, None, "not reproduced"),
        (1.3, 1.1, "corrected"),
        (1.3, 1.3, "not reproduced"),
        (1.15, 1.05, "corrected"),
        (1.05, 1.15, "reproduced"),
        ((0.0, 0.85), None, "reproduced"),
        ((0.0, 0.7), (0.75, 2.0), "corrected"),
        (None, 1.0, "corrected"),
        (None, None, "not reproduced"),
    ],
)
def test_verdict_follows_from_interval(
    claimed: float | tuple[float, float] | None,
    derived: float | tuple[float, float] | None,
    verdict: str,
) -> None:
    assert judge("", "", OURS, claimed=claimed, derived=derived, why="").verdict == verdict


def test_only_values_with_intervals_are_judged() -> None:
    with pytest.raises(ValueError, match="interval"):
        judge("", "", Coefficient(1.0, None, None, "1"), claimed=1.0, why="")
    assert untestable("", "", "no record").verdict == "untestable"


def test_absence_is_reproduced_by_a_bound_only() -> None:
    hidden = absent("", "", Coefficient.bounded(3.0, "1", "hidden"), why="")
    assert hidden.verdict == "reproduced"
    assert hidden.ours.upper == 3.0
    assert absent("", "", OURS, why="").verdict == "not reproduced"


def test_a_printed_number_stands_for_what_rounds_to_it() -> None:
    assert rounded(0.29, 2) == pytest.approx((0.285, 0.295))
    assert exact(0.0, "1").interval is not None


def test_jackknife_interval_covers() -> None:
    # 400 intervals of 95 %: fewer than 350 or more than 398 hits have a probability below 1e-5.
    rng = np.random.default_rng(3)
    hits = 0
    for _ in range(400):
        pair = np.column_stack([2.0 * rng.chisquare(3, 300), rng.chisquare(5, 300)])
        found = estimate(pair, ratio_of_means)
        assert found.interval is not None
        hits += found.interval[0] <= 1.2 <= found.interval[1]
    assert 350 <= hits <= 398


def test_share_has_an_interval_even_where_all_agree() -> None:
    found = share_of(np.ones(100, dtype=bool))
    assert found.interval == pytest.approx((0.963, 1.0), abs=1e-3)


def test_mean_of_estimates_needs_intervals() -> None:
    pooled = mean_of([OURS, OURS, OURS, OURS])
    assert pooled.interval == pytest.approx((0.95, 1.05))
    with pytest.raises(ValueError, match="intervals"):
        mean_of([OURS, Coefficient.bounded(1.0, "1", "hidden")])


def test_theo1_of_a_ramp_is_its_sum() -> None:
    y = Ramp(1.0).sample(1000, 1.0, np.random.default_rng(0))
    for m, published in ((10, 3.375), (40, 3.59), (100, 3.64), (400, 3.67)):
        ratio = 0.5 * (0.75 * m) ** 2 / theo1(y, [m])[0]
        assert theo1_ratio("ramp", m) == pytest.approx(ratio, rel=1e-9)
        assert ratio == pytest.approx(published, abs=0.006)


@pytest.mark.parametrize(
    ("noise", "m", "published"),
    [
        ("quantization", 10, 0.420),
        ("quantization", 1000, 0.147),
        ("white", 100, 1.0),
        ("bias_instability", 100, 1.837),
        ("random_walk", 10, 2.446),
        ("random_walk", 100, 2.668),
    ],
)
def test_theo1_of_noises(noise: str, m: int, published: float) -> None:
    assert theo1_ratio(noise, m) == pytest.approx(published, abs=6e-4)


def test_total_variance_of_a_ramp_and_of_quantization() -> None:
    n = 2000
    y = Ramp(1.0).sample(n, 1.0, np.random.default_rng(0))
    for m in (200, 600, 1000):
        ratio = total(y, [m])[0] / (0.5 * m**2)
        assert ratio == pytest.approx(total_ratio("ramp", m / n), abs=2e-3)
    # Mean of 2000 records; the relative sd of one at T/2 is √(2/12): tolerance of 5 standard errors.
    rng = np.random.default_rng(5)
    y = np.stack([Quantization(1.0).sample(200, 1.0, rng) for _ in range(2000)], axis=1)
    ratio = total(y, [100])[0].mean() / (3.0 / 100.0**2)
    assert ratio == pytest.approx(total_ratio("quantization", 0.5), rel=5.0 * np.sqrt(2.0 / 12.0 / 2000.0))


def test_printed_degrees_of_freedom() -> None:
    n, half = 1000.0, np.array([500.0])
    assert printed_total("white FM", n, half) == pytest.approx([3.0])
    assert printed_total("flicker FM", n, half) == pytest.approx([2.114])
    assert printed_total("random-walk FM", n, half) == pytest.approx([1.496])
    assert printed_total("white PM", n, half) == pytest.approx(printed_allan("white PM", n, half) + 2.0)
    assert printed_theo1("random-walk FM", n, np.array([720.0]))[0] < 0.0
    m = np.array([20.0, 200.0])
    for clock in ("random-walk FM", "flicker FM", "white FM", "flicker PM", "white PM"):
        assert printed_theoh(clock, n, m) == pytest.approx(printed_theo1(clock, n, 0.75 * m))
        assert np.all(np.diff(printed_allan(clock, n, m)) < 0.0)


def test_relative_sd_of_a_root() -> None:
    # χ with many degrees of freedom has 1/√(2ν); with one it is that of |x|.
    assert relative_sd_of_sigma(np.array([1.0]))[0] == pytest.approx(np.sqrt(np.pi / 2.0 - 1.0))
    assert relative_sd_of_sigma(np.array([1e4]))[0] == pytest.approx(1.0 / np.sqrt(2e4), rel=1e-3)


def test_how_often_equation_16_stays_white() -> None:
    # The likelihood of one autoregressive coefficient gains −n ln(1 − r₁²); 2000 records, 5 standard errors.
    rng, n, runs = np.random.default_rng(8), 2000, 2000
    kept = 0
    for _ in range(runs):
        y = MODEL.sample(n, 0.01, rng)
        r = np.dot(y[1:], y[:-1]) / np.dot(y, y)
        kept += -n * np.log1p(-(r**2)) < np.log(n)
    assert stays_white(n) == pytest.approx(kept / runs, abs=5.0 * np.sqrt(0.034 * 0.966 / runs))
    assert stays_white(20_000) < stays_white(2000)
    assert stays_white(23_000) > 0.5 > stays_white(24_000)


def test_unweighted_fit_of_an_exact_curve() -> None:
    terms = (Quantization(0.005), White(0.05), BiasInstability(0.05), RandomWalk(0.002), Ramp(1e-5))
    tau = 0.01 * 2.0 ** np.arange(20)
    wanted = [float(term.allan_variance(1.0)) for term in terms]
    assert unweighted_fit(tau, NoiseModel(terms).allan_variance(tau)) == pytest.approx(wanted, rel=2e-6)
    tau = 2.0 ** np.arange(12)
    assert unweighted_fit(tau, 1.0 / tau - 0.3 / 4096.0)[2] < 0.0
