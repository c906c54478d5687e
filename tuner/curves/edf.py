"""Equivalent degrees of freedom of every estimator.

Allan, modified Allan and Hadamard variances, overlapping or not, are mean squared differences: exact for any
sum of terms (`tuner.curves.difference_dof`). Total variance and Thêo1 are other quadratic forms; for pure noises
their ν = tr(QS)²/tr(QSQS) was computed and is tabulated against τ/T, with a factor for clusters of few
samples. A sum of terms counts there as the term that rules at τ. ThêoBR pays for the ratio it takes from the
same record.

The χ² interval of ν degrees of freedom is `tuner.types.AllanCurve.interval`.

References
----------
.. [1] C. A. Greenhall, D. A. Howe, D. B. Percival, Total variance, an estimator of long-term frequency
   stability, IEEE Trans. UFFC 46(5), 1999.
.. [2] W. J. Riley, Handbook of Frequency Stability Analysis, NIST Special Publication 1065, 2008
   (Thêo1, white phase). Its formulas for the other noises go astray, for random walk below zero, at long τ.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from models.arrays import FloatArray
from models.noise import (
    BiasInstability,
    NoiseModel,
    Quantization,
    RandomWalk,
    White,
)
from tuner.curves import difference_dof as differences
from tuner.curves.difference_dof import Difference

PURE_NOISES = {
    "quantization": NoiseModel((Quantization(1.0),)),
    "white": NoiseModel((White(1.0),)),
    "bias_instability": NoiseModel((BiasInstability(1.0),)),
    "random_walk": NoiseModel((RandomWalk(1.0),)),
}
"""Noise types that can be named in place of a model."""


def dof(
    estimator: str,
    n: int,
    m: ArrayLike,
    noise: str | Sequence[str] | NoiseModel,
    *,
    interval: float = 1.0,
) -> FloatArray:
    """Return the equivalent degrees of freedom of variances of a record without gaps.

    Parameters
    ----------
    estimator : str
        ``adev oadev twogroup mdev hdev ohdev totdev theo1 theobr nsec``.
    n : int
        Samples of the record.
    m : array_like of int, shape (q,)
        Cluster sizes (m of Thêo1, not its τ).
    noise : str, sequence of str or NoiseModel
        ``quantization white bias_instability random_walk``, one for all or one a cluster size; or a model.
    interval : float
        Sampling interval, s; matters only for a model.

    Returns
    -------
    ndarray, shape (q,)
        At least 1.

    Raises
    ------
    ValueError
        If the estimator or a noise type has no such name.
    """
    clusters = np.atleast_1d(np.asarray(m, dtype=np.int64)).tolist()
    if estimator not in _RULES:
        raise ValueError(f"'estimator' must be one of {', '.join(_RULES)}, got {estimator!r}")
    types = [noise] * len(clusters) if isinstance(noise, (str, NoiseModel)) else list(noise)
    models = [each if isinstance(each, NoiseModel) else _named(each) for each in types]
    rule = _RULES[estimator]
    freedom = [rule(model, n, k, k * interval) for model, k in zip(models, clusters, strict=True)]
    return np.maximum(freedom, 1.0)


def _named(name: str) -> NoiseModel:
    if name not in PURE_NOISES:
        raise ValueError(f"'noise' must be one of {', '.join(PURE_NOISES)}, got {name!r}")
    return PURE_NOISES[name]


def dominant(model: NoiseModel, tau: float) -> str:
    """Return the noise type, of those in `PURE_NOISES`, that carries most of the Allan variance of a model at τ, s.

    Stationary noise of a bias, such as Gauss–Markov, counts as bias instability, ramps and sinusoids do not count, all
    else counts as white.
    """
    share = dict.fromkeys(PURE_NOISES, 0.0)
    for term in model.terms:
        if term.deterministic:
            continue
        wanders = term.is_bias and term.exponentials() is not None
        name = term.name if term.name in PURE_NOISES else "bias_instability" if wanders else "white"
        share[name] += float(term.allan_variance(tau))
    return max(share, key=lambda name: (share[name], name == "white"))


_TOTAL = {"white": (1.50, 0.0), "bias_instability": (1.168, 0.222), "random_walk": (0.927, 0.358)}
"""b and c of ν = b T/τ - c, τ ≤ T/2 [1]; traces agree to 0.02."""

_TOTAL_SAMPLING = {"white": (1.25, 2.0), "bias_instability": (0.328, 3.4), "random_walk": (0.0442, 4.8)}
"""a and p of the factor 1/(1 + a/m^p) for clusters of few samples, fitted to traces at N = 401."""

_TOTAL_END = {
    "quantization": (12.0, 5.44, 3.03),
    "white": (3.0, 1.59, 1.49),
    "bias_instability": (2.11, 1.18, 1.13),
    "random_walk": (1.51, 1.06, 1.03),
}
"""Traces at τ/T = 1/2, 3/4 and 1."""


def _total(model: NoiseModel, n: int, m: int, tau: float) -> float:
    noise = dominant(model, tau)
    if 2 * m > n:
        return float(np.interp(m / n, [0.5, 0.75, 1.0], _TOTAL_END[noise]))
    if noise == "quantization":  # squares of the 2m terms at the ends share the end points
        return (6.0 * n + 8.0 * m) ** 2 / (70.0 * n + 126.0 * m + 32.0 * m * m)
    b, c = _TOTAL[noise]
    a, power = _TOTAL_SAMPLING[noise]
    return float((b * n / m - c) / (1.0 + a / m**power))


_THEO1_SHARE = (0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.75)
_THEO1 = {
    "white": (4.365, 4.168, 3.977, 3.616, 3.316, 3.171, 2.792, 2.133, 1.682, 1.502),
    "bias_instability": (1.897, 1.806, 1.716, 1.543, 1.385, 1.248, 1.054, 0.899, 0.873, 0.908),
    "random_walk": (1.285, 1.217, 1.149, 1.015, 0.888, 0.773, 0.697, 0.687, 0.739, 0.785),
}
"""ν τ/T of Thêo1 against τ/T for many samples: traces at m = 320."""

_THEO_BR_SHARE = (0.012, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.45, 0.6, 0.75)
_THEO_BR = {
    "white": (0.0049, 0.0070, 0.0168, 0.0306, 0.0367, 0.0367, 0.0341, 0.0279, 0.0223, 0.0160),
    "bias_instability": (0.0027, 0.0041, 0.0152, 0.0321, 0.0433, 0.0471, 0.0484, 0.0481, 0.0503, 0.0436),
    "random_walk": (0.0040, 0.0081, 0.0174, 0.0295, 0.0405, 0.0485, 0.0624, 0.0857, 0.1061, 0.1080),
}
"""1/ν of ThêoBR less 1/ν of Thêo1 against τ/T, the price of the ratio: 12 000 runs, n = 1000."""


def _theo1(model: NoiseModel, n: int, m: int, tau: float) -> float:
    noise = dominant(model, 0.75 * tau)
    r = 0.75 * m
    if noise == "quantization":
        return 0.86 * (n + 2) * (n + 1 - m) / (n + 1 - r) * r / (r + 1.14)
    sampling = 1.0 - 2.44 / m if noise == "white" else 1.0
    return float(np.interp(r / n, _THEO1_SHARE, _THEO1[noise]) * n / r * sampling)


def _theo_br(model: NoiseModel, n: int, m: int, tau: float) -> float:
    noise = dominant(model, 0.75 * tau)
    price = float(np.interp(0.75 * m / n, _THEO_BR_SHARE, _THEO_BR[noise])) if noise in _THEO_BR else 0.0
    return 1.0 / (1.0 / _theo1(model, n, m, tau) + price)


def _two_groups(model: NoiseModel, n: int, m: int, tau: float) -> float:
    start = m // 2
    return differences.two_groups(Difference(model, 2, tau), n // m - 1, (n - start) // m - 1, start / m)


_RULES: dict[str, Callable[[NoiseModel, int, int, float], float]] = {
    "adev": lambda model, n, m, tau: differences.adjoining(Difference(model, 2, tau), n // m - 1),
    "oadev": lambda model, n, m, tau: differences.overlapping(Difference(model, 2, tau), m, n + 1 - 2 * m),
    "twogroup": _two_groups,
    "mdev": lambda model, n, m, tau: differences.averaged(Difference(model, 2, tau), m, n + 2 - 3 * m),
    "hdev": lambda model, n, m, tau: differences.adjoining(Difference(model, 3, tau), n // m - 2),
    "ohdev": lambda model, n, m, tau: differences.overlapping(Difference(model, 3, tau), m, n + 1 - 3 * m),
    "totdev": _total,
    "theo1": _theo1,
    "theobr": _theo_br,
    "nsec": lambda _model, n, m, _tau: n // m - 1.0,
}
"""ν by estimator: of a model, n samples, clusters of m samples and τ = m dt."""
