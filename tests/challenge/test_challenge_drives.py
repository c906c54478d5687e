"""The generator of drives is independent of the project, and right about truth, effects and detectability."""

from __future__ import annotations

import ast
import json
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from challenge.answer import configured
from challenge.drives.errors import Errors
from challenge.drives.files import drive, generate, sheets
from challenge.drives.items import CATALOGUE, KINDS, LIMIT, Hidden, Item, hide, item
from challenge.drives.oracle import GROUPS, Oracle
from challenge.drives.scene import HARD, scene
from challenge.generator.effect import UnreachableError
from challenge.seal import opened

from models import rotation
from models.earth import ned_between
from models.strapdown import NavigationState
from tests.mechanisation import mechanize
from tuner.readers.drive import read_drive

HERE = Path(__file__).resolve().parent
SCENE = scene(np.random.default_rng(3), reference=True)
NONE = np.ones(2), np.ones(6)


@cache
def oracle() -> Oracle:
    return Oracle(SCENE)


def made(errors: Errors) -> dict:
    """Return a drive with errors; noise as without."""

    class Fixed(Item):
        errors = property(lambda self: errors)  # type: ignore[assignment]

    return drive(Fixed("x", "single", 7, SCENE, ()))


CLEAN = made(Errors())


def test_generator_imports_only_numpy_scipy_and_the_standard_library():
    allowed = {"numpy", "scipy", "challenge", *sys.stdlib_module_names}
    for path in (HERE / "drives").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert {name.split(".")[0] for name in names} <= allowed, path.name


def test_perfect_samples_lead_to_the_true_end():
    """Two mechanisations that share nothing: Earth-fixed splines here, increments in north-east-down there."""
    truth, rate, duration = SCENE.truth, 100.0, 200.0
    t, samples = truth.unit(rate, duration)
    first, last = truth.state(np.zeros(1)), truth.state(t[-1:])
    quat = rotation.quat_from_mat(first.local[0].T @ first.body[0])
    start = NavigationState(first.llh[0], first.vel_n[0], quat)
    end = mechanize(start, samples[:, :3] / rate, samples[:, 3:] / rate, 1.0 / rate)
    np.testing.assert_allclose(ned_between(np.asarray(end.llh)[-1], last.llh[0]), 0.0, atol=2e-3)
    np.testing.assert_allclose(np.asarray(end.vel_n)[-1], last.vel_n[0], atol=5e-5)


def test_noise_has_its_size():
    """First differences of 45 000 samples: white sd within 3 % (over five standard errors)."""
    for name, density in (("gyro", SCENE.arw), ("accel", SCENE.vrw)):
        _, true = SCENE.truth.unit(SCENE.imu_rate, SCENE.duration)
        error = CLEAN[name] - true[:, :3] if name == "gyro" else CLEAN[name] - true[:, 3:]
        sd = np.diff(error, axis=0).std(axis=0) / np.sqrt(2.0)
        np.testing.assert_allclose(sd, density * np.sqrt(SCENE.imu_rate), rtol=0.03)


def test_effects_do_what_their_parameters_say():
    """Differences to the drive without the effect, whose noise is the same."""
    t = CLEAN["gnss_t"]
    truth, arm = SCENE.truth, np.zeros(3)
    late = made(Errors(delay=0.2, lag=0.1))
    _, then = truth.antenna(t - 0.3, arm)
    _, now = truth.antenna(t, arm)
    np.testing.assert_allclose(late["gnss_vned"] - CLEAN["gnss_vned"], then - now, atol=1e-7)
    turned = made(Errors(frame=np.array([0.0, 0.0, 0.01])))
    expected = now @ rotation.mat_from_rpy((0.0, 0.0, 0.01)).T - now
    np.testing.assert_allclose(turned["gnss_vned"] - CLEAN["gnss_vned"], expected, atol=1e-7)
    matrix = np.zeros((6, 6))
    matrix[2, 2] = 1e-3
    _, samples = truth.unit(SCENE.imu_rate, SCENE.duration)
    scaled = made(Errors(matrix=matrix))
    np.testing.assert_allclose((scaled["gyro"] - CLEAN["gyro"])[:, 2], 1e-3 * samples[:, 2], atol=1e-12)
    jumped = made(Errors(jump_time=400.0, jump=np.array([0.0, 0.0, 0.0, 0.0, 0.02, 0.0])))
    np.testing.assert_allclose(
        (jumped["accel"] - CLEAN["accel"])[:, 1], np.where(CLEAN["imu_t"] > 400.0, 0.02, 0.0), atol=1e-12
    )


def test_detectability_is_the_gain_of_a_filter_that_knows():
    """Log likelihood ratio of 30 linear drives: five standard errors of their mean (6e-7)."""
    o, rng = oracle(), np.random.default_rng(5)
    ratio = np.array([1.1, 1.1, 1.1, 1.0, 1.0, 1.0])
    expected = o.divergence(np.ones(2), ratio)
    gains = [likelihood(o, nu, ratio) - likelihood(o, nu, np.ones(6)) for nu in drawn(o, ratio, 30, rng)]
    assert abs(np.mean(gains) - expected) < 5.0 * np.std(gains) / np.sqrt(len(gains))
    assert o.divergence(*NONE) == pytest.approx(0.0, abs=1e-9)


def drawn(o: Oracle, ratio: np.ndarray, count: int, rng: np.random.Generator) -> list[np.ndarray]:
    """Return fixes of linear drives, less the truth: H e + v with the estimate left at zero."""
    phi, *noise = o.transition
    roots = np.linalg.cholesky(sum(noise) + 1e-18 * np.eye(15))
    out = []
    for _ in range(count):
        e, z = np.linalg.cholesky(o.start) @ rng.standard_normal(15), np.empty((len(phi), 6))
        for i in range(len(phi)):
            e = phi[i] @ e + roots[i] @ rng.standard_normal(15)
            z[i] = o.H[i] @ e + ratio * o.reported * rng.standard_normal(6)
        out.append(z)
    return out


def likelihood(o: Oracle, z: np.ndarray, ratio: np.ndarray) -> float:
    phi, *noise = o.transition
    q, r, p, x, total = sum(noise), np.diag((ratio * o.reported) ** 2), o.start, np.zeros(15), 0.0
    for i, h in enumerate(o.H):
        x, p = phi[i] @ x, phi[i] @ p @ phi[i].T + q[i]
        s, nu = h @ p @ h.T + r, z[i] - h @ x
        total -= 0.5 * (np.linalg.slogdet(s)[1] + nu @ np.linalg.solve(s, nu))
        k = np.linalg.solve(s, h @ p).T
        x, p = x + k @ nu, p - k @ h @ p
        p = 0.5 * (p + p.T)
    return float(total)


def test_an_effect_has_the_requested_detectability():
    rng = np.random.default_rng(8)
    for cause in CATALOGUE:
        found = reached(cause, rng)
        assert found.nats == pytest.approx(40.0, rel=0.05)
        assert found.cause == cause
        if cause in GROUPS:
            assert np.linalg.norm(list(found.truth.values())) <= LIMIT[cause] * (1.0 + 1e-9)


def reached(cause: str, rng: np.random.Generator) -> Hidden:
    for _ in range(20):
        try:
            return hide(oracle(), cause, 40.0, rng)
        except UnreachableError:
            continue
    raise AssertionError(cause)


def test_half_the_twins_of_a_straight_road_cannot_be_distinguished():
    o = Oracle(scene(np.random.default_rng(2), road="straight", reference=True))
    found = hide(o, "time_offset", 50.0, np.random.default_rng(1))
    _, left = o.rival(o.mean("time_offset", np.array([found.truth["delay"]])), "time_offset")
    assert left < 25.0


def test_items_are_the_same_for_the_same_secret_and_every_kind_can_be_made():
    first, again, other = item("a", 3), item("a", 3), item("b", 3)
    assert json.dumps(first.truth(), default=float) == json.dumps(again.truth(), default=float)
    assert first.name != other.name
    assert [item("all", n, (kind,), reference=True).kind for n, kind in enumerate(KINDS)] == list(KINDS)
    assert {scene(np.random.default_rng(n), hard=hard).hard for n, hard in enumerate(HARD)} == set(HARD)


def test_drives_are_sealed_carry_no_hint_and_can_be_read(tmp_path):
    published = generate(
        range(2), "seal", tmp_path / "drives", tmp_path / "keys" / "0.json", kinds=("single",)
    )
    key = opened(tmp_path / "keys" / "0.json", published)
    assert len(key) == 2
    names = {entry["name"] for entry in key}
    for path in (tmp_path / "drives").glob("*.npz"):
        assert path.stem in names
        with np.load(path) as arrays:
            assert set(arrays.files) == {
                "imu_t", "gyro", "accel", "gnss_t", "gnss_llh", "gnss_vned", "gnss_pstd", "gnss_vstd", "meta",
            }  # fmt: skip
            assert set(json.loads(str(arrays["meta"]))) == {
                "imu_frame",
                "mounting_rpy_deg",
                "lever_arm_frd_m",
            }
        assert read_drive(path).notes == ()
        config = configured(path.with_suffix(".sensor.yaml"))
        assert set(config.channels) == {f"{s}_{a}" for s in ("gyro", "accel") for a in "xyz"}
    (tmp_path / "keys" / "0.json").write_text("[]")
    with pytest.raises(ValueError, match="not the key"):
        opened(tmp_path / "keys" / "0.json", published)


def test_the_sheets_say_what_the_scene_has(tmp_path):
    for kind, text in zip(("sensor", "gnss"), sheets(SCENE), strict=True):
        (tmp_path / f"x.{kind}.yaml").write_text(text, encoding="utf-8")
    config = configured(tmp_path / "x.sensor.yaml")
    assert config.channels["gyro_x"].white_density == pytest.approx(SCENE.arw, rel=1e-6)
    assert config.channels["accel_z"].white_density == pytest.approx(SCENE.vrw, rel=1e-6)
    assert config.channels["gyro_z"].constant_sd == pytest.approx(SCENE.gyro_bias, rel=0.01)
    assert config.gnss is not None
    assert config.gnss.position_sd == pytest.approx(SCENE.position_sd)
