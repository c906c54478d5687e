"""What explains the errors of a filter, and what to change, as English sentences."""

from __future__ import annotations

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
    "mounting": "frame of the body",
}
_CHANGES = {
    "gnss_noise_scale": "multiply the sds of {fixes} by {size:.3g} (R by {square:.3g})",
    "imu_noise_scale": "multiply the noise densities{of_subject} by {size:.3g} (Q by {square:.3g})",
    "noise_scale": "multiply all stated sds by {size:.3g}, or R and Q by {square:.3g}",
    "correlated_gnss": "add states for errors of the positions of sd {size:.3g} m, or multiply their sds",
    "time_constant": "multiply the time constants{of_subject} by {size:.3g}",
    "missing_state": "add a state{of_subject} of sd {size:.3g} {unit}",
    "time_offset": "shift the stamps of the fixes by {back:+.3g} s, or give the filter this delay",
    "time_offset of the output": (
        "shift the stamps of the output by {back:+.3g} s, or score with --align-time if the truth is late"
    ),
    "lever_arm": "add to the lever arm (forward, right, down): {parts} m",
    "gnss_frame": "put fixes and truth into one frame: {parts}",
    "mounting": "turn the body frame of the estimate: {parts} rad; --align-body takes a known difference out",
}
"""What to change, by the code of the cause."""
MAX_ALTERNATIVES = 3
"""Alternatives that a sentence names: more make it unreadable."""


def cause_name(cause: OutputCause) -> str:
    """Return the name of a cause in words."""
    name = _NAMES.get(cause.cause, cause.cause.replace("_", " "))
    return f"{name} ({cause.subject})" if cause.subject else name


def cause_text(cause: OutputCause) -> str:
    """Return a cause with its size, interval and what is not distinguished from it."""
    size = amount(Coefficient.known(cause.size, *cause.interval, cause.unit))
    if cause.unit == "1":
        size = f"true {'time' if cause.cause == 'time_constant' else 'sd'} {size} times the assumed"
    others = ", ".join(cause_name(other) for other in cause.alternatives[:MAX_ALTERNATIVES])
    return f"{cause_name(cause)}: {size}" + (f"; not distinguished from it: {others}" if others else "")


def change_text(cause: OutputCause) -> str:
    """Return what to change and by how much."""
    of_output = cause.cause == "time_offset" and cause.subject.startswith("stamps")
    return _CHANGES.get("time_offset of the output" if of_output else cause.cause, "").format(
        size=cause.size,
        square=cause.size**2,
        back=-cause.size,
        unit=cause.unit,
        of_subject=f" of {cause.subject}" if cause.subject else "",
        fixes=cause.subject or "the fixes",
        parts=", ".join(f"{name} {value:+.3g}" for name, (value, _, _) in cause.parameters.items()),
    )
