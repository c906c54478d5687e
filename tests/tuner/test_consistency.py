"""Scores of filters: a linear-Gaussian oracle, and the error-state filter on sensors it believes or does not.

The oracle is the best filter of a linear system, so that mean NEES = n and mean NIS = m exactly; every wrong
belief must show. Chance of a false failure below 1e-4 where statistics decide.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from models.trajectories import TRAJECTORIES
from tuner.check import check
from tuner.cli import run
from tuner.consistency import evaluate, innovation_scores, score, squares, whiteness
from tuner.grades import grade_identification, load_gnss, load_grade
from tuner.navigation.sensor import sensor_of_config, sensor_of_grade
from tuner.navigation.settings import filter_settings
from tuner.navigation.simulate import outage_windows, scenario, simulate
from tuner.results import MarkovState
from tuner.synthesis import synthesize

STEP = 1.0
BLIND = 100


def oracle(rng, runs, epochs, *, q=1.0, r=1.0, memory=1.0, believed_states=2):
    """Angle, rate bias (two Gauss–Markov states) measured as an angle; the filter believes factors of it all.

    Returns errors of angle and total bias with their covariances, innovations, and the square of the angle
    error over its prediction `BLIND` steps after the last measurement.
    """
    times, sds, white, noise = np.array([20.0, 400.0]), np.array([0.02, 0.03]), 0.02, 0.5

    def system(times, scale, count):
        times = times[:count]
        phi = np.eye(1 + count)
        phi[0, 1:] = STEP
        phi[range(1, 1 + count), range(1, 1 + count)] = np.exp(-STEP / times)
        drive = sds[:count] ** 2 * scale * -np.expm1(-2.0 * STEP / times)
        return phi, np.diag([white**2 * STEP * scale, *drive])

    (phi, drive), (f, big_q) = system(times, 1.0, 2), system(times * memory, q, believed_states)
    n = len(f)
    x = np.concatenate([np.zeros((runs, 1)), sds * rng.standard_normal((runs, 2))], axis=1)
    m, p, cov_r = np.zeros((runs, n)), np.diag([0.0, *sds[: n - 1] ** 2 * q]), noise**2 * r
    total = np.zeros((2, n))
    total[0, 0], total[1, 1:] = 1.0, 1.0
    out = {"error": [], "covariance": [], "z": [], "s": []}
    for _ in range(epochs):
        x = x @ phi.T + rng.standard_normal((runs, 3)) * np.sqrt(np.diag(drive))
        m, p = m @ f.T, f @ p @ f.T + big_q
        s = p[0, 0] + cov_r
        z = x[:, 0] + noise * rng.standard_normal(runs) - m[:, 0]
        k = p[:, 0] / s
        m, p = m + z[:, None] * k, p - np.outer(k, k) * s
        out["error"].append(np.stack([x[:, 0], x[:, 1:].sum(axis=1)], axis=-1) - m @ total.T)
        out["covariance"].append(np.broadcast_to(total @ p @ total.T, (runs, 2, 2)))
        out["z"].append(z)
        out["s"].append(np.full(runs, s))
    for _ in range(BLIND):
        x = x @ phi.T + rng.standard_normal((runs, 3)) * np.sqrt(np.diag(drive))
        m, p = m @ f.T, f @ p @ f.T + big_q
    blind = (x[:, 0] - m[:, 0]) ** 2 / p[0, 0]
    return {name: np.stack(values, axis=1) for name, values in out.items()} | {"blind": blind[:, None]}


def judged(data, first=100, every=20):
    nees = score(
        "nees", list(squares(data["error"][:, first::every], data["covariance"][:, first::every])), 2
    )
    nis = score("nis", list(data["z"] ** 2 / data["s"]), 1)
    return nees, nis, score("outage", list(data["blind"]), 1)


def correlation(data):
    """Whiteness of the oracle's innovations, dressed as three like components."""
    runs, epochs = data["z"].shape
    z = np.zeros((runs, epochs, 6))
    s = np.tile(np.eye(6), (runs, epochs, 1, 1))
    z[..., 0] = data["z"]
    s[..., 0, 0] = data["s"]
    z[..., 1], z[..., 2], s[..., 1, 1], s[..., 2, 2] = z[..., 0], z[..., 0], s[..., 0, 0], s[..., 0, 0]
    use = np.tile([1, 0], (runs, epochs, 1))
    return whiteness(STEP * np.arange(epochs), list(z), list(s), list(use))


def test_oracle_has_its_expectations():
    rng = np.random.default_rng(1)
    nees, nis, outage = judged(oracle(rng, 400, 500))
    assert outage.consistent
    assert nees.mean == pytest.approx(2.0, abs=5.0 * np.sqrt(4.0 / nees.effective) * np.sqrt(2.0))
    assert nis.mean == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / nis.effective))


def test_right_belief_passes_in_a_hundred_studies():
    rng = np.random.default_rng(2)
    passed = 0
    for _ in range(100):
        data = oracle(rng, 30, 400)
        passed += all(s.consistent for s in judged(data)) and correlation(data).consistent
    assert passed >= 98


@pytest.mark.parametrize(
    ("belief", "optimistic"),
    [
        ({"q": 0.1}, True),
        ({"q": 10.0}, False),
        ({"r": 0.3}, True),
        ({"r": 3.0}, False),
        ({"memory": 10.0}, True),
        ({"believed_states": 1}, True),
    ],
    ids=["Q×0.1", "Q×10", "R×0.3", "R×3", "T×10", "ladder cut short"],
)
def test_wrong_belief_is_flagged_in_fifty_studies(belief, optimistic):
    rng = np.random.default_rng(3)
    flagged = 0
    for _ in range(50):
        scores = judged(oracle(rng, 30, 400, **belief))
        bad = [s for s in scores if not s.consistent]
        flagged += bool(bad) and all((s.ratio > 1.0) == optimistic for s in bad)
        if "r" in belief:
            assert not scores[1].consistent
    assert flagged >= 48


def test_correlated_innovations_are_seen():
    rng = np.random.default_rng(4)
    found = correlation(oracle(rng, 30, 400, q=0.01))
    assert not found.consistent
    assert found.correlation > 0.1


def test_few_groups_do_not_pretend():
    rng = np.random.default_rng(5)
    shared = rng.standard_normal((4, 1)) ** 2 * np.ones((4, 1000))
    assert score("x", list(shared), 1).effective < 40.0
    free = rng.standard_normal((40, 100)) ** 2
    assert score("x", list(free), 1).effective > 1000.0


def test_innovations_of_refused_fixes_do_not_count():
    z, s = np.ones((10, 6)), np.tile(np.eye(6), (10, 1, 1))
    z[3] = 100.0
    use = np.ones((10, 2), dtype=np.int64)
    use[3] = 2
    (nis, position, _) = innovation_scores([z], [s], [use])
    assert nis.mean == pytest.approx(6.0)
    assert position.mean == pytest.approx(3.0)


def configuration(grade="mpu9250", receiver="spp"):
    return synthesize(grade_identification(load_grade(grade)), gnss=load_gnss(receiver))


def scaled(config, *, q=1.0, r=1.0, memory=1.0, rungs=None):
    channels = {
        axis: replace(
            c,
            white_density=c.white_density * np.sqrt(q),
            random_walk_density=c.random_walk_density * np.sqrt(q),
            markov=tuple(MarkovState(m.sd * np.sqrt(q), m.time_constant * memory) for m in c.markov[:rungs]),
        )
        for axis, c in config.channels.items()
    }
    receiver = replace(config.gnss, position_sd=tuple(np.sqrt(r) * x for x in config.gnss.position_sd))
    return replace(config, channels=channels, gnss=receiver)


@pytest.fixture(scope="module")
def town():
    return scenario(TRAJECTORIES["city"](1500.0), load_gnss("spp"), 0.02)


def flown(believed, town, *, runs=12, seed=11):
    truth = sensor_of_config(configuration())
    return evaluate(simulate(filter_settings(believed), truth, town, runs=runs, seed=seed), town.outages)


def test_honest_filter_on_its_own_sensor(town):
    found = flown(configuration(), town)
    assert found.consistent, [s for s in found.scores if not s.consistent]
    assert 0.9 < found.nees.ratio < 1.1
    assert [outage.seconds for outage in found.outages] == [10.0, 30.0, 60.0, 300.0]
    assert found.gated < 1e-3


@pytest.mark.parametrize(
    ("belief", "names"),
    [
        ({"q": 0.1}, {"gyro_bias", "accel_bias"}),
        ({"r": 0.3}, {"nis_position"}),
        ({"rungs": 1}, {"gyro_bias", "accel_bias"}),
    ],
    ids=["Q", "R", "ladder"],
)
def test_wrong_filter_is_flagged_where_it_is_wrong(town, belief, names):
    found = flown(scaled(configuration(), **belief), town)
    bad = {s.name for s in found.scores if not s.consistent}
    assert names <= bad
    assert not found.consistent
    if "q" in belief:
        # The innovations of position hardly show it.
        assert "nis_position" not in bad
        assert max(outage.score.ratio for outage in found.outages) > 2.0


def test_runs_do_not_depend_on_threads(town):
    a = simulate(filter_settings(configuration()), sensor_of_config(configuration()), town, runs=3, seed=5)
    b = simulate(filter_settings(configuration()), sensor_of_config(configuration()), town, runs=2, seed=5)
    np.testing.assert_array_equal(a.error[:2], b.error)


def test_truth_of_another_sensor_is_noticed():
    config = configuration("adis16465", "dgnss")
    found = check(config, TRAJECTORIES["city"](600.0), sensor=sensor_of_grade(load_grade("mpu9250")), runs=6)
    assert not found.consistency.consistent
    assert found.consistency.nees.ratio > 1.5
    assert found.consistency.verdicts


def test_outage_windows_fit():
    assert outage_windows(1000.0).shape == (0, 2)
    np.testing.assert_allclose(outage_windows(2200.0), [[900.0, 1200.0], [1800.0, 2100.0]])


def test_check_from_the_command_line(tmp_path, capsys):
    file = tmp_path / "check.json"
    arguments = ["check", "stim300", "--gnss", "rtk", "--runs", "4", "--duration", "300", "--quiet"]
    assert run([*arguments, "--json", str(file)]) == 0
    content = json.loads(file.read_text(encoding="utf-8"))
    assert content["schema"] == "tuner.consistency/1"
    assert content["nees"]["dof"] == 15
    assert content["consistent"] is True
    assert "consistent" in capsys.readouterr().out
    assert run([*arguments, "--truth", "mpu9250", "--strict"]) == 1
    capsys.readouterr()
    for bad in (["check", "nothing"], ["check", "stim300", "--trajectory", "moon"]):
        assert run(bad) == 2
        assert capsys.readouterr().err.count("\n") == 1
