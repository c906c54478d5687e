"""Declaration of a cause of a drive, and the registry from which every table of causes is computed.

Another package adds a cause by an entry point of the group ``tuner.drive_causes`` that names its class. Most are a
`ConstantCause`: parameters, their sensitivities, a prior and words; tests, estimates and compensation follow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from models.arrays import FloatArray
from models.effects.drive import EFFECTS
from models.effects.drive.base import DriveEffect
from tuner.diagnosis.registry_of_causes import RegistryOfCauses
from tuner.types import Parameter

if TYPE_CHECKING:
    from tuner.diagnosis.drive.cause_test import CauseTest
    from tuner.diagnosis.drive.hypothesis import FilterRun, Hypothesis
    from tuner.linear_run.likelihood import NoiseHypothesis


Joins = Literal["preprocessing", "noise model", "measurement noise", "states"]
"""Part of a filter that a cause changes."""
View = Literal["distribution", "sensitivity", "positions", "velocities", "slow means"]
"""Figures of `tuner.report.drive_cause_panels`."""


@dataclass(frozen=True)
class FixGeometry:
    """Motion at k fixes, from which their sensitivity to a constant of the receiver follows.

    Attributes
    ----------
    mat_nb : ndarray, shape (k, 3, 3)
        Attitude of the filter's body frame.
    velocity : ndarray, shape (k, 3)
        Velocity of the antenna, north, east, down, m/s.
    acceleration : ndarray, shape (k, 3)
        Mean acceleration around the fix, m/s².
    rate : ndarray, shape (k, 3)
        Angular rate against the Earth, north, east, down, rad/s.
    since : ndarray, shape (k,)
        Seconds since the time halfway between the first and the last fix of the drive.
    """

    mat_nb: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    rate: FloatArray
    since: FloatArray


class DriveCause:
    """One cause of a misfit between a drive and the filter's model of it."""

    cause: ClassVar[str]
    """Code, as findings, keys of simulations and ``--hide`` have it."""
    effect: ClassVar[type[DriveEffect] | None] = None
    """Its generative model; None for what no simulation hides."""
    channels: ClassVar[tuple[str, ...]]
    """Whose error it is: ``gnss``, ``imu``, ``gyro``."""
    meaning: ClassVar[str]
    """What the cause is, in one sentence: clauses between commas, those with figures as `meaning_text` fills them."""
    consequence: ClassVar[str]
    """What to change in a filter, in one sentence."""
    joins: ClassVar[Joins] = "preprocessing"
    shares: ClassVar[int] = 1
    """Shares of the probability of a false finding in a clean drive that its test has."""
    view: ClassVar[View] = "distribution"
    """The figure that shows it best."""

    @classmethod
    def without(cls, final: Hypothesis, base: Hypothesis) -> Hypothesis:
        """Return the final hypothesis without this cause, which is then as in the hypothesis before the search."""
        return final.with_compensation_of(cls.cause, base)


class ConstantCause(DriveCause):
    """A cause of a few constants, which shift the innovations in proportion: tested by its score."""

    effect: ClassVar[type[DriveEffect]]
    """Says also what its parameters do to the sensors, and how they are taken out of a drive."""
    units: ClassVar[Mapping[str, str]]
    """SI unit of every parameter, by name."""
    prior_sd: ClassVar[float]
    """Spread of each parameter in practice, SI: the prior of its Bayes factor."""
    largest: ClassVar[float]
    """Value of a parameter from which the cause is not credible, however well it fits: something else is wrong."""
    down_acceleration: ClassVar[float] = 0.0
    """Acceleration down that one unit adds to the error model, m/s²."""
    view = "sensitivity"

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """Return its parameters, in the order of the columns of B and D."""
        return tuple(Parameter(cls.cause, name) for name in cls.units)

    @classmethod
    def fix_sensitivity(cls, geometry: FixGeometry) -> FloatArray | None:  # noqa: ARG003
        """Return D (k, 6, p): how its p parameters shift position and velocity fixes; None where they do not."""
        return None


class NoiseCause(DriveCause):
    """A cause that changes the noise, the rows or the biases of a linearised run: tested by likelihood."""

    tested_with: ClassVar[str | None] = None
    """Code of the cause whose `test` tests this one, too."""
    of_single_fixes: ClassVar[bool] = False
    """Whether it is found by leaving fixes out; such causes are tested again after each constant is accepted."""
    covers: ClassVar[tuple[str, ...]] = ()
    """Codes of constants that are a part of what it describes: they are sought no more once it is accepted."""
    rivals: ClassVar[tuple[str, ...]] = ()
    """Codes of causes that look alike; where there are some it is tested, for its cost, only where one of them is
    significant, or no cause is."""
    is_noise_scale: ClassVar[bool] = False
    """Whether it is factors on noise settings: estimated once, at the end, and no explanation of other factors."""

    @classmethod
    def test(cls, run: FilterRun, noise: NoiseHypothesis, threshold: float) -> tuple[CauseTest, ...]:
        """Test a run; several outcomes where causes share the test, or compete.

        Parameters
        ----------
        run : FilterRun
            The run.
        noise : NoiseHypothesis
            Its noise as configured, with the constants free that are fitted beside the test.
        threshold : float
            p value below which a test is significant.
        """
        raise NotImplementedError

    @classmethod
    def is_credible(cls, test: CauseTest) -> bool:  # noqa: ARG003
        """Whether a cause of the estimated size is met in practice."""
        return True

    @classmethod
    def accepted(cls, run: FilterRun, test: CauseTest) -> Hypothesis:
        """Return the hypothesis of a run with this cause added."""
        return run.hypothesis.with_noise(run.linearized, test)


class FinalCause(DriveCause):
    """A cause that is tested once, after the search, on the innovations that the other causes leave."""


FINAL_CAUSES = ("sensor_bias", "mounting")
"""Codes of these: `tuner.diagnosis.drive.diagnose` calls their tests by name, so that there are no others."""


def _lacking(cause: type[DriveCause]) -> list[str]:
    """Return the attributes that a declaration lacks; raise TypeError where no stage would test the cause."""
    if not issubclass(cause, ConstantCause | NoiseCause | FinalCause):
        raise TypeError("expected a subclass of ConstantCause or NoiseCause: no stage tests any other")
    if issubclass(cause, FinalCause) and cause.cause not in FINAL_CAUSES:
        only = " and ".join(FINAL_CAUSES)
        raise TypeError(
            f"expected a subclass of ConstantCause or NoiseCause: of FinalCause there are {only} only"
        )
    needed = ["cause", "channels", "meaning", "consequence"]
    if issubclass(cause, ConstantCause):
        needed += ["effect", "units", "prior_sd", "largest"]
    lacking = [name for name in needed if getattr(cause, name, None) is None]
    if issubclass(cause, NoiseCause) and cause.tested_with is None and _inherits_test(cause):
        lacking.append("test")
    return lacking


def _inherits_test(cause: type[NoiseCause]) -> bool:
    """Return whether a cause of the noise has no test but the one that raises."""
    line = cause.__mro__
    return not any("test" in vars(one) for one in line[: line.index(NoiseCause)])


DRIVE_CAUSES: RegistryOfCauses[type[DriveCause]] = RegistryOfCauses(
    "cause of a drive", "tuner.drive_causes", base=DriveCause, effects=EFFECTS, lacking=_lacking
)
"""All causes by code. `tuner.diagnosis.drive.causes.registry` declares the built-in ones."""


def constant_causes() -> dict[str, type[ConstantCause]]:
    """Return the causes that are constants, by code."""
    return {code: cause for code, cause in DRIVE_CAUSES.items() if issubclass(cause, ConstantCause)}


def noise_causes() -> dict[str, type[NoiseCause]]:
    """Return the causes that are tested by likelihood, by code."""
    return {code: cause for code, cause in DRIVE_CAUSES.items() if issubclass(cause, NoiseCause)}


def prior_sds(parameters: tuple[Parameter, ...]) -> FloatArray:
    """Return the spreads of p parameters in practice, shape (p,)."""
    causes = constant_causes()
    return np.array([causes[parameter.cause].prior_sd for parameter in parameters])


def constant_parameters() -> tuple[Parameter, ...]:
    """Return the parameters of all constant causes: the columns of B and D."""
    return tuple(parameter for cause in constant_causes().values() for parameter in cause.parameters())


def sensor_errors(parameters: tuple[Parameter, ...]) -> FloatArray:
    """Return E (p, 6, 6): one unit of a parameter changes measured rates and forces by E (ω, f), to first order."""
    return np.stack([EFFECTS[parameter.cause].sensor_error(parameter.name) for parameter in parameters])


def is_of_single_fixes(code: str) -> bool:
    """Whether a cause is found by leaving fixes out."""
    cause = DRIVE_CAUSES[code]
    return issubclass(cause, NoiseCause) and cause.of_single_fixes


def is_noise_scale(code: str) -> bool:
    """Whether a cause is factors on noise settings."""
    cause = DRIVE_CAUSES[code]
    return issubclass(cause, NoiseCause) and cause.is_noise_scale
