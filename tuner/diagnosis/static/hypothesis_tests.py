"""Every hypothesis test on one fitted channel, and the budget of false alarms that they share.

The tests of one channel share `FALSE_ALARM_BUDGET`, that of a whole data set: each cause gets
budget ÷ (all shares × channels), and those that search hundreds of thousands of
frequencies several such shares [1]_: the least amplitude that is found falls there, and hardly rises elsewhere.

References
----------
.. [1] C. R. Genovese, K. Roeder, L. Wasserman, False discovery control with p-value weighting, Biometrika 93 (2006).
"""

from __future__ import annotations

import numpy as np

from models.probability import chi2_beyond
from tuner.diagnosis.static.causes import colour, lowpass, vibration
from tuner.diagnosis.static.causes.registry import CAUSES
from tuner.diagnosis.static.causes.template import Template
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.outcome import TestResult
from tuner.diagnosis.static.spectrum.shape import few_shapes, many_shapes
from tuner.diagnosis.static.variance import modulation
from tuner.diagnosis.static.variance.local_variance import course
from tuner.diagnosis.static.variance.quantized_noise import hides_noise

FALSE_ALARM_BUDGET = 3e-3
"""Probability that a data set without any effect gets a finding; chosen as one data set in three hundred."""
TESTS_WITHOUT_CAUSE = 13
"""Tests that no cause owns: misfit of the fast and of the slow spectrum, three of the local variance, masked pairs.

And seven checks of the final residuals (`tuner.diagnosis.static.residual_checks`).
"""
SHAPES = ("lowpass", "colour", "vibration")
"""Causes that are shapes of the fast spectrum, tested against each other by `spectrum`."""
CERTAIN_GAIN = 60.0
"""Gain beyond which an extension is not tested again, nats; chosen far beyond chance, e⁻⁶⁰."""


def shares() -> int:
    """Return the shares of the budget a channel: those of all causes, and one for each test that no cause owns."""
    return CAUSES.shares() + TESTS_WITHOUT_CAUSE


def threshold(channels: int) -> float:
    """Return the p-value below which a family with one share rejects, for a data set of so many channels."""
    return FALSE_ALARM_BUDGET / (shares() * channels)


def significant(result: TestResult, threshold: float) -> bool:
    """Return whether a result is less likely than the shares of its cause allow; one share allows the threshold."""
    cause = CAUSES.get(result.cause)
    return result.p_value < (1 if cause is None else cause.shares) * threshold


def hypothesis_tests(fitted: FittedChannel, known: tuple[TestResult, ...] = ()) -> tuple[TestResult, ...]:
    """Run every test that is still open on a fitted channel, but for those of single causes whose result is known.

    Where a quantizer hides the noise, only templates on the slow part are tested.
    """
    by_cause = {result.cause: result for result in known}
    if hides_noise(fitted):
        slow = [
            by_cause[code] if code in by_cause else cause.test(fitted)
            for code, cause in CAUSES.extensions().items()
            if issubclass(cause, Template) and is_open(fitted, code)
        ]
        return tuple(result for result in slow if result is not None)
    results = [
        by_cause[code] if code in by_cause else cause.test(fitted)
        for code, cause in CAUSES.extensions().items()
        if is_open(fitted, code)
    ]
    return (
        *(result for result in results if result is not None),
        *spectrum(fitted),
        *slow_spectrum_misfit(fitted),
        *modulation.test(fitted),
    )


def with_tests_anew(
    fitted: FittedChannel, results: tuple[TestResult, ...], causes: set[str]
) -> tuple[TestResult, ...]:
    """Return the results of a fitted channel, those of these causes, each tested alone, from this fit as well."""
    again = (CAUSES.extensions()[one.cause].test(fitted) if one.cause in causes else one for one in results)
    return tuple(result for result in again if result is not None)


def is_open(fitted: FittedChannel, cause: str) -> bool:
    """Return whether a channel may have this cause (once more)."""
    declared = CAUSES.extensions()[cause]
    if declared.needs_fine_quantizer and fitted.channel.deadband > 0.0:
        return False
    if fitted.count(*declared.contained_in):
        return False
    return fitted.count(cause, *declared.excludes) < declared.repeats


def is_tested_alone(cause: str) -> bool:
    """Return whether a cause has a test of its own, apart from those that compare shapes of the fast spectrum."""
    return cause in CAUSES.extensions() and cause not in SHAPES


def spectrum(fitted: FittedChannel) -> tuple[TestResult, ...]:
    """Test the fast spectrum for resonances and for its broad shape."""
    tested = few_shapes(fitted)
    name, nats = "shape of the fast spectrum", tested.misfit_nats
    unnamed = TestResult(
        "spectrum", tested.misfit, 0.0, tested.null.cost, name, misfit=nats, place=tested.worst
    )
    resonances = (vibration.test(fitted, tested),) if is_open(fitted, "vibration") else ()
    if fitted.count("lowpass", "colour"):
        return (*resonances, unnamed)
    known, tested = tested, many_shapes(tested)
    if resonances and tested.smooth is not known.smooth:
        resonances = (vibration.test(fitted, tested),)
    wide = (vibration.wide(tested, fitted),) if resonances else ()
    return (*resonances, lowpass.test(tested), colour.test(tested), *wide, unnamed)


def slow_spectrum_misfit(fitted: FittedChannel) -> tuple[TestResult, ...]:
    """Test the slow spectrum as a whole: bins of the squared residual coefficients against χ²."""
    singles = fitted.track.singles
    square = fitted.track.grid.amplitude[:singles] - fitted.track.columns @ fitted.fit.beta
    ratio = square**2 / fitted.fit.expected[:singles]
    edges = np.unique(np.geomspace(4, singles, 13).astype(int))
    count = np.diff(edges) / float(np.mean(course(fitted) ** 2))
    mean = np.add.reduceat(ratio[: edges[-1]], edges[:-1]) / np.diff(edges)
    share = count * (mean - 1.0 - np.log(mean))
    deviance = float(np.sum(share))
    inflation = float(np.mean(1.0 + 1.0 / (3.0 * count)))
    p_value = chi2_beyond(deviance / inflation, len(count))
    worst = int(np.argmax(share))
    longest, shortest = 2.0 * fitted.channel.span / edges[worst : worst + 2]
    place = f"{10.0 * np.log10(mean[worst]):+.2g} dB at periods of {shortest:.3g} … {longest:.3g} s"
    left = 0.5 * max(deviance - len(count), 0.0)
    name = "shape of the slow spectrum"
    return (TestResult("slow spectrum", p_value, 0.0, deviance, name, misfit=left, place=place),)


def retest(fitted: FittedChannel, cause: str) -> TestResult | None:
    """Run the test of one cause."""
    results = [CAUSES.extensions()[cause].test(fitted)]
    if cause == "lowpass" and not fitted.count("lowpass", "colour"):
        results.append(lowpass.test(few_shapes(fitted)))
    elif cause in SHAPES:
        results += [r for r in spectrum(fitted) if r.cause == cause]
    known = [result.confirm() if result.confirm else result for result in results if result is not None]
    return max(known, key=lambda result: (result.gain > 0, -result.p_value)) if known else None
