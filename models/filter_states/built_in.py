"""The states that this project declares: biases, scale factors, misalignments, receiver and gravity."""

from __future__ import annotations

from models.filter_states.declaration import Coupling, FilterState, Origin

_AXES = ("x", "y", "z")
_NED = ("north", "east", "down")
OFF_DIAGONAL = ("xy", "xz", "yx", "yz", "zx", "zy")
"""Misalignments: the axis that errs, then the one that it feels."""
_MATRIX = tuple(a + b for a in _AXES for b in _AXES)


def _bias(sensor: str) -> tuple[Coupling, ...]:
    return tuple(Coupling(axis, f"{sensor}_{axis}") for axis in _AXES)


def _scale(sensor: str, felt: str) -> tuple[Coupling, ...]:
    return tuple(Coupling(axis, f"{sensor}_{axis}", f"{felt}_{axis}") for axis in _AXES)


def _cross(names: tuple[str, ...], sensor: str, felt: str) -> tuple[Coupling, ...]:
    return tuple(Coupling(name, f"{sensor}_{name[0]}", f"{felt}_{name[1]}") for name in names)


GYRO_BIAS = FilterState(
    "gyro_bias", _AXES, "rad/s", "gyro bias", _bias("gyro"), "deg/h", origin=Origin.AXIS_CONSTANT
)
ACCEL_BIAS = FilterState(
    "accel_bias", _AXES, "m/s^2", "accelerometer bias", _bias("accel"), "mg", origin=Origin.AXIS_CONSTANT
)
GYRO_MARKOV = FilterState(
    "gyro_markov", _AXES, "rad/s", "gyro bias process", _bias("gyro"), "deg/h", origin=Origin.AXIS_PROCESSES
)
ACCEL_MARKOV = FilterState(
    "accel_markov", _AXES, "m/s^2", "accelerometer bias process", _bias("accel"), "mg",
    origin=Origin.AXIS_PROCESSES,
)  # fmt: skip
GYRO_RAMP = FilterState(
    "gyro_ramp", _AXES, "rad/s^2", "gyro ramp", slope_of="gyro_bias", origin=Origin.AXIS_SLOPE
)
ACCEL_RAMP = FilterState(
    "accel_ramp", _AXES, "m/s^3", "accelerometer ramp", slope_of="accel_bias", origin=Origin.AXIS_SLOPE
)
GYRO_SCALE = FilterState("gyro_scale", _AXES, "1", "gyro scale", _scale("gyro", "rate"), "ppm")
ACCEL_SCALE = FilterState("accel_scale", _AXES, "1", "accelerometer scale", _scale("accel", "force"), "ppm")
GYRO_MISALIGNMENT = FilterState(
    "gyro_misalignment", OFF_DIAGONAL, "1", "gyro misalignment", _cross(OFF_DIAGONAL, "gyro", "rate"), "ppm"
)
ACCEL_MISALIGNMENT = FilterState(
    "accel_misalignment", OFF_DIAGONAL, "1", "accelerometer misalignment",
    _cross(OFF_DIAGONAL, "accel", "force"), "ppm",
)  # fmt: skip
G_SENSITIVITY = FilterState(
    "g_sensitivity", _MATRIX, "rad/s/(m/s^2)", "g sensitivity", _cross(_MATRIX, "gyro", "force")
)
LEVER_ARM = FilterState("lever_arm", _AXES, "m", "lever arm", not_linear="models.measurements")
TIME_OFFSET = FilterState("time_offset", ("",), "s", "time offset", not_linear="models.measurements")
MOUNTING = FilterState("mounting", _AXES, "rad", "mounting", not_linear="models.measurements")
GRAVITY = FilterState("gravity", ("",), "m/s^2", "gravity", (Coupling("", "acceleration_down"),), "mGal")
GNSS_POSITION = FilterState(
    "gnss_position", _NED, "m", "correlated fixes",
    tuple(Coupling(axis, f"position_{axis}") for axis in _NED), origin=Origin.FIX_PROCESSES,
)  # fmt: skip
CORRELATED_VELOCITY = FilterState(
    "correlated_velocity", _NED, "m/s", "velocity error of the receiver",
    tuple(Coupling(axis, f"velocity_{axis}") for axis in _NED), time_constant=100.0,
)  # fmt: skip

BUILT_IN = (
    GYRO_BIAS,
    ACCEL_BIAS,
    GYRO_MARKOV,
    ACCEL_MARKOV,
    GYRO_RAMP,
    ACCEL_RAMP,
    GYRO_SCALE,
    ACCEL_SCALE,
    GYRO_MISALIGNMENT,
    ACCEL_MISALIGNMENT,
    G_SENSITIVITY,
    LEVER_ARM,
    TIME_OFFSET,
    MOUNTING,
    GRAVITY,
    GNSS_POSITION,
    CORRELATED_VELOCITY,
)
"""In the order in which a filter has them; those of other packages follow."""
