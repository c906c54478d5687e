"""Columns of a filter's output, by name and unit, put into SI and into our frames.

===================================================  ===================================================
t                                                    s
lat, lon, height | n, e, d | x, y, z                 deg, deg, m | m | m in the axes of `frame`
vn, ve, vd | vx, vy, vz                              m/s; the latter in the axes of `frame`
roll, pitch, yaw | qw, qx, qy, qz                    deg | body to world
bg_x … bg_z, ba_x … ba_z                             rad/s, m/s²
sd_NAME, cov_NAME_NAME                               of any of these, of n, e, d beside lat, lon, height, and of
                                                     phi_n, phi_e, phi_d (rotation vector, deg)
z_n … z_d, z_vn … z_vd                               innovations, m, m/s; sd_ and cov_ are those of S
outage                                               1 where fixes are withheld
===================================================  ===================================================

A unit may follow in brackets: ``sd_roll [rad]``, ``cov_n_e [m^2]``. Without it an sd has the unit of its column.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.earth import llh_from_ecef, mat_en, metres_per_radian
from models.units import unit_value
from tuner.readers.axes_letters import BODY_LETTERS, WORLD_LETTERS, axes_rotation
from tuner.readers.estimate_column_names import (
    QUATERNION,
    SPREADS,
    TRIPLES,
    UNITS,
    column_unit,
)
from tuner.readers.estimate_spreads import Spread, stated_spread
from tuner.readers.text import read_numbers
from tuner.readers.text_dialect import Dialect
from tuner.types.filter_output import FilterOutput, TakenAxes, filter_output
from tuner.types.records import DataError

ANGLE_ROUNDING = 1e-3
"""Relative excess of a pitch over 90° that rounding may leave."""
MAX_DENSE_ROWS = 20_000
"""Rows with covariances that are all kept: 36 MB."""
THINNED_INTERVAL = 0.1
"""Time between rows of more than that, s: errors of a filter change little in it."""


Columns = Mapping[str, tuple[FloatArray, str | None]]
"""Values, shape (n,), and unit as it is stated, by canonical name."""
Places = Mapping[str, tuple[int, str | None]]
"""Place in a text, from 0 on, and unit, by canonical name."""


@dataclass(frozen=True)
class Frames:
    """Axes of the world and of the body, by letters, as they are stated; None where the form of the file says them.

    Without both, those of the world are unknown, and those of the body forward, right, down.
    """

    world: str | None = None
    body: str | None = None


@dataclass(frozen=True)
class _Part:
    """Three states, from the number `first` on, as a linear function of named columns: Jacobian of shape (n, 3, k)."""

    first: int
    jacobian: FloatArray
    names: tuple[str, ...]


def read_columns(path: Path, dialect: Dialect, places: Places) -> Columns:
    """Read columns of a text file."""
    (numbers,) = read_numbers(path, dialect, [[place for place, _ in places.values()]])
    return {name: (numbers[:, j], unit) for j, (name, (_, unit)) in enumerate(places.items())}


def assemble(
    source: str,
    columns: Columns,
    frames: Frames,
    *,
    notes: tuple[str, ...] = (),
) -> FilterOutput:
    """Return the filter output of named columns.

    Parameters
    ----------
    source : str
        The file, for messages.
    columns : mapping of str to (ndarray, str or None)
        `Columns`.
    frames : Frames
        Axes that the names do not state.

    Raises
    ------
    DataError
        A unit, a frame or columns that cannot be used, in one line.
    """
    messages = list(notes)
    columns = _thinned(columns, messages)
    units = {
        name: column_unit(source, name, stated) for name, (_, stated) in columns.items() if name in UNITS
    }
    values = {name: unit_value(units[name]) * columns[name][0] for name in units}
    if "t" not in values:
        raise DataError(
            f"{source}: expected a column t, s, found {', '.join(columns) or 'none that is known'}"
        )
    spread = stated_spread(source, columns, units, values, messages)
    n = len(values["t"])
    triples = {key: _triple(source, values, key) for key in ("llh", "ned", "xyz", "vned", "vxyz", "rpy")}
    llh, local, xyz, vel_n, vel_w, rpy = triples.values()
    if llh is not None and not (np.nanmax(np.abs(llh[:, 0])) < 1.6):
        raise DataError(
            f"{source}: expected latitudes within ±90 deg, found {np.degrees(np.nanmax(np.abs(llh[:, 0]))):.5g} deg"
        )
    letters_of_body = frames.body or "FRD"
    mat_bf = axes_rotation(letters_of_body, BODY_LETTERS, option="--body")
    letters, mat_nw, of_ecef = _world(source, frames, xyz, vel_w, quaternions="qw" in values, n=n)
    if of_ecef is not None:
        llh = of_ecef
    elif xyz is not None and llh is None:
        local = xyz @ mat_nw[0].T
    if vel_w is not None:
        vel_n = np.einsum("nij,nj->ni", mat_nw, vel_w)
    eye = np.asarray(np.broadcast_to(np.eye(3), (n, 3, 3)))
    parts: list[_Part] = []
    if llh is not None and {"sd_lat", "cov_lat_lat"} & columns.keys():
        size = metres_per_radian(llh)
        parts.append(_Part(0, np.einsum("ni,ij->nij", size, np.eye(3)), ("lat", "lon", "height")))
    parts += [_Part(0, eye, ("n", "e", "d")), _Part(0, mat_nw, ("x", "y", "z"))]
    parts += [_Part(3, eye, ("vn", "ve", "vd")), _Part(3, mat_nw, ("vx", "vy", "vz"))]
    attitude = _attitude(source, values, rpy, mat_nw, mat_bf)
    if attitude is not None:
        parts += attitude[1]
    parts.append(_Part(6, eye, ("phi_n", "phi_e", "phi_d")))
    body = np.asarray(np.broadcast_to(mat_bf, (n, 3, 3)))
    bias = np.full((n, 6), np.nan)
    for i, key in enumerate(("bg", "ba")):
        own = _triple(source, values, key)
        if own is not None:
            bias[:, 3 * i : 3 * i + 3] = own @ mat_bf.T
            parts.append(_Part(9 + 3 * i, body, TRIPLES[key][0]))
    cov = np.full((n, 15, 15), np.nan)
    correlated = spread is not None and _transform(cov, spread, parts)
    innovation, s = _innovations(n, _triple(source, values, "z"), _triple(source, values, "zv"), spread)
    return filter_output(
        source,
        values["t"],
        llh=llh,
        local=None if llh is not None else local,
        vel_n=vel_n,
        quat_nb=None if attitude is None else attitude[0],
        bias=bias,
        covariance=cov,
        correlated=correlated,
        innovation=innovation,
        innovation_covariance=s,
        outages=_outages(values),
        notes=tuple(messages),
        axes=TakenAxes(
            letters if xyz is not None and llh is None else "NED",
            letters if vel_w is not None else "NED",
            None if rpy is not None or of_ecef is not None else letters,
            letters_of_body.strip().upper(),
        ),
    )


def _triple(source: str, values: Mapping[str, FloatArray], key: str) -> FloatArray | None:
    """Return three columns that belong together, shape (n, 3); None where there is none of them."""
    names = TRIPLES[key][0]
    missing = [name for name in names if name not in values]
    if len(missing) == len(names):
        return None
    if missing:
        raise DataError(
            f"{source}: expected the columns {', '.join(names)} together, {', '.join(missing)} missing"
        )
    return np.column_stack([values[name] for name in names])


def _world(
    source: str,
    frames: Frames,
    xyz: FloatArray | None,
    velocity: FloatArray | None,
    *,
    quaternions: bool,
    n: int,
) -> tuple[str, FloatArray, FloatArray | None]:
    """Return the axes of x, y, z, vx, vy, vz and of quaternions: north, east, down where nothing needs them.

    Returns
    -------
    letters : str
        Names of the axes.
    mat_nw : ndarray, shape (n, 3, 3)
        Their rotation to north, east, down.
    llh : ndarray, shape (n, 3), or None
        Positions that were ECEF: latitude and longitude, rad, height, m.
    """
    if xyz is None and velocity is None and (frames.world is None or not quaternions):
        return "NED", np.asarray(np.broadcast_to(np.eye(3), (n, 3, 3))), None
    if frames.world is None:
        which = "x, y, z" if xyz is not None else "vx, vy, vz"
        raise DataError(f"{source}: the columns {which} need their axes: --frame ENU, NED, ECEF or others")
    letters = frames.world.strip().upper()
    if letters != "ECEF":
        mat = axes_rotation(frames.world, WORLD_LETTERS, option="--frame")
        return letters, np.asarray(np.broadcast_to(mat, (n, 3, 3))), None
    if xyz is None:
        raise DataError(f"{source}: --frame ECEF: expected the columns x, y, z, found none")
    llh = llh_from_ecef(xyz)
    return "NED", np.swapaxes(mat_en(llh[:, 0], llh[:, 1]), -1, -2), llh


def _attitude(
    source: str,
    values: Mapping[str, FloatArray],
    rpy: FloatArray | None,
    mat_nw: FloatArray,
    mat_bf: FloatArray,
) -> tuple[FloatArray, list[_Part]] | None:
    """Return the attitude, shape (n, 4), by angles or else by quaternions, and what its covariance may be of."""
    if rpy is not None:
        if np.nanmax(np.abs(rpy[:, 1])) > 0.5 * np.pi * (1.0 + ANGLE_ROUNDING):
            worst = math.degrees(float(np.nanmax(np.abs(rpy[:, 1]))))
            raise DataError(
                f"{source}: expected a pitch within ±90 deg, found {worst:.4g} deg: state the unit of its column"
            )
        quat = rotation.quat_from_mat(rotation.mat_from_rpy(rpy) @ mat_bf.T)
        return quat, [_Part(6, rotvec_of_angles(rpy), ("roll", "pitch", "yaw"))]
    if any(name not in values for name in QUATERNION):
        return None
    q = np.column_stack([values[name] for name in QUATERNION])
    length = np.linalg.norm(q, axis=1, keepdims=True)
    if not np.nanmax(np.abs(length - 1.0)) < 0.05:
        raise DataError(
            f"{source}: expected unit quaternions in qw, qx, qy, qz, found lengths up to {np.nanmax(length):.3g}"
        )
    q = q / length
    quat = rotation.quat_from_mat(mat_nw @ rotation.mat_from_quat(q) @ mat_bf.T)
    angles = rotvec_of_angles(rotation.rpy_from_quat(quat))
    return quat, [
        _Part(6, mat_nw @ _rotvec_of_quaternion(q), QUATERNION),
        _Part(6, angles, ("roll", "pitch", "yaw")),
    ]


def _thinned(columns: Columns, notes: list[str]) -> Columns:
    """Return the rows some way apart in time, and all with innovations, where there are many with covariances."""
    if "t" not in columns or not any(name in SPREADS for name in columns):
        return columns
    t, unit = columns["t"]
    seconds = t * unit_value(column_unit("", "t", unit))
    if len(t) <= MAX_DENSE_ROWS or not np.isfinite(seconds).all():
        return columns
    number = np.floor((seconds - seconds[0]) / THINNED_INTERVAL + 1e-6)
    keep = np.concatenate([[True], np.diff(number) != 0.0])
    for name in ("z_n", "z_vn"):
        if name in columns:
            keep |= np.isfinite(columns[name][0])
    notes.append(f"{np.count_nonzero(keep)} of {len(t)} rows used, {THINNED_INTERVAL:g} s apart")
    return {name: (values[keep], unit) for name, (values, unit) in columns.items()}


def rotvec_of_angles(rpy: FloatArray) -> FloatArray:
    """Return d(rotation vector about north, east, down)/d(roll, pitch, yaw), shape (n, 3, 3)."""
    _, pitch, yaw = rpy.T
    zero, one = np.zeros(len(rpy)), np.ones(len(rpy))
    roll_axis = np.stack([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), -np.sin(pitch)], axis=-1)
    pitch_axis = np.stack([-np.sin(yaw), np.cos(yaw), zero], axis=-1)
    yaw_axis = np.stack([zero, zero, one], axis=-1)
    return np.stack([roll_axis, pitch_axis, yaw_axis], axis=-1)


def _rotvec_of_quaternion(q: FloatArray) -> FloatArray:
    """Return d(rotation vector)/d(q) = 2 (δq q*)ᵥ, shape (n, 3, 4)."""
    w, x, y, z = q.T
    return 2.0 * np.stack(
        [
            np.stack([-x, w, -z, y], axis=-1),
            np.stack([-y, z, w, -x], axis=-1),
            np.stack([-z, -y, x, w], axis=-1),
        ],
        axis=-2,
    )


def _transform(cov: FloatArray, spread: Spread, parts: list[_Part]) -> bool:
    """Fill the covariance of the states from that of the columns; return whether off-diagonal entries are known."""
    chosen: dict[int, _Part] = {}
    for part in parts:
        if all(name in spread.names for name in part.names):
            chosen.setdefault(part.first, part)
    given = any(np.isfinite(spread.of(part.names)[:, 0, 1]).any() for part in chosen.values())
    for a, of_a in chosen.items():
        for b, of_b in chosen.items():
            at_a, at_b = ([spread.names.index(n) for n in part.names] for part in (of_a, of_b))
            block = spread.mat[:, at_a][:, :, at_b]
            if a == b:
                diagonal = np.isfinite(np.einsum("nii->ni", block)).all(axis=1)
                block = np.where(np.isfinite(block), block, 0.0)
                block[~diagonal] = np.nan
            else:
                block = np.where(np.isfinite(block), block, 0.0)
            cov[:, a : a + 3, b : b + 3] = of_a.jacobian @ block @ np.swapaxes(of_b.jacobian, -1, -2)
    return given


def _innovations(
    n: int, position: FloatArray | None, velocity: FloatArray | None, spread: Spread | None
) -> tuple[FloatArray, FloatArray]:
    z, s = np.full((n, 6), np.nan), np.full((n, 6, 6), np.nan)
    names: tuple[str, ...] = ()
    rows: list[int] = []
    for i, (value, key) in enumerate(((position, "z"), (velocity, "zv"))):
        own = TRIPLES[key][0]
        if value is not None and spread is not None and all(name in spread.names for name in own):
            z[:, 3 * i : 3 * i + 3] = value
            names += own
            rows += [3 * i, 3 * i + 1, 3 * i + 2]
    if names and spread is not None:
        found = spread.of(names)
        diagonal = np.isfinite(np.einsum("nii->ni", found))
        both = diagonal[:, :, None] & diagonal[:, None, :]
        found = np.where(both & ~np.isfinite(found), 0.0, found)
        s[np.ix_(range(n), rows, rows)] = found
    return z, s


def _outages(values: Mapping[str, FloatArray]) -> FloatArray:
    """Return begin and end of the stretches that a column marks."""
    if "outage" not in values:
        return np.zeros((0, 2))
    mark = np.concatenate([[False], values["outage"] > 0.5, [False]])
    begin, end = np.flatnonzero(mark[1:] & ~mark[:-1]), np.flatnonzero(~mark[1:] & mark[:-1]) - 1
    t = values["t"]
    return np.column_stack([t[np.maximum(begin - 1, 0)], t[end]])
