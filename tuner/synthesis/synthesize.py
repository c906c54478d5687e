"""From what was found in a sensor to the settings of a filter: every number with its reason.

`synthesize` takes each axis through `tuner.synthesis.channel_noise`, sizes P0 by
`tuner.synthesis.initial_covariance`, and fills in what the log lacks from grades, saying so. `inflate` enlarges
figures of a configuration with a reason each.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from models.noise import GaussMarkov
from models.sensors import SensorGrade
from tuner.catalogue.grades import grade_identification
from tuner.synthesis.bias_states import BOUND, RULES
from tuner.synthesis.channel_noise import channel_noise
from tuner.synthesis.initial_covariance import initial_uncertainty, turn_on_sd
from tuner.synthesis.prediction import hold_to_records
from tuner.types import ChannelNoise, Enlargement, FilterConfig, GnssNoise, Identification, Inflation
from tuner.types.arguments import described
from tuner.types.borrowed import with_borrowed
from tuner.types.number_ranges import NonNegative, Positive, Whole
from tuner.types.public import public
from tuner.types.records import DataError, Record

AXES: Mapping[str, tuple[str, ...]] = {
    "gyros": ("gyro_x", "gyro_y", "gyro_z"),
    "accelerometers": ("accel_x", "accel_y", "accel_z"),
}
"""The axes a navigation filter needs."""


@public("synthesize")
def synthesize(
    identification: Identification,
    *,
    horizon: Positive = 1000.0,
    rule: str = "ladder",
    complete: SensorGrade | None = None,
    gnss: GnssNoise | None = None,
    turn_on: Mapping[str, NonNegative] | None = None,
    inflations: Sequence[Enlargement] = (),
    findings: Sequence[Mapping[str, Any]] = (),
    records: Sequence[Record] = (),
    name: str = "",
    seed: Whole | None = None,
) -> FilterConfig:
    """Choose the settings of a navigation filter.

    Parameters
    ----------
    identification : Identification
        Noise of every channel.
    horizon : float, optional
        Longest time the filter must predict without aiding, s: longest time constant of the ladder.
    rule : str, optional
        How flicker becomes states: a key of `RULES`, or ``bound`` for the upper end of every interval.
    complete : SensorGrade, optional
        Stands in for the axes the identification lacks.
    gnss : GnssNoise, optional
        Errors of the aiding; without it R is left out.
    turn_on : mapping of str to float, optional
        Sd of the turn-on constant by axis, unit, such as from `turn_on_spread`; else taken from grade,
        datasheet or mean.
    inflations : sequence of Enlargement, optional
        Enlargements that findings ask for, applied by `inflate`.
    findings : sequence of mapping, optional
        Findings carried along, as plain values.
    records : sequence of Record, optional
        Samples at rest that were identified: settings that do not predict them are fitted to their Allan curve
        (`tuner.synthesis.prediction`), as in `tuner.tune`.
    name : str, optional
        Name of the configuration; default the source's.
    seed : int, optional
        Seed of the run, for the provenance.

    Returns
    -------
    FilterConfig
        No density, sd or time constant that a filter divides by is zero.

    Raises
    ------
    DataError
        For an unknown rule, a horizon that is not positive, or no channels at all.
    """
    if rule not in {*RULES, BOUND}:
        raise DataError(f"'rule' must be one of {', '.join([*RULES, BOUND])}, got {rule!r}")
    if not identification.channels:
        raise DataError("the identification holds no channel: nothing to configure")
    whole, notes = _completed(identification, complete)
    if strange := [axis for axis in turn_on or {} if axis not in whole.channels]:
        raise DataError(
            f"synthesize: turn_on: expected axes of the identification ({' '.join(whole.channels)}), found "
            f"{described(strange[0])}"
        )
    if any(not {"cause", "channels"} <= one.keys() for one in findings):
        raise DataError(
            "synthesize: findings: expected those of a configuration, each with cause and channels, found "
            f"{described(list(next(one for one in findings if not {'cause', 'channels'} <= one.keys())))}"
        )
    spread = dict(whole.source.get("turn_on_sd", {})) | dict(turn_on or {})
    channels: dict[str, ChannelNoise] = {}
    changes: list[Inflation] = []
    reasons: dict[str, str] = {}
    for axis, channel in whole.channels.items():
        constant, why = turn_on_sd(whole, axis, spread)
        channels[axis], inflated = channel_noise(channel, rule=rule, horizon=horizon, constant_sd=constant)
        changes.extend(inflated)
        reasons[axis] = why
    if gnss is None:
        notes.append("no GNSS figures in the log: R and gate are left out; --gnss GRADE fills them in")
    config = FilterConfig(
        name or str(identification.source.get("name", "unnamed")),
        next(iter(identification.channels.values())).interval,
        channels,
        initial_uncertainty(channels, reasons, gnss),
        gnss,
        tuple(changes),
        _provenance(whole, rule, horizon, complete, seed),
        (*identification.notes, *notes),
        tuple(findings),
    )
    config, _ = hold_to_records(config, records)
    return inflate(config, inflations)


def inflate(config: FilterConfig, inflations: Sequence[Enlargement]) -> FilterConfig:
    """Return the configuration with figures enlarged, and the enlargements on record.

    Parameters
    ----------
    config : FilterConfig
        Settings.
    inflations : sequence of Enlargement
        Factors on ``AXIS.FIELD`` or ``SENSOR.FIELD`` with FIELD one of ``white_density``, ``markov`` (the
        sds), ``random_walk_density``, ``constant_sd``, ``ramp_sd``; or on ``gnss.position_sd``,
        ``gnss.velocity_sd``.

    Raises
    ------
    DataError
        Where a factor names nothing in the configuration.
    """
    for inflation in inflations:
        owner, field = inflation.quantity.owner, inflation.quantity.field
        if owner == "gnss" and config.gnss is not None and field in {"position_sd", "velocity_sd"}:
            config = replace(config, gnss=_inflated_gnss(config.gnss, field, inflation.factor))
            continue
        axes = inflation.quantity.axes(config.channels)
        if not axes or field not in ENLARGEABLE_SETTINGS:
            allowed = ", ".join(ENLARGEABLE_SETTINGS)
            raise DataError(
                f"inflation of '{inflation.quantity}': expected an axis or sensor and one of {allowed}"
            )
        enlarged = {axis: _enlarged(config.channels[axis], field, inflation.factor) for axis in axes}
        config = replace(config, channels={**config.channels, **enlarged})
    return replace(config, inflations=(*config.inflations, *inflations))


ENLARGEABLE_SETTINGS = ("white_density", "markov", "random_walk_density", "constant_sd", "ramp_sd")
"""Settings of an axis that an enlargement may name; of `markov` the sds."""


def _inflated_gnss(gnss: GnssNoise, field: str, factor: float) -> GnssNoise:
    sd: tuple[float, float, float] | None = getattr(gnss, field)
    scaled: Any = None if sd is None else (factor * sd[0], factor * sd[1], factor * sd[2])
    return replace(gnss, **{field: scaled})


def _enlarged(channel: ChannelNoise, field: str, factor: float) -> ChannelNoise:
    if field == "markov":
        return replace(
            channel, markov=tuple(GaussMarkov(factor * s.sd, s.time_constant) for s in channel.markov)
        )
    return replace(channel, **{field: factor * getattr(channel, field)})


def _completed(identification: Identification, grade: SensorGrade | None) -> tuple[Identification, list[str]]:
    """Return the identification with missing axes filled in from a grade, and what there is to say."""
    missing = {
        name: [axis for axis in axes if axis not in identification.channels] for name, axes in AXES.items()
    }
    lacking = {name: axes for name, axes in missing.items() if axes}
    missing_axes = [name if len(axes) == 3 else f"{name} {', '.join(axes)}" for name, axes in lacking.items()]
    if grade is None:
        return identification, [
            f"no {words} in the log: left out; --complete GRADE fills them in" for words in missing_axes
        ]
    other = grade_identification(grade)
    added = {axis: c for axes in missing.values() for axis in axes if (c := other.channels.get(axis))}
    sd = {axis: value for axis, value in other.source["turn_on_sd"].items() if axis in added}
    source = {**identification.source, "turn_on_sd": {**identification.source.get("turn_on_sd", {}), **sd}}
    source = with_borrowed(source, added, grade.key)
    notes = [f"{words} completed from grade {grade.key}" for words in missing_axes]
    return replace(identification, source=source, channels={**identification.channels, **added}), notes


def _provenance(
    identification: Identification, rule: str, horizon: float, complete: SensorGrade | None, seed: int | None
) -> dict[str, Any]:
    first = next(iter(identification.channels.values()))
    return {
        "source": _plain(identification.source),
        "method": first.method,
        "rate": 1.0 / first.interval,
        "span": first.span,
        "rule": rule,
        "horizon": horizon,
        "complete": None if complete is None else complete.key,
        "versions": {package: _version(package) for package in ("ins-noise-tuner", "numpy", "scipy")},
        "seed": seed,
    }


def _plain(value: Any) -> Any:
    """Return a value as the plain types YAML knows."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if hasattr(value, "tolist"):
        return value.tolist()
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
