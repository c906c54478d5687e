"""Names and units as others write them: the one table of column names and unit spellings.

A column is known by the end of its name, so that ``field.angular_velocity.x`` and ``imu/gyro_x`` need no
entry of their own: a name is lowered, everything but letters and digits becomes ``_``, and a trailing unit
(``time_ns``, ``gyro_x_dps``, ``gyro_x [deg/s]``) is taken off first.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from tuner.types.records import DataError

SENSORS = ("gyro", "accel")

STEMS: Mapping[str, tuple[str, ...]] = {
    "gyro": (
        "gyro", "gyr", "gyroscope", "angular_velocity", "angular_rate", "ang_vel", "angvel", "omega", "rate",
        "w_rs_s", "wb", "wibb", "w", "g", "gy", "dtheta", "dang", "delta_angle", "del_ang", "delang", "dth",
    ),
    "accel": (
        "accel", "acc", "accel_ln", "accel_wr", "acc_smooth", "acceleration", "accelerometer", "linear_acceleration",
        "specific_force", "lin_acc", "a_rs_s", "fb", "fibb", "a", "ac", "f", "dvel", "delta_velocity", "delta_vel",
        "del_vel", "delvel", "dv",
    ),
}  # fmt: skip
"""Names of a sensor before the axis; the first is ours, the last lines are increments."""

INCREMENTS = frozenset(
    [
        "dtheta",
        "dang",
        "delta_angle",
        "del_ang",
        "delang",
        "dth",
        "dvel",
        "delta_velocity",
        "delta_vel",
        "del_vel",
        "delvel",
        "dv",
    ]
)
TIME = (
    "t",
    "time",
    "timestamp",
    "timestamps",
    "timestamp_unix",
    "ts",
    "stamp",
    "elapsed",
    "seconds",
    "sec",
    "tow",
    "sow",
    "gps_time",
    "gpstime",
    "gps_seconds",
    "gps_sec",
    "gpssec",
    "gpst",
    "imu_t",
    "time_of_week",
    "seconds_of_week",
    "gps_tow",
    "itow",
    "i_tow",
    "sod",
    "seconds_of_day",
    "datetime",
    "utc",
    "epoch",
    "time_startup",
    "time_boot",
    "zeit",
    "temps",
    "tiempo",
    "tempo",
    "sample_time_fine",
)
TIME_WORDS = ("millis", "milliseconds", "msec", "ms", "micros", "microseconds", "usec", "us")
"""Units of time that are the name of a column, as of the clocks of an Arduino."""
WEEK = ("week", "gps_week", "gpsweek", "week_number", "wn", "weekno")
TIME_OF_WEEK = (
    "tow",
    "sow",
    "gps_time",
    "seconds",
    "sec",
    "time_of_week",
    "seconds_of_week",
    "gps_tow",
    "towms",
    "itow",
    "i_tow",
    "gpstime",
    "gps_seconds",
    "gps_sec",
    "gpssec",
    "gpst",
)
"""Names of the GPS week, and of the time in it."""
TEMPERATURE = ("temperature", "temp", "imu_temp", "temperature_imu", "temp_c", "celsius")

TIME_UNITS: Mapping[str, float] = {
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "ns": 1e-9,
    "min": 60.0,
    "h": 3600.0,
    "0.1 ms": 1e-4,
}
"""Seconds in one unit."""

UNITS: Mapping[str, tuple[str, ...]] = {
    "gyro": ("rad/s", "deg/s", "deg/h", "mrad/s", "mdeg/s", "rad", "deg", "arcsec"),
    "accel": ("m/s^2", "g", "mg", "ug", "cm/s^2", "ft/s^2", "m/s", "cm/s", "ft/s"),
}
"""Units a sensor may have, SI first; the last ones (no time in the gyro's, /s of the accel) are increments."""

INCREMENT_UNITS = frozenset(("rad", "deg", "arcsec", "m/s", "cm/s", "ft/s"))

INCREMENT_OF: Mapping[str, str] = {
    "rad/s": "rad", "deg/s": "deg", "m/s^2": "m/s", "cm/s^2": "cm/s", "ft/s^2": "ft/s",
}  # fmt: skip
"""Increments of a rate: what is meant where a file calls them by the rate."""

_SPELLINGS: Mapping[str, tuple[str, ...]] = {
    "rad/s": ("rad/s", "rad/sec", "rad/second", "rads/s", "radian/s", "radian/sec", "radian/second", "radians/s",
              "radians/sec", "radians/second", "rad s^-1", "rad*s^-1", "rad.s^-1", "rad s-1", "rad.s-1", "radps",
              "rad_s", "rads", "rps"),
    "deg/s": ("deg/s", "deg/sec", "deg/second", "degree/s", "degree/sec", "degree/second", "degrees/s",
              "degrees/sec", "degrees/second", "deg s^-1", "deg s-1", "deg.s-1", "°/s", "°/sec", "dps", "deg_s",
              "degps", "degs"),
    "deg/h": ("deg/h", "deg/hr", "deg/hour", "degree/h", "degree/hour", "degrees/h", "degrees/hour", "°/h", "°/hr",
              "dph", "deg_h", "deg h^-1", "arcsec/s"),
    "mrad/s": ("mrad/s", "mrad/sec", "mrads", "mrad_s"),
    "mdeg/s": ("mdeg/s", "mdps", "mdeg_s", "milli-deg/s"),
    "rad": ("rad", "radian", "radians"),
    "deg": ("deg", "°", "degree", "degrees"),
    "arcsec": ("arcsec", "as", "arcseconds", '"'),
    "m/s^2": ("m/s^2", "m/(s^2)",
              "m/s2", "m/sec^2", "m/sec2", "m/sec²", "m/sec/sec", "meter/second^2", "meters/second^2", "n/kg",
              "m s-2", "m.s-2", "m/s²", "m/s/s", "m s^-2", "m*s^-2", "m.s^-2", "mps2", "m_s2",
              "mpss", "ms2", "ms^-2", "m/s**2"),
    "g": ("g", "gn", "g0"),
    "mg": ("mg", "milli-g", "millig"),
    "ug": ("ug", "µg", "μg", "micro-g", "microg"),
    "cm/s^2": ("cm/s^2", "cm/s2", "cm/s²", "gal", "cm_s2", "cms2"),
    "ft/s^2": ("ft/s^2", "ft/s2", "ft/s²", "ft_s2", "fps2"),
    "m/s": ("m/s", "m s^-1", "mps", "m_s", "m/sec"),
    "cm/s": ("cm/s", "cm_s"),
    "ft/s": ("ft/s", "fps", "ft_s"),
    "s": ("s", "sec", "secs", "second", "seconds"),
    "ms": ("ms", "msec", "millis", "milliseconds"),
    "us": ("us", "usec", "µs", "μs", "micros", "microseconds"),
    "ns": ("ns", "nsec", "nanos", "nanoseconds", "nanosec"),
    "min": ("min", "minutes"),
    "h": ("h", "hr", "hours"),
    "0.1 ms": ("0.1 ms", "0.1ms"),
    "degC": ("degc", "°c", "c", "celsius", "deg c", "deg_c", "℃"),
    "K": ("k", "kelvin"),
    "count": ("count", "counts", "lsb", "adc", "ticks"),
}  # fmt: skip
_UNIT_OF = {spelling: unit for unit, spellings in _SPELLINGS.items() for spelling in spellings}
_SUFFIXES = {s: u for s, u in _UNIT_OF.items() if re.fullmatch(r"[a-z][a-z0-9_]+", s) and u != "min"} | {
    "g": "g",
    "s": "s",
}
_INDEX = re.compile(r"^(?P<name>.*?)\s*[\[(](?P<index>\d{1,4})[\])]\s*$")
"""A bracket that holds a whole number is an index: ``gyro_rad[0]`` of PX4 is its x axis."""
_RATE_OF = {"rad": "rad/s", "deg": "deg/s"}
"""What ``gyro_rad`` means: a gyroscope gives rates, unless its name is that of an increment."""
UNITS_BY_NAME: Mapping[str, tuple[str, ...]] = {"sample_time_fine": ("0.1 ms", "us")}
"""Clocks whose unit is one of their maker's: Xsens counts ticks of 0.1 ms (MTi) or microseconds (DOT)."""
_BRACKET = re.compile(r"^(?P<name>.*?)\s*[\[({](?P<unit>[^\])}]*)[\])}]\s*$")
_AXIS = re.compile(r"^(?P<stem>.+?)_?(?P<axis>[xyz])$")
_AXIS_FIRST = re.compile(r"^(?P<axis>[xyz])(?P<stem>acc|gyro)$")


@dataclass(frozen=True)
class ColumnName:
    """A column name taken apart.

    Attributes
    ----------
    written : str
        As in the file.
    plain : str
        Without unit.
    unit : str or None
        As the name states it.
    angle : bool
        Whether the name states an angle where a gyroscope gives a rate, as ``gyro_rad`` does.
    """

    written: str
    plain: str
    unit: str | None
    angle: bool = False


def unit_of(text: str, allowed: Iterable[str], *, what: str) -> str:
    """Return our spelling of a unit; raise `DataError` that lists `allowed` where it is none of them."""
    allowed = tuple(allowed)
    unit = known_unit(text)
    if unit is None or unit not in allowed:
        raise DataError(f"{what}: unknown unit '{text}': expected one of {', '.join(allowed)}")
    return unit


def known_unit(text: str) -> str | None:
    """Return our spelling of a unit, or None."""
    return _UNIT_OF.get(text.strip().lower()) or _UNIT_OF.get(re.sub(r"\s+", "", text.lower()))


def parse_name(written: str) -> ColumnName:
    """Take a column name apart: ``Gyro X [deg/s]`` is plain ``gyro_x`` in ``deg/s``."""
    if (index := _INDEX.match(written)) is not None:
        # VectorNav writes the components of a vector as ``gyro.c[0]``.
        inner, number = parse_name(index["name"].removesuffix(".c")), int(index["index"])
        last = "xyz"[number] if number < 3 else str(number)
        return ColumnName(written, f"{inner.plain}_{last}", inner.unit, inner.angle)
    match = _BRACKET.match(written)
    name, unit = (match["name"], match["unit"].strip() or None) if match else (written, None)
    if match and _INDEX.match(name) is not None:
        return ColumnName(written, parse_name(name).plain, unit)
    words = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z]{2})", "_", name)
    plain = re.sub(r"[^a-z0-9]+", "_", words.lower()).strip("_")
    if unit is None:
        for tail in (2, 1):
            parts = plain.rsplit("_", tail)
            suffix = "_".join(parts[1:])
            if len(parts) == tail + 1 and suffix in _SUFFIXES and not _is_axis_name(plain):
                found = _SUFFIXES[suffix]
                rate = not increments(parts[0]) and (_role_of(parts[0]) or ("",))[0].startswith("gyro")
                angle = rate and found in _RATE_OF
                return ColumnName(written, parts[0], _RATE_OF[found] if angle else found, angle)
    return ColumnName(written, plain, _UNIT_OF[plain] if unit is None and plain in TIME_WORDS else unit)


def without_unit(written: str) -> str:
    """Return a column name without the unit in brackets behind it."""
    match = _BRACKET.match(written) if _INDEX.match(written) is None else None
    return match["name"] if match and match["name"] else written


def role_of(name: ColumnName) -> tuple[str, int] | None:
    """Return what a column is (``t temperature gyro_x … gyro accel``) and its rank, or None.

    Rank 0 is a name of the table, rank 1 one that ends like it: ``imu_gyro_x`` and ``imu/gyro_x`` give way to
    ``gyro_x``.
    """
    role = _role_of(name.plain)
    if (
        role is not None
        and role[0] == "t"
        and known_unit(name.unit or "s") in _SPELLINGS.keys() - TIME_UNITS.keys()
    ):
        return None  # T(°) is no clock
    *path, last = re.split("[/.]", name.written)
    if role is None and path:
        found = _role_of(parse_name(last).plain)
        return None if found is None else (found[0], 1)
    return role


def _role_of(plain: str) -> tuple[str, int] | None:
    if plain in TIME_WORDS:
        return "t", 1
    for role, aliases in (("t", TIME), ("temperature", TEMPERATURE)):
        if plain in aliases:
            return role, 0
        if any(plain.endswith(f"_{a}") for a in aliases if len(a) > 3):
            return role, 1
    for ending in ("_raw", "_cal"):
        bare = plain.removesuffix(ending)
        if (
            bare != plain
            and (_AXIS.match(bare) or ending == "_cal")
            and (found := _role_of(bare)) is not None
        ):
            return found[0], 1
    if (first := _AXIS_FIRST.match(plain)) is not None:  # MAVLink: xacc
        return _role_of(f"{first['stem']}_{first['axis']}")
    match = _AXIS.match(plain)
    stem, suffix = (match["stem"], f"_{match['axis']}") if match else (plain, "")
    if stem == "alpha" and suffix:  # Kalibr's name of the specific force, elsewhere the angular acceleration
        return "accel" + suffix, 1
    for sensor in SENSORS:
        stems = [s for s in STEMS[sensor] if suffix or len(s) > 1]
        if stem in stems:
            return sensor + suffix, 0
        words = [s for s in stems if len(s) > 1 or (suffix and not plain.endswith(suffix))]
        if any(stem.endswith(f"_{s}") for s in words):
            return sensor + suffix, 1
    return None


def is_mavlink(name: str) -> bool:
    """Return whether a column has a name of MAVLink's, such as ``xgyro``: whole numbers there are mg and mrad/s."""
    return _AXIS_FIRST.match(parse_name(name).plain) is not None


def sensor_of(plain: str) -> str | None:
    """Return the sensor whose name an array's begins with or contains as a word, such as ``gyro_dps_1``."""
    words = f"_{plain}_"
    if any(
        f"_{w}_" in words
        for w in ("bias", "sd", "std", "cov", "covariance", "var", "temp", "temperature", "time", "t")
    ):
        return None
    for sensor in SENSORS:
        if any(f"_{stem}_" in words for stem in STEMS[sensor] if len(stem) > 1):
            return sensor
    return None


def unit_in_words(plain: str, sensor: str) -> str | None:
    """Return the unit that a word of an array's name states, such as ``gyro_dps_1`` → ``deg/s``."""
    found = (_SUFFIXES.get(word) for word in plain.split("_"))
    return next((unit for unit in found if unit in (*UNITS[sensor], "count")), None)


def increments(plain: str) -> bool:
    """Return whether a name says that the values are increments."""
    return any(f"_{stem}_" in f"_{plain}_" for stem in INCREMENTS)


def _is_axis_name(plain: str) -> bool:
    match = _AXIS.match(plain)
    return bool(match) and any(match["stem"] in stems for stems in STEMS.values()) if match else False
