"""Intervals of sizes stay positive; signals without noise are refused in one line.

Seeds are fixed and are the first that were tried.
"""

from __future__ import annotations

import warnings
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from models.effects import EFFECTS
from tuner.diagnosis import diagnose
from tuner.diagnosis.static.causes.base import Value
from tuner.diagnosis.static.channel import computed
from tuner.diagnosis.static.findings import alternatives, pooled
from tuner.diagnosis.static.model.fitted_channel import _crossing
from tuner.diagnosis.static.model.null_distributions import SLOW_RATIO_FACTOR
from tuner.types import Coefficient
from tuner.types.diagnosis import Alternative
from tuner.types.records import DataError, Record

INTERVAL, N = 0.01, 60_000


def record(y: np.ndarray) -> Record:
    axes = tuple(f"gyro_{a}" for a in "xyz"[: y.shape[1]])
    return Record("gyro", INTERVAL * np.arange(len(y)), y, axes, "rad/s", INTERVAL)


def coefficient(value: float, relative: float) -> Coefficient:
    return Value.log(value, relative, "s").coefficient("rad/s", 1.0)


@pytest.mark.parametrize("relative", [0.01, 0.5, 2.0])
def test_pooling_positive_numbers_is_that_of_their_logarithms(relative):
    """Scale does not matter, nor whether a time or its inverse is pooled; narrow intervals pool as they always did."""
    both = [coefficient(2.0, relative), coefficient(2.0 * (1.0 + 0.5 * relative), 2.0 * relative)]
    mean = pooled(both)
    assert 0.0 < mean.interval[0] < mean.value < mean.interval[1]
    inverse = pooled(
        [coefficient(1.0 / c.value, k * relative) for c, k in zip(both, (1.0, 2.0), strict=True)]
    )
    assert mean.value * inverse.value == pytest.approx(1.0)
    assert mean.interval[0] * inverse.interval[1] == pytest.approx(1.0)
    if relative < 0.1:
        weight = np.array([1.0 / (c.interval[1] - c.interval[0]) ** 2 for c in both])
        assert mean.value == pytest.approx(weight @ [c.value for c in both] / weight.sum(), rel=relative**2)


def test_numbers_of_either_sign_are_pooled_as_they_are_and_bounds_at_zero_are_kept():
    signed = [Value.of(0.1, 0.2).coefficient("", 1.0), Value.of(-0.1, 0.2).coefficient("", 1.0)]
    assert pooled(signed).value == pytest.approx(0.0)
    assert pooled(signed).interval[0] < 0.0
    bounded = [
        Value.of(0.1, 0.2).positive.coefficient("", 1.0),
        Value.of(0.2, 0.2).positive.coefficient("", 1.0),
    ]
    assert pooled(bounded).interval[0] >= 0.0


def test_a_mean_outside_the_interval_of_an_axis_is_not_its_number():
    """Of a filter with 17.9 ± 0.5, 32 (22 … 37) and 37 (22 … 37) Hz 18.2 was told of all three axes."""
    narrow, *wide = (
        Coefficient.known(*ends, "Hz")
        for ends in ((17.9, 17.4, 18.4), (32.2, 22.0, 37.0), (36.9, 22.0, 37.0))
    )
    assert pooled([narrow, *wide]) is narrow
    assert pooled(wide).value == pytest.approx(34.3, abs=0.5)


@pytest.mark.parametrize("drift", [1e-3, 0.5, 3.0, 1e4])
def test_a_widened_interval_keeps_a_size_positive(drift):
    wide = Value.log(1.5, 0.2).widened_by(drift)
    assert 0.0 < wide.lower < 1.5 < wide.upper
    near = Value.log(1.5, 0.002).widened_by(0.01)
    assert 1.5 - near.lower == pytest.approx(np.hypot(1.96 * 0.003, 0.01), rel=0.01)


def test_sizes_of_weak_findings_are_not_negative():
    """Three axes with a resonance and tails that are hardly there."""
    rng = np.random.default_rng(5)
    y = rng.standard_normal((N, 3)) + 0.09 * np.sin(60.0 * INTERVAL * np.arange(N))[:, None]
    y[rng.choice(N, 3)] += 9.0
    findings = diagnose(record(y)).findings
    assert {"line", "spikes"} <= {f.cause for f in findings}
    for finding in findings:
        for parameters in (finding.parameters, *finding.by_channel.values()):
            for name, value in parameters.items():
                if name in EFFECTS[finding.cause].positive:
                    assert value.interval[0] >= 0.0


@pytest.mark.parametrize(
    ("signal", "message"),
    [
        (lambda t: np.sin(2.0 * np.pi * 1.3 * t), "sinusoid of 1.3 Hz"),
        (lambda t: 9.8 + 1e-3 * np.sin(2.0 * np.pi * 0.02 * t + 1.0), "sinusoid of 0.02 Hz"),
        (lambda t: np.sin(2.0 * np.pi * 25.0 * t), "sinusoid of 25 Hz"),
        (lambda t: 1.0 - 1e-3 * t, "straight line"),
    ],
)
def test_a_signal_without_noise_is_refused_with_what_it_is(signal, message):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(DataError, match=message):
            diagnose(record(signal(INTERVAL * np.arange(N))[:, None]))


def test_other_axes_are_judged_beside_one_without_noise():
    y = np.random.default_rng(6).standard_normal((N, 2))
    y[:, 1] = np.sin(0.1 * np.arange(N))
    diagnosis = diagnose(record(y))
    assert set(diagnosis.models) == {"gyro_x"}
    assert any("gyro_y is a sinusoid" in note for note in diagnosis.notes)


def test_noise_of_a_millionth_is_noise():
    rng = np.random.default_rng(7)
    sine = np.sin(0.1 * np.arange(N))
    assert computed(sine) == pytest.approx(0.1 / (2.0 * np.pi))
    assert computed(sine + 1e-6 * rng.standard_normal(N)) is None
    assert computed(np.cumsum(np.cumsum(rng.standard_normal(N)))) is None


@pytest.mark.parametrize("step", [0.1, -0.1])
def test_an_interval_ends_where_a_quadratic_loss_says(step):
    """χ² of 95 % by the factor of slow templates: 1.96/√0.8 sds, found to a thirtieth of one."""
    end = _crossing(lambda size: ((size - 2.0) / 0.1) ** 2, 2.0, step)
    expected = float(np.sqrt(chi2.ppf(0.95, 1) / SLOW_RATIO_FACTOR))
    assert -1e-3 < (end - 2.0) / step - expected < 1.96 / 2**6 + 1e-3


def test_alternatives_of_equal_weight_keep_their_order():
    """Which came first hung on the hashes of their names, which differ from run to run."""
    names = ["unknown", "vibration", "line", "chirp", "lowpass", "telegraph", "step", "recovery"]
    found = SimpleNamespace(alternatives=tuple(Alternative(name, 1.0) for name in names))
    assert [one.cause for one in alternatives([found, found])] == names
