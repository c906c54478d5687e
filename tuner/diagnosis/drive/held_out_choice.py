"""Which configuration to write for a drive: fitted on its first 60 %, kept where it predicts the last 40 % better.

Candidates are the configuration as it began and the one with all findings, each also with factors on its noise that
let it predict outages of the first part (`predictive_score`): innovations a tenth of a second ahead do not show what
adds up over a minute, such as vibration that turns into bias, or errors of the receiver that stay. Factors are found
one after another, by steps of 3 and then of √3, each kept where it gains `MIN_GAIN`.

On the last part a candidate replaces the beginning only where its log density is larger, no length of outage has errors
that are larger beyond chance (`change_interval`), and positions with fixes are not worse. The candidates are tried in
the order of their log density on the first part; where none passes, the configuration stays as it began.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from tuner.diagnosis.drive.causes.time_offset import with_clock
from tuner.diagnosis.drive.diagnose import ExaminedDrive
from tuner.diagnosis.drive.held_out_gain import change_interval, fitted_before
from tuner.diagnosis.drive.hypothesis import with_density_factors
from tuner.diagnosis.drive.linear_model.linearized_run import NOISE_GROUPS
from tuner.diagnosis.drive.predictive_score import PredictiveScore, configured_run, predictive_score
from tuner.diagnosis.drive.score_tests import FITTED_SHARE
from tuner.navigation.drive.axis_checks import with_axes_found
from tuner.navigation.drive.clock import clock_of_drive
from tuner.navigation.drive.gross_outliers import without_gross_outliers
from tuner.navigation.fix_sd_model import GNSS_NOISE_SCALE
from tuner.types import Enlargement, FilterConfig, Parameter, Quantity
from tuner.types.progress import Progress
from tuner.types.records import DataError, Drive

FACTORS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "white": ("gyro_white", "accel_white"),
        "bias": ("gyro_bias", "accel_bias"),
        "position_vertical": ("position_vertical",),
        "velocity_vertical": ("velocity_vertical",),
        "position_horizontal": ("position_horizontal",),
        "velocity_horizontal": ("velocity_horizontal",),
    }
)
"""Factors that are tried, with the noise groups or fix rows that they multiply, in the order of trial."""
STEPS = (3.0, 3.0**0.5)
"""Factors by which a setting is moved: a third of a decade is far, its root is what outages of a drive tell apart."""
MIN_GAIN = 3.0
"""Nats that a step must gain: a likelihood ratio of 20."""
MAX_MOVES = 3
"""Moves of one setting by one step size, at most: 27 times."""
MAX_TRACKING_RATIO = 1.05
"""Position error with fixes, after ÷ before, above which it counts as worse: 5 % are lost in the scatter of a drive."""
QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {
        "gyro_white": Quantity("gyro", "white_density"),
        "accel_white": Quantity("accel", "white_density"),
        "gyro_bias": Quantity("gyro", "markov"),
        "accel_bias": Quantity("accel", "markov"),
        "position_vertical": Quantity("gnss", "position_sd"),
        "velocity_vertical": Quantity("gnss", "velocity_sd"),
        "position_horizontal": Quantity("gnss", "position_sd"),
        "velocity_horizontal": Quantity("gnss", "velocity_sd"),
    }
)
"""Settings that a factor enlarges."""
NOT_JUDGED = (
    "the drive is too short to hold configurations against its last part: that with the findings is written"
)
"""Note of a drive without outages in either part."""


@dataclass(frozen=True)
class HeldOutChoice:
    """The configuration that a drive keeps.

    Attributes
    ----------
    config : FilterConfig
        To be written.
    kept : str
        ``as it began``, ``with the findings``, or one of these with ``, factors for outages``.
    factors : mapping of str to float
        On the noise of that configuration, by name of `FACTORS`.
    before, after : PredictiveScore or None
        On the last part: as it began, and as written; None where the drive is too short.
    note : str
        What was decided, and why, in words.
    """

    config: FilterConfig
    kept: str
    factors: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    before: PredictiveScore | None = None
    after: PredictiveScore | None = None
    note: str = ""


def with_noise_factors(config: FilterConfig, factors: Mapping[str, float]) -> FilterConfig:
    """Return a configuration with factors on its noise, by name of `FACTORS`."""
    each = {setting: factor for name, factor in factors.items() for setting in FACTORS[name]}
    config = with_density_factors(config, {group: each.get(group, 1.0) for group in NOISE_GROUPS})
    own = config.compensation.of(GNSS_NOISE_SCALE)
    rows = {name: factor for name, factor in each.items() if name not in NOISE_GROUPS}
    values = {Parameter(GNSS_NOISE_SCALE, name): own.get(name, 1.0) * factor for name, factor in rows.items()}
    return replace(config, compensation=config.compensation.with_values(values))


def choose_config(
    drive: Drive, examined: ExaminedDrive, before: FilterConfig, after: FilterConfig, progress: Progress
) -> HeldOutChoice:
    """Choose the configuration of a drive by its last part.

    Parameters
    ----------
    drive : Drive
        As read.
    examined : ExaminedDrive
        Its diagnosis.
    before, after : FilterConfig
        As it began, and with all findings.
    progress : callable
        Called with what is being done.
    """
    gnss, _, _ = without_gross_outliers(with_axes_found(drive.gnss)[0])
    drive = replace(drive, gnss=gnss)
    clock = clock_of_drive(drive)
    before, after = with_clock(before, clock), with_clock(after, clock)
    begin, end = float(gnss.t[0]), float(gnss.t[-1])
    cut = begin + FITTED_SHARE * (end - begin)

    def score(config: FilterConfig, first: float, last: float) -> PredictiveScore | None:
        try:
            return predictive_score(configured_run(drive, config, clock), first, last)
        except (DataError, np.linalg.LinAlgError):
            return None

    progress("fitting the noise to outages of the first part of the drive")
    written = {"as it began": before, "with the findings": after}
    fitted = dict(written)
    if after is not before and examined.search.accepted:
        try:
            part = fitted_before(examined.drive, examined.search, cut)
        except DataError:
            del fitted["with the findings"]
        else:
            fitted["with the findings"] = replace(part.config, compensation=part.compensation)
    else:
        del fitted["with the findings"]
    ranked: list[tuple[float, str, FilterConfig, Mapping[str, float]]] = []
    for name, config in fitted.items():
        first = score(config, begin, cut)
        if first is None:
            continue
        ranked.append((first.nats, name, config, {}))
        found, nats = _fit_factors(config, first.nats, lambda one: score(one, begin, cut))
        if found:
            ranked.append((nats, name, config, found))
    begun = score(before, cut, end)
    if begun is None or not ranked:
        return HeldOutChoice(after, "with the findings", note=NOT_JUDGED)
    progress("judging the configurations on the last part of the drive")
    for _, name, config, factors in sorted(ranked, key=lambda one: -one[0]):
        late = score(with_noise_factors(config, factors), cut, end)
        if late is not None and is_better(begun, late):
            kept = f"{name}, factors for outages" if factors else name
            return HeldOutChoice(
                _recorded(written[name], factors), kept, factors, begun, late, _note(kept, begun, late)
            )
    return HeldOutChoice(before, "as it began", {}, begun, begun, _note("as it began", begun, begun))


def is_better(before: PredictiveScore, after: PredictiveScore) -> bool:
    """Whether one score is larger than another and nothing that a user reads is worse."""
    if after.nats <= before.nats or after.tracking_rms > MAX_TRACKING_RATIO * before.tracking_rms:
        return False
    for one, other in zip(before.outages, after.outages, strict=False):
        pairs = (
            np.stack([one.square, other.square], axis=-1) if len(one.square) == len(other.square) else None
        )
        if pairs is not None and len(pairs) > 1 and change_interval(pairs)[0] > 0.0:
            return False
    return True


def _fit_factors(
    config: FilterConfig, nats: float, score: Callable[[FilterConfig], PredictiveScore | None]
) -> tuple[dict[str, float], float]:
    """Return the factors that raise the log density, one after another, and what it then is."""
    factors: dict[str, float] = {}
    for step in STEPS:
        for name in FACTORS:
            for direction in (step, 1.0 / step):
                moved = False
                for _ in range(MAX_MOVES):
                    trial = {**factors, name: factors.get(name, 1.0) * direction}
                    found = score(with_noise_factors(config, trial))
                    if found is None or found.nats < nats + MIN_GAIN:
                        break
                    factors, nats, moved = trial, found.nats, True
                if moved:
                    break
    return {name: factor for name, factor in factors.items() if abs(np.log(factor)) > 1e-6}, nats


def _recorded(config: FilterConfig, factors: Mapping[str, float]) -> FilterConfig:
    """Return a configuration with factors on its noise, each with its reason."""
    reason = "errors in outages of 10 to 60 s on the first 60 % of the drive; the last 40 % are predicted better, too"
    records = tuple(
        Enlargement(QUANTITIES[setting], factor, f"{setting.replace('_', ' ')}: {reason}")
        for name, factor in factors.items()
        for setting in FACTORS[name]
    )
    config = with_noise_factors(config, factors)
    return replace(config, inflations=(*config.inflations, *records))


def _note(kept: str, before: PredictiveScore, after: PredictiveScore) -> str:
    """Return in words what was kept and what it does on the last part of the drive."""
    outages = "; ".join(
        f"{a.seconds:.0f} s without fixes {b.rms:.3g} → {a.rms:.3g} m, true ÷ predicted {b.ratio:.2f} → {a.ratio:.2f}"
        for b, a in zip(before.outages, after.outages, strict=False)
    )
    if kept == "as it began":
        outages = "; ".join(
            f"{b.seconds:.0f} s without fixes {b.rms:.3g} m, true ÷ predicted {b.ratio:.2f}"
            for b in before.outages
        )
        return f"the configuration stays as it began: no change predicts the last 40 % of the drive better ({outages})"
    return (
        f"kept: {kept}; on the last 40 % of the drive position with fixes "
        f"{before.tracking_rms:.3g} → {after.tracking_rms:.3g} m, {outages}"
    )
