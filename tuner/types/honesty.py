"""Is a filter as uncertain as it says? The verdict on its scores.

A filter is honest where true ÷ predicted error of position, of velocity and of the position after 10, 30 and 60 s
without fixes lies within the band that the number of windows allows about 1, or within `HONEST_RATIO` of 1 where that
band is narrower; attitudes within `TOLERATED_RATIO`. A score counts only where it could have shown an error of
`HONEST_RATIO` with the probability `TEST_POWER`: with ν degrees of freedom and the limits a … b of that band, which is
of those that are certain,

    P(χ²(ν)/ν > b/1.5²) ≥ 0.9    and    P(χ²(ν)/ν < 1.5² a) ≥ 0.9

Others are too short to judge, and the verdict says how much more data would do.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from models.probability import chi2_beyond, chi2_quantile
from tuner.limits import HONEST_RATIO, TEST_POWER, TOLERATED_RATIO
from tuner.types.judgement import Judgement, Reason, Use, judged
from tuner.types.verdict import VerdictCode

if TYPE_CHECKING:
    from tuner.types.consistency import Consistency, Score

LONGEST_CLAIM = 60.0
"""Longest time without fixes that decides whether a filter is honest, s."""
TAIL_PROBABILITY = 0.0005
"""Chance on either side that one score of a right filter lies outside its band: 99.7 % for three scores together."""
OUTAGE = "outage "
"""How the name of a score of the position without fixes begins; the time follows."""
NAMES = {
    "nees": "all states (root of NEES)",
    "accel_bias": "accelerometer bias",
    "nis_position": "position innovations (root of NIS)",
    "nis_velocity": "velocity innovations (root of NIS)",
    "nis": "innovations (root of NIS)",
}
"""What scores are of, where their names do not say it."""


def honesty(found: Consistency) -> Judgement:
    """Return whether a filter is honest, optimistic or pessimistic, or its scores are too short to judge it."""
    if found.diverged:
        runs = [one.numbers for one in found.verdicts if one.code is VerdictCode.RUNS_DIVERGED]
        many = f" in {runs[0]['diverged_runs']} of {runs[0]['runs']} runs" if runs else ""
        return Judgement(Use.DO_NOT_USE, (f"the filter diverged{many}",))
    scores = list(claims(found))
    reasons = off_reasons(found, filter(is_off, scores))
    if reasons:
        return judged(Use.HONEST, reasons)
    sure = [one for one in scores if shows_dishonesty(one)]
    weak = [one for one in scores if one not in sure]
    names = ", ".join(claim_name(one.name, has_truth=found.has_truth) for one in weak)
    lacking = f"{names}{need_text(weak)}" if weak else "no error can be compared with its sd"
    if not sure:
        return Judgement(Use.TOO_SHORT, (lacking,))
    return Judgement(
        Use.HONEST, (_right_text(found, sure), *([f"too short to judge: {lacking}"] if weak else []))
    )


def off_reasons(found: Consistency, off: Iterable[Score]) -> list[Reason]:
    """Return what some scores say against the honesty of a filter, the farthest first: errs more, errs less."""
    known = {one.score.name: one.interval for one in found.outages}
    texts: dict[Use, list[str]] = {Use.OPTIMISTIC: [], Use.PESSIMISTIC: []}
    for one in sorted(off, key=lambda one: -abs(math.log(max(one.ratio, 1e-9)))):
        ratio = ratio_text(one.ratio, known.get(one.name, one.interval))
        name = claim_name(one.name, has_truth=found.has_truth)
        texts[Use.OPTIMISTIC if one.ratio > 1.0 else Use.PESSIMISTIC].append(f"{name} {ratio}")
    what = "error" if found.has_truth else "distance"
    kinds = {Use.OPTIMISTIC: "more", Use.PESSIMISTIC: "less"}
    return [
        Reason(use, f"errs {kinds[use]} than predicted, {what} ÷ predicted: {', '.join(_first(each))}")
        for use, each in texts.items()
        if each
    ]


def _first(texts: Sequence[str]) -> list[str]:
    """Return the first two, and how many more there are."""
    more = len(texts) - 2
    return [*texts[:2], *([f"{more} more"] if more > 0 else [])]


def _right_text(found: Consistency, sure: Sequence[Score]) -> str:
    """Return between what the scores of an honest filter lie, and up to what time without fixes."""
    ratios = [one.ratio for one in sure]
    between = " to ".join(dict.fromkeys(digits(one) for one in (min(ratios), max(ratios))))
    longest = max((one.seconds for one in found.outages if one.score in sure), default=0.0)
    unaided = f", up to {longest:g} s without fixes" if longest else ""
    return f"{'errors' if found.has_truth else 'distances to the fixes'} {between} × predicted{unaided}"


def claims(found: Consistency) -> Iterator[Score]:
    """Yield the scores that decide; innovations where there is no truth, all states where none has a known name."""
    blocks = {one.name: one for one in found.blocks if found.has_truth}
    innovations = {one.name: one for one in found.nis}
    known = [blocks[name] for name in ("position", "velocity", "attitude") if name in blocks]
    known += [
        innovations[f"nis_{name}"]
        for name in ("position", "velocity")
        if name not in blocks and f"nis_{name}" in innovations
    ]
    whole = [found.nees] if found.nees is not None else list(innovations.values())[:1]
    yield from known or [*blocks.values()] or whole
    yield from (one.score for one in found.outages if one.seconds <= LONGEST_CLAIM)


def is_off(score: Score) -> bool:
    """Return whether a score speaks against the honesty of a filter."""
    widest = TOLERATED_RATIO if score.name == "attitude" else HONEST_RATIO
    if 1.0 / widest <= score.ratio <= widest or not 0.0 < score.freedom < math.inf:
        return False
    low, high = _band(score.freedom)
    return not low <= score.ratio**2 <= high


def shows_dishonesty(score: Score, more: float = 1.0) -> bool:
    """Return whether a score, or one of so many times as much data, would show an error of `HONEST_RATIO`."""
    nu = more * score.effective
    if not 0.0 < nu < math.inf:
        return False
    low, high = _band(more * score.freedom)
    optimistic = chi2_beyond(nu * high / HONEST_RATIO**2, nu)
    pessimistic = 1.0 - chi2_beyond(nu * low * HONEST_RATIO**2, nu)
    return min(optimistic, pessimistic) >= TEST_POWER


def _band(freedom: float) -> tuple[float, float]:
    """Return the limits of χ² ÷ its degrees of freedom that a right filter keeps."""
    low, high = (chi2_quantile(p, freedom) / freedom for p in (TAIL_PROBABILITY, 1.0 - TAIL_PROBABILITY))
    return low, high


def need_text(scores: Sequence[Score]) -> str:
    """Return how much more data would tell of all of some scores, in words; empty where that is not known."""
    more = 1.0
    known = [one for one in scores if 0.0 < one.effective < math.inf]
    while not all(shows_dishonesty(one, more) for one in known):
        more *= 1.05
    return f" ({more:.2g} times as much data would do)" if known else ""


def ratio_text(ratio: float, interval: tuple[float, float]) -> str:
    """Return a ratio with its 95 % interval, to two decimals."""
    low, high = interval
    return f"{digits(ratio)} ({digits(low)} to {'∞' if math.isinf(high) else digits(high)})"


def digits(ratio: float) -> str:
    """Return a ratio to two decimals, a large one to two digits."""
    return f"{ratio:.2f}" if ratio < 10.0 else f"{ratio:.2g}"


def claim_name(name: str, *, has_truth: bool = True) -> str:
    """Return what a score of a name is of, in words: of a distance to fixes where there is no truth."""
    if name.startswith(OUTAGE):
        time = name.removeprefix(OUTAGE)
        return (
            f"position after {time} without fixes" if has_truth else f"distance to fixes withheld for {time}"
        )
    return NAMES.get(name, name.replace("_", " "))
