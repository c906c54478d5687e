"""What explains the errors of a filter, and what to change, as English sentences."""

from __future__ import annotations

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
MAX_ALTERNATIVES = 3
"""Alternatives that a sentence names: more make it unreadable."""


def cause_name(cause: OutputCause) -> str:
    """Return the name of a cause in words."""
    name = _NAMES.get(cause.cause, cause.cause.replace("_", " "))
    return f"{name} ({cause.subject})" if cause.subject else name


def cause_text(cause: OutputCause) -> str:
    """Return a cause with its size, interval and what is not distinguished from it."""
    low, high = cause.interval
    unit = "" if cause.unit == "1" else f" {cause.unit}"
    words = f"{cause_name(cause)}: {cause.size:.3g} ({low:.3g} … {high:.3g}){unit}"
    if cause.unit == "1":
        words = f"{cause_name(cause)}: true sd {cause.size:.3g} ({low:.3g} … {high:.3g}) times the assumed"
        if cause.cause == "time_constant":
            words = words.replace("true sd", "true time").replace("assumed", "assumed one")
    if cause.alternatives:
        others = ", ".join(cause_name(other) for other in cause.alternatives[:MAX_ALTERNATIVES])
        words += f"; not distinguished from it: {others}"
    return words


def change_text(cause: OutputCause) -> str:
    """Return what to change and by how much."""
    size = cause.size
    parts = ", ".join(f"{name} {value:+.3g}" for name, (value, _, _) in cause.parameters.items())
    subject = f" of {cause.subject}" if cause.subject else ""
    match cause.cause:
        case "gnss_noise_scale":
            return f"multiply the sds of {cause.subject or 'the fixes'} by {size:.3g} (R by {size**2:.3g})"
        case "imu_noise_scale":
            return f"multiply the noise densities{subject} by {size:.3g} (Q by {size**2:.3g})"
        case "noise_scale":
            return f"multiply all stated sds by {size:.3g}, or R and Q by {size**2:.3g}"
        case "correlated_gnss":
            return f"add states for errors of the positions of sd {size:.3g} m, or multiply their sds"
        case "time_constant":
            return f"multiply the time constants{subject} by {size:.3g}"
        case "missing_state":
            return f"add a state{subject} of sd {size:.3g} {cause.unit}"
        case "time_offset" if cause.subject.startswith("stamps"):
            return f"shift the stamps of the output by {-size:+.3g} s, or score with --align-time if the truth is late"
        case "time_offset":
            return f"shift the stamps of the fixes by {-size:+.3g} s, or give the filter this delay"
        case "lever_arm":
            return f"add to the lever arm (forward, right, down): {parts} m"
        case "gnss_frame":
            return f"put fixes and truth into one frame: {parts}"
        case "mounting":
            return (
                f"turn the body frame of the estimate: {parts} rad; --align-body takes a known difference out"
            )
    return ""
