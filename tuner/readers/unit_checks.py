"""Are the units of a log those it is read in? What nobody states must be shown by the samples, or is refused.

=============  ===================================================================================================
stated by      what happens where the samples of a sensor at rest speak against the unit
=============  ===================================================================================================
nobody         refused, unless gravity confirms the accelerometers; a gyroscope whose unit its noise, bias and step
               leave open is read in SI, and the result says by how much another unit would be off
file           refused where another unit gives gravity, or where it is off by more than `MAX_UNIT_FACTOR`
user           refused where it is off by more than `MAX_UNIT_FACTOR`
=============  ===================================================================================================

``--assume si`` takes what is not stated as SI. The evidence: `tuner.readers.unit_evidence`. A single reading beyond
`MAX_READING` is a broken row of the file, no spike of a sensor.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from models.earth import EARTH_RATE
from models.units import STANDARD_GRAVITY
from tuner.readers.column_names import INCREMENT_UNITS, UNITS
from tuner.readers.options import UnitChoice
from tuner.readers.unit_evidence import (
    CHECKED_SAMPLES,
    GRAVITY_TOLERANCE,
    MAX_STEADY_RATE,
    USUAL_RATES,
    Sizes,
    possible_rate,
    rate_in_motion,
    si_value,
    sizes_of,
    step_of,
    unit_of_step,
    units_with_gravity,
    whole_numbers,
)
from tuner.types.records import DataError, Record

MAX_UNIT_FACTOR = 100.0
"""Factor by which a stated unit may be wrong before it is refused: logs in motion and without gravity exist."""
MAX_READING: Mapping[str, float] = MappingProxyType({"gyro": 1e5, "accel": 1e6})
"""Readings that no sensor has, rad/s and m/s²."""
MIN_RANGE = 1e-15
"""Largest difference of readings, rad/s or m/s², that no sensor resolves: the best have noise of 1e-10."""
MAX_MEDIAN_RATE = 35.0
"""rad/s, 2000 deg/s: the range of consumer gyroscopes, which no log exceeds in the median."""
EARTH_TOLERANCE = 0.02
"""Relative distance of a mean rate from the Earth's up to which it is taken for it."""
ANSWER = "--assume si"


def check_units(
    source: str, records: Sequence[Record], choices: Mapping[str, UnitChoice], *, assume_si: bool = False
) -> tuple[list[str], dict[str, str]]:
    """Return notes on units that may be wrong, and by sensor what was assumed where nobody states the unit.

    Raises
    ------
    DataError
        A unit that the samples contradict, with the option that states the right one; a reading no sensor has.
    """
    notes: list[str] = []
    assumed: dict[str, str] = {}
    for record in records:
        choice = choices[record.name]
        _check_range(source, record)
        found = sizes_of(record)
        open_question = choice.basis == "assumed" and not assume_si
        if open_question and whole_numbers(record.y, si_value(choice.unit, record.interval)):
            raise DataError(f"{source}: {_counts(record, found, choice)}")  # noqa: EM102
        if record.name == "accel":
            if open_question:
                assumed["accel"] = _confirmed_by_gravity(source, record, found, choice)
            elif not assume_si:
                notes += _not_against_gravity(source, record, found, choice)
        else:
            if open_question:
                assumed["gyro"] = _open_rate(source, record, found, choice, choices.get("accel"))
            if not assume_si:
                _check_rate(source, record, found, choice)
        if choice.basis == "assumed" and assume_si:
            assumed[record.name] = f"{record.name}: {choice.unit} assumed, as {ANSWER} says"
    return notes, assumed


def _check_range(source: str, record: Record) -> None:
    """Refuse a record with readings that no sensor has: too large in places, or too small everywhere."""
    if 0.0 < float(np.ptp(record.y, axis=0).max()) < MIN_RANGE:
        msg = (
            f"{source}: {record.name} varies by {np.ptp(record.y, axis=0).max():.3g} {record.unit} in all, which no "
            f"sensor resolves: pass --{record.name}-unit or --{record.name}-scale, or choose other columns"
        )
        raise DataError(msg)
    limit = MAX_READING.get(record.name, np.inf)
    if max(record.y.max(), -record.y.min()) > limit > np.median(np.abs(record.y[:CHECKED_SAMPLES])):
        first = int(np.argmax(np.abs(record.y).max(axis=1)))
        msg = (
            f"{source}: {record.name} reads {np.abs(record.y[first]).max():.3g} {record.unit} in sample {first + 1}, "
            "which no sensor does: a broken row; take it out or write NaN"
        )
        raise DataError(msg)


def _counts(record: Record, found: Sizes, choice: UnitChoice) -> str:
    """Return what to do about whole numbers without a unit."""
    begin = f"{record.name} holds whole numbers, as counts do, and nothing states their size: pass "
    if record.name == "gyro":
        return (
            f"{begin}--gyro-unit deg/s --gyro-scale X with the deg/s in one count of its data sheet, "
            f"such as 0.0076294 (250 / 2^15), or {ANSWER} if these are {choice.unit}"
        )
    raw = found.norm / si_value(choice.unit, record.interval)
    if units := [u for u in units_with_gravity(raw, record.interval) if u not in INCREMENT_UNITS]:
        return f"{begin}--accel-unit {units[0]}, in which the mean is gravity, or {ANSWER} if these are {choice.unit}"
    power = round(math.log2(raw)) if raw > 1.0 else 0
    scale = 2.0**-power if abs(raw / 2.0**power - 1.0) < GRAVITY_TOLERANCE else 1.0 / raw
    whence = (
        f"1 / {2**power}"
        if scale == 2.0**-power
        else "gravity divided by the mean; the data sheet knows better"
    )
    return (
        f"{begin}--accel-unit g --accel-scale {scale:.6g} ({whence}), or {ANSWER} if these are {choice.unit}"
    )


def _confirmed_by_gravity(source: str, record: Record, found: Sizes, choice: UnitChoice) -> str:
    """Return the assumption that gravity confirms, or refuse it."""
    if abs(found.norm / STANDARD_GRAVITY - 1.0) < GRAVITY_TOLERANCE:
        return f"accel: {choice.unit} assumed, as its mean is gravity ({found.norm:.4g} m/s^2)"
    raw = found.norm / si_value(choice.unit, record.interval)
    units = units_with_gravity(raw, record.interval)
    axes = "" if len(record.axes) == 3 else f" on {len(record.axes)} axes"
    option = f"--accel-unit {units[0]}" if units else f"--accel-unit UNIT ({' '.join(UNITS['accel'])})"
    msg = (
        f"{source}: accel reads {found.norm:.4g} m/s^2{axes} where gravity is 9.81, and nothing states its unit: "
        f"pass {option}, or {ANSWER} if these are {choice.unit}"
    )
    raise DataError(msg)


def _not_against_gravity(source: str, record: Record, found: Sizes, choice: UnitChoice) -> list[str]:
    """Return a note on a stated unit that could not be checked, or refuse it where it cannot be."""
    if len(record.axes) != 3:
        return []
    tiny = found.norm < STANDARD_GRAVITY / MAX_UNIT_FACTOR
    steady = found.mean > 20.0 * found.noise
    units = units_with_gravity(found.norm / si_value(choice.unit, record.interval), record.interval)
    absurd = found.norm > MAX_UNIT_FACTOR * STANDARD_GRAVITY or (tiny and steady and choice.basis != "user")
    if absurd or (units and choice.unit not in units and steady and choice.basis == "file"):
        off = max(found.norm / STANDARD_GRAVITY, STANDARD_GRAVITY / found.norm) if found.norm else math.inf
        msg = (
            f"{source}: accel reads {found.norm:.4g} m/s^2 where gravity is 9.81: the unit {choice.unit} is wrong by "
            f"{off:.3g}x; pass --accel-unit {units[0] if units else 'UNIT'}, or --accel-unit {choice.unit} {ANSWER} "
            "if it is right"
        )
        raise DataError(msg)
    if tiny:
        return ["accel: no gravity in the log, so its unit could not be checked"]
    if units and choice.unit not in units and steady:
        return [
            f"accel reads {found.norm:.4g} m/s^2 at rest, as if in {units[0]}: if so pass --accel-unit {units[0]}"
        ]
    return []


def _open_rate(
    source: str, record: Record, found: Sizes, choice: UnitChoice, accel: UnitChoice | None
) -> str:
    """Return what is assumed of a gyroscope whose unit nobody states, or refuse what noise and bias speak against."""
    interval, read_in = record.interval, choice.unit
    factor = si_value(read_in, interval)
    rates = [u for u in USUAL_RATES if u != read_in]
    if accel is not None and accel.basis != "assumed":
        matching = accel.unit in INCREMENT_UNITS
        rates = [u for u in rates if (u in INCREMENT_UNITS) == matching]
        if (read_in in INCREMENT_UNITS) != matching:
            msg = (
                f"{source}: accel is in {accel.unit}, {'an increment' if matching else 'a rate'}, and nothing states "
                f"the unit of gyro: pass --gyro-unit {'rad' if matching else 'rad/s'} or "
                f"{'deg' if matching else 'deg/s'}"
            )
            raise DataError(msg)
    possible = [u for u in rates if possible_rate(u, found, interval, read_in)]
    by_step = {unit_of_step(step_of(y, factor)) for y in record.y.T} - {None}
    shown = f"{found.mean / factor:.3g} ± {found.noise / factor:.2g}"
    why = ""
    stepped = [u for u in possible if by_step == {u}]
    if stepped:
        why, possible = f"has samples at multiples of a step that gyroscopes have in {stepped[0]}", stepped
    elif not possible_rate(read_in, found, interval, read_in):
        why = f"reads {shown}, which bias and noise at rest cannot be in {read_in}"
    elif (turning := _as_the_earth(record, found, possible, read_in)) is not None:
        why, possible = f"turns as the Earth does in {turning}", [turning]
    if why:
        option = f"--gyro-unit {possible[0]}" if possible else f"--gyro-unit UNIT ({' '.join(UNITS['gyro'])})"
        if why.startswith("reads") and possible and possible[0] != "deg/s":
            kind = read_in in INCREMENT_UNITS if accel is None or accel.basis == "assumed" else matching
            alike = [u for u in UNITS["gyro"] if u not in possible and (u in INCREMENT_UNITS) == kind]
            fitting = [*possible[1:], *(u for u in alike if possible_rate(u, found, interval, read_in))]
            option += f" ({', '.join(fitting)} would fit, too)" if fitting else ""
            if "deg/s" in rates and rate_in_motion(found, interval, read_in):
                option = f"--gyro-unit deg/s if the sensor moved; if it was at rest, {option}"
        msg = f"{source}: gyro {why}, and nothing states its unit: pass {option}, or {ANSWER} if it is {read_in}"
        raise DataError(msg)
    foreign = accel is not None and accel.basis != "assumed" and accel.unit not in ("m/s^2", "m/s")
    if foreign and accel is not None and possible and by_step != {read_in}:
        msg = (
            f"{source}: accel is in {accel.unit}, and nothing states the unit of gyro: pass "
            f"--gyro-unit {possible[0]}, or --gyro-unit {read_in}"
        )
        raise DataError(msg)
    if by_step == {read_in}:
        return f"gyro: {read_in} assumed, as the step of its samples is that of gyroscopes in {read_in}"
    others = ", ".join(f"in {u} {factor / si_value(u, interval):.3g} times too large" for u in possible[:3])
    if not others:
        return f"gyro: {read_in} assumed, as no other unit fits its noise and bias"
    return (
        f"gyro: {read_in} assumed, as nothing states the unit ({shown}); every gyro number is, if the samples are "
        f"{others}: --gyro-unit {possible[0]} states another"
    )


def _as_the_earth(record: Record, found: Sizes, possible: Sequence[str], read_in: str) -> str | None:
    """Return the unit in which a triad turns as fast as the Earth, where its noise lets that be seen."""
    if len(record.axes) != 3:
        return None
    for unit in possible:
        factor = si_value(unit, record.interval) / si_value(read_in, record.interval)
        seen = found.white * factor / math.sqrt(record.span) < 0.5 * EARTH_TOLERANCE * EARTH_RATE
        if seen and abs(found.mean * factor / EARTH_RATE - 1.0) < EARTH_TOLERANCE:
            return unit
    return None


def _check_rate(source: str, record: Record, found: Sizes, choice: UnitChoice) -> None:
    """Refuse a gyroscope that turns as nothing does."""
    if len(record.axes) != 3:
        return
    if found.norm > MAX_MEDIAN_RATE or (found.mean > MAX_STEADY_RATE and found.noise < found.mean):
        factor = si_value(choice.unit, record.interval)
        slower = [u for u in UNITS["gyro"] if u not in INCREMENT_UNITS and u != choice.unit]
        fitting = [u for u in slower if found.norm / factor * si_value(u, record.interval) < 1.0]
        msg = (
            f"{source}: gyro reads {found.norm:.3g} rad/s ({np.rad2deg(found.norm):.3g} deg/s) in the median: the "
            f"unit {choice.unit} is wrong; pass --gyro-unit {fitting[0] if fitting else 'UNIT'}"
            f"{' (probably)' if fitting else ''}, or --gyro-unit {choice.unit} {ANSWER} if it is right"
        )
        raise DataError(msg)
