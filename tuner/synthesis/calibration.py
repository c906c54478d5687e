"""What a calibration from poses changes in a configuration, in plain values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from tuner.formats.documents import plain
from tuner.formats.noise_terms import coefficient_json
from tuner.segments.multi_position import PoseCalibration
from tuner.synthesis.initial_covariance import initial_uncertainty
from tuner.types import Coefficient, FilterConfig


def calibration_json(found: PoseCalibration) -> dict[str, Any]:
    """Return a calibration; numbers are SI."""
    return {
        "model": "measured = A f + bias; A lower triangular: diagonal 1 + scale, misalignment_RC in row R, column C",
        "poses": found.poses,
        "different_poses": found.different,
        "accel": {name: coefficient_json(c) for name, c in found.accel.items()},
        "gyro": {name: coefficient_json(c) for name, c in found.gyro.items()},
        "misfit": plain(found.misfit),
        "notes": list(found.notes),
    }


def with_calibration(config: FilterConfig, found: PoseCalibration) -> FilterConfig:
    """Return a configuration whose prior constants are those that the poses show, with the calibration to apply.

    The constant of an axis is as large as the bias that was found, for a filter that does not apply the calibration;
    the reason says what is left where it does.
    """
    channels, reasons = dict(config.channels), dict(config.initial.reasons)
    for sensor, coefficients in (("accel", found.accel), ("gyro", found.gyro)):
        for letter in "xyz":
            axis, c = f"{sensor}_{letter}", coefficients.get(f"bias_{letter}")
            if axis not in channels or c is None or c.value is None:
                continue
            sd = _half(c) / 1.96
            channels[axis] = replace(channels[axis], constant_sd=math.hypot(c.value, sd))
            reasons[axis] = (
                f"bias of {c.value:.4g} {c.unit} from {found.poses} stand-stills; "
                f"once the calibration is applied {sd:.3g} is left"
            )
    provenance: Mapping[str, Any] = {**config.provenance, "calibration": calibration_json(found)}
    note = "several poses: the calibration in provenance.calibration is to be applied before the filter"
    initial = initial_uncertainty(channels, reasons, config.gnss)
    return replace(
        config, channels=channels, initial=initial, provenance=provenance, notes=(*config.notes, note)
    )


def _half(c: Coefficient) -> float:
    assert c.interval is not None
    return 0.5 * (c.interval[1] - c.interval[0])
