"""The verdict on settings, noise and diagnoses, built from everything that is known of them.

Screen, page, JSON, exit status and files read this one verdict. Each function below returns the reasons of one kind,
each with the best use that it leaves; the gravest decides (`judged`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from tuner.catalogue.grades import receiver_or_default
from tuner.formats.axis_words import axes_text
from tuner.formats.customary_units import digits, percent, range_text
from tuner.formats.grouping import gathered
from tuner.identification.identify_channel import CURVE_DISAGREES
from tuner.limits import HONEST_RATIO, LOST_SHARE, SHOWN_CHANGE, TOLERATED_RATIO, WRONG_FACTOR
from tuner.synthesis.error_growth import modelled_growth
from tuner.synthesis.from_drive import FROM_FIXES
from tuner.synthesis.sufficient import UNAIDED_TIME, lacking_slow_bias, undetermined_bias
from tuner.types import (
    AppliedNoiseScale,
    Diagnosis,
    DriveDiagnosis,
    Enlargement,
    FilterConfig,
    Finding,
    Identification,
    Unexplained,
)
from tuner.types.borrowed import borrowed_words
from tuner.types.consistency import Check, Consistency
from tuner.types.diagnosis import START
from tuner.types.honesty import claims, is_off, need_text, off_reasons, shows_dishonesty
from tuner.types.judgement import Judgement, Reason, Use, judged
from tuner.types.prediction import BlockSource, PredictedBlock

if TYPE_CHECKING:
    from tuner.diagnosis.drive.held_out_choice import HeldOutChoice

ABOUT = {
    "fast spectrum": "the spectrum of the noise",
    "distribution": "the distribution and the variance of the noise",
    "slow part": "the slow course of the bias",
}
"""Parts of the samples that statistics are about, in words."""
FOR_SETTINGS = "for the settings of a filter, if long enough (`tune` says)"
"""What a log is for whose samples nothing speaks against."""
SETTING_WORDS = {
    "white_density": "white noise",
    "markov": "bias states",
    "random_walk_density": "bias random walk",
    "bias_instability_level": "bias instability",
}
"""Settings of a sensor and terms behind them, in words."""
NOT_SHOWN_AT_REST = "a log at rest cannot show scale factors, misalignment, delays or vibration of a vehicle"
"""What the verdict on a log that nothing contradicts says of its reach."""


@dataclass(frozen=True)
class Settings:
    """What is known of settings: the parts of a result of `tune`, each as there, those not run None or empty."""

    identification: Identification
    config: FilterConfig
    predictions: Mapping[str, PredictedBlock] = field(default_factory=lambda: MappingProxyType({}))
    diagnosis: Diagnosis | None = None
    check: Check | None = None
    drive: DriveDiagnosis | None = None
    choice: HeldOutChoice | None = None
    measured: Consistency | None = None


def judge_settings(known: Settings) -> Judgement:
    """Return for what the settings of a filter can be used."""
    reasons = [
        *(Reason(Use.DO_NOT_USE, why) for why in lacking_slow_bias(known.config).values()),
        *(Reason(Use.DO_NOT_USE, f"too short for {why}") for why in _too_short_for(known.identification)),
        *_of_drive(known),
        *_of_simulation(known.check, of_less=known.config.gnss is None or _measured(known)),
        *_of_predictions(known.predictions),
        *_of_compensation(known.predictions),
        *_of_reading(known.identification),
        *_of_losses(known.identification),
        *_of_lost_samples(() if known.diagnosis is None else known.diagnosis.findings),
        *_of_unexplained(() if known.diagnosis is None else known.diagnosis.unexplained),
        *_of_enlargements(known.config),
        *(Reason(Use.USABLE_EXCEPT, text) for text in borrowed_words(known.config)),
        *_of_limits(known.config),
        *_of_ramps(known.config),
        *_of_bandwidth(() if known.diagnosis is None else known.diagnosis.findings),
    ]
    forbidding = [one for one in reasons if one.use is Use.DO_NOT_USE]
    found = judged(Use.USABLE, forbidding or reasons)
    return found if found.reasons else Judgement(Use.USABLE, tuple(_grounds(known)))


def _grounds(known: Settings) -> Iterator[str]:
    """Yield what shows that settings can be used, and what was not looked at."""
    if known.predictions:
        ratios = [one.curve.ratio for one in known.predictions.values()]
        most = math.exp(max(float(abs(np.log(one)).max()) for one in ratios)) - 1.0
        begin = max(float(one.curve.tau[0]) for one in known.predictions.values())
        end = min(float(one.curve.tau[-1]) for one in known.predictions.values())
        yield (
            f"noise.yaml reproduces the Allan deviation of this log within {percent(most)}, {digits(begin, 2)} to "
            f"{digits(end, 2)} s"
        )
    if known.check is not None:
        receiver = receiver_or_default(known.config.gnss)
        sd = f"fixes of {digits(receiver.position_sd[0], 2)} m, --gnss"
        honest = known.check.consistency.honesty.reasons[0]
        yield f"in simulated drives ({sd}) it is honest: {honest}"
    if not any(one.span > 0.0 for one in known.identification.channels.values()):
        yield "its numbers are those of a sheet, not of your unit"
    if known.measured is not None:
        yield f"on this drive it is honest: {known.measured.honesty.reasons[0]}"


def judge_noise(
    found: Identification, predictions: Mapping[str, PredictedBlock] = MappingProxyType({})
) -> Judgement:
    """Return for what the identified noise can be used; `predictions` are of the settings made from it."""
    failed = curve_axes(predictions)
    unfit = Reason(
        Use.USABLE_EXCEPT,
        f"{axes_text(failed)}, whose terms do not predict the Allan curve: numbers read off the curve stand for them",
    )
    short = [Reason(Use.USABLE_EXCEPT, why) for why in _too_short_for(found)]
    refuted = [
        axis
        for axis, one in found.channels.items()
        if axis not in predictions and any(text.startswith(CURVE_DISAGREES) for text in one.warnings)
    ]
    if refuted:
        short.append(Reason(Use.DO_NOT_USE, f"the Allan curve contradicts the terms of {axes_text(refuted)}"))
    said = [
        *_of_reading(found),
        *([unfit] if failed else []),
        *_of_compensation(predictions),
        *_of_losses(found),
    ]
    return judged(Use.USABLE, [*short, *said])


def curve_axes(predictions: Mapping[str, PredictedBlock]) -> list[str]:
    """Return the axes whose settings are fitted to the Allan curve, as the identified terms do not predict it."""
    return [axis for axis, one in predictions.items() if one.source is not BlockSource.LIKELIHOOD]


def judge_log(found: Diagnosis) -> Judgement:
    """Return for what a log can be used by what its samples show, and what of them has no cause."""
    limits = [
        *_of_lost_samples(found.findings),
        *_of_unexplained(found.unexplained),
        *_of_bandwidth(found.findings),
    ]
    verdict = judged(Use.USABLE, limits)
    small = "" if any(map(is_felt, found.unexplained)) else f", below {percent(SHOWN_CHANGE)} of the drift"
    left = [one.text for one in _without_cause(found.unexplained)]
    said = [
        f"{'usable ' * bool(limits)}{FOR_SETTINGS}",
        f"not explained{small}: {'; '.join(left)}" if left else "",
        "" if left or found.findings else f"nothing contradicts its noise terms; {NOT_SHOWN_AT_REST}",
    ]
    return replace(verdict, reasons=(*verdict.reasons, *filter(None, said)))


def is_felt(one: Unexplained) -> bool:
    """Return whether an axis drifts further than its model by `SHOWN_CHANGE`, or nobody knows."""
    return not one.drift or any(a > (1.0 + SHOWN_CHANGE) * b for a, b in one.drift.values())


def judge_drive(found: DriveDiagnosis) -> Judgement:
    """Return whether anything in a drive contradicts its filter, and whether it has a cause."""
    reasons = []
    if not found.credited:
        reasons = [
            Reason(Use.NOT_EXPLAINED, "the last part of the drive is predicted worse with the findings")
        ]
    scales = [
        f"{one.setting.replace('_', ' ')} is {digits(one.named.value or 0.0, 2)} × as stated"
        for one in found.noise_scales
        if one.identifiable and "unknown" in one.causes and one.named.determined and _far(one.named.value)
    ]
    reasons += [Reason(Use.NOT_EXPLAINED, f"noise without a known cause: {', '.join(scales)}")] * bool(scales)
    return _of_causes(found.findings, found.unexplained, reasons)


def _of_causes(
    findings: Sequence[Finding], unexplained: Sequence[Unexplained], more: Sequence[Reason] = ()
) -> Judgement:
    """Return the verdict on a diagnosis: its causes, and what has none first."""
    left = [*_without_cause(unexplained), *more]
    causes = ", ".join(dict.fromkeys(one.cause.replace("_", " ") for one in findings))
    text = f"explained: {causes}" if left else causes
    named = [Reason(Use.EXPLAINED, text)] if causes else []
    return judged(Use.NOTHING_CONTRADICTS, [*left, *named])


def _without_cause(unexplained: Sequence[Unexplained]) -> list[Reason]:
    """Return what of the samples is not explained, one reason a part of them."""
    parts = gathered((one.part, one) for one in unexplained)
    return [Reason(Use.NOT_EXPLAINED, _unexplained_text(tests)) for tests in parts.values()]


def _unexplained_text(tests: Sequence[Unexplained]) -> str:
    """Return what is not explained of a part of the samples: its statistic, or the part where several show it."""
    statistics = list(dict.fromkeys(one.statistic for one in tests))
    words = statistics[0] if len(statistics) == 1 else ABOUT.get(tests[0].about, "; ".join(statistics))
    axes = list(dict.fromkeys(axis for one in tests for axis in one.channels))
    return words if set(axes) <= {"drive", "gnss", "imu"} else f"{words} in {axes_text(axes)}"


def _of_drive(known: Settings) -> Iterator[Reason]:
    """Yield what a drive says against the settings that were made with it."""
    if known.drive is not None:
        for one in known.drive.unexplained:
            if one.about == START:
                yield Reason(Use.DO_NOT_USE, one.statistic)
            else:
                yield Reason(Use.USABLE_EXCEPT, f"what is not explained on the drive: {one.statistic}")
    if known.choice is not None and known.choice.after is not None:
        after = known.choice.after
        if after.fixes_rms is not None and not after.follows(WRONG_FACTOR):
            text = f"worse than the fixes alone: {digits(after.tracking_rms)} m, the fixes {digits(after.fixes_rms)} m"
            yield Reason(Use.DO_NOT_USE, f"with fixes the position is {text} (rms, last 40 % of the drive)")
    if known.choice is not None:
        yield from _worse_than_before(known.choice)
    if (
        known.drive is not None
        and known.config.gnss is not None
        and known.config.gnss.reference != FROM_FIXES
    ):
        yield Reason(Use.USABLE_EXCEPT, "the sds of the fixes, which are ASSUMED: the receiver states none")
    if known.measured is not None:
        yield from _of_scores(known.measured, "on the whole drive")
        if known.measured.gated > LOST_SHARE:
            yield Reason(
                Use.USABLE_EXCEPT, f"the filter refused {percent(known.measured.gated)} of the fixes"
            )


def judge_export(found: Consistency, error: float, fixes_alone: float) -> Judgement:
    """Return for what the settings of another filter can be used that runs on a drive.

    Parameters
    ----------
    found : Consistency
        Its scores by what is known of the truth.
    error, fixes_alone : float
        Rms errors with fixes and of the fixes themselves, position in three axes, m.
    """
    reasons = list(_of_scores(found, "on this drive"))
    if error > WRONG_FACTOR * fixes_alone:
        text = f"errs by {digits(error)} m on this drive, the fixes alone by {digits(fixes_alone)} m"
        reasons.append(Reason(Use.DO_NOT_USE, text))
    return judged(Use.USABLE, reasons) if reasons else Judgement(Use.USABLE, found.honesty.reasons)


def _worse_than_before(choice: HeldOutChoice) -> Iterator[Reason]:
    """Yield where settings err more with fixes than those they began from; in outages `choose_config` refuses them."""
    before, after = choice.before, choice.after
    if before is not None and after is not None and after.tracking_rms > WRONG_FACTOR * before.tracking_rms:
        change = f"{digits(before.tracking_rms)} → {digits(after.tracking_rms)} m"
        yield Reason(
            Use.DO_NOT_USE,
            f"worse than the settings it began from: {change} with fixes, last 40 % of the drive",
        )


def _measured(known: Settings) -> bool:
    """Return whether a drive shows how the filter errs, which counts more than simulated drives."""
    return known.measured is not None and known.measured.honesty.use not in (Use.DO_NOT_USE, Use.TOO_SHORT)


def _of_simulation(check: Check | None, *, of_less: bool) -> Iterator[Reason]:
    """Yield what simulated drives say against settings.

    Where their receiver is assumed, or a recorded drive says more, they speak `of_less`: against use on such drives.
    """
    if check is not None:
        for one in _of_scores(check.consistency, "in simulation"):
            yield Reason(Use.USABLE_EXCEPT, f"drives with GNSS: {one.text}") if of_less else one


def _of_scores(found: Consistency, where: str) -> Iterator[Reason]:
    """Yield what the scores of a filter say against its settings: beyond twice its prediction they are not used."""
    verdict = found.honesty
    if verdict.use is Use.DO_NOT_USE:
        yield Reason(Use.DO_NOT_USE, f"{where} {verdict.reasons[0]}")
    elif verdict.use in (Use.OPTIMISTIC, Use.PESSIMISTIC):
        off = [one for one in claims(found) if is_off(one)]
        far = {one.ratio > 1.0 for one in off if one.name != "attitude" and _far(one.ratio, TOLERATED_RATIO)}
        alike = off_reasons(found, [one for one in off if not far or (one.ratio > 1.0) in far])
        yield Reason(Use.DO_NOT_USE if far else Use.USABLE_EXCEPT, f"{where} {alike[0].text}")
    elif verdict.use is Use.TOO_SHORT:
        scores = [one for one in claims(found) if not shows_dishonesty(one)]
        yield Reason(
            Use.USABLE_EXCEPT, f"{where} its errors, which are too short to judge{need_text(scores)}"
        )


def _of_compensation(predictions: Mapping[str, PredictedBlock]) -> Iterator[Reason]:
    """Yield axes whose settings are for samples without some signals, as none predict them as they are."""
    axes = gathered((one.without, axis) for axis, one in predictions.items() if one.without)
    for causes, those in axes.items():
        named = " and ".join(one.replace("_", " ") for one in causes)
        yield Reason(Use.USABLE_EXCEPT, f"{axes_text(those)}, whose {named} your filter must take out first")


def _of_predictions(predictions: Mapping[str, PredictedBlock]) -> Iterator[Reason]:
    """Yield the axes whose settings do not predict their log."""
    failed = {axis: one for axis, one in predictions.items() if not one.passes}
    if failed:
        worst = max(failed.values(), key=lambda one: abs(math.log(one.curve.worst)))
        yield Reason(
            Use.USABLE_EXCEPT,
            f"{axes_text(list(failed))}: the settings predict {worst.curve.worst:.2f} × the Allan deviation of the log "
            f"at {digits(worst.curve.worst_tau, 2)} s",
        )


def _of_reading(found: Identification) -> Iterator[Reason]:
    """Yield what of a log its samples speak against as it is read, such as a unit beside gravity, and what it lacks."""
    yield from (Reason(Use.USABLE_EXCEPT, text) for text in found.source.get("contradicted", ()))
    for sensor in sorted({axis.split("_")[0] for axis in found.channels}):
        lost = [axis for x in "xyz" if (axis := f"{sensor}_{x}") not in found.channels]
        if len(lost) == 1:  # a sensor of one axis is a product, one of two is none
            yield Reason(Use.USABLE_EXCEPT, f"{axes_text(lost)}, which the log does not hold")


def _of_bandwidth(findings: Sequence[Finding]) -> Iterator[Reason]:
    """Yield what of a motion a sensor does not show, which a log at rest does not need."""
    lost = [one for one in findings if one.in_motion]
    if lost:
        axes = axes_text([axis for one in lost for axis in one.channels])
        yield Reason(
            Use.USABLE_EXCEPT, f"in motion, as {axes} are filtered ({lost[0].in_motion.partition(':')[0]})"
        )


def _too_short_for(found: Identification) -> tuple[str, ...]:
    """Return what the log behind noise is too short for, as `tune` refuses it."""
    return tuple(found.source.get("too_short_for", ()))


def lost_shares(found: Identification) -> dict[str, float]:
    """Return the share of the samples of a log that each of its axes is not identified from."""
    lost: dict[str, float] = {}
    for sensor in found.source.get("sensors", ()):
        lost |= dict.fromkeys(sensor["axes"], 1.0 - sensor.get("used_share", 1.0))
    return lost


def _of_losses(found: Identification) -> Iterator[Reason]:
    """Yield which samples of a log are left out, where more than `LOST_SHARE` of them are."""
    shares = lost_shares(found).items()
    kept = gathered((percent(1.0 - lost), axis) for axis, lost in shares if lost > LOST_SHARE)
    for used, axes in kept.items():
        text = f"{axes_text(axes)}: only {used} of the samples are used; else it moved, froze or was noisier"
        yield Reason(Use.USABLE_EXCEPT, text)


def _of_lost_samples(findings: Iterable[Finding]) -> Iterator[Reason]:
    """Yield which samples are at fault, where more than `LOST_SHARE` of them are."""
    for one in findings:
        share = one.parameters.get("fraction")
        if share is not None and share.value is not None and share.value > LOST_SHARE:
            cause = one.cause.replace("_", " ")
            yield Reason(
                Use.USABLE_EXCEPT,
                f"{axes_text(one.channels)}: {percent(share.value)} of the samples: {cause}",
            )


def _of_unexplained(unexplained: Sequence[Unexplained]) -> Iterator[Reason]:
    """Yield the axes whose log drifts further than its model by more than `WRONG_FACTOR`."""
    for one in unexplained:
        ratios = {name: a / b for name, (a, b) in one.drift.items() if b > 0.0}
        name = max(ratios, key=lambda key: ratios[key], default=None)
        if name is not None and ratios[name] > WRONG_FACTOR:
            yield Reason(
                Use.USABLE_EXCEPT,
                f"{axes_text(one.channels)}: after {name} its drift is {digits(ratios[name], 2)} × that of its noise, "
                "cause unknown",
            )


def _of_enlargements(config: FilterConfig) -> Iterator[Reason]:
    """Yield the settings that differ from what was measured or stated by more than `WRONG_FACTOR`, with the causes.

    Of a setting that several things change, such as vibration and a drive, it is one factor: their product.
    """
    settings: dict[tuple[str, str], list[Enlargement | AppliedNoiseScale]] = {}
    for one in config.inflations:
        if isinstance(one, Enlargement | AppliedNoiseScale):
            owner = one.quantity.owner  # a sensor stands for its axes
            for axis in [each for each in config.channels if each.startswith(f"{owner}_")] or [owner]:
                settings.setdefault((axis, one.quantity.field), []).append(one)
    changed: dict[tuple[str, str], list[tuple[str, float]]] = {}
    for (axis, name), parts in settings.items():
        factors = _factors_on_fixes(config).get(name, ()) if axis == "gnss" else ()
        if any(map(_far, factors or (one.factor for one in parts))):
            what = f"{name.partition('_')[0]} sds" if axis == "gnss" else SETTING_WORDS.get(name, name)
            why = _causes_text(list(dict.fromkeys(cause for one in parts for cause in one.causes)))
            for factor in factors or (math.prod(one.factor for one in parts),):
                changed.setdefault((what, why), []).append((axis, factor))
    texts = []
    for (what, why), alike in changed.items():
        axes, each = zip(*alike, strict=True)
        texts.append(
            f"{what} of {axes_text(list(dict.fromkeys(axes)))} × {range_text(each, significant=2)}{why}"
        )
    if texts:
        head = "settings not as measured or stated"
        yield Reason(Use.USABLE_EXCEPT, f"{head}: {', '.join(texts)}".replace("of gnss", "of fixes"))


def _factors_on_fixes(config: FilterConfig) -> dict[str, tuple[float, ...]]:
    """Return the factors on the sds that a receiver reports, by setting, where a configuration has them."""
    from tuner.navigation.fix_sd_model import BLOCKS, GNSS_NOISE_SCALE, fix_sd_model  # loads the navigation

    values = config.compensation.of(GNSS_NOISE_SCALE)
    models = {
        f"{block}_sd": fix_sd_model(values, block)
        for block in BLOCKS
        if any(name.startswith(block) for name in values)
    }
    return {name: (*one.horizontal, *one.vertical) for name, one in models.items() if one.exponent == 1.0}


def _causes_text(causes: Sequence[str]) -> str:
    return f" ({', '.join(causes).replace('_', ' ')})" if causes else ""


def _of_limits(config: FilterConfig) -> Iterator[Reason]:
    """Yield the axes whose settings depend on a term of which only a limit is known.

    White noise is then the limit. Slow terms of which half of it stands in the settings are named where they decide the
    drift of a minute.
    """
    hidden = [axis for axis in config.channels if "white_density" in config.on_limit(axis)]
    if hidden:
        yield Reason(
            Use.USABLE_EXCEPT,
            f"the white noise of {axes_text(hidden)}: only a limit is known, which is written",
        )
    if (words := undetermined_bias(config)) is not None:
        yield Reason(Use.USABLE_EXCEPT, words)


def _of_ramps(config: FilterConfig) -> Iterator[Reason]:
    """Yield the axes whose measured bias drift changes angle or velocity as much as the noise; few filters estimate it.

    After a time t it makes r t²/2 beside the sd of the noise, which together are `HONEST_RATIO` times that sd or more.
    """
    felt = []
    for channel in config.channels.values():
        rates = [t.coefficients["rate"].value for t in channel.identified if t.name == "ramp"]
        moved = sum(abs(rate or 0.0) for rate in rates) * 0.5 * UNAIDED_TIME**2
        noise = float(modelled_growth(channel, UNAIDED_TIME))
        if moved**2 > (HONEST_RATIO**2 - 1.0) * noise:
            felt.append(channel.axis)
    if felt:
        yield Reason(
            Use.USABLE_EXCEPT,
            f"the bias of {axes_text(felt)}, which drifted steadily while recorded: only noise.yaml has that rate",
        )


def _far(ratio: float | None, factor: float = WRONG_FACTOR) -> bool:
    """Return whether a ratio is further from 1 than a factor."""
    return ratio is not None and not 1.0 / factor <= ratio <= factor
