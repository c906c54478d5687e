"""The answer of `covariances`: what each stream errs, what it declares, what to write; then what the filter gets."""

from __future__ import annotations

from typing import Any

from rich.table import Table

from tuner.covariances.proposal import Covariances, key_of
from tuner.covariances.robot_localization_form import STATES
from tuner.formats.codec import dump
from tuner.formats.customary_units import amount, digits, pretty
from tuner.report.answer_layout import span_text
from tuner.report.document import Document, document
from tuner.report.titled_table import table_of
from tuner.types import Coefficient

HEADS = "sd of a reading", "declares", "white", "lasting", "over", "true ÷ declared", "write"
"""Columns of the streams."""


def covariances_answer(found: Covariances) -> Document:
    """Return the verdict, the errors of every stream with what to write, process noise and gates."""
    noise = [digits(one, 2) for one in found.settings.process_noise[::3]]
    groups = (" ".join(STATES[i : i + 3]) for i in range(0, len(STATES), 3))
    listed = "; ".join(f"{names} {value} each" for names, value in zip(groups, noise, strict=True))
    suffix = "_rejection_threshold"
    gates = ", ".join(f"{name.removesuffix(suffix)} {digits(one, 2)}" for name, one in found.gates().items())
    return document(
        [
            f"{found.name}, {span_text(found.span)}; noise of the unit: {found.unit_from}",
            f"Verdict: {found.verdict}",
            _streams(found),
            "write: sd for the message, its square the covariance, best for this filter; –: none (it takes no "
            "velocities in axes of the world); ( ): 95 % interval",
            f"process_noise_covariance, its diagonal: {listed}" if found.written else "",
            f"Gates (…{suffix}): {gates}" if gates else "",
            "Not separated: errors that outlast the recording, scale of wheels from a lasting error, bias of "
            "accelerometers from tilt (accelerations are not fused)",
        ],
        found.notes,
        more=[
            f"{key_of(one)}: white {amount(one.white)}, lasting {amount(one.lasting)}"
            for one in found.streams
        ],
    )


def covariances_json(found: Covariances) -> dict[str, Any]:
    """Return the same in the form ``tuner.covariances/1``."""
    return {
        "schema": "tuner.covariances/1",
        "source": {"drive": found.name, "unit": found.unit_from},
        "verdict": found.verdict,
        "streams": [{**dump(one), "to_write": found.sd(one)} for one in found.streams],
        "process_noise_covariance": found.settings.process_noise.tolist() if found.written else None,
        "gates": dict(found.gates()),
        "true_over_predicted": dict(found.ratios),
        "notes": list(found.notes),
    }


def _streams(found: Covariances) -> Table:
    rows = []
    for one in found.streams:
        sd, of_unit = found.sd(one), one.stream in ("gyro", "accel")
        rows.append(
            (
                f"{key_of(one)}, {pretty(one.white.unit)}",
                "nothing" if one.declared is None else digits(one.declared, 2),
                digits(one.white.value or one.white.upper or 0.0, 2),
                _known(one.lasting),
                "all of it" if of_unit else f"{digits(one.time.value or 0.0, 2)} s" if one.time else "–",
                _known(one.size, one.declared) if one.declared else "–",
                "–" if sd is None else digits(sd, 2),
            )
        )
    return table_of(HEADS, rows)


def _known(one: Coefficient, of: float = 1.0) -> str:
    """Return a value with its interval, or its limit, in units `of`."""
    if one.value is None or one.interval is None:
        return f"< {digits((one.upper or 0.0) / of, 2)}"
    low, high = one.interval
    return f"{digits(one.value / of, 2)} ({digits(low / of, 2)}–{digits(high / of, 2)})"
