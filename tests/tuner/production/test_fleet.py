"""A fleet of twelve simulated units: taken up after a kill, a bad log, a mistaken unit, the spread, the same bytes."""

import math
import os
import re
import signal
import sys
from operator import attrgetter
from types import SimpleNamespace

import numpy as np
import pytest

from models.noise import NoiseModel, White
from models.units import to_si
from tuner.catalogue.datasheet_format import parse_sheet
from tuner.cli import run
from tuner.formats.logs import write_log
from tuner.production import unit as unit_module
from tuner.production.fleet import fleet, judged, output_folder, unit_names
from tuner.production.limits import judge, read_limits
from tuner.production.outliers import FALSE_NAMING, units_apart
from tuner.production.spread import grade_yaml, spread
from tuner.production.workers import outcomes
from tuner.report.fleet_files import write_fleet
from tuner.report.fleet_tables import reasons
from tuner.simulation.static import Channel, simulate
from tuner.types import Coefficient
from tuner.types.fleet import Fleet, FleetUnit, UnitMeasurement
from tuner.types.records import DataError

DENSITY = to_si(0.2, "deg/sqrt(h)")
RELATIVE_SD = 0.1
"""Unit-to-unit sd of the logarithm of N in the simulated fleet: large beside the error of 1 % of a log."""
FACTORS = np.exp(RELATIVE_SD * np.random.default_rng(3).standard_normal((12, 3)))
"""N of each axis of each unit, relative to that of the sensor."""
WRONG, BAD = 4, 7
"""Units whose log has deg/s under the name rad/s, and text among its numbers."""


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet") / "lot"
    folder.mkdir()
    for index, row in enumerate(FACTORS):
        of_axis = {
            f"gyro_{a}": Channel(NoiseModel((White(DENSITY * f),)), 1e-4)
            for a, f in zip("xyz", row, strict=True)
        }
        records, _ = simulate(of_axis, duration=100.0, rate=50.0, seed=index)
        path = folder / f"SN{index:02d}.csv"
        write_log(records, path)
        if index == WRONG:
            head, *lines = path.read_text().splitlines()
            cells = [[float(x) for x in line.split(",")] for line in lines]
            turned = [",".join(map(repr, [c[0], *(math.degrees(x) for x in c[1:4]), *c[4:]])) for c in cells]
            path.write_text("\n".join([head, *turned]))
        if index == BAD:
            path.write_text(path.read_text()[:2000] + "\nbroken,by,hand\n")
    return folder


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return tmp_path_factory.mktemp("store")


@pytest.fixture(scope="module")
def whole(logs, store):
    """The fleet, measured by two processes."""
    return fleet(logs, jobs=2, terms=("white",), store=store)


def test_a_killed_run_is_taken_up_and_nothing_is_measured_again(logs, tmp_path, whole, monkeypatch):
    measure, measured = unit_module.measure, []
    monkeypatch.setattr(
        unit_module, "measure", lambda path, o: measured.append(path.name) or measure(path, o)
    )

    def kill(done, _total):
        if done == 6:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fleet(logs, terms=("white",), store=tmp_path, progress=kill)
    assert len(measured) == 6
    again = fleet(logs, terms=("white",), store=tmp_path)
    assert sorted(measured) == [f"SN{i:02d}.csv" for i in range(12)]
    assert again.measured == 5  # of the six that were left, one is refused
    assert again.units == whole.units
    assert fleet(logs, terms=("white",), store=tmp_path).measured == 0


def test_results_are_the_same_bytes_for_any_number_of_processes(logs, whole, store, tmp_path):
    alone = fleet(logs, jobs=1, terms=("white",))
    names = write_fleet(alone, tmp_path / "one")
    assert write_fleet(whole, tmp_path / "two") == names
    assert {"fleet.csv", "fleet.html", "spread.csv", "grade.yaml", "fleet.json"} <= set(names)
    for name in names:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    assert not list((tmp_path / "one").glob(".*"))
    assert len(list(store.glob("*.json"))) == 11


def test_a_bad_log_is_a_row_with_its_reason(whole):
    bad = whole.units[BAD]
    assert bad.name == "SN07"
    assert bad.measurement is None
    assert "broken" in bad.error
    assert "\n" not in bad.error
    assert [u.name for u in whole.units if u.error] == ["SN07"]


def test_a_log_with_a_mistaken_unit_is_named_with_its_cure(whole):
    assert [u.name for u in whole.units if u.outliers] == [f"SN{WRONG:02d}"]
    wrong = whole.units[WRONG]
    assert {"gyro_x.N", "gyro_y.N", "gyro_z.N"} <= {o.quantity for o in wrong.outliers}
    assert all(o.score > o.threshold for o in wrong.outliers)
    (advice,) = wrong.advice
    assert "deg/s read as rad/s" in advice
    assert "--gyro-unit deg/s" in advice


def test_the_spread_from_unit_to_unit_is_that_of_the_simulated_units(whole):
    used = [i for i in range(12) if i not in (WRONG, BAD)]
    for column, axis in enumerate(("gyro_x", "gyro_y", "gyro_z")):
        drawn = np.log(FACTORS[used, column])
        pooled = whole.spread[f"{axis}.N"]
        # N of 5000 white samples is known to 1/√10000 = 1 %, five times that for the largest of three differences
        assert pooled.spread.value == pytest.approx(drawn.std(ddof=1), abs=0.05)
        assert math.log(pooled.value.value / DENSITY) == pytest.approx(drawn.mean(), abs=0.05)
        # the 95 % interval of a standard deviation of ten values is 0.69 … 1.83 times it (chi-square, 9 dof)
        low, high = pooled.spread.interval
        assert low / pooled.spread.value == pytest.approx(0.69, rel=0.1)
        assert high / pooled.spread.value == pytest.approx(1.83, rel=0.1)


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


def test_the_grade_is_read_like_any_other(whole):
    grade = parse_sheet(grade_yaml(whole), source="grade.yaml")
    assert grade.key == "lot"
    assert grade.rate.value == pytest.approx(50.0)
    # the mean of 30 logarithms with sd 0.1 is known to 1.8 %: five of them
    assert grade.gyro.white.value == pytest.approx(DENSITY, rel=5 * RELATIVE_SD / math.sqrt(30))
    assert "unit to unit" in grade.gyro.white.reference
    assert any("SN04" in note for note in grade.notes)


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
    _, broken = judge(UnitMeasurement("", 1.0, 1.0, units, noise), read_limits(path))
    assert broken[0] == "gyro x z N 0.300 to 0.500 > 0.200 deg/√h"


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
        r"gyro: N of x y z × (2\.9|3\.0|3\.1).*, Allan deviation at 10 s of x y z × (2\.9|3\.0|3\.1)", line
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
    assert units_apart(_normal_fleet(np.random.default_rng(2), 5, 6)).comparisons == 0


def test_spread_needs_two_units():
    assert spread([]) == {}
    assert spread(list(_normal_fleet(np.random.default_rng(2), 1, 2).values())) == {}


LIMITS = "format: tuner-limits/1\ngyro: {N: 0.2 deg/√h, B: 5 °/h}\n"


def _measured(**found):
    return UnitMeasurement("", 1.0, 1.0, {"gyro_x": "rad/s"}, {f"gyro_x.{k}": v for k, v in found.items()})


@pytest.mark.parametrize(
    ("density", "bias", "verdict"),
    [
        (Coefficient.known(0.19, 0.18, 0.20, ""), Coefficient.bounded(4.0, "", "absent"), "PASS"),
        (Coefficient.known(0.21, 0.20, 0.22, ""), Coefficient.bounded(4.0, "", "absent"), "FAIL"),
        (Coefficient.known(0.19, 0.18, 0.20, ""), Coefficient.bounded(6.0, "", "absent"), "OPEN"),
        (Coefficient.known(0.21, 0.20, 0.22, ""), Coefficient.bounded(6.0, "", "absent"), "FAIL"),
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
            c.interval,
            None if c.upper is None else to_si(c.upper, unit),
            "",
        )

    found = {"N": si(density, "deg/√h"), "B": si(bias, "deg/h")}
    got, broken = judge(_measured(**{k: v for k, v in found.items() if v is not None}), limits)
    assert got == verdict
    assert bool(broken) == (verdict != "PASS")


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


def test_a_process_that_dies_costs_only_its_own_log():
    """The task without options makes its process fail beyond recovery."""
    tasks = [SimpleNamespace(file=f"{i}", options=SimpleNamespace(reading=i)) for i in range(5)]
    tasks[1] = SimpleNamespace(file="1", options=None)
    found = dict(outcomes(attrgetter("options.reading"), tasks, jobs=2, scheduler=None))
    assert found[1].error.startswith("1: the process that was to read it ended")
    assert [found[i] for i in (0, 2, 3, 4)] == [0, 2, 3, 4]


def test_the_command_writes_all_files_and_gates_on_limits(logs, whole, store, tmp_path, capsys):
    assert whole.measured == 11
    out = tmp_path / "out"
    (out).mkdir()
    (out / "units").symlink_to(store)
    limits = tmp_path / "limits.yaml"
    limits.write_text("format: tuner-limits/1\ngyro: {N: 1 deg/√h}\n")
    arguments = [
        "fleet",
        str(logs / "*.csv"),
        "-o",
        str(out),
        "--limits",
        str(limits),
        "--terms",
        "white",
        "--jobs",
        "1",
    ]
    assert run(arguments) == 0
    tables = capsys.readouterr().out
    assert "10 PASS, 1 FAIL, 0 OPEN" in tables
    assert "SN04" in tables
    assert run([*arguments, "--strict", "--quiet"]) == 1
    rows = (out / "fleet.csv").read_text().splitlines()
    assert len(rows) == 13
    assert "gyro_x N [deg/sqrt(h)]" in rows[0]
    capsys.readouterr()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["/nowhere/at/all/*.csv"], "expected a log, a folder with logs"),
        (["{logs}", "-o", "{logs}"], "other than that of the logs"),
        (["{logs}", "--limits", "/nowhere.yaml"], "nowhere.yaml"),
    ],
)
def test_bad_input_is_one_line(logs, arguments, said, capsys):
    assert run(["fleet", *(a.replace("{logs}", str(logs)) for a in arguments)]) == 2
    captured = capsys.readouterr()
    assert said in captured.err
    assert captured.err.count("\n") == 1


def test_units_of_one_name_are_told_apart_by_their_folders(tmp_path):
    assert unit_names(["a/x/log.csv", "b/x/log.csv", "b/other.csv"]) == ["a/x/log", "b/x/log", "other"]
    assert unit_names(["caf\udce9/log.csv", "b/log.csv"]) == ["caf\ufffd/log", "b/log"]
    assert output_folder([str(tmp_path / "*.csv")], None).name == tmp_path.name


def test_a_cluster_that_loses_a_worker_measures_the_rest(logs, whole, monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.delattr(sys.modules["__main__"], "__file__", raising=False)  # workers would run pytest again
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        victim = next(iter(client.run(os.getpid).values()))

        def kill(done, _total):
            if done == 2:
                os.kill(victim, signal.SIGKILL)

        found = fleet(logs, scheduler=cluster.scheduler_address, terms=("white",), progress=kill)
    assert found.units == whole.units


def test_a_file_name_that_is_no_text_is_shown_with_marks(tmp_path):
    folder = tmp_path / "logs"
    folder.mkdir()
    (folder / os.fsdecode(b"caf\xe9.csv")).write_text("no log\n")
    assert run(["fleet", str(folder), "-o", str(tmp_path / "out"), "--jobs", "1", "--quiet"]) == 0
    assert "caf\ufffd.csv" in (tmp_path / "out" / "fleet.csv").read_text()
