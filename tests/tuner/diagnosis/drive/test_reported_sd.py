"""Standard deviations reported by a receiver: their relation to the truth; adaptive R against maximum likelihood."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.tuner.diagnosis.drive.replicas import Source
from tests.tuner.diagnosis.drive.sage_husa import sage_husa
from tuner.diagnosis.drive.causes.rejected_solutions import rejected_solutions
from tuner.diagnosis.drive.causes.reported_sd import choose_sd_model, class_edges, reported_sd_test
from tuner.diagnosis.drive.linear_model.noise_fit import maximize_likelihood
from tuner.diagnosis.drive.linear_model.noise_parameters import ROW_GROUPS, noise_parameters
from tuner.linear_run.likelihood import NoiseHypothesis, as_configured, evaluate
from tuner.linear_run.linearized_run import LinearizedRun
from tuner.navigation.fix_sd_model import fix_sd_model
from tuner.types import Compensation


def reporting(linearized: LinearizedRun, level: np.ndarray, truth: np.ndarray, seed: int) -> NoiseHypothesis:
    """Draw a run whose receiver reports `level` (k,) times the usual sds; the true ones are `truth` times them."""
    reported = linearized.sd * level[:, None]
    reporting_run = replace(linearized, reported_sd=reported, sd=reported)
    true = replace(as_configured(reporting_run), sd=linearized.sd * truth[:, None])
    return as_configured(Source.of(true).draw(np.random.default_rng(seed)))


def test_classes_are_parted_where_the_sd_jumps() -> None:
    rng = np.random.default_rng(0)
    sd = np.concatenate(
        [rng.uniform(0.01, 0.015, 300), rng.uniform(0.3, 0.5, 200), rng.uniform(2.0, 3.0, 100)]
    )
    first, second = class_edges(sd)
    assert 0.015 < first < 0.3
    assert 0.5 < second < 2.0
    assert not class_edges(rng.uniform(1.0, 3.0, 500))
    assert not class_edges(np.append(sd[:300], [5.0, 6.0])), "two fixes are no class"


def test_constant_reported_sds_have_no_model(city_drive: LinearizedRun) -> None:
    assert choose_sd_model(as_configured(city_drive), "position") is None


@pytest.mark.parametrize("kind", ["factor", "classes", "power", "uninformative"])
def test_the_model_of_reported_sds_is_found(city_drive: LinearizedRun, kind: str) -> None:
    rng = np.random.default_rng(4)
    level = np.exp(0.6 * rng.standard_normal(900))
    if kind == "classes":
        level = np.repeat([0.05, 1.0], (400, 500)) * rng.uniform(1.0, 1.8, 900)
    truth = {
        "factor": 1.3 * level,
        "classes": level * np.where(level < 0.5, 3.0, 0.8),
        "power": 1.1 * level**0.4,
        "uninformative": np.full(900, 1.4),
    }[kind]
    noise = reporting(city_drive, level, truth, 7)
    model, test = choose_sd_model(noise, "position"), reported_sd_test(noise, "position")
    if kind == "factor":
        assert model is None or model.kind == "factor"
        assert test is None
        return
    assert model.kind == ("classes" if kind == "classes" else "power")
    assert model.p_value < 1e-9
    estimates = test.describe()
    if kind == "classes":
        for name, value in (("class_0", 3.0), ("class_1", 0.8)):
            assert estimates[f"position_horizontal_{name}"].value == pytest.approx(value, rel=0.2)
            assert estimates[f"position_vertical_{name}"].value == pytest.approx(value, rel=0.25)
    else:
        assert estimates["position_exponent"].value == pytest.approx(
            {"power": 0.4, "uninformative": 0.0}[kind], abs=0.15
        )
    expected = fix_sd_model(test.sd_model, "position").sds(
        noise.linearized.reported_sd[:, :3], noise.linearized.solution
    )
    np.testing.assert_allclose(test.noise.sd[:, :3], expected, rtol=1e-9)


def test_stated_solutions_have_sds_of_their_own(city_drive: LinearizedRun) -> None:
    """Reported sds are all alike, true ones three times them for float solutions: only the statement shows it."""
    solution = np.where(np.arange(900) % 7 < 2, 5.0, 4.0)
    truth = np.where(solution == 5.0, 3.0, 0.8)
    stating = replace(city_drive, solution=solution)
    noise = reporting(stating, np.ones(900), truth, 7)
    model, test = choose_sd_model(noise, "position"), reported_sd_test(noise, "position")
    assert model.kind == "solutions"
    estimates = test.describe()
    for c, value in enumerate((0.8, 3.0)):
        assert estimates[f"position_horizontal_class_{c}"].value == pytest.approx(value, rel=0.2)
    sds = fix_sd_model(test.sd_model, "position")
    np.testing.assert_allclose(sds.sds(noise.linearized.reported_sd[:, :3], solution), test.noise.sd[:, :3])
    unknown = sds.sds(np.ones((2, 3)), np.array([1.0, np.nan]))
    np.testing.assert_array_equal(unknown, np.ones((2, 3))), "what the drive did not show stays as reported"
    assert choose_sd_model(reporting(stating, np.ones(900), np.full(900, 1.3), 8), "position") is None


def test_a_solution_that_the_gate_rejects_is_told_before_its_fixes(city_drive: LinearizedRun) -> None:
    rng = np.random.default_rng(3)
    solution = np.where(np.arange(900) % 12 == 0, 4.0, 1.0)
    wrong = (solution == 4.0)[:, None] & (np.arange(6) < 3)
    sd = np.where(wrong, 0.01, city_drive.sd)
    innovation = np.where(wrong, 5.0 * rng.standard_normal((900, 6)), city_drive.innovation)
    rejecting = replace(
        city_drive, solution=solution, sd=sd, innovation=innovation, used=city_drive.available & ~wrong
    )
    run = SimpleNamespace(linearized=rejecting, hypothesis=SimpleNamespace(compensation=Compensation()))
    values, p_value = rejected_solutions(run, 1e-3)
    assert p_value < 1e-20
    assert values["position_horizontal_class_1"] == pytest.approx(500.0, rel=0.3)
    assert not any(name.startswith("velocity") for name in values)
    honest = replace(rejecting, used=rejecting.available & (rng.random((900, 1)) > 0.2))
    assert rejected_solutions(SimpleNamespace(**{**vars(run), "linearized": honest}), 1e-3)[0] == {}


def test_adaptive_noise_follows_but_is_rough(city_drive: LinearizedRun) -> None:
    """R is 1.5 times what was configured: both find it; maximum likelihood is nearer and predicts better.

    The first half is learnt from, the second scored with what was learnt.
    """
    names = tuple(ROW_GROUPS)
    source = Source.of(
        noise_parameters(("position", "velocity")).change(as_configured(city_drive), np.log([1.5, 1.5]))
    )
    learnt, scored = (
        np.arange(900) < 450,
        np.arange(900) >= 450,
    )
    error: dict[str, list[float]] = {"likelihood": [], "adaptive": []}
    value: dict[str, float] = {"as configured": 0.0, "likelihood": 0.0, "adaptive": 0.0}
    for seed in range(6):
        linearized = source.draw(np.random.default_rng(seed))
        first, second = (as_configured(replace(linearized, scored=part)) for part in (learnt, scored))
        fit = maximize_likelihood(first, noise_parameters(names))
        trace, _ = sage_husa(first)
        logs = np.log([trace[name][449] for name in names])
        error["likelihood"] += (fit.estimate - np.log(1.5)).tolist()
        error["adaptive"] += (logs - np.log(1.5)).tolist()
        value["as configured"] += evaluate(second).value
        value["likelihood"] += evaluate(noise_parameters(names).change(second, fit.estimate)).value
        value["adaptive"] += evaluate(noise_parameters(names).change(second, logs)).value
    rms = {name: float(np.sqrt(np.mean(np.square(values)))) for name, values in error.items()}
    assert rms["likelihood"] < 0.05
    assert rms["adaptive"] < 0.3
    assert rms["likelihood"] < 0.5 * rms["adaptive"]
    assert value["likelihood"] > value["adaptive"] > value["as configured"]
