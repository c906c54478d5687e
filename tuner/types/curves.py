"""Empirical statistics of a record: Allan curves, spectra, correlograms."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.probability import chi2_quantile
from tuner.types.coefficient import LEVEL
from tuner.types.shown import Shown


@dataclass(frozen=True, repr=False)
class AllanCurve(Shown):
    """An empirical curve of the Allan family: one variance a cluster time and axis.

    Attributes
    ----------
    estimator : str
        ``adev oadev twogroup mdev hdev ohdev totdev theo1 theobr theoh``.
    tau : ndarray, shape (m,)
        Effective cluster time, s (0.75 m τ0 for Thêo1).
    variance : ndarray, shape (m, k)
        Variance, unit².
    dof : ndarray, shape (m, k)
        Equivalent degrees of freedom.
    unit : str
        Unit of the deviation.
    axes : tuple of str
        Names of the k columns.
    notes : tuple of str
        What was done to make the curve affordable, such as block averaging.
    """

    estimator: str
    tau: FloatArray
    variance: FloatArray
    dof: FloatArray
    unit: str
    axes: tuple[str, ...]
    notes: tuple[str, ...] = ()

    def deviation(self) -> FloatArray:
        """Return the square root of the variance, shape (m, k)."""
        return np.sqrt(self.variance)

    def interval(self, level: float = LEVEL) -> tuple[FloatArray, FloatArray]:
        """Return lower and upper limits of the deviation from χ² with `dof` degrees of freedom, shapes (m, k)."""
        tail = 0.5 * (1.0 - level)
        scaled = self.dof * self.variance
        low, high = (np.sqrt(scaled / chi2_quantile(p, self.dof)) for p in (1.0 - tail, tail))
        return low, high

    def axis(self, name: str) -> AllanCurve:
        """Return the curve of one axis alone."""
        j = self.axes.index(name)
        only = slice(j, j + 1)
        return replace(self, variance=self.variance[:, only], dof=self.dof[:, only], axes=(name,))


@dataclass(frozen=True, repr=False)
class Spectrum(Shown):
    """An empirical two-sided power spectral density.

    Attributes
    ----------
    frequency : ndarray, shape (m,)
        Hz, positive.
    density : ndarray, shape (m, k)
        unit²/Hz, two-sided: white noise of density N shows N².
    dof : ndarray, shape (m,)
        Equivalent degrees of freedom of each value.
    unit : str
        Unit of the samples.
    axes : tuple of str
        Names of the k columns.
    """

    frequency: FloatArray
    density: FloatArray
    dof: FloatArray
    unit: str
    axes: tuple[str, ...]

    def interval(self, level: float = LEVEL) -> tuple[FloatArray, FloatArray]:
        """Return lower and upper limits of the density from χ² with `dof` degrees of freedom, shapes (m, k)."""
        tail = 0.5 * (1.0 - level)
        dof = self.dof[:, None]
        low, high = (self.density * dof / chi2_quantile(p, dof) for p in (1.0 - tail, tail))
        return low, high


@dataclass(frozen=True, repr=False)
class Correlogram(Shown):
    """Sample autocorrelation or partial autocorrelation.

    Attributes
    ----------
    statistic : str
        ``acf`` or ``pacf``.
    lag : ndarray, shape (m,)
        s.
    value : ndarray, shape (m, k)
        Correlation, -1 … 1.
    band : float
        Half width of the band that holds 95 % of the values of white noise.
    axes : tuple of str
        Names of the k columns.
    """

    statistic: str
    lag: FloatArray
    value: FloatArray
    band: float
    axes: tuple[str, ...]
