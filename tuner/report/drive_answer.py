"""What a drive changed, for the answer of `tune`: its findings, and errors before and after."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rich.table import Table

from tuner.formats.customary_units import amount, digits
from tuner.formats.parameter_words import parameter_words
from tuner.types.honesty import ratio_text

if TYPE_CHECKING:
    from tuner.diagnosis.drive.held_out_choice import HeldOutChoice
    from tuner.types import Finding


def found_text(finding: Finding, *, sizes: bool = True) -> str:
    """Return the cause of a finding, where it acts, what it is, and its figures or only that within its words."""
    what, _, rest = finding.text.partition(": ")
    words = rest.partition(" (")[0]
    cause = finding.cause.replace("_", " ")
    where = ", ".join(one for one in finding.channels if one not in cause)
    subject = f"{cause} in {where}" if where else cause
    figures = dict(finding.figures)
    for name in finding.figures:
        if (phrase := f" by the {name.replace('_', ' ')}") in words:  # the figure in its place
            words = words.replace(phrase, f" by {amount(figures.pop(name))}", 1)
            break
    said = [f"{said} {amount(figures[name])}" for name, said in parameter_words(figures).items()]
    text = f"{subject[:1].upper()}{subject[1:]}: {words or what}".removesuffix(": ")
    return f"{text} ({', '.join(said)})" if said and sizes else text


def choice_parts(choice: HeldOutChoice) -> list[Table | str]:
    """Return errors with fixes and without them, with the settings before the drive and those chosen on it.

    Without a reference these are distances to the fixes. A difference that chance may make is said to be none.
    """
    before, after = choice.before, choice.after
    if choice.kept == "as it began" or before is None or after is None:
        return [f"After the drive: {choice.note}"]
    from tuner.diagnosis.drive.held_out_gain import change_interval  # loads the diagnosis of drives

    error = "distance to fixes" if after.fixes_rms is None else "error"
    alone = "" if after.fixes_rms is None else f"(fixes alone {digits(after.fixes_rms)} m)"
    table = Table(box=None, padding=(0, 2, 0, 0))
    for head in (f"{error}, rms", "before", "now", "now ÷ predicted (95 %)"):
        table.add_column(head, no_wrap=True)
    tracking = (f"{digits(one.tracking_rms)} m" for one in (before, after))
    table.add_row("with fixes (last 40 %)", *tracking, alone)
    late = {one.seconds: ratio_text(one.ratio, one.interval) for one in choice.late}
    for seconds, pairs in choice.outages.items():
        old, new = np.sqrt(pairs.mean(axis=0)).tolist()
        low, high = change_interval(pairs)
        chance = ", or the same" * (low <= 0.0 <= high)
        name = f"{seconds:g} s without fixes"
        table.add_row(name, f"{digits(old)} m", f"{digits(new)} m{chance}", late.get(seconds, ""))
    despite = [f"{choice.despite[:1].upper()}{choice.despite[1:]}"] if choice.despite else []
    return [table, *despite]
