"""What no cause predicts is seen in the final residuals, and makes the name that explains a part of it uncertain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from models.probability import chi2_beyond
from tuner.diagnosis import diagnose
from tuner.diagnosis.static.causes.comb import Comb
from tuner.diagnosis.static.causes.line import Line
from tuner.diagnosis.static.causes.motion import Motion
from tuner.diagnosis.static.causes.periodic_variance import PeriodicVariance
from tuner.diagnosis.static.causes.spikes import Spikes
from tuner.diagnosis.static.causes.temperature import Temperature
from tuner.diagnosis.static.causes.warmup import Warmup
from tuner.diagnosis.static.channel import channel
from tuner.diagnosis.static.model.fitted_channel import fit_channel
from tuner.diagnosis.static.outcome import Accepted
from tuner.diagnosis.static.residual_checks import checks
from tuner.diagnosis.static.search import SearchResult
from tuner.diagnosis.static.something_else import groups, other_transient_lead, with_unknown
from tuner.types.records import Record

COUNT = 20_000
CHANCE = 1e-4
"""P-value that none of a few dozen tests falls below without a reason: one in five hundred does."""


def rng(*seed: int) -> np.random.Generator:
    return np.random.default_rng([18, *seed])


def record(y: np.ndarray) -> Record:
    return Record("gyro", 0.01 * np.arange(len(y)), 1e-3 * y[:, None], ("gyro_x",), "rad/s", 0.01)


def p_values(y: np.ndarray, *extensions: Line, step: float = 0.0) -> dict[str, float]:
    fitted = fit_channel(channel(record(y), "gyro_x", quantizer_step=1e-3 * step), extensions)
    return {test.cause: test.p_value for test in checks(fitted)}


def light_tails() -> np.ndarray:
    """Of kurtosis −2 · 0.36²."""
    return 0.6 * rng(1).choice([-1.0, 1.0], COUNT) + 0.8 * rng(2).standard_normal(COUNT)


def short_gusts() -> np.ndarray:
    """The sd changes every half second by a factor of two either way."""
    return rng(3).standard_normal(COUNT) * np.repeat(2.0 ** rng(4).uniform(-1.0, 1.0, COUNT // 50), 50)


def other_half() -> np.ndarray:
    """White at first, then the mean of two samples, of the same variance."""
    white = rng(5).standard_normal(COUNT + 1)
    mean = (white[1:] + white[:-1]) / np.sqrt(2.0)
    return np.where(np.arange(COUNT) < COUNT // 2, white[1:], mean)


def test_a_gap_is_no_misfit():
    """Where a fifth of the record moved, no means lie at zero and no spectrum changes."""
    moved = Motion(8_000, 12_000, values={}).including(8_000, 12_000, COUNT)
    fitted = fit_channel(channel(record(rng(6).standard_normal(COUNT)), "gyro_x"), (moved,))
    assert np.count_nonzero(~fitted.valid) >= 4_000
    assert min(test.p_value for test in checks(fitted)) > CHANCE


@pytest.mark.parametrize(
    ("made", "seen"), [(light_tails, "law"), (short_gusts, "squares"), (other_half, "spectrum in time")]
)
def test_each_check_sees_what_it_is_for(made, seen):
    assert p_values(made())[seen] < 1e-10


@pytest.mark.parametrize("step", [0.0, 0.4, 0.8])
def test_normal_noise_passes_all_checks_rounded_or_not(step):
    for seed in range(4):
        y = rng(6, seed).standard_normal(COUNT)
        found = p_values(step * np.round(y / step) if step else y, step=step)
        assert min(found.values()) > CHANCE
        assert ("law" in found) == (step < 0.5)


def test_codes_bend_the_law_of_no_long_record():
    """A bin of a histogram has other places in it than its middle where samples lie on codes."""
    y, step = rng(6).standard_normal(300_000), 0.37
    assert p_values(step * np.round(y / step), step=step)["law"] > CHANCE


def test_spikes_at_a_period_are_told_from_those_at_random():
    """Every 500 samples, one sample early or late; anywhere, alone and three in a row; within a tenth of the record."""
    anywhere = rng(15).choice(COUNT - 3, 40, replace=False)
    for places, clear in (
        (250 + 500 * np.arange(40) + rng(14).integers(-1, 2, 40), True),
        (anywhere, False),
        ((anywhere[:, None] + np.arange(3)).ravel(), False),
        (9000 + anywhere // 10, False),
        (anywhere // 10 + np.where(np.arange(40) < 20, 3000, 15_000), False),
    ):
        y = rng(16).standard_normal(COUNT)
        y[places] += 12.0
        fitted = fit_channel(channel(record(y), "gyro_x"), (Spikes(tuple(places.tolist())),))
        (p,) = (test.p_value for test in checks(fitted) if test.cause == "times of spikes")
        assert (p < 1e-8) == clear
        assert clear or p > CHANCE


def test_two_converters_in_turn_are_one_cause():
    """The variance of every second sample is e times that of the others: one period of two samples, of depth ½."""
    y = rng(17).standard_normal(COUNT) * np.exp(0.25 * (-1.0) ** np.arange(COUNT))
    (found,) = diagnose(record(y)).findings
    assert found.cause == "periodic_variance"
    assert found.parameters["period"].value == pytest.approx(0.02, rel=1e-6)
    assert found.parameters["depth"].value == pytest.approx(0.5, abs=0.05)


def test_the_variance_of_every_second_sample_has_one_degree_of_freedom():
    """The ordinate is the likelihood ratio of two sds, not twice that; its chance is at least that of χ²₁."""
    y = rng(22).standard_normal(COUNT) * np.exp(0.05 * (-1.0) ** np.arange(COUNT))
    found = PeriodicVariance.test(fit_channel(channel(record(y), "gyro_x")))
    halves = np.log(y.var()) - 0.5 * np.log(y[::2].var()) - 0.5 * np.log(y[1::2].var())
    ratio = 0.5 * COUNT * halves
    assert found.statistic == pytest.approx(ratio, rel=0.1)
    assert found.gain < ratio - 1.5 * np.log(COUNT)
    assert found.p_value > chi2_beyond(2.0 * ratio, 1)


def test_a_line_whose_phase_wanders_leaves_power_beside_it():
    t = np.arange(COUNT)
    line = Line(10.0, 0.0, 0.2)
    for size, clear in ((0.0, False), (0.02, True)):
        phase = 0.2 * np.pi * t + np.cumsum(size * rng(7).standard_normal(COUNT))
        p = p_values(rng(8).standard_normal(COUNT) + 0.2 * np.sin(phase), line)["beside lines"]
        assert (p < 1e-6) == clear
        assert clear or p > CHANCE


@pytest.mark.parametrize(("kinked", "clear"), [(False, False), (True, True)])
def test_a_bias_with_a_kink_in_temperature_is_more_than_a_slope(kinked, clear):
    felt = 25.0 + 10.0 * np.sin(4.0 * np.pi * np.arange(COUNT) / COUNT)
    read = felt + 0.02 * rng(13).standard_normal(COUNT)
    bias = 0.2 * np.maximum(felt - 27.0, 0.0) if kinked else 0.1 * felt
    made = replace(record(rng(9).standard_normal(COUNT) + bias), covariates={"temperature": read})
    found = checks(fit_channel(channel(made, "gyro_x"), (Temperature(),)))
    (p,) = (test.p_value for test in found if test.cause == "course")
    assert (p < 1e-8) == clear
    assert clear or p > CHANCE


def test_the_square_of_a_temperature_is_foretold_about_the_mean_it_was_found_with():
    """In the rest of the record the mean is another one, about which the square would have another slope."""
    felt = 25.0 + 10.0 * np.sin(5.0 * np.pi * np.arange(COUNT) / COUNT)
    made = record(rng(19).standard_normal(COUNT) + 0.01 * (felt - 22.0) ** 2)
    found = diagnose(replace(made, covariates={"temperature": felt + 0.02 * rng(20).standard_normal(COUNT)}))
    (square,) = (f for f in found.findings if f.cause == "temperature_squared")
    assert square.gain.split == "60/40"
    assert square.gain.nats > 5.0


def test_what_is_left_of_the_slow_part_puts_slow_lines_in_doubt():
    one = channel(record(rng(21).standard_normal(COUNT)), "gyro_x")
    edge = 0.5 / (one.block * one.interval)
    for slow, extension in (
        (True, Line(0.5 * edge, 0.0, 1.0)),
        (True, Comb(800.0, (0.0,) * 800, 0.0)),
        (False, Line(1.5 * edge, 0.0, 1.0)),
    ):
        assert ("slow part" in groups(extension, one)) == slow


def test_power_law_noise_is_no_certain_filter():
    """Noise f^(−1/2) bends the spectrum as a filter and a Gauss–Markov process together do, and as neither does."""
    wave = np.fft.rfft(rng(10).standard_normal(2 * COUNT))
    f = np.maximum(np.arange(COUNT + 1.0), 1.0) / COUNT
    y = rng(11).standard_normal(COUNT) + np.fft.irfft(wave * 0.6 * f**-0.25)[:COUNT]
    found = diagnose(record(y))
    assert found.findings
    assert all("unknown" in {a.cause for a in one.alternatives} for one in found.findings)


@pytest.mark.parametrize(("exponential", "expected"), [(False, 0.0), (True, -20.0)])
def test_a_change_of_slope_is_likelier_than_a_transient_where_it_is_one(exponential, expected):
    time = np.arange(COUNT) / COUNT
    course = 8.0 * np.exp(-time / 0.05) if exponential else 20.0 * np.maximum(0.4 - time, 0.0)
    fitted = fit_channel(channel(record(rng(14).standard_normal(COUNT) + course), "gyro_x"))
    found = Warmup.test(fitted)
    assert found is not None
    lead = other_transient_lead(fit_channel(fitted.channel, found.propose()), 0)
    assert lead < expected if exponential else lead > expected


def test_a_thermometer_that_errs_for_minutes_is_named_before_the_time():
    """The bias follows the true temperature, which the readings miss by 0.3 K for 10 s: a warm-up alone was named."""
    time = 0.01 * np.arange(COUNT)
    felt = 10.0 * -np.expm1(-time / 40.0)
    decay = np.exp(-0.001)
    error = lfilter([0.3 * np.sqrt(1.0 - decay**2)], [1.0, -decay], rng(20).standard_normal(COUNT))
    made = record(rng(16).standard_normal(COUNT) + 0.1 * felt)
    (finding,) = diagnose(replace(made, covariates={"temperature": 25.0 + felt + error})).findings
    assert finding.cause == "temperature"
    assert "warmup" in {a.cause for a in finding.alternatives}
    assert finding.parameters["slope"].value == pytest.approx(1e-4, rel=0.3)


def test_a_converter_without_some_codes_has_no_other_law():
    """Every eighth code takes the next one: the samples are skew for that reason alone."""
    code = np.round((rng(12).standard_normal(COUNT) + 3.3) / 0.5)
    found = diagnose(record(0.5 * (code + (code % 8 == 0))))
    assert [one.cause for one in found.findings] == ["lattice"]


def test_a_cause_that_gains_nothing_is_as_likely_something_else():
    """A finding without gain, beside a misfit of its part of the samples, divided by zero."""
    made = replace(
        record(rng(9).standard_normal(COUNT)), covariates={"temperature": rng(14).standard_normal(COUNT)}
    )
    final = fit_channel(channel(made, "gyro_x"), (Temperature(),))
    (misfit,) = (test for test in checks(final) if test.cause == "course")
    accepted = Accepted(final.extensions[0], replace(misfit, cause="temperature", gain=0.0))
    left = replace(misfit, gain=5.0, misfit=5.0)
    (found,) = with_unknown(SearchResult(final, final, (accepted,), (left,)))
    assert {one.cause: one.score for one in found.alternatives}["unknown"] == 1.0
