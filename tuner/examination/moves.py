"""Faults of a whole stream, each with what undoes it; the likelihood says which is wanted, and for which part."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from itertools import permutations, product
from typing import Literal

import numpy as np
from scipy.integrate import cumulative_trapezoid

from models import rotation
from models.arrays import FloatArray
from models.earth import metres_per_radian
from models.units import FOOT, unit_value
from tuner.examination.streams import HorizontalVelocities, Positions, Stream, Streams, Velocities
from tuner.examination.windows import ACCEL_BIAS, GYRO_BIAS, TURN, WINDOW_LENGTH, Motion
from tuner.formats.clock_words import late_words
from tuner.types.clock import HALF_INTERVAL, Clock, Delay
from tuner.types.repair import Repair

AXES = "xyz"
LEVER_ARM = "lever arm"
RECEIVER = "receiver"
CLOCK_OF_UNIT = "clock of the inertial unit"
TRIADS = {"gyro": slice(0, 3), "accelerometer": slice(3, 6), "inertial unit": slice(0, 6)}
"""Columns of the samples that have one fault."""
LARGEST_COURSE = 360.01
"""Course beyond which there is none, deg, as it is rounded."""
LARGEST_PLACE = np.array([0.5 * np.pi, 2.0 * np.pi])
"""Latitude and longitude beyond which there are none, rad."""
STATED_ODDS = 1000.0
"""Odds of what a file states of its units, axes and clocks."""
DELAYS = (-2.0, -1.0, -0.5, -0.25, 0.25, 0.5, 1.0, 2.0)
"""Delays from which the search begins, s."""
Change = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Move(Repair):
    """A fault of a stream that the likelihood may want, and what undoes it.

    Attributes
    ----------
    mended : callable
        Returns the streams without the fault.
    kind : str
        ``reading``: how numbers are read (unit, sign, axes); ``constant``: of the installation, estimated with the
        others; ``event``: at one time.
    partial : bool
        Whether the fault can hold for a part of a drive.
    subject : str
        What of the stream it is about, where a recording may be unable to show it.
    rival : Move or None
        The next explanation, where it is wanted as well.
    """

    mended: Callable[[Streams], Streams] = lambda streams: streams
    kind: Literal["reading", "constant", "event"] = "reading"
    partial: bool = False
    subject: str = ""
    rival: Move | None = None

    @property
    def whole(self) -> bool:
        """Whether it is one of the whole drive."""
        return self.begin is None and self.end is None

    @property
    def repair(self) -> Repair:
        """What of it a report needs."""
        return Repair(**{one.name: getattr(self, one.name) for one in fields(Repair)})


class BodyVelocities(Velocities):
    """Velocities in the axes of the unit, m/s."""

    def seen(self, motion: Motion) -> tuple[FloatArray, FloatArray]:
        """Return the velocity in the axes of the unit and its derivatives."""
        back, across = motion.attitude.swapaxes(-1, -2), rotation.skew(motion.velocity)
        by = motion.by_velocity.copy()
        by[..., TURN] += across
        by[..., GYRO_BIAS] += (
            across @ motion.by_velocity[..., ACCEL_BIAS]
        )  # as ∫R turns forces, it turns axes
        return (back @ motion.velocity[..., None])[..., 0], back @ by


def moves(streams: Streams) -> Iterator[Move]:
    """Return every fault that is tried, of the streams that are there."""
    yield from _inertial_moves(streams.imu.interval)
    degrees, heights = times(180.0 / np.pi, 180.0 / np.pi, 1.0), "sign of the heights"
    for fault, done, change, subject in (
        ("have latitude and longitude exchanged", "exchanged back", _linear(np.eye(3)[[1, 0, 2]]), ""),
        ("have heights with the wrong sign", "heights multiplied by −1", times(1.0, 1.0, -1.0), heights),
        ("are in rad, read as degrees", "latitude and longitude in degrees", degrees, ""),
        ("have heights in ft, read as m", f"heights multiplied by {FOOT}", times(1.0, 1.0, FOOT), ""),
    ):
        found = of_values("fixes", fault, done, change, subject)
        places = np.abs(found.mended(streams).positions.values[:, :2])
        if np.all(np.nanmax(places, axis=0) <= LARGEST_PLACE):
            yield replace(found, partial=False)  # of a part it would be a step of the positions as well
    for one in streams.others:
        if isinstance(one, Velocities):
            yield from _velocity_moves(one, whole=not isinstance(one, HorizontalVelocities))
            if one.readings.sum() > 1:
                yield _turned(one, streams.positions)
    for delay in DELAYS:
        yield of_clock(None, Clock(Delay(delay)))
        for one in streams.others:
            yield of_clock(one.name, Clock(Delay(delay)))


def _inertial_moves(interval: float) -> Iterator[Move]:
    """Return faults of the samples of a unit, whose interval is given, s."""
    for name in ("gyro", "accelerometer"):
        for i, axis in enumerate(AXES):
            signs = times(*(-1.0 if i == j else 1.0 for j in range(3)))
            done, subject = f"{axis} multiplied by −1", f"sign of {name} {axis}"
            yield of_values(name, f"{axis} has the wrong sign", done, signs, subject)
    # but for the name as it is and the sign of one axis
    turns = (
        np.eye(3)[list(order)] * np.array(signs)[:, None]
        for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3))
        if order != (0, 1, 2) or signs.count(-1.0) > 1
    )
    for turn in turns:
        words = ", ".join(
            f"{axis} is {'−' * bool(row.min() < 0.0)}{AXES[int(np.argmax(np.abs(row)))]}"
            for axis, row in zip(AXES, turn, strict=True)
            if row[AXES.index(axis)] != 1.0
        )
        fault = f"has its axes exchanged against the accelerometer: its {words}"
        yield of_values("gyro", fault, "its axes named anew", _linear(turn.T))
    for name, fault, done, subject in (
        (
            "accelerometer",
            "has the sign of gravity, not of the specific force",
            "multiplied by −1",
            "sign of the accelerometer",
        ),
        (
            "inertial unit",
            "has left-handed axes",
            "gyro and accelerometer multiplied by −1",
            "handedness of the axes",
        ),
    ):
        yield of_values(name, fault, done, times(-1.0), subject)
    for name, gained, read_as, others in (
        ("gyro", "rad in", "rad/s", ("deg/s", "mrad/s", "mdeg/s")),
        ("accelerometer", "m/s gained in", "m/s²", ("g", "mg", "ft/s²")),
    ):
        units = {unit: unit_value(unit) for unit in others}
        yield from _units(name, "is", read_as, {**units, f"{gained} {interval:.4g} s": 1.0 / interval})
        yield from _units(name, "is", others[0], {read_as: 1.0 / unit_value(others[0])})


def _units(name: str, verb: str, read_as: str, units: Mapping[str, float]) -> Iterator[Move]:
    """Return that a stream is in each of some units, of which each is so many of the one that it is read as."""
    for unit, factor in units.items():
        yield of_values(
            name, f"{verb} in {unit}, read as {read_as}", f"multiplied by {factor:.6g}", times(factor)
        )


def _velocity_moves(stream: Velocities, *, whole: bool) -> Iterator[Move]:
    """Return faults of velocities, whole ones or horizontal ones alone."""
    name, up = stream.name, times(1.0, 1.0, -1.0)
    units = {"knots": "kn", **{unit: unit for unit in ("km/h", "mph", "ft/s", "cm/s", "mm/s")}}
    yield from _units(name, "are", "m/s", {word: unit_value(unit) for word, unit in units.items()})
    for unit, one in (("", 1.0), (" in rad", 180.0 / np.pi)):
        course = _from_course(one)
        if one * np.nanmax(np.abs(stream.values[:, 1])) <= LARGEST_COURSE:
            yield of_values(name, f"are speed and course{unit}", "turned into north and east", course)
    north_east_down = _linear(np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]))
    third, its_third = (", up", ", down") if whole else ("", "")
    order = f"put in the order north, east{its_third}"
    yield of_values(name, f"are east, north{third}", order, north_east_down)
    if not whole:
        return
    wrong, subject = (
        "have the wrong vertical sign: they point up, not down",
        "vertical sign of the velocities",
    )
    yield of_values(name, wrong, "third component multiplied by −1", up, subject)
    yield Move(
        name,
        "are in the axes of the unit, not north, east, down",
        "",
        mended=lambda s: s.changed(
            lambda x: BodyVelocities(x.t, x.values, x.sd, x.name, x.arm, x.log_scale), name
        ),
    )


def _turned(stream: Velocities, positions: Positions) -> Move:
    """Return that velocities are turned about the vertical, by the angle to the ways of the positions in windows."""
    places, speeds = positions.values[positions.readings], stream.values[stream.readings]
    t, its = positions.t[positions.readings], stream.t[stream.readings]
    ends = np.arange(t[1], t[-1], WINDOW_LENGTH)
    there, gone = (
        np.column_stack([np.interp(ends, stamps, x) for x in values.T])
        for stamps, values in ((t, places), (its, cumulative_trapezoid(speeds, its, axis=0, initial=0)))
    )
    moved = np.diff(there, axis=0) * metres_per_radian(there[1:])
    way, its_way = (x[:, 0] + 1j * x[:, 1] for x in (moved, np.diff(gone, axis=0)))
    product = its_way * way.conj()
    angle = float(np.angle(product.sum()))
    scatter = np.linalg.norm((product * np.exp(-1j * angle)).imag) / max(abs(product.sum()), 1e-9)
    size, half = abs(math.degrees(angle)), HALF_INTERVAL * math.degrees(float(scatter))
    low, high = max(size - half, 0.0), size + half
    turn = rotation.mat_from_rotvec(np.array([0.0, 0.0, -angle]))
    way_round = "clockwise" if angle > 0.0 else "anticlockwise"
    fault = f"are turned {way_round} by {size:.1f} deg ({low:.1f} to {high:.1f}), seen from above"
    found = of_values(stream.name, fault, "turned back", _linear(turn))
    return replace(found, size=size, interval=(low, high), unit="deg")


def _linear(matrix: FloatArray) -> Change:
    return lambda x: x @ matrix.T


def times(*factors: float) -> Change:
    """Return what multiplies components by factors."""
    return lambda x: x * np.array(factors)


def _from_course(unit: float) -> Change:
    """Return what turns speed and course into north and east; the unit of the course is so many degrees."""

    def change(x: FloatArray) -> FloatArray:
        course = np.radians(unit * x[:, 1])
        return np.column_stack([x[:, 0] * np.cos(course), x[:, 0] * np.sin(course), x[:, 2]])

    return change


def of_values(name: str, fault: str, repair: str, change: Change, subject: str = "") -> Move:
    """Return a fault of the values of a stream, or of a triad of the inertial unit, that a function undoes."""

    def mended(streams: Streams) -> Streams:
        part = TRIADS.get(name)
        if part is None:
            return streams.changed(lambda x: _changed(x, change), name)
        rates = streams.imu.rates.copy()
        rates[:, part] = change(rates[:, part])
        return replace(streams, imu=replace(streams.imu, rates=rates))

    return Move(name, fault, repair, mended=mended, partial=True, subject=subject)


def _changed(stream: Stream, change: Change) -> Stream:
    """Return a stream after a change of triples; of pairs the third number is zero."""
    d, step = stream.values.shape[1], 1e-6
    triples = np.pad(stream.values, ((0, 0), (0, 3 - d)))
    columns = [
        (change(triples + step * one) - change(triples - step * one))[:, :d] / (2.0 * step)
        for one in np.eye(3)[:d]
    ]
    size = np.abs(np.linalg.det(np.nan_to_num(np.stack(columns, axis=-1))))  # Jacobian, by differences
    return stream.with_values(change(triples)[:, :d], np.log(np.maximum(size, 1e-12)))


def of_clock(stream: str | None, clock: Clock) -> Move:
    """Return what puts a stream, or all of them against the inertial unit, on the right clock."""
    drifts, drift, middle = clock.drift.certain, clock.drift.value, 0.5 * sum(clock.ends)
    delay = clock.delay.taken_out if drifts else clock.delay.value

    def mended(streams: Streams) -> Streams:
        return streams.changed(lambda x: x.later(-delay, -drift, middle), stream)

    whose, is_are, its = (RECEIVER, "is", "its") if stream is None else (stream, "are", "their")
    amount, word, interval = abs(delay), "late" if delay > 0.0 else "early", None
    shown, moved = f"{word} by {amount:.2f} s", f"{-delay:+.3f} s"
    if drifts:
        shown, moved = late_words(clock), " to ".join(f"{-one.value:+.3f} s" for one in clock.delays.values())
    elif math.isfinite(clock.delay.sd):
        half = HALF_INTERVAL * clock.delay.sd
        interval = amount - half, amount + half
        shown = f"{word} by {amount:.3f} s ({interval[0]:.3f} to {interval[1]:.3f})"
    return Move(
        whose,
        f"{is_are} {shown} against the {'inertial unit' if stream is None else 'positions'}",
        f"{its} stamps moved by {moved}",
        size=None if drifts else amount,
        interval=interval,
        unit="s",
        mended=mended,
        kind="constant",
        subject=f"delay of the {whose}",
    )


def jumped(begin: float, ahead: float) -> Move:
    """Return that stamps of the inertial unit jump ahead by a time at another, s, without a sample lost."""
    return Move(
        CLOCK_OF_UNIT,
        f"jumps ahead by {ahead:.3f} s at {begin:.1f} s: no sample is lost there",
        f"stamps of the receiver behind it moved by {ahead:+.3f} s",
        size=ahead,
        unit="s",
        mended=lambda s: s.changed(lambda x: replace(x, t=x.t + np.where(x.t > begin, ahead, 0.0))),
        kind="event",
    )


def arm_of(arm: FloatArray, sd: FloatArray) -> Move:
    """Return the lever arm of all streams of a receiver, in the axes of the inertial unit, m, with its sds."""
    x, y, z = (float(value) for value in arm)
    halves = HALF_INTERVAL * sd
    shown = ", ".join(f"{axis} {a:+.2f} ±{h:.2f}" for axis, a, h in zip(AXES, arm, halves, strict=True))
    size, half = float(np.linalg.norm(arm)), float(np.linalg.norm(halves))
    return Move(
        "antenna",
        f"is {size:.2f} m from the inertial unit: {shown} m in its axes (95 %)",
        "",
        size=size,
        interval=(max(size - half, 0.0), size + half),
        unit="m",
        mended=lambda streams: streams.changed(lambda one: replace(one, arm=(x, y, z))),
        kind="constant",
        subject=LEVER_ARM,
    )
