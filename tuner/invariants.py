"""What no answer may say: sentences that hold for every result before it is printed, drawn or written.

A result is reduced to what it claims (`Claims`); each invariant is one function of that. `violations` is empty for
every result of this program; tests hold it against made and simulated results, and against each invariant broken on
purpose. A result that would violate one is mended where it is made: a name is withdrawn (`names`), a file withheld
(`TuneResult.written`), a verdict lowered (`tuner.judgement`).

Numbers are those of the invariants of the project: 1 nothing contradicts, 2 power, 3 one file one verdict, 4 errors are
against a truth, 5 bounds name nothing, 6 losses are counted, 8 one quantity one number, 9 not worse than the fixes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from tuner.formats.customary_units import percent
from tuner.limits import LOST_SHARE, WRONG_FACTOR
from tuner.types import Finding
from tuner.types.consistency import Consistency
from tuner.types.honesty import claims as scored_claims
from tuner.types.honesty import is_off, shows_dishonesty
from tuner.types.judgement import Judgement, Use

NUMBER_DIGITS = 5
"""Digits in which two statements about one quantity are the same number: files keep six."""


@dataclass(frozen=True)
class Statement:
    """One number that is shown or written: of which quantity, where, with its interval or upper limit."""

    quantity: str
    place: str
    value: float
    interval: tuple[float, float] | None = None
    limit: float | None = None


@dataclass(frozen=True)
class Claims:
    """What a result claims.

    Attributes
    ----------
    verdict : Judgement
        For what it can be used.
    scores : tuple of Consistency
        Scores of filters behind it.
    unexplained : tuple of str
        What has no cause.
    names : tuple of Finding
        Causes that are named.
    errors : mapping of str to bool
        Names of figures that are called errors, and whether they are distances to a truth.
    lost : mapping of str to float
        Share of the samples of each axis that is left out.
    statements : tuple of Statement
        Numbers shown or written.
    files : tuple of str
        Settings that are written.
    beside_fixes : (float, float) or None
        Errors with fixes of the filter and of the fixes alone, m, on data not used for it; None without a truth.
    """

    verdict: Judgement
    scores: tuple[Consistency, ...] = ()
    unexplained: tuple[str, ...] = ()
    names: tuple[Finding, ...] = ()
    errors: Mapping[str, bool] = field(default_factory=lambda: MappingProxyType({}))
    lost: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    statements: tuple[Statement, ...] = ()
    files: tuple[str, ...] = ()
    beside_fixes: tuple[float, float] | None = None


def violations(said: Claims) -> tuple[str, ...]:
    """Return what of a result must not be said, one sentence each with the number of its invariant."""
    return tuple(f"{number}: {text}" for number, check in INVARIANTS.items() for text in check(said))


def _nothing_beside_a_failure(said: Claims) -> Iterator[str]:
    """1: nothing contradicts, or usable without reservation, never beside a score that failed or an unnamed rest."""
    if said.verdict.use is Use.NOTHING_CONTRADICTS:
        yield from (f"nothing contradicts beside {one}" for one in said.unexplained)
    if said.verdict.use in (Use.USABLE, Use.HONEST, Use.NOTHING_CONTRADICTS):
        yield from (
            f"{said.verdict.use} beside {score.name} {score.ratio:.2f}"
            for found in said.scores
            for score in scored_claims(found)
            if is_off(score)
        )


def _honest_with_power(said: Claims) -> Iterator[str]:
    """2: honest only where some score could have shown that it is not."""
    if said.verdict.use is Use.HONEST:
        for found in said.scores:
            if not any(shows_dishonesty(one) for one in scored_claims(found)):
                yield "honest, but no score could have shown otherwise"


def _one_verdict_on_a_file(said: Claims) -> Iterator[str]:
    """3: settings are not usable without reservation where the filter itself is not honest in simulation."""
    if said.verdict.use is Use.USABLE:
        yield from (
            f"usable, but the filter is {found.honesty.use}"
            for found in said.scores
            if found.honesty.use in (Use.OPTIMISTIC, Use.PESSIMISTIC, Use.DO_NOT_USE)
        )


def _errors_against_a_truth(said: Claims) -> Iterator[str]:
    """4: an error is a distance to a truth."""
    yield from (
        f"{name} is called an error without a truth" for name, known in said.errors.items() if not known
    )


def _bounds_name_nothing(said: Claims) -> Iterator[str]:
    """5: an estimate at a bound, or one that is hardly determined, names nothing; what is named is explained."""
    yield from (
        f"{one.cause} is named by an estimate that is not determined"
        for one in said.names
        if not one.determined
    )
    yield from (
        f"{one.cause} is named, and unexplained"
        for one in said.names
        if any(left.startswith(f"{one.cause}: ") for left in said.unexplained)
    )
    for one in said.statements:
        if one.interval is not None and not one.interval[0] <= one.value <= one.interval[1]:
            yield f"{one.quantity} {one.value:g} outside its own interval, {one.place}"
        if one.limit is not None and one.value > one.limit:
            yield f"{one.quantity} {one.value:g} above its own limit {one.limit:g}, {one.place}"


def _losses_are_said(said: Claims) -> Iterator[str]:
    """6: of what may be used, what is left out beyond `LOST_SHARE` stands on the first screen, in the verdict."""
    text = said.verdict.text
    for axis, share in said.lost.items():
        if share > LOST_SHARE and "%" not in text and said.verdict.use is not Use.DO_NOT_USE:
            yield f"{percent(share)} of {axis} are left out and not in the verdict"


def _one_number_a_quantity(said: Claims) -> Iterator[str]:
    """8: two statements about one quantity are one number, and one place states it once."""
    first: dict[str, Statement] = {}
    listed: set[tuple[str, str]] = set()
    for one in said.statements:
        if (one.quantity, one.place) in listed:
            yield f"{one.quantity} stands twice {one.place}"
        listed.add((one.quantity, one.place))
        other = first.setdefault(one.quantity, one)
        if f"{one.value:.{NUMBER_DIGITS}g}" != f"{other.value:.{NUMBER_DIGITS}g}":
            yield f"{one.quantity} is {other.value:g} {other.place} and {one.value:g} {one.place}"


def _not_worse_than_the_fixes(said: Claims) -> Iterator[str]:
    """9: settings are not written that err more than the fixes alone, nor any that must not be used."""
    if said.files and said.verdict.use is Use.DO_NOT_USE:
        yield f"{', '.join(said.files)} written although not to be used"
    if said.files and said.beside_fixes is not None:
        own, alone = said.beside_fixes
        if own > WRONG_FACTOR * alone:
            yield f"written although they err {own:.3g} m where the fixes err {alone:.3g} m"


INVARIANTS: Mapping[int, Callable[[Claims], Iterator[str]]] = MappingProxyType(
    {
        1: _nothing_beside_a_failure,
        2: _honest_with_power,
        3: _one_verdict_on_a_file,
        4: _errors_against_a_truth,
        5: _bounds_name_nothing,
        6: _losses_are_said,
        8: _one_number_a_quantity,
        9: _not_worse_than_the_fixes,
    }
)
