"""Which units of a fleet stand apart, keep their limits and how far they differ: laws on measurements made up here."""

import math
import re

import numpy as np
import pytest

from models.units import to_si
from tuner.production.fleet import judged
from tuner.production.limits import judge, read_limits
from tuner.production.outliers import FALSE_NAMING, units_apart
from tuner.production.spread import spread
from tuner.report.fleet_answer import fleet_answer, reasons
from tuner.types import Coefficient
from tuner.types.fleet import Fleet, FleetUnit, UnitMeasurement
from tuner.types.records import DataError

DENSITY = to_si(0.2, "deg/sqrt(h)")
LIMITS = "format: tuner-limits/1\ngyro: {N: 0.2 deg/√h, B: 5 °/h}\n"


def _normal_fleet(rng, units, quantities):
    draws = rng.standard_normal((units, quantities))
    return {
        i: UnitMeasurement(
            "", 1.0, 1.0, {f"g{j}": "rad/s" for j in range(quantities)},
            {f"g{j}.mean": Coefficient.known(x, x - 0.01, x + 0.01, "rad/s") for j, x in enumerate(row)},
        )
        for i, row in enumerate(draws)
    }  # fmt: skip


@pytest.mark.parametrize(("units", "quantities"), [(8, 6), (40, 6)])
def test_a_sound_fleet_is_rarely_accused(units, quantities):
    rng, fleets = np.random.default_rng(17), 400
    accused = sum(bool(units_apart(_normal_fleet(rng, units, quantities)).outliers) for _ in range(fleets))
    assert accused <= FALSE_NAMING * fleets + 5 * math.sqrt(FALSE_NAMING * fleets)


def test_a_unit_ten_standard_deviations_off_is_named():
    one = _normal_fleet(np.random.default_rng(2), 40, 6)
    off = Coefficient.known(10.0, 9.99, 10.01, "rad/s")
    one[3] = UnitMeasurement("", 1.0, 1.0, one[3].units, {**one[3].quantities, "g2.mean": off})
    found = units_apart(one)
    assert list(found.outliers) == [3]
    assert found.outliers[3][0].quantity == "g2.mean"


@pytest.mark.parametrize(("factor", "named"), [(3.0, False), (1.0 / 0.3048, True)])
def test_another_sensor_is_not_called_a_mistaken_unit(factor, named):
    """Of seven units the threshold is dozens of sds: an accelerometer three times as noisy was said to be in ft/s²."""
    units = {f"accel_{axis}": "m/s^2" for axis in "xyz"}

    def unit(number):
        densities = np.random.default_rng(number).normal(1e-3, 5e-6, 3) * (factor if number == 6 else 1.0)
        noise = {
            f"{axis}.N": Coefficient.known(x, 0.99 * x, 1.01 * x, "")
            for axis, x in zip(units, densities, strict=True)
        }
        return UnitMeasurement("", 1.0, 1.0, units, noise)

    found = units_apart({number: unit(number) for number in range(7)})
    assert list(found.outliers) == [6]
    assert ("ft/s^2" in str(found.advice.get(6))) == named


def test_axes_that_break_one_limit_share_a_line(tmp_path):
    path = tmp_path / "limits.yaml"
    path.write_text(LIMITS)
    units = {f"gyro_{axis}": "rad/s" for axis in "xyz"}
    sizes = (to_si(x, "deg/√h") for x in (0.3, 0.1, 0.5))
    noise = {f"{axis}.N": Coefficient.known(x, x, x, "") for axis, x in zip(units, sizes, strict=True)}
    failed, _ = judge(UnitMeasurement("", 1.0, 1.0, units, noise), read_limits(path))
    assert failed[0] == "gyro x z N 0.300 to 0.500 > 0.200 deg/√h"


def test_a_unit_three_times_as_noisy_in_several_axes_is_one_line():
    rng = np.random.default_rng(8)
    axes = {f"gyro_{axis}": "rad/s" for axis in "xyz"}

    def unit(factor):
        sizes = {f"{a}.{s}": factor * x for a in axes for s, x in (("N", 1e-4), ("sigma_10s", 3e-5))}
        noise = {q: x * math.exp(0.01 * rng.standard_normal()) for q, x in sizes.items()}
        known = {q: Coefficient.known(x, 0.999 * x, 1.001 * x, "rad/s") for q, x in noise.items()}
        return UnitMeasurement("", 1.0, 1.0, axes, known)

    measured = [unit(3.0 if k == 7 else 1.0) for k in range(20)]
    found = units_apart(dict(enumerate(measured)))
    units = [
        FleetUnit(
            f"u{k}", f"u{k}.csv", one, outliers=found.outliers.get(k, ()), advice=found.advice.get(k, ())
        )
        for k, one in enumerate(measured)
    ]
    lot = Fleet("lot", tuple(units), (), channel_units=axes, comparisons=found.comparisons)
    (line,) = reasons(units[7], lot)
    # Factors of 3 known to 1 %, and the median of twenty: 2.9 to 3.1.
    assert re.match(
        r"gyro: white noise of x y z .*, (2\.9|3\.0|3\.1) ×.*, Allan deviation at 10 s of x y z .*, (2\.9|3\.0|3\.1) ×",
        line,
    )


def test_a_log_that_ended_early_is_named_and_does_not_pass(tmp_path):
    """A file cut off after 0.4 s of 180 passed its limits."""
    path = tmp_path / "limits.yaml"
    path.write_text("format: tuner-limits/1\ngyro: {N: 0.6 deg/√h}\n")
    n = to_si(0.42, "deg/√h")
    rows = []
    for k in range(8):
        noise = {"gyro_x.N": Coefficient.known(n, 0.9 * n, 1.1 * n, "")}
        one = UnitMeasurement("", 50.0, 0.4 if k == 3 else 180.0 + k, {"gyro_x": "rad/s"}, noise)
        rows.append(FleetUnit(f"u{k}", f"u{k}.csv", one))
    units = judged("lot", rows, read_limits(path)).units
    assert [unit.verdict for unit in units] == ["PASS"] * 3 + ["OPEN"] + ["PASS"] * 4
    assert "0.4 s" in units[3].advice[0]
    assert not any(unit.advice for unit in units if unit.name != "u3")


def test_too_few_units_are_not_judged():
    """Of four units one had eight times the noise: PASS, none stands apart."""
    measured = _normal_fleet(np.random.default_rng(2), 5, 6)
    assert units_apart(measured).comparisons == 0
    lot = judged("lot", [FleetUnit(f"u{i}", f"u{i}.csv", one) for i, one in measured.items()], ())
    said = "Verdict: OPEN: the 5 units in lot are too few to say which stand apart (6 are needed)"
    assert fleet_answer(lot).parts[0].startswith(said)


def test_spread_needs_two_units():
    assert spread([]) == {}
    assert spread(list(_normal_fleet(np.random.default_rng(2), 1, 2).values())) == {}


def test_intervals_of_the_spread_cover_it_as_often_as_they_say():
    rng, covered, fleets = np.random.default_rng(29), 0, 300
    for _ in range(fleets):
        values = DENSITY * np.exp(0.1 * rng.standard_normal(10) + 0.05 * rng.standard_normal(10))
        found = [
            _measured(N=Coefficient.known(v, v * math.exp(-0.098), v * math.exp(0.098), "rad/s^0.5"))
            for v in values
        ]
        one = spread(found)["gyro_x.N"].spread
        low, high = one.interval or (0.0, one.upper)
        covered += low <= 0.1 <= high
    assert abs(covered / fleets - 0.95) < 5 * math.sqrt(0.95 * 0.05 / fleets)


def _measured(**found):
    return UnitMeasurement("", 1.0, 1.0, {"gyro_x": "rad/s"}, {f"gyro_x.{k}": v for k, v in found.items()})


@pytest.mark.parametrize(
    ("density", "bias", "verdict"),
    [
        (Coefficient.known(0.19, 0.18, 0.20, ""), Coefficient.bounded(4.0, "", "absent"), "PASS"),
        (Coefficient.known(0.21, 0.201, 0.22, ""), Coefficient.bounded(4.0, "", "absent"), "FAIL"),
        (Coefficient.known(0.19, 0.18, 0.20, ""), Coefficient.bounded(6.0, "", "absent"), "OPEN"),
        (Coefficient.known(0.21, 0.201, 0.22, ""), Coefficient.bounded(6.0, "", "absent"), "FAIL"),
        (Coefficient.known(0.21, 0.19, 0.23, ""), Coefficient.bounded(4.0, "", "absent"), "OPEN"),
        (Coefficient.known(0.19, 0.18, 0.20, ""), None, "OPEN"),
    ],
)
def test_limits_are_kept_broken_or_left_open(tmp_path, density, bias, verdict):
    path = tmp_path / "limits.yaml"
    path.write_text(LIMITS)
    limits = read_limits(path)

    def si(c, unit):
        if c is None:
            return None
        return Coefficient(
            None if c.value is None else to_si(c.value, unit),
            None if c.interval is None else tuple(to_si(end, unit) for end in c.interval),
            None if c.upper is None else to_si(c.upper, unit),
            "",
        )

    found = {"N": si(density, "deg/√h"), "B": si(bias, "deg/h")}
    failed, unclear = judge(_measured(**{k: v for k, v in found.items() if v is not None}), limits)
    assert verdict == ("FAIL" if failed else "OPEN" if unclear else "PASS")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("gyro: {N: 0.2 deg/√h}\n", "format: tuner-limits/1"),
        ("format: tuner-limits/1\n", "a limit"),
        ("format: tuner-limits/1\ngyro: {M: 0.2 deg/√h}\n", "'M'"),
        ("format: tuner-limits/1\ngyro: {N: 0.2}\n", "gyro"),
        ("format: tuner-limits/1\ngyro: {N: -1 deg/√h}\n", "a positive number"),
        ("format: tuner-limits/1\ngyro: {N: 0.2 µg}\n", "deg/h^0.5"),
        ("format: tuner-limits/1\ngyro: {N: 0.2 deg/√h\n", "line"),
    ],
)
def test_wrong_limits_are_refused_in_one_line(tmp_path, text, said):
    path = tmp_path / "limits.yaml"
    path.write_text(text)
    with pytest.raises(DataError) as caught:
        read_limits(path)
    assert said in str(caught.value)
    assert "limits.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)
