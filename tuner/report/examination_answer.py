"""The answer of `examine`: what is to be mended, in order of evidence, what each stream is worth, what was not seen."""

from __future__ import annotations

import numpy as np
from rich.table import Table

from tuner.examination.examine import Examination
from tuner.formats.customary_units import digits
from tuner.formats.grouping import gathered
from tuner.formats.repair_words import repair_text
from tuner.limits import WRONG_FACTOR
from tuner.report.answer_layout import span_text
from tuner.report.document import Document, document
from tuner.report.titled_table import table_of

MENDED = "mended.npz"
"""File of a mended drive."""
SHOWN_REPAIRS = 3
"""Repairs on a screen."""


def examination_answer(found: Examination) -> Document:
    """Return what is to be mended first, the noise of every stream, and what the recording could not have shown."""
    repairs = [f"{number}. {repair_text(one)}" for number, one in enumerate(found.repairs, 1)]
    rates = ", ".join(f"{name} {digits(rate)} Hz" for name, rate in found.rates.items())
    parts = (one.rpartition(" ") for one in found.unseen)
    alike = gathered((head, last) for head, _, last in parts)  # sign of gyro x, … y → sign of gyro x y
    listed = ", ".join(f"{head} {' '.join(lasts)}".strip() for head, lasts in alike.items())
    unseen = f"Could not have shown: {listed}" if listed else ""
    return document(
        [
            f"{found.mended.name}, {span_text(float(np.ptp(found.mended.imu_t)))}: {rates}; "
            f"{span_text(found.seconds)} of it compared",
            f"Verdict: {examination_verdict(found)}",
            *repairs[:SHOWN_REPAIRS],
            _noise_table(found),
            *vibration_lines(found),
            f"Lever arm, not stated: the antenna {found.lever_arm}" if found.lever_arm else "",
            unseen,
        ],
        repairs[SHOWN_REPAIRS:],
    )


def examination_verdict(found: Examination) -> str:
    """Return whether anything is to be mended."""
    many = len(found.repairs)
    things = f"{many} thing{'s' * (many > 1)}"
    return f"mend before any filter: {things}, the surest first" if many else "nothing contradicts"


def vibration_lines(found: Examination) -> list[str]:
    """Return how much noisier the samples are in motion than at rest, where that changes Q."""
    parts = [
        f"{name} {digits(moving / still, 2)} ×"
        for name, (still, moving) in found.vibration.items()
        if moving > WRONG_FACTOR * still > 0.0
    ]
    return [f"Noise in motion: {', '.join(parts)} that at rest; Q needs what of it adds up"] if parts else []


def _noise_table(found: Examination) -> Table:
    rows = []
    for one in found.noise:
        name = f"{one.stream}{', ' * bool(one.part)}{one.part}"
        stated = "none" if one.reported is None else f"{digits(one.reported)} {one.unit}"
        ratio = f"{one.sd / one.reported:.2g}" if one.reported else ""
        rows.append((name, f"{digits(one.sd)} {one.unit}", stated, ratio))
    heads = "noise from reading to reading", "measured", "reported", "measured ÷ reported"
    return table_of(heads, rows, words=len(heads))
