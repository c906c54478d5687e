"""Published WGS 84 values.

Source of all: NIMA TR8350.2, 3rd ed. (2000), tables 3.1, 3.3 and 3.4, as repeated by
http://in-dubio-pro-geo.de/?file=register/wgs84 and https://fatiando.org/boule/v0.3.1/ellipsoids/wgs84.html.
"""

from __future__ import annotations

import numpy as np
import pytest

from models import earth


@pytest.mark.parametrize(
    ("value", "published", "tolerance"),
    [
        (earth.SEMI_MINOR_AXIS, 6356752.3142, 1e-4),
        (earth.ECCENTRICITY_SQUARED, 6.69437999014e-3, 1e-14),
        (earth.GRAVITY_RATIO, 0.00344978650684, 1e-14),
        (earth.radii(0.0)[0], 6335439.327, 1e-3),  # meridian radius at the equator
        (earth.radii(0.0)[1], 6378137.0, 1e-9),
        (earth.radii(1.0)[0], 6399593.6258, 1e-4),  # polar radius of curvature, M = N
        (earth.radii(1.0)[1], 6399593.6258, 1e-4),
        (earth.gravity(0.0, 0.0), 9.7803253359, 1e-12),
        (earth.gravity(1.0, 0.0), 9.8321849378, 1e-10),
        (earth.SOMIGLIANA, 0.00193185265241, 1e-11),  # here from the ten printed digits of γp
    ],
)
def test_published_value(value, published, tolerance):
    assert abs(value - published) <= tolerance


def test_mean_gravity():
    # Mean normal gravity over the ellipsoid, 9.7976432222 m/s² (table 3.4).
    x, w = np.polynomial.legendre.leggauss(60)
    lat = 0.5 * np.pi * x
    meridian, normal = earth.radii(np.sin(lat))
    area = w * meridian * normal * np.cos(lat)
    assert abs(np.sum(area * earth.gravity(np.sin(lat), 0.0)) / np.sum(area) - 9.7976432222) < 2e-9
