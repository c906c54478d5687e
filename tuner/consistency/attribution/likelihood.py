"""Likelihood of a covariance of errors and innovations, from their products, whitened by the filter's prediction.

With the filter's covariance P = L Lᵀ of an error e, the whitened y = L⁻¹ e has covariance I in a consistent filter
and L⁻¹ V L⁻ᵀ = C Cᵀ where the truth is V. Component i of C⁻¹ y is what is new in yᵢ given those before it, so
that the likelihood of V is a product over components, each from as many independent values nᵢ as its squares
show (`tuner.consistency.scores.score`)::

    −2 ln p = Σᵢ nᵢ [2 ln Cᵢᵢ + (C⁻¹ S C⁻ᵀ)ᵢᵢ]          S = mean of y yᵀ

and a sum over the blocks: aided, each outage, innovations. As blocks and epochs depend on each other this is
a composite likelihood [1]_, whose standard error is that of independent runs. Components go from biases to positions:
the last are the slowest.

References
----------
.. [1] C. Varin, N. Reid, D. Firth, An overview of composite likelihood methods, Statistica Sinica 21 (2011).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from tuner.consistency.scores import score
from tuner.navigation.data import USED
from tuner.simulation.monte_carlo import Runs
from tuner.types.consistency import ErrorBudget

MIN_VARIANCE = 1e-3
"""Least whitened variance that an expectation may have: a difference of parts may be negative."""


@dataclass(frozen=True)
class WhitenedProducts:
    """Mean products of whitened components.

    Attributes
    ----------
    products : ndarray, shape (m, d, d)
        Mean over the epochs of each run; I ideally.
    effective : ndarray, shape (d,)
        Independent values behind each component, all runs together.
    """

    products: FloatArray
    effective: FloatArray


def whitened_products(values: FloatArray, used: NDArray[np.bool_]) -> WhitenedProducts:
    """Return the mean products of whitened values, shape (m, e, d), at the epochs that count, (m, e)."""
    counts = np.maximum(used.sum(axis=1), 1)[:, None, None]
    products = np.einsum("me,mei,mej->mij", used.astype(float), values, values, optimize=True) / counts
    effective = [
        score("", [run[own, i] ** 2 for run, own in zip(values, used, strict=True)], 1).effective
        for i in range(values.shape[-1])
    ]
    return WhitenedProducts(products, np.array(effective))


def measured_products(simulated: Runs, budget: ErrorBudget) -> tuple[WhitenedProducts, ...]:
    """Return the products of runs at the epochs of a budget: innovations, aided errors, errors in outages."""
    rows = np.searchsorted(simulated.t, budget.t)
    answer = []
    for name, epochs, _, total in _blocks(budget):
        d = total.shape[-1]
        values = (simulated.innovation if name == "innovation" else simulated.error)[:, rows[epochs], :d]
        used = (simulated.use[:, rows[epochs], : d // 3] == USED).all(axis=-1)
        counted = used | (name == "error")
        values = np.where(counted[..., None], values, 0.0)[..., ::-1]
        answer.append(whitened_products(np.einsum("eij,mej->mei", _whitening(total), values), counted))
    return tuple(answer)


def expected_products(budget: ErrorBudget) -> FloatArray:
    """Return what every source adds to every product of `measured_products`; shape (Σ d², g)."""
    rows = []
    for _, _, parts, total in _blocks(budget):
        white = _whitening(total)
        products = np.zeros(parts.shape[1:])
        for w, own in zip(white, parts[..., ::-1, ::-1], strict=True):
            products += w @ own @ w.T / len(white)
        rows.append(products.reshape(len(products), -1))
    return np.concatenate(rows, axis=1).T


def deviance(
    measured: Sequence[WhitenedProducts], expected: FloatArray, *, model_error: float = 0.0
) -> FloatArray:
    """Return −2 ln p of each run, up to a constant; their mean is that of all runs.

    Parameters
    ----------
    measured : sequence of WhitenedProducts
        Of m runs.
    expected : ndarray, shape (..., Σ d²)
        Expectations of their products, one after another.
    model_error : float
        Relative error of an expected mean square, beside chance.

    Returns
    -------
    ndarray, shape (..., m)
    """
    total, at = np.zeros((*expected.shape[:-1], len(measured[0].products))), 0
    for one in measured:
        d = len(one.effective)
        block = expected[..., at : at + d * d].reshape(*expected.shape[:-1], d, d)
        at += d * d
        root = _root(block)
        inverse = np.linalg.inv(root)[..., None, :, :]
        squares = np.sum((inverse @ one.products) * inverse, axis=-1)
        logs = 2.0 * np.log(np.diagonal(root, axis1=-2, axis2=-1))[..., None, :]
        total += (logs + squares) @ (1.0 / (1.0 / one.effective + 0.5 * model_error**2))
    return total


def _blocks(budget: ErrorBudget) -> Iterator[tuple[str, NDArray[np.intp], FloatArray, FloatArray]]:
    """Yield name, epochs, covariance by source (e, g, d, d) and the filter's own (e, d, d) of each block."""
    d = int(np.count_nonzero(np.diagonal(budget.innovation_total[budget.aided[0]]) > 0.0))
    aided = budget.aided
    yield (
        "innovation",
        aided,
        budget.innovation[aided][..., :d, :d],
        budget.innovation_total[aided][..., :d, :d],
    )
    for epochs in (aided, *budget.after.values()):
        yield "error", epochs, budget.covariance[epochs], budget.total[epochs]


def _whitening(total: FloatArray) -> FloatArray:
    """Return L⁻¹ of covariances, shape (e, d, d), components in reverse order."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(total[..., ::-1, ::-1])))


def _root(covariance: FloatArray) -> FloatArray:
    """Return C of C Cᵀ; what is smaller than `MIN_VARIANCE` is raised to it."""
    try:
        return np.asarray(np.linalg.cholesky(covariance))
    except np.linalg.LinAlgError:
        values, axes = np.linalg.eigh(0.5 * (covariance + np.swapaxes(covariance, -1, -2)))
        raised = (axes * np.maximum(values, MIN_VARIANCE)[..., None, :]) @ np.swapaxes(axes, -1, -2)
        return np.asarray(np.linalg.cholesky(raised))
