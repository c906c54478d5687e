"""What a drive changed, for the answer of `tune`: its findings, and errors before and after."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tuner.formats.customary_units import amount, digits
from tuner.formats.parameter_words import parameter_words

if TYPE_CHECKING:
    from tuner.diagnosis.drive.held_out_choice import HeldOutChoice
    from tuner.types import Finding


def found_text(finding: Finding) -> str:
    """Return the cause of a finding, where it acts, what it is, and its figures."""
    what, _, rest = finding.text.partition(": ")
    words = rest.partition(" (")[0]
    subject = f"{finding.cause.replace('_', ' ')} in {', '.join(finding.channels)}"
    figures = dict(finding.figures)
    for name in finding.figures:
        if (phrase := f" by the {name.replace('_', ' ')}") in words:  # the figure in its place
            words = words.replace(phrase, f" by {amount(figures.pop(name))}", 1)
            break
    said = [f"{said} {amount(figures[name])}" for name, said in parameter_words(figures).items()]
    text = f"{subject[:1].upper()}{subject[1:]}: {words or what}".removesuffix(": ")
    return f"{text} ({', '.join(said)})" if said else text


def choice_lines(choice: HeldOutChoice) -> list[str]:
    """Return what of a drive is in the settings, and errors with fixes and without them before and after.

    Without a reference these are distances to the fixes.
    """
    before, after = choice.before, choice.after
    if choice.kept == "as it began" or before is None or after is None:
        return [f"After the drive: {choice.note}"]
    from tuner.diagnosis.drive.held_out_gain import change_interval  # loads the diagnosis of drives

    changes = []
    for seconds, pairs in choice.outages.items():
        old, new = np.sqrt(pairs.mean(axis=0)).tolist()
        low, high = (_signed(end) for end in change_interval(pairs))
        changes.append(f"{seconds:.0f} s {digits(old)} → {digits(new)} m ({low} to {high})")
    tracking = f"{digits(before.tracking_rms)} → {digits(after.tracking_rms)} m"
    alone = "" if after.fixes_rms is None else f"; of the fixes alone {digits(after.fixes_rms)} m"
    error = "distance to the fixes" if after.fixes_rms is None else "position error with fixes"
    withheld = "distance to the withheld fixes" if after.fixes_rms is None else "error"
    despite = [f"{choice.despite[:1].upper()}{choice.despite[1:]}"] if choice.despite else []
    return [
        *despite,
        f"Settings {choice.kept}: {error}, rms, last 40 % of the drive: {tracking}{alone}",
        f"Without fixes, {withheld}, whole drive (95 % of the change): {', '.join(changes)}",
        f"Without fixes, last 40 % (ratios at 95 %): {'; '.join(one.text for one in choice.late)}",
    ]


def _signed(change: float) -> str:
    """Return a change with its sign, to two digits."""
    return ("+" if change > 0.0 else "") + digits(change, 2)
