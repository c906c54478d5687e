"""Published tables from scores: counts with Wilson's 95 % intervals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from challenge.verdict import BANDS, EXACT, Verdict
from scipy.optimize import minimize
from scipy.stats import norm

FLOORS = (25.0, 35.0, 50.0, 60.0, 100.0)
"""Detectabilities from which on the headline rates are told, nats."""


def wilson(hits: int, tries: int, z: float = 1.96) -> tuple[float, float]:
    """Return Wilson's interval of a rate."""
    if tries == 0:
        return 0.0, 1.0
    p, n = hits / tries, tries
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * float(np.sqrt(p * (1 - p) / n + z * z / (4 * n * n)))
    return max(0.0, middle - half), min(1.0, middle + half)


def rate(hits: int, tries: int) -> str:
    """Return a rate as text: counts, and the interval in per cent."""
    if tries == 0:
        return "–"
    low, high = wilson(hits, tries)
    return f"{hits}/{tries} ({100 * low:.1f}–{100 * high:.1f} %)"


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a Markdown table; nothing where there are no rows with figures."""
    body = [[str(cell) for cell in row] for row in rows]
    if all(cell in ("–", "") for row in body for cell in row[1:]):
        return ""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in body)]) + "\n"


def nulls(verdicts: Sequence[Verdict]) -> str:
    """Clean sets by kind and length."""
    clean = [v for v in verdicts if not v.causes]
    groups: dict[str, list[Verdict]] = {"all": clean}
    groups |= {
        f"{n:.3g} samples": [v for v in clean if v.samples == n] for n in sorted({v.samples for v in clean})
    }
    groups |= {f"{k} axes": [v for v in clean if v.axes == k] for k in sorted({v.axes for v in clean})}
    groups |= {(h or "ordinary"): [v for v in clean if v.hard == h] for h in sorted({v.hard for v in clean})}
    rows = [
        (
            name,
            rate(sum(bool(v.findings) for v in group), len(group)),
            rate(sum(v.alarm for v in group), len(group)),
            ", ".join(
                f"{c} {n}"
                for c, n in Counter(s for v in group for s in (*v.findings, *v.unexplained)).items()
            ),
        )
        for name, group in groups.items()
    ]
    return table(("clean sets", "any finding", "any alarm", "which"), rows)


def headline(verdicts: Sequence[Verdict]) -> str:
    """Singles above each floor of detectability, exact causes apart."""
    singles = [v for v in verdicts if v.kind == "single" and v.causes[0] not in EXACT]
    rows = []
    for floor in FLOORS:
        above = [v for v in singles if v.nats[0] >= floor]
        found = [v for v in above if v.alarm]
        good = sum(v.named or v.listed for v in found)
        family = sum(v.named or v.listed or v.familial for v in found)
        extra = sum(v.extra > 0 for v in above)
        rows.append((f"d ≥ {floor:.0f}", rate(len(found), len(above)),
                     rate(sum(v.named for v in found), len(found)),
                     rate(good, len(found)), rate(family, len(found)), rate(extra, len(above))))  # fmt: skip
    return table(
        (
            "single effects",
            "found",
            "named first ∣ found",
            "or in a shortlist of 2",
            "or family",
            "with a false finding",
        ),
        rows,
    )


def by_cause(verdicts: Sequence[Verdict]) -> str:
    """Found and named of every cause in every band; sizes at which half and 95 % are found."""
    singles = [v for v in verdicts if v.kind == "single"]
    rows = []
    for cause in sorted({v.causes[0] for v in singles}):
        mine = [v for v in singles if v.causes[0] == cause]
        cells = []
        for band in BANDS:
            inside = [v for v in mine if v.band == band]
            found = sum(v.alarm for v in inside)
            cells.append(
                f"{rate(found, len(inside))}; {sum(v.named for v in inside if v.alarm)}" if inside else "–"
            )
        half, most = (
            ("–", "–") if cause in EXACT else power([v.nats[0] for v in mine], [v.alarm for v in mine])
        )
        rows.append((cause, *cells, half, most))
    return table(
        ("cause: found; of these named first", *(f"{b} {lo:.0f}–{hi:.0f}" for b, (lo, hi) in BANDS.items()),
         "d50", "d95"), rows,
    )  # fmt: skip


def power(nats: Sequence[float], found: Sequence[bool]) -> tuple[str, str]:
    """Return the detectability at which half and 95 % are found, by a probit in √d."""
    x, y = np.sqrt(np.array(nats)), np.array(found)
    if len(x) < 6 or y.all() or not y.any():
        return "–", "–"

    def cost(p: np.ndarray) -> float:
        q = norm.cdf(np.where(y, 1.0, -1.0) * (x - p[0]) / np.exp(p[1]))
        return float(-np.sum(np.log(np.maximum(q, 1e-12))) + 0.1 * p[1] ** 2)

    best = minimize(cost, [np.sqrt(20.0), 0.0], method="Nelder-Mead").x
    return f"{max(best[0], 0.0) ** 2:.0f}", f"{(best[0] + 1.645 * np.exp(best[1])) ** 2:.0f}"


def confusion(verdicts: Sequence[Verdict]) -> str:
    """What was named first where one thing was hidden."""
    rows = []
    singles = [v for v in verdicts if v.kind in ("single", "unknown")]
    for cause in sorted({v.causes[0] for v in singles}):
        mine = [v for v in singles if v.causes[0] == cause]
        first = Counter(
            v.findings[0] if v.findings else ("unexplained" if v.unexplained else "nothing") for v in mine
        )
        right, none = first.pop(cause, 0), first.pop("nothing", 0)
        others = ", ".join(f"{name} {count}" for name, count in first.most_common())
        more = Counter(told for v in mine for told in v.findings[1:] if told not in v.causes)
        rows.append(
            (cause, len(mine), right, none, others, ", ".join(f"{n} {c}" for n, c in more.most_common()))
        )
    return table(("hidden", "sets", "named first", "nothing", "named instead", "also named"), rows)


def several(verdicts: Sequence[Verdict]) -> str:
    """Pairs and triples: all named."""
    rows = []
    for kind in ("pair", "triple"):
        mine = [v for v in verdicts if v.kind == kind]
        every = sum(set(v.causes) <= set(v.findings) for v in mine)
        each = [(c, c in v.findings) for v in mine for c in v.causes]
        missed = Counter(c for c, told in each if not told)
        rows.append((kind, rate(every, len(mine)), rate(sum(t for _, t in each), len(each)),
                     rate(sum(v.extra > 0 for v in mine), len(mine)),
                     ", ".join(f"{c} {n}" for c, n in missed.most_common())))  # fmt: skip
    return table(("sets", "all named", "each named", "with a false finding", "missed"), rows)


def twins(verdicts: Sequence[Verdict]) -> str:
    """Near misses: right, honest, or the wrong twin."""
    rows = []
    mine = [v for v in verdicts if v.kind == "twin"]
    for pair in sorted({(v.causes[0], v.twins[0]) for v in mine}):
        group = [v for v in mine if (v.causes[0], v.twins[0]) == pair]
        right = sum(v.causes[0] in v.findings for v in group)
        honest = sum(v.causes[0] not in v.findings and v.listed for v in group)
        wrong = sum(
            v.twins[0] in v.findings and v.causes[0] not in v.findings and not v.listed for v in group
        )
        rows.append((" ∣ ".join(pair), len(group), right, honest, wrong, sum(not v.alarm for v in group)))
    return table(("hidden ∣ twin", "sets", "right", "honest shortlist", "wrong twin", "nothing"), rows)


def parameters(verdicts: Sequence[Verdict]) -> str:
    """Share of 95 % intervals that hold the truth."""
    every = [p for v in verdicts for p in v.parameters]
    clear = [p for p in every if p.nats >= 35.0]
    rows: list[tuple[object, ...]] = [("all", rate(sum(p.inside for p in clear), len(clear)), "")]
    for key in sorted({(p.cause, p.name) for p in every}):
        mine = [p for p in clear if (p.cause, p.name) == key]
        off = [abs(p.value / p.truth - 1.0) for p in mine if p.truth]
        rows.append(
            (
                " ".join(key),
                rate(sum(p.inside for p in mine), len(mine)),
                f"{100 * np.median(off):.2g} %" if off else "–",
            )
        )
    return table(("parameter (d ≥ 35)", "truth inside the 95 % interval", "median error"), rows)


def gains(verdicts: Sequence[Verdict]) -> str:
    """Log likelihood gained on the record held out."""
    rows = []
    pairs = [(c, v.nats[v.causes.index(c)], g) for v in verdicts for c, g in v.gains.items() if c in v.causes]
    for cause in ("all", *sorted({c for c, _, _ in pairs})):
        mine = [g for c, d, g in pairs if d >= 50.0 and cause in ("all", c)]
        if mine:
            rows.append((cause, rate(sum(g > 0 for g in mine), len(mine)), f"{np.median(mine):.0f}"))
    return table(("cause (d ≥ 50)", "gain on what was held out > 0", "median, nats"), rows)


def times(verdicts: Sequence[Verdict]) -> str:
    """Seconds a set."""
    rows = []
    for key in sorted({(v.samples, v.axes) for v in verdicts}):
        mine = [v for v in verdicts if (v.samples, v.axes) == key]
        quiet = [v.cpu for v in mine if not v.causes]
        rows.append((f"{key[0]:.3g}", key[1], len(mine), _median(v.cpu for v in mine), _median(quiet),
                     f"{max(v.cpu for v in mine):.1f}", _median(v.seconds for v in mine)))  # fmt: skip
    return table(("samples", "axes", "sets", "CPU s, median", "clean", "longest", "wall s, median"), rows)


def _median(values: Iterable[float]) -> str:
    numbers = list(values)
    return f"{np.median(numbers):.1f}" if numbers else "–"


def broken(verdicts: Sequence[Verdict]) -> str:
    """Sets on which the analysis broke."""
    errors = Counter((v.error or "").strip().splitlines()[-1] for v in verdicts if v.error)
    return table(("error", "sets"), errors.most_common()) if errors else "None.\n"


SECTIONS: tuple[tuple[str, Callable[[Sequence[Verdict]], str]], ...] = (
    ("Clean sets", nulls),
    ("Single effects", headline),
    ("By cause", by_cause),
    ("Confusion", confusion),
    ("Several effects at once", several),
    ("Near misses", twins),
    ("Parameters", parameters),
    ("Gain on what was held out", gains),
    ("Time", times),
    ("Errors", broken),
)


def page(verdicts: Sequence[Verdict], about: str) -> str:
    """Return all tables as Markdown."""
    scored = [v.points() for v in verdicts]
    kinds = ", ".join(f"{kind} {count}" for kind, count in Counter(v.kind for v in verdicts).most_common())
    text = f"{about}\n\n{len(verdicts)} sets ({kinds}); mean score {np.mean(scored):.2f}.\n\n"
    parts = ((title, make(verdicts)) for title, make in SECTIONS)
    return text + "\n".join(f"### {title}\n\n{told}" for title, told in parts if told)
