"""Filter states of another package, one file and one entry point each, go through every stage."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from models.error_state import Linearization, corrected, dynamics
from models.filter_states import FILTER_STATES, Coupling, FilterState
from models.imu_errors import calibration
from models.measurements import perfect_fixes, position_fix, velocity_fix
from models.rotation import mat_from_rpy
from models.state_layout import AxisNoise, error_model
from models.trajectory.catalogue import TRAJECTORIES
from models.trajectory.motion import imu_increments
from tests.extension.height_bias import HEIGHT_BIAS
from tests.extension.non_orthogonality import NON_ORTHOGONALITY
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.consistency.check import check
from tuner.formats import noise_yaml
from tuner.navigation import engine
from tuner.navigation import reference_filter as reference
from tuner.navigation.data import Constraints, Fixes, Steps, split_at
from tuner.navigation.settings import filter_settings
from tuner.synthesis import synthesize
from tuner.types.records import DataError

SUPPLY_BIAS = FilterState(
    "supply_bias",
    ("",),
    "m/s^2",
    "bias by the supply voltage",
    (
        *(Coupling("", f"accel_{axis}", factor=f) for axis, f in zip("xyz", (1.0, -0.5, 2.0), strict=True)),
        Coupling("", "gyro_z", factor=1e-3),
    ),
    time_constant=20.0,
)
"""Adds to several sensors, with factors."""
GEOID = FilterState(
    "geoid", ("",), "m/s^2", "gravity disturbance", (Coupling("", "acceleration_down", factor=-1.0),)
)
"""Accelerates the unit, upwards."""
DOPPLER = FilterState(
    "doppler", ("north", "east"), "m/s", "Doppler bias",
    (Coupling("north", "velocity_north"), Coupling("east", "velocity_east", factor=2.0)), walk_density=1e-3,
)  # fmt: skip
"""Adds to velocities, and walks."""
STATES = (HEIGHT_BIAS, NON_ORTHOGONALITY, SUPPLY_BIAS, GEOID, DOPPLER)
PRIORS = dict(zip((s.name for s in STATES), (5.0, 1e-3, 0.02, 1e-3, 0.1), strict=True)) | {
    "time_offset": 0.02
}
PACKAGE = {"height_bias": "HEIGHT_BIAS", "non_orthogonality": "NON_ORTHOGONALITY"}


@pytest.fixture
def declared():
    """Declare the states for one test."""
    FILTER_STATES.extend(STATES)
    yield
    for state in STATES:
        del FILTER_STATES._declared[state.name]


def configuration(**changes):
    config = synthesize(grade_identification(load_grade("adis16405")), gnss=load_gnss("spp"))
    return replace(config, **changes)


@pytest.mark.usefixtures("declared")
def test_dynamics_and_measurements_are_derivatives_of_the_sensor_model():
    """S, F and H against what the declared errors do: measured = A (ω, f) + b, fix = truth + error."""
    model = error_model([AxisNoise(1e-5)] * 3, [AxisNoise(1e-3)] * 3, constants=tuple(PRIORS))
    x = 1e-3 * np.random.default_rng(1).standard_normal(model.layout.size)
    true = np.array([0.1, -0.2, 0.3, 1.0, 2.0, -9.0])
    xy, xz, yz = x[model.layout["gyro_non_orthogonality"]]
    supply = x[model.layout["supply_bias"]][0]
    expected = true + 0.0
    expected[:3] += 0.5 * np.array([[0, xy, xz], [xy, 0, yz], [xz, yz, 0]]) @ true[:3]
    expected += supply * np.array([0, 0, 1e-3, 1, -0.5, 2])
    expected[:3] += x[model.layout["gyro_bias"]]
    expected[3:] += x[model.layout["accel_bias"]]
    own = calibration(model, x)
    np.testing.assert_allclose(own.matrix @ true + own.bias, expected, atol=1e-15)
    llh, vel, mat = np.array([0.8, 0.2, 100.0]), np.array([10.0, 2.0, -1.0]), mat_from_rpy([0.1, 0.2, 0.9])
    at = Linearization(llh, vel, mat, true[:3], true[3:], own)
    assert dynamics(model, at)[5, model.layout.start("geoid")] == -1.0
    without = replace_states(x, model, "height_bias", "doppler")
    for fix, given in ((position_fix, llh), (velocity_fix, vel)):
        one, other = (fix(model, at, values, given, lever_arm=(0.3, 0.0, -1.0)) for values in (x, without))
        np.testing.assert_allclose(one.z - other.z, -(one.H @ (x - without)), atol=1e-9)
        assert np.any(one.z != other.z)


def replace_states(x, model, *names):
    """Return a vector of states without some."""
    answer = x.copy()
    for name in names:
        answer[model.layout[name]] = 0.0
    return answer


@pytest.mark.usefixtures("declared")
@pytest.mark.parametrize("priors", [PRIORS, {"supply_bias": 0.02}], ids=["all", "no-mixing"])
def test_compiled_filter_equals_the_reference_filter(priors):
    settings = filter_settings(configuration(), constants=priors, lever_arm=(0.3, -0.2, -1.0))
    rng, duration, interval = np.random.default_rng(2), 9.0, 0.01
    motion = TRAJECTORIES["s_turns"](duration)
    increments = np.hstack(imu_increments(motion, interval))
    increments += 1e-4 * rng.standard_normal(increments.shape) + interval * np.array(
        [0, 0, 1e-3, 0.1, 0, 0.05]
    )
    t = np.arange(1.0, duration - 1.0) + 0.003
    steps, after = split_at(Steps(0.0, np.full(len(increments), interval), increments), t)
    llh, vel = perfect_fixes(motion, t, lever_arm=settings.lever_arm, delay=0.02)
    vel = vel + 0.05 * rng.standard_normal(vel.shape)
    fixes = Fixes(t, after, llh, vel, np.tile([1.5, 1.5, 3.0, 0.05, 0.05, 0.1], (len(t), 1)))
    start = corrected(
        motion.evaluate([0.0]).at(0), np.array([1.0, -1.0, 2.0, 0.1, 0.1, -0.1, 0.01, -0.01, 0.1])
    )
    when = np.arange(0.5, 8.0, 0.5)
    index = np.searchsorted(steps.ends(), when)
    own = Constraints(
        when, index, np.arange(len(when)) % 3 + 1, np.full(len(when), 0.5),
        steps.increments[index - 1] / steps.dt[index - 1, None], np.eye(3), (-1.0, 0.2, 0.4),
    )  # fmt: skip
    a = reference.run(settings, start, steps, fixes, constraints=own)
    b = engine.run(settings, start, steps, fixes, constraints=own)
    np.testing.assert_array_equal(a.constrained.use, b.constrained.use)
    assert_same(settings, a, b)
    assert a.further_covariance.shape == (len(t), settings.size - 15 - 21 - 3, settings.size - 39)
    alone = engine.run(settings, start, steps, fixes)
    assert_same(settings, alone, engine.run_together(settings, [start] * 2, steps, [fixes] * 2)[1])


def assert_same(settings, a, b):
    sd = np.sqrt(np.diag(a.final_covariance))
    np.testing.assert_allclose(a.parameters, b.parameters, rtol=0.0, atol=1e-9 * settings.initial_sd.max())
    assert np.all(np.abs(a.parameters - b.parameters) <= 1e-9 * settings.initial_sd + 1e-300)
    assert np.all(np.abs(a.final_covariance - b.final_covariance) <= 1e-9 * np.outer(sd, sd))
    further = np.sqrt(np.einsum("kii->ki", a.further_covariance))
    off = np.abs(a.further_covariance - b.further_covariance)
    assert np.all(off <= 1e-9 * further[:, :, None] * further[:, None, :])
    np.testing.assert_array_equal(a.use, b.use)


@pytest.mark.usefixtures("declared")
def test_check_judges_the_states():
    """NEES of each is within its band where the truth has the prior and the process that the filter assumes."""
    priors = {
        name: sd for name, sd in PRIORS.items() if name in ("height_bias", "supply_bias", "geoid", "doppler")
    }
    config = configuration(constants=priors, time_constants={"height_bias": 100.0})
    found = check(config, duration=600.0, runs=32, seed=4).consistency
    scores = {score.name: score for score in found.blocks}
    assert scores.keys() > priors.keys()
    assert all(score.consistent for score in scores.values())
    # 32 runs: a mean square of 32 numbers or more, within 5 standard deviations of 1.
    assert all(abs(scores[name].ratio ** 2 - 1.0) < 5.0 * (2.0 / 32.0) ** 0.5 for name in priors)


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Lay the files and their entry points as pip would, and a configuration that asks for the states."""
    folder = tmp_path_factory.mktemp("site")
    facts = folder / "other_states-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: other-states\nVersion: 1.0\n")
    points = [f"{name} = {name}:{value}" for name, value in PACKAGE.items()]
    (facts / "entry_points.txt").write_text("[tuner.filter_states]\n" + "\n".join(points) + "\n")
    for name in PACKAGE:
        shutil.copy(Path(__file__).with_name(f"{name}.py"), folder)
        assert len((folder / f"{name}.py").read_text().splitlines()) <= 40
    config = configuration(constants={"height_bias": 5.0, "gyro_non_orthogonality": 0.01})
    with FILTER_STATES.added(HEIGHT_BIAS), FILTER_STATES.added(NON_ORTHOGONALITY):
        noise_yaml.dump(config, folder / "noise.yaml")
    return folder


def tuner(package: Path, *arguments: str, known: bool = True) -> subprocess.CompletedProcess[str]:
    """Run a command in a process that sees the other package, or does not."""
    path = os.pathsep.join([str(package)] * known + [p for p in sys.path if p])
    code = "import sys; from tuner.cli import main; sys.exit(main())"
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=package.parent,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


def test_another_package_declares_states_that_check_judges(package):
    text = (package / "noise.yaml").read_text()
    assert "height_bias: 5.0  # m\n" in text
    assert "# rad; 10.0 mrad" in text
    files = str(package / "noise.yaml"), "--json", str(package / "c.json")
    done = tuner(package, "check", *files, "--duration", "300", "--runs", "8", "--budget")
    assert done.returncode == 0, done.stderr
    found = json.loads((package / "c.json").read_text())
    assert {"height_bias", "gyro_non_orthogonality"} <= found["blocks"].keys()
    assert "height bias of fixes" in done.stdout
    assert "gyro non-orthogonality" in done.stdout


def test_a_state_of_a_missing_package_is_refused_in_one_line(package):
    done = tuner(package, "check", str(package / "noise.yaml"), "--runs", "2", known=False)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert "noise.yaml: constants: expected a declared filter state, got unknown filter state" in done.stderr
    with pytest.raises(DataError, match="unknown filter state 'height_bias'"):
        noise_yaml.load(package / "noise.yaml")


def test_the_page_shows_these_files():
    page = (Path(__file__).parents[2] / "docs" / "extending" / "filter-state.md").read_text(encoding="utf-8")
    for name in PACKAGE:
        assert f"```python\n{Path(__file__).with_name(f'{name}.py').read_text(encoding='utf-8')}```" in page
