"""A calibration from several poses in lines of text."""

from __future__ import annotations

from tuner.formats.customary_units import amount
from tuner.segments.multi_position import PoseCalibration


def calibration_lines(found: PoseCalibration) -> list[str]:
    """Return bias, scale factor and misalignment of each sensor, one a line, with its interval."""
    return [
        f"calibration from {found.poses} stand-stills in {found.different} poses (± 95 %):",
        *(
            f"  {sensor} {name.replace('_', ' ')} {amount(c)}"
            for sensor, coefficients in (("accel", found.accel), ("gyro", found.gyro))
            for name, c in coefficients.items()
        ),
        *(f"  {note}" for note in found.notes),
    ]
