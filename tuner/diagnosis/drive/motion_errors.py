"""Errors of sensors and fixes that follow the motion and are in no cause, tested on the innovations of a drive.

A cause takes up what the catalogue lacks: vibration that shifts accelerometers with the speed passes for a scale
factor, an antenna on a bending mast for a delay. So errors of every sensor and fix are tried that are proportional to
what the vehicle does, whatever would make them: speed and its square, acceleration and force along the axes, turn
rates, heading, way, height, and time (ramps, warm-up, steps, waves). Each group G of columns S is a constant amplitude
of three axes; with the evidence of the largest over all spreads of its prior (`g-prior` [1]_)::

    z² = bᵀ I⁻¹ b / c,   b = Sᵀ W,   I = Sᵀ S          ln B = ½ [z² − k − k ln(z²/k)]  where z² > k, else 0

beside all that was found, and in place of each cause that was found: of a constant or a jump as if it had not been
taken out, of noise as if it were as stated. The choice among the groups, and of the spread, is paid for.

References
----------
.. [1] A. Zellner, On assessing prior distributions and Bayesian regression analysis with g-prior distributions, in
       Bayesian Inference and Decision Techniques (1986).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from models.arrays import FloatArray
from models.filter_states.declaration import NAVIGATION_STATES
from tuner.diagnosis.drive.causes.base import is_noise_scale
from tuner.diagnosis.drive.causes.bias_jump import BIAS_JUMP, SENSORS
from tuner.diagnosis.drive.causes.correlated_gnss import CORRELATED_GNSS
from tuner.diagnosis.drive.causes.correlated_velocity import CAUSE_CODE as CORRELATED_VELOCITY
from tuner.diagnosis.drive.causes.sensor_bias import CAUSE_CODE as SENSOR_BIAS
from tuner.diagnosis.drive.motion_courses import WAVES, Motion, covariates
from tuner.diagnosis.drive.score_tests import colour_factor, columns_of
from tuner.diagnosis.drive.search import SearchResult
from tuner.linear_run.likelihood import NoiseHypothesis, as_configured, evaluate
from tuner.linear_run.linearized_run import NOISE_GROUPS, LinearizedRun
from tuner.linear_run.whitened_innovations import whiten
from tuner.navigation.settings import ACCELS, GYROS
from tuner.types import ChannelNoise, Parameter

SPREAD_COST = 2.0
"""Cost, nats, of choosing the spread of the prior: sizes known to four decades, of which the best takes about e."""
SLOW_COURSES = ("grows with time", "changes slowly", "settles")
"""What errors of all sensors at once do: one temperature, or one supply, moves them together."""
ATTITUDE_ERRORS = slice(6, 9)
"""Errors of the attitude."""
NEAR_FIXES = (-1, 0, 1)
"""Fixes about that of a jump at which an attitude may jump: between two fixes neither is known better."""
SENSOR_NAMES = {"gyro": "gyroscopes", "accel": "accelerometers"}
IMU_NOISE = "imu_noise_scale"
STATES = {CORRELATED_GNSS: "gnss_position", CORRELATED_VELOCITY: "correlated_velocity"}
"""States of a filter that causes add."""
OF_SHIFTS = "shifts"
"""Stands for constants and jumps, each of which is left out in turn."""
WHITE = ("gyro", "accel")
"""Factors on white noise, in the order of `NOISE_GROUPS`."""
NEGLIGIBLE_SD = 1e-6
"""Factor on an sd that makes nothing of it, and leaves covariances positive."""


@dataclass(frozen=True)
class MotionError:
    """An error in no cause: of what, with what it grows, and its evidence, nats."""

    port: str
    grows_with: str
    evidence: float

    @property
    def text(self) -> str:
        """In words."""
        return f"{self.port} that {self.grows_with}"


def bias_columns(linearized: LinearizedRun) -> FloatArray:
    """Return what a bias of one unit between two fixes does to the errors, (k, n, 6): what it does as a state."""
    unit = linearized.transition[:, :, NAVIGATION_STATES : NAVIGATION_STATES + 6].copy()
    unit[:, NAVIGATION_STATES:] = 0.0
    return unit


Columns = tuple[FloatArray, FloatArray]
"""What c amplitudes add to errors between fixes, (k, n, c), and to fixes, (k, 6, c)."""


@dataclass(frozen=True)
class Port:
    """Where errors enter: in words, what they do at amplitude 1, and the courses they may follow.

    Attributes
    ----------
    name : str
        What is wrong.
    columns : Columns
        Of c amplitudes.
    courses : mapping of str to list of ndarray
        Courses (k,) of all, or (k, c) of each amplitude, by what the error does.
    """

    name: str
    columns: Columns
    courses: Mapping[str, list[FloatArray]]


def ports(linearized: LinearizedRun, jumps: Sequence[float] = ()) -> Iterator[Port]:
    """Yield what may be wrong, with the courses of its error; causes of the catalogue are left out.

    Parameters
    ----------
    linearized : LinearizedRun
        The run.
    jumps : sequence of float
        Times of jumps of a bias that were found, s: an attitude that is wrong from then on looks alike.
    """
    motion = Motion.of(linearized)
    courses = covariates(motion)
    k, n = linearized.transition.shape[:2]
    unit, none = bias_columns(linearized), np.zeros((k, 6, 6))

    def those(*begin: str, but: tuple[str, ...] = ()) -> dict[str, list[FloatArray]]:
        return {
            name: of for name, of in courses.items() if name.startswith(begin) and not name.startswith(but)
        }

    by_jumps = ("changes at",)
    by_rates = (*by_jumps, "grows with the force", "grows with the rate")
    yield Port("an error of the gyroscopes", (unit[:, :, :3], none[:, :, :3]), those("", but=by_rates))
    yield Port("an error of the accelerometers", (unit[:, :, 3:], none[:, :, :3]), those("", but=by_jumps))
    yield Port("an error of all sensors", (unit, none), those(*SLOW_COURSES))
    for sensors, values in (("gyro", motion.rate), ("accel", motion.force)):
        own = list(columns_of(f"{sensors}_scale", linearized.parameters))
        felt = values[:, : len(own)]
        yield Port(
            f"a scale factor of the {SENSOR_NAMES[sensors]}",
            (linearized.B[:, :, own], none[:, :, : len(own)]),
            {"differs between directions": [np.sign(felt)], "grows with what is measured": [np.abs(felt)]},
        )
    three, still = np.zeros((k, 3, 3)), np.zeros((k, n, 3))
    north = np.broadcast_to(np.eye(3), (k, 3, 3))
    for what, rows in (("positions", 0), ("velocities", 3)):
        for axes, mat in (("", north), (" in axes of the vehicle", motion.mat)):
            parts = [mat, three] if rows == 0 else [three, mat]
            shift = np.concatenate(parts, axis=1)
            yield Port(f"an error of the {what}{axes}", (still, shift), those("", but=(WAVES,)))
    for what, cause in (("a lever arm", "lever_arm"), ("a delay of the fixes", "time_offset")):
        own = list(columns_of(cause, linearized.parameters))
        yield Port(
            what, (still[:, :, : len(own)], linearized.D[:, :, own]), those("changes", "grows with time")
        )
    if len(jumps):
        turn = still.copy()
        turn[:, ATTITUDE_ERRORS, :] = np.eye(3)
        at = np.searchsorted(linearized.t, jumps)
        near = {int(i) + more for i in at for more in NEAR_FIXES if 0 <= i + more < k}
        impulses = {f"jumps at {linearized.t[i]:.1f} s": [np.eye(k)[i]] for i in sorted(near)}
        yield Port("an attitude", (turn, none[:, :, :3]), impulses)


def whitened_columns(noise: NoiseHypothesis, columns: Mapping[str, Columns]) -> dict[str, FloatArray]:
    """Return whitened columns (m, c) by name."""
    push = np.concatenate([one[0] for one in columns.values()], axis=2)
    shift = np.concatenate([one[1] for one in columns.values()], axis=2)
    names = tuple(Parameter("column", str(i)) for i in range(push.shape[2]))
    slope = whiten(
        replace(noise, linearized=replace(noise.linearized, parameters=names, B=push, D=shift))
    ).slope
    edges = np.cumsum([one[0].shape[2] for one in columns.values()])[:-1]
    return dict(zip(columns, np.split(slope, edges, axis=1), strict=True))


def _errors_of(noise: NoiseHypothesis, port: Port) -> dict[str, FloatArray]:
    """Return the whitened columns (m, c) of all errors of a port, by what they do; each course is whitened once."""
    push, shift = port.columns

    def times(course: FloatArray) -> Columns:
        of = course[:, None, None] if course.ndim == 1 else course[:, None, :]
        return push * of, shift * of

    once = {str(id(course)): times(course) for courses in port.courses.values() for course in courses}
    found = whitened_columns(noise, once)
    return {
        name: np.column_stack([found[str(id(course))] for course in courses])
        for name, courses in port.courses.items()
    }


@dataclass(frozen=True)
class Fit:
    """Fit of k columns to whitened innovations: z², and how much wider than white noise its sums scatter.

    Two fits to the same innovations are compared with one scatter, the less: what either leaves is in it, and of one
    column it is hardly known.
    """

    z2: float
    count: int
    colour: float

    @classmethod
    def of(cls, t: FloatArray, residual: FloatArray, s: FloatArray) -> Fit:
        """Fit columns (m, k) to whitened innovations (m,) at times t."""
        information, b = s.T @ s, s.T @ residual
        if not np.any(information):
            return cls(0.0, s.shape[1], 1.0)
        step = np.linalg.pinv(information, rcond=1e-9, hermitian=True) @ b
        return cls(float(b @ step), s.shape[1], colour_factor(t, residual - s @ step, s))

    def evidence(self, colour: float) -> float:
        """Return the log Bayes factor of the columns, nats, the spread of their prior the best one."""
        z2 = self.z2 / colour
        return 0.5 * (z2 - self.count - self.count * math.log(z2 / self.count)) if z2 > self.count else 0.0

    def evidence_above(self, other: Fit) -> float:
        """Return how much larger it is than that of another fit."""
        colour = min(self.colour, other.colour)
        return self.evidence(colour) - other.evidence(colour)


NOTHING = Fit(0.0, 1, math.inf)
"""Fit of nothing, which no error has to beat."""


@dataclass(frozen=True)
class Innovations:
    """Innovations in which errors are looked for: noise, whitened rows, what is fitted beside, what is to be beaten."""

    noise: NoiseHypothesis
    residual: FloatArray
    beside: FloatArray
    hurdle: float = SPREAD_COST
    rival: Fit = NOTHING

    @cached_property
    def _q(self) -> FloatArray:
        return np.linalg.qr(self.beside)[0]

    def left(self, s: FloatArray) -> FloatArray:
        """Return what is left of columns beside those that are fitted."""
        return np.asarray(s - self._q @ (self._q.T @ s))


def innovations(outcome: SearchResult, biased: Sequence[str] = ()) -> dict[str, Innovations]:
    """Return the innovations beside all that was found, by "", and as if one cause had not been found, by its code.

    What has to be beaten is the evidence for the cause where it is a constant or a jump, and the likelihood that its
    factors, or its states, gain where it is noise. Of biases beyond their prior, axes `biased`, it is the evidence of
    constants: the filter has their prior.
    """
    run, noise = outcome.final, as_configured(outcome.final.linearized)
    level, bias = evaluate(noise).value, run.hypothesis.errors_in_variables_bias
    found = dict(_shifts(outcome))
    out = {}
    named = with_named_noise(outcome, noise)
    if biased:
        columns = {cause: of for cause, (of, _) in found.items()}
        out[SENSOR_BIAS] = without_bias(named, biased, columns)
    shifts = {OF_SHIFTS: named} if found else {}
    for cause, own in {"": noise, **shifts, **dict(_without_noise(outcome, noise))}.items():
        w = whiten(own)
        residual = w.residual if bias is None else w.residual - w.slope @ bias
        slopes = whitened_columns(own, {c: columns for c, (columns, _) in found.items()}) if found else {}
        none = np.zeros((len(residual), 0))
        if cause != OF_SHIFTS:
            hurdle = level - evaluate(own).value if cause else SPREAD_COST
            out[cause] = Innovations(own, residual, np.column_stack([none, *slopes.values()]), hurdle)
            continue
        for shift in found:
            others = np.column_stack([none, *(s for c, s in slopes.items() if c != shift)])
            alone = Innovations(own, residual + slopes[shift] @ found[shift][1], others)
            least = Fit.of(w.t, alone.left(alone.residual), alone.left(slopes[shift]))
            out[shift] = replace(alone, hurdle=0.0, rival=least)
    return out


def without_bias(noise: NoiseHypothesis, biased: Sequence[str], beside: Mapping[str, Columns]) -> Innovations:
    """Return all innovations from the first fix on, with the evidence of a constant error of some axes as hurdle."""
    start = replace(noise.linearized, scored=np.ones(len(noise.linearized.t), dtype=bool))
    every = replace(noise, linearized=start)
    w = whiten(every)
    push = bias_columns(start)[:, :, [(GYROS + ACCELS).index(axis) for axis in biased]]
    own = {SENSOR_BIAS: (push, np.zeros((len(push), 6, len(biased)))), **beside}
    slopes = whitened_columns(every, own)
    constants = slopes.pop(SENSOR_BIAS)
    alone = Innovations(every, w.residual, np.column_stack([np.zeros((len(w.t), 0)), *slopes.values()]))
    return replace(alone, hurdle=0.0, rival=Fit.of(w.t, alone.left(w.residual), alone.left(constants)))


def with_named_noise(outcome: SearchResult, noise: NoiseHypothesis) -> NoiseHypothesis:
    """Return the noise of the last run with densities of the sensors as stated where no finding says otherwise.

    Larger ones that the search put into the filter follow what no cause explains, and hide it.
    """
    if any(one.cause == IMU_NOISE for one in outcome.accepted):
        return noise
    now, stated = (run.hypothesis.config.channels for run in (outcome.final, outcome.base))
    ratio = np.ones(len(NOISE_GROUPS))
    for i, (sensor, kind) in enumerate(group.split("_") for group in NOISE_GROUPS):
        one, other = (_densities(channels[f"{sensor}_x"], kind) for channels in (now, stated))
        ratio[i] = other / one if one > 0.0 else 1.0
    if np.all(ratio == 1.0):
        return noise
    return replace(noise, process_noise_scale=noise.process_noise_scale * ratio)


def _densities(channel: ChannelNoise, kind: str) -> float:
    """Return a density of an axis that a factor on white noise, or on the noise of its biases, multiplies."""
    if kind == "white":
        return channel.white_density
    return math.hypot(channel.random_walk_density, *(state.sd for state in channel.markov))


def _shifts(outcome: SearchResult) -> Iterator[tuple[str, tuple[Columns, FloatArray]]]:
    """Yield constants and jumps that were found: their columns, and the sizes that were taken out."""
    run, before = outcome.final, outcome.base.hypothesis.compensation
    linearized, after = run.linearized, run.hypothesis.compensation
    for cause in outcome.shifts:
        own = list(columns_of(cause, linearized.parameters))
        names = [linearized.parameters[i] for i in own]
        yield (
            cause,
            ((linearized.B[:, :, own], linearized.D[:, :, own]), after.vector(names) - before.vector(names)),
        )
    if run.hypothesis.jumps:
        unit = bias_columns(linearized)
        later = [
            unit[:, :, SENSORS[jump.sensor][0]] * (linearized.t > jump.time)[:, None, None]
            for jump in run.hypothesis.jumps
        ]
        push = np.concatenate(later, axis=2)
        sizes = np.concatenate([jump.size for jump in run.hypothesis.jumps])
        yield BIAS_JUMP, ((push, np.zeros((len(push), 6, push.shape[2]))), sizes)


def _without_noise(outcome: SearchResult, noise: NoiseHypothesis) -> Iterator[tuple[str, NoiseHypothesis]]:
    """Yield the noise without what each cause of noise changed."""
    linearized, layout = noise.linearized, outcome.final.settings.model.layout
    for one in outcome.accepted:
        if one.cause == IMU_NOISE:
            factors = [one.parameters[name].value if name in one.parameters else 1.0 for name in WHITE]
            before = np.array([factor or 1.0 for factor in factors] + [1.0, 1.0])
            yield one.cause, replace(noise, process_noise_scale=noise.process_noise_scale / before)
        elif is_noise_scale(one.cause):
            said = linearized.reported_sd
            yield one.cause, replace(noise, sd=np.where(np.isfinite(said), said, noise.sd))
        elif STATES.get(one.cause, "") in layout:
            state = layout[STATES[one.cause]]
            initial = linearized.initial.copy()
            initial[state, :] *= NEGLIGIBLE_SD
            initial[:, state] *= NEGLIGIBLE_SD
            slow = {**linearized.noise, "gnss_position": NEGLIGIBLE_SD**2 * linearized.noise["gnss_position"]}
            yield one.cause, replace(noise, linearized=replace(linearized, initial=initial, noise=slow))


def motion_errors(outcome: SearchResult, biased: Sequence[str] = ()) -> dict[str, MotionError]:
    """Return the error with the largest evidence beside all that was found, by "", and in place of each cause."""
    return errors_in(innovations(outcome, biased), [jump.time for jump in outcome.final.hypothesis.jumps])


def errors_in(looked_at: Mapping[str, Innovations], jumps: Sequence[float] = ()) -> dict[str, MotionError]:
    """Return the error with the largest evidence in each of some innovations of one run.

    The evidence is less what it has to beat, and what the choice costs: all places where errors enter are alike
    beforehand, and at each of them all courses.
    """
    best = {name: MotionError("", "", -math.inf) for name in looked_at}
    first = next(iter(looked_at.values())).noise.linearized
    all_ports = list(ports(first, jumps))
    for port in all_ports:
        paid = math.log(len(all_ports) * len(port.courses))
        whitened: dict[int, dict[str, FloatArray]] = {}
        for name, one in looked_at.items():
            own = whitened.setdefault(id(one.noise), {}) or _errors_of(one.noise, port)
            whitened[id(one.noise)] = own
            rows = one.noise.counted
            t = np.broadcast_to(first.t[:, None], rows.shape)[rows]
            y = one.left(one.residual)
            for grows_with, s in own.items():
                evidence = Fit.of(t, y, one.left(s)).evidence_above(one.rival) - one.hurdle - paid
                if evidence > best[name].evidence:
                    best[name] = MotionError(port.name, grows_with, evidence)
    return best
