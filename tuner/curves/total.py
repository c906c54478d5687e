"""Total variance: the Allan variance of a record continued by odd reflection at both ends.

The phase x_1 … x_N, N = n + 1, is continued by x*_{1-j} = 2 x_1 - x_{1+j} and x*_{N+j} = 2 x_N - x_{N-j}::

    TOTVAR(m) = Σ_{i=2}^{N-1} (x*_{i-m} - 2 x*_i + x*_{i+m})² / (2 m² (N - 2))

Every m has all N - 2 terms, which steadies long cluster times at the price of a bias that is not removed
here. With T the length of the record, E TOTVAR / AVAR is 1 for white noise, 1 - τ/(3 ln 2 T) for flicker, 1 -
3τ/(4T) for random walk and 1 + 4τ/(3T) for quantization.

References
----------
.. [1] C. A. Greenhall, D. A. Howe, D. B. Percival, Total variance, an estimator of long-term frequency
   stability, IEEE Trans. UFFC 46(5), 1999. The bias of quantization was computed for this project.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from models.arrays import FloatArray
from tuner.curves import allan_kernels as kernels
from tuner.curves.allan import by_column, sizes


def total(y: ArrayLike, m: ArrayLike) -> FloatArray:
    """Return the total variance, uncorrected.

    Parameters
    ----------
    y : array_like, shape (n,) or (n, k)
        Samples.
    m : array_like of int, shape (q,)
        Cluster sizes, 1 … n - 1.

    Returns
    -------
    ndarray, shape (q,) or (q, k)
        Variance, squared unit of y.
    """
    n = len(np.asarray(y))
    clusters = sizes(m, least=1, most=n - 1, samples=n)

    def variance(column: FloatArray) -> FloatArray:
        x = kernels.integrate(column)
        reach = int(clusters.max()) - 1
        left = 2.0 * x[0] - x[reach:0:-1]
        right = 2.0 * x[-1] - x[-2 : -2 - reach : -1]
        extended = np.concatenate([left, x, right])
        first = np.full_like(clusters, reach + 1)
        last = np.full_like(clusters, reach + x.size - 1)

        def stretch(begin: int, end: int) -> FloatArray:
            return kernels.second_differences(
                extended, clusters, first, last, begin + reach, end + reach, kernels.BLOCK_POSITIONS
            )

        sums = kernels.in_threads(stretch, x.size)
        return sums / (2.0 * clusters.astype(float) ** 2 * (x.size - 2))

    return by_column(y, variance)
