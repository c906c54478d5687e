"""Empirical curves: statistics of measured samples, free of any model.

==================  =======================================================================================
`curve`             one curve of the Allan family of a `Record`, segments pooled, with degrees of freedom
`psd`               multitaper spectrum, two-sided, in a few hundred log-spaced bands
`acf`, `pacf`       correlograms with the band of white noise
`empirical`         any of these by name
==================  =======================================================================================

The statistics themselves are functions of arrays in `allan`, `total`, `theo`, `series` and `spectrum`; their
degrees of freedom are in `difference_dof` and `edf`.
"""

from __future__ import annotations

from collections.abc import Sequence

from tuner.curves.edf import dof
from tuner.curves.pooled_curve import ESTIMATORS, curve
from tuner.curves.series import acf, pacf
from tuner.curves.spectrum import psd
from tuner.types import AllanCurve, Correlogram, Spectrum
from tuner.types.public import public
from tuner.types.records import DataError, Record

__all__ = ["ESTIMATORS", "acf", "curve", "dof", "empirical", "pacf", "psd"]


@public("curve")
def empirical(
    record: Record, statistic: str, *, tau: Sequence[float] | None = None
) -> AllanCurve | Spectrum | Correlogram:
    """Return the statistic of that name: an estimator of `curve`, ``psd``, ``acf`` or ``pacf`` (at lags τ).

    Raises
    ------
    DataError
        If cluster times are given for a spectrum, or the record cannot give them.
    """
    if tau is not None and not len(tau):
        raise DataError("curve: tau: expected cluster times or lags, s, found none")
    if statistic == "psd":
        if tau is not None:
            raise DataError("psd has no cluster times: leave tau out")
        return psd(record)
    if statistic in ("acf", "pacf"):
        return (acf if statistic == "acf" else pacf)(record, lag=tau)
    return curve(record, statistic, tau=tau)
