"""How another program's filter was tuned: its factors, and its scores without and with them, as table and JSON."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rich.table import Table

from tuner.external.noise_factors import NOISE_FACTORS
from tuner.external.tune_external import ExternalTuning
from tuner.formats.codec import dump
from tuner.report.json.output_score import output_score_json
from tuner.report.titled_table import titled_table
from tuner.report.verdict_text import score_title, verdict_text

ESTIMATES = ("untouched", "tuned")
"""What a filter gives without the factors and with them."""


def external_tables(result: ExternalTuning) -> list[Table | str]:
    """Return the factors with their intervals, and the scores beside those of the untouched settings."""
    found = result.found
    factors = []
    for name in NOISE_FACTORS:
        interval = found.interval(name)
        words = "no effect on the output" if interval is None else f"{interval[0]:.3g} … {interval[1]:.3g}"
        factors.append((name, f"{found.factors[name]:.3g}", words))
    verdicts = (
        f"  {name}: {'; '.join(verdict_text(v) for v in one.consistency.verdicts)}"
        for name, one in zip(ESTIMATES, result.scores, strict=True)
    )
    title = f"factors on the settings, by {found.after.kind}, {found.runs} runs"
    return [
        *titled_table(title, ("setting", "factor", "95 %"), factors),
        *titled_table("untouched and tuned", ("", *ESTIMATES), _scores(result)),
        "  * outside the band of a consistent filter",
        *verdicts,
        _kept_text(result),
    ]


def _scores(result: ExternalTuning) -> Iterator[tuple[str, ...]]:
    """Yield what the rest of the drive says of the factors, and every score of all of it, without and with them."""
    yield "rest of the drive: true rms ÷ predicted sd", *(f"{ratio:.3f}" for ratio in result.ratios)
    gain = f"{result.gain:+.3f} ± {2.0 * result.gain_sd:.3f}"
    yield "rest of the drive: likelihood, nats an epoch", "0", gain
    if result.reference_gain is not None:
        against = "rest of the drive: likelihood of errors against its reference"
        yield against, "0", f"{result.reference_gain:+.3f}"
    ratios = [
        {s.name: f"{s.ratio:.3f}{'*' * (not s.consistent)}" for s in one.consistency.scores}
        for one in result.scores
    ]
    for name in dict.fromkeys(name for own in ratios for name in own):
        yield f"{score_title(name)}: true rms ÷ predicted sd", *(own.get(name, "") for own in ratios)


def _kept_text(result: ExternalTuning) -> str:
    if result.kept:
        return "  kept: the rest of the drive is more likely with the factors"
    if result.gain > 0.0:
        return (
            "  not kept: the fixes of the rest are more likely with the factors, errors against its reference less: "
            "errors of fixes that stay look like small ones; settings as they were"
        )
    return "  not kept: the rest of the drive is not more likely with the factors; settings as they were"


def external_json(result: ExternalTuning, *, source: Mapping[str, Any]) -> dict[str, Any]:
    """Return the result in the form ``tuner.external/1``."""
    found = result.found
    return {
        "schema": "tuner.external/1",
        "source": dict(source),
        "dialect": result.dialect,
        "scored_by": found.after.kind,
        "runs": found.runs,
        "converged": found.converged,
        "kept": result.kept,
        "factors": {
            name: {"value": found.factors[name], "interval": dump(found.interval(name)), "unit": "1"}
            for name in NOISE_FACTORS
        },
        "held_out": {
            "gain": result.gain,
            "interval": [result.gain - 2.0 * result.gain_sd, result.gain + 2.0 * result.gain_sd],
            "unit": "nat/epoch",
            "reference_gain": result.reference_gain,
            "ratio": {"untouched": result.ratios[0], "tuned": result.ratios[1]},
        },
        "scores": {
            name: output_score_json(one, source={"estimates": name})
            for name, one in zip(ESTIMATES, result.scores, strict=True)
        },
        "text": result.text,
        "notes": list(result.notes),
    }
