"""The registry of static causes; every table of causes is computed from it.

Another package adds a cause by an entry point in the group ``tuner.causes`` that names its class
(`docs/extending/cause.md`).
"""

from __future__ import annotations

from models.effects import EFFECTS
from tuner.diagnosis.cause import Cause
from tuner.diagnosis.data_quality.causes import (
    Clipping,
    Duplicates,
    ErrorCode,
    Interpolated,
    Overflow,
    Quantizer,
    RepeatedPackets,
    Timing,
)
from tuner.diagnosis.registry_of_causes import RegistryOfCauses
from tuner.diagnosis.static.causes.base import Extension
from tuner.diagnosis.static.causes.burst import Burst
from tuner.diagnosis.static.causes.colour import Colour
from tuner.diagnosis.static.causes.comb import Comb
from tuner.diagnosis.static.causes.cross_axis import CrossAxis
from tuner.diagnosis.static.causes.gauss_markov import MoreMarkov
from tuner.diagnosis.static.causes.heavy_tails import HeavyTails
from tuner.diagnosis.static.causes.hysteresis import Hysteresis
from tuner.diagnosis.static.causes.line import Line
from tuner.diagnosis.static.causes.lowpass import LowPass
from tuner.diagnosis.static.causes.motion import Motion
from tuner.diagnosis.static.causes.mount_tilt import MountTilt
from tuner.diagnosis.static.causes.periodic_variance import PeriodicVariance
from tuner.diagnosis.static.causes.recovery import Recovery
from tuner.diagnosis.static.causes.skewed_noise import SkewedNoise
from tuner.diagnosis.static.causes.spikes import Spikes
from tuner.diagnosis.static.causes.step import Step
from tuner.diagnosis.static.causes.telegraph import Telegraph
from tuner.diagnosis.static.causes.temperature import Temperature
from tuner.diagnosis.static.causes.temperature_rate import TemperatureRate
from tuner.diagnosis.static.causes.temperature_squared import TemperatureSquared
from tuner.diagnosis.static.causes.temperature_times_time import Ageing
from tuner.diagnosis.static.causes.template import Template
from tuner.diagnosis.static.causes.thermal_lag import Thermal, ThermalLag
from tuner.diagnosis.static.causes.transients import Transients
from tuner.diagnosis.static.causes.variance_drift import VarianceDrift
from tuner.diagnosis.static.causes.vibration import Vibration
from tuner.diagnosis.static.causes.warmup import Warmup

WORDS = ("cause", "meaning", "consequence", "group")
"""What every declaration has."""


def lacking(cause: type[Cause]) -> list[str]:
    """Return the names of what a declaration needs and does not have."""
    missing = [name for name in WORDS if not hasattr(cause, name)]
    if issubclass(cause, Template):
        missing += [name for name in ("size", "statistic") if not hasattr(cause, name)]
        missing += ["template"] * (cause.template is Template.template)
    return missing


class CauseRegistry(RegistryOfCauses[type[Cause]]):
    """Causes of static logs by code."""

    def extensions(self) -> dict[str, type[Extension]]:
        """Return the causes of single channels, by code."""
        return {code: cause for code, cause in self.items() if issubclass(cause, Extension)}

    def shares(self) -> int:
        """Return the shares of the budget of false alarms that the tests of all causes have together."""
        return sum(cause.shares * cause.tests for cause in self.values() if cause.tested_with is None)


CAUSES = CauseRegistry("cause", "tuner.causes", base=Cause, effects=EFFECTS, lacking=lacking)
CAUSES.extend(
    (
        Line, Temperature, ThermalLag, Step, Warmup, MountTilt, Ageing, Telegraph, MoreMarkov, Spikes, HeavyTails,
        Burst, VarianceDrift, Vibration, LowPass, Colour, Motion, CrossAxis, Thermal, Duplicates, Timing,
        Overflow, Clipping, Quantizer, RepeatedPackets, Interpolated, SkewedNoise, PeriodicVariance, TemperatureSquared,
        TemperatureRate, Hysteresis, Comb, Recovery, Transients,
        ErrorCode,
    )
)  # fmt: skip
