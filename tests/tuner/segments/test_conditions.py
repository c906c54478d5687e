"""Parts of a log under one condition: cut where it changes, and compared."""

import json
from dataclasses import replace

import numpy as np
import pytest

from tuner.cli import run
from tuner.formats.logs import write_log
from tuner.identification import identify
from tuner.identification.comparison import compare_identifications
from tuner.judgement import Settings, judge_noise, judge_settings
from tuner.pipeline import tune
from tuner.segments.conditions import at_rest, expect_rest, still_parts, temperature_parts
from tuner.synthesis import synthesize
from tuner.types.judgement import Use
from tuner.types.records import DataError, Record

RATE = 50.0
AXES = ("gyro_x", "gyro_y", "gyro_z")


def moved(seed=1, loud=2.0):
    """Two stretches at rest of 200 s, parted by 20 s of turning; the second is louder by a factor."""
    rng = np.random.default_rng(seed)
    n = 21_000
    y = 1e-3 * rng.standard_normal((n, 3))
    y[10_000:11_000] += 0.5
    y[11_000:] *= loud
    return Record("gyro", np.arange(n) / RATE, y, AXES, "rad/s", 1 / RATE, source="unit.csv")


def warmed(seed=2, n=60_000):
    """A log that warms up by 20 K, its noise growing from 1 to 2."""
    celsius = np.linspace(20.0, 40.0, n)
    y = 1e-3 * (celsius[:, None] / 20.0) * np.random.default_rng(seed).standard_normal((n, 3))
    return Record(
        "gyro", np.arange(n) / RATE, y, AXES, "rad/s", 1 / RATE, covariates={"temperature": celsius}
    )


def test_only_what_stands_still_is_kept_and_said():
    said = []
    (kept,) = at_rest([moved(loud=1.1)], said.append)
    turning = (kept.t >= 200.0) & (kept.t < 220.0)
    inside = np.zeros(len(kept), dtype=bool)
    for start, stop in kept.segments:
        inside[start:stop] = True
    assert not np.any(inside & turning)
    assert inside.mean() > 0.9
    assert len(said) == 1
    assert "moved" in said[0]


def test_a_sensor_that_stopped_is_at_rest_while_it_measured():
    """Rates of zero from the middle on were taken for the rest of a log, and the sensor for one that never varied."""
    log = moved(loud=1.0)
    y = 1e-3 * np.random.default_rng(4).standard_normal(log.y.shape)
    y[12_600:] = 0.0
    said = []
    (kept,) = at_rest([replace(log, y=y)], said.append)
    assert kept.segments == ((0, 12_600),)
    assert said == ["gyro x y z: frozen for 168 s of 420 s, left out"]


def test_one_axis_that_stopped_ends_the_measurement_of_its_sensor():
    """The part in which an axis gave one value was the quietest and taken for the rest, which held no noise of it."""
    log = moved(loud=1.0)
    y = np.round(np.random.default_rng(4).standard_normal(log.y.shape) / 0.05) * 5e-5
    y[10_000:, 1] = y[10_000, 1]
    (kept,) = at_rest([replace(log, y=y)])
    assert kept.segments == ((0, 10_000),)
    assert kept.contradicted == ("gyro y: frozen for 220 s of 420 s",)


def test_a_log_at_rest_is_left_alone():
    record = warmed()
    assert at_rest([record]) == (record,)


def test_sensors_on_clocks_of_their_own_are_judged_apart():
    still = replace(
        moved(), t=moved().t + 0.1, y=1e-3 * np.random.default_rng(9).standard_normal((21_000, 3))
    )
    first, second = at_rest([moved(loud=1.1), still])
    assert len(first.segments) == 2
    assert second.segments == still.segments


def test_stretches_at_rest_differ_by_the_ratio_of_their_noise():
    parts = still_parts([moved(loud=2.0)])
    assert len(parts) == 2
    found = compare_identifications([p.name for p in parts], [identify(p.records, arma=None) for p in parts])
    for rows in found.axes.values():
        row = next(r for r in rows if r.name == "white.density")
        # sd(ln N) = 1/√(2n) = 0.7 % a part, 1 % for the ratio: five of them.
        assert row.ratio == pytest.approx(2.0, rel=0.05)
        assert row.differs


def test_bins_of_temperature_are_ordered_and_share_the_samples():
    log = warmed()
    parts = temperature_parts([replace(log, y=log.y[:, :1], axes=AXES[:1])])
    counts = [sum(b - a for a, b in part.records[0].segments) for part in parts]
    assert max(counts) - min(counts) < 0.02 * sum(counts)
    means = []
    for part in parts:
        (record,) = part.records
        chosen = np.concatenate([np.arange(a, b) for a, b in record.segments])
        means.append(record.covariates["temperature"][chosen].mean())
    assert means == sorted(means)
    found = compare_identifications([p.name for p in parts], [identify(p.records, arma=None) for p in parts])
    row = next(r for r in found.axes["gyro_x"] if r.name == "white.density")
    # Noise of the bins: root mean squares of T/20 over thirds of 20 … 40 °C.
    rms = [np.sqrt(np.mean(np.linspace(a, b, 999) ** 2)) for a, b in ((20.0, 26.667), (33.333, 40.0))]
    assert row.ratio == pytest.approx(rms[1] / rms[0], rel=0.05)
    assert row.ratio_interval[0] < row.ratio < row.ratio_interval[1]


def test_a_mean_that_moved_is_said_without_a_ratio():
    rng = np.random.default_rng(5)
    logs = []
    for offset in (0.0, 1e-3):
        y = offset + 1e-3 * rng.standard_normal((20_000, 1))
        logs.append(
            identify([Record("gyro", np.arange(20_000) / RATE, y, AXES[:1], "rad/s", 1 / RATE)], arma=None)
        )
    row = next(r for r in compare_identifications(["off", "on"], logs).axes["gyro_x"] if r.name == "mean")
    assert row.ratio is None
    assert row.differs


@pytest.mark.parametrize(
    ("record", "part", "word"),
    [
        (warmed(), still_parts, "two or more stretches"),
        (moved(), temperature_parts, "temperature"),
        (
            replace(warmed(), covariates={"temperature": np.full(60_000, 21.0)}),
            temperature_parts,
            "stays within",
        ),
    ],
)
def test_a_log_without_parts_is_refused(record, part, word):
    with pytest.raises(DataError, match=word):
        part([record])


def test_the_command_compares_the_parts_of_one_log(tmp_path, capsys):
    path = tmp_path / "warm.npz"
    write_log([warmed(n=30_000)], path)
    assert run(["compare", str(path), "--by", "temperature", "--json", "-", "--quiet"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found["sources"]) == 3
    assert found["sources"][0].endswith("°C")
    assert found["channels"]["gyro_x"]["coefficients"]["white.density"]["differs"]
    assert run(["compare", str(path), "--by", "still", "--quiet"]) == 2
    assert run(["compare", str(path), str(path), "--by", "still", "--quiet"]) == 2
    assert run(["compare", "mpu9250", "--by", "still", "--quiet"]) == 2
    assert capsys.readouterr().err.count("\n") == 3


def test_parts_too_short_for_a_filter_are_refused():
    """An interrupted log of 6.6 s in 300 parts of 0.02 s gave a filter settings of a bias that nobody saw."""
    n = 2000
    y = 1e-3 * np.random.default_rng(3).standard_normal((n, 3))
    whole = Record("gyro", np.arange(n) / 250.0, y, AXES, "rad/s", 1 / 250.0, source="unit.csv")
    pieces = replace(whole, segments=tuple((k, k + 5) for k in range(0, n, 6)))
    with pytest.raises(DataError, match=r"make up 8 s, found 6\.68 s in 334 parts, the longest 0\.02 s: "):
        tune([pieces])
    noise = identify([replace(whole, segments=((0, 200), (250, 450)))], arma=None)
    assert judge_noise(noise).text.startswith(
        "usable except: settings of a filter, which need parts of 1 s or more"
    )
    assert judge_settings(Settings(noise, synthesize(noise))).use is Use.DO_NOT_USE
    assert judge_noise(identify([whole], arma=None)).use is Use.USABLE
    expect_rest([whole])  # eight seconds
    expect_rest([replace(whole, segments=((0, 500), (500, 1000), (1000, 2000)))])
    with pytest.raises(DataError, match=r"the longest 0\.8 s"):
        expect_rest([replace(whole, segments=tuple((k, k + 200) for k in range(0, n, 200)))])
