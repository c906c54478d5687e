"""A calibration from several poses in lines of text."""

from __future__ import annotations

from tuner.segments.multi_position import PoseCalibration


def calibration_lines(found: PoseCalibration) -> list[str]:
    """Return bias, scale factor and misalignment of each sensor, one a line, with the half width of its interval."""
    lines = [
        f"  calibration from {found.poses} stand-stills, {found.different} of them in poses of their own (SI, 95 %):"
    ]
    for sensor, coefficients in (("accel", found.accel), ("gyro", found.gyro)):
        for name, c in coefficients.items():
            assert c.value is not None
            assert c.interval is not None
            unit = "" if c.unit == "1" else f" {c.unit}"
            half = 0.5 * (c.interval[1] - c.interval[0])
            lines.append(f"    {sensor} {name.replace('_', ' ')} {c.value:.6g} ± {half:.2g}{unit}")
    return lines + [f"    {note}" for note in found.notes]
