"""The panel: every family of tests on one residual.

Families of one channel share the budget of false alarms, `BUDGET` for a whole data set: each gets budget ÷ (`SHARES` ×
channels), and those that search hundreds of thousands of frequencies several such shares [1]_: the least amplitude that
is found falls there, and hardly rises elsewhere.

References
----------
.. [1] C. R. Genovese, K. Roeder, L. Wasserman, False discovery control with p-value weighting, Biometrika 93 (2006).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from scipy.stats import chi2

from tuner.diagnosis.static.causes import (
    burst,
    colour,
    gauss_markov,
    heavy_tails,
    line,
    lowpass,
    spikes,
    step,
    telegraph,
    temperature,
    thermal_lag,
    variance_drift,
    vibration,
    warmup,
)
from tuner.diagnosis.static.causes import mount_tilt as yielding
from tuner.diagnosis.static.causes import temperature_times_time as ageing
from tuner.diagnosis.static.model.residual import Residual
from tuner.diagnosis.static.outcome import Alarm
from tuner.diagnosis.static.spectrum.shape import few_shapes, many_shapes
from tuner.diagnosis.static.variance import modulation
from tuner.diagnosis.static.variance.level import course

BUDGET = 3e-3
"""Chance that a data set without any effect gets a finding."""
SEVERAL: Mapping[str, int] = MappingProxyType({"line": 15, "vibration": 3, "lowpass": 3, "colour": 3})
"""Shares of a family that has more than one; the last two are one family, which a wide hump belongs to as well."""
SHARES = 46
"""Shares of the budget a channel: 15 for lines, 3 for narrow humps, 3 for the shape of the fast spectrum, and one
for each of 25 more families, those of hygiene and of several channels included."""

CERTAIN = 60.0
"""Gain beyond which an extension is not put in question again, nats."""
SINGLE: Mapping[str, Callable[[Residual], Alarm | None]] = MappingProxyType(
    {
        "line": line.test,
        "temperature": temperature.test,
        "thermal_lag": thermal_lag.test,
        "step": step.test,
        "warmup": warmup.test,
        "attitude": yielding.test,
        ageing.UNNAMED: ageing.test,
        "telegraph": telegraph.test,
        "gauss_markov": gauss_markov.test,
        "spikes": spikes.test,
        "heavy_tails": heavy_tails.test,
        "burst": burst.test,
        "variance_drift": variance_drift.test,
    }
)
"""Tests that stand alone, by cause."""
LIMITS: Mapping[str, int] = MappingProxyType(
    {
        "line": line.Line.repeats,
        "vibration": vibration.Vibration.repeats,
        "step": step.Step.repeats,
        "attitude": yielding.Yielding.repeats,
        "burst": burst.Burst.repeats,
        "spikes": 2,
    }
)
"""How often a cause may be found in a channel, where not once."""
EXCLUSIVE: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"temperature": ("temperature", "thermal_lag"), "thermal_lag": ("temperature", "thermal_lag")}
)
"""Causes of which a channel has one at most."""
HIDDEN_BY_PATH = ("step", "warmup", "gauss_markov", "attitude")
"""Causes that what is wrong in the path of telegraph noise could be taken for."""
HIDDEN_BY_DEADBAND = ("heavy_tails", "spikes")
"""Causes that samples outside a dead band, rare and far from the others, could be taken for."""


def threshold(channels: int) -> float:
    """Return the chance below which a family with one share alarms, for a data set of so many channels."""
    return BUDGET / (SHARES * channels)


def believed(alarm: Alarm, threshold: float) -> bool:
    """Return whether an alarm is less likely than the shares of its family allow; one share allows the threshold."""
    return alarm.p_value < SEVERAL.get(alarm.cause, 1) * threshold


def panel(found: Residual, known: tuple[Alarm, ...] = ()) -> tuple[Alarm, ...]:
    """Run every test that is still open on a residual, but for the tests that stand alone whose alarm is known."""
    told = {alarm.cause: alarm for alarm in known}
    alarms = [
        told[cause] if cause in told else test(found)
        for cause, test in SINGLE.items()
        if is_open(found, cause)
    ]
    return (
        *(alarm for alarm in alarms if alarm is not None),
        *spectrum(found, whole=False),
        *leftovers(found),
        *modulation.test(found),
    )


def is_open(found: Residual, cause: str) -> bool:
    """Return whether a channel may have this cause (once more)."""
    if cause in HIDDEN_BY_DEADBAND and found.channel.deadband > 0.0:
        return False
    if cause in HIDDEN_BY_PATH and found.found("telegraph"):
        return False
    return found.found(*EXCLUSIVE.get(cause, (cause,))) < LIMITS.get(cause, 1)


def spectrum(found: Residual, *, whole: bool = True) -> tuple[Alarm, ...]:
    """Test the shape of the fast spectrum, and it for humps.

    Beside a narrow hump beyond doubt broad shapes are not asked for unless the `whole` is: it goes first.
    """
    tested = few_shapes(found)
    unnamed = Alarm("spectrum", tested.misfit, 0.0, tested.null.cost, tested.worst)
    humps = (vibration.test(found, tested),) if is_open(found, "vibration") else ()
    certain = any(hump.gain > CERTAIN for hump in humps)
    if found.found("lowpass", "colour") or (certain and not whole):
        return (*humps, unnamed)
    known, tested = tested, many_shapes(tested)
    if humps and tested.smooth is not known.smooth:
        humps = (vibration.test(found, tested),)
    wide = (vibration.wide(tested, found),) if humps else ()
    return (*humps, lowpass.test(tested), colour.test(tested), *wide, unnamed)


def leftovers(found: Residual) -> tuple[Alarm, ...]:
    """Test the slow spectrum as a whole: bins of the squared residual coefficients against χ²."""
    singles = found.track.singles
    square = found.track.grid.amplitude[:singles] - found.track.columns @ found.fit.beta
    ratio = square**2 / found.fit.expected[:singles]
    edges = np.unique(np.geomspace(4, singles, 13).astype(int))
    count = np.diff(edges) / float(np.mean(course(found) ** 2))
    mean = np.add.reduceat(ratio[: edges[-1]], edges[:-1]) / np.diff(edges)
    deviance = float(np.sum(count * (mean - 1.0 - np.log(mean))))
    inflation = float(np.mean(1.0 + 1.0 / (3.0 * count)))
    p_value = float(chi2.sf(deviance / inflation, len(count)))
    return (Alarm("slow spectrum", p_value, 0.0, deviance, "shape of the slow spectrum"),)


def retest(found: Residual, cause: str) -> Alarm | None:
    """Run the test of one cause."""
    alarms = [SINGLE[cause](found)] if cause in SINGLE else []
    if cause == "lowpass" and not found.found("lowpass", "colour"):
        alarms.append(lowpass.test(few_shapes(found)))
    elif cause in ("lowpass", "colour", "vibration"):
        alarms += [alarm for alarm in spectrum(found, whole=cause != "vibration") if alarm.cause == cause]
    known = [alarm for alarm in alarms if alarm is not None]
    return max(known, key=lambda alarm: (alarm.gain > 0, -alarm.p_value)) if known else None
