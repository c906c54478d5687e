"""A change of a filter, judged by its outputs before and after: equal ones are not worse, worse ones are named."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from tuner.cli import run
from tuner.consistency.output_comparison import changed_scores, differences
from tuner.consistency.score_output import score_outputs
from tuner.types.filter_output import filter_output
from tuner.types.judgement import Use
from tuner.types.records import DataError

N, MEMORY = 1200, 5.0
T = np.arange(N) * 1.0
COURSE = np.column_stack([10.0 * T, 50.0 * np.sin(T / 40.0), np.zeros(N)])
TRUTH = filter_output("truth", T, local=COURSE)


def output(seed, size=1.0, sd=1.0, constant=0.0):
    """Positions with first-order Gauss–Markov errors of 5 s, and the sds that are stated of them."""
    keep = np.exp(-1.0 / MEMORY)
    drive = np.random.default_rng(seed).standard_normal((N + 100, 3))
    errors = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], drive, axis=0)[100:] + constant
    covariance = np.zeros((N, 15, 15))
    covariance[:, range(3), range(3)] = sd**2
    covariance[:, range(3, 15), range(3, 15)] = np.nan
    return filter_output(f"run{seed}", T, local=COURSE - size * errors, covariance=covariance)


def scored(*outputs):
    return score_outputs(outputs, [TRUTH])


def test_one_output_is_not_worse_than_itself():
    found = changed_scores(scored(output(1)), scored(output(1)))
    assert found.verdict.text == "not worse: every value is the same"


def test_equal_filters_are_not_called_worse():
    """Of 40 pairs none: at the level of 0.1 % more than one has a chance below 1e-3."""
    pairs = [(scored(output(2 * k)), scored(output(2 * k + 1))) for k in range(40)]
    words = [changed_scores(*pair).verdict.use for pair in pairs]
    assert words.count(Use.WORSE) + words.count(Use.BETTER) <= 1


def test_larger_errors_are_worse_and_the_other_way_round_better():
    before, after = scored(output(3)), scored(output(3, size=1.3))
    found = changed_scores(after, before)
    assert found.verdict.use is Use.WORSE
    assert found.scores[0].error[0] == pytest.approx(1.3)
    assert found.scores[0].error[1] < 1.3 < found.scores[0].error[2]
    assert changed_scores(before, after).verdict.use is Use.BETTER


def test_sds_that_no_longer_fit_are_worse_and_those_that_stay_honest_are_not():
    before = scored(output(4))
    found = changed_scores(scored(output(4, sd=0.4)), before)
    assert found.verdict.use is Use.WORSE
    assert "true ÷ predicted of position" in found.verdict.text
    assert changed_scores(scored(output(4, sd=0.9)), before).verdict.use is Use.NOT_WORSE


def test_an_error_that_stays_is_one_value():
    """It was as many as there are epochs: ten of a hundred equal filters were worse by their accelerometer biases."""
    found = changed_scores(
        scored(output(5, size=0.01, constant=100.0)), scored(output(6, size=0.01, constant=60.0))
    )
    assert found.verdict.use is Use.TOO_SHORT
    assert found.scores[0].count < 5.0


def test_an_output_that_ends_early_is_worse():
    whole = output(7)
    found = changed_scores(scored(whole.rows(slice(0, 900))), scored(whole))
    assert found.verdict.use is Use.WORSE
    assert "ends 300 s earlier" in found.verdict.text


def test_rates_may_differ():
    whole = output(8)
    found = changed_scores(scored(whole.rows(slice(0, None, 4))), scored(whole))
    assert found.verdict.use is Use.NOT_WORSE
    assert found.scores[0].error[0] == pytest.approx(1.0)


def test_without_a_truth_outputs_are_only_different():
    before = output(9)
    found = differences([replace(before, local=before.local + 0.3)], [before])
    assert found.verdict.use is Use.DIFFERENT
    assert "position by up to 0.300 of its sds" in found.verdict.text
    assert differences([before], [before]).verdict.text == "not worse: every value is the same"
    near = differences([replace(before, local=before.local + 0.01)], [before])
    assert near.verdict.text == "not worse: no value differs by 5 % of its sds or more"
    wider = differences([replace(before, covariance=1.21 * before.covariance)], [before])
    assert "sds 1.10 ×" in wider.verdict.text


def test_runs_are_paired():
    with pytest.raises(DataError, match="--against: expected one output for each of 2 estimates, found 1"):
        changed_scores(scored(output(1), output(2)), scored(output(1)))


@pytest.fixture
def files(tmp_path):
    """Outputs as PX4's estimator writes its change indicator, the later one with larger errors, and a truth."""
    paths = []
    for name, one in (("before", output(10)), ("after", output(10, size=1.4)), ("truth", TRUTH)):
        values = np.column_stack([1e6 * one.t, one.local, np.ones((N, 3))])
        paths.append(tmp_path / f"{name}.csv")
        heads = "Timestamp,state[7],state[8],state[9],variance[7],variance[8],variance[9]"
        np.savetxt(paths[-1], values, delimiter=",", header=heads, comments="")
    states = "t [us]=Timestamp,n=state[7],e=state[8],d=state[9]"
    sds = "cov_n_n=variance[7],cov_e_e=variance[8],cov_d_d=variance[9]"
    return *map(str, paths), f"{states},{sds}", states


def test_the_command_gates_a_change(files, tmp_path, capsys):
    before, after, truth, columns, states = files
    words = ["--against", before, "--columns", columns, "--truth-columns", states, "--strict"]
    stored = tmp_path / "change.json"
    assert (
        run(["score", after, "--truth", truth, *words, "--json", str(stored), "-o", str(tmp_path / "out")])
        == 1
    )
    assert json.loads(stored.read_text())["change"]["verdict"]["use"] == "worse"
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Is it worse than before?" in page
    assert "Verdict: worse: position errs 1.40" in capsys.readouterr().out
    assert run(["score", before, "--truth", truth, *words]) == 0
    assert run(["score", after, *words]) == 1
    assert "Verdict: different: position" in capsys.readouterr().out
    assert run(["score", after, *words, "-o", str(tmp_path / "other")]) == 2
