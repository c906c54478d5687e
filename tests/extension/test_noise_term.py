"""A noise term of another package, one file and one entry point, goes through every stage."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from matplotlib.figure import Figure

from models.noise import TERMS, NoiseModel, Term, White
from models.registry import RegistryError
from tests.extension.second_order_gauss_markov import SecondOrderGaussMarkov
from tuner.diagnosis.static.switching.models import Slow, block_noise
from tuner.identification import identify
from tuner.report.allan_figure import allan_figure
from tuner.report.figure_files import write_figure
from tuner.synthesis.bias_states import spectrum_bound
from tuner.types.records import DataError, Record

NAME = "second_order_gauss_markov"
SD, TIME, DENSITY = 1e-3, 4.0, 2e-4
INTERVAL, SAMPLES = 0.1, 10_000


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Lay the file and its entry point as pip would."""
    folder = tmp_path_factory.mktemp("site")
    shutil.copy(Path(__file__).with_name(f"{NAME}.py"), folder)
    facts = folder / "other_noise-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: other-noise\nVersion: 1.0\n")
    (facts / "entry_points.txt").write_text(f"[tuner.noise_terms]\n{NAME} = {NAME}:SecondOrderGaussMarkov\n")
    model = NoiseModel([White(DENSITY), SecondOrderGaussMarkov(SD, TIME)])
    rng = np.random.default_rng(5)
    table = np.column_stack([np.arange(SAMPLES) * INTERVAL, model.sample(SAMPLES, INTERVAL, rng)])
    np.savetxt(folder / "log.csv", table, delimiter=",", header="time,gyro_x", comments="")
    return folder


def tuner(package: Path, *arguments: str, known: bool = True) -> subprocess.CompletedProcess[str]:
    """Run a command in a process that sees the other package, or does not."""
    path = os.pathsep.join([str(package)] * known + [p for p in sys.path if p])
    code = "import sys; from tuner.cli import main; sys.exit(main())"
    return subprocess.run(
        [sys.executable, "-P", "-c", code, *arguments],
        cwd=package,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture(scope="module")
def tuned(package: Path) -> Path:
    """Identify and configure with the term."""
    done = tuner(
        package, "tune", "log.csv", "--terms", f"white,{NAME}", "--gyro-unit", "rad/s", "-o", "out", "--quiet"
    )
    assert done.returncode == 0, done.stderr
    return package / "out"


def test_it_is_one_short_file() -> None:
    lines = Path(__file__).with_name(f"{NAME}.py").read_text().splitlines()
    assert len(lines) <= 40


def test_it_is_fitted(tuned: Path) -> None:
    result = json.loads((tuned / "result.json").read_text())["identification"]
    for channel in result["channels"].values():
        (found,) = channel["terms"][NAME]
        for name, true in (("sd", SD), ("time_constant", TIME)):
            low, high = found[name]["interval"]
            # Two parameters: twice the interval is exceeded by chance once in 4500 seeds.
            assert low - (high - low) / 2.0 < true < high + (high - low) / 2.0
        assert found["sd"]["unit"] == "rad/s"


def test_the_filter_has_a_state_whose_spectrum_bounds_it(tuned: Path) -> None:
    config = yaml.safe_load((tuned / "noise.yaml").read_text())
    axis = config["sensors"]["gyro"]["gyro_x"]
    assert axis["filter"]["markov"]
    estimate = next(term for term in axis["identified"] if term["term"] == NAME)
    term = SecondOrderGaussMarkov(estimate["sd"]["value"], estimate["time_constant"]["value"])
    state = spectrum_bound(term)
    # For T' = r T the least variance is σ² r³/(2 (r² − 1)): r = √3, σ'² = 3^1.5/4 σ² by hand.
    assert state.time_constant == pytest.approx(np.sqrt(3.0) * term.time_constant, rel=0.02)
    assert state.sd == pytest.approx(3.0**0.75 / 2.0 * term.sd, rel=1e-3)
    f = np.geomspace(1e-5, 1e3, 2000)
    assert np.all(spectrum_bound(term).psd(f) >= (1.0 - 1e-3) * term.psd(f))
    assert NAME in axis["fates"]


def test_it_is_exported_and_simulated(package: Path, tuned: Path) -> None:
    exported = tuner(package, "export", "out/noise.yaml", "--to", "gazebo")
    assert exported.returncode == 0, exported.stderr
    assert NAME in exported.stdout
    done = tuner(package, "simulate", "out/noise.yaml", "-o", "again.csv", "--hours", "0.1", "--seed", "1")
    assert done.returncode == 0, done.stderr


def test_without_the_package_the_term_is_refused_in_one_line(package: Path, tuned: Path) -> None:
    done = tuner(
        package, "identify", "log.csv", "--terms", f"white,{NAME}", "--gyro-unit", "rad/s", known=False
    )
    assert done.returncode != 0
    assert f"got '{NAME}'" in done.stderr
    done = tuner(package, "simulate", "out/noise.yaml", "-o", "again.csv", "--hours", "0.1", known=False)
    assert done.returncode != 0
    assert "Traceback" not in done.stderr
    assert f"got '{NAME}'" in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"name": "gauss_markov_2"}, "expected a name of lower-case letters.* that does not end in a number"),
        ({"name": "my term,1"}, "expected a name of lower-case letters"),
        ({"PARAMETERS": ("sd", "period")}, "PARAMETERS must name fields of the dataclass, 'period' is none"),
        ({"UNITS": (0.0,)}, "UNITS must hold one entry for each of PARAMETERS"),
    ],
)
def test_a_contradicting_declaration_is_refused_in_one_line(
    changes: dict[str, object], complaint: str
) -> None:
    with pytest.raises(RegistryError, match=rf"^noise term '[^\n]*': {complaint}[^\n]*$"):
        TERMS.add(type("Changed", (SecondOrderGaussMarkov,), changes))


def test_a_term_that_states_nothing_is_refused_in_one_line() -> None:
    with pytest.raises(RegistryError, match=r"^noise term 'Empty': the class needs name, PARAMETERS, UNITS$"):
        TERMS.add(type("Empty", (Term,), {}))


def test_a_term_with_a_parameter_that_is_no_time_and_gives_no_trial_values_is_refused_in_one_line() -> None:
    heated = type("Heated", (SecondOrderGaussMarkov,), {"name": "heated", "UNITS": (0.0, "K")})
    y = np.random.default_rng(0).standard_normal((4000, 1))
    record = Record("gyro", 0.01 * np.arange(4000), y, ("gyro_x",), "rad/s", 0.01)
    with (
        TERMS.added(heated),
        pytest.raises(DataError, match=r"^noise term 'heated' cannot be fitted: [^\n]*$"),
    ):
        identify((record,), terms=("white", "heated"))


def test_a_long_name_leaves_the_panels_of_the_allan_figure_their_width(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The layout must not make room for the legend beside a panel: three panels fill most of the width."""
    widths: list[float] = []
    save = Figure.savefig

    def saved(figure: Figure, *arguments: object, **options: object) -> None:
        save(figure, *arguments, **options)
        widths.extend(panel.get_position().width for panel in figure.axes)

    monkeypatch.setattr(Figure, "savefig", saved)
    named = type("Named", (SecondOrderGaussMarkov,), {"name": "gauss_markov_of_second_order", "SYMBOLS": ()})
    model, rng = NoiseModel([White(DENSITY), named(SD, TIME)]), np.random.default_rng(5)
    y = model.sample(2000, INTERVAL, rng)[:, None]
    record = Record("gyro", INTERVAL * np.arange(2000), y, ("gyro_x",), "rad/s", INTERVAL)
    with TERMS.added(named):
        found = identify((record,), terms=("white", named.name), arma=None)
        one = found.channels["gyro_x"]
        axes = ("gyro_x", "gyro_y", "gyro_z")
        found = replace(found, channels={axis: replace(one, axis=axis) for axis in axes})
        write_figure(allan_figure(found), tmp_path / "allan.png")
    assert len(widths) == 3
    assert min(widths) > 0.25


@pytest.mark.parametrize("place", [lambda terms: Slow.of(terms, 1.0), lambda terms: block_noise(terms, 1.0)])
def test_models_of_switching_levels_refuse_it_in_one_line(place: Callable[[list[Term]], object]) -> None:
    """Left out in silence, its power would be taken for switches."""
    with pytest.raises(
        DataError, match=rf"^noise term '{NAME}' cannot be searched for [^\n]*; leave it out[^\n]*$"
    ):
        place([White(DENSITY), SecondOrderGaussMarkov(SD, TIME)])
