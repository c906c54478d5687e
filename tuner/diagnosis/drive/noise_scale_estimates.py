"""Noise-scale estimates of a drive: the factor on each noise setting that the innovations need, and its cause.

All factors on Q and R, true ÷ stated, are fitted together: to the run of the filter as configured, to the run with all
findings, and to runs in which one finding is left out::

    plain    the factor with no cause named
    named    the factor that remains with all findings in the filter
    causes   of all findings, those without which most of the factor returns

A factor on white noise that remains is ascribed to vibration where the unit is that much noisier in motion
than at rest, one on the receiver to its reported sds where those were found wrong; else its cause is unknown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tuner.diagnosis.drive.causes.base import DRIVE_CAUSES, is_noise_scale
from tuner.diagnosis.drive.diagnose import ExaminedDrive
from tuner.diagnosis.drive.hypothesis import FilterRun, run_filter
from tuner.diagnosis.drive.hypothesis_tests import noise_hypothesis_of
from tuner.diagnosis.drive.linear_model.noise_fit import NoiseFit, maximize_likelihood
from tuner.diagnosis.drive.linear_model.noise_parameters import BLOCKS, noise_parameters, present
from tuner.types import ChannelNoise, Coefficient, FilterConfig, NoiseScaleEstimate
from tuner.types.records import DataError, Drive

SETTINGS: Mapping[str, tuple[str, str]] = {
    "gyro_white": ("white noise of the gyros", "rad/s/√Hz"),
    "accel_white": ("white noise of the accelerometers", "m/s^2/√Hz"),
    "gyro_bias": ("random walk of the gyro biases", "rad/s/√s"),
    "accel_bias": ("random walk of the accelerometer biases", "m/s^2/√s"),
    "position": ("error of the positions", "m"),
    "velocity": ("error of the velocities", "m/s"),
}
"""Noise settings of a filter: in words, and their SI unit."""
MIN_VIBRATION_RATIO = 1.5
"""Vibration, moving ÷ at rest, from which it can explain a factor on white noise; chosen as clearly above 1."""
MIN_RETURNED_SHARE = 0.25
"""Part of what a factor lost that must return when a cause is left out for it to be named.

A quarter, as up to `MAX_CAUSES_LEFT_OUT` = 4 causes may share it.
"""
MAX_CAUSES_LEFT_OUT = 4
"""Findings that are left out in turn, the first accepted: each costs a run and a fit."""
NOTHING_NAMED = "with no cause named"
"""End of the words on a factor of the drive as it stands."""
UNKNOWN_CAUSE = "unknown"
"""Stands for the cause of a factor that no finding explains."""


@dataclass(frozen=True)
class _Factors:
    """Factors on the stated settings fitted to a run, with intervals."""

    fit: NoiseFit
    scale: Mapping[str, float]

    def log(self, name: str) -> float:
        """Return the size of a factor: how far its log is from 0."""
        return abs(float(np.log(self.fit.factor(name) * self.scale[name])))

    def coefficient(self, name: str) -> Coefficient:
        """Return a factor with its interval."""
        return self.fit.coefficient(name, scale=self.scale[name])


def estimate_noise_scales(
    examined: ExaminedDrive, vibration: Mapping[str, float] | None = None
) -> tuple[NoiseScaleEstimate, ...]:
    """Estimate the factor that a drive gives on each noise setting, before and after its causes are named.

    No prior enters: the drive alone determines the factors. Empty where the likelihood has no maximum that could be
    found.

    Parameters
    ----------
    examined : ExaminedDrive
        The drive, its runs and findings.
    vibration : mapping of str to float
        Scatter of samples, moving ÷ at rest, of ``gyro`` and ``accel``.
    """
    base, final = examined.search.base, examined.search.final
    config = base.hypothesis.config
    fitted = tuple(a.cause for a in examined.search.accepted)
    if not all(present(noise_hypothesis_of(one, ()), tuple(SETTINGS)) for one in (base, final)):
        return ()
    try:
        unexplained = _fit_factors(base, base, ())
        explained = _fit_factors(base, final, fitted)
    except np.linalg.LinAlgError:
        return ()
    names = [
        name
        for name in SETTINGS
        if name in unexplained.fit.parameters.names and name in explained.fit.parameters.names
    ]
    factor = {name: (unexplained.coefficient(name), explained.coefficient(name)) for name in names}
    fallen = [
        name
        for name in names
        if not may_be_one(factor[name][0])
        and unexplained.log(name) - explained.log(name) > MIN_RETURNED_SHARE * unexplained.log(name)
    ]
    accounted = _responsible_causes(examined.drive, base, final, fitted, fallen, unexplained, explained)
    answer = []
    for name in SETTINGS:
        stated = stated_value(config, base, name)
        if name not in names:
            continue
        identifiable = unexplained.fit.identifiable(name) or explained.fit.identifiable(name)
        causes = accounted.get(name, ())
        if identifiable and not may_be_one(factor[name][1]):
            causes = (*causes, _remaining_cause(name, factor[name][1], fitted, vibration or {}))
        answer.append(
            NoiseScaleEstimate(
                name,
                stated,
                SETTINGS[name][1],
                *factor[name],
                causes if identifiable else (),
                identifiable,
                "",
            )
        )
    return tuple(replace(one, text=words(one, (vibration or {}).get(one.setting[:-6]))) for one in answer)


def may_be_one(factor: Coefficient) -> bool:
    """Whether a factor may be 1."""
    if factor.interval is not None:
        return factor.interval[0] <= 1.0 <= factor.interval[1]
    return factor.upper is None or factor.upper >= 1.0


def stated_value(config: FilterConfig, base: FilterRun, name: str) -> float | None:
    """Return the stated value of a setting, root mean square over axes (and fixes), SI."""
    if name in BLOCKS:
        rows = base.linearized.counted[:, BLOCKS[name]]
        return float(np.sqrt(np.mean(base.linearized.sd[:, BLOCKS[name]][rows] ** 2))) if rows.any() else None
    sensor, _, kind = name.partition("_")
    channels = [c for axis, c in config.channels.items() if axis.startswith(sensor)]
    density = [c.white_density if kind == "white" else bias_driving_density(c) for c in channels]
    return float(np.sqrt(np.mean(np.square(density))))


def bias_driving_density(channel: ChannelNoise) -> float:
    """Return the density that drives all bias states of an axis together, unit/√s."""
    return float(np.sqrt(channel.random_walk_density**2 + sum(s.driving_density**2 for s in channel.markov)))


def _fit_factors(
    base: FilterRun,
    run: FilterRun,
    fitted: Sequence[str],
    free: Sequence[str] = tuple(SETTINGS),
    others: NoiseFit | None = None,
) -> _Factors:
    """Fit the free settings of a run, the others as in another fit."""
    noise = noise_hypothesis_of(run, tuple(fitted))
    names = present(noise, tuple(free))
    if others is not None:
        fixed = tuple(name for name in others.parameters.names if name not in names)
        logs = np.array([others.estimate[others.number(name)] for name in fixed])
        noise = noise_parameters(fixed).change(noise, logs)
    # Far from the truth variances may come out negative: the search turns back from there.
    with np.errstate(invalid="ignore"):
        fit = maximize_likelihood(noise, noise_parameters(names))
    return _Factors(
        fit, {name: assumed_over_stated(run, name) / assumed_over_stated(base, name) for name in names}
    )


def assumed_over_stated(run: FilterRun, name: str) -> float:
    """Return the value of a setting in the filter of a run ÷ the stated one."""
    if name in BLOCKS:
        linearized, rows = run.linearized, run.linearized.counted[:, BLOCKS[name]]
        now, factor_text = (sd[:, BLOCKS[name]][rows] for sd in (linearized.sd, linearized.reported_sd))
        fitted = np.isfinite(factor_text)
        return (
            float(np.sqrt(np.sum(now[fitted] ** 2) / np.sum(factor_text[fitted] ** 2)))
            if fitted.any()
            else 1.0
        )
    value = stated_value(run.hypothesis.config, run, name)
    return value or 1.0


def _responsible_causes(
    drive: Drive,
    base: FilterRun,
    final: FilterRun,
    fitted: tuple[str, ...],
    fallen: Sequence[str],
    unexplained: _Factors,
    explained: _Factors,
) -> dict[str, tuple[str, ...]]:
    """Return the findings without which factors return, the most important first."""
    causes = tuple(dict.fromkeys(c for c in fitted if not is_noise_scale(c)))[:MAX_CAUSES_LEFT_OUT]
    if not fallen or not causes:
        return {}
    if len(causes) == 1:
        return dict.fromkeys(fallen, causes)
    returned: dict[str, dict[str, float]] = {name: {} for name in fallen}
    for cause in causes:
        others = tuple(c for c in fitted if c != cause)
        try:
            without = run_filter(drive, DRIVE_CAUSES[cause].without(final.hypothesis, base.hypothesis))
            refit = _fit_factors(base, without, others, fallen, explained.fit)
        except (DataError, np.linalg.LinAlgError):
            # A filter that cannot do without the cause: all of the factor is back.
            returned = {name: {**shares, cause: 1.0} for name, shares in returned.items()}
            continue
        for name in fallen:
            lost = unexplained.log(name) - explained.log(name)
            returned[name][cause] = (refit.log(name) - explained.log(name)) / lost
    answer = {}
    for name, shares in returned.items():
        order = sorted(shares, key=lambda cause: -shares[cause])
        answer[name] = tuple(c for c in order if shares[c] > MIN_RETURNED_SHARE) or (order[0],)
    return answer


def _remaining_cause(
    name: str, left: Coefficient, fitted: Sequence[str], vibration: Mapping[str, float]
) -> str:
    """Return what accounts for a factor that remains."""
    if name in BLOCKS:
        return "gnss_noise_scale" if "gnss_noise_scale" in fitted else UNKNOWN_CAUSE
    sensor, _, kind = name.partition("_")
    ratio = vibration.get(sensor, 1.0)
    low = left.interval[0] if left.interval else 0.0
    return (
        "vibration"
        if kind == "white" and ratio > MIN_VIBRATION_RATIO and 1.0 < low < ratio
        else UNKNOWN_CAUSE
    )


def words(one: NoiseScaleEstimate, vibration: float | None = None) -> str:
    """Return an estimate in words."""
    title = SETTINGS[one.setting][0]
    if not one.identifiable:
        return f"{title}: not identifiable on this drive; the stated value stays"
    if may_be_one(one.plain) and may_be_one(one.named):
        return f"{title}: as stated; the drive allows {_times(one.plain)}"
    explained = [
        cause.replace("_", " ")
        for cause in one.causes
        if cause not in (UNKNOWN_CAUSE, "vibration") and not is_noise_scale(cause)
    ]
    parts = [f"{title}: the drive gives {_times(one.plain)} {NOTHING_NAMED}"]
    if explained:
        parts.append(
            f"{_times(one.named)} once {listed(explained)} {'is' if len(explained) == 1 else 'are'} named"
        )
    else:
        parts.append(f"{_times(one.named)} with all findings in the filter")
    if "vibration" in one.causes and vibration is not None:
        parts.append(f"its samples scatter {vibration:.1f} times as much in motion as at rest")
    if "gnss_noise_scale" in one.causes:
        parts.append("the receiver's own standard deviations are off by that much")
    if UNKNOWN_CAUSE in one.causes:
        parts.append("what is left has no known cause")
    return "; ".join(parts)


def listed(names: Sequence[str]) -> str:
    """Return names joined by commas and *and*."""
    return " and ".join([*filter(None, [", ".join(names[:-1])]), names[-1]])


def _times(factor: Coefficient) -> str:
    return f"less than × {factor.upper:.3g}" if factor.value is None else f"× {factor_text(factor)}"


def factor_text(factor: Coefficient) -> str:
    """Return a factor as text: ``1.8 (1.5 … 2.2)``, ``below 0.9``."""
    if factor.value is None:
        return f"below {factor.upper:.3g}" if factor.upper is not None else "–"
    if factor.interval is None:
        return f"{factor.value:.3g}"
    return f"{factor.value:.3g} ({factor.interval[0]:.3g} … {factor.interval[1]:.3g})"
