"""The answers of `compare`, `choose` and `plan`, and the built-in grades."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.table import Table

from models.sensors import SensorGrade
from tuner.consistency.choose_grade import GradeChoice, RankedGrade
from tuner.consistency.compare_sensors import SensorComparison
from tuner.formats.axis_words import axes_text
from tuner.formats.customary_units import (
    customary_unit,
    digits,
    in_customary,
    pretty,
    range_text,
    symbol,
)
from tuner.formats.grouping import gathered
from tuner.identification.comparison import LimitCheck
from tuner.identification.static_test_plan import StaticTestPlan
from tuner.report.document import Document, document
from tuner.report.identification_answer import sensor_or_axes, terms_table, warning_lines
from tuner.report.identification_tables import identification_tables
from tuner.report.noise_table import FLICKER, NAMES, WHITE, legend
from tuner.report.terms_rows import MAIN_TERMS, channel_row, joined_rows
from tuner.report.titled_table import table_of, titled_table
from tuner.synthesis.sufficient import unstated_terms
from tuner.types import FilterConfig

NEAREST_GRADES = 3
"""Grades of an answer: the last that keeps the limit and two that do not."""
ANSWERED_TIME = 60.0
"""Time without fixes of the sentence that answers a comparison, s."""
AT_LEAST = "≥ "
"""Before an error to which a term adds that is not known."""
UNITS = {"gyro": "rad/s", "accel": "m/s^2"}


def comparison_answer(found: SensorComparison) -> Document:
    """Return which sensor errs how far without fixes, the noise of each, and limits, differences, warnings."""
    sources = list(zip(found.noise.names, found.noise.sources, strict=True))
    rows = [
        (name, row)
        for name, source in sources
        for row in joined_rows(channel_row(channel) for channel in source.channels.values())
    ]
    table = terms_table(rows)
    return document(
        [*_drift(found), table, f"{legend(table)}; a number alone: stated".removeprefix("; ")],
        [
            *map(limit_text, found.limits),
            _differences(found),
            *(f"{name}: {warning}" for name, source in sources for warning in warning_lines(source)),
        ],
        more=[part for name, source in sources for part in (f"{name}:", *identification_tables(source))],
    )


def limit_text(one: LimitCheck) -> str:
    """Return whether a measured sensor keeps what is stated, and where it does not, by how much."""
    head = f"{one.measured} against {one.stated}:"
    if one.passes:
        return f"{head} PASS: no interval lies above any of {one.within} stated numbers"
    return f"{head} FAIL: {_ratios_text(one.exceeded)} what is stated"


def _ratios_text(found: Iterable[tuple[str, str, float]]) -> str:
    """Return ratios of coefficients, each with its axes and the range of its ratios."""
    terms = gathered((NAMES.get(name, symbol(name)), (axis, ratio)) for axis, name, ratio in found)
    ratios = {term: dict(each) for term, each in terms.items()}
    return "; ".join(
        f"{term} of {axes_text([*at])} {range_text(at.values())} ×" for term, at in ratios.items()
    )


def _differences(found: SensorComparison) -> str:
    """Return where the last source differs from the first with 95 %, and the ratios that lack an interval."""
    noise = found.noise
    rows = [
        (row.differs, (axis, row.name, row.ratio))
        for axis, own in noise.axes.items()
        for row in own
        if row.ratio is not None and "." in row.name
    ]
    if all(differs is None for differs, _ in rows):
        return ""
    differing = [ratio for differs, ratio in rows if differs]
    unknown = [ratio for differs, ratio in rows if differs is None]
    pair = f"{noise.names[-1]} ÷ {noise.names[0]}"
    said = f"differs at 95 % in {_ratios_text(differing)}" if differing else "differs in no term at 95 %"
    return f"{pair} {said}" + (f"; without an interval: {_ratios_text(unknown)}" if unknown else "")


def _drift(found: SensorComparison) -> list[Table | str]:
    """Return the drift of each source without fixes, the least first, and how it is predicted.

    That of a source that lacks a slow term is at least as large as stated, so that it has no rank.
    """
    sources = zip(found.noise.names, found.drift, found.noise.sources, strict=True)
    known = [
        (" and ".join(unstated_terms(source)), name, one) for name, one, source in sources if one is not None
    ]
    unranked = [f"{name} has no rank: {why}" for name, why in found.unranked.items()]
    if not known:
        return ["Verdict: not comparable: no source has six axes with white noise and a slow bias", *unranked]
    times = list(known[0][2].free)
    known.sort(key=lambda each: (bool(each[0]), each[2].free[times[-1]]))
    errors = [(lacks, name, f"{name} {digits(one.free[ANSWERED_TIME], 2)} m") for lacks, name, one in known]
    said = ", ".join(text for lacks, name, text in errors if not lacks and name not in found.assumed)
    half = ", ".join(text for lacks, name, text in errors if not lacks and name in found.assumed)
    half += " (no rank: half of limits is ASSUMED)" * bool(half)
    least = ", ".join(
        f"{text} or more (no rank: its {lacks} is not stated)" for lacks, _, text in errors if lacks
    )
    kinds = (("without fixes", times), ("non-holonomic", times))
    heads = [f"{kind * (time == times[0])}\n{time:g} s" for kind, each in kinds for time in each]
    rows = [
        (
            name,
            *(f"{AT_LEAST * bool(lacks)}{digits(x, 2)}" for x in (*one.free.values(), *one.wheels.values())),
        )
        for lacks, name, one in known
    ]
    about = (
        f"Predicted for a filter tuned to each sensor, after 15 min in a city with {found.receiver} fixes; "
        "non-holonomic: with that constraint. Scale factors and misalignments are not included."
    )
    about += f" {AT_LEAST.strip()}: at least." * bool(least)
    parts = "; ".join(filter(None, (said, half, least)))
    verdict = f"Verdict: after {ANSWERED_TIME:g} s without fixes the position errs by: {parts}"
    assumed = [f"{name}: {why}" for name, why in found.assumed.items()]
    return [verdict, table_of(("horizontal\nerror, m rms", *heads), rows), *unranked, *assumed, about]


def steadiest(found: SensorComparison) -> int:
    """Return the place of the source that drifts least among those of which every term is known; 0 for none."""
    drifts = {
        number: one.free[max(one.free)]
        for number, (one, source) in enumerate(zip(found.drift, found.noise.sources, strict=True))
        if one is not None and not unstated_terms(source) and found.noise.names[number] not in found.assumed
    }
    return min(drifts, key=lambda number: drifts[number], default=0)


def choice_answer(found: GradeChoice) -> Document:
    """Return how many of the built-in grades stay within the limit, those nearest to it, and which noise just does."""
    kept, count = len(found.kept), len(found.ranking)
    with_wheels = "with" if found.wheels else "without"
    before = f"horizontal, rms; {found.receiver} fixes before; {with_wheels} a non-holonomic constraint"
    least = any(unstated_terms(one.config) for one in found.ranking[:kept])
    verdict = (
        f"Verdict: {'at most ' * least}{kept or 'none'} of {count} built-in sensors stay{'s' * (kept <= 1)} within "
        f"{found.limit:g} m after {found.outage:g} s without fixes ({before})"
    )
    first = max(0, min(kept - 1, count - NEAREST_GRADES))
    nearest = found.ranking[first : first + NEAREST_GRADES]
    if found.factor is None:
        just = (
            "No factor on the noise of a grade leads to the limit: other errors than the sensor's decide it"
        )
    else:
        gyro_n, gyro_b, accel_n, accel_b = (
            digits(v, 2) for v in noise_of(found.nearest.config, found.factor)
        )
        just = (
            f"{digits(found.factor, 2)} × the noise of {found.nearest.name} just stays within: gyro white noise "
            f"{gyro_n} deg/√h, B {gyro_b} deg/h; accel white noise {accel_n} µg/√Hz, B {accel_b} µg"
        )
    about = "B: bias instability. Scale factors and misalignments are not included."
    about += f" {AT_LEAST.strip()}: at least, as its sheet leaves a slow term out." * any(
        unstated_terms(one.config) for one in nearest
    )
    answer = document(
        [
            f"{verdict}. The nearest:" if count > len(nearest) else verdict,
            _ranking(found, nearest),
            f"{just}. {about}",
        ],
        more=[_ranking(found, found.ranking)] if count > len(nearest) else [],
        beyond="all sensors",
    )
    pair = [one.name for one in nearest[:2]]
    return answer.then("compare", *pair) if len(pair) > 1 else answer


def _ranking(found: GradeChoice, shown: Sequence[RankedGrade]) -> Table:
    """Return some grades with their error and noise."""
    heads = ("sensor", "error,\nm rms", "within\nit", "gyro white\nnoise, deg/√h", "B,\ndeg/h")
    rows = (
        (
            one.name,
            f"{AT_LEAST * bool(unstated_terms(one.config))}{digits(one.error, 2)}",
            "no" if one.error > found.limit else "open" if unstated_terms(one.config) else "yes",
            *(digits(value) if value > 0.0 else "–" for value in noise_of(one.config, 1.0)),
        )
        for one in shown
    )
    return table_of((*heads, "accel white\nnoise, µg/√Hz", "B,\nµg"), rows)


def noise_of(config: FilterConfig, factor: float) -> tuple[float, ...]:
    """Return N and B of gyro x and accelerometer x of a grade times a factor, customary units; 0 where not stated."""
    known = {
        (axis, f"{term.name}.{field}"): one.value or 0.0
        for axis in ("gyro_x", "accel_x")
        for term in config.channels[axis].identified
        for field, one in term.coefficients.items()
    }
    return tuple(
        factor * in_customary(known.get((axis, name), 0.0), name, config.channels[axis].unit)
        for axis in ("gyro_x", "accel_x")
        for name in (WHITE, FLICKER)
    )


def grade_tables(grades: Sequence[SensorGrade]) -> list[Table | str]:
    """Return the built-in grades, one a row, in customary units."""
    columns = [(kind, quantity) for kind in UNITS for quantity in MAIN_TERMS]
    heads = (f"{kind} {symbol(name)}, {pretty(customary_unit(name, UNITS[kind]))}" for kind, name in columns)
    rows = []
    for grade in grades:
        values = {
            (kind, f"{term.name}.{field}"): getattr(term, field)
            for kind in UNITS
            for term in grade.noise_model(kind).terms
            for field in term.PARAMETERS
        }
        cells = (
            "–" if column not in values else digits(in_customary(values[column], column[1], UNITS[column[0]]))
            for column in columns
        )
        rows.append((grade.key, grade.title, *cells))
    title = "Built-in sensor grades (references: configs/sensors)"
    return [*titled_table(title, ("name", "sensor", *heads), rows, words=2)]


def plan_answer(plans: StaticTestPlan, limited: str = "") -> Document:
    """Return what a planned test shows of each term of each sensor, the worst axis, and the cluster rule.

    Of the terms that `limited` names only limits are known: nothing is planned of them.
    """
    first = next(iter(plans.values()))
    wanted = f"{100 * first.accuracy:g} %"
    groups = gathered(
        ((plans.units[axis], p.name), (axis, p)) for axis, plan in plans.items() for p in plan.parameters
    )
    rows, hidden = [], []
    for (unit, name), found in groups.items():
        values = [in_customary(p.value, name, unit) for _, p in found]
        spread = max(p.relative_sd for _, p in found)
        hours = [p.hours for _, p in found]
        term = f"{sensor_or_axes([axis for axis, _ in found], list(plans))} {NAMES.get(name, symbol(name))}"
        if not all(p.shown for _, p in found):
            hidden.append(term)
        rows.append(
            (
                term,
                f"{range_text(values)} {pretty(customary_unit(name, unit))}",
                f"{digits(100 * spread, 2)} %" if spread < 10 else "> 1000 %",
                "limit only" if term in hidden else "yes",
                "more than 10 000" if None in hours else digits(max(h for h in hours if h is not None), 2),
            )
        )
    shows = (
        f"all but {', '.join(hidden)}" if hidden else f"every term{' whose size is known' * bool(limited)}"
    )
    span = f"{digits(first.hours)} h"
    return document(
        [
            f"Verdict: {span} of {plans.name} at rest show {shows}",
            table_of((f"{plans.name}, {span}", "assumed", "1 sd", "shown", f"hours for {wanted}"), rows),
            f"Not planned, as only limits are known: {limited}. A sheet with values to expect plans them"
            if limited
            else "",
            f"An Allan deviation is known to {wanted} where {first.clusters} averages fit into the log: here up to "
            f"{digits(first.longest_tau)} s. Of several axes the worst is shown.",
        ]
    )
