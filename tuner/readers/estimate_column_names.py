"""Names and units of the columns of a filter's output: what is known, other spellings, units in brackets."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

from models.units import canonical_unit
from tuner.types.records import DataError

TRIPLES: Mapping[str, tuple[tuple[str, str, str], tuple[str, str, str]]] = {
    "llh": (("lat", "lon", "height"), ("deg", "deg", "m")),
    "ned": (("n", "e", "d"), ("m", "m", "m")),
    "xyz": (("x", "y", "z"), ("m", "m", "m")),
    "vned": (("vn", "ve", "vd"), ("m/s",) * 3),
    "vxyz": (("vx", "vy", "vz"), ("m/s",) * 3),
    "rpy": (("roll", "pitch", "yaw"), ("deg",) * 3),
    "phi": (("phi_n", "phi_e", "phi_d"), ("deg",) * 3),
    "bg": (("bg_x", "bg_y", "bg_z"), ("rad/s",) * 3),
    "ba": (("ba_x", "ba_y", "ba_z"), ("m/s^2",) * 3),
    "z": (("z_n", "z_e", "z_d"), ("m",) * 3),
    "zv": (("z_vn", "z_ve", "z_vd"), ("m/s",) * 3),
}
"""Groups of three columns with their usual units."""

QUATERNION = ("qw", "qx", "qy", "qz")

UNITS: Mapping[str, str] = {
    "t": "s",
    "outage": "1",
    **dict.fromkeys(QUATERNION, "1"),
    **{name: unit for names, units in TRIPLES.values() for name, unit in zip(names, units, strict=True)},
}
"""Unit of every column without brackets."""

_ALIASES = {
    "time": "t",
    "timestamp": "t",
    "stamp": "t",
    "latitude": "lat",
    "longitude": "lon",
    "lng": "lon",
    "alt": "height",
    "altitude": "height",
    "h": "height",
    "north": "n",
    "east": "e",
    "down": "d",
    "heading": "yaw",
    "azimuth": "yaw",
    **{f"imu_{angle}": angle for angle in ("roll", "pitch", "yaw")},
    "vel_n": "vn",
    "vel_e": "ve",
    "vel_d": "vd",
    "v_n": "vn",
    "v_e": "ve",
    "v_d": "vd",
}
"""Other names of columns."""


def canonical_name(written: str) -> tuple[str, str | None]:
    """Return our name of a column and the unit in its brackets: ``Sd_Latitude [m]`` gives ``sd_lat`` and ``m``.

    A number in brackets is an index, no unit.
    """
    name, bracket, rest = written.partition("[")
    if not bracket:
        name, bracket, rest = written.partition("(")
    stated = rest.strip(" ])")
    unit = stated if stated and not stated.isdigit() else None
    plain = name.strip().lower().replace(" ", "_").replace("-", "_")
    for prefix in ("sd_", "std_", "sigma_"):
        if plain.startswith(prefix):
            own = plain.removeprefix(prefix)
            return f"sd_{_ALIASES.get(own, own)}", unit
    return _ALIASES.get(plain, plain), unit


_STATES = [name for name in UNITS if name not in ("t", "outage")]
SPREADS: Mapping[str, tuple[str, str | None]] = {
    **{f"sd_{name}": (name, None) for name in _STATES},
    **{f"cov_{a}_{b}": (a, b) for a, b in itertools.product(_STATES, repeat=2)},
}
"""Names of all sds and covariances, each with the columns that it is of."""


def is_known(name: str) -> bool:
    """Tell whether a name is that of a column that is read."""
    return name in UNITS or name in SPREADS


def column_unit(source: str, name: str, stated: str | None) -> str:
    """Return the unit of a column as `models.units` writes it."""
    usual = UNITS[name]
    if stated is None or usual == "1":
        return usual
    try:
        unit = canonical_unit(stated)
    except ValueError:
        unit = ""
    if not unit or not same_kind(unit, usual):
        raise DataError(f"{source}: column '{name} [{stated}]': expected a unit such as {usual}")
    return unit


_KINDS = (
    ("s", "ms", "us", "ns", "min", "h"),
    ("rad", "mrad", "urad", "deg", "arcmin", "arcsec"),
    ("m", "cm", "mm", "km", "ft"),
    ("m/s", "cm/s", "mm/s", "km/h", "kn", "mph", "ft/s"),
    ("rad/s", "deg/s", "mdeg/s", "deg/h", "arcsec/s"),
    ("m/s^2", "g", "mg", "ug", "Gal", "mGal"),
)
"""Units of one kind."""


def same_kind(unit: str, usual: str) -> bool:
    """Tell whether two units are of one kind."""
    return any(unit in kind and usual in kind for kind in _KINDS)


def stated_unit(source: str, column: str, unit: str) -> str:
    """Return a unit in brackets as `models.units` writes it."""
    try:
        return canonical_unit(unit)
    except ValueError:
        raise DataError(f"{source}: column '{column} [{unit}]': unknown unit") from None


def units_of_product(source: str, column: str, text: str) -> tuple[str, str]:
    """Return the two units of a covariance: ``m^2``, ``(m/s)^2``, ``m*deg``."""
    bare = text.replace("²", "^2").replace("·", "*").strip()
    if bare.endswith("^2") and bare != "m/s^2":
        inner = bare.removesuffix("^2").strip("()")
        return stated_unit(source, column, inner), stated_unit(source, column, inner)
    parts = [part.strip(" ()") for part in bare.split("*")]
    if len(parts) != 2:
        raise DataError(
            f"{source}: column '{column} [{text}]': expected a square or a product of two units, such as m^2 or m*deg"
        )
    return stated_unit(source, column, parts[0]), stated_unit(source, column, parts[1])
