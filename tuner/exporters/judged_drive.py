"""A drive for KF-GINS, judged in the form in which that program will use it before anything is written.

The files are filtered as KF-GINS does (`as_read`): from the start that they state, with one Gauss–Markov state a bias,
every fix used with its own sd, and no state for errors of the receiver that last. What such a filter lacks has to be in
its sds. So a variance s² is added to that of every fix, horizontal and vertical each for itself: the one with the best
expected log score of what *that* filter predicts, by the best that is known of the truth. That is the reference of the
drive, else what filters with all states make of it; that estimate x has the covariance P, x̂ of the poorer filter C::

    J = mean of  ln det C + tr C⁻¹ (d dᵀ + P)        d = x − x̂

The sds have the best J of the position with fixes, of which they are the sds; velocity and outages, which they hardly
move, would leave it dishonest. White noise, walk of the biases and scale factors of all axes get a factor each, by the
sum of J over position and velocity with fixes and the position after 10 and 60 s without: built-in grades, which stand
in for what nobody measured, are too coarse or too fine for a unit by as much. A factor f costs (ln f / ln 3)² over the
number of blocks with fixes: the noise of a class is known to a factor of 3, and a short drive changes little of it.

What is unknown is not zero. Without a reference P therefore includes three uncertainties more. The first is that of the
delay and, where nobody states it, of the lever arm, which are states of the filters that make x
(`unknown_installation`). The second is that of the receiver: beside the filter of the configuration stand others, with
one error of the fixes that lasts (`lasting`); x and P are the mean and the covariance of all, each weighted by how
likely the drive is with it [2]_. The last is an error of all fixes that lasts longer than the drive: no filter can see
it; its variance is what the receiver states beyond what shows from fix to fix (`unseen_sds`). The log score is proper:
it rewards small errors and punishes dishonesty of both kinds [1]_.

References
----------
.. [1] T. Gneiting, A. E. Raftery, Strictly proper scoring rules, prediction, and estimation, JASA 102 (2007).
.. [2] J. A. Hoeting, D. Madigan, A. E. Raftery, C. T. Volinsky, Bayesian model averaging: a tutorial, Statistical
   Science 14 (1999).
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.arrays import FloatArray
from models.earth import llh_displaced, ned_between
from models.noise import GaussMarkov
from tuner.consistency.drive_scores import blocks, on_clock_of, reference_at, settled, stated
from tuner.consistency.reference_check import trusted_reference
from tuner.consistency.score_drive import (
    CLAIMED_LENGTHS,
    UNKNOWN_DELAY_SD,
    UNKNOWN_LEVER_ARM_SD,
    drive_filter,
)
from tuner.consistency.scores import DIVERGED_REFUSED_SHARE, outage_score, score, squares
from tuner.examination.examine import StreamNoise
from tuner.examination.examined_drive import examined_drive
from tuner.exporters.kf_gins_drive import DriveFiles, drive_files, truth_rows, write_drive
from tuner.formats.customary_units import digits
from tuner.formats.digits import rounded
from tuner.formats.yaml_text import Inline, Noted
from tuner.judgement import judge_export
from tuner.navigation.compensation import compensate, with_stated_arm
from tuner.navigation.data import ABSENT, GATED, Solution
from tuner.navigation.drive.run import Stretch, expect_settled, navigate, outage_windows, prepare
from tuner.navigation.settings import FilterSettings, chi2_gate
from tuner.readers import kf_gins_settings
from tuner.readers.drive import read_drive
from tuner.synthesis.from_drive import config_for_drive
from tuner.types import FilterConfig, GnssNoise
from tuner.types.consistency import ERROR_UNITS, Consistency, RmsError
from tuner.types.judgement import Judgement, Use
from tuner.types.progress import Progress, silent
from tuner.types.records import DataError, Drive, Reference

EVERY_FIX = GnssNoise((0.0, 0.0, 0.0), None, 1.0, gate=1e6)
"""What KF-GINS assumes of a receiver: the sds of each fix, and no gate."""
TRIED_SDS = (0.0, *np.geomspace(0.1, 1000.0, 17).tolist())
"""Values of s that are tried, in medians of the sds of the fixes."""
SCORED = 0.0, 10.0, 60.0
"""Times without fixes by whose errors s is chosen, s."""
NOISE_SPREAD = 3.0
"""Factor by which the noise of a unit differs from what is known of its class, one sd."""
NOISE_STEPS = (3.0, 3.0**0.5)
"""Factors by which noise is moved: its root is what the outages of a drive tell apart."""
PARTS = (slice(0, 2), slice(2, 3))
"""Components that are horizontal and vertical."""
LASTING_SHARES = tuple(0.3 * 2.0**k for k in range(8))
"""Sds of an error that lasts, in sds of the fixes, that are tried: to those of receivers that smooth."""
LASTING_STEPS = tuple(2.0 ** (0.5 * k) for k in range(-2, 3))
"""Factors on the best of them that are tried with all time constants."""
LASTING_TIMES = 60.0, 20.0, 180.0
"""Time constants, s, the first the one of these sds: of one that lasts longer a drive shows what it moves meanwhile."""
NO_WINDOWS = np.zeros((0, 2))
SAME_TIME = 0.02
"""Times of one fix differ by less, s: by the rest of a delay that a filter estimates."""


def export_drive(
    drive: Drive | str | Path,
    config: FilterConfig | str | Path,
    *,
    lever_arm: tuple[float, float, float] | None = None,
    progress: Progress = silent,
) -> tuple[DriveFiles, Judgement]:
    """Examine a recorded drive and return it for KF-GINS, judged; see `judged_drive`.

    Parameters
    ----------
    drive : Drive, str or Path
        As recorded, or where it is stored.
    config : FilterConfig, str or Path
        The settings, their file or the name of a built-in grade.
    lever_arm : tuple of 3 floats, optional
        From the inertial unit to the antenna, forward, right, down, m: it goes before that of the drive and before its
        corrections in the settings.
    progress : callable, optional
        Called with what is being done.

    Raises
    ------
    DataError
        As `judged_drive`, and for a lever arm that `with_mounting` refuses.
    """
    measured, found = examined_drive(drive, progress, lever_arm=lever_arm)
    settings, left_out = with_stated_arm(config_for_drive(measured, config), lever_arm)
    measured = replace(measured, notes=(*measured.notes, *left_out))
    return judged_drive(measured, settings, () if found is None else found.noise)


def judged_drive(
    drive: Drive, config: FilterConfig, noise: Sequence[StreamNoise] = ()
) -> tuple[DriveFiles, Judgement]:
    """Return a drive for KF-GINS with sds for a filter without states of the receiver, and for what it can be used.

    Parameters
    ----------
    drive : Drive
        The drive, examined.
    config : FilterConfig
        The settings with all their states.
    noise : sequence of StreamNoise, optional
        That of the streams, as examined.

    Raises
    ------
    DataError
        Where the drive cannot be aligned, or what would be written errs by more than twice its prediction or more than
        the fixes do.
    """
    files = drive_files(drive, config)
    known, refused, measured = best_known(drive, config, noise)
    if measured:
        files = replace(files, truth=truth_rows(known, files.imu[0, 0] - files.begin))
    known = replace(known, t=known.t - files.begin)
    count = len(files.fixes)
    files = _without(files, refused - files.begin)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "kf-gins.yaml"
        write_drive(files, path)
        stretch, settings = as_read(path)
    best = chosen(stretch, settings, known)
    files, (stretch, settings) = _with_chosen(files, best), best.of(stretch, settings)
    pairs = compared(stretch, settings, known)
    if not pairs:
        raise DataError(
            f"{drive.source or drive.name}: nothing is written for kf-gins: its filter loses this drive"
        )
    alone = fixes_alone(stretch, known)
    verdict = judge_export(consistency(pairs, 1.0 - len(files.fixes) / count), pairs[0].rms, alone)
    if verdict.use is Use.DO_NOT_USE:
        whose = "its filter, without states for errors of fixes that last,"
        raise DataError(
            f"{drive.source or drive.name}: nothing is written for kf-gins: {whose} {verdict.reasons[0]}; `tuner tune "
            "--drive` fits settings to a drive, `tuner navigate` shows what they do in a filter that has such states"
        )
    against = "the reference" if measured else "filters with all states, as there is no reference"
    head = (
        f"Verdict: {verdict.use.value}: as KF-GINS uses these files on this drive: {verdict.reasons[0]}",
        f"position against {against}: the fixes alone {digits(alone)} m; {'; '.join(map(_words, pairs))}",
    )
    return replace(files, header=(*head, *files.header), notes=(*head, *files.notes)), verdict


def best_known(
    drive: Drive, config: FilterConfig, noise: Sequence[StreamNoise] = ()
) -> tuple[Reference, FloatArray, bool]:
    """Return the reference of a drive, else what filters with all states make of it, and which fixes are refused.

    Without a reference it is the mean of those filters by how likely the drive is with each, with their spread.

    Returns
    -------
    known : Reference
        On the clock of the inertial unit.
    refused : ndarray, shape (r,)
        Times of fixes that the likeliest filter refuses, s.
    measured : bool
        Whether it is the reference.
    """
    states = unknown_installation(drive, config) if drive.reference is None else None
    drive = compensate(drive, config.compensation)
    run = _with_all_states(drive, config, states)
    reference = drive.reference
    if reference is not None:
        reference, _ = trusted_reference(reference, run.stretches, run.settings)
    scored = [settled(*pair) for pair in zip(run.stretches, run.solutions, strict=True)]
    expect_settled(
        any(len(rows) > 1 for rows in scored), drive.source, [float(np.ptp(s.t)) for s in run.solutions]
    )
    if reference is not None:
        return on_clock_of(reference, run.solutions, scored)[0], run.refused, True
    others = []
    if (gnss := config.gnss) is not None:

        def with_error(sds: FloatArray, time: float = LASTING_TIMES[0]) -> _AllStates:
            return _with_all_states(drive, replace(config, gnss=lasting(gnss, sds, time)), states)

        usual = np.median(np.concatenate([s.fixes.sd for s in run.stretches]), axis=0)[[0, 2]]
        tried = [with_error(share * usual) for share in LASTING_SHARES]
        likely = [np.argmax([one.log_likelihood(part) for one in tried]) for part in PARTS]
        best = usual * np.array(LASTING_SHARES)[likely]
        others = [with_error(step * best, time) for step, time in product(LASTING_STEPS, LASTING_TIMES)]
    runs = [one for one in (run, *others) if math.isfinite(one.log_likelihood())] or [run]
    prior = -math.log(max(1, len(others))) * (np.arange(len(runs)) > 0)  # as likely as the configured one
    logs = prior + [one.log_likelihood() for one in runs]
    likeliest, weights = runs[int(np.argmax(logs))], np.exp(logs - logs.max())
    weights /= weights.sum()
    apart = np.stack([one.apart(likeliest) for one in runs])
    mean = np.tensordot(weights, apart, 1)
    unseen = np.zeros((len(runs), 1, 9))
    unseen[:, 0, :3] = [unseen_sds(noise, one.config) ** 2 for one in runs]
    variance = np.stack([one.variance for one in runs]) + unseen + (apart - mean) ** 2
    known = likeliest.track
    llh, vel_n = llh_displaced(known.llh, mean[:, :3]), known.vel_n + mean[:, 3:6]
    sd = np.sqrt(np.tensordot(weights, variance, 1))
    return replace(known, llh=llh, vel_n=vel_n, sd=sd), likeliest.refused, False


@dataclass(frozen=True)
class _AllStates:
    """A filter with all the states of a configuration on a drive."""

    config: FilterConfig
    settings: FilterSettings
    stretches: tuple[Stretch, ...]
    solutions: tuple[Solution, ...]

    @property
    def refused(self) -> FloatArray:
        """Times of positions that it refuses, s."""
        return np.concatenate([s.t[s.use[:, 0] == GATED] for s in self.solutions])

    @property
    def track(self) -> Reference:
        """Its estimate at the fixes."""
        parts = zip(
            *(
                (s.t, s.state.llh, s.state.vel_n, rotation.rpy_from_quat(s.state.quat_nb))
                for s in self.solutions
            ),
            strict=True,
        )
        t, llh, vel_n, rpy = (np.concatenate(each) for each in parts)
        return Reference(t, llh, vel_n, rpy, None)

    @property
    def variance(self) -> FloatArray:
        """Variances of position, velocity and attitude, shape (k, 9)."""
        return np.concatenate([np.diagonal(s.covariance, axis1=1, axis2=2)[:, :9] for s in self.solutions])

    def apart(self, other: _AllStates) -> FloatArray:
        """Return its position, m, and velocity, m/s, less those of another; zeros for attitude, shape (k, 9)."""
        mine, its = self.track, other.track
        return np.hstack([ned_between(mine.llh, its.llh), mine.vel_n - its.vel_n, np.zeros_like(its.rpy)])

    def log_likelihood(self, part: slice = slice(6)) -> float:
        """Return that of innovations of some components, those that are there; one that is refused is at its gate."""
        total = 0.0
        for s in self.solutions:
            there = (np.repeat(s.use != ABSENT, 3, axis=1) & np.isfinite(s.innovation))[:, part]
            for own in np.unique(there[there.any(axis=1)], axis=0):
                rows = (there == own).all(axis=1)
                z = s.innovation[rows, part][:, own]
                covariance = s.innovation_covariance[rows, part, part][:, own][:, :, own]
                limit = chi2_gate(self.settings.gate, int(own.sum()))
                terms = np.minimum(squares(z, covariance), limit) + np.linalg.slogdet(covariance)[1]
                total -= 0.5 * float(np.sum(terms))
        return total if math.isfinite(total) else -math.inf


def lasting(gnss: GnssNoise, sds: FloatArray, time: float) -> GnssNoise:
    """Return a receiver with one error of the positions that lasts in place of those that it has.

    Parameters
    ----------
    gnss : GnssNoise
        The receiver.
    sds : ndarray, shape (2,)
        Horizontally and down of an error of the first of the tried times that moves as much in a second, m.
    time : float
        Time constant, s.
    """
    horizontal, down = (math.sqrt(time / LASTING_TIMES[0]) * sds).tolist()
    return replace(gnss, correlated=(GaussMarkov(horizontal, time),), correlated_down=down / horizontal)


def _with_all_states(drive: Drive, config: FilterConfig, states: Mapping[str, float] | None) -> _AllStates:
    settings, _ = drive_filter(drive, config, states=states)
    stretches, _ = prepare(drive, settings)
    return _AllStates(config, settings, stretches, navigate(stretches, settings, NO_WINDOWS))


def unknown_installation(drive: Drive, config: FilterConfig) -> dict[str, float]:
    """Return states of a filter for what is not known of an installation, by their names, with the sds of their priors.

    A lever arm that the drive shows in part, and which is taken out, is estimated again: its other axes are as unknown.
    """
    delay = {"time_offset": min(UNKNOWN_DELAY_SD, drive.clock.delay.left)}
    arm = {} if drive.lever_arm is not None else {"lever_arm": UNKNOWN_LEVER_ARM_SD}
    return {**delay, **arm, **config.constants}


def unseen_sds(noise: Sequence[StreamNoise], config: FilterConfig) -> FloatArray:
    """Return the sds north, east, down, m, that a receiver states and that neither its readings nor its states show."""
    unseen = np.zeros(3)
    shown = np.zeros(3)
    if config.gnss is not None:
        lasting = math.hypot(*(state.sd for state in config.gnss.correlated))
        shown = lasting * np.array([1.0, 1.0, config.gnss.correlated_down])
    for one in noise:
        if one.stream == "fixes" and one.reported is not None:
            own = slice(2, 3) if one.part == "vertical" else slice(0, 2)
            unseen[own] = np.maximum(one.reported**2 - one.sd**2 - shown[own] ** 2, 0.0)
    return np.sqrt(unseen)


@dataclass(frozen=True)
class Compared:
    """Errors of a filter and what it predicts of them.

    Attributes
    ----------
    seconds : float
        Time without fixes, s; 0 with them.
    error : ndarray, shape (r, c)
        Of position and velocity with fixes, else of the position at the ends of outages, m, m/s.
    unknown : ndarray, shape (r, c)
        Variances with which the truth is known.
    covariance : ndarray, shape (r, c, c)
        As the filter predicts it.
    lengths : tuple of int
        Rows of each independent group.
    """

    seconds: float
    error: FloatArray
    unknown: FloatArray
    covariance: FloatArray
    lengths: tuple[int, ...]

    @property
    def rms(self) -> float:
        """Rms error of the position in three axes, what is unknown of the truth included, m."""
        return math.sqrt(float(np.mean(np.sum(self.spread[:, :3] ** 2, axis=1))))

    @property
    def spread(self) -> FloatArray:
        """Rms errors, what is unknown of the truth included, shape (r, c)."""
        return np.asarray(np.sqrt(self.error**2 + self.unknown))

    def squares(self, own: slice) -> FloatArray:
        """Return tr C⁻¹ (d dᵀ + P) of some components, shape (r,)."""
        d, c = self.error[:, own], self.covariance[:, own, own]
        spread = d[:, :, None] * d[:, None, :] + self.unknown[:, own, None] * np.eye(d.shape[1])
        return np.asarray(np.trace(np.linalg.solve(c, spread), axis1=1, axis2=2))

    def score(self, own: slice) -> float:
        """Return J of some components."""
        return float(np.mean(np.linalg.slogdet(self.covariance[:, own, own])[1] + self.squares(own)))

    def cost(self, part: slice) -> float:
        """Return J, horizontal or vertical."""
        firsts = range(0, self.error.shape[1], 3)
        return sum(self.score(slice(first + part.start, first + part.stop)) for first in firsts)


def compared(
    stretch: Stretch,
    settings: FilterSettings,
    known: Reference,
    lengths: Sequence[float] = CLAIMED_LENGTHS,
) -> tuple[Compared, ...]:
    """Return what a filter errs and predicts with fixes, and after some times without, s; nothing where it is lost."""
    (whole,) = navigate((stretch,), settings, NO_WINDOWS)
    groups = [rows for _, rows in blocks(whole, settled(stretch, whole))]
    expect_settled(bool(groups), "what would be written", [float(np.ptp(whole.t))])
    found = [_compared(0.0, whole, np.concatenate(groups), known, [len(rows) for rows in groups])]
    for length in lengths:
        windows = np.array(outage_windows((stretch,), length)).reshape(-1, 2)
        (run,) = navigate((stretch,), settings, windows)
        inside = (run.t[:, None] > windows[:, 0]) & (run.t[:, None] <= windows[:, 1])
        ends = np.array([np.flatnonzero(one)[-1] for one in inside.T if one.any()], dtype=int)
        found.append(_compared(length, run, ends, known, [1] * len(ends)))
    return tuple(one for one in found if len(one.error)) if len(found[0].error) else ()


def _compared(
    seconds: float, run: Solution, rows: NDArray[np.intp], known: Reference, lengths: Sequence[int]
) -> Compared:
    size = 3 if seconds else 6
    llh, vel_n, _ = reference_at(known, run.t[rows])
    error = np.hstack([ned_between(llh, run.state.llh[rows]), vel_n - run.state.vel_n[rows]])[:, :size]
    there = np.isfinite(error).all(axis=1)
    group = np.repeat(np.arange(len(lengths)), lengths)[there]
    kept = rows[there]
    return Compared(
        seconds,
        error[there],
        stated(known, run.t[kept])[:, :size],
        run.covariance[kept][:, :size, :size],
        tuple(np.bincount(group, minlength=len(lengths)).tolist()),
    )


@dataclass(frozen=True)
class Chosen:
    """What a filter gets instead of the states that it lacks.

    Attributes
    ----------
    added : tuple of 2 floats
        Sds added to those of the fixes, horizontal and vertical, m (root of the sum of squares).
    white, bias, scale : float
        Factors on white noise, on what drives the biases, and on the sds of scale factors at the start, all axes.
    """

    added: tuple[float, float] = (0.0, 0.0)
    white: float = 1.0
    bias: float = 1.0
    scale: float = 1.0

    @property
    def factors(self) -> FloatArray:
        """All factors, shape (3,)."""
        return np.array([self.white, self.bias, self.scale])

    def of(self, stretch: Stretch, settings: FilterSettings) -> tuple[Stretch, FilterSettings]:
        """Return a stretch and a filter with it."""
        model, at = settings.model, settings.model.layout
        drive, first = model.driving_density.copy(), settings.initial_sd.copy()
        for sensor in ("gyro", "accel"):
            for block in (f"{sensor}_bias", f"{sensor}_markov"):
                if block in at:
                    drive[at[block]] *= self.bias
            if f"{sensor}_scale" in at:
                first[at[f"{sensor}_scale"]] *= self.scale
        model = replace(
            model,
            gyro_density=self.white * model.gyro_density,
            accel_density=self.white * model.accel_density,
            driving_density=drive,
        )
        return _wider(stretch, self.added), replace(settings, model=model, initial_sd=first)


def chosen(stretch: Stretch, settings: FilterSettings, known: Reference) -> Chosen:
    """Return the settings of the best expected log score: sds by the position, then noise by steps, then sds again.

    Parameters
    ----------
    stretch : Stretch
        The drive as the filter takes it.
    settings : FilterSettings
        The filter.
    known : Reference
        What is known of the truth, with its sds.
    """
    typical = np.median(stretch.fixes.sd[:, :3], axis=0)
    usual = float(np.sqrt(np.mean(typical[:2] ** 2))), float(typical[2])

    def costs(one: Chosen) -> FloatArray:
        found = compared(*one.of(stretch, settings), known, SCORED[1:])
        if not found:
            return np.full(len(PARTS), np.inf)
        spread = float(np.sum(np.log(one.factors) ** 2)) / math.log(NOISE_SPREAD) ** 2
        penalty = spread / len(PARTS) / len(found[0].lengths)
        parts = [sum(each.cost(part) for each in found) + penalty for part in PARTS]
        return np.asarray(np.nan_to_num(np.array(parts), nan=np.inf))

    def position(one: Chosen) -> FloatArray:
        found = compared(*one.of(stretch, settings), known, ())
        scores = [found[0].score(part) if found else np.inf for part in PARTS]
        return np.asarray(np.nan_to_num(np.array(scores), nan=np.inf))

    def with_sds(one: Chosen) -> Chosen:
        tried = [(factor * usual[0], factor * usual[1]) for factor in TRIED_SDS]
        best = np.argmin([position(replace(one, added=added)) for added in tried], axis=0)
        return replace(one, added=(tried[best[0]][0], tried[best[1]][1]))

    best = with_sds(Chosen())
    least = float(costs(best).sum())
    for step, name in product(NOISE_STEPS, ("bias", "white", "scale")):
        for factor in (step, 1.0 / step):
            before = least
            while (
                cost := float(costs(moved := replace(best, **{name: factor * getattr(best, name)})).sum())
            ) < least:
                best, least = moved, cost
            if least < before:
                break
    return best if (best.factors == 1.0).all() else with_sds(best)


def consistency(found: Sequence[Compared], refused: float = 0.0) -> Consistency:
    """Return the scores of what a filter errs by what it predicts; `refused` is the share of the fixes left out."""
    aided, *outages = found
    parts = {name: slice(3 * i, 3 * i + 3) for i, name in enumerate(("position", "velocity"))}
    ends = np.cumsum(aided.lengths)[:-1]
    return Consistency(
        None,
        tuple(score(name, np.split(aided.squares(own), ends), 3) for name, own in parts.items()),
        (),
        None,
        tuple(
            outage_score(one.seconds, list(one.spread[:, None]), list(one.covariance[:, None]))
            for one in outages
        ),
        {name: RmsError.of(aided.error[:, own], ERROR_UNITS[name]) for name, own in parts.items()},
        refused,
        refused > DIVERGED_REFUSED_SHARE,
    )


def _words(one: Compared) -> str:
    """Return the rms error of the position, and that ÷ predicted."""
    ratio = math.sqrt(float(np.mean(one.squares(slice(0, 3)))) / 3.0)
    when = f"after {one.seconds:g} s without" if one.seconds else "with fixes"
    return f"{when} {digits(one.rms)} m, {ratio:.2f} × predicted"


def fixes_alone(stretch: Stretch, known: Reference) -> float:
    """Return the rms error of the fixes themselves, as `Compared.rms`, after the filter has settled, m."""
    fixes = stretch.fixes
    rows = fixes.t >= stretch.settled
    t = fixes.t[rows]
    apart = ned_between(reference_at(known, t)[0], fixes.llh[rows])
    return float(np.sqrt(np.nanmean(np.sum(apart**2 + stated(known, t)[:, :3], axis=1))))


def as_read(path: Path) -> tuple[Stretch, FilterSettings]:
    """Return the stretch and the filter of a YAML as KF-GINS uses them."""
    drive = read_drive(path)
    settings, _ = drive_filter(drive, replace(kf_gins_settings.load(path), gnss=EVERY_FIX))
    return prepare(drive, settings)[0][0], settings


def _wider(stretch: Stretch, added: tuple[float, float]) -> Stretch:
    """Return a stretch with a variance added to those of its fixes, given as sds horizontal and vertical, m."""
    sd = stretch.fixes.sd.copy()
    sd[:, :3] = np.hypot(sd[:, :3], [added[0], *added])
    return replace(stretch, fixes=replace(stretch.fixes, sd=sd))


def _with_chosen(files: DriveFiles, best: Chosen) -> DriveFiles:
    """Return files with what was chosen for a filter that lacks states."""
    fixes, notes = files.fixes.copy(), []
    fixes[:, 4:] = np.hypot(fixes[:, 4:], [best.added[0], *best.added])
    if any(best.added):
        horizontal, vertical = (digits(one, 2) for one in best.added)
        notes.append(
            "sds of the fixes: the receiver's own and, for errors that last, of which KF-GINS has no states, "
            f"{horizontal} m horizontal and {vertical} m vertical (root of the sum of squares)"
        )
    tree = {**files.tree, "imunoise": dict(files.tree["imunoise"])}
    changed = (
        (tree["imunoise"], ("arw", "vrw"), best.white),
        (tree["imunoise"], ("gbstd", "abstd"), best.bias),
        (tree, ("initsgstd", "initsastd"), best.scale),
    )
    for own, names, factor in changed:
        if factor != 1.0:
            for name in names:
                values = [rounded(factor * one) for one in own[name].value.value]
                own[name] = Noted(Inline(values), own[name].note)
            notes.append(
                f"{' and '.join(names)} are {digits(factor, 2)} × those of the configuration, as this drive shows"
            )
    return replace(files, fixes=fixes, tree=tree, notes=(*files.notes, *notes))


def _without(files: DriveFiles, refused: FloatArray) -> DriveFiles:
    """Return files without the fixes of some times since their start: KF-GINS has no gate."""
    since = files.fixes[:, 0] - files.imu[0, 0]
    lost = (np.abs(since[:, None] - refused) < SAME_TIME).any(axis=1)
    if not lost.any():
        return files
    note = f"{lost.sum()} of {len(since)} fixes, which our filter refuses, are left out: KF-GINS has no gate"
    return replace(files, fixes=files.fixes[~lost], notes=(*files.notes, note))
