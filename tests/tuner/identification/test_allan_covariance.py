"""Covariance between points of an Allan curve: quadratic forms and Monte Carlo."""

import numpy as np
import pytest

from models.noise import BiasInstability, GaussMarkov, NoiseModel, Quantization, Ramp, RandomWalk, White
from tuner.identification.allan_covariance import allan_covariance

N = 160
M = np.array([1, 3, 8, 24, 40])


def dense(covariance, m=M, lengths=(N,), mean=None):
    """Covariance of pooled Allan variances from that of the samples: 2 tr(QSQS) + 4 μᵀQSQμ."""
    answer = np.zeros((len(m), len(m)))
    weight = np.array([sum(max(n + 1 - 2 * k, 0) for n in lengths) for k in m])
    for n in lengths:
        forms = []
        for k, number in zip(m, weight, strict=True):
            rows = max(n + 1 - 2 * k, 0)
            z = np.zeros((rows, n))
            for i in range(rows):
                z[i, i : i + k], z[i, i + k : i + 2 * k] = -1.0 / k, 1.0 / k
            forms.append(z.T @ z / (2.0 * number))
        s = covariance[:n, :n]
        halves = [form @ s for form in forms]
        drift = np.zeros(n) if mean is None else mean[:n]
        for i in range(len(m)):
            for j in range(len(m)):
                answer[i, j] += (
                    2.0 * np.sum(halves[i] * halves[j].T) + 4.0 * drift @ halves[i] @ forms[j] @ drift
                )
    return answer


def walk(n=N):
    steps = np.arange(n)
    return np.minimum.outer(steps, steps).astype(float)


def markov(time, n=N):
    return np.exp(-np.abs(np.subtract.outer(np.arange(n), np.arange(n))) / time)


def flicker(n=N, past=40_000):
    taps = np.cumprod(np.concatenate(([1.0], (np.arange(1, n + past) - 0.5) / np.arange(1, n + past))))
    lagged = np.array([taps[: n + past - k] @ taps[k:] for k in range(n)])
    return lagged[np.abs(np.subtract.outer(np.arange(n), np.arange(n)))]


CASES = {
    "white": (White(2.0), 4.0 * np.eye(N)),
    "quantization": (
        Quantization(1.5),
        2.25 * (2.0 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1)),
    ),
    "random_walk": (RandomWalk(0.3), 0.09 * walk()),
    "gauss_markov": (GaussMarkov(0.7, 20.0), 0.49 * markov(20.0)),
    "long gauss_markov": (GaussMarkov(0.7, 5000.0), 0.49 * markov(5000.0)),
}


@pytest.mark.parametrize("case", CASES)
def test_a_term_alone(case):
    term, matrix = CASES[case]
    mean, covariance = allan_covariance((term,), M, (N,), 1.0)
    exact = dense(matrix)
    scale = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    assert mean == pytest.approx(term.allan_variance(M.astype(float), interval=1.0), rel=1e-12)
    assert np.max(np.abs(covariance - exact) / scale) < 0.03


def test_flicker_beyond_the_first_clusters():
    # the kernel is that of the continuous process, which differs from the sampled one at a sample or two
    _, covariance = allan_covariance((BiasInstability(1.0),), M[2:], (N,), 1.0)
    exact = dense(flicker(), M[2:])
    assert covariance == pytest.approx(exact, rel=0.05)


def test_terms_add_before_the_square():
    terms = (Quantization(1.0), White(1.0), RandomWalk(0.2), Ramp(0.01))
    matrix = np.eye(N) + CASES["quantization"][1] / 2.25 + 0.04 * walk()
    _, covariance = allan_covariance(terms, M, (N,), 1.0)
    exact = dense(matrix, mean=0.01 * np.arange(N))
    scale = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    assert np.max(np.abs(covariance - exact) / scale) < 0.03


def test_segments_pool_by_their_numbers_of_differences():
    terms = (White(1.0), RandomWalk(0.2))
    _, covariance = allan_covariance(terms, M[:4], (N, 90), 1.0)
    exact = dense(np.eye(N) + 0.04 * walk(), M[:4], (N, 90))
    scale = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    assert np.max(np.abs(covariance - exact) / scale) < 0.03


def test_long_records_agree_with_published_degrees_of_freedom():
    # Greenhall & Riley closed forms hold for m ≫ 1; white FM at τ = T/10 has 12.8, random walk FM 7.76
    m = np.array([10_000])
    for term, published in ((White(1.0), 12.8), (RandomWalk(1.0), 7.76), (BiasInstability(1.0), 9.93)):
        mean, covariance = allan_covariance((term,), m, (100_000,), 0.01)
        assert 2.0 * mean[0] ** 2 / covariance[0, 0] == pytest.approx(published, rel=0.01)


def test_the_whole_matrix_of_a_long_mixed_record_is_positive():
    m = 2 ** np.arange(19)
    model = NoiseModel((White(1.0), BiasInstability(0.5), RandomWalk(0.02)))
    _, covariance = allan_covariance(model.terms, m, (2_000_000,), 0.01)
    sd = np.sqrt(np.diag(covariance))
    assert np.linalg.eigvalsh(covariance / np.outer(sd, sd))[0] > 0.01
