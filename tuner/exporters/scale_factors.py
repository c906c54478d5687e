"""Sds of scale factors, which a static log does not show: as configured, of the grade, or of the nearest grade."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tuner.catalogue.grades import grade_names, load_grade
from tuner.exporters.triad_values import triad
from tuner.synthesis.from_drive import nearest_grade
from tuner.types import FilterConfig
from tuner.types.borrowed import borrowed


def scale_factor(config: FilterConfig, block: str) -> tuple[float, str]:
    """Return the sd of a scale factor, and in words where it is from.

    Parameters
    ----------
    config : FilterConfig
        Its ``constants`` come first, then its grade, then the built-in grade whose white noise is nearest.
    block : str
        ``gyro_scale`` or ``accel_scale``.
    """
    if block in config.constants:
        return config.constants[block], "as configured"
    sensor = block.removesuffix("_scale")
    known = {
        name: sd
        for name in grade_names()
        if (sd := getattr(load_grade(name), sensor).scale_factor_sd) is not None
    }
    source = config.provenance.get("source")
    stated = source.get("scale_factor_sd", {}) if isinstance(source, Mapping) else {}
    if sensor in stated and isinstance(source, Mapping):
        lent = next((grade for axis, grade in borrowed(config).items() if axis.startswith(sensor)), None)
        return stated[sensor], f"assumed: of {lent}" if lent else f"of the sheet {source.get('name', '')}"
    white = {}
    for kind in ("gyro", "accel"):
        if channels := triad(config, kind):
            white[kind] = math.sqrt(sum(c.white_density**2 for c in channels) / len(channels))
    nearest = nearest_grade(white, known)
    return known[nearest].value, f"assumed: of {nearest}, nearest in white noise of the grades that state one"
