"""Constants of an output: least squares with the scatter of parts of a record."""

from __future__ import annotations

import numpy as np
import pytest

from tuner.consistency.constants import by_leaving_out


def equations(columns, data, parts=10):
    rows = np.array_split(np.arange(len(data)), parts)
    return (
        np.array([columns[i].T @ columns[i] for i in rows]),
        np.array([columns[i].T @ data[i] for i in rows]),
    )


def test_data_without_noise_give_the_constants_and_no_scatter():
    columns = np.random.default_rng(1).standard_normal((200, 3))
    value, covariance, sds = by_leaving_out(*equations(columns, columns @ [1.0, -2.0, 0.5]))
    assert value == pytest.approx([1.0, -2.0, 0.5])
    assert covariance == pytest.approx(np.zeros((3, 3)), abs=1e-20)
    assert sds == pytest.approx(2.2622, abs=1e-4)  # Student's quantile of nine degrees of freedom


def test_the_scatter_of_a_mean_is_the_jackknife_of_its_parts():
    data = np.random.default_rng(2).standard_normal(100)
    value, covariance, _ = by_leaving_out(*equations(np.ones((100, 1)), data))
    means = data.reshape(10, 10).mean(axis=1)
    assert value[0] == pytest.approx(data.mean())
    assert covariance[0, 0] == pytest.approx(means.var(ddof=1) / 10.0)


def test_a_constant_that_one_part_alone_shows_is_not_solved_for():
    columns = np.ones((100, 2))
    columns[10:, 1] = 0.0
    assert by_leaving_out(*equations(columns, np.ones(100))) is None
    assert by_leaving_out(*equations(np.ones((100, 2)), np.ones(100))) is None
