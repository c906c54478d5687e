"""What the INS/GNSS filter of NaveGo returns, ``nav_e`` in a MAT file: estimates, P and innovations with their S.

Its states are attitude, velocity, position in rad, rad, m, gyro and accelerometer biases; matrices stand row by row.
Scored are the epochs of its fixes, ``tg``. Its biases are subtracted from the samples, as here.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.arrays import FloatArray
from models.earth import metres_per_radian
from tuner.types.filter_output import FilterOutput, filter_output
from tuner.types.records import DataError

_NEEDED = ("t", "tg", "roll", "pitch", "yaw", "vel", "lat", "lon", "h", "Pp")
_ORDER = np.array([6, 7, 8, 3, 4, 5, 0, 1, 2, 9, 10, 11, 12, 13, 14])
"""Rows of NaveGo's P in our order."""


def read_navego_output(path: Path) -> FilterOutput:
    """Read ``nav_e`` of a MAT file of v7.2 or older (``save('nav.mat', 'nav_e', '-v7')``).

    Raises
    ------
    DataError
        What cannot be used, in one line.
    """
    nav = _struct(path)
    if missing := [name for name in _NEEDED if name not in nav]:
        raise DataError(
            f"{path}: expected nav_e of NaveGo with {', '.join(_NEEDED)}, {', '.join(missing)} missing"
        )
    t, tg = nav["t"].ravel(), nav["tg"].ravel()
    if nav["Pp"].size != 225 * len(tg):
        raise DataError(
            f"{path}: nav_e.Pp: expected {len(tg)} rows of 225 numbers, found shape {nav['Pp'].shape}"
        )
    p = nav["Pp"].reshape(-1, 15, 15)
    used = np.flatnonzero((np.einsum("kii->ki", p) > 0.0).all(axis=1) & (tg >= t[0]) & (tg <= t[-1]))
    if len(used) < 2:
        raise DataError(f"{path}: nav_e: expected fixes that were used, with P, found {len(used)}")
    at = np.clip(np.searchsorted(t, tg[used] - 1e-3), 0, len(t) - 1)
    llh = np.column_stack([nav[name].ravel()[at] for name in ("lat", "lon", "h")])
    rpy = np.column_stack([nav[name].ravel()[at] for name in ("roll", "pitch", "yaw")])
    cov = p[used][:, _ORDER][:, :, _ORDER]
    metres = np.ones((len(used), 15))
    metres[:, :3] = metres_per_radian(llh)
    cov = cov * metres[:, :, None] * metres[:, None, :]
    bias = nav["b"].reshape(len(tg), 6)[used] if "b" in nav else None
    innovation, s = _innovations(nav, len(tg), used)
    return filter_output(
        str(path),
        t[at],
        llh=llh,
        vel_n=nav["vel"].reshape(-1, 3)[at],
        quat_nb=rotation.quat_from_rpy(rpy),
        bias=bias,
        covariance=cov,
        correlated=True,
        innovation=innovation,
        innovation_covariance=s,
        notes=(f"{len(used)} epochs of fixes of NaveGo",),
    )


def _innovations(
    nav: Mapping[str, FloatArray], count: int, used: NDArray[np.intp]
) -> tuple[FloatArray | None, FloatArray | None]:
    """Return innovations, fix minus prediction, position first; NaveGo has velocity first and the other sign."""
    if "v" not in nav or "S" not in nav or nav["v"].size != 6 * count or nav["S"].size != 36 * count:
        return None, None
    order = np.array([3, 4, 5, 0, 1, 2])
    z = -nav["v"].reshape(count, 6)[used][:, order]
    s = nav["S"].reshape(count, 6, 6)[used][:, order][:, :, order]
    whole = (np.einsum("kii->ki", s) > 0.0).all(axis=1)
    z, s = z.copy(), s.copy()
    z[~whole], s[~whole] = np.nan, np.nan
    return z, s


def _struct(path: Path) -> dict[str, FloatArray]:
    """Return the numeric fields of ``nav_e``, or of the only struct with a field ``Pp``."""
    import scipy.io  # loaded when used: slow to import

    try:
        content: dict[str, Any] = scipy.io.loadmat(path, struct_as_record=True, squeeze_me=True)
    except NotImplementedError:
        raise DataError(
            f"{path}: expected a MAT file of v7.2 or older, got v7.3: save('nav.mat', 'nav_e', '-v7')"
        ) from None
    except Exception as error:  # scipy raises many kinds for a damaged file
        raise DataError(f"{path}: cannot be read as a MAT file: {error}") from None
    structs = {
        name: np.asarray(value)
        for name, value in content.items()
        if not name.startswith("__") and np.asarray(value).dtype.names and np.asarray(value).ndim == 0
    }
    found = structs.get("nav_e", next((v for v in structs.values() if "Pp" in (v.dtype.names or ())), None))
    if found is None:
        raise DataError(
            f"{path}: expected the struct nav_e of NaveGo, found {', '.join(structs) or 'no struct'}"
        )
    fields = {name: np.asarray(found[name][()]) for name in found.dtype.names or ()}
    return {name: np.asarray(v, dtype=float) for name, v in fields.items() if v.dtype.kind in "iuf"}
