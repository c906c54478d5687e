"""What is said of a filter's scores, and what would explain them: codes with numbers (SI).

`tuner.report.verdict_text` puts them into words.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType


class Severity(StrEnum):
    """How much a verdict weighs."""

    DIVERGED = "diverged"
    """The filter diverged: nothing it says can be used."""
    EXPLANATION = "explanation"
    """Says why the filter diverged or what would explain its scores."""
    INCONSISTENT = "inconsistent"
    """A score speaks against the filter."""
    CONSISTENT = "consistent"
    """Nothing speaks against the filter."""


class VerdictCode(StrEnum):
    """What a verdict says, with the numbers that go with it."""

    DIVERGED = "diverged"
    NOT_FINITE = "diverged_not_finite"
    RUNS_DIVERGED = "diverged_in_runs"
    """`diverged_runs`, `runs`."""
    FIXES_REFUSED = "diverged_refusing_fixes"
    START_NOT_LINEAR = "initial_uncertainty_not_linear"
    """`attitude_sd`, `gyro_bias_sd`: three values each, rad and rad/s."""
    TRUTH_FAR = "truth_far_from_configuration"
    """True sd ÷ configured sd of each quantity, by its name; infinite where no sd is configured."""
    SPURIOUS_INFORMATION = "spurious_information"
    """Of `subject`: `filter_sd`, and `linear_sd` of linear covariance."""
    EXPLAINED = "explained"
    """`explanations`, the likeliest first."""
    NOT_EXPLAINED = "not_explained"
    OPTIMISTIC = "optimistic"
    """Of the score `subject`: `ratio` of true rms to predicted sd."""
    PESSIMISTIC = "pessimistic"
    """As `OPTIMISTIC`."""
    CORRELATED_INNOVATIONS = "correlated_innovations"
    """Of the part `subject`: `correlation`, `lag`, `band`."""
    CONSISTENT = "consistent"


class ExplanationKind(StrEnum):
    """In which way a configuration may be wrong."""

    SCALE = "scale"
    """The sd of a source is wrong by a ratio."""
    TIME_CONSTANT = "time_constant"
    """The time constants of a source are wrong by a ratio."""
    MISSING_SLOWER = "slower"
    """Decades of states slower than the slowest are missing."""
    MISSING_NEXT = "next"
    """One state, a decade slower than the slowest, is missing."""
    MISSING_FASTER = "faster"
    """One state, a decade faster than the fastest, is missing."""
    MISSING_CORRELATED = "correlated"
    """Errors of the fixes that stay for a time constant are missing, as strong as a ratio of the white ones."""
    INSTALLATION = "installation"
    """A constant of the installation differs from that of the truth by so much, SI."""


@dataclass(frozen=True)
class Explanation:
    """One thing wrong with a configuration that would explain the scores of its filter.

    Attributes
    ----------
    kind : ExplanationKind
        In which way it is wrong.
    process : str
        The source of errors, such as ``gyro bias noise``.
    ratio : float
        True ÷ configured sd, or time constant; of a missing process, its sd ÷ that of the state beside it, or of the
        white errors of the fixes; of the installation, the difference, m or s.
    interval : (float, float)
        95 % interval of the ratio; ends at the bounds of the search.
    misfit : float
        Sum of squares that it leaves over in the logarithms of the scores.
    time_constant : float or None
        Of the state beside a missing process, s, None where the filter has no states for it; of missing errors of
        fixes their own.
    equivalent : Explanation or None
        The same effect described otherwise: the runs do not distinguish the two.
    beside : Explanation or None
        What is wrong as well; the two explain the scores together.
    """

    kind: ExplanationKind
    process: str
    ratio: float
    interval: tuple[float, float]
    misfit: float
    time_constant: float | None = None
    equivalent: Explanation | None = None
    beside: Explanation | None = None

    @property
    def source(self) -> str:
        """What is wrong, in a few words that do not depend on the ratio."""
        return explanation_source(self.kind, self.process)


def explanation_source(kind: ExplanationKind, process: str) -> str:
    """Return the name of what is wrong, such as ``missing gyro bias noise (slower)``."""
    if kind is ExplanationKind.SCALE:
        return process
    if kind is ExplanationKind.TIME_CONSTANT:
        return f"time constants of the {process}"
    if kind is ExplanationKind.INSTALLATION:
        return process
    return f"missing {process} ({kind.value})"


@dataclass(frozen=True)
class Verdict:
    """One statement on a filter.

    Attributes
    ----------
    code : VerdictCode
        What is said; which numbers go with it, see there.
    severity : Severity
        How much it weighs.
    subject : str
        The score, state or part it is about; empty where it is about the whole filter.
    numbers : mapping of str to float or tuple of float
        SI.
    explanations : tuple of Explanation
        Of `VerdictCode.EXPLAINED`.
    """

    code: VerdictCode
    severity: Severity
    subject: str = ""
    numbers: Mapping[str, float | tuple[float, ...]] = field(default_factory=lambda: MappingProxyType({}))
    explanations: tuple[Explanation, ...] = ()
