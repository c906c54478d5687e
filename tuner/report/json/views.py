"""JSON of what follows from identifications: plans, comparisons, pooled records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from models.sensors import SensorGrade
from tuner.consistency.choose_grade import GradeChoice
from tuner.consistency.compare_sensors import SensorComparison
from tuner.formats.identification import identification_json
from tuner.formats.noise_terms import coefficient_json
from tuner.identification.gnss_receiver import ReceiverErrors
from tuner.identification.record_length import Plan
from tuner.synthesis.sufficient import unstated_terms
from tuner.types import Identification, PooledChannel, PooledCoefficient


def receiver_json(found: ReceiverErrors) -> dict[str, Any]:
    """Return the errors of a receiver at rest in the form ``tuner.receiver/1``."""
    return {
        "schema": "tuner.receiver/1",
        "interval": found.noise.interval,
        "position": {
            axis: {name: coefficient_json(c) for name, c in parts.items()}
            for axis, parts in found.position.items()
        },
        "velocity": {axis: {"white_sd": coefficient_json(c)} for axis, c in found.velocity.items()},
        "notes": list(found.notes),
    }


def plan_json(plans: Mapping[str, Plan]) -> dict[str, Any]:
    """Return the plan of every channel; hours are null beyond what can be waited for."""
    return {
        "schema": "tuner.plan/1",
        "channels": {
            axis: {
                "hours": plan.hours,
                "accuracy": plan.accuracy,
                "parameters": {
                    p.name: {
                        "value": p.value,
                        "relative_sd": p.relative_sd,
                        "shown": p.shown,
                        "hours": p.hours,
                    }
                    for p in plan.parameters
                },
                "cluster_rule": {"clusters": plan.clusters, "longest_tau": plan.longest_tau},
            }
            for axis, plan in plans.items()
        },
    }


def comparison_json(found: SensorComparison) -> dict[str, Any]:
    """Return every compared coefficient, in the order of the sources, the limits and the drift, m by seconds."""
    comparison = found.noise
    return {
        "schema": "tuner.comparison/1",
        "sources": list(comparison.names),
        "channels": {
            axis: {
                "unit": comparison.units[axis],
                "coefficients": {
                    row.name: {
                        "values": [None if v is None else coefficient_json(v) for v in row.values],
                        "ratio": row.ratio,
                        "ratio_interval": row.ratio_interval,
                        "differs": row.differs,
                    }
                    for row in rows
                },
            }
            for axis, rows in comparison.axes.items()
        },
        "limits": [
            {
                "measured": one.measured,
                "stated": one.stated,
                "passes": one.passes,
                "exceeded": [{"channel": a, "coefficient": c, "ratio": r} for a, c, r in one.exceeded],
            }
            for one in found.limits
        ],
        "receiver": found.receiver,
        "drift": [
            None
            if one is None
            else {
                kind: {f"{time:g}": value for time, value in errors.items()}
                for kind, errors in (("free", one.free), ("wheels", one.wheels))
            }
            for one in found.drift
        ],
        "not_stated": [list(unstated_terms(source)) for source in comparison.sources],
        "unranked": dict(found.unranked),
        "assumed": dict(found.assumed),
    }


def choice_json(found: GradeChoice) -> dict[str, Any]:
    """Return the ranking in the form ``tuner.choice/1``; errors in m, rms."""
    return {
        "schema": "tuner.choice/1",
        "outage_s": found.outage,
        "limit_m": found.limit,
        "receiver": found.receiver,
        "wheels": found.wheels,
        "ranking": [
            {
                "grade": one.name,
                "error_m": one.error,
                "kept": one.error <= found.limit,
                "not_stated": list(unstated_terms(one.config)),
            }
            for one in found.ranking
        ],
        "just_enough": None
        if found.factor is None
        else {"grade": found.nearest.name, "factor": found.factor},
    }


def pooled_json(
    names: Sequence[str], found: Sequence[Identification], pooled: Mapping[str, PooledChannel]
) -> dict[str, Any]:
    """Return the pooled coefficients of every channel, then each record's own identification."""
    return {
        "schema": "tuner.pooled/1",
        "records": list(names),
        "channels": {
            axis: {
                "unit": channel.unit,
                "coefficients": {row.name: _pooled(row) for row in channel.coefficients},
                "mean": None if channel.mean is None else _pooled(channel.mean),
            }
            for axis, channel in pooled.items()
        },
        "identifications": [identification_json(one) for one in found],
    }


def grades_json(grades: Sequence[SensorGrade]) -> dict[str, Any]:
    """Return the noise terms of every built-in grade, SI."""
    return {
        "schema": "tuner.grades/1",
        "grades": {
            grade.key: {
                "title": grade.title,
                "gyro": grade.noise_model("gyro").as_dict(),
                "accel": grade.noise_model("accel").as_dict(),
            }
            for grade in grades
        },
    }


def _pooled(row: PooledCoefficient) -> dict[str, Any]:
    return {
        "pooled": coefficient_json(row.value),
        "spread": coefficient_json(row.spread),
        "values": row.values,
        "equal_p_value": row.p_value,
    }
