"""Sensors side by side, with the drift that a filter of each predicts without fixes. The verb `compare`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

from tuner.catalogue.grades import DEFAULT_RECEIVER, load_gnss
from tuner.consistency.outage_drift import OutageDrift, outage_drift
from tuner.identification.compare_sources import Source, compare_sources
from tuner.identification.comparison import Comparison, LimitCheck, limit_checks
from tuner.synthesis import synthesize
from tuner.synthesis.sufficient import SENSORS, undetermined_bias, why_insufficient
from tuner.types import Identification
from tuner.types.progress import Progress, silent
from tuner.types.public import public
from tuner.types.shown import Shown


@dataclass(frozen=True, repr=False)
class SensorComparison(Shown):
    """Sensors side by side.

    Attributes
    ----------
    noise : Comparison
        Every coefficient of every axis.
    limits : tuple of LimitCheck
        Each measured source against each data sheet.
    receiver : str
        Built-in receiver before the outages.
    drift : tuple of OutageDrift or None
        One a source; None for those that lack an axis or a slow bias.
    unranked : mapping of str to str
        Sources without a drift, each with the reason.
    assumed : mapping of str to str
        Sources whose drift rests on half of a limit, each with the terms.
    """

    noise: Comparison
    limits: tuple[LimitCheck, ...]
    receiver: str
    drift: tuple[OutageDrift | None, ...]
    unranked: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    assumed: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))


@public("compare")
def compare(
    *sources: Source,
    by: Literal["still", "temperature"] | None = None,
    gnss: str = DEFAULT_RECEIVER,
    progress: Progress = silent,
) -> SensorComparison:
    """Compare sensors: coefficients, limits of data sheets, and predicted drift after 10, 60 and 300 s.

    Parameters
    ----------
    *sources : str, Path, Identification or sequence of Record
        Two or more of what `tuner.identification.identify_source` takes, or identifications.
    by : str, optional
        Compares the parts of one log instead: the stretches at rest between motions (``still``), or three bins of
        temperature (``temperature``).
    gnss : str
        Built-in receiver that aids before an outage.
    progress : callable, optional
        Called with one line at each step.

    Raises
    ------
    DataError
        For fewer than two sources or parts, a source that cannot be identified, or an unknown receiver.
    """
    receiver = load_gnss(gnss)
    noise = compare_sources(*sources, by=by, progress=progress)
    configs = [synthesize(source, gnss=receiver) for source in noise.sources]
    lacking = [_lacking_sensor(source) or why_insufficient(source) for source in noise.sources]
    drift = tuple(None if why else outage_drift(config) for config, why in zip(configs, lacking, strict=True))
    unranked = {name: why for name, why in zip(noise.names, lacking, strict=True) if why}
    limited = zip(noise.names, map(undetermined_bias, configs), strict=True)
    assumed = {name: words for name, words in limited if words is not None and name not in unranked}
    checks = limit_checks(noise)
    return SensorComparison(noise, checks, gnss, drift, MappingProxyType(unranked), MappingProxyType(assumed))


def _lacking_sensor(source: Identification) -> str:
    """Return of which sensor axes are missing, in words; empty where it has all six."""
    lost = [
        name
        for sensor, name in SENSORS.items()
        if sum(axis.startswith(sensor) for axis in source.channels) < 3
    ]
    return f"{' and '.join(lost)} of three axes are needed, found fewer" if lost else ""
