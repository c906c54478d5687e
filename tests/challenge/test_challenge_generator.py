"""The generator of the challenge is independent of the project, and right about what it hides."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from challenge.generator.effect import Place
from challenge.generator.files import log
from challenge.generator.items import CATALOGUE, KINDS, _hide, item
from challenge.generator.laws import HeavyTails, above_normal
from challenge.generator.means import Line, Step
from challenge.generator.noise import Noise
from challenge.generator.oracle import Oracle
from challenge.generator.sampling import Lattice
from challenge.generator.scene import Scene
from challenge.generator.spectra import LowPass, Vibration
from challenge.seal import generate, opened
from challenge.tables import wilson
from challenge.verdict import judge
from scipy.fft import dct
from scipy.stats import kstest, norm
from scipy.stats import t as student

HERE = Path(__file__).resolve().parent
QUIET = Noise(
    white=1.0,
    quantum=0.0,
    flicker=0.01,
    markov=0.0,
    time_constant=0.0,
    walk=1e-4,
    ramp=0.0,
    step=0.0,
    bias=3.0,
)
PLAIN = Scene(
    "industrial", 100.0, 100_000, 0.0, {"gyro_x": QUIET}, "none",
    {"level": 25.0, "range": 5.0, "noise": 0.01, "code": 0.03, "update": 0.0},
)  # fmt: skip


def place(seed: int) -> Place:
    return Place(PLAIN, "gyro_x", np.full(PLAIN.samples, 25.0), np.random.default_rng(seed))


def loaded(statement: str) -> set[str]:
    """Return the names of the modules a clean interpreter has after a statement."""
    code = f"import sys; sys.path.append({str(HERE.parent)!r}); {statement}; print('\\n'.join(sys.modules))"
    out = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=HERE.parents[1]
    )
    return set(out.stdout.split())


def test_generator_and_analyser_share_no_module_of_the_project():
    generator = loaded("import challenge.generator.files, challenge.drives.files, challenge.seal")
    analyser = loaded("import challenge.answer")
    ours = ("challenge", "models", "tuner")
    common = {name for name in generator & analyser if name.split(".")[0] in ours} - {"challenge"}
    assert not common
    assert not any(name.split(".")[0] in ("models", "tuner") for name in generator)


def test_generator_imports_only_numpy_scipy_and_the_standard_library():
    allowed = {"numpy", "scipy", "challenge", *sys.stdlib_module_names}
    for path in [*(HERE / "generator").glob("*.py"), HERE / "seal.py"]:
        for node in ast.walk(ast.parse(path.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert {name.split(".")[0] for name in names} <= allowed, path.name


@pytest.mark.parametrize(
    "noise",
    [
        QUIET,
        replace(QUIET, flicker=0.3),
        replace(QUIET, flicker=0.0, markov=0.3, time_constant=20.0),
        replace(QUIET, quantum=0.5, walk=0.01),
    ],
    ids=["white", "flicker", "markov", "walk"],
)
def test_noise_has_the_power_the_oracle_counts_with(noise):
    """Bins of 40 and more squared coefficients over their expectation: z below 5 in some 100 bins (1e-4)."""
    n, dt = 2**17, 0.01
    rng = np.random.default_rng(5)
    y = noise.white * rng.standard_normal(n) + noise.slow(n, dt, rng)
    a = dct(y, norm="ortho")[1:]
    oracle = Oracle(noise, n, dt)
    ratio = np.add.reduceat(a * a, oracle.edges[:-1] - 1) / oracle.count / oracle.power
    wide = oracle.count >= 40
    z = (ratio[wide] - 1.0) * np.sqrt(oracle.count[wide] / 2.0)
    assert np.abs(z).max() < 5.0
    slow = ratio[20:200]
    assert abs(slow.mean() - 1.0) < 5.0 * np.sqrt(2.0 / len(slow))


def test_detectability_of_a_line_is_half_its_squared_snr():
    hidden = Line.hide(place(1), 40.0)
    amplitude = hidden.truth("gyro_x", PLAIN)["amplitude"]
    assert amplitude**2 * PLAIN.samples / 4.0 == pytest.approx(hidden.nats, rel=0.05)


def test_base_absorbs_part_of_a_step():
    hidden = Step.hide(place(2), 40.0)
    oracle = place(2).oracle
    fixed = 0.5 * float(
        np.sum(oracle.count * oracle.energy(hidden.signal("gyro_x", np.zeros(1), PLAIN, None)) / oracle.power)
    )
    assert 1.1 * hidden.nats < fixed


def test_detectability_of_tails_is_the_gain_of_their_law():
    """Mean log ratio of 4e5 draws against the divergence: five standard errors (6e-7)."""
    for nu in (5.0, 12.0, 80.0):
        spread = np.sqrt((nu - 2.0) / nu)
        x = spread * student.rvs(nu, size=400_000, random_state=np.random.default_rng(int(nu)))
        gain = student.logpdf(x / spread, nu) - np.log(spread) - norm.logpdf(x)
        assert abs(gain.mean() - above_normal(nu)) < 5.0 * gain.std() / np.sqrt(len(x))


def test_tails_have_unit_variance_and_the_law_of_student():
    hidden = HeavyTails.hide(place(3), 300.0)
    rng = np.random.default_rng(4)
    w = hidden.white(rng.standard_normal(200_000), 1.0, PLAIN, rng)
    spread = np.sqrt((hidden.nu - 2.0) / hidden.nu)
    assert kstest(w / spread, student(hidden.nu).cdf).pvalue > 1e-5


def test_filter_and_resonance_have_their_spectra():
    """Mean of the periodogram in 20 bands over the law of the effect: five standard errors."""
    n, rng, f = 2**17, np.random.default_rng(6), np.arange(1, 2**17) / 2**18 * 100.0
    where = replace(PLAIN, samples=n)
    filtered, resonant = LowPass.hide(place(4), 200.0), Vibration.hide(place(5), 900.0)
    cases = [
        (filtered.white(np.zeros(n), 1.0, where, rng), filtered.response(filtered.cutoff, f, 100.0)),
        (resonant.signal("gyro_x", f, where, rng), resonant.size**2 * resonant.response(f, 0.01)),
    ]
    for y, power in cases:
        ratio = (dct(y, norm="ortho")[1:] ** 2 / power).reshape(-1)[: 20 * 6553].reshape(20, 6553)
        assert np.abs(ratio.mean(axis=1) - 1.0).max() < 5.0 * np.sqrt(2.0 / 6553)


def test_items_are_the_same_for_the_same_secret_and_differ_for_another():
    first, again, other = (
        item("a", 3, samples=20_000),
        item("a", 3, samples=20_000),
        item("b", 3, samples=20_000),
    )
    assert json.dumps(first.truth(), default=float) == json.dumps(again.truth(), default=float)
    assert first.name != other.name
    a, b = log(first), log(again)
    assert all(np.array_equal(a[name], b[name]) for name in a)
    assert not np.array_equal(a["gyro_x"], log(first, "b")["gyro_x"])


def test_every_kind_and_cause_can_be_made():
    kinds = [item("all", number, (kind,), samples=30_000).kind for number, kind in enumerate(KINDS)]
    assert kinds == list(KINDS)
    assert len({effect.cause for effect in CATALOGUE}) == 21


def test_a_key_that_was_changed_after_publication_is_refused(tmp_path):
    published = generate(range(2), "seal", tmp_path / "logs", tmp_path / "keys.json", samples=20_000)
    assert len(opened(tmp_path / "keys.json", published)) == 2
    (tmp_path / "keys.json").write_text((tmp_path / "keys.json").read_text() + " ")
    with pytest.raises(ValueError, match="not the key"):
        opened(tmp_path / "keys.json", published)


def test_logs_carry_no_hint(tmp_path):
    generate(range(3), "hint", tmp_path / "logs", tmp_path / "keys.json", samples=20_000)
    for path in (tmp_path / "logs").iterdir():
        with np.load(path) as arrays:
            assert set(arrays.files) <= {
                "t",
                "temperature",
                *(f"{s}_{a}" for s in ("gyro", "accel") for a in "xyz"),
            }


def test_wilson_intervals():
    """Figures of Brown, Cai, DasGupta (2001) style: 0 of 10 and 5 of 10."""
    assert wilson(0, 10) == pytest.approx((0.0, 0.27753), abs=1e-4)
    assert wilson(5, 10) == pytest.approx((0.23659, 0.76341), abs=1e-4)


def test_points_reward_the_name_and_punish_invention():
    truth = {
        "name": "x", "kind": "single", "scene": {"hard": "", "samples": 10, "axes": {"gyro_x": {}}},
        "effects": [
            {"cause": "warmup", "axes": ["gyro_x"], "nats": 50.0, "twin": "",
             "parameters": {"gyro_x": {"amplitude": 2.0}}}
        ],
    }  # fmt: skip

    def answer(*causes: str) -> dict:
        figure = {"amplitude": {"value": 2.1, "interval": [1.9, 2.3]}}
        told = [
            {
                "cause": c,
                "channels": ["gyro_x"],
                "parameters": figure,
                "by_channel": {},
                "alternatives": [],
                "gain": None,
            }
            for c in causes
        ]
        return {"findings": told, "unexplained": [], "seconds": 1.0, "cpu": 1.0, "error": None}

    right, family, both, nothing = (
        judge(truth, answer(*causes)).points()
        for causes in (("warmup",), ("temperature",), ("warmup", "line"), ())
    )
    assert right > family > nothing
    assert right > both
    assert judge(truth, answer("warmup")).parameters[0].inside


def test_effects_beside_a_coarse_quantizer_are_sized_in_its_noise():
    """A line of amplitude a in white noise and rounding errors: d = n a²/(4 (1 + D²/12)), but for the slow noise."""
    rng = np.random.default_rng(5)
    where, hidden = _hide(rng, 5, (Line, Lattice), lambda: 100.0, 100_000, 1)
    made = {h.effect.cause: h.effect for h in hidden}
    line, lattice = made["line"], made["lattice"]
    (noise,) = where.axes.values()
    assert noise.step == pytest.approx(lattice.step * noise.white)
    spread = noise.quantum**2 / noise.white**2 * 4.0 * np.sin(np.pi * line.frequency * where.interval) ** 2
    sized = 0.25 * where.samples * line.size**2 / (1.0 + lattice.step**2 / 12.0 + spread)
    assert sized == pytest.approx(line.nats, rel=0.1)
