"""From inertial-sensor recordings to navigation-filter settings one can trust.

The whole way, from a log (and perhaps a measured drive) to a configuration and its check::

    result = tuner.tune("static.csv", drive="drive.npz")
    result.config, result.diagnosis, result.check

and its parts, in the order of the work::

    records = tuner.read("static.csv")                  # a log, in SI units
    noise = tuner.identify(records)                     # noise terms with intervals
    diagnosis = tuner.diagnose(records)                 # what a simulation of that noise gets wrong, and why
    config = tuner.synthesize(noise, records=records)   # settings of a navigation filter that predict the log
    verdict = tuner.check(config)                       # Monte-Carlo consistency of that filter
    scores = tuner.navigate("drive.npz", config)        # the same filter on a measured drive
    judged = tuner.score(errors, covariances)           # anyone's Monte Carlo: NEES, and each state
    seen = tuner.examine(drive)                         # what is wrong with its streams, before any filter
    table = tuner.compare("static.csv", "mpu9250")      # sensors side by side, with predicted drift
    grades = tuner.choose(outage=60, error=2)           # the grade for a tunnel of 60 s
    hours = tuner.plan(noise, hours=1.0, accuracy=0.1)  # how long a static test must be
    allan = tuner.curve(records[0], "oadev")            # one statistic of a record, raw
    text = tuner.export(config, "kalibr")               # the dialect of another filter
    units = tuner.fleet("logs/", limits="limits.yaml")  # many units: limits, outlying ones, spread

Every function returns a frozen result, prints nothing and writes no file; `tuner.report` draws and writes. They are
imported when first used, so that starting is quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tuner.consistency.check import check
    from tuner.consistency.choose_grade import choose
    from tuner.consistency.compare_sensors import compare
    from tuner.consistency.score_drive import navigate_recorded as navigate
    from tuner.consistency.score_output import score_arrays as score
    from tuner.curves import empirical as curve
    from tuner.diagnosis import diagnose
    from tuner.examination.examine import examine
    from tuner.exporters import export
    from tuner.identification.identify_source import identify_log as identify
    from tuner.identification.static_test_plan import plan_test as plan
    from tuner.pipeline import tune
    from tuner.production.fleet import fleet
    from tuner.readers import read
    from tuner.synthesis import synthesize

__all__ = [
    "check",
    "choose",
    "compare",
    "curve",
    "diagnose",
    "examine",
    "export",
    "fleet",
    "identify",
    "navigate",
    "plan",
    "read",
    "score",
    "synthesize",
    "tune",
]

_HOMES = {
    "tune": ("tuner.pipeline", "tune"),
    "read": ("tuner.readers", "read"),
    "identify": ("tuner.identification.identify_source", "identify_log"),
    "diagnose": ("tuner.diagnosis", "diagnose"),
    "examine": ("tuner.examination.examine", "examine"),
    "synthesize": ("tuner.synthesis", "synthesize"),
    "check": ("tuner.consistency.check", "check"),
    "navigate": ("tuner.consistency.score_drive", "navigate_recorded"),
    "score": ("tuner.consistency.score_output", "score_arrays"),
    "compare": ("tuner.consistency.compare_sensors", "compare"),
    "choose": ("tuner.consistency.choose_grade", "choose"),
    "plan": ("tuner.identification.static_test_plan", "plan_test"),
    "curve": ("tuner.curves", "empirical"),
    "export": ("tuner.exporters", "export"),
    "fleet": ("tuner.production.fleet", "fleet"),
}
"""Module and name of each function."""


def __getattr__(name: str) -> Any:
    """Return a function of the package, imported when first used."""
    if name not in _HOMES:
        raise AttributeError(f"module 'tuner' has no attribute {name!r}")
    module, attribute = _HOMES[name]
    return getattr(importlib.import_module(module), attribute)


def __dir__() -> list[str]:
    """Return the names of the package with the functions that are not imported yet."""
    return sorted({*globals(), *__all__})
