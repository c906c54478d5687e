"""Published and independently computed values of the noise terms.

Sources
-------
[1] Li Qi et al., Allan variance analysis of ring laser gyroscopes, table 3: Q = 0.29″, N = 0.09,
    σ(10 s) = 0.05 deg/h. The numbers agree only with N in (deg/h)√s; then σ(10 s) = 0.0577 deg/h and the
    corner lies at 31 s.
[2] Zhang Meng et al., Allan variance and ARMA modelling of MEMS gyroscopes: ARMA(1,1) 0.476425, −0.455909,
    variance 0.0063. The derived values were computed from its transfer function and checked by simulation
    of 4e6 samples.
[3] IEEE Std 952-1997, Annex C: closed forms; the peaks were found by maximising them numerically.
[4] N. F. Zhang, Allan variance of time series models for measurement data, Metrologia 45 (2008): AR(1).
    The continuous averages beside it by quadrature of the spectrum.
[5] Flicker samples (Hosking, d = 1/2): quadrature of the spectrum B² dt/(2 sin πf dt).
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from models.noise import BiasInstability, GaussMarkov, LowPassWhite, Quantization, RandomWalk, Sinusoid, White
from models.noise.arma import Arma
from models.noise.bias_instability import flicker_ladder
from models.units import ARCSEC, DEG_PER_HOUR, DEG_PER_HOUR_PER_SQRT_HZ


def peak(term, bracket):
    found = minimize_scalar(
        lambda tau: -float(term.allan_variance(tau)), bounds=bracket, options={"xatol": 1e-10}
    )
    return found.x, math.sqrt(-found.fun)


def test_ring_laser_gyroscope():
    """Source [1]."""
    model = Quantization(0.29 * ARCSEC) + White(0.09 * DEG_PER_HOUR_PER_SQRT_HZ)
    assert math.sqrt(float(model.allan_variance(10.0))) / DEG_PER_HOUR == pytest.approx(0.0577, abs=5e-5)
    corner = 3.0 * (0.29 / 0.09) ** 2
    assert corner == pytest.approx(31.0, abs=0.5)
    quantization, white = (float(term.allan_variance(corner)) for term in model.terms)
    assert quantization == pytest.approx(white)


def test_mems_gyroscope_arma():
    """Source [2]."""
    arma = Arma((0.476425,), (-0.455909,), 0.0063, 1.0)
    allan = arma.allan_variance([1.0, 2.0, 10.0, 100.0])
    np.testing.assert_allclose(allan, [0.00617255, 0.00314583, 0.000666028, 0.0000678907], rtol=1e-6)
    variance, lagged = arma.autocovariance([0.0, 1.0])
    assert variance == pytest.approx(0.00630343, rel=1e-6)
    assert lagged / variance == pytest.approx(0.020764, rel=1e-4)
    assert float(arma.psd(0.0)) == pytest.approx(0.00680340, rel=1e-6)


def test_gauss_markov_peak():
    """Source [3]."""
    tau, deviation = peak(GaussMarkov(1.0, 1.0), (0.5, 5.0))
    assert tau == pytest.approx(1.89262, abs=1e-5)
    assert deviation == pytest.approx(0.617364, abs=1e-6)
    assert deviation / GaussMarkov(1.0, 1.0).driving_density == pytest.approx(0.436542, abs=1e-6)


def test_gauss_markov_at_short_cluster_times():
    """Source [3]: the closed form printed there is 80 times too large at τ = 1e-6 T in double precision."""
    for x in (1e-12, 1e-6, 1e-3):
        series = 2.0 * x * (1.0 / 3.0 - x / 4.0 + 7.0 * x**2 / 60.0 - x**3 / 24.0)
        assert float(GaussMarkov(1.0, 1.0).allan_variance(x)) == pytest.approx(series, rel=1e-12)


def test_first_order_autoregression():
    """Source [4], φ = 0.9 and innovations of variance 1; the continuous average beside it."""
    phi, n = 0.9, np.array([1.0, 4.0, 20.0, 200.0])
    markov = GaussMarkov(1.0 / math.sqrt(1.0 - phi**2), -1.0 / math.log(phi))
    expected = (n - 3 * phi - n * phi**2 + 4 * phi ** (n + 1) - phi ** (2 * n + 1)) / (
        n**2 * (1 - phi) ** 2 * (1 - phi**2)
    )
    sampled = markov.allan_variance(n, interval=1.0)
    np.testing.assert_allclose(sampled, expected, rtol=1e-12)
    np.testing.assert_allclose(sampled, [0.526316, 1.136168, 2.005754, 0.464474], atol=1e-6)
    np.testing.assert_allclose(markov.allan_variance(n), [0.3419, 1.0910, 1.9984, 0.4640], atol=1e-4)


def test_flicker_samples():
    """Source [5]: 44 % above the flat line at m = 1."""
    m = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 64.0])
    allan = BiasInstability(1.0).allan_variance(m * 0.01, interval=0.01)
    np.testing.assert_allclose(allan, [0.63662, 0.50930, 0.46334, 0.44807, 0.44329, 0.44144], atol=1e-5)
    assert allan[0] == pytest.approx(2.0 / math.pi, rel=1e-14)
    assert math.sqrt(float(BiasInstability(1.0).allan_variance(1.0))) == pytest.approx(0.664282, abs=1e-6)


def test_random_walk_samples():
    """Source [3], and the sum of m point samples: +50 % at m = 1, +0.5 % at m = 10."""
    ratio = RandomWalk(1.0).allan_variance([1.0, 10.0], interval=1.0) / RandomWalk(1.0).allan_variance(
        [1.0, 10.0]
    )
    np.testing.assert_allclose(ratio, [1.5, 1.005], rtol=1e-12)


def test_sinusoid_peak_and_zeros():
    """Source [3]."""
    tau, deviation = peak(Sinusoid(1.0, 1.0), (0.1, 0.9))
    assert (tau, deviation) == (pytest.approx(0.37101, abs=1e-5), pytest.approx(0.72461, abs=1e-5))
    np.testing.assert_allclose(Sinusoid(1.0, 0.5).allan_variance([2.0, 4.0, 20.0]), 0.0, atol=1e-25)


@pytest.mark.parametrize(
    ("order", "tau", "deviation", "ratios"),
    [(1, 0.3012, 1.0942, (0.873, 0.959, 0.988)), (2, 0.468, 1.0908, (0.913, 0.971, 0.992))],
)
def test_low_pass_white(order, tau, deviation, ratios):
    """Source [3] through the filter: peak in units of N √f_c, ratio to the white line at f_c τ = 1, 3, 10."""
    term = LowPassWhite(1.0, 1.0, order=order)
    where, height = peak(term, (0.1, 2.0))
    assert where == pytest.approx(tau, abs=5e-4)
    assert height == pytest.approx(deviation, abs=1e-4)
    at = np.array([1.0, 3.0, 10.0])
    np.testing.assert_allclose(np.sqrt(term.allan_variance(at) * at), ratios, atol=6e-4)


@pytest.mark.parametrize(("per_decade", "sd"), [(1.0, 0.8561), (2.0, 0.6054), (0.75, 0.9886), (0.5, 1.2107)])
def test_ladder_rung(per_decade, sd):
    """Equal rungs sd = B √(ln r/π): variance B² ln 10/π a decade of frequency."""
    ladder = flicker_ladder(1.0, 1.0, 1e12, per_decade=per_decade)
    assert ladder[0].sd == pytest.approx(sd, abs=1e-4)
