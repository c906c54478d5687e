"""What explains the errors of a filter, and what to change, as English sentences."""

from __future__ import annotations

import math

from tuner.formats.customary_units import amount
from tuner.types import Coefficient
from tuner.types.output_score import OutputCause

_NAMES = {
    "gnss_noise_scale": "measurement noise R",
    "imu_noise_scale": "process noise Q",
    "noise_scale": "all stated sds, as if R and Q were wrong together",
    "correlated_gnss": "errors of the fixes that stay",
    "time_constant": "time constant of the biases",
    "missing_state": "a bias state is missing",
    "time_offset": "delay",
    "lever_arm": "lever arm",
    "gnss_frame": "frame of the positions",
    "mounting": "attitudes, the body turned",
    "gnss_frame of height": "heights, a constant offset",
    "gnss_frame of offset": "positions, a constant offset",
    "gnss_frame of rotation": "positions, turned",
    "gnss_frame of scale": "positions, scaled",
    "lever_arm of output": "lever arm of the output",
    "time_offset of stamps of the output or of the truth": "time stamps, a constant offset",
    "unit_of_sds of attitude in rad": "sds of the attitude are in rad",
    "unit_of_sds of attitude in deg": "sds of the attitude are in deg",
    "unit_of_sds of variances": "stated sds are variances",
    "unit_of_sds of variances in deg²": "stated sds are variances, of the attitude in deg²",
    "unit_of_sds of roots": "stated sds are roots of sds, as of sds in columns of variances",
    "unit_of_sds of roots in deg": "stated sds are roots of sds, as of sds in columns of variances",
    "unit_of_sds of position variances": "stated sds of positions are variances",
    "unit_of_sds of velocity variances": "stated sds of velocities are variances",
    "unit_of_sds of attitude variances": "stated sds of attitudes are variances in deg²",
}
"""Names by the code of the cause, or by code and subject."""
_CHANGES = {
    "gnss_noise_scale": "multiply the sds of {fixes} by {size:.3g} (R by {square:.3g})",
    "imu_noise_scale": "multiply the noise densities{of_subject} by {size:.3g} (Q by {square:.3g})",
    "noise_scale": "multiply all stated sds by {size:.3g}, or R and Q by {square:.3g}",
    "correlated_gnss": "add states for errors of the positions of sd {size:.3g} m, or multiply their sds",
    "time_constant": "multiply the time constants{of_subject} by {size:.3g}",
    "missing_state": "add a state{of_subject} of sd {size:.3g} {unit}",
    "time_offset": "shift the stamps of the fixes by {back:+.3g} s, or give the filter this delay",
    "time_offset of stamps of the output": "shift the stamps of the output by {back:+.3g} s{leap}",
    "time_offset of stamps of the output or of the truth": (
        "shift the stamps of the output by {back:+.3g} s, or score with --align-time if the truth is late{leap}"
    ),
    "lever_arm": "add to the lever arm (forward, right, down): {parts} m",
    "gnss_frame of height": (
        "the estimate is too {high} throughout: another datum (ellipsoid, mean sea level) or antenna height?"
    ),
    "gnss_frame of offset": "the estimate is off by {parts} m throughout: put both into one datum and origin",
    "gnss_frame of rotation": "positions are turned by {degrees} deg: grid north in one of the two?",
    "gnss_frame of scale": "the estimate's ways are {percent} % too long: a map projection in one of the two?",
    "lever_arm of output": (
        "the point of the output is off by {parts} m (forward, right, down) from that of the truth: another antenna, "
        "or a lever arm that the filter lacks"
    ),
    "unit_of_sds": "write their square roots, or name the columns as variances",
    "unit_of_sds of attitude in rad": "name the columns 'sd_roll [rad]', …",
    "unit_of_sds of attitude in deg": "name the columns 'sd_roll [deg]', …",
    "unit_of_sds of roots": "write their squares, or name the columns as sds",
    "unit_of_sds of roots in deg": "write their squares, or name the columns as sds",
    "gnss_frame": "put fixes and truth into one frame: {parts}",
    "mounting": "turn the body frame of the estimate: {parts} rad; --align-body takes a known difference out",
}
"""What to change, by the code of the cause."""
ANGLES = ("roll", "pitch", "yaw")
"""Parameters of a rotation."""
LEAP_SECONDS = 18.0
"""GPS time less UTC since 2017, s."""
MAX_STAMP_ERROR = 0.5
"""Error of a stamp in whole seconds of another time scale, s."""
MAX_ALTERNATIVES = 3
"""Alternatives that a sentence names: more make it unreadable."""


def cause_name(cause: OutputCause) -> str:
    """Return the name of a cause in words."""
    if exact := _NAMES.get(f"{cause.cause} of {cause.subject}"):
        return exact
    name = _NAMES.get(cause.cause, cause.cause.replace("_", " "))
    return f"{name} ({cause.subject})" if cause.subject else name


def cause_text(cause: OutputCause) -> str:
    """Return a cause with its size, interval and what is not distinguished from it."""
    size = amount(Coefficient.known(cause.size, *cause.interval, cause.unit))
    if cause.cause == "unit_of_sds":
        return f"{cause_name(cause)}: errors are {size} times as large as the sds that were read"
    if cause.unit == "1" and cause.cause != "gnss_frame":
        size = f"true {'time' if cause.cause == 'time_constant' else 'sd'} {size} times the assumed"
    others = ", ".join(cause_name(other) for other in cause.alternatives[:MAX_ALTERNATIVES])
    return f"{cause_name(cause)}: {size}" + (f"; not distinguished from it: {others}" if others else "")


def change_text(cause: OutputCause) -> str:
    """Return what to change and by how much."""
    exact = _CHANGES.get(f"{cause.cause} of {cause.subject}")
    leaps = cause.cause == "time_offset" and abs(abs(cause.size) - LEAP_SECONDS) < MAX_STAMP_ERROR
    return (exact or _CHANGES.get(cause.cause, "")).format(
        size=cause.size,
        square=cause.size**2,
        back=-cause.size,
        unit=cause.unit,
        of_subject=f" of {cause.subject}" if cause.subject else "",
        fixes=cause.subject or "the fixes",
        high="high" if cause.size > 0.0 else "low",
        degrees=", ".join(
            f"{name} {math.degrees(value):+.3g}"
            for name, (value, _, _) in cause.parameters.items()
            if name in ANGLES
        ),
        percent=f"{100.0 * cause.size:+.3g}",
        leap=f"; GPS time and UTC are {LEAP_SECONDS:g} s apart" if leaps else "",
        parts=", ".join(f"{name} {value:+.3g}" for name, (value, _, _) in cause.parameters.items()),
    )
