"""The filter behind an output: the error-state filter whose sds are those that the output states.

Along the trajectory the errors of any inertial filter obey the same linear dynamics: position, velocity, attitude and
biases, driven by white noise of gyros and accelerometers and by that of their biases [1]_. What a filter assumes, the
densities of four noises, the time constants of the biases and the variances of position and velocity fixes, horizontal
and vertical, is found by least squares of the logarithms of its sds; where no such filter has these, scale factors join
its states. An output without attitude may be that of a filter of position and velocity, driven by white accelerations
and aided by positions: with fewer numbers it is tried first. Its gains follow.

References
----------
.. [1] P. D. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed., ch. 14.2.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from models import rotation
from models.arrays import FloatArray
from tuner.consistency.output_causes.course import GRAVITY, Course, head
from tuner.consistency.output_errors import OutputErrors
from tuner.linear_run.likelihood import NoiseHypothesis, covariances
from tuner.linear_run.linearized_run import LinearizedRun

DEFAULT_SD = np.repeat([3.0, 0.3, 0.03, 1e-3, 0.03], 3)
"""Sds at the start of states for which none are stated, SI: after a coarse alignment of a consumer unit."""
FIRST_GUESS = np.log([1e-4, 3e-3, 3e-5, 3e-4])
"""Densities from which the search begins, SI: a consumer unit."""
LOG_SPAN = 12.0
"""How far, as a logarithm, the search may go from its first guess: from a consumer unit to a navigation grade."""
MAX_FITTED_EPOCHS = 400
"""Epochs of a run that are fitted: eight numbers follow from far fewer."""
MAX_MISFIT = 0.05
"""Rms difference of the logarithms of sds above which no such filter explains them: filters without further states
leave 0.2 to 1 %; of KF-GINS with scale factors of 3 %, a model without them leaves 14 %, with densities wrong by powers
of ten, and one with them 1.5 %."""
SCALE_GUESS = np.log([3e-3, 3e-3])
"""Sds of scale factors from which the search begins."""
MIN_MISFIT = 0.01
"""Error of the sds of a modelled filter that is taken at least: what its linear dynamics leave out."""
NO_FIX_VARIANCE = 1e12
"""Variance of fixes that there are not, (m/s)²."""
SIMPSON = np.array([1.0, 4.0, 1.0]) / 6.0
"""Weights of the begin, middle and end of a step in its mean (Simpson's rule)."""
PLAIN_PARAMETERS = np.array([1, 6, 7])
"""Of the numbers of a filter those of one of position and velocity: white acceleration, horizontal and vertical R."""


@dataclass(frozen=True)
class FilterModel:
    """What a filter assumes, as its sds show (SI).

    Attributes
    ----------
    density : ndarray, shape (4,)
        Of gyro white noise, accelerometer white noise, gyro bias noise and accelerometer bias noise.
    time_constant : ndarray, shape (2,)
        Of gyro and accelerometer biases, s.
    fix_variance : ndarray, shape (6,)
        Of position and velocity fixes.
    misfit : float
        Rms difference of the logarithms of its sds and those stated.
    log_density_sd : ndarray, shape (4,)
        How well the sds tell the logarithms of the densities: errors of one epoch's sds, as those of all are alike.
    log_time_sd : ndarray, shape (2,)
        The same of the time constants.
    scale_sd : ndarray, shape (2,), or None
        Of scale factors of gyros and accelerometers among its states; None without.
    without_attitude : bool
        Whether its states are position and velocity alone, driven by white accelerations.
    """

    density: FloatArray
    time_constant: FloatArray
    fix_variance: FloatArray
    misfit: float
    log_density_sd: FloatArray = field(default_factory=lambda: np.full(4, np.inf))
    log_time_sd: FloatArray = field(default_factory=lambda: np.zeros(2))
    scale_sd: FloatArray | None = None
    without_attitude: bool = False

    @property
    def fits(self) -> bool:
        """Whether the sds are those of such a filter."""
        return self.misfit < MAX_MISFIT


def transitions(course: Course, time_constant: FloatArray, states: int = 15) -> tuple[FloatArray, FloatArray]:
    """Return transition matrices and process noise of unit density by source; (k, n, n), (k, 4, n, n).

    The errors are truth minus estimate: p' = v, v' = −[f ×] φ − C δa, φ' = −C δg, biases decaying; scale factors of the
    gyros and accelerometers, in a filter of 21 states, add −C diag(ω) δs to φ' and −C diag(f) δs to v'. Of velocities
    along the axes of the body p' = u − [v ×] φ, u' = [ω ×] u − u / T − C δa, T being the second time constant: a random
    walk that is measured often is known with an error of the first order.
    """
    k = len(course.dt)
    if course.motion.of_body:
        fading = float(time_constant[1])
        return _body_transition(course, fading), _body_noise(course, fading)
    half, whole = (_transition(course, time_constant, share, states) for share in (0.5, 1.0))
    noise = np.zeros((k, 4, states, states))
    for s, (first, mat) in enumerate(((6, course.mat_nb), (3, course.mat_nb), (9, None), (12, None))):
        g = np.zeros((k, states, 3))
        g[:, first : first + 3] = np.eye(3) if mat is None else mat
        for weight, phi in zip(SIMPSON, (np.eye(states), half, whole), strict=True):
            column = phi @ g
            noise[:, s] += weight * course.dt[:, None, None] * (column @ np.swapaxes(column, -1, -2))
    return whole, noise


def _transition(course: Course, time_constant: FloatArray, share: float, states: int) -> FloatArray:
    """Return transition matrices over a share of each step: without decay, the third power of the rates is the last."""
    c, dt = course.mat_nb, share * course.dt[:, None, None]
    step = np.zeros((len(c), states, states))
    step[:, 0:3, 3:6] = dt * np.eye(3)
    step[:, 3:6, 6:9] = -dt * rotation.skew(course.force)
    step[:, 3:6, 12:15] = step[:, 6:9, 9:12] = -dt * c
    if states > 15:
        rate, force = (np.einsum("kji,kj->ki", c, x)[:, None] for x in (course.motion.rate, course.force))
        step[:, 6:9, 15:18], step[:, 3:6, 18:21] = -dt * c * rate, -dt * c * force
    square = step @ step
    phi = np.eye(states) + step + square / 2.0 + step @ square / 6.0
    decaying = np.concatenate([np.repeat(time_constant, 3), np.repeat(time_constant[0], 6)])[: states - 9]
    phi[:, range(9, states), range(9, states)] = np.exp(-dt[:, 0] / decaying)
    return np.asarray(phi)


def _body_transition(course: Course, fading: float) -> FloatArray:
    """Return transition matrices of errors with velocities along the axes of the body."""
    dt = course.dt[:, None, None]
    angle = rotation.mat_from_rotvec(course.motion.rate * dt[:, :, 0])
    decay = np.exp(-dt / fading)
    mean = np.minimum(fading * (1.0 - decay), dt)
    phi = np.tile(np.eye(15), (len(course.dt), 1, 1))
    middle = course.motion.vel - 0.5 * course.dt[:, None] * (course.force + GRAVITY)
    phi[:, 0:3, 3:6] = mean * np.eye(3)
    phi[:, 0:3, 6:9] = -dt * rotation.skew(middle)
    phi[:, 0:3, 9:12] = 0.5 * dt**2 * (rotation.skew(middle) @ course.mat_nb)
    phi[:, 3:6, 3:6] = decay * angle
    phi[:, 6:9, 9:12] = -dt * course.mat_nb
    return phi


def _body_noise(course: Course, fading: float) -> FloatArray:
    """Return their noise of unit density: of level, of the fading velocity, of heading, and none."""
    k, dt = len(course.dt), course.dt[:, None, None]
    noise, eye = np.zeros((k, 4, 15, 15)), np.eye(3)
    turned = np.zeros((k, 15, 3))
    for weight, rest in zip(SIMPSON, (0.0, 0.5, 1.0), strict=True):
        turned[:, 0:3] = -rest * dt * rotation.skew(course.motion.vel)
        turned[:, 6:9] = eye
        for source, axes in ((0, slice(0, 2)), (2, slice(2, 3))):
            own = turned[:, :, axes]
            noise[:, source] += weight * dt * (own @ np.swapaxes(own, -1, -2))
    one, two = (1.0 - np.exp(-n * dt / fading) for n in (1, 2))
    noise[:, 1, 0:3, 0:3] = fading**2 * (dt - 2.0 * fading * one + 0.5 * fading * two) * eye
    noise[:, 1, 0:3, 3:6] = fading**2 * (one - 0.5 * two) * eye
    noise[:, 1, 3:6, 0:3] = noise[:, 1, 0:3, 3:6]
    noise[:, 1, 3:6, 3:6] = 0.5 * fading * two * eye
    return noise


def start_covariance(run: OutputErrors, course: Course, *, without_attitude: bool = False) -> FloatArray:
    """Return P at the first epoch: as stated, `DEFAULT_SD` of what is not, 0 of what is no state; (15, 15)."""
    stated = run.covariance[course.rows[0]]
    good = np.diag(stated) > 0.0
    start = np.where(good[:, None] & good[None, :], stated, 0.0)
    start[~good, ~good] = DEFAULT_SD[~good] ** 2
    if course.motion.of_body:
        start[9:, 9:] = 0.0
    if without_attitude:
        start[6:, 6:] = 0.0
    return np.asarray(start)


def filter_matrices(
    course: Course, model: FilterModel, start: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return transition, noise by source and start of a filter, of 15 states, or of 21 with scale factors.

    The noise is that of the densities that it assumes; that of scale factors, first-order processes with the time
    constant of the gyro biases as in filters with one time constant for all, joins that of the gyro biases.
    """
    phi, noise = transitions(course, model.time_constant, 15 if model.scale_sd is None else 21)
    noise = noise * (model.density**2)[:, None, None]
    if model.scale_sd is not None:
        variance, new = np.repeat(model.scale_sd**2, 3), range(15, 21)
        noise[:, 2, new, new] = (1.0 - phi[:, new, new] ** 2) * variance
        start = np.pad(start, (0, 6))
        start[new, new] = variance
    return phi, noise, start


def filter_run(
    course: Course, model: FilterModel, phi: FloatArray, noise: FloatArray, start: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return P after every epoch of a filter and the gains of its fixes, (k, n, n), (k, n, 6)."""
    k, n = phi.shape[:2]
    fixed, none = np.tile(course.fixed[:, None], 6), np.zeros((k, 6))
    sd = np.tile(np.sqrt(model.fix_variance), (k, 1))
    run = LinearizedRun(
        np.cumsum(course.dt), phi, {"all": noise.sum(axis=1)}, np.tile(np.eye(6, n), (k, 1, 1)), none, sd, sd, fixed,
        fixed, np.zeros((k, n)), start, (), np.zeros((k, n, 0)), np.zeros((k, 6, 0)), np.zeros(k, dtype=bool),
    )  # fmt: skip
    p = covariances(NoiseHypothesis(run, sd, np.ones(1), fixed))
    return p, p[:, :, :6] / model.fix_variance * course.fixed[:, None, None]


def fit_filter(run: OutputErrors, course: Course) -> FilterModel:
    """Return the filter whose sds are nearest to those of a run: the one with the fewest states that fits."""
    if not (course.motion.of_body or np.isfinite(run.estimate.quat_nb).any()):
        found = _fit(run, course, without_attitude=True)
        if found.misfit < MIN_MISFIT:
            return found
    found = _fit(run, course)
    if found.fits or course.motion.of_body:
        return found
    other = _fit(run, course, scale=True)
    return other if other.fits else found


def _fit(
    run: OutputErrors, course: Course, *, scale: bool = False, without_attitude: bool = False
) -> FilterModel:
    from scipy.optimize import least_squares  # loaded when used: slow to import

    count = min(len(course.dt), MAX_FITTED_EPOCHS)
    variance = np.einsum("kii->ki", run.covariance)[course.rows[1 : count + 1]]
    stated = np.log(np.where(variance > 0.0, variance, np.nan))
    states = np.flatnonzero(np.isfinite(stated).all(axis=0))
    if course.motion.of_body:
        states = states[states < 9]
    first = count // (20 if len(states) == 15 else 3)
    start = start_covariance(run, course, without_attitude=without_attitude)
    settled = np.exp(np.median(stated, axis=0))
    position = settled[[0, 2]] if 0 in states else np.ones(2)
    velocity = settled[[3, 5]] if 3 in states else np.full(2, 0.01)
    guess = np.concatenate(
        [FIRST_GUESS, np.log([300.0, 300.0]), 0.5 * np.log(10.0 * np.concatenate([position, velocity]))]
    )
    part = head(course, count)
    if course.motion.of_body:
        guess[5] = 0.0
    if scale:
        guess = np.concatenate([guess, SCALE_GUESS])
    fixed = guess.copy()
    free = np.arange(len(guess))
    if without_attitude:
        free = PLAIN_PARAMETERS
        fixed[[0, 2, 3]], fixed[8:10] = -np.inf, 0.5 * np.log(NO_FIX_VARIANCE)

    def whole(x: FloatArray) -> FloatArray:
        every = fixed.copy()
        every[free] = x
        return every

    def residual(x: FloatArray) -> FloatArray:
        model = _model(whole(x), 0.0, of_body=course.motion.of_body)
        phi, noise, wide = filter_matrices(part, model, start)
        p, _ = filter_run(part, model, phi, noise, wide)
        own = np.log(np.maximum(np.einsum("kii->ki", p)[:, :15], 1e-30))
        return np.asarray(0.5 * (own - stated)[first:, states].ravel())

    begin = guess[free]
    found = least_squares(
        residual, begin, bounds=(begin - LOG_SPAN, begin + LOG_SPAN), x_scale=1.0, diff_step=1e-4, max_nfev=40
    )
    misfit = float(np.sqrt(np.mean(found.fun**2)))
    # Sds of neighbouring epochs err together: all of them are worth one.
    information = found.jac.T @ found.jac / (count - first) + 1e-12 * np.eye(len(begin))
    sd = np.zeros(len(guess))
    sd[free] = max(misfit, MIN_MISFIT) * np.sqrt(np.diag(np.linalg.inv(information)))
    return replace(
        _model(whole(found.x), misfit, of_body=course.motion.of_body),
        log_density_sd=sd[:4],
        log_time_sd=sd[4:6],
        without_attitude=without_attitude,
    )


def _model(x: FloatArray, misfit: float, *, of_body: bool) -> FilterModel:
    variance = np.exp(2.0 * x[6:10])[[0, 0, 1, 2, 2, 3]]
    scale = np.exp(x[10:]) if len(x) > 10 else None
    if of_body:  # what is measured of the velocity is in its fading
        variance[3:] = NO_FIX_VARIANCE
    return FilterModel(np.exp(x[:4]), np.exp(x[4:6]), variance, misfit, scale_sd=scale)
