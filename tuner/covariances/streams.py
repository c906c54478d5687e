"""Errors of the streams of a recording: the white part, and the part that lasts.

Each stream is compared with the motion that the inertial unit and the fixes give (`tuner.diagnosis.drive`): white
errors of a reading beside a Gauss–Markov error of some sd and time constant, by likelihood, the noise of the unit and
of the other streams being fitted with them. Fixes and velocities of the receiver come first, each with what the other
showed as states of the filter; wheels then replace the velocities of the receiver, in axes of the vehicle. The bias of
the unit is what its filter estimates: for a filter without such states it is an error that lasts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.error_state import corrected
from models.probability import normal_reach
from tuner.diagnosis.drive.cause_test import not_significant
from tuner.diagnosis.drive.causes.base import NoiseCause
from tuner.diagnosis.drive.causes.correlated_gnss import TIME_PRIOR_SD, CorrelatedGnss, fit_correlated
from tuner.diagnosis.drive.causes.correlated_velocity import CorrelatedVelocity, exchanged
from tuner.diagnosis.drive.causes.reported_sd import MIN_CLASS_FIXES
from tuner.diagnosis.drive.hypothesis import FilterRun, Hypothesis, in_sensor_axes, run_filter
from tuner.diagnosis.drive.hypothesis_tests import noise_hypothesis_of
from tuner.diagnosis.drive.linear_model.noise_fit import NoiseFit, maximize_likelihood
from tuner.diagnosis.drive.linear_model.noise_parameters import (
    MARKOV_AXES,
    MARKOV_TIME,
    ROW_GROUPS,
    noise_parameters,
    present,
)
from tuner.diagnosis.drive.linear_model.noise_prior import static_prior
from tuner.linear_run.likelihood import NoiseHypothesis, as_configured, evaluate
from tuner.linear_run.linearized_run import NOISE_GROUPS
from tuner.navigation.settings import total_bias
from tuner.types import LEVEL, Coefficient, FilterConfig
from tuner.types.records import BodyVelocity, DataError, Drive

INSTALLATION = ("time_offset", "lever_arm")
"""Constants that are free beside the errors of the receiver: they are no noise."""
PARTS = {"horizontal": 0, "vertical": 2}
"""Components whose errors have one size, and the first row of each."""
USUAL_WHEELS = 0.1
"""Sd of wheels that state none, m/s, from which a fit begins."""
NOT_SEEN = "indistinguishable from none in this recording"
"""Why there is only a limit."""
TRIED_RATIOS = np.geomspace(0.03, 30.0, 17)
"""Lasting sds that are compared, in scatters from one reading to the next: from none that shows to any that stands."""
TRIED_TIMES = 7
"""Correlation times that are compared, from two intervals to half of the recording."""
LEAST_WHITE = 0.01
"""Least white part of that scatter: filters divide by it."""
SEEN_NATS = 1.92
"""Nats by which a lasting error is likelier than none where it is stated: half of the 95 % quantile of χ²₁."""
OF_WHEELS = {"horizontal": "forward", "vertical": "sideways"}
"""What stands in those rows of wheels: where their vehicle goes, and where it does not."""
ACROSS = "across"
"""Sideways, where wheels state a vertical velocity as well: of that, which does not come out of turns, it is the sd."""


@dataclass(frozen=True)
class StreamErrors:
    """Errors of some components of a stream, sds of a reading.

    Attributes
    ----------
    stream, part : str
        ``fixes``, ``receiver velocities``, ``wheels``, ``gyro``, ``accel``; which components, empty for all.
    declared : float or None
        Median of the sds that the stream states; None where it states none.
    white, lasting : Coefficient
        The part that is new in each reading; the stationary sd of the part that is not.
    time : Coefficient or None
        Correlation time of that, s; None where nothing tells one.
    size : Coefficient
        Sd of the whole error.
    interval : float
        Usual time between readings, s.
    """

    stream: str
    part: str
    declared: float | None
    white: Coefficient
    lasting: Coefficient
    time: Coefficient | None
    size: Coefficient
    interval: float


def stream_errors(
    drive: Drive, config: FilterConfig, recorded: Drive
) -> tuple[tuple[StreamErrors, ...], FilterRun]:
    """Return the errors of every stream of a recording, and the filter run with what was found as states.

    Parameters
    ----------
    drive : Drive
        As examined, with its wheels.
    config : FilterConfig
        Noise of the unit and of the receiver to begin with.
    recorded : Drive
        As recorded: what its streams declare.

    Raises
    ------
    DataError
        Where the recording cannot be aligned.
    """
    sensor, prior = in_sensor_axes(drive), static_prior(config.channels)
    run = run_filter(sensor, Hypothesis.first(sensor, config, config.compensation))
    if (count := int(run.linearized.counted[:, 0].sum())) < MIN_CLASS_FIXES:
        raise DataError(
            f"{drive.source or drive.name}: expected {MIN_CLASS_FIXES} fixes or more after the filter has settled, "
            f"found {count}: drive on for some minutes, with turns and changes of speed"
        )

    def fitted(one: FilterRun, turned: bool = False) -> NoiseFit:
        noise = noise_hypothesis_of(one, INSTALLATION)
        return _fitted(exchanged(noise) if turned else noise, prior)

    fixes, found, before = fitted(run), list[StreamErrors](), run
    run = _after(sensor, run, CorrelatedGnss, fixes)
    if run.linearized.counted[:, 3].sum() >= MIN_CLASS_FIXES:
        velocities = fitted(run, turned=True)
        run = _after(sensor, run, CorrelatedVelocity, velocities)
        first = replace(run.hypothesis, config=replace(run.hypothesis.config, gnss=config.gnss))
        fixes = fitted(before := run_filter(sensor, first))
        run = _after(sensor, before, CorrelatedGnss, fixes)
        found += _parts("receiver velocities", velocities, recorded.gnss.velocity_sd, drive.gnss.t)
    found = [*_parts("fixes", fixes, recorded.gnss.position_sd, drive.gnss.t), *found]
    if drive.wheels is not None:
        turned = exchanged(_with_wheels(run, drive, drive.wheels))
        if turned.counted[:, 0].sum() >= MIN_CLASS_FIXES:
            parts = _parts("wheels", _fitted(turned, prior), drive.wheels.sd, drive.wheels.t)
            level = np.ptp(drive.wheels.v[:, 2]) > 0.0
            found += [replace(one, part=ACROSS) if level and one.part != "forward" else one for one in parts]
    return (*found, *_of_unit(drive, before, fixes, run)), run


def _fitted(noise: NoiseHypothesis, prior: Mapping[str, float]) -> NoiseFit:
    """Fit white and lasting errors of the first rows of a fix beside all other noise."""
    first = fit_correlated(noise)
    others = present(first.noise, (*ROW_GROUPS, *NOISE_GROUPS))
    names = (*first.parameters.names, *(one for one in others if one not in first.parameters.names))
    start = replace(first.noise, linearized=noise.linearized, columns=noise.columns)
    return maximize_likelihood(start, noise_parameters(names), prior_sd={MARKOV_TIME: TIME_PRIOR_SD, **prior})


def _parts(stream: str, fit: NoiseFit, declared: FloatArray, t: FloatArray) -> list[StreamErrors]:
    """Return the errors of the horizontal and vertical components that a fit was made to."""
    unit, out, best = "m" if stream == "fixes" else "m/s", list[StreamErrors](), dict[float, float]()
    start = fit.start
    interval = float(np.median(np.diff(t)))
    for part, row in PARTS.items():
        if f"markov_{part}" not in fit.parameters.names or start.counted[:, row].sum() < MIN_CLASS_FIXES:
            continue
        column = {"sideways": 1}.get(OF_WHEELS[part], row) if stream == "wheels" else row
        stated = declared[np.isfinite(declared[:, column]), column]
        white, lasting, time, size = _posterior(fit, part, unit, best)
        name, usual = OF_WHEELS[part] if stream == "wheels" else part, None
        if len(stated):
            usual = float(np.median(stated))
        out.append(StreamErrors(stream, name, usual, white, lasting, time, size, interval))
    return out


def _posterior(
    fit: NoiseFit, part: str, unit: str, best: dict[float, float]
) -> tuple[Coefficient, Coefficient, Coefficient | None, Coefficient]:
    """Return white and lasting error, its time and the whole error of some components, medians of their posterior.

    The scatter from one reading to the next, w² + l² (1 − e^(−dt/T)), is what a recording knows best: it is kept, with
    the sd of its logarithm, while l and T go over a grid of even prior in their logarithms; other noise stays as
    fitted. `best` are the likeliest l of the horizontal components by T, filled there and used for vertical ones.
    """
    noise, names = fit.noise, list(fit.parameters.names)
    own, row = MARKOV_AXES[f"markov_{part}"], PARTS[part]
    t = noise.linearized.t[noise.counted[:, row]]
    step = float(np.median(np.diff(t)))

    def scatter(at: int) -> float:
        kept = noise.markov_sd[at] ** 2 * (1.0 - math.exp(-step / noise.markov_time))
        return float(np.median(noise.sd[noise.counted[:, at], at]) ** 2 + kept)

    def white_of(total: float, sd: float, time: float) -> float:
        return math.sqrt(max(total - sd**2 * (1.0 - math.exp(-step / time)), LEAST_WHITE**2 * total))

    total, first = scatter(row), not best
    both = [(one, at) for one, at in PARTS.items() if f"markov_{one}" in names]
    found = []
    for time in np.geomspace(2.0 * step, 0.5 * float(np.ptp(t)), TRIED_TIMES):
        for sd in math.sqrt(total) * TRIED_RATIOS:
            if sd**2 * (1.0 - math.exp(-step / time)) > total:
                continue
            sds, markov = noise.sd.copy(), noise.markov_sd.copy()
            markov[own] = sd
            for one, at in both:
                if one != part:
                    share = float(np.clip(noise.markov_sd[at] / max(noise.markov_sd[row], 1e-9), 1e-3, 5.0))
                    markov[MARKOV_AXES[f"markov_{one}"]] = share * sd if first else best[time]
                typical = float(np.median(noise.sd[noise.counted[:, at], at]))
                rows = ROW_GROUPS[f"position_{one}"]
                sds[:, rows] *= white_of(scatter(at), markov[at], time) / typical
            value = evaluate(replace(noise, sd=sds, markov_sd=markov, markov_time=float(time))).value
            found.append((value, sd, time, white_of(total, sd, time)))
    value, sd, time, white = np.array(found).T
    if first:
        for one in np.unique(time):
            there = time == one
            best[float(one)] = float(sd[there][np.argmax(value[there])])
    weight = np.exp(value - value.max())
    at = names.index(f"position_{part}")
    spread = min(float(np.sqrt(fit.covariance[at, at])), 1.0 / math.sqrt(2.0 * noise.counted[:, own].sum()))

    def quantiles(x: FloatArray, unit: str) -> Coefficient:
        order = np.argsort(x)
        share = (np.cumsum(weight[order]) - 0.5 * weight[order]) / weight.sum()
        low, middle, high = np.exp(np.interp([0.025, 0.5, 0.975], share, np.log(x[order])))
        more = np.hypot(np.log([middle / low, high / middle]), normal_reach(LEVEL) * spread)
        return Coefficient.known(middle, middle * math.exp(-more[0]), middle * math.exp(more[1]), unit)

    lasting = quantiles(sd, unit)
    seen = value.max() - value[sd <= TRIED_RATIOS[0] * math.sqrt(total) * 1.01].max() > SEEN_NATS
    if not seen:
        lasting = Coefficient.bounded(lasting.interval[1] if lasting.interval else math.inf, unit, NOT_SEEN)
    return (
        quantiles(white, unit),
        lasting,
        quantiles(time, "s") if seen else None,
        quantiles(np.hypot(white, sd), unit),
    )


def _after(drive: Drive, run: FilterRun, cause: type[NoiseCause], fit: NoiseFit) -> FilterRun:
    """Return the run with what was fitted: lasting errors as states of the filter, white ones as its sds."""
    test = not_significant(cause.cause, fit.noise, 1.0, 0.0, "")
    return run_filter(drive, cause.accepted(run, test))


def _with_wheels(run: FilterRun, drive: Drive, wheels: BodyVelocity) -> NoiseHypothesis:
    """Return the noise of a run with wheels in place of the velocities of its fixes, forward and sideways.

    A reading at a fix is interpolated between two; the columns of constants are the place of the wheels.
    """
    own = run.linearized
    mounting = drive.sensor_from_vehicle
    before = [
        corrected(one.state, -part[:, :9])
        for one, part in zip(
            run.solutions, np.split(own.correction, np.flatnonzero(own.starts)[1:]), strict=True
        )
    ]
    vel = np.concatenate([one.vel_n for one in before])
    mat = rotation.mat_from_quat(np.concatenate([one.quat_nb for one in before])) @ mounting
    to_body = np.swapaxes(mat, -1, -2)
    after = np.clip(np.searchsorted(wheels.t, own.t), 1, len(wheels.t) - 1)
    step = wheels.t[after] - wheels.t[after - 1]
    share = ((own.t - wheels.t[after - 1]) / step)[:, None]
    read = share * wheels.v[after] + (1.0 - share) * wheels.v[after - 1]
    usual = float(np.median(np.diff(wheels.t)))
    there = (share >= 0.0) & (share <= 1.0) & (step[:, None] < 2.0 * usual) & np.isfinite(read)
    there &= np.ptp(wheels.v, axis=0) > 0.0
    rates = np.column_stack([np.interp(own.t, drive.imu_t, one) for one in drive.rates[:, :3].T]) @ mounting
    seen = np.zeros_like(own.H[:, 3:])
    seen[:, :, 3:6], seen[:, :, 6:9] = to_body, to_body @ rotation.skew(vel)
    arms, order = np.zeros_like(own.D), [0, 2, 1]
    arms[:, 3:, :3] = rotation.skew(rates)[:, order]
    innovation, h, sd = own.innovation.copy(), own.H.copy(), own.sd.copy()
    innovation[:, 3:] = np.nan_to_num(read - (to_body @ vel[:, :, None])[:, :, 0])[:, order]
    h[:, 3:] = seen[:, order]
    stated = [one[one > 0.0] for one in np.nan_to_num(wheels.sd).T]
    usual_sd = np.array([np.median(one) if len(one) else USUAL_WHEELS for one in stated])
    sd[:, 3:] = (usual_sd * np.sqrt(share**2 + (1.0 - share) ** 2))[:, order]
    available = own.available.copy()
    available[:, 3:] = there[:, order] & [True, False, True]
    used = own.used.copy()
    used[:, 3:] = available[:, 3:]
    changed = replace(
        own, innovation=innovation, H=h, sd=sd, available=available, used=used, D=arms, B=np.zeros_like(own.B)
    )
    return replace(as_configured(changed), columns=(0, 1, 2))


def _of_unit(drive: Drive, before: FilterRun, fit: NoiseFit, run: FilterRun) -> list[StreamErrors]:
    """Return the errors of the unit: white noise as a fit to a run has it, and the bias that the last run estimates."""
    interval, config, last = (
        float(np.median(np.diff(drive.imu_t))),
        before.hypothesis.config,
        run.solutions[-1],
    )
    bias = (total_bias(run.settings.model) @ last.final_parameters)[9:]
    spread, out = last.covariance[-1, 9:, 9:], []
    for i, (sensor, unit) in enumerate((("gyro", "rad/s"), ("accel", "m/s^2"))):
        densities = [one.white_density for axis, one in config.channels.items() if axis.startswith(sensor)]
        sample = float(np.sqrt(np.mean(np.square(densities)) / interval))
        own = slice(3 * i, 3 * i + 3)
        size = float(np.sqrt(np.mean(bias[own] ** 2)))
        sd = float(np.sqrt(bias[own] @ spread[own, own] @ bias[own])) / (3.0 * size)
        reach = normal_reach(LEVEL) * sd
        lasting = (
            Coefficient.known(size, size - reach, size + reach, unit)
            if reach < size
            else Coefficient.bounded(size + reach, unit, NOT_SEEN)
        )
        white = fit.coefficient(f"{sensor}_white", unit=unit, scale=sample)
        whole = float(np.hypot(white.value or 0.0, size))
        low, high = white.interval or (0.0, white.upper or 0.0)
        ends = float(np.hypot(low, max(0.0, size - reach))), float(np.hypot(high, size + reach))
        total = Coefficient.known(whole, ends[0], ends[1], unit)
        out.append(StreamErrors(sensor, "", None, white, lasting, None, total, interval))
    return out
