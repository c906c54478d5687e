"""The Earth model: round trips, derivatives, and gravity against an independent closed form."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from models import earth

LATITUDES = np.linspace(-1.5, 1.5, 31)
HEIGHTS = (-100.0, 0.0, 1000.0, 20000.0)
latitude = st.floats(-1.57, 1.57)


@given(latitude, st.floats(-3.14, 3.14), st.floats(-1e4, 1e7))
def test_earth_fixed_round_trip(lat, lon, height):
    back = earth.llh_from_ecef(earth.ecef_from_llh([lat, lon, height]))
    np.testing.assert_allclose(back[:2], [lat, lon], rtol=0, atol=1e-14)
    np.testing.assert_allclose(back[2], height, rtol=0, atol=1e-8)


def test_poles_round_trip():
    for sign in (-1.0, 1.0):
        back = earth.llh_from_ecef(earth.ecef_from_llh([sign * np.pi / 2, 0.0, 50.0]))
        np.testing.assert_allclose(back, [sign * np.pi / 2, 0.0, 50.0], atol=1e-8)


@given(latitude, st.floats(-3.0, 3.0), st.floats(-100.0, 1e4))
def test_radii_and_axes_are_the_derivative_of_the_earth_fixed_position(lat, lon, height):
    llh, step = np.array([lat, lon, height]), np.array([1e-6, 1e-6, 1.0])
    metres = earth.metres_per_radian(llh)
    for i in range(3):
        e = step[i] * np.eye(3)[i]
        derivative = (earth.ecef_from_llh(llh + e) - earth.ecef_from_llh(llh - e)) / (2 * step[i])
        expected = earth.mat_en(lat, lon)[:, i] * metres[i]
        np.testing.assert_allclose(derivative, expected, rtol=0, atol=1e-2 * step[i] * 1e6)


@given(latitude, st.floats(-3.0, 3.0))
def test_local_axes_are_a_rotation(lat, lon):
    mat = earth.mat_en(lat, lon)
    np.testing.assert_allclose(mat @ mat.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(np.linalg.det(mat), 1.0, atol=1e-15)


def test_displacement_round_trip_across_the_date_line():
    reference = np.array([0.5, np.pi - 1e-7, 10.0])
    moved = earth.llh_displaced(reference, [3.0, 5.0, -2.0])
    moved[1] -= 2 * np.pi
    np.testing.assert_allclose(earth.ned_between(moved, reference), [3.0, 5.0, -2.0], atol=1e-8)


def _normal_gravity_of_the_potential(lat, height):
    """Gradient of the level ellipsoid's potential, by central differences (Heiskanen & Moritz, eq. 2-62)."""
    a, b, w, gm = earth.SEMI_MAJOR_AXIS, earth.SEMI_MINOR_AXIS, earth.EARTH_RATE, earth.GRAVITATIONAL_CONSTANT
    focal = np.sqrt(a * a - b * b)

    def q(u):
        x = focal / u
        if x < 0.2:  # the closed form cancels: its series
            return sum(
                (-1) ** (k + 1) * 2 * k * x ** (2 * k + 1) / ((2 * k + 1) * (2 * k + 3)) for k in range(1, 14)
            )
        return 0.5 * ((1 + 3 / x**2) * np.arctan(x) - 3 / x)

    def potential(x, z):
        r2 = x * x + z * z - focal**2
        u2 = 0.5 * r2 * (1 + np.sqrt(1 + 4 * focal**2 * z * z / r2**2))
        u = np.sqrt(u2)
        sin2 = z * z / u2
        gravitation = gm / focal * np.arctan(focal / u) + 0.5 * w * w * a * a * q(u) / q(b) * (
            sin2 - 1.0 / 3.0
        )
        return gravitation + 0.5 * w * w * x * x

    x, _, z = earth.ecef_from_llh([lat, 0.0, height])
    step = 20.0
    gx = (potential(x + step, z) - potential(x - step, z)) / (2 * step)
    gz = (potential(x, z + step) - potential(x, z - step)) / (2 * step)
    return -(gx * np.cos(lat) + gz * np.sin(lat))


def test_gravity_is_the_gradient_of_the_normal_potential():
    for lat in LATITUDES[::5]:
        for height in HEIGHTS:
            expected = _normal_gravity_of_the_potential(lat, height)
            # Rounding of the potential, and what eq. 4-3 leaves out: f² h/a, f h²/a² and h³/a³ times 8 γ.
            u = abs(height / earth.SEMI_MAJOR_AXIS)
            allowed = 2e-9 + 80.0 * (earth.FLATTENING**2 * u + earth.FLATTENING * u**2 + u**3)
            assert abs(earth.gravity(np.sin(lat), height) - expected) < allowed


def test_gravity_gradient_against_finite_difference():
    for height in HEIGHTS:
        by_lat, by_height = earth.gravity_gradient(np.sin(LATITUDES), np.cos(LATITUDES), height)
        step = 1e-5
        numeric = earth.gravity(np.sin(LATITUDES + step), height) - earth.gravity(
            np.sin(LATITUDES - step), height
        )
        np.testing.assert_allclose(by_lat, numeric / (2 * step), atol=1e-9)
        numeric = earth.gravity(np.sin(LATITUDES), height + 10.0) - earth.gravity(
            np.sin(LATITUDES), height - 10.0
        )
        np.testing.assert_allclose(by_height, numeric / 20.0, atol=1e-14)


def test_radii_gradient_against_finite_difference():
    step = 1e-5
    numeric = (np.array(earth.radii(np.sin(LATITUDES + step))) - earth.radii(np.sin(LATITUDES - step))) / (
        2 * step
    )
    np.testing.assert_allclose(earth.radii_gradient(np.sin(LATITUDES), np.cos(LATITUDES)), numeric, atol=1e-3)


def test_transport_rate_is_the_turning_of_the_local_axes():
    lat, lon, height, vel = 0.7, 0.3, 500.0, (120.0, -80.0, 5.0)
    metres = earth.metres_per_radian([lat, lon, height])
    lat_dot, lon_dot = vel[0] / metres[0], vel[1] / metres[1]
    step = 1.0
    ahead, behind = (earth.mat_en(lat + s * lat_dot, lon + s * lon_dot) for s in (step, -step))
    turned = earth.mat_en(lat, lon).T @ (ahead - behind) / (2 * step)
    numeric = [turned[2, 1], turned[0, 2], turned[1, 0]]
    np.testing.assert_allclose(
        earth.transport_rate(np.sin(lat), np.cos(lat), height, vel), numeric, atol=1e-13
    )


def test_earth_rate_is_the_earth_axis():
    expected = earth.mat_en(0.6, 1.1).T @ [0.0, 0.0, earth.EARTH_RATE]
    np.testing.assert_allclose(earth.earth_rate(np.sin(0.6), np.cos(0.6)), expected, atol=1e-20)


@given(latitude, st.floats(-7.0, 7.0), st.lists(st.floats(-2.0, 2.0), min_size=1, max_size=6))
def test_tracks_lose_their_jumps_and_nothing_else(lat, lon, steps):
    true = lon + np.concatenate([[0.0], np.cumsum(steps)])
    llh = np.column_stack(
        [np.full(len(true), lat), np.remainder(true + np.pi, 2 * np.pi) - np.pi, 0.0 * true]
    )
    llh[1:1] = np.nan
    smooth = earth.without_jumps(llh)
    np.testing.assert_allclose(np.diff(smooth[:, 1]), steps, atol=1e-12)
    np.testing.assert_allclose(earth.ned_between(smooth, llh), 0.0, atol=1e-6)
    assert abs(smooth[0, 1]) <= np.pi
    np.testing.assert_allclose(
        earth.ned_between(np.radians(earth.in_degrees(llh)) * [1, 1, 0], llh * [1, 1, 0]), 0, atol=1e-6
    )


def test_rows_without_position_do_not_break_a_track():
    llh = np.array([[0.1, 3.1, 0.0], [np.nan] * 3, [0.1, -3.1, 0.0], [0.1, -3.0, 0.0]])
    np.testing.assert_allclose(
        earth.without_jumps(llh)[[0, 2, 3], 1], [3.1, 2 * np.pi - 3.1, 2 * np.pi - 3.0]
    )


def test_tangent_plane_and_distance_are_displacements_where_they_are_small():
    reference = np.array([1.55, np.pi - 1e-6, 12e3])
    ned = np.array([[3.0, 5.0, -2.0], [-20.0, 10.0, 4.0]])
    track = earth.llh_displaced(reference, np.vstack([np.zeros(3), ned]))
    track[1:, 1] -= 2.0 * np.pi
    np.testing.assert_allclose(earth.in_tangent_plane(track, reference)[0][1:], ned, atol=5e-3)
    np.testing.assert_allclose(earth.distance_along(track)[1:], ned, atol=5e-3)
