"""How another program's filter was tuned: its factors, and its scores without and with them, as table and JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.table import Table

from tuner.external.noise_factors import NOISE_FACTORS
from tuner.external.tune_external import ExternalTuning
from tuner.report.json.output_score import output_score_json
from tuner.report.verdict_text import verdict_text


def external_tables(result: ExternalTuning) -> list[Table | str]:
    """Return the factors with their intervals, and the scores beside those of the untouched settings."""
    found = result.found
    factors = Table(title=f"factors on the settings, by {found.after.kind}, {found.runs} runs")
    for name in ("setting", "factor", "95 %"):
        factors.add_column(name, justify="left" if name == "setting" else "right")
    for name in NOISE_FACTORS:
        interval = found.interval(name)
        words = "no effect on the output" if interval is None else f"{interval[0]:.3g} … {interval[1]:.3g}"
        factors.add_row(name, f"{found.factors[name]:.3g}", words)
    scores = Table(title="untouched and tuned")
    for name in ("", "untouched", "tuned"):
        scores.add_column(name, justify="left" if not name else "right")
    scores.add_row("rest of the drive: true rms ÷ predicted sd", *(f"{ratio:.3f}" for ratio in result.ratios))
    gain = f"{result.gain:+.3f} ± {2.0 * result.gain_sd:.3f}"
    scores.add_row("rest of the drive: likelihood, nats an epoch", "0", gain)
    if result.reference_gain is not None:
        likelihood = f"{result.reference_gain:+.3f}"
        scores.add_row("rest of the drive: likelihood of errors against its reference", "0", likelihood)
    names = {s.name: None for one in result.scores for s in one.consistency.scores}
    for name in names:
        cells = [{s.name: s for s in one.consistency.scores}.get(name) for one in result.scores]
        ratios = ["" if s is None else f"{s.ratio:.3f}{'' if s.consistent else ' *'}" for s in cells]
        scores.add_row(f"{name.replace('_', ' ')}: true rms ÷ predicted sd", *ratios)
    said = [
        f"  {name}: {'; '.join(verdict_text(v) for v in one.consistency.verdicts)}"
        for name, one in zip(("untouched", "tuned"), result.scores, strict=True)
    ]
    if result.kept:
        kept = "  kept: the rest of the drive is more likely with the factors"
    elif result.gain > 0.0:
        kept = (
            "  not kept: the fixes of the rest are more likely with the factors, errors against its reference less: "
            "errors of fixes that stay look like small ones; settings as they were"
        )
    else:
        kept = "  not kept: the rest of the drive is not more likely with the factors; settings as they were"
    return [factors, scores, "  * outside the band of a consistent filter", *said, kept]


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
            name: {"value": found.factors[name], "interval": _pair(found.interval(name)), "unit": "1"}
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
            for name, one in zip(("untouched", "tuned"), result.scores, strict=True)
        },
        "text": result.text,
        "notes": list(result.notes),
    }


def _pair(interval: tuple[float, float] | None) -> list[float] | None:
    return None if interval is None else list(interval)
