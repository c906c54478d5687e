"""What a configuration simulates has the findings again that the configuration was made from."""

from __future__ import annotations

import pytest

from models.effects.static import parse
from models.effects.static.temperature_profiles import Diurnal
from models.noise import BiasInstability, NoiseModel, White
from tuner.diagnosis import diagnose
from tuner.formats import noise_yaml
from tuner.identification import identify
from tuner.simulation.from_config import channels_of_config
from tuner.simulation.simulate_source import _profile, simulate_source
from tuner.simulation.static import simulate
from tuner.synthesis import synthesize
from tuner.synthesis.findings import findings_for_config
from tuner.types.config import ChannelNoise, FilterConfig, InitialUncertainty

NOISE = NoiseModel((White(1e-3), BiasInstability(1e-4)))
SD, STEP = 1e-3 * 50.0**0.5, 2.5e-3 * 50.0**0.5
HIDDEN = (
    "colour@gyro_x:ar=0.5/-0.3",
    "temperature@gyro_y:slope=3e-3",
    f"lattice@gyro_z:step={STEP}",
    f"clipping@accel_x:low={-3.0 * SD},high={3.2 * SD}",
    "timing@gyro_x+gyro_y+gyro_z+accel_x:gap_count=3",
)


@pytest.mark.slow
def test_findings_come_again(tmp_path):
    axes = ("gyro_x", "gyro_y", "gyro_z", "accel_x")
    records, _ = simulate(
        dict.fromkeys(axes, NOISE), duration=400.0, rate=50.0, seed=5, effects=HIDDEN,
        temperature=Diurnal(25.0, 8.0, period=270.0),
    )  # fmt: skip
    found = diagnose(records)
    before = {(f.cause, f.channels) for f in found.findings}
    assert before >= {
        ("colour", ("gyro_x",)), ("temperature", ("gyro_y",)), ("lattice", ("gyro_z",)), ("clipping", ("accel_x",)),
    }  # fmt: skip
    unit = synthesize(identify(records, arma=None), name="unit", findings=findings_for_config(found))
    noise_yaml.dump(unit, tmp_path / "noise.yaml")
    again = simulate_source(str(tmp_path / "noise.yaml"), duration=400.0, seed=6)
    assert {(f.cause, f.channels) for f in diagnose(again.data).findings} == before


def known(value: float, unit: str = "1") -> dict[str, object]:
    return {"value": value, "interval": [value, value], "upper": None, "unit": unit}


def finding(cause: str, axis: str, level: float | None = None, **values: float) -> dict[str, object]:
    extension = {} if level is None else {"level": level}
    parameters = {name: known(value) for name, value in values.items()}
    return {"cause": cause, "channels": [axis], "parameters": parameters, "extension": extension}


def test_findings_become_effects_as_they_were_found():
    """Lists number by number, rails about the level, one clock, noise before it was rounded, members of a family."""
    fitted = {
        "cause": "thermal_lag",
        "parameters": {"slope": {"value": 1e-4}, "time_constant": {"value": 5e3}},
    }
    noise = {axis: ChannelNoise(axis, "rad/s", 1e-3, (), 0.0, 0.02) for axis in ("gyro_x", "gyro_y")}
    config = FilterConfig(
        "unit", 0.02, noise, InitialUncertainty(1.0, 1.0, 0.1, 0.1), None,
        findings=(
            finding("colour", "gyro_x", ar_1=0.5, ar_2=-0.3),
            finding("clipping", "gyro_x", 0.5, low=0.48, high=0.53),
            finding("overflow", "gyro_x", 0.5, low=0.45, high=0.52),
            finding("lattice", "gyro_y", step=STEP),
            finding("timing", "gyro_x", gap_count=3.0),
            finding("timing", "gyro_y", gap_count=3.0),
            finding("motion", "gyro_x", start=3.0, duration=2.0, sd=0.1),
            {**finding("thermal", "gyro_y", sd=0.1), "extension": {"members": {"gyro_y": fitted}}},
        ),
    )  # fmt: skip
    channels, effects, notes = channels_of_config(config)
    assert notes == ()
    made = {one.effect.name: one for one in effects}
    assert sorted(one.effect.name for one in effects) == [
        "clipping",
        "colour",
        "lattice",
        "motion",
        "overflow",
        "thermal_lag",
        "timing",
    ]
    assert made["thermal_lag"].effect.time_constant == 5e3
    assert made["colour"].effect.ar == (0.5, -0.3)
    assert (made["clipping"].effect.low, made["clipping"].effect.high) == pytest.approx((-0.02, 0.03))
    assert (made["overflow"].effect.low, made["overflow"].effect.high) == pytest.approx((-0.05, 0.02))
    assert (channels["gyro_x"].bias_sd, channels["gyro_y"].bias_sd) == (0.0, 0.02)
    assert set(made["timing"].axes) == {"gyro_x", "gyro_y"}
    assert isinstance(
        _profile(effects, 100.0), Diurnal
    )  # a warm-up beside a warming box would be its temperature
    (white,) = [t for t in channels["gyro_y"].model.terms if isinstance(t, White)]
    assert white.density**2 == pytest.approx(1e-6 - STEP**2 * 0.02 / 12.0)


def test_what_happened_beyond_a_shorter_simulation_is_left_out_and_said(tmp_path):
    noise = {axis: ChannelNoise(axis, "rad/s", 1e-3, (), 0.0, 0.02) for axis in ("gyro_x", "gyro_y")}
    moved = [finding("motion", axis, start=269.5, duration=2.0, sd=0.1) for axis in noise]
    early = finding("motion", "gyro_x", start=3.0, duration=2.0, sd=0.1)
    config = FilterConfig(
        "unit", 0.02, noise, InitialUncertainty(1.0, 1.0, 0.1, 0.1), None, findings=(*moved, early)
    )
    noise_yaml.dump(config, tmp_path / "noise.yaml")
    made = simulate_source(str(tmp_path / "noise.yaml"), duration=20.0, seed=1)
    assert len(made.key["hidden"]) == 1
    (note,) = made.notes
    assert note.startswith("motion in gyro_x, gyro_y is left out: at 269.5 s of its log, beyond the 20 s")
    assert len(simulate_source(str(tmp_path / "noise.yaml"), duration=300.0, seed=1).key["hidden"]) == 3


def test_whole_numbers_may_be_written_with_a_point():
    assert parse("timing:gap_count=3.0") == parse("timing:gap_count=3")
    with pytest.raises(ValueError, match="must be an integer"):
        parse("timing:gap_count=3.5")
