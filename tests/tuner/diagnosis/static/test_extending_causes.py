"""A cause of another package: hidden, found, named, sized and measured from one declaration of forty lines."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from models.effects import EFFECTS, Samples
from models.effects.static.temperature_profiles import Diurnal
from models.noise import BiasInstability, NoiseModel, White
from models.registry import RegistryError
from tuner.diagnosis import diagnose
from tuner.diagnosis.cause import Cause
from tuner.diagnosis.static.causes.registry import CAUSES, CauseRegistry, lacking
from tuner.diagnosis.static.causes.template import Template
from tuner.report.static_diagnosis_figures import finding_figures
from tuner.simulation.static import simulate

EXAMPLE = Path(__file__).with_name("temperature_swing_cause.py")
NOISE = NoiseModel((White(1e-4), BiasInstability(1e-5)))
SLOPE = 4e-3


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Install the example as pip would, for one test."""
    (tmp_path / "temperature_swing_cause.py").write_text(EXAMPLE.read_text())
    facts = tmp_path / "rate-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: rate\nVersion: 1.0\n")
    (facts / "entry_points.txt").write_text(
        "[tuner.causes]\ntemperature_swing = temperature_swing_cause:TemperatureSwing\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    for registry in (CAUSES, EFFECTS):
        monkeypatch.setattr(registry, "_declared", dict(registry._declared))
        monkeypatch.setattr(registry, "_entry_points_loaded", False)
    yield
    sys.modules.pop("temperature_swing_cause", None)


def swing_log(seed: int = 0, swing: float = 0.0, rate: float = 0.0) -> tuple:
    """Simulate two hours of one axis whose bias follows dT/dt, alone and times T."""
    clean, _ = simulate(
        {"gyro_x": NOISE},
        duration=7200.0,
        rate=20.0,
        seed=seed,
        temperature=Diurnal(30.0, 5.0, period=1800.0),
    )
    (record,) = clean
    true = Diurnal(30.0, 5.0, period=1800.0).celsius(record.t)
    y = record.y + ((rate + swing * (true - true.mean())) * np.gradient(true, record.interval))[:, None]
    return (type(record)(**{**vars(record), "y": y}),)


def test_the_example_is_one_file_of_forty_lines() -> None:
    assert len(EXAMPLE.read_text().splitlines()) <= 40


@pytest.mark.usefixtures("package")
def test_a_cause_of_another_package_is_hidden_found_named_and_sized() -> None:
    records, key = simulate(
        {"gyro_x": NOISE}, duration=7200.0, rate=20.0, seed=0, temperature=Diurnal(30.0, 5.0, period=1800.0),
        effects=(f"temperature_swing:slope={SLOPE}",),
    )  # fmt: skip
    assert [h["cause"] for h in key["hidden"]] == ["temperature_swing"]
    np.testing.assert_allclose(records[0].y, swing_log(swing=SLOPE)[0].y, atol=1e-15)
    diagnosis = diagnose(records)
    (finding,) = diagnosis.findings
    assert finding.cause == "temperature_swing"
    low, high = finding.parameters["slope"].interval
    assert low < SLOPE < high
    assert high - low < 0.2 * SLOPE
    assert finding.parameters["slope"].unit == "rad/s·s/K²"
    assert finding.gain.nats > 10.0
    t, celsius = records[0].t, records[0].covariates["temperature"]
    samples = Samples(t, records[0].y[:, :1], records[0].interval, celsius)
    drawn = EFFECTS["temperature_swing"].drawn({"slope": 2.0}, samples)
    away = celsius - celsius.mean()
    np.testing.assert_allclose(drawn, 2.0 * away * np.gradient(away, records[0].interval))
    (sketch,) = finding_figures(records, diagnosis)
    assert list(sketch.files((".svg",))) == ["finding-1-temperature_swing.svg"]


@pytest.mark.usefixtures("package")
def test_a_further_cause_takes_its_share_of_the_false_alarms() -> None:
    before = sum(
        c.shares * c.tests
        for c in CAUSES.values()
        if c.tested_with is None and c.cause not in ("temperature", "temperature_swing")
    )
    assert CAUSES.shares() == before + CAUSES["temperature"].shares + CAUSES["temperature_swing"].shares


def test_a_bias_that_follows_the_rate_of_the_temperature_is_no_lag_of_hours() -> None:
    """Under a single sinusoid both are one function; the rate has a parameter less, and the lag is its alternative."""
    diagnosis = diagnose(swing_log(rate=1e-2))
    (finding,) = diagnosis.findings
    assert finding.cause == "temperature_rate"
    low, high = finding.parameters["slope"].interval
    assert low < 1e-2 < high
    assert high - low < 0.3e-2
    assert finding.gain.nats > 10.0


def test_a_lag_that_is_known_keeps_its_name() -> None:
    records, _ = simulate(
        {"gyro_x": NOISE}, duration=7200.0, rate=20.0, seed=1, temperature=Diurnal(30.0, 5.0, period=1800.0),
        effects=("thermal_lag:slope=2e-5,time_constant=200",),
    )  # fmt: skip
    (finding,) = diagnose(records).findings
    assert finding.cause == "thermal_lag"
    low, high = finding.parameters["time_constant"].interval
    assert low < 200.0 < high


def test_an_incomplete_or_contradicting_declaration_is_refused_in_one_line() -> None:
    registry = CauseRegistry("cause", "tuner.no_causes", base=Cause, effects=EFFECTS, lacking=lacking)

    class Wordless(Cause):
        cause = "wordless"

    class Other(CAUSES["line"]):
        cause = "other"

    with pytest.raises(
        RegistryError, match=r"^cause 'wordless': the class needs meaning, consequence, group$"
    ):
        registry.add(Wordless)
    with pytest.raises(
        RegistryError, match=r"^cause 'other': its effect has the code 'line'; give both the same$"
    ):
        registry.add(Other)

    class Shapeless(Template):
        cause = "shapeless"
        meaning = consequence = "none"

    with pytest.raises(
        RegistryError, match=r"^cause 'shapeless': the class needs size, statistic, template$"
    ):
        registry.add(Shapeless)
    with pytest.raises(RegistryError, match=r"^unknown cause 'lin' \(did you mean 'line'\?\); known are "):
        CAUSES["lin"]
