"""Sentences for verdicts on a filter: every code has one, with its figures in customary units."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from tuner.report.json.consistency import consistency_json, explanation_json
from tuner.report.verdict_text import explanation_text, observability_text, verdict_text
from tuner.types.consistency import Consistency, Observability, WeakDirection
from tuner.types.verdict import Explanation, ExplanationKind, Severity, Verdict, VerdictCode

DEGREE = math.radians(1.0)
SCALE = Explanation(ExplanationKind.SCALE, "gyro bias noise", 0.322, (0.303, 0.357), 1.0)
SMALL = Explanation(ExplanationKind.SCALE, "all sensor noise", 3.2, (3.0, 3.4), 1.0)
FASTER = Explanation(
    ExplanationKind.MISSING_FASTER, "gyro bias noise", 1.02, (0.88, 1.2), 1.0, time_constant=10.0
)
LONG = Explanation(
    ExplanationKind.TIME_CONSTANT, "gyro bias noise", 1 / 9, (1 / 32, 1 / 6), 1.0, equivalent=FASTER
)

EXPLANATIONS = {
    "gyro bias noise (sd) about 3.1 times (2.8 … 3.3) too large": SCALE,
    "all sensor noise (sd) about 3.2 times (3 … 3.4) too small": SMALL,
    "time constants of the gyro bias noise about 9 times (6 … 32) too long, or in other words: "
    "gyro bias noise a decade faster than the fastest state (10 s) is missing, "
    "about 1 times (0.88 … 1.2) as strong": LONG,
    "time constants of the gyro bias noise about 3 times too short": Explanation(
        ExplanationKind.TIME_CONSTANT, "gyro bias noise", 3.0, (3.0, 3.01), 1.0
    ),
    "gyro bias noise over decades slower than the slowest state (316 s) is missing, "
    "about 2 times (1.5 … 2.5) as strong": Explanation(
        ExplanationKind.MISSING_SLOWER, "gyro bias noise", 2.0, (1.5, 2.5), 1.0, 316.0
    ),
    "gyro bias noise a decade slower than the slowest state (1e+03 s) is missing, "
    "about 2 times (1.5 … 2.5) as strong": Explanation(
        ExplanationKind.MISSING_NEXT, "gyro bias noise", 2.0, (1.5, 2.5), 1.0, 1000.0
    ),
    "gyro bias noise a decade faster than the fastest state (10 s) is missing, "
    "about 1 times (0.88 … 1.2) as strong": FASTER,
    "errors of the position fixes that stay for some 100 s are missing, "
    "about 0.67 times (0.5 … 0.8) their white sd": Explanation(
        ExplanationKind.MISSING_CORRELATED, "position fixes", 0.667, (0.5, 0.8), 1.0, 100.0
    ),
    "the lever arm of the truth is 1.12 m off that of the filter": Explanation(
        ExplanationKind.INSTALLATION, "lever arm", 1.12, (1.12, 1.12), 0.0
    ),
    "the delay of the fixes of the truth is 0.2 s off that of the filter": Explanation(
        ExplanationKind.INSTALLATION, "delay of the fixes", -0.2, (-0.2, -0.2), 0.0
    ),
    "gyro bias noise over decades is missing": Explanation(
        ExplanationKind.MISSING_SLOWER, "gyro bias noise", 2.0, (1.5, 2.5), 1.0
    ),
    "gyro bias noise of some 10 s is missing": Explanation(
        ExplanationKind.MISSING_NEXT, "gyro bias noise", 2.0, (1.5, 2.5), 1.0
    ),
}

VERDICTS = {
    "the filter diverged: its output cannot be used": Verdict(VerdictCode.DIVERGED, Severity.DIVERGED),
    "the filter diverged: its errors are not finite": Verdict(VerdictCode.NOT_FINITE, Severity.DIVERGED),
    "the filter diverged in 6 of 12 runs: its output cannot be used": Verdict(
        VerdictCode.RUNS_DIVERGED, Severity.DIVERGED, numbers={"diverged_runs": 6, "runs": 12}
    ),
    "the filter diverged and refuses most of its fixes: its output cannot be used": Verdict(
        VerdictCode.FIXES_REFUSED, Severity.DIVERGED
    ),
    "its start (1 sd: attitude 2.9, 2.9, 10 deg, gyro constants 10, 10, 10 deg/s) is more than a linear filter always "
    "recovers from; let the vehicle stand to find the gyro biases first, and give it what is left of them as "
    "constants": Verdict(
        VerdictCode.START_NOT_LINEAR,
        Severity.EXPLANATION,
        numbers={
            "attitude_sd": (2.9 * DEGREE, 2.9 * DEGREE, 10.0 * DEGREE),
            "gyro_bias_sd": (10.0 * DEGREE,) * 3,
        },
    ),
    "the simulated errors are far larger than the filter is configured for: gyro white noise 85 times as large, "
    "gyro constants, configured as none": Verdict(
        VerdictCode.TRUTH_FAR,
        Severity.EXPLANATION,
        numbers={"gyro white noise": 85.2, "gyro constants": math.inf},
    ),
    "the filter takes its own errors for information: its heading has 10 deg (1 sd, while aided), where this "
    "motion supports 54 deg; its noise cannot be judged here: simulate turns and changes of speed, or begin with a "
    "smaller uncertainty": Verdict(
        VerdictCode.SPURIOUS_INFORMATION,
        Severity.EXPLANATION,
        "heading",
        {"filter_sd": 10.0 * DEGREE, "linear_sd": 54.0 * DEGREE},
    ),
    "all sensor noise (sd) about 3.2 times (3 … 3.4) too small: that explains the runs best": Verdict(
        VerdictCode.EXPLAINED, Severity.EXPLANATION, explanations=(SMALL,)
    ),
    "all sensor noise (sd) about 3.2 times (3 … 3.4) too small: that explains the runs best; not distinguished from "
    "it: gyro bias noise (sd) about 3.1 times (2.8 … 3.3) too large": Verdict(
        VerdictCode.EXPLAINED, Severity.EXPLANATION, explanations=(SMALL, SCALE)
    ),
    "no single cause explains the scores": Verdict(VerdictCode.NOT_EXPLAINED, Severity.EXPLANATION),
    "all states (root of NEES): 4.62 × what the filter predicts: optimistic": Verdict(
        VerdictCode.OPTIMISTIC, Severity.INCONSISTENT, "nees", {"ratio": 4.62}
    ),
    "position innovations (root of NIS): 0.87 × what the filter predicts: pessimistic": Verdict(
        VerdictCode.PESSIMISTIC, Severity.INCONSISTENT, "nis_position", {"ratio": 0.87}
    ),
    "position after 60 s without fixes: true 12.0 m, predicted 8.00 m (ratio 1.5, 1.1 … 2.4 with 5 windows): "
    "optimistic": Verdict(
        VerdictCode.OPTIMISTIC,
        Severity.INCONSISTENT,
        "outage 60 s",
        {"ratio": 1.5, "rms": 12.0, "predicted": 8.0, "interval": (1.1, 2.4), "windows": 5.0},
    ),
    "position after 60 s without fixes: 2.96 × what the filter predicts: optimistic": Verdict(
        VerdictCode.OPTIMISTIC, Severity.INCONSISTENT, "outage 60 s", {"ratio": 2.96}
    ),
    "the velocity innovations are correlated: -0.25 at lag 3, where white ones stay within ±0.12": Verdict(
        VerdictCode.CORRELATED_INNOVATIONS,
        Severity.INCONSISTENT,
        "velocity",
        {"correlation": -0.25, "lag": 3, "band": 0.12},
    ),
    "no score contradicts the filter: none is shown to be 10 % from its prediction": Verdict(
        VerdictCode.CONSISTENT, Severity.CONSISTENT
    ),
}


@pytest.mark.parametrize("sentence", EXPLANATIONS)
def test_explanations_in_words(sentence):
    assert explanation_text(EXPLANATIONS[sentence]) == sentence


@pytest.mark.parametrize("sentence", VERDICTS)
def test_verdicts_in_words(sentence):
    assert verdict_text(VERDICTS[sentence]) == sentence


def test_every_code_and_kind_has_its_words():
    assert {verdict.code for verdict in VERDICTS.values()} == set(VerdictCode)
    assert {explanation.kind for explanation in EXPLANATIONS.values()} == set(ExplanationKind)


def test_a_sentence_names_three_rivals_at_most():
    rivals = tuple(replace(SCALE, process=f"source {i}") for i in range(9))
    text = verdict_text(Verdict(VerdictCode.EXPLAINED, Severity.EXPLANATION, explanations=rivals))
    assert [f"source {i}" in text for i in range(9)] == [True] * 4 + [False] * 5


def test_states_that_a_trajectory_does_not_distinguish():
    weak = WeakDirection(("heading", "gyro bias x"), (0.7, 0.7), 2.0)
    left = {"heading": 0.9, "gyro bias x": 0.1, "position north": 0.01}
    assert observability_text(Observability(left, (weak,))) == (
        "cannot be distinguished on this trajectory: heading and gyro bias x (90 % and 10 % of their prior sd left)",
        "hardly better known than at the start: heading (90 %)",
    )


def test_json_has_sentences_codes_and_finite_numbers():
    verdicts = tuple(VERDICTS.values())
    found = Consistency(None, (), (), None, (), {}, 0.0, True, verdicts)
    content = json.loads(json.dumps(consistency_json(found, source={}), allow_nan=False))
    assert content["verdicts"] == list(VERDICTS)
    assert [entry["code"] for entry in content["verdict_codes"]] == [verdict.code for verdict in verdicts]
    by_code = {entry["code"]: entry for entry in content["verdict_codes"]}
    far = by_code["truth_far_from_configuration"]
    assert far["numbers"] == {"gyro white noise": 85.2, "gyro constants": None}
    assert by_code["initial_uncertainty_not_linear"]["numbers"]["gyro_bias_sd"] == pytest.approx(
        3 * [np.radians(10.0)]
    )
    assert by_code["explained"]["explanations"] == ["all sensor noise", "gyro bias noise"]
    assert by_code["spurious_information"]["subject"] == "heading"


def test_explanations_keep_their_names_in_json():
    assert explanation_json(FASTER) == {
        "source": "missing gyro bias noise (faster)",
        "ratio": 1.02,
        "interval": [0.88, 1.2],
        "misfit": 1.0,
        "text": "gyro bias noise a decade faster than the fastest state (10 s) is missing, "
        "about 1 times (0.88 … 1.2) as strong",
    }
    assert explanation_json(LONG)["source"] == "time constants of the gyro bias noise"
