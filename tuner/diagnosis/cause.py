"""Declaration of a cause: its effect, its words, its share of the false alarms, and how it is shown.

A cause is one class. What any stage has to know about it is an attribute of that class, and every table of causes is
computed from the registry `tuner.diagnosis.static.causes.registry.CAUSES`. How to write one: `docs/extending/cause.md`.
"""

from __future__ import annotations

from typing import ClassVar, Literal

from models.effects import Effect

Group = Literal["fast spectrum", "distribution", "slow part", "samples", "several channels"]
"""Where causes show; those of one group can be mistaken for each other."""
View = Literal[
    "time course",
    "peak",
    "spectrum",
    "temperature",
    "variance",
    "histogram",
    "values",
    "time stamps",
    "pairs",
]
"""Figures of `tuner.report.static_cause_panels`."""


class Cause:
    """One cause of a misfit between samples and their simulation."""

    cause: ClassVar[str]
    """Code, as findings, keys of simulations and ``--hide`` have it."""
    effect: ClassVar[type[Effect] | None] = None
    """Its generative model; None for what no simulation can hide."""
    named: ClassVar[bool] = True
    """Whether a finding names it; what has no name is reported as unexplained."""
    meaning: ClassVar[str]
    """What the cause is and how it shows, in one sentence."""
    consequence: ClassVar[str]
    """What a filter needs because of it, in one sentence."""
    group: ClassVar[Group]
    """Causes that it can be mistaken for."""
    shares: ClassVar[int] = 1
    """Shares of the budget of false alarms that each of its tests has: more for those that try more hypotheses.

    0 for what is read off the record, or has a threshold of its own far below the budget.
    """
    tests: ClassVar[int] = 1
    """Tests of a channel that look for it, each with its shares."""
    tested_with: ClassVar[str | None] = None
    """Code of the cause whose test, and share, it has in common with this one."""
    view: ClassVar[View] = "time course"
    """The figure that shows it best."""
    happens_once: ClassVar[bool] = False
    """Whether it is an event of one part of a record, of which another part says nothing."""
