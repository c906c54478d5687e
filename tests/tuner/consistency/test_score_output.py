"""Scores of any filter's output: the verdicts of `check` on its own runs, laws on arrays, alignment, bad input."""

from __future__ import annotations

import functools
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import tuner
from models import rotation
from models.earth import llh_displaced
from models.trajectory.catalogue import TRAJECTORIES
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.cli import run
from tuner.consistency import score_output
from tuner.consistency.output_errors import output_errors
from tuner.consistency.output_scores import error_scores
from tuner.consistency.score_output import _without_contradicted, score_outputs
from tuner.consistency.scores import evaluate
from tuner.navigation.data import USED
from tuner.navigation.settings import filter_settings
from tuner.simulation.imu import sensor_of_config
from tuner.simulation.monte_carlo import simulate
from tuner.simulation.scenario import scenario
from tuner.synthesis import synthesize
from tuner.types.consistency import Score
from tuner.types.filter_output import filter_output
from tuner.types.output_score import OutputCause
from tuner.types.records import DataError
from tuner.types.verdict import VerdictCode


def outputs_of(runs, plan):
    """Estimates of simulated runs as any filter would write them, and the truth."""
    truth = plan.truth
    outputs = []
    for i in range(len(runs.error)):
        e = runs.error[i]
        used = np.repeat(runs.use[i] == USED, 3, axis=1)
        z = np.where(used, runs.innovation[i], np.nan)
        outputs.append(
            filter_output(
                f"run {i}",
                runs.t,
                llh=llh_displaced(truth.llh, -e[:, :3]),
                vel_n=truth.vel_n - e[:, 3:6],
                quat_nb=rotation.quat_multiply(rotation.quat_from_rotvec(-e[:, 6:9]), truth.quat_nb),
                bias=-e[:, 9:],
                covariance=runs.covariance[i].astype(float),
                correlated=True,
                innovation=z,
                innovation_covariance=runs.innovation_covariance[i].astype(float),
                outages=plan.outages,
            )
        )
    reference = filter_output(
        "truth",
        runs.t,
        llh=truth.llh,
        vel_n=truth.vel_n,
        quat_nb=truth.quat_nb,
        bias=np.zeros((len(runs.t), 6)),
    )
    return outputs, reference


@functools.cache
def simulated_runs(runs, duration):
    config = synthesize(grade_identification(load_grade("mpu9250")), gnss=load_gnss("spp"))
    plan = scenario(TRAJECTORIES["city"](duration), load_gnss("spp"), 0.02)
    settings = filter_settings(config)
    return simulate(settings, sensor_of_config(config), plan, runs=runs, seed=11), plan


def checked_runs(*, q=1.0, runs=12, duration=1200.0):
    simulated, plan = simulated_runs(runs, duration)
    if q != 1.0:
        simulated = replace(simulated, covariance=simulated.covariance * np.float32(q))
    return evaluate(simulated, plan.outages), *outputs_of(simulated, plan)


def test_runs_of_our_filter_get_the_scores_of_check_where_it_is_not_consistent():
    own, outputs, truth = checked_runs(q=0.5)
    nees, blocks = error_scores([output_errors(output, truth) for output in outputs])
    for one, other in zip((nees, *blocks), (own.nees, *own.blocks), strict=True):
        assert one.mean == pytest.approx(other.mean, rel=1e-3), one.name
        assert one.consistent is other.consistent


def test_runs_of_our_filter_get_the_verdicts_of_check():
    own, outputs, truth = checked_runs()
    scored = score_outputs(outputs, [truth]).consistency
    assert scored.consistent is own.consistent is True
    assert [s.name for s in scored.scores] == [s.name for s in own.scores]
    for one, other in zip(scored.scores, own.scores, strict=True):
        assert one.mean == pytest.approx(other.mean, rel=1e-3), one.name
        assert one.consistent is other.consistent
    assert scored.whiteness.correlation == pytest.approx(own.whiteness.correlation, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("q", [1.0, 0.5, 2.0])
def test_two_hundred_runs_of_our_filter_get_the_verdicts_of_check(q):
    # Twenty minutes: a tenth of these is as long as `check` lets a filter settle.
    own, outputs, truth = checked_runs(q=q, runs=200, duration=1200.0)
    scored = score_outputs(outputs, [truth]).consistency
    assert scored.consistent is own.consistent is (q == 1.0)
    for one, other in zip((scored.nees, *scored.blocks), (own.nees, *own.blocks), strict=True):
        assert one.name == other.name
        assert one.mean == pytest.approx(other.mean, rel=1e-3), one.name
        assert one.consistent is other.consistent, one.name


def test_arrays_of_a_consistent_monte_carlo_pass_and_a_small_covariance_does_not():
    rng = np.random.default_rng(3)
    a = rng.standard_normal((4, 4))
    p = a @ a.T + np.eye(4)
    e = rng.standard_normal((50, 20, 4)) @ np.linalg.cholesky(p).T
    assert tuner.score(e, p).consistent
    found = tuner.score(e, p / 2.0)
    assert not found.consistent
    assert found.nees.ratio == pytest.approx(np.sqrt(2.0), rel=0.03)


def test_each_state_of_an_array_has_a_score_of_its_own():
    """Of two states the second errs twice as much as predicted: its ratio is 2, and that of both √(5/2)."""
    e = np.random.default_rng(5).standard_normal((40, 1, 2)) * [1.0, 2.0]
    found = tuner.score(e, np.eye(2), names=("bias", "scale"))
    assert [one.name for one in found.blocks] == ["bias", "scale"]
    # A mean square of 40 numbers has the relative sd √(2/40) = 0.22; five of them.
    for score, ratio in zip((*found.blocks, found.nees), (1.0, 2.0, np.sqrt(2.5)), strict=True):
        assert abs(score.ratio**2 / ratio**2 - 1.0) < 5.0 * np.sqrt(2.0 / 40.0)
    assert [one.consistent for one in found.blocks] == [True, False]
    assert tuner.score(e[..., :1], np.eye(1)).blocks == ()


def test_correlation_in_time_widens_the_band_of_one_run():
    rng = np.random.default_rng(4)
    white = rng.standard_normal((2000, 2))
    slow = np.empty_like(white)
    slow[0] = white[0]
    for k in range(1, len(white)):
        slow[k] = 0.99 * slow[k - 1] + np.sqrt(1.0 - 0.99**2) * white[k]
    one, other = tuner.score(white, np.eye(2)).nees, tuner.score(slow, np.eye(2)).nees
    # 1 + 2 Σ ρ² = (1 + a²)/(1 − a²) = 99.5 of a first-order process with a = 0.99
    assert one.effective == pytest.approx(4000.0, rel=0.1)
    assert other.effective == pytest.approx(4000.0 / 99.5, rel=0.4)


def test_nothing_to_score_by_is_said_in_one_line():
    t = np.arange(10.0)
    output = filter_output("a.csv", t, local=np.zeros((10, 3)))
    with pytest.raises(DataError, match=r"a\.csv: expected a truth .* or innovations"):
        score_outputs([output])


def test_a_covariance_that_is_not_positive_definite_is_refused_with_its_time():
    t = np.arange(50.0)
    cov = np.full((50, 15, 15), np.nan)
    cov[:, :3, :3] = np.eye(3)
    cov[7, 0, 1] = cov[7, 1, 0] = 1.5
    one = filter_output("run", t, local=np.zeros((50, 3)), covariance=cov, correlated=True)
    with pytest.raises(
        DataError, match=r"^run: expected covariances that are positive definite, .* at 7\.000 s"
    ):
        score_outputs([one], [filter_output("truth", t, local=np.zeros((50, 3)))])


@pytest.mark.parametrize(("factor", "kept"), [(2.1, True), (10.1, False)])
def test_a_factor_that_its_own_score_contradicts_is_no_cause(factor, kept):
    """Errors of 2 sds at every epoch are no errors of a filter with ten times the covariance."""
    nees = Score("position", 12.0, 3, 300.0, (0.8 * 3, 1.3 * 3))
    cause = OutputCause("noise_scale", factor, (0.95 * factor, 1.05 * factor), "1", 100.0)
    assert bool(_without_contradicted((cause,), (nees,))) is kept


@pytest.mark.parametrize(("factor", "kept"), [(1.3, False), (0.2, True)])
def test_a_factor_on_r_alone_moves_a_score_no_further_than_the_factor(factor, kept):
    """Errors of 0.26 of what is predicted had the advice to multiply the sds of fixes by 1.28."""
    nees = Score("position", 3.0 * 0.26**2, 3, 300.0, (2.6, 3.4))
    cause = OutputCause("gnss_noise_scale", factor, (0.9 * factor, 1.1 * factor), "", 100.0)
    assert bool(_without_contradicted((cause,), (nees,))) is kept


def wandering(n, seed=3):
    """A course of n seconds as truth, and an estimate of it with errors of ten times their sds."""
    rng, t = np.random.default_rng(seed), np.arange(float(n))
    course = np.cumsum(np.cumsum(rng.standard_normal((n, 3)), axis=0), axis=0)
    cov = np.full((n, 15, 15), np.nan)
    cov[:, :3, :3] = 0.01 * np.eye(3)
    estimate = course + rng.standard_normal((n, 3))
    return (filter_output("run", t, local=one, covariance=cov, correlated=True) for one in (course, estimate))


def test_sds_of_too_few_epochs_are_not_said_to_lack():
    """Two epochs "state no sds", and "no error is known" stood beside the error."""
    truth, estimate = wandering(2)
    found = score_outputs([estimate], [filter_output("truth", truth.t, local=truth.local)])
    assert found.consistency.honesty.reasons == ("no error can be compared with its sd",)
    assert any(note.startswith("2 epochs are too few") for note in found.notes)


def test_where_no_cause_is_sought_none_is_missed(monkeypatch):
    truth, estimate = wandering(400)
    monkeypatch.setattr(score_output, "explain", lambda *_, **__: ((), 0.07))
    monkeypatch.setattr(score_output, "one_factor", lambda *_: None)
    found = score_outputs([estimate], [filter_output("truth", truth.t, local=truth.local)])
    assert any("no cause is sought" in note for note in found.notes)
    assert VerdictCode.NOT_EXPLAINED not in [one.code for one in found.consistency.verdicts]


def test_errors_that_grow_diverge_and_large_ones_that_stay_do_not(monkeypatch):
    """A datum 50 m off was "diverged"; errors that 400 s bring to 800 m are."""
    monkeypatch.setattr(score_output, "explain", lambda *_, **__: ((), 0.07))
    truth, estimate = wandering(400)
    reference = filter_output("truth", truth.t, local=truth.local)
    growing = replace(estimate, local=estimate.local + np.outer(np.exp(truth.t / 60.0), [1.0, -1.0, 0.0]))
    assert score_outputs([growing], [reference]).consistency.diverged
    far = replace(estimate, local=estimate.local + 50.0 * np.random.default_rng(1).standard_normal((400, 3)))
    assert not score_outputs([far], [reference]).consistency.diverged


def _still(name: str, shift: float):
    t = np.arange(100.0)
    rng = np.random.default_rng(3)
    return filter_output(
        name, t, local=rng.normal(shift, 1.0, (100, 3)), covariance=np.broadcast_to(np.eye(15), (100, 15, 15))
    )


def test_a_run_that_comes_twice_and_an_outage_outside_of_all_runs_are_refused():
    one, other = _still("one", 0.0), _still("other", 0.1)
    truth = filter_output("truth", one.t, local=np.zeros((100, 3)))
    with pytest.raises(DataError, match=r"^copy: expected runs that differ, found the numbers of one again"):
        score_outputs([one, other, replace(one, name="copy")], [truth])
    with pytest.raises(
        DataError, match=r"^outage 1e\+300,2e\+300: expected times of the estimates, 0 to 99 s"
    ):
        score_outputs([one, other], [truth], outages=[(10.0, 20.0), (1e300, 2e300)])
    assert score_outputs([one, other], [truth], outages=[(90.0, 2e300)]).consistency.consistent


def test_covariances_that_are_not_symmetric_are_refused():
    """Cholesky reads one triangle alone: [[1, 5], [0, 1]] was honest."""
    e = np.random.default_rng(1).normal(size=(50, 2))
    with pytest.raises(
        DataError, match=r"^covariances: expected symmetric matrices, found 5 of states 1 and 2 and 0 of"
    ):
        tuner.score(e, [[1, 5], [0, 1]])
    rounded = np.array([[1.0, 0.2], [0.2, 1.0]], dtype=np.float32) * np.float32(1.0 / 3.0)
    rounded[0, 1] = np.nextafter(rounded[0, 1], np.float32(1.0))
    assert tuner.score(e, rounded).nees is not None


@pytest.mark.parametrize(
    ("sds", "names", "why"),
    [
        (-1.0, None, "expected sds above 0, found -1"),
        (np.nan, None, "expected finite numbers, found NaN or infinite ones"),
        (1.0, ("a", "a"), "expected 2 different names of states, found a, a"),
    ],
)
def test_arrays_that_no_filter_states_are_refused(sds, names, why):
    """Negative sds were honest, of NaN the errors were not finite, and of two states of one name one was lost."""
    e = np.random.default_rng(4).standard_normal((20, 50, 2))
    with pytest.raises(DataError, match=why):
        tuner.score(e, np.full_like(e, sds), names=names)


def test_the_row_behind_an_outage_is_not_its_end():
    """Stamps a billionth of a second late: the first row with a fix again was the position after 30 s without."""
    t = 1.000000001 * np.arange(200.0)
    inside = (t > 100.0) & (t <= 130.0)
    errors = np.where(inside, 50.0, 0.1)[:, None] * np.ones(3)
    cov = np.tile(np.eye(15), (200, 1, 1))
    found = score_outputs(
        [filter_output("run", t, local=errors, covariance=cov)],
        [filter_output("truth", t, local=np.zeros((200, 3)))],
        outages=[[100.0, 130.0]],
    )
    (longest,) = (one for one in found.consistency.outages if one.seconds == 30.0)
    assert longest.rms > 40.0


def test_a_cause_that_makes_errors_larger_than_measured_is_not_named(tmp_path):
    """Sds of positions halved: a bias of 0.36 deg/s was missing, which makes attitudes 190 times their errors."""
    rng, t = np.random.default_rng(2), np.arange(1200.0)
    north, east, down = -480.0 * np.cos(t / 40.0), 660.0 * np.sin(t / 55.0), -12.0 * np.cos(t / 60.0)
    vn, ve, vd = 12.0 * np.sin(t / 40.0), 12.0 * np.cos(t / 55.0), 0.2 * np.sin(t / 60.0)
    columns = ("t", "n", "e", "d", "vn", "ve", "vd", "roll", "pitch", "yaw")
    yaw = np.degrees(np.arctan2(ve, vn))
    truth = np.column_stack(
        [t, north, east, down, vn, ve, vd, 2.0 * np.sin(t / 31.0), 3.0 * np.sin(t / 23.0), yaw]
    )
    sds = np.array([0.8, 0.8, 1.2, 0.05, 0.05, 0.05, 0.2, 0.2, 0.6])
    errors = rng.standard_normal((len(t), 9)) * sds
    for first, time in ((0, 8.0), (3, 6.0), (6, 20.0)):
        keep = np.exp(-1.0 / time)
        block = errors[:, first : first + 3]
        errors[:, first : first + 3] = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], block, axis=0)
    stated = np.tile(sds * np.repeat([0.5, 1.0, 1.0], 3), (len(t), 1))
    files = {"truth": (columns, truth)}
    files["output"] = (
        (*columns, *(f"sd_{name}" for name in columns[1:])),
        np.column_stack([truth + np.column_stack([0 * t, errors]), stated]),
    )
    for name, (header, rows) in files.items():
        np.savetxt(tmp_path / f"{name}.csv", rows, delimiter=",", header=",".join(header), comments="")
    command = ["score", "output.csv", "--truth", "truth.csv", "--json", "found.json", "--quiet"]
    assert run([str(tmp_path / one) if one.endswith((".csv", ".json")) else one for one in command]) == 0
    causes = json.loads((tmp_path / "found.json").read_text())["causes"]
    assert "missing_state" not in [one["cause"] for one in causes]
