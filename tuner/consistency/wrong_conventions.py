"""Is an output in other axes or units than it was taken in? Errors that another convention explains are no errors.

Each usual convention is tried on positions, velocities and attitudes. One that brings them several times nearer to the
truth, or velocities to the change of the positions, cannot be chance: the output is refused with what to do.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.earth import ned_between
from models.units import unit_value
from tuner.readers.axes_letters import BODY_LETTERS, WORLD_LETTERS, axes_rotation
from tuner.types.filter_output import FilterOutput, TakenAxes
from tuner.types.records import DataError

MIN_IMPROVEMENT = 5.0
"""Rms error as taken ÷ in another convention, from which that is refused: of wrong ones it is tens to thousands, and of
right ones below 1, as all of these conventions move a vehicle by far more than a filter errs."""
MIN_ROWS = 20
"""Epochs from which conventions are compared."""
WORLDS = ("NED", "ENU", "NWU")
"""Usual axes of the world."""
BODIES = ("FRD", "FLU", "RFU")
"""Usual axes of the body."""
SPEEDS = ("km/h", "kn", "mph", "ft/s", "cm/s")
"""Other units of velocities."""


def refuse_wrong_conventions(estimate: FilterOutput, truth: FilterOutput) -> None:
    """Raise a DataError in one line where another convention explains the errors of an estimate.

    Parameters
    ----------
    estimate, truth : FilterOutput
        At the same times, in one frame.
    """
    place, other = _place(estimate, estimate), _place(truth, estimate)
    if place is not None and other is not None:
        _tell(estimate, "positions", _about_mean(place - other), _positions(estimate, truth, place, other))
    for one, option in ((estimate, "--frame"), (truth, "--truth-frame")):
        place = _place(one, one)
        if place is not None and np.isfinite(one.vel_n).any():
            moved = np.gradient(place, one.t, axis=0)
            _tell_velocities(one, moved, option, "their own positions")
    _tell_velocities(estimate, truth.vel_n, "--frame", "the truth")
    _tell(estimate, "attitudes", _turns(estimate.quat_nb, truth.quat_nb), _attitudes(estimate, truth.quat_nb))


def _tell_velocities(one: FilterOutput, want: FloatArray, option: str, beside: str) -> None:
    """Raise where another convention brings velocities far nearer to those that are wanted, m/s, and near to them."""
    _tell(one, "velocities", one.vel_n - want, _velocities(one, want, option), beside, want)


def _tell(
    one: FilterOutput,
    what: str,
    error: FloatArray,
    others: Iterator[tuple[str, str, FloatArray]],
    beside: str = "the truth",
    size: FloatArray | None = None,
) -> None:
    """Raise where another convention leaves far less of the error, and little of `size` where that is given."""
    good = np.isfinite(error).all(axis=1)
    if np.count_nonzero(good) < MIN_ROWS:
        return
    before = float(np.sqrt(np.mean(error[good] ** 2)))
    best = min(
        ((float(np.sqrt(np.mean(e[good] ** 2))), words, cure) for words, cure, e in others), default=None
    )
    if best is None or not before > MIN_IMPROVEMENT * best[0]:
        return
    # Noise of a vehicle at rest fits better in any smaller unit.
    if size is not None and not np.sqrt(np.mean(size[good] ** 2)) > MIN_IMPROVEMENT * best[0]:
        return
    after, words, cure = best
    times = min(before / after, 1e6) if after > 0.0 else 1e6
    unit = {"positions": "m", "velocities": "m/s", "attitudes": "rad"}[what]
    raise DataError(
        f"{one.name}: {what} fit {beside} {times:.3g} times better {words} than as they were taken (rms error "
        f"{before:.3g} and {after:.3g} {unit}): {cure}"
    )


def _place(one: FilterOutput, origin: FilterOutput) -> FloatArray | None:
    """Return positions in metres north, east, down."""
    if one.llh is not None and origin.llh is not None:
        return ned_between(one.llh, origin.llh[np.flatnonzero(np.isfinite(origin.llh).all(axis=1))[0]])
    return one.local if origin.llh is None else None


def _about_mean(error: FloatArray) -> FloatArray:
    """Return errors less their mean: another origin or datum is no other convention."""
    return np.asarray(error - np.nanmean(error, axis=0)) if np.isfinite(error).any() else error


def _positions(
    estimate: FilterOutput, truth: FilterOutput, place: FloatArray, other: FloatArray
) -> Iterator[tuple[str, str, FloatArray]]:
    if estimate.llh is None or truth.llh is None:
        axes = [
            *_axes(estimate.axes.positions, "x, y, z with --frame", "d"),
            ("with n and e exchanged", "exchange n and e", np.eye(3)[[1, 0, 2]]),
        ]
        yield from ((words, cure, _about_mean(place @ mat.T - other)) for words, cure, mat in axes)
        return
    degrees = np.degrees(estimate.llh[:, :2])
    for words, cure, pair in (
        ("with latitude and longitude in rad", "name the columns 'lat [rad]', 'lon [rad]'", degrees),
        ("with latitude and longitude exchanged", "exchange lat and lon", estimate.llh[:, 1::-1]),
    ):
        if np.abs(pair[:, 0]).max() < 0.5 * np.pi:
            llh = np.column_stack([pair, estimate.llh[:, 2]])
            yield words, cure, _about_mean(ned_between(llh, truth.llh))


def _velocities(one: FilterOutput, want: FloatArray, option: str) -> Iterator[tuple[str, str, FloatArray]]:
    units = [
        (f"in {unit}", f"name the columns 'vn [{unit}]', …", unit_value(unit) * np.eye(3)) for unit in SPEEDS
    ]
    axes = [*_axes(one.axes.velocities, f"vx, vy, vz with {option}", "vd"), *units]
    yield from ((words, cure, one.vel_n @ mat.T - want) for words, cure, mat in axes)
    if np.isfinite(one.quat_nb).all():
        turned = np.einsum("nij,nj->ni", rotation.mat_from_quat(one.quat_nb), one.vel_n)
        yield "along the axes of the body", "turn them into axes of the world", turned - want


def _attitudes(one: FilterOutput, want: FloatArray) -> Iterator[tuple[str, str, FloatArray]]:
    q = one.quat_nb
    if not np.isfinite(q).any():
        return
    yield (
        "as world to body",
        "write body to world: change the signs of qx, qy, qz",
        _turns(rotation.quat_conjugate(q), want),
    )
    for order in ([1, 2, 3, 0], [3, 0, 1, 2]):
        for sign, words in ((1.0, "in another order of the quaternion"), (-1.0, "of JPL's order and sense")):
            other = q[:, order] * [1.0, sign, sign, sign]
            yield words, "name the columns qw, qx, qy, qz as Hamilton's, body to world", _turns(other, want)
    angles = rotation.rpy_from_quat(np.where(np.isfinite(q), q, [1.0, 0.0, 0.0, 0.0]))
    yield (
        "in rad",
        "name the columns 'roll [rad]', 'pitch [rad]', 'yaw [rad]'",
        _turns(rotation.quat_from_rpy(np.degrees(angles)), want),
    )
    mat = rotation.mat_from_quat(q)
    mat = np.where(np.isfinite(mat), mat, np.eye(3))
    taken = one.axes
    before = taken.attitudes or "NED"
    from_frd = axes_rotation(taken.body, BODY_LETTERS, option="--body")
    for (world, to_ned), body in itertools.product([(before, np.eye(3)), *_worlds(before)], BODIES):
        if (world, body) != (before, taken.body):
            to_frd = axes_rotation(body, BODY_LETTERS, option="--body")
            other = rotation.quat_from_mat(to_ned @ mat @ from_frd @ to_frd.T)
            yield f"as {body} to {world}", _frames_cure(taken, world, body), _turns(other, want)


def _axes(taken: str, columns: str, down: str) -> list[tuple[str, str, FloatArray]]:
    """Return other axes of the world in words, with what to do and the matrix that changes to them."""
    named = [(f"as {name}", f"name the columns {columns} {name}", mat) for name, mat in _worlds(taken)]
    return [*named, (f"with {down} upwards", f"change the sign of {down}", np.diag([1.0, 1.0, -1.0]))]


def _worlds(taken: str) -> Iterator[tuple[str, FloatArray]]:
    """Yield other axes of the world than those a file was read in, each with the rotation that changes to them."""
    back = axes_rotation(taken, WORLD_LETTERS, option="--frame").T
    for name in WORLDS:
        if name != taken:
            yield name, axes_rotation(name, WORLD_LETTERS, option="--frame") @ back


def _frames_cure(taken: TakenAxes, world: str, body: str) -> str:
    """Return the options with which attitudes are taken in other axes, and those that they replace."""
    if taken.attitudes is None:  # --frame turns no angles
        turned = "" if world == "NED" else "turn the attitudes to NED axes"
        bodies = "" if body == taken.body else f"pass --body {body}"
        bodies += f", not {taken.body}" if bodies and taken.body != "FRD" else ""
        return " and ".join(part for part in (turned, bodies) if part)
    options = f"--frame {world} --body {body}"
    if (taken.attitudes, taken.body) == ("NED", "FRD"):
        return f"add {options}"
    return f"pass {options}, not {taken.attitudes} and {taken.body}"


def _turns(q: FloatArray, want: FloatArray) -> FloatArray:
    return rotation.rotvec_from_quat(rotation.quat_multiply(want, rotation.quat_conjugate(q)))
