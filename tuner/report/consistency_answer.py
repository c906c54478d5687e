"""The answer of `check`, `navigate` and `score`: verdict, scores, errors, what to do; beside it each score's band."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from rich.table import Table

from tuner.consistency.error_budget import blind_spots
from tuner.consistency.error_budget import table as budget_rows
from tuner.formats.customary_units import digits, percent
from tuner.formats.reference_words import reference_line
from tuner.limits import HONEST_RATIO, SHOWN_FINDINGS, TOLERATED_RATIO
from tuner.report.document import Document, document, sentence
from tuner.report.titled_table import table_of, titled_table
from tuner.report.verdict_text import observability_text, score_title, verdict_text
from tuner.types.consistency import (
    Check,
    Consistency,
    EngineComparison,
    ErrorBudget,
    Observability,
    RmsError,
    Score,
)
from tuner.types.honesty import claim_name, claims, is_off, ratio_text, shows_dishonesty
from tuner.types.judgement import Use
from tuner.types.named_cause import separated
from tuner.types.verdict import Severity, VerdictCode

HEADS = ("score", "ratio", "expected", "outside")
"""Of a table of scores, of which not all decide the verdict."""
IN_THE_TABLE = (
    VerdictCode.OPTIMISTIC,
    VerdictCode.PESSIMISTIC,
    VerdictCode.CORRELATED_INNOVATIONS,
    VerdictCode.CONSISTENT,
)
"""Verdicts that rows and the verdict of the answer say."""


def consistency_answer(
    found: Consistency,
    notes: Sequence[str] = (),
    to_do: Sequence[str] = (),
    about: str = "",
    more: Iterable[Table | str] = (),
    causes: Sequence[str] = (),
) -> Document:
    """Return the verdict on a filter with its reason, its scores and errors, what to do, and notes that have room.

    Parameters
    ----------
    found : Consistency
        Scores of a filter.
    notes : sequence of str, optional
        What was repaired, found and assumed; causes that it names stand behind the verdict.
    to_do : sequence of str, optional
        What to do, and where files are.
    about : str, optional
        What was scored on what.
    more : iterable of Table or str, optional
        What is known beside the scores.
    causes : sequence of str, optional
        What explains the verdict and what to change.
    """
    found = found.shown
    faults, others = separated(notes)
    reasons = [] if causes else explanation_lines(found)
    named = [*reference_line(notes), *faults[:SHOWN_FINDINGS], *causes, *reasons]
    said = [about, f"Verdict: {found.honesty.text}", *named]
    table = [_score_table(found)] if found.scores or found.errors else []
    return document(
        [*said, *table, *map(_legend, table), _further(found), *to_do],
        [*faults[SHOWN_FINDINGS:], *(f"Note: {note}" for note in others)],
        more=[*_bands(found), *more],
        beyond="every score with its band",
    )


def check_answer(found: Check, about: str = "") -> Document:
    """Return the answer of a Monte-Carlo check; the error budget, where it was wanted, is added to it."""
    shares = (
        []
        if found.budget is None or found.observability is None
        else budget_tables(found.budget, found.observability)
    )
    line = "" if found.engines is None else engine_line(found.engines)
    return consistency_answer(found.consistency, found.notes, [line], about, shares)


def engine_line(found: EngineComparison) -> str:
    """Return whether filterpy and the compiled filter agree, by how much they differ at most, and where they do not."""
    size = f"{found.difference:.1e} sd"
    if found.agree:
        return (
            f"Engines agree: filterpy and compiled within {size}, in {found.runs} of {found.simulated} runs"
        )
    where = f"{found.state}, {size}, run {found.run} at {found.t:g} s"
    return f"Engines differ: filterpy and compiled in {where}: trust no score"


def explanation_lines(found: Consistency) -> list[str]:
    """Return why a filter diverged, or which setting explains its scores best; nothing where it is honest."""
    if found.honesty.good:
        return []
    explained = [one for one in found.verdicts if one.severity in (Severity.EXPLANATION, Severity.DIVERGED)]
    return [sentence(verdict_text(replace(one, explanations=one.explanations[:1]))) for one in explained[:2]]


def _score_table(found: Consistency) -> Table:
    """Return errors, errors ÷ what was predicted of every score, with its interval, and what those that decide say."""
    errors = {name: _rms_text(one, [math.hypot(*one.values)]) for name, one in found.errors.items()}
    outages = {one.score.name: one for one in found.outages}
    decisive = list(claims(found))
    together = found.nis[:1] if len(found.nis) > 1 else ()  # said by its parts
    rows = []
    for one in (each for each in found.scores if each not in together):
        outage = outages.get(one.name)
        size = errors.pop(one.name, "") if outage is None else f"{digits(outage.rms)} m"
        text = ratio_text(one.ratio, one.interval if outage is None else outage.interval)
        rows.append((_name(one, found), size, text, _judged(one) if one in decisive else ""))
    rows += [(score_title(name), size, "", "") for name, size in errors.items()]
    heads = "rms", "error" if found.has_truth else "distance", "÷ predicted (95 %)", "verdict"
    return table_of(heads, rows, words=len(heads))


def _judged(one: Score) -> str:
    """Return what a score says of the filter."""
    if is_off(one):
        return Use.OPTIMISTIC if one.ratio > 1.0 else Use.PESSIMISTIC
    return Use.HONEST if shows_dishonesty(one) else "undecided"


def _name(one: Score, found: Consistency) -> str:
    """Return what a row is of; where there is no truth, states are compared with the smoother."""
    words = score_title(one.name, has_truth=found.has_truth)
    fixes = found.has_truth or one in found.nis or one.name in {each.score.name for each in found.outages}
    return words if fixes else f"{words}, to the smoother"


def _rms_text(one: RmsError, values: Iterable[float], names: Iterable[str] = ("",)) -> str:
    """Return rms errors behind the names of their axes, in their unit or, of angles, degrees."""
    size, unit = (math.degrees(1.0), "deg") if one.unit == "rad" else (1.0, one.unit)
    parts = (f"{name} {digits(size * value)}" for name, value in zip(names, values, strict=False))
    return f"{', '.join(parts)} {unit}".strip()


def _legend(table: Table) -> str:
    """Return what the rows of a table are judged by; nothing of what it does not have."""
    names, *_, verdicts = ([*map(str, column.cells)] for column in table.columns)
    attitude = f" (attitude {1.0 / TOLERATED_RATIO:g} to {TOLERATED_RATIO:g})" * ("attitude, 3-D" in names)
    honest = f"honest: {1.0 / HONEST_RATIO:.2f} to {HONEST_RATIO:g}{attitude}, or explained by chance"
    others = {"undecided": "undecided: too little data", "": "blank: not judged"}
    own = (text for word, text in others.items() if word in verdicts)
    return "; ".join([honest, *own]) if any(verdicts) else ""


def _further(found: Consistency) -> str:
    """Return what the table does not show: correlation of the innovations, refused fixes."""
    white, refused = found.whiteness, f"{percent(found.gated)} of fixes refused"
    others = [refused] if found.gated else []
    if white is not None and not white.consistent:
        others.insert(0, f"innovations correlated, {white.correlation:+.2f} at lag {white.lag}")
    return "; ".join(others)


def _bands(found: Consistency) -> list[Table | str]:
    """Return each score with its band, errors by axis, and other verdicts."""
    rows = score_rows(found.scores)
    if (white := found.whiteness) is not None:
        name = f"correlation of {white.part} innovations, lag {white.lag}"
        said = "" if white.consistent else "correlated"
        rows.append([name, f"{white.correlation:+.3f}", f"±{white.band:.3f}", said])
    windows = (f"{one.seconds:g} s {one.windows}" for one in found.outages)
    axes = ("north", "east", "down")
    return [
        *titled_table("true rms ÷ predicted sd (99 % over all scores, 10 % margin)", HEADS, rows),
        *([f"  windows without fixes: {', '.join(windows)}"] if found.outages else []),
        *(
            f"  rms of {claim_name(name).removesuffix(' (root of NIS)')}: {_rms_text(each, each.values, axes)}"
            for name, each in found.errors.items()
            if len(each.values) > 1
        ),
        *(f"  {verdict_text(verdict)}" for verdict in found.verdicts if verdict.code not in IN_THE_TABLE),
    ]


def band_of(score: Score) -> tuple[float, float]:
    """Return the ratios, true rms ÷ predicted sd, that do not speak against the filter."""
    low, high = np.sqrt(np.divide(score.band, score.dof)).tolist()
    return low, high


def score_rows(scores: Iterable[Score]) -> list[list[str]]:
    """Return what each score is of, its ratio and band, and what it says where it is off, as `HEADS`."""
    return [
        [
            score_title(one.name),
            f"{one.ratio:.3f}",
            " … ".join(f"{end:.2f}" for end in band_of(one)),
            "" if one.consistent else "above" if one.ratio > 1.0 else "below",
        ]
        for one in scores
    ]


def budget_tables(budget: ErrorBudget, seen: Observability) -> list[Table | str]:
    """Return the shares of every source, what is left of the prior, and what stays hidden.

    Shares are per cent of the variances of position, velocity and attitude, aided and without fixes. Beside
    them stands by how much the sd of a source may be wrong before any error leaves the 10 % margin.
    """
    cases, spots = budget_rows(budget), blind_spots(budget)
    rows = []
    for j, name in enumerate(budget.sources):
        small, large = spots[name]
        shares = (" / ".join(f"{100.0 * x:.0f}" for x in part[j]) for _, part in cases)
        rows.append([name, *shares, f"{small:.2g}, {'never' if math.isinf(large) else f'{large:.2g}'}"])
    heads = ["source", *(case for case, _ in cases), "shows where × too small, large"]
    left = ([name, f"{100.0 * value:.3g}"] for name, value in seen.left.items())
    return [
        *titled_table("share of the variance of position / velocity / attitude, %", heads, rows),
        *titled_table("sd after the last fix, % of that at the start", ("state", "%"), left),
        *(f"  {sentence}" for sentence in observability_text(seen)),
    ]
