"""Explained inflation: by how much a drive wants each noise setting enlarged, and what it really asks for.

All factors on Q and R are fitted together, true ÷ stated: to the pass of the filter as it was configured, to the pass
with all findings, and to passes in which one finding is forgotten::

    plain    what one would inflate by without naming anything
    named    what is left once the causes are in the filter
    cause    of all findings, the one whose forgetting brings most of the factor back

What is left of white noise is put down to vibration where the unit is that much noisier above 5 Hz while it moves than
while it stands, what is left of the receiver to its stated sds where those were found wrong; else it is unknown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tuner.diagnosis.drive.causes.base import DRIVE_CAUSES, is_noise_scale
from tuner.diagnosis.drive.diagnose import ExaminedDrive
from tuner.diagnosis.drive.hypothesis import FilterRun, run_filter
from tuner.diagnosis.drive.hypothesis_tests import noise_hypothesis_of
from tuner.diagnosis.drive.linear_model.noise_fit import NO_PRIOR, NoiseFit, maximize_likelihood
from tuner.diagnosis.drive.linear_model.noise_parameters import BLOCKS, noise_parameters, present
from tuner.types import ChannelNoise, Coefficient, FilterConfig, NoiseScaleEstimate
from tuner.types.records import DataError, Drive

FloatArray = NDArray[np.float64]

SETTINGS: Mapping[str, tuple[str, str]] = {
    "gyro_white": ("white noise of the gyros", "rad/s/√Hz"),
    "accel_white": ("white noise of the accelerometers", "m/s^2/√Hz"),
    "gyro_bias": ("wander of the gyro biases", "rad/s/√s"),
    "accel_bias": ("wander of the accelerometer biases", "m/s^2/√s"),
    "position": ("error of the positions", "m"),
    "velocity": ("error of the velocities", "m/s"),
}
"""Noise settings of a filter: in words, SI unit."""
MIN_VIBRATION_RATIO = 1.5
"""Vibration, moving ÷ standing, from which it counts."""
MIN_RETURNED_SHARE = 0.25
"""Part of what a factor lost that forgetting a cause must bring back for it to be named."""
MAX_CAUSES_LEFT_OUT = 4
"""Findings that are forgotten in turn, the first accepted: each costs a pass and a fit."""
UNKNOWN = "unknown"


@dataclass(frozen=True)
class _Factors:
    """Factors on the stated settings that a pass asks for, and the same as coefficients with intervals."""

    fit: NoiseFit
    scale: Mapping[str, float]

    def log(self, name: str) -> float:
        """Return the size of a factor: how far its log is from 0."""
        return abs(float(np.log(self.fit.factor(name) * self.scale[name])))

    def coefficient(self, name: str) -> Coefficient:
        """Return a factor with its interval."""
        return self.fit.coefficient(name, scale=self.scale[name])


def estimate_noise_scales(
    examined: ExaminedDrive,
    vibration: Mapping[str, float] | None = None,
    *,
    prior_sd: Mapping[str, float] = NO_PRIOR,
) -> tuple[NoiseScaleEstimate, ...]:
    """Return what a drive asks of each noise setting, and why.

    None where the likelihood has no maximum that could be found.

    Parameters
    ----------
    examined : ExaminedDrive
        The drive, its passes and findings.
    vibration : mapping of str to float
        Noise above 5 Hz, moving ÷ standing, of ``gyro`` and ``accel``.
    prior_sd : mapping of str to float
        What is known beforehand of the log of a factor, by name of `SETTINGS`; nothing by default, so that the drive
        speaks for itself.
    """
    base, final = examined.search.base, examined.search.final
    config = base.hypothesis.config
    known = tuple(a.cause for a in examined.search.accepted)
    if not all(present(noise_hypothesis_of(one, ()), tuple(SETTINGS)) for one in (base, final)):
        return ()
    try:
        plain = _fit_factors(base, base, (), prior_sd)
        named = _fit_factors(base, final, known, prior_sd)
    except np.linalg.LinAlgError:
        return ()
    names = [
        name for name in SETTINGS if name in plain.fit.parameters.names and name in named.fit.parameters.names
    ]
    factor = {name: (plain.coefficient(name), named.coefficient(name)) for name in names}
    fallen = [
        name
        for name in names
        if not may_be_one(factor[name][0])
        and plain.log(name) - named.log(name) > MIN_RETURNED_SHARE * plain.log(name)
    ]
    accounted = _responsible_causes(examined.drive, base, final, known, fallen, plain, named, prior_sd)
    answer = []
    for name in SETTINGS:
        stated = stated_value(config, base, name)
        if name not in names:
            continue
        held = plain.fit.identifiable(name) or named.fit.identifiable(name)
        causes = accounted.get(name, ())
        if held and not may_be_one(factor[name][1]):
            causes = (*causes, _remaining_cause(name, factor[name][1], known, vibration or {}))
        answer.append(
            NoiseScaleEstimate(
                name, stated, SETTINGS[name][1], *factor[name], causes if held else (), held, ""
            )
        )
    return tuple(replace(one, text=words(one, (vibration or {}).get(one.setting[:-6]))) for one in answer)


def may_be_one(factor: Coefficient) -> bool:
    """Whether a factor may be 1."""
    if factor.interval is not None:
        return factor.interval[0] <= 1.0 <= factor.interval[1]
    return factor.upper is None or factor.upper >= 1.0


def stated_value(config: FilterConfig, base: FilterRun, name: str) -> float | None:
    """Return what is stated of a setting, root mean square over axes (and fixes), SI."""
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
    known: Sequence[str],
    prior_sd: Mapping[str, float],
    free: Sequence[str] = tuple(SETTINGS),
    others: NoiseFit | None = None,
) -> _Factors:
    """Fit the free settings of a pass, the others as a fit has them."""
    noise = noise_hypothesis_of(run, tuple(known))
    names = present(noise, tuple(free))
    if others is not None:
        fixed = tuple(name for name in others.parameters.names if name not in names)
        logs = np.array([others.estimate[others.number(name)] for name in fixed])
        noise = noise_parameters(fixed).change(noise, logs)
    # Far from the truth variances may come out negative: the search turns back from there.
    with np.errstate(invalid="ignore"):
        fit = maximize_likelihood(noise, noise_parameters(names), prior_sd=prior_sd)
    return _Factors(
        fit, {name: assumed_over_stated(run, name) / assumed_over_stated(base, name) for name in names}
    )


def assumed_over_stated(run: FilterRun, name: str) -> float:
    """Return the configured value of a setting of a pass, in proportion to what was stated."""
    if name in BLOCKS:
        linearized, rows = run.linearized, run.linearized.counted[:, BLOCKS[name]]
        now, factor_text = (sd[:, BLOCKS[name]][rows] for sd in (linearized.sd, linearized.reported_sd))
        known = np.isfinite(factor_text)
        return (
            float(np.sqrt(np.sum(now[known] ** 2) / np.sum(factor_text[known] ** 2))) if known.any() else 1.0
        )
    value = stated_value(run.hypothesis.config, run, name)
    return value or 1.0


def _responsible_causes(
    drive: Drive,
    base: FilterRun,
    final: FilterRun,
    known: tuple[str, ...],
    fallen: Sequence[str],
    plain: _Factors,
    named: _Factors,
    prior_sd: Mapping[str, float],
) -> dict[str, tuple[str, ...]]:
    """Return the findings that bring factors back when they are forgotten, the most important first."""
    causes = tuple(dict.fromkeys(c for c in known if not is_noise_scale(c)))[:MAX_CAUSES_LEFT_OUT]
    if not fallen or not causes:
        return {}
    if len(causes) == 1:
        return dict.fromkeys(fallen, causes)
    back: dict[str, dict[str, float]] = {name: {} for name in fallen}
    for cause in causes:
        others = tuple(c for c in known if c != cause)
        try:
            less = run_filter(drive, DRIVE_CAUSES[cause].without(final.hypothesis, base.hypothesis))
            asked = _fit_factors(base, less, others, prior_sd, fallen, named.fit)
        except (DataError, np.linalg.LinAlgError):
            # A filter that cannot do without the cause: all of the factor is back.
            back = {name: {**shares, cause: 1.0} for name, shares in back.items()}
            continue
        for name in fallen:
            lost = plain.log(name) - named.log(name)
            back[name][cause] = (asked.log(name) - named.log(name)) / lost
    answer = {}
    for name, shares in back.items():
        order = sorted(shares, key=lambda cause: -shares[cause])
        answer[name] = tuple(c for c in order if shares[c] > MIN_RETURNED_SHARE) or (order[0],)
    return answer


def _remaining_cause(
    name: str, left: Coefficient, known: Sequence[str], vibration: Mapping[str, float]
) -> str:
    """Return what accounts for a factor that stays."""
    if name in BLOCKS:
        return "gnss_noise_scale" if "gnss_noise_scale" in known else UNKNOWN
    sensor, _, kind = name.partition("_")
    ratio = vibration.get(sensor, 1.0)
    low = left.interval[0] if left.interval else 0.0
    return "vibration" if kind == "white" and ratio > MIN_VIBRATION_RATIO and 1.0 < low < ratio else UNKNOWN


def words(one: NoiseScaleEstimate, vibration: float | None = None) -> str:
    """Put the estimate of a noise scale in words."""
    title = SETTINGS[one.setting][0]
    if not one.identifiable:
        return f"{title}: not identifiable on this drive; the stated value stays"
    if may_be_one(one.plain) and may_be_one(one.named):
        return f"{title}: as stated; the drive allows {_times(one.plain)}"
    named = [
        cause.replace("_", " ")
        for cause in one.causes
        if cause not in (UNKNOWN, "vibration") and not is_noise_scale(cause)
    ]
    parts = [f"{title}: the drive asks for {_times(one.plain)} as it stands"]
    if named:
        parts.append(f"{_times(one.named)} once {listed(named)} {'is' if len(named) == 1 else 'are'} named")
    else:
        parts.append(f"{_times(one.named)} with all findings in the filter")
    if "vibration" in one.causes and vibration is not None:
        parts.append(f"above 5 Hz the unit is {vibration:.1f} times as noisy moving as standing")
    if "gnss_noise_scale" in one.causes:
        parts.append("the receiver's own standard deviations are off by that much")
    if UNKNOWN in one.causes:
        parts.append("what is left has no known cause")
    return "; ".join(parts)


def listed(names: Sequence[str]) -> str:
    """Join names as a sentence does."""
    return " and ".join([*filter(None, [", ".join(names[:-1])]), names[-1]])


def _times(factor: Coefficient) -> str:
    return f"less than × {factor.upper:.3g}" if factor.value is None else f"× {factor_text(factor)}"


def factor_text(factor: Coefficient) -> str:
    """Say a factor: ``1.8 (1.5 … 2.2)``, ``below 0.9``."""
    if factor.value is None:
        return f"below {factor.upper:.3g}" if factor.upper is not None else "–"
    if factor.interval is None:
        return f"{factor.value:.3g}"
    return f"{factor.value:.3g} ({factor.interval[0]:.3g} … {factor.interval[1]:.3g})"
