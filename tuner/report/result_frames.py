"""The numbers of each type of result as a data frame: a row a number, with its interval and unit if it has them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import pandas as pd

from models.noise import RandomWalk
from tuner.consistency.choose_grade import GradeChoice
from tuner.consistency.compare_sensors import SensorComparison
from tuner.examination.examine import Examination
from tuner.identification.static_test_plan import StaticTestPlan
from tuner.report.coefficient_text import LEVEL_NAMES, coefficients_of
from tuner.report.consistency_answer import band_of
from tuner.types import AllanCurve, Coefficient, Correlogram, FilterConfig, Identification, Spectrum
from tuner.types.consistency import Consistency, Score
from tuner.types.diagnosis import Finding


def _coefficients(named: Iterable[tuple[Mapping[str, object], Coefficient]]) -> pd.DataFrame:
    """Return coefficients as rows behind what names them."""
    rows = [
        {
            **head,
            "value": c.value,
            "low": None if c.interval is None else c.interval[0],
            "high": None if c.interval is None else c.interval[1],
            "upper": c.upper,
            "unit": c.unit,
        }
        for head, c in named
    ]
    numbers = ["value", "low", "high", "upper"]
    return pd.DataFrame(rows).astype(dict.fromkeys(numbers, float)) if rows else pd.DataFrame(columns=numbers)


def identification_frame(found: Identification) -> pd.DataFrame:
    """Return every coefficient and level of every axis."""
    return _coefficients(
        ({"axis": axis, "coefficient": name}, c)
        for axis, channel in found.channels.items()
        for name, c in (
            *((name, c) for (name, _), c in coefficients_of(channel).items()),
            *((level, getattr(channel, level)) for level in LEVEL_NAMES),
        )
    )


def curve_frame(found: AllanCurve | Spectrum | Correlogram) -> pd.DataFrame:
    """Return a curve of every axis with its 95 % interval, where it has one."""
    if isinstance(found, Correlogram):
        columns = {"lag": found.lag, "value": found.value}
    else:
        low, high = found.interval()
        if isinstance(found, AllanCurve):
            columns = {
                "tau": found.tau,
                "deviation": found.deviation(),
                "low": low,
                "high": high,
                "dof": found.dof,
            }
        else:
            columns = {"frequency": found.frequency, "density": found.density, "low": low, "high": high}
    parts = [
        pd.DataFrame({"axis": axis, **{name: x[:, k] if x.ndim == 2 else x for name, x in columns.items()}})
        for k, axis in enumerate(found.axes)
    ]
    return pd.concat(parts, ignore_index=True)


def findings_frame(findings: Sequence[Finding]) -> pd.DataFrame:
    """Return every parameter of every finding."""
    return _coefficients(
        (
            {
                "finding": number,
                "cause": one.cause,
                "channels": " ".join(one.channels),
                "p_value": one.p_value,
                "parameter": name,
            },
            c,
        )
        for number, one in enumerate(findings)
        for name, c in one.parameters.items()
    )


def settings_frame(config: FilterConfig) -> pd.DataFrame:
    """Return every filter setting of every axis, in units of the axis."""
    rows: list[tuple[str, str, float, str]] = []
    for axis, noise in config.channels.items():
        rows += [
            (axis, "white_density", noise.white_density, f"{noise.unit}/√Hz"),
            (axis, "random_walk_density", noise.random_walk_density, RandomWalk(1.0).units(noise.unit)[0]),
            (axis, "constant_sd", noise.constant_sd, noise.unit),
        ]
        for state in noise.markov:
            rows.append((axis, f"markov_sd_{state.time_constant:g}s", state.sd, noise.unit))
    return pd.DataFrame(rows, columns=["axis", "setting", "value", "unit"])


def consistency_frame(found: Consistency, states: Sequence[Score] = ()) -> pd.DataFrame:
    """Return true rms ÷ predicted sd of each score, with its band."""
    columns = ["score", "ratio", "low", "high", "consistent"]
    rows = [(s.name, s.ratio, *band_of(s), s.consistent) for s in (*found.scores, *states)]
    return pd.DataFrame(rows, columns=columns)


def comparison_frame(found: SensorComparison) -> pd.DataFrame:
    """Return every coefficient of every axis and source."""
    noise = found.noise
    return _coefficients(
        ({"axis": axis, "coefficient": row.name, "source": name}, value)
        for axis, rows in noise.axes.items()
        for row in rows
        for name, value in zip(noise.names, row.values, strict=True)
        if value is not None
    )


def choice_frame(found: GradeChoice) -> pd.DataFrame:
    """Return the error of each grade and whether it keeps the limit."""
    rows = [(one.name, one.error, one.error <= found.limit) for one in found.ranking]
    return pd.DataFrame(rows, columns=["grade", "error", "kept"])


def plan_frame(found: StaticTestPlan) -> pd.DataFrame:
    """Return what a planned test shows of every coefficient; hours are NaN beyond what can be waited for."""
    return pd.DataFrame(
        [
            {
                "axis": axis,
                "coefficient": one.name,
                "value": one.value,
                "relative_sd": one.relative_sd,
                "shown": one.shown,
                "hours": float("nan") if one.hours is None else one.hours,
            }
            for axis, plan in found.items()
            for one in plan.parameters
        ]
    )


def examination_frame(found: Examination) -> pd.DataFrame:
    """Return the repairs of a drive, one a row."""
    return pd.DataFrame([vars(one) for one in found.repairs])
