"""Error dynamics: F and G equal finite differences of the mechanisation; discretisation meets its stated error."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from models import rotation, strapdown
from models.earth import metres_per_radian
from models.error_state import (
    Linearization,
    corrected,
    coupling,
    dynamics,
    middle,
    navigation_error,
    process_noise,
    process_noise_variance,
    transition,
)
from models.filter_states import named_states
from models.imu_errors import calibration, sensor_jacobian
from models.noise import GaussMarkov
from models.state_layout import AxisNoise, StateLayout, error_model
from models.statespace import StateSpace, discretize
from models.strapdown import NavigationState, correct_increments, mean_attitude, step
from models.trajectory.catalogue import TRAJECTORIES
from models.trajectory.motion import imu_increments

LADDER = (GaussMarkov(1e-5, 3.0), GaussMarkov(2e-5, 40.0))
GYRO = (
    AxisNoise(3e-5, walk_density=1e-6, markov=LADDER),
    AxisNoise(4e-5, walk_density=2e-6, bias_time_constant=300.0),
    AxisNoise(5e-5, walk_density=1e-6, markov=LADDER[:1]),
)
ACCEL = (
    AxisNoise(1e-3, walk_density=1e-5),
    AxisNoise(2e-3, walk_density=1e-5, bias_time_constant=100.0, markov=LADDER),
    AxisNoise(1.5e-3, walk_density=2e-5, markov=LADDER[:1]),
)
FULL = error_model(GYRO, ACCEL, gnss_markov=(GaussMarkov(1.0, 60.0),), constants=named_states())
BASE = error_model([AxisNoise(3e-5, 1e-6)] * 3, [AxisNoise(1e-3, 1e-5)] * 3)


def _parameters(model, seed=7):
    """Plausible estimates of all sensor states."""
    x = 0.01 * np.random.default_rng(seed).standard_normal(model.layout.size)
    x[:9] = 0.0
    return x


@pytest.fixture(params=[BASE, FULL], ids=["base", "full"])
def model(request):
    return request.param


@pytest.fixture
def place(model):
    x = _parameters(model)
    mat = rotation.mat_from_rpy([0.2, -0.3, 1.1])
    return x, Linearization(
        np.array([0.7, 0.2, 300.0]),
        np.array([30.0, -20.0, 4.0]),
        mat,
        np.array([0.1, -0.2, 0.3]),
        np.array([1.0, -0.5, -9.5]),
        calibration(model, x),
    )


def test_layout_is_consistent():
    layout = FULL.layout
    assert layout.size == len(FULL.time_constant) == len(FULL.driving_density)
    covered = np.concatenate([np.arange(layout.size)[layout[name]] for name, _ in layout.blocks])
    np.testing.assert_array_equal(covered, np.arange(layout.size))
    assert BASE.layout.size == 15
    assert "gravity" in layout
    assert "gravity" not in BASE.layout
    assert (BASE.layout.start("gyro_bias"), BASE.layout.start("gravity")) == (9, -1)
    assert StateLayout((("a", 2),)) == StateLayout((("a", 2),))


@pytest.mark.parametrize(
    "make",
    [
        lambda: AxisNoise(-1.0),
        lambda: AxisNoise(1.0, bias_time_constant=0.0),
        lambda: error_model(GYRO[:2], ACCEL),
        lambda: error_model(GYRO, ACCEL, constants=("lever",)),
    ],
)
def test_impossible_models_are_refused(make):
    with pytest.raises(ValueError, match="'"):
        make()


def test_error_and_correction_are_inverse():
    rng = np.random.default_rng(3)
    estimate = NavigationState(
        np.array([0.7, 3.1, 50.0]), rng.standard_normal(3), rotation.quat_from_rpy([0.1, 0.2, 3])
    )
    error = 0.1 * rng.standard_normal(9)
    np.testing.assert_allclose(navigation_error(corrected(estimate, error), estimate), error, atol=1e-8)


def _measured_rates(of, true):
    """What sensors of a calibration would measure."""
    return of.matrix @ true + of.bias


def test_calibration_round_trip_and_its_jacobian(model, place):
    x, at = place
    true = np.concatenate([at.omega_b, at.force_b])
    np.testing.assert_allclose(
        at.calibration.true_rates(_measured_rates(at.calibration, true)), true, rtol=1e-14
    )
    jacobian = np.stack(
        [
            (
                _measured_rates(calibration(model, x + e), true)
                - _measured_rates(calibration(model, x - e), true)
            )
            / 2e-3
            for e in 1e-3 * np.eye(len(x))
        ],
        axis=-1,
    )
    np.testing.assert_allclose(sensor_jacobian(model, at.omega_b, at.force_b), jacobian, atol=1e-12)


def _rate_of_error(model, x, at, delta):
    """Derivative of the error states when the truth is `delta` away from the estimate."""
    measured = _measured_rates(at.calibration, np.concatenate([at.omega_b, at.force_b]))

    def flow(state, parameters, h):
        mat = rotation.mat_from_quat(state.quat_nb)
        true = calibration(model, parameters).true_rates(measured)
        pos_dot, vel_dot, turn = strapdown.rates(
            tuple(state.llh), tuple(state.vel_n), tuple(mat), tuple(true[:3]), tuple(true[3:])
        )
        vel_dot = np.array(vel_dot)
        if "gravity" in model.layout:
            vel_dot[2] += parameters[model.layout["gravity"]][0]
        quat = rotation.quat_multiply(rotation.quat_from_rotvec(h * np.array(turn)), state.quat_nb)
        return NavigationState(state.llh + h * np.array(pos_dot), state.vel_n + h * vel_dot, quat)

    estimate = NavigationState(at.llh, at.vel_n, rotation.quat_from_mat(at.mat_nb))
    truth = corrected(estimate, delta[:9])
    h = 0.005
    ends = [navigation_error(flow(truth, x + delta, s), flow(estimate, x, s)) for s in (h, -h)]
    return (ends[0] - ends[1]) / (2 * h)


def test_dynamics_against_finite_differences(model, place):
    """Exact to the rounding of positions: the derivatives of the radii and of gravity are in F."""
    x, at = place
    f = dynamics(model, at)
    size = np.full(len(x), 1e-3)
    size[:3], size[3:6] = 200.0, 1.0
    for k in range(len(x)):
        e = size[k] * np.eye(len(x))[k]
        numeric = (_rate_of_error(model, x, at, e) - _rate_of_error(model, x, at, -e)) / (2 * size[k])
        rounding = np.array([4e-7] * 3 + [1e-11] * 3 + [1e-12] * 3) / size[k]
        np.testing.assert_array_less(np.abs(f[:9, k] - numeric), 1e-4 * np.abs(numeric) + rounding)
    bias = f[9:, 9:]
    np.testing.assert_array_equal(np.diag(bias), -1.0 / model.time_constant[9:])


def test_small_couplings_against_finite_differences():
    """All terms of the Earth and the transport rate, fast and far north, without any force."""
    llh, vel, zero = np.array([1.2, 0.4, 1e4]), np.array([250.0, -180.0, 20.0]), (0.0, 0.0, 0.0)

    def flow(position, velocity):
        return np.concatenate(strapdown.rates(tuple(position), tuple(velocity), tuple(np.eye(3)), zero, zero))

    by_llh, by_vel = np.empty((9, 3)), np.empty((9, 3))
    for i, (angle, speed) in enumerate(zip((1e-4, 1e-4, 100.0), (1.0, 1.0, 1.0), strict=True)):
        e, d = angle * np.eye(3)[i], speed * np.eye(3)[i]
        by_llh[:, i] = (flow(llh + e, vel) - flow(llh - e, vel)) / (2 * angle)
        by_vel[:, i] = (flow(llh, vel + d) - flow(llh, vel - d)) / (2 * speed)
    metres = metres_per_radian(llh)
    step = 0.1
    ahead, behind = (metres_per_radian(llh + s * flow(llh, vel)[:3]) for s in (step, -step))
    stretch = np.diag((ahead - behind) / (2 * step) / metres)

    f_rr, f_vr, f_vv, f_ar, f_av, omega_in = (np.array(block) for block in coupling(tuple(llh), tuple(vel)))
    for block, expected, size in (
        (f_rr, metres[:, None] * by_llh[:3] / metres + stretch, 1e-4),
        (np.eye(3), metres[:, None] * by_vel[:3], 1.0),
        (f_vr, by_llh[3:6] / metres, 1e-8),
        (f_vv, by_vel[3:6], 1e-4),
        (f_ar, by_llh[6:] / metres, 1e-11),
        (f_av, by_vel[6:], 1e-7),
        (omega_in, -flow(llh, vel)[6:], 1e-4),
    ):
        np.testing.assert_allclose(block, expected, rtol=1e-6, atol=1e-6 * size)


def test_middle_of_a_step_is_half_way():
    start = NavigationState(
        np.array([0.7, 0.2, 300.0]), np.array([1.0, 2.0, 3.0]), rotation.quat_from_rotvec([0, 0, 0.2])
    )
    end = NavigationState(start.llh + 1e-6, -3.0 * start.vel_n, rotation.quat_from_rotvec([0, 0, 0.6]))
    place = middle(start, end, [1.0, 2.0, 3.0], [9.0, 0.0, 0.0])
    np.testing.assert_allclose(place.llh, start.llh + 5e-7, rtol=1e-15)
    np.testing.assert_allclose(place.vel_n, -start.vel_n)
    np.testing.assert_allclose(place.mat_nb, rotation.mat_from_rotvec([0, 0, 0.4]), atol=1e-15)
    np.testing.assert_allclose(place.mat_nb @ place.force_b, [9.0, 0.0, 0.0], atol=1e-14)


def test_vertical_channel_is_unstable_and_tilt_has_the_period_of_schuler():
    f = dynamics(BASE, _still())
    assert f[5, 2] == pytest.approx(2 * 9.8 / 6.37e6, rel=0.01)
    schuler = f[3, 7] * f[7, 3]
    assert 2 * np.pi / np.sqrt(-schuler) == pytest.approx(84.4 * 60, rel=0.01)


def test_transition_against_one_step_of_the_mechanisation(model, place):
    """Φ is the derivative of one mechanisation step, to the stated order."""
    x, at = place
    dt = 0.01
    measured = dt * _measured_rates(at.calibration, np.concatenate([at.omega_b, at.force_b]))

    def advance(state, parameters):
        true = dt * calibration(model, parameters).true_rates(measured / dt)
        a, u = tuple(true[:3]), tuple(true[3:])
        rotvec, force = correct_increments(a, u, a, u)
        pos, vel, quat, _ = step(
            tuple(state.llh), tuple(state.vel_n), tuple(state.quat_nb), rotvec, force, dt
        )
        shift = np.zeros(3)
        if "gravity" in model.layout:
            shift[2] = dt * parameters[model.layout["gravity"]][0]
        moved = corrected(
            NavigationState(np.array(pos), np.array(vel), np.array(quat)),
            np.r_[0.5 * dt * shift, np.zeros(6)],
        )
        return NavigationState(moved.llh, moved.vel_n + shift, moved.quat_nb)

    estimate = NavigationState(at.llh, at.vel_n, rotation.quat_from_mat(at.mat_nb))
    end = advance(estimate, x)
    middle = np.array(mean_attitude(tuple(estimate.quat_nb), tuple(end.quat_nb)))
    phi = transition(
        model, Linearization(at.llh, at.vel_n, middle, at.omega_b, at.force_b, at.calibration), dt
    )
    size = np.full(len(x), 1e-3)
    size[:3], size[3:6] = 200.0, 1.0
    for k in range(len(x)):
        e = size[k] * np.eye(len(x))[k]
        ahead, behind = (
            navigation_error(advance(corrected(estimate, d[:9]), x + d), advance(estimate, x))
            for d in (e, -e)
        )
        numeric = (ahead - behind) / (2 * size[k])
        allowed = np.array([3e-8] * 3 + [3e-6] * 3 + [3e-7] * 3) + 2e-9 / size[k]
        assert np.all(np.abs(phi[:9, k] - numeric) < allowed), (k, phi[:9, k] - numeric)


def _compound(model, at, duration, n):
    phi, q = np.eye(model.layout.size), np.zeros((model.layout.size,) * 2)
    one, noise = transition(model, at, duration / n), process_noise(model, at, duration / n)
    for _ in range(n):
        phi, q = one @ phi, one @ q @ one.T + noise
    return phi, q


def test_transitions_compound_to_the_exponential(model, place):
    """Φ(a + b) = Φ(b) Φ(a) holds in the limit, with an error of first order in the small terms alone."""
    _, at = place
    exact = expm(dynamics(model, at) * 10.0)
    coarse, fine = (_compound(model, at, 10.0, n)[0] for n in (500, 1000))
    scale = np.abs(exact) + 1e-3 * np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    assert np.max(np.abs(fine - exact) / scale) < np.max(np.abs(coarse - exact) / scale)
    chain = np.ix_(range(9), range(9, 15))
    np.testing.assert_allclose(fine[chain], exact[chain], rtol=5e-3, atol=1e-4 * np.abs(exact[chain]).max())


def test_gauss_markov_states_compound_exactly():
    one, two = (transition(FULL, _still(), dt)[9:, 9:] for dt in (0.5, 1.0))
    decays = np.diag(one)
    np.testing.assert_allclose(decays**2, np.diag(two), rtol=1e-14)
    np.testing.assert_allclose(
        decays**2 * process_noise_variance(FULL, 0.5)[9:] + process_noise_variance(FULL, 0.5)[9:],
        process_noise_variance(FULL, 1.0)[9:],
        rtol=1e-13,
    )
    stationary = process_noise_variance(FULL, 1e6)[FULL.layout["gyro_markov"]]
    np.testing.assert_allclose(np.sqrt(stationary), [1e-5, 2e-5, 1e-5], rtol=1e-12)


def _still():
    return Linearization(
        np.array([0.7, 0.2, 300.0]), np.zeros(3), np.eye(3), np.zeros(3), np.array([0.0, 0.0, -9.8])
    )


def noise_density(model, at):
    """Two-sided spectral density of the noise in x' = F x + noise."""
    turn, push = at.sensor_response()
    g = np.zeros((model.layout.size, 6))
    g[model.layout["velocity"]], g[model.layout["attitude"]] = push, turn
    white = np.concatenate([model.gyro_density, model.accel_density]) ** 2
    return np.diag(model.driving_density**2) + (g * white) @ g.T


def test_process_noise_compounds_to_the_exact_integral(model, place):
    """Against the doubling formula of `models.statespace` over 20 s: 3/(2n), from the driven biases."""
    _, at = place
    size = model.layout.size
    ss = StateSpace(
        F=dynamics(model, at),
        G=np.eye(size),
        H=np.eye(1, size),
        Q=noise_density(model, at),
        P0=np.zeros((size, size)),
    )
    _, exact = discretize(ss, 20.0)
    _, sampled = _compound(model, at, 20.0, 400)
    sd = np.sqrt(np.diag(exact))
    driven = sd > 0
    normalised = ((sampled - exact)[np.ix_(driven, driven)]) / np.outer(sd[driven], sd[driven])
    assert np.max(np.abs(normalised)) < 1.5 / 400


@pytest.mark.parametrize("name", ["city", "s_turns"])
def test_covariance_in_long_steps_is_that_of_every_sample(name):
    """Aided once a second for 40 s, then not for 20 s; one step of the mechanisation is 0.02 s."""
    dt, seconds = 0.02, 60
    motion = TRAJECTORIES[name](float(seconds))
    dtheta, dvel = imu_increments(motion, dt)
    ends = motion.evaluate(dt * np.arange(len(dtheta) + 1))
    turned = (motion.evaluate(dt * (np.arange(len(dtheta)) + 0.5)).mat_nb @ dvel[..., None])[..., 0]
    prior = np.repeat([2.0, 0.3, 0.01, 1e-3, 0.05], 3) ** 2

    def deviations(samples):
        p, out = np.diag(np.r_[prior, np.full(BASE.layout.size - 15, 1e-8)]), []
        for k in range(0, len(dtheta), samples):
            mean = [a[k : k + samples].sum(axis=0) / (samples * dt) for a in (dtheta, turned)]
            place = middle(ends.at(k), ends.at(k + samples), *mean)
            phi = transition(BASE, place, samples * dt)
            p = phi @ p @ phi.T + process_noise(BASE, place, samples * dt)
            second = (k + samples) * dt
            if second < 40.5 and (k + samples) % round(1.0 / dt) == 0:
                gain = p[:, :3] @ np.linalg.inv(p[:3, :3] + np.eye(3))
                p = p - gain @ p[:3]
                p = 0.5 * (p + p.T)
                out.append(np.sqrt(np.diag(p)))
        return np.array([*out, np.sqrt(np.diag(p))])

    np.testing.assert_allclose(deviations(5), deviations(1), rtol=2e-4)


def test_process_noise_is_symmetric_and_not_negative(model, place):
    _, at = place
    q = process_noise(model, at, 0.01)
    np.testing.assert_allclose(q, q.T, atol=1e-20)
    scale = np.sqrt(np.maximum(np.diag(q), 1e-300))
    assert np.linalg.eigvalsh(q / np.outer(scale, scale)).min() > -1e-12
