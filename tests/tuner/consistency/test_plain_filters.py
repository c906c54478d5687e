"""Outputs of filters without attitude, and sds that are no filter's: what is assumed, and which factor is wrong.

The filter is the textbook one of position and velocity: white acceleration of density q, positions at 1 Hz.
"""

from __future__ import annotations

import numpy as np
import pytest

from tuner.consistency.output_causes.course import course_of
from tuner.consistency.output_causes.filter_model import fit_filter
from tuner.consistency.score_output import score_outputs
from tuner.types.filter_output import filter_output

EPOCHS, DENSITY, FIX_SD = 500, 0.05, 2.0
T = np.arange(EPOCHS, dtype=float)


def kalman(seed, ratio):
    """Run on positions whose true sd is `ratio` times the assumed: truth, estimate, sds; (n, 3, 2) each."""
    rng = np.random.default_rng(seed)
    f = np.array([[1.0, 1.0], [0.0, 1.0]])
    q = DENSITY**2 * np.array([[1.0 / 3.0, 0.5], [0.5, 1.0]])
    steps = rng.standard_normal((EPOCHS, 3, 2)) @ np.linalg.cholesky(q).T
    x, m, p = np.zeros((3, 2)), np.zeros((3, 2)), np.diag([4.0, 1.0])
    truth, found, sds = (np.zeros((EPOCHS, 3, 2)) for _ in range(3))
    for k in range(EPOCHS):
        x, m, p = x @ f.T + steps[k], m @ f.T, f @ p @ f.T + q
        gain = p[:, 0] / (p[0, 0] + (FIX_SD / ratio) ** 2)
        m = m + np.outer(x[:, 0] + FIX_SD * rng.standard_normal(3) - m[:, 0], gain)
        p = p - np.outer(gain, p[0])
        truth[k], found[k], sds[k] = x, m, np.sqrt(np.diag(p))
    return truth, found, sds


def scored(truth, found, sds):
    covariance = np.zeros((EPOCHS, 15, 15))
    covariance[:, range(6), range(6)] = np.concatenate([sds[:, :, 0], sds[:, :, 1]], axis=1) ** 2
    estimate = filter_output("filter", T, local=found[:, :, 0], vel_n=found[:, :, 1], covariance=covariance)
    return score_outputs([estimate], [filter_output("truth", T, local=truth[:, :, 0], vel_n=truth[:, :, 1])])


def test_a_filter_of_position_and_velocity_is_read_off_its_sds_and_its_r_found():
    found = scored(*kalman(4, 3.0))
    (run,) = found.runs
    model = fit_filter(run, course_of(run))
    assert np.sqrt(model.fix_variance[0]) == pytest.approx(FIX_SD / 3.0, rel=1e-3)
    assert model.density[1] == pytest.approx(DENSITY, rel=1e-3)
    assert (found.causes[0].cause, found.causes[0].subject) == ("gnss_noise_scale", "position fixes")
    # 1500 innovations tell an sd to 1.8 %; three standard errors.
    assert found.causes[0].size == pytest.approx(3.0, rel=0.06)


def test_a_consistent_filter_of_position_and_velocity_has_no_cause():
    found = scored(*kalman(5, 1.0))
    assert found.consistency.consistent
    assert found.causes == ()


def test_a_start_that_is_not_scored_is_said_where_it_contradicts_the_filter():
    """One position in 500 s is wrong by 30 sds while the filter settles; a consistent start has a note once in 1000."""
    truth, found, sds = kalman(5, 1.0)
    said = "in the first 50 s, which the table leaves out, position errs by 1"
    assert not any("the table leaves out" in note for note in scored(truth, found, sds).notes)
    found[:30, 0, 0] += 30.0 * sds[:30, 0, 0]
    (note,) = (note for note in scored(truth, found, sds).notes if "the table leaves out" in note)
    assert note.startswith(said)


@pytest.mark.parametrize("factors", [(1.5, 1.5), (1.5, 3.0)])
def test_one_factor_on_constant_sds_is_named_only_where_it_explains_all(factors):
    """3000 independent squares tell the factor to 1.3 %; five standard errors."""
    rng = np.random.default_rng(7)
    truth = np.stack([np.outer(T, [3.0, 1.0, 0.0]), np.tile([3.0, 1.0, 0.0], (EPOCHS, 1))], axis=-1)
    sds = np.tile([0.5, 0.1], (EPOCHS, 3, 1))
    found = scored(truth, truth + np.array(factors) * sds * rng.standard_normal(sds.shape), sds)
    assert not found.consistency.consistent
    if factors[0] != factors[1]:
        assert found.causes == ()
        return
    (cause,) = found.causes
    assert (cause.cause, cause.subject) == ("noise_scale", "")
    assert cause.size == pytest.approx(1.5, rel=0.065)
    assert cause.interval[0] < 1.5 < cause.interval[1]
