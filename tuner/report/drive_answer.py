"""What a drive changed, for the answer of `tune`: its findings, errors before and after, sds and delay of the fixes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from rich.table import Table

from models.filter_states import FILTER_STATES
from tuner.formats.customary_units import amount, digits
from tuner.formats.parameter_words import parameter_words
from tuner.types.honesty import ratio_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tuner.diagnosis.drive import ExaminedDrive
    from tuner.diagnosis.drive.held_out_choice import HeldOutChoice
    from tuner.navigation.drive.clock import Clock
    from tuner.types import FilterConfig, Finding
    from tuner.types.compensation import Compensation
    from tuner.types.consistency import Outage


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


def choice_parts(choice: HeldOutChoice, scored: Sequence[Outage] = ()) -> list[Table | str]:
    """Return errors with fixes and without them, with the settings before the drive and those chosen on it.

    Without a reference these are distances to the fixes. A difference that chance may make is said to be none. Errors ÷
    predicted are those of the scored outages, which the verdict reads, where there are any.
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
    late |= {
        one.seconds: ratio_text(one.score.ratio, one.interval) for one in scored
    }  # as the verdict has them
    for seconds, pairs in choice.outages.items():
        old, new = np.sqrt(pairs.mean(axis=0)).tolist()
        low, high = change_interval(pairs)
        chance = ", or the same" * (low <= 0.0 <= high)
        name = f"{seconds:g} s without fixes"
        table.add_row(name, f"{digits(old)} m", f"{digits(new)} m{chance}", late.get(seconds, ""))
    despite = [f"{choice.despite[:1].upper()}{choice.despite[1:]}"] if choice.despite else []
    return [table, *despite]


def fixes_parts(examined: ExaminedDrive, config: FilterConfig) -> list[Table | str]:
    """Return the sds of the fixes as the receiver reports them and as the filter has them, and what it takes as delay.

    Of sds that differ from fix to fix these are medians. Where none are reported, those of the configuration stand.
    """
    # load the navigation, which the answer on a log does without
    from tuner.navigation.compensation import compensate_settings
    from tuner.navigation.drive.clock import AGREEING
    from tuner.navigation.drive.run import assumed_sds, reported_sds
    from tuner.navigation.settings import filter_settings

    gnss = examined.drive.gnss
    settings = compensate_settings(filter_settings(config), config.compensation)
    raw = np.hstack([gnss.position_sd, gnss.velocity_sd])
    both = reported_sds(gnss, settings), assumed_sds(raw, gnss.solution, settings)
    table = Table(box=None, padding=(0, 2, 0, 0))
    for head in ("fix sd: horizontal, down", "reported", "noise.yaml", "and errors that last"):
        table.add_column(head, no_wrap=True)
    lasting = _lasting_texts(config)
    for name, block in (("positions, m", slice(0, 3)), ("velocities, m/s", slice(3, 6))):
        if name in lasting or np.isfinite(gnss.vel_n).any():
            known, used = (_level_text(*np.median(one[:, block], axis=0).tolist()) for one in both)
            source = "" if (raw[:, block] > 0.0).any() else " ASSUMED"
            table.add_row(name, f"{known}{source}", used, lasting.get(name, ""))
    return [table, *_delay_lines(examined.clock or AGREEING, config.compensation)]


def _level_text(north: float, east: float, down: float) -> str:
    """Return a sd of an axis in the horizontal, and that down."""
    return f"{digits(math.hypot(north, east) / math.sqrt(2.0), 2)}, {digits(down, 2)}"


def _lasting_texts(config: FilterConfig) -> dict[str, str]:
    """Return the sds and correlation times of errors of positions and velocities that the filter lets stay."""
    gnss, name = config.gnss, "correlated_velocity"
    states = () if gnss is None else gnss.correlated
    down = 1.0 if gnss is None else gnss.correlated_down
    said = {
        "positions, m": "; ".join(_lasting_text(one.sd, one.sd * down, one.time_constant) for one in states)
    }
    if sd := config.constants.get(name):
        time = config.time_constants.get(name, FILTER_STATES[name].time_constant)
        said["velocities, m/s"] = _lasting_text(sd, sd, time)
    return said


def _lasting_text(level: float, down: float, time: float) -> str:
    return f"{digits(level, 2)}, {digits(down, 2)} for {digits(time, 2)} s"


def _delay_lines(clock: Clock, applied: Compensation) -> list[str]:
    """Return the line on the delays that noise.yaml takes out of fixes and velocities; no line without any."""
    from tuner.navigation.drive.clock import Clock, clock_words

    delay, lag = (applied.value(cause, "delay") for cause in ("time_offset", "velocity_lag"))
    taken = clock if (clock.delay, clock.lag) == (delay, lag) else Clock(delay, lag, (delay,) * 2, (lag,) * 2)
    text = clock_words(taken)
    how = "noise.yaml takes that out; shift the stamps for another filter"
    return [f"{text[:1].upper()}{text[1:]}: {how}"] if text else []
