"""Tests of data quality: no finding in clean data, hidden faults found with their size.

Seeds are fixed and are the first that were tried. Clean sets: about 600 tests at p < 1e-4 each.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate, stats
from scipy.signal import lfilter

from models.effects import Samples, hide
from models.effects.static.sampling import Clipping, Duplicates, Quantizer
from models.noise import BiasInstability, NoiseModel, RandomWalk, White
from tuner.diagnosis.data_quality import DataQualityTest, data_quality_tests
from tuner.diagnosis.data_quality.repeated_samples import chance_equality, find_repeated_samples
from tuner.diagnosis.data_quality.saturation import rails
from tuner.segments.quantizer import may_be_uneven, quantizer_step, read_codes
from tuner.simulation.static import Channel, simulate
from tuner.types.records import Record

INTERVAL = 0.01
REJECTION_P_VALUE = 1e-4

FILTERS = {
    "white": ([1.0], [1.0]),
    "low-pass": ([1.0], [1.0, -0.6]),
    "strong low-pass": ([1.0], [1.0, -1.6, 0.7]),
    "high-pass": ([1.0], [1.0, 0.5]),
    "quantization": ([1.0, -1.0], [1.0]),
}


def noise(kind: str, n: int, k: int, rng: np.random.Generator) -> np.ndarray:
    """Noise of unit sd and of that kind on a bias that wanders slowly."""
    w = rng.standard_normal((n, k))
    if kind in FILTERS:
        w = lfilter(*FILTERS[kind], w, axis=0)
    elif kind == "heavy tails":
        w = rng.standard_t(5, (n, k))
    elif kind == "moved":
        w[n // 2 : n // 2 + n // 10] *= 30.0
    elif kind == "line":
        w += 2.0 * np.sin(2 * np.pi * 7.3 * INTERVAL * np.arange(n))[:, None]
    w /= (w[: n // 2] if kind == "moved" else w).std(axis=0)
    return w + 0.3 * rng.standard_normal(k) + 1e-3 * np.cumsum(rng.standard_normal((n, k)), axis=0)


KINDS = (*FILTERS, "heavy tails", "moved", "line")


def record(y: np.ndarray, **options) -> Record:
    axes = tuple(f"gyro_{a}" for a in "xyz"[: y.shape[1]])
    return Record("gyro", INTERVAL * np.arange(len(y)), y, axes, "rad/s", INTERVAL, **options)


def hidden(*effects, n=100_000, k=1, seed=0, kind="white") -> Record:
    rng = np.random.default_rng(seed)
    y = noise(kind, n, k, rng)
    block = Samples(INTERVAL * np.arange(n), y, INTERVAL)
    return record(hide(block, [(e, range(k)) for e in effects], rng).y)


def rejected(tests: tuple[DataQualityTest, ...]) -> list[str]:
    return [t.cause for t in tests if t.p_value < REJECTION_P_VALUE]


# ---- clean data


@pytest.mark.parametrize("kind", KINDS)
def test_clean_data_have_no_finding_for_any_noise_and_quantizer(kind):
    for seed, step in enumerate((0.0, 0.003, 0.05, 0.3, 0.7, 1.0, 1.4, 1.8)):
        tests = data_quality_tests(
            hidden(*([Quantizer(step)] if step else []), k=3, seed=seed, kind=kind, n=30_000)
        )
        assert rejected(tests) == []
        assert all(t.note is (step > 0) for t in tests if t.cause == "lattice")


def test_clean_simulated_sensors_have_no_finding_and_uniform_p_values():
    """40 sets: P(p < 0.05) of the duplicate and clipping tests below 0.22 (5 sd above nominal)."""
    model = NoiseModel([White(1e-3), BiasInstability(1e-4), RandomWalk(1e-6)])
    found: dict[str, list[float]] = {"duplicates": [], "clipping": []}
    for seed in range(40):
        step = 0.01 * float(np.exp(np.random.default_rng(seed).uniform(np.log(0.03), 0.0)))
        (gyro,), _ = simulate(
            {"gyro_x": Channel(model)},
            duration=300.0,
            rate=100.0,
            seed=seed,
            effects=[f"lattice:step={step}"],
        )
        tests = data_quality_tests(gyro)
        assert rejected(tests) == []
        for t in tests:
            found.get(t.cause, []).append(t.p_value)
    for p in found.values():
        assert np.mean(np.array(p) < 0.05) < 0.22


# ---- duplicates


def test_chance_equality_is_the_integral():
    for u in (0.1, 1.0, 4.0):
        numeric, _ = integrate.quad(lambda d, u=u: (1 - abs(d) / u) * stats.norm.pdf(d), -u, u)
        assert chance_equality(1.0, u) == pytest.approx(numeric, rel=1e-9)


@pytest.mark.parametrize("step", [0.0, 0.03, 0.3, 1.0])
@pytest.mark.parametrize("fraction", [0.03, 0.3, 0.9])
def test_repeated_samples_are_found_and_counted(step, fraction):
    effects = [Duplicates(fraction)] + ([Quantizer(step)] if step else [])
    tests = data_quality_tests(hidden(*effects, n=200_000, seed=int(100 * fraction)))
    assert rejected(tests) == ["duplicates"]
    (repeated,) = [t for t in tests if t.cause == "duplicates"]
    share = repeated.parameters["fraction"]
    # A share p of equal neighbours, fraction + (1 − fraction) g with g = step/(2 √π) by chance, has the sd √(p(1−p)/n):
    # one that needs g from the record, too, knows the fraction at most half as well. Six of the latter.
    by_chance = step / (2.0 * np.sqrt(np.pi))
    equal = fraction + (1.0 - fraction) * by_chance
    sd = np.sqrt(equal * (1.0 - equal) / 200_000) / (1.0 - by_chance)
    assert share.value == pytest.approx(fraction, abs=6.0 * 2.0 * sd)
    assert share.interval[1] - share.interval[0] > 0.7 * 2.0 * 1.96 * sd


def test_intervals_of_the_fraction_cover_it():
    """95 % nominal over 80 sets: 66 or more (below 2e-4 by the binomial)."""
    inside = 0
    for seed in range(80):
        rng = np.random.default_rng(seed)
        y = Duplicates(0.05).apply(
            Samples(np.arange(20_000.0), 0.2 * np.round(5 * rng.standard_normal((20_000, 1))), 1.0), rng
        )
        low, high = find_repeated_samples([y.y], [0.2]).interval
        inside += low <= 0.05 <= high
    assert inside >= 66


def test_samples_repeated_by_a_slow_register_are_found():
    """Every reading four times over: three quarters are repetitions, though lag 2 is equal half of the time."""
    y = np.repeat(noise("low-pass", 30_000, 1, np.random.default_rng(1)), 4, axis=0)
    repeated = find_repeated_samples([y], [0.0])
    assert repeated.p_value < 1e-20
    assert repeated.fraction == pytest.approx(0.75, abs=0.01)


def test_a_few_repeated_samples_are_found_where_chance_makes_none():
    """Two in 100 000: of all n²/2 pairs n are neighbours. Beside an equal pair elsewhere five are 9⁻⁵, by nine lags."""
    y = np.random.default_rng(8).standard_normal((100_000, 1))
    y[[900, 20_000]] = y[[899, 19_999]]
    assert find_repeated_samples([y], [0.0]).p_value == pytest.approx((2.0 / 100_000) ** 2, rel=0.02)
    y[[44_444, 71_000, 99_000, 5]] = y[[44_443, 70_999, 98_999, 300]]
    assert find_repeated_samples([y], [0.0]).p_value == pytest.approx(9.0**-5, rel=0.2)


def test_half_a_percent_of_repeats_on_a_quantizer_of_half_a_sd_is_beyond_chance():
    """f n (1 − g) over the sd √(g n) of what chance does, and little more: 7.4 less the cost of not knowing g.

    Over five records the mean deviate is known to 0.5; 4.6 requires four fifths of 7.4 within three of these.
    """
    deviates = []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        y = 0.5 * np.round(2.0 * rng.standard_normal((360_000, 1)))
        source = np.arange(len(y))
        source[1 + rng.choice(len(y) - 1, 1800, replace=False)] = 0
        deviates.append(find_repeated_samples([y[np.maximum.accumulate(source)]], [0.5]).statistic)
    assert np.mean(deviates) > 4.6


@pytest.mark.parametrize("pole", [0.0, 0.3])
@pytest.mark.parametrize("freedom", [5.0, np.inf])
def test_p_values_of_repeated_samples_are_uniform_on_a_fine_quantizer(pole, freedom):
    """Whatever the tails and the colour: below 1e-2 in at most 8 of 120 records (4e-6 by the binomial)."""
    rng, few = np.random.default_rng(6), 0
    for _ in range(120):
        w = rng.standard_t(freedom, 20_000) if np.isfinite(freedom) else rng.standard_normal(20_000)
        y = np.round(3.0 * lfilter([1.0], [1.0, -pole], w))
        few += find_repeated_samples([y[:, None]], [1.0]).p_value < 0.01
    assert few <= 8


def test_axes_that_repeat_together_make_one_finding_and_one_axis_alone_is_named():
    together = data_quality_tests(hidden(Duplicates(0.002), Quantizer(0.3), k=3, n=300_000))
    (only,) = [t for t in together if t.cause == "duplicates"]
    assert only.channels == ("gyro_x", "gyro_y", "gyro_z")
    assert only.parameters["fraction"].value == pytest.approx(0.002, abs=0.001)
    rng = np.random.default_rng(2)
    block = Samples(INTERVAL * np.arange(100_000), noise("white", 100_000, 3, rng), INTERVAL)
    y = hide(block, [(Duplicates(0.05), [1]), (Quantizer(0.1), [0, 1, 2])], rng).y
    assert [t.channels for t in data_quality_tests(record(y)) if t.p_value < REJECTION_P_VALUE] == [
        ("gyro_y",)
    ]


def test_a_low_pass_on_a_coarse_quantizer_is_no_repetition():
    """The trap: neighbours of low-pass noise are equal more often than samples two apart."""
    y = np.round(noise("low-pass", 300_000, 1, np.random.default_rng(3)))
    same1, same2 = (np.mean(y[lag:] == y[:-lag]) for lag in (1, 2))
    assert same1 > 1.1 * same2
    assert find_repeated_samples([y], [1.0]).p_value > 1e-3


# ---- clipping


@pytest.mark.parametrize("step", [0.0, 0.02, 0.2, 0.6])
@pytest.mark.parametrize("kind", ["white", "low-pass", "line"])
def test_rails_are_found_where_they_are(step, kind):
    """A rail that one sample in a thousand would cross."""
    clip = Clipping(high=float(np.quantile(hidden(n=300_000, kind=kind, seed=4).y, 0.999)))
    effects = [clip] + ([Quantizer(step)] if step else [])
    tests = data_quality_tests(hidden(*effects, n=300_000, kind=kind, seed=4))
    assert rejected(tests) == ["clipping"]
    (found,) = [t for t in tests if t.p_value < REJECTION_P_VALUE]
    assert set(found.parameters) == {"high", "fraction"}
    assert found.parameters["high"].value == pytest.approx(
        clip.high, abs=0.5 * step + 1e-12
    )  # the nearest code
    low, high = found.parameters["high"].interval
    assert low - 1e-12 <= clip.high <= high + 1e-12
    assert high - low == pytest.approx(step, abs=1e-9)


def test_expected_crossings_are_those_of_a_gaussian():
    """E = n Φ(−rail) for white noise: within 10 % of its value at 3 sd."""
    rng = np.random.default_rng(5)
    y = np.minimum(rng.standard_normal(400_000), 3.0)
    _, high = rails([y], 0.0)
    assert high.crossings == pytest.approx(400_000 * stats.norm.sf(3.0), rel=0.1)
    assert high.count == pytest.approx(400_000 * stats.norm.sf(3.0), rel=0.2)


def test_a_sd_inflated_by_a_coarse_quantizer_is_no_saturation():
    """The trap: on a lattice of 1.5 sd the rounding makes the sd look 10 % larger than it is."""
    for seed in range(10):
        y = 1.5 * np.round(np.random.default_rng(seed).standard_normal(300_000) / 1.5)
        assert min(rail.p_value for rail in rails([y], 1.5)) > 1e-3


def test_noise_of_lighter_tails_than_its_innovations_is_not_clipped():
    """The trap: an oscillation of bounded amplitude ends without a rail."""
    rng = np.random.default_rng(14)
    n = 300_000
    phase = np.cumsum(0.05 * rng.standard_normal(n)) + 2 * np.pi * 0.19 * np.arange(n)
    y = 2.0 * np.sin(phase) + rng.standard_normal(n)
    for step in (0.0, 0.02, 0.2, 0.6):
        z = step * np.round(y / step) if step else y
        assert min(rail.p_value for rail in rails([z], step)) > 1e-3


@pytest.mark.parametrize("step", [0.0, 1e-4])
def test_a_few_equal_spikes_are_no_rail(step):
    y = np.random.default_rng(15).standard_normal(50_000)
    y[[100, 20_000, 30_000, 40_000]] = 40.0
    coded = np.round(y / step) * step if step else y
    assert rails([coded], step)[1].p_value == 1.0


@pytest.mark.parametrize(("step", "beyond"), [(0.0, 4), (0.05, 12)])
def test_a_rail_that_is_reached_a_few_times_is_found(step, beyond):
    """Ties of that many outermost samples have a chance of 1e-10 and 1e-6 without it."""
    y = np.random.default_rng(16).standard_normal(200_000)
    y = np.minimum(step * np.round(y / step) if step else y, np.sort(y)[-beyond])
    y = step * np.round(y / step) if step else y
    low, high = rails([y], step)
    assert high.p_value < 1e-4
    assert low.p_value > 1e-3


def test_a_rail_is_found_beside_spikes_and_by_them():
    """Ten spikes, half of them end at the rail: the others show that the level is no glitch of one size."""
    rng = np.random.default_rng(17)
    y = rng.standard_normal(100_000)
    y[rng.choice(len(y), 12, replace=False)] = np.linspace(6.0, 40.0, 12)
    assert min(rail.p_value for rail in rails([y], 0.0)) > 1e-3
    assert rails([np.minimum(y, 25.0)], 0.0)[1].p_value < 1e-4
    assert rails([np.minimum(y, 3.9)], 0.0)[1].p_value < 1e-4


# ---- codes


@pytest.mark.parametrize("step", [1.0 / 131.0, 0.25, 1.3e-7])
def test_the_step_is_found_through_scale_decimals_and_sparse_codes(step):
    rng = np.random.default_rng(6)
    for width in (3.0, 40.0, 3000.0):
        y = step * np.round(width * rng.standard_normal(20_000))
        assert quantizer_step([y]) == pytest.approx(step, rel=1e-9)
    decimals = np.round(step * np.round(5.0 * rng.standard_normal(20_000)), 2 - int(np.floor(np.log10(step))))
    assert quantizer_step([decimals]) == pytest.approx(step, rel=0.01)


@pytest.mark.parametrize("offset", [0.0, 0.5, -9.80665 / 0.0024])
def test_bridged_samples_and_an_offset_do_not_hide_the_quantizer(offset):
    """A lattice on an offset of broken steps, with 1 % of interpolated samples: a note, no more."""
    rng = np.random.default_rng(13)
    y = 0.0024 * (np.round(4.0 * rng.standard_normal((100_000, 1))) + offset)
    middle = rng.choice(np.arange(1, 99_999, 2), 1000, replace=False)
    y[middle] = 0.5 * (y[middle - 1] + y[middle + 1])
    tests = data_quality_tests(record(y))
    assert rejected(tests) == []
    (test,) = [t for t in tests if t.cause == "lattice"]
    assert test.note
    assert test.parameters["step"].value == pytest.approx(0.0024, rel=1e-6)


def test_continuous_and_constant_data_have_no_step():
    assert quantizer_step([np.random.default_rng(7).standard_normal(50_000)]) == 0.0
    assert quantizer_step([np.full(100, 3.0)]) == 0.0


@pytest.mark.parametrize(("step", "note"), [(0.5, True), (1.9, True), (2.15, False), (4.0, False)])
def test_only_a_step_above_two_sd_is_a_finding(step, note):
    (test,) = [t for t in data_quality_tests(hidden(Quantizer(step), seed=8)) if t.cause == "lattice"]
    assert test.note is note
    assert (test.p_value < REJECTION_P_VALUE) is not note
    assert test.parameters["step"].value == pytest.approx(step)
    if note:
        assert test.statistic == pytest.approx(step, rel=0.05)


@pytest.mark.parametrize(
    ("step", "width"), [(0.02, 1.0), (0.02, 3.0), (0.1, 2.0), (0.5, 1.0), (0.5, 2.4), (1.0, 1.0)]
)
def test_dead_bands_are_found_with_their_width(step, width):
    rng = np.random.default_rng(9)
    block = Samples(np.arange(200_000.0), 0.1 + rng.standard_normal((200_000, 1)), 1.0)
    y = Quantizer(step, width * step).apply(block, rng).y[:, 0]
    codes = read_codes([y], quantizer_step([y]))
    assert codes.p_value < REJECTION_P_VALUE
    assert codes.deadband == pytest.approx(width * step, abs=(0.05 if step > 0.02 else 0.5) * step)


def test_a_code_that_never_comes_is_missed():
    y = np.round(10.0 * np.random.default_rng(10).standard_normal(100_000))
    y[y == 7] = 8.0
    codes = read_codes([y], 1.0)
    assert codes.missing == 1
    assert codes.p_value < REJECTION_P_VALUE
    assert codes.deadband == 0.0


def test_holes_that_are_narrow_against_the_noise_do_no_harm():
    """A lattice of 4.9 units that was printed in whole units: many codes are missing, none matters."""
    y = np.round(4.9 * np.round(200.0 * np.random.default_rng(16).standard_normal((100_000, 1))))
    assert rejected(data_quality_tests(record(y))) == []


# ---- order, edges


def test_repeated_samples_do_not_make_other_findings():
    for seed in range(5):
        assert rejected(data_quality_tests(hidden(Duplicates(0.9), Quantizer(0.01), seed=seed))) == [
            "duplicates"
        ]


def test_gaps_are_no_neighbours():
    """Equal samples on the two sides of a gap do not count."""
    y = np.random.default_rng(12).standard_normal((40_000, 1))
    y[200::200] = y[199:-1:200]
    cut = record(y, segments=tuple((i, i + 200) for i in range(0, 40_000, 200)))
    whole = record(y)
    assert rejected(data_quality_tests(whole)) == ["duplicates"]
    assert rejected(data_quality_tests(cut)) == []


@pytest.mark.parametrize("y", [np.zeros((500, 2)), np.ones((3, 1)), np.arange(40.0)[:, None]])
def test_records_without_noise_or_length_are_judged_without_fuss(y):
    assert rejected(data_quality_tests(record(y))) == []


def test_codes_of_uneven_width_are_reported_and_no_law_of_the_noise():
    """Widths that scatter by a third, on a step of 0.4 sd; laws with edges, tails and two humps have even codes."""
    rng = np.random.default_rng(22)
    n = 60_000
    white = rng.standard_normal(n)
    edges = np.cumsum(0.4 * np.maximum(1.0 + 0.33 * rng.standard_normal(200), 0.05))
    (uneven,) = rejected(
        data_quality_tests(record(0.4 * np.searchsorted(edges, white[:, None] + edges[100])))
    )
    assert uneven == "lattice"
    humps = white + 2.0 * rng.choice([-1.0, 1.0], n)
    for y in (white, rng.standard_t(4, n), rng.uniform(-2.0, 2.0, n), rng.standard_gamma(3.0, n), humps):
        assert read_codes([0.4 * np.round(y / 0.4)], 0.4).unevenness == 0.0


def test_a_law_of_samples_is_doubted_where_their_codes_may_differ_in_width():
    """Widths that scatter by a third, which 15 codes may not prove; codes of an sd, too few to show it.

    Not widths that are alike.
    """
    rng = np.random.default_rng(23)
    white = rng.standard_normal(60_000)
    doubted = 0
    for _ in range(10):
        edges = np.cumsum(0.35 * np.maximum(1.0 + 0.33 * rng.standard_normal(200), 0.05))
        doubted += may_be_uneven(0.35 * np.searchsorted(edges, white + edges[100]), 0.35)
    assert doubted == 10
    skewed = (rng.standard_gamma(6.0, 60_000) - 6.0) / np.sqrt(6.0)
    for y in (white, skewed):
        assert not any(may_be_uneven(step * np.round(y / step), step) for step in (0.05, 0.3, 0.5))
    assert may_be_uneven(np.round(white), 1.0)


@pytest.mark.parametrize(("step", "found"), [(1.2, []), (2.5, ["lattice"])])
def test_means_of_rounded_samples_in_single_precision_have_their_step_and_no_rails(step, found):
    """Means of two codes lie half a step apart and end where two samples happened to; steps in sds of the samples."""
    rng = np.random.default_rng(8)
    codes = (1e-3 * step * np.round((rng.standard_normal((400_000, 1)) + 0.3) / step)).astype(np.float32)
    means = record(0.5 * (codes[0::2].astype(float) + codes[1::2]), samples_a_mean=2)
    tests = data_quality_tests(means)
    assert rejected(tests) == found
    (codes_test,) = (test for test in tests if test.cause == "lattice")
    assert codes_test.parameters["step"].value == pytest.approx(1e-3 * step, rel=1e-4)


@pytest.mark.parametrize(("step", "seed"), [(0.15, 9), (0.188, 13), (0.515, 3)])
def test_the_steep_end_of_skewed_noise_is_no_rail(step, seed):
    """Gamma noise of skewness 0.8: some ten samples end it where a normal law has a thousand beyond."""
    rng = np.random.default_rng((77, seed))
    y = (rng.standard_gamma(6.0, 100_000) - 6.0) / np.sqrt(6.0) + rng.uniform()
    low, high = rails([step * np.round(y / step)], step)
    assert min(low.p_value, high.p_value) > 0.01
