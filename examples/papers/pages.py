"""The items of the papers in words: one Markdown page, one JSON object, one table on the terminal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from rich.table import Table

from examples.papers.results import Claim, Item
from tuner.formats.customary_units import digits, digits_to
from tuner.formats.noise_terms import coefficient_json
from tuner.types import Coefficient

VERDICT_ORDER = ("reproduced", "corrected", "untestable", "not reproduced")
"""Verdicts in the order of the summary."""
INTRODUCTION = """# The three papers, reproduced and judged

The papers behind this project published no logs. Every item below simulates data to a paper's settings and runs the
functions that `tuner` offers. From a checkout of the project run it yourself with `python -m examples.papers NAME`, or
all of it with `python -m examples.papers all -o DIR`.

1. Li Qi et al.: *Performance evaluation of the Allan variance method for ring laser gyroscope noise
   analyses* (in Chinese)
2. Xu Dongsheng et al.: *ThêoH identification of random errors of fibre-optic gyros* (in Chinese)
3. Zhang Meng et al.: Allan variance of two groupings and ARMA model of a MEMS gyro (in Chinese)

A verdict follows from numbers. **Reproduced**: the paper's value lies within about four standard deviations of ours.
**Corrected**: the value derived in its place does, and lies nearer. **Untestable**: what a test needs is missing, and
named. **Not reproduced**: neither value agrees. Intervals are 95 %; a value without one is counted or computed, not
sampled. The derivations are in `docs/maths.md` of the project.
"""
"""Begin of the page."""


def papers_markdown(items: Sequence[Item], figures: str) -> str:
    """Return the page of all items; `figures` comes before the NAME.png of each figure."""
    parts = [INTRODUCTION, _summary(items)]
    parts += [_section(item, f"{figures}{item.name}.png") for item in items]
    return "\n".join(parts)


def papers_json(items: Sequence[Item]) -> dict[str, Any]:
    """Return all claims as plain values; numbers are in the units of the papers."""
    return {
        "schema": "tuner.papers/1",
        "items": {
            item.name: {
                "paper": item.paper,
                "claims": [
                    {
                        "text": claim.text,
                        "paper": claim.paper,
                        "ours": coefficient_json(claim.ours),
                        "verdict": claim.verdict,
                        "why": claim.why,
                    }
                    for claim in item.claims
                ],
            }
            for item in items
        },
    }


def item_table(item: Item) -> Table:
    """Return the claims of an item for the terminal."""
    table = Table(title=f"{item.name} — {item.paper}", title_justify="left", show_lines=True)
    for heading in ("claim", "paper", "ours", "verdict", "why"):
        table.add_column(heading, overflow="fold")
    for claim in item.claims:
        table.add_row(claim.text, claim.paper, coefficient_text(claim.ours), claim.verdict, claim.why)
    return table


def coefficient_text(ours: Coefficient) -> str:
    """Return a value with its interval in its own unit: ``0.0577 (0.0565 … 0.0589) deg/h``."""
    unit = "" if ours.unit in ("", "1") else f" {ours.unit}"
    if ours.value is None:
        return "–" if ours.upper is None else f"< {digits(ours.upper)}{unit}"
    if ours.interval is None:
        return digits(ours.value) + unit
    low, high = ours.interval
    half = 0.5 * (high - low)
    if half <= 1e-4 * abs(ours.value) or half <= 1e-9:
        return f"{ours.value:.4g}{unit}"
    return f"{digits_to(ours.value, half)} ({digits_to(low, half)} … {digits_to(high, half)}){unit}"


def _summary(items: Sequence[Item]) -> str:
    lines = [
        "| item | paper | " + " | ".join(VERDICT_ORDER) + " |",
        "|---|---|" + "---|" * len(VERDICT_ORDER),
    ]
    for item in items:
        count: Counter[str] = Counter(claim.verdict for claim in item.claims)
        cells = " | ".join(str(count[verdict] or "") for verdict in VERDICT_ORDER)
        lines.append(f"| [{item.name}](#{item.name}) | {item.paper} | {cells} |")
    return "\n".join(lines) + "\n"


def _section(item: Item, figure: str) -> str:
    lines = [
        f"## {item.name}",
        "",
        f"{item.paper}.",
        "",
        f"![{item.name}]({figure})",
        "",
        "| claim | paper | ours | verdict | why |",
        "|---|---|---|---|---|",
        *(_row(claim) for claim in item.claims),
        "",
    ]
    return "\n".join(lines)


def _row(claim: Claim) -> str:
    cells = (claim.text, claim.paper, coefficient_text(claim.ours), f"*{claim.verdict}*", claim.why)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
