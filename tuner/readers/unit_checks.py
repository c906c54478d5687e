"""Are the units of a log those it is read in? What nobody states must be shown by the samples, or is refused.

=============  ===================================================================================================
stated by      what happens where the samples of a sensor at rest speak against the unit
=============  ===================================================================================================
nobody         refused, unless gravity confirms the accelerometers; a gyroscope whose unit its noise, bias and step
               leave open is read in SI, and the result says by how much another unit would be off
file           refused where gravity is off by more than `WRONG_FACTOR`, or where no gyroscope at rest has such noise or
               bias; said first where gravity is off by less
user           gravity as of a file; the rates of gyroscopes are refused where nothing that moves has them
=============  ===================================================================================================

A refusal carries the readings that may be meant; `tuner.readers.readings` tries them, and then every judgement here
counts, whoever states a unit. ``--assume si`` takes what is not stated as SI. The evidence:
`tuner.readers.unit_evidence`. A single reading beyond `LARGEST_READING` is a broken row of the file, no spike of a
sensor; numbers whose squares are none (1e200) are samples in no unit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.earth import EARTH_RATE
from models.units import STANDARD_GRAVITY, unit_value
from tuner.limits import WRONG_FACTOR
from tuner.readers.column_names import INCREMENT_OF, INCREMENT_UNITS, UNITS
from tuner.readers.column_units import UnitChoice
from tuner.readers.refusal import CUSTOMARY_UNITS, Change, Refusal
from tuner.readers.unit_evidence import (
    CHECKED_SAMPLES,
    GRAVITY_TOLERANCE,
    LARGEST_CHANGE,
    MAX_BIAS,
    MAX_STEADY_RATE,
    MAX_SUMMED,
    SURELY_SUMMED,
    USUAL_RATES,
    Sizes,
    axes_exchanged,
    one_sensor,
    possible_rate,
    rate_in_motion,
    same_kind,
    si_value,
    sizes_of,
    step_of,
    unit_of_step,
    units_with_gravity,
    whole_numbers,
    why_times_gravity,
)
from tuner.types.number_ranges import largest_reading
from tuner.types.records import DataError, Record

MAX_UNIT_FACTOR = 100.0
"""Factor by which a stated unit may be wrong before it is refused: logs in motion and without gravity exist."""
MIN_RANGE = 1e-15
"""Largest difference of readings, rad/s or m/s², that no sensor resolves: the best have noise of 1e-10."""
MAX_MEDIAN_RATE = 35.0
"""rad/s, 2000 deg/s: the range of consumer gyroscopes, which no log exceeds in the median."""
EARTH_TOLERANCE = 0.02
"""Relative distance of a mean rate from the Earth's up to which it is taken for it."""
ANSWER = "--assume si"
STEADY_RATIO = 20.0
"""Mean ÷ noise of accelerometers from which they show gravity of a unit at rest."""
MIN_ALIGNED = 0.95
"""Norm of the mean ÷ mean of the norm from which a unit keeps its attitude, within 18°."""


def check_units(
    source: str,
    records: Sequence[Record],
    choices: Mapping[str, UnitChoice],
    *,
    assume_si: bool = False,
    tried: bool = False,
    kinds: bool = True,
    others: Sequence[Change] = (),
    exchange: Callable[[str], Sequence[Change]] = lambda _: (),
) -> tuple[list[str], dict[str, Assumption]]:
    """Return notes on units that may be wrong, and by sensor what is to be said first of its unit.

    Parameters
    ----------
    source : str
        Name of the log.
    records : sequence of Record
        Its sensors as they are read.
    choices : mapping of str to UnitChoice
        Their units.
    assume_si : bool, optional
        Whether units that nobody states are SI.
    tried : bool, optional
        Whether this is a reading that is tried: then a unit must fit whoever states it.
    kinds : bool, optional
        Whether both sensors must have rates, or both increments.
    others : sequence of Change, optional
        Readings that are no matter of units: in which the clock has another one, or gyro and accel are exchanged.
    exchange : callable, optional
        Returns the reading in which gyro and accel exchange the axes of these letters.

    Raises
    ------
    Refusal
        A unit that the samples contradict.
    DataError
        A reading no sensor has.
    """
    notes: list[str] = []
    said: dict[str, Assumption] = {}
    sizes = {record.name: sizes_of(record) for record in records}
    for record in records:
        _check_range(source, record)
    full = {record.name: record for record in records if len(record.axes) == 3}
    if full.keys() == {"gyro", "accel"} and not assume_si and (letters := axes_exchanged(**full)):
        columns = " and ".join(f"{name}_{letter}" for letter in letters for name in ("gyro", "accel"))
        raise Refusal(
            f"{source}: {columns} may be exchanged: each has the noise of the other sensor",
            exchange(letters),
            contradicts=True,
        )
    if (text := _exchanged(full, sizes, choices)) and not assume_si:
        raise Refusal(f"{source}: {text}", others, contradicts=True)
    if tried and "accel" in full and _at_rest(sizes["accel"], full["accel"]):
        for record in full.values():
            if not one_sensor(record):
                raise Refusal(f"{source}: the noise of the axes of {record.name} is not that of one sensor")
    requested = [n for n, choice in choices.items() if choice.basis == "requested"]
    judged = sorted((r for r in records if r.name not in requested), key=lambda r: r.name)
    accel = next((r for r in judged if r.name == "accel"), None)
    at_rest = None if accel is None else _at_rest(sizes["accel"], accel)
    for record in judged:
        choice, found = choices[record.name], sizes[record.name]
        if choice.basis == "assumed" and assume_si and not tried:
            said[record.name] = Assumption(f"{record.name}: {choice.unit} assumed, as {ANSWER} says")
            continue
        judge = _Judge(source, record, found, choice, tried, tuple(others))
        unsure = choice.basis == "assumed" or (
            tried and choice.basis == "file" and choice.unit in CUSTOMARY_UNITS
        )
        if unsure and whole_numbers(record.y, si_value(choice.unit, record.interval)):
            known = [change for change in others if "t" in change.columns or change.unit]
            stated = f"in {choice.unit} is stated" if choice.basis == "file" else "nothing states their size"
            raise Refusal(f"{source}: {_COUNTS.format(record.name)}, and {stated}", (*known, *judge.counts()))
        if record.name == "accel":
            if (first := judge.accel(choices.get("gyro"))) is not None:
                said["accel"] = first
            elif found.norm < STANDARD_GRAVITY / MAX_UNIT_FACTOR and len(record.axes) == 3:
                notes.append("accel: no gravity in the log, so its unit could not be checked")
        else:
            beside = None if accel is None or not kinds else choices["accel"]
            if (taken := judge.gyro(beside, at_rest)) is not None:
                said["gyro"] = taken
    return notes, said


_COUNTS = "{} holds whole numbers, as counts do"


def _exchanged(
    full: Mapping[str, Record], sizes: Mapping[str, Sizes], choices: Mapping[str, UnitChoice]
) -> str:
    """Return what shows that gyroscopes stand where accelerometers should; "" where nothing does.

    What is gravity in another unit is no gyroscope.
    """
    if full.keys() != {"gyro", "accel"}:
        return ""
    gyro, accel = sizes["gyro"], sizes["accel"]
    if (
        WRONG_FACTOR * accel.norm > STANDARD_GRAVITY
        or gyro.mean < MAX_BIAS
        or not _at_rest(gyro, full["gyro"])
    ):
        return ""
    raw = accel.norm / si_value(choices["accel"].unit, full["accel"].interval)
    if any(
        abs(raw * unit_value(unit) / STANDARD_GRAVITY - 1.0) < GRAVITY_TOLERANCE
        for unit in UNITS["accel"]
        if unit not in INCREMENT_UNITS
    ):
        return ""
    return (
        f"accel reads {accel.norm:.3g} m/s^2 where gravity is 9.81, and gyro as steady as gravity "
        f"{np.rad2deg(gyro.mean):.3g} deg/s: the columns of gyro and accel may be exchanged"
    )


def _at_rest(found: Sizes, accel: Record) -> bool:
    """Return whether what is read as accelerometers shows a unit that keeps still: one direction, little noise.

    A vehicle on level ground keeps its direction, too, but not its mean from one second to the next.
    """
    aligned = found.mean > MIN_ALIGNED * found.norm
    steady = found.change * STANDARD_GRAVITY < LARGEST_CHANGE["m/s^2"] * found.mean
    return len(accel.axes) == 3 and found.mean > STEADY_RATIO * found.noise and aligned and steady


@dataclass(frozen=True)
class Assumption:
    """What is said first of how a log is read, and what of it the samples speak against; "" for nothing.

    `unstated` tells a unit that was taken while others fit the samples as well from one that the samples show.
    """

    text: str
    contradicted: str = ""
    unstated: bool = False


@dataclass(frozen=True)
class _Judge:
    """A sensor in the unit it is read in."""

    source: str
    record: Record
    found: Sizes
    choice: UnitChoice
    tried: bool
    others: tuple[Change, ...]

    def refusal(self, measured: str, changes: Sequence[Change]) -> Refusal:
        """Return the refusal of this reading, with what is no matter of units as the last changes."""
        stated = self.choice.basis != "assumed"
        return Refusal(f"{self.source}: {measured}", (*changes, *self.others), contradicts=stated)

    @property
    def raw(self) -> float:
        """The median norm of the accelerometers as the log has it."""
        return self.found.norm / si_value(self.choice.unit, self.record.interval)

    def counts(self) -> list[Change]:
        """Return the readings of whole numbers without a unit, all of which but gravity's their owner must state."""
        if self.record.name == "gyro":
            return [Change({"gyro": "deg/s"}, requested="gyro")]
        return [*self.by_gravity(), self.scaled()]

    def scaled(self) -> Change:
        """Return the size of a count by gravity: a power of two, if one fits."""
        power = round(math.log2(self.raw)) if self.raw > 1.0 else 0
        of_two = abs(self.raw / 2.0**power - 1.0) < GRAVITY_TOLERANCE
        return Change({"accel": "g"}, {"accel": 2.0**-power if of_two else 1.0 / self.raw})

    def by_gravity(self) -> list[Change]:
        """Return the units in which the mean is gravity."""
        return [Change({"accel": unit}) for unit in units_with_gravity(self.raw, self.record.interval)]

    def accel(self, gyro: UnitChoice | None) -> Assumption | None:
        """Return what is to be said first of the unit of accelerometers; None for nothing.

        Raises
        ------
        Refusal
            Where it is not the one in which the mean is gravity.
        """
        record, found, choice = self.record, self.found, self.choice
        ratio = found.norm / STANDARD_GRAVITY
        axes = "" if len(record.axes) == 3 else f" on {len(record.axes)} axes"
        reads = f"accel reads {found.norm:.4g} m/s^2{axes}"
        if choice.unit in INCREMENT_UNITS:
            reads += f" (increments of {self.raw:.4g} {choice.unit} ÷ {record.interval:.4g} s)"
        drifts = self.tried and found.summed > MAX_SUMMED
        fits = abs(ratio - 1.0) < GRAVITY_TOLERANCE
        fits |= self.tried and choice.unit in units_with_gravity(self.raw, record.interval)
        if fits and not drifts:
            confirmed = f"accel: {choice.unit} assumed, as its mean is gravity ({found.norm:.4g} m/s^2)"
            return Assumption(confirmed) if choice.basis == "assumed" else None
        if choice.basis == "assumed":
            raise self.refusal(
                f"{reads}, {ratio:.3g} × gravity{why_times_gravity(ratio)}, and nothing states its unit",
                self.by_gravity() or ([self.scaled()] if ratio > 1.0 and _at_rest(found, record) else []),
            )
        if len(record.axes) != 3 and not self.tried:
            return None
        still = _at_rest(found, record)
        far = max(ratio, 1.0 / ratio) if ratio > 0.0 else math.inf
        clipped = bool(np.any(np.ptp(record.y, axis=0) == 0.0))
        if (
            ratio > MAX_UNIT_FACTOR
            or (self.tried and ratio > 0.0)
            or (still and not clipped and far > WRONG_FACTOR)
        ):
            changes = [c for c in self.by_gravity() if same_kind(c.unit["accel"], choice.unit)]
            if (increment := INCREMENT_OF.get(choice.unit)) is not None and gyro is not None:
                both = {"accel": increment, "gyro": INCREMENT_OF.get(gyro.unit, "")}
                changes += [Change(both)] if both["gyro"] else []
            if whole_numbers(record.y, si_value(choice.unit, record.interval)):
                changes.append(self.scaled())
            raise self.refusal(
                f"{reads} at rest, {ratio:.3g} × gravity: the unit {choice.unit} is wrong by {far:.3g}x"
                f"{why_times_gravity(ratio)}",
                changes,
            )
        if still and not clipped:
            return Assumption(
                f"{reads} at rest in {choice.unit}, {ratio:.3g} × gravity: its unit or its scale is wrong",
                f"accel, which reads {ratio:.3g} × gravity at rest",
            )
        return None

    def gyro(self, accel: UnitChoice | None, at_rest: bool | None) -> Assumption | None:
        """Return what is to be said first of the unit of gyroscopes; None for nothing.

        `at_rest` says whether the accelerometers show a unit at rest; None where there are none.

        Raises
        ------
        Refusal
            Where noise, bias, step or the other sensor speak against it.
        """
        record, found, choice = self.record, self.found, self.choice
        interval, read_in = record.interval, choice.unit
        factor = si_value(read_in, interval)
        shown = f"{found.mean / factor:.3g} ± {found.noise / factor:.2g} {read_in}"
        if at_rest and found.summed > SURELY_SUMMED and (self.tried or choice.basis != "user"):
            first, last = (
                np.linalg.norm(record.y[part].mean(axis=0)) for part in (slice(99), slice(-99, None))
            )
            raise self.refusal(
                f"gyro goes from {first / factor:.3g} to {last / factor:.3g} {read_in} while accel keeps still: no "
                "rate of a unit at rest does",
                [],
            )
        units = [*USUAL_RATES, *(u for u in UNITS["gyro"] if u not in USUAL_RATES)]
        if accel is not None:
            units = [u for u in units if same_kind(u, accel.unit)]
        by_step = {unit_of_step(step_of(y, factor)) for y in record.y.T} - {None}
        summed = self.tried and found.summed > MAX_SUMMED
        assumed = choice.basis == "assumed" and not self.tried
        possible = [
            u for u in units if not summed and possible_rate(u, found, interval, read_in, assumed=assumed)
        ]
        stepped = [u for u in possible if by_step == {u}]
        turning = _as_the_earth(record, found, possible, read_in)
        left = stepped or sorted(possible, key=lambda unit: unit != turning)
        others = [Change({"gyro": unit}) for unit in left if unit != read_in]
        if not at_rest and "deg/s" in units and rate_in_motion(found, interval, read_in):
            when = "if the sensor moved" if at_rest is None and others else ""
            others.insert(0, Change({"gyro": "deg/s"}, when=when))
        if (
            accel is not None
            and not same_kind(read_in, accel.unit)
            and (self.tried or choice.basis == "assumed")
        ):
            kind = "an increment" if accel.unit in INCREMENT_UNITS else "a rate"
            others.sort(key=lambda change: accel.unit == "m/s^2" and change.unit["gyro"] != "rad/s")
            stated = choice.basis == "file"
            raise self.refusal(
                f"accel is in {accel.unit}, {kind}, and gyro in {read_in}", [] if stated else others
            )
        moves = at_rest is not True and self.tried and self._may_move()  # which only a trial supposes
        fits = read_in in left or moves
        if choice.basis == "assumed" or self.tried:
            why = "" if fits else f"reads {shown}, which bias and noise at rest cannot be"
            if stepped and read_in not in stepped:
                why = f"has samples at multiples of a step that gyroscopes have in {stepped[0]}"
            elif choice.basis == "assumed" and turning and turning != read_in:
                why = f"turns as the Earth does in {turning}"
            if why:
                who = "nothing states its unit" if choice.basis == "assumed" else f"{read_in} is stated"
                if assumed and at_rest is False and not (stepped or turning) and self._may_move():
                    others.insert(0, Change({"gyro": read_in}))
                    who += "; accel shows that the sensor moves, so only its owner knows the unit"
                raise self.refusal(f"gyro {why}, and {who}", others)
        elif self._absurd(lenient=choice.basis == "user" or not at_rest or read_in in possible):
            raise self.refusal(
                f"gyro reads {shown} ({np.rad2deg(found.norm):.3g} deg/s in the median), which bias and noise at rest "
                f"cannot be: the unit {read_in} is wrong",
                others,
            )
        doubted = self.tried and choice.basis == "file" and accel is not None and accel.basis == "user"
        if choice.basis != "assumed" and not doubted:
            return None
        foreign = accel is not None and accel.basis != "assumed" and accel.unit not in ("m/s^2", "m/s")
        if (foreign or doubted) and accel is not None and others and by_step != {read_in}:
            own = Change({"gyro": read_in})
            raise self.refusal(
                f"accel is in {accel.unit}, and nothing states the unit of gyro",
                [own, *others] if doubted else [*others, own],
            )
        if by_step == {read_in}:
            return Assumption(
                f"gyro: {read_in} assumed, as the step of its samples is that of gyroscopes in {read_in}"
            )
        usual = [u for u in possible if u in USUAL_RATES and u != read_in]
        ratios = {u: factor / si_value(u, interval) for u in usual[:3]}
        sizes = ", ".join(
            f"{max(ratio, 1.0 / ratio):.3g} times too {'large' if ratio > 1.0 else 'small'} for samples in {u}"
            for u, ratio in ratios.items()
        )
        if not sizes:
            return Assumption(f"gyro: {read_in} assumed, as no other unit fits its noise and bias")
        return Assumption(
            f"gyro: {read_in} assumed, as nothing states the unit ({shown}); every number of the gyro is {sizes}: "
            f"--gyro-unit {usual[0]} states another",
            unstated=True,
        )

    def _may_move(self) -> bool:
        """Return whether something that is navigated can turn so."""
        return self.found.norm < MAX_MEDIAN_RATE and self.found.mean < MAX_STEADY_RATE

    def _absurd(self, *, lenient: bool) -> bool:
        """Return whether no unit turns so: where nothing shows that it is at rest, only what nothing at all does."""
        found = self.found
        if found.white == 0.0:
            return False
        fast = found.norm > MAX_MEDIAN_RATE or (found.mean > MAX_STEADY_RATE and found.noise < found.mean)
        return (fast and len(self.record.axes) == 3) or not lenient


def _check_range(source: str, record: Record) -> None:
    """Refuse a record with readings that no sensor has: in no unit, too large in places, or too small everywhere."""
    largest = float(max(record.y.max(), -record.y.min()))
    if len(record.axes) * largest > math.sqrt(np.finfo(float).max):
        raise DataError(
            f"{source}: {record.name} reads up to {largest:.3g} {record.unit}, and no sensor does in any unit: choose "
            f"other columns, or write the samples in {record.unit}"
        )
    if 0.0 < float(np.ptp(record.y, axis=0).max()) < MIN_RANGE:
        raise DataError(
            f"{source}: {record.name} varies by {np.ptp(record.y, axis=0).max():.3g} {record.unit} in all, which no "
            f"sensor resolves: pass --{record.name}-unit or --{record.name}-scale, or choose other columns"
        )
    limit = largest_reading(record.unit)
    if largest > limit > np.median(np.abs(record.y[:CHECKED_SAMPLES]).max(axis=1)):
        first = int(np.argmax(np.abs(record.y).max(axis=1)))
        raise DataError(
            f"{source}: {record.name} reads {np.abs(record.y[first]).max():.3g} {record.unit} in sample {first + 1}, "
            "which no sensor does: take a broken row out or write NaN; else its unit or its scale is wrong"
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
