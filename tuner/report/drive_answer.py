"""What a drive changed, for the answer of `tune`: its findings, errors before and after, sds and delay of the fixes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from models.filter_states import FILTER_STATES
from tuner.formats.clock_words import clock_words
from tuner.formats.customary_units import digits
from tuner.formats.parameter_words import meaning_text
from tuner.report.document import sentence
from tuner.report.titled_table import table_of
from tuner.types.clock import Clock, Delay
from tuner.types.honesty import ratio_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from rich.table import Table

    from models.arrays import FloatArray
    from tuner.diagnosis.drive import ExaminedDrive
    from tuner.diagnosis.drive.held_out_choice import HeldOutChoice
    from tuner.types import FilterConfig, Finding
    from tuner.types.compensation import Compensation
    from tuner.types.consistency import Outage


def found_text(finding: Finding, *, ranges: bool = False) -> str:
    """Return what a finding of a drive is, in one sentence, with its figures or the ranges of those that are alike."""
    from tuner.diagnosis.drive.causes.registry import DRIVE_CAUSES  # loads the diagnosis of drives

    return sentence(meaning_text(DRIVE_CAUSES[finding.cause].meaning, finding.figures, ranges=ranges))


def choice_parts(choice: HeldOutChoice, scored: Sequence[Outage] = ()) -> list[Table | str]:
    """Return errors with fixes and without them: now, ÷ those with the settings before the drive, and ÷ predicted.

    Without a reference these are distances to the fixes.
    """
    if choice.kept == "as it began" or choice.before is None or choice.after is None:
        return [f"After the drive: {choice.note}"]
    before, after = choice.before, choice.after
    error = "distance to fixes" if after.fixes_rms is None else "error"
    alone = "" if after.fixes_rms is None else f"(fixes alone {digits(after.fixes_rms)} m)"
    change = f"{after.tracking_rms / before.tracking_rms:.2f}"
    aided = "with fixes (last 40 %)", f"{digits(after.tracking_rms)} m", change, alone
    heads = f"{error}, rms", "noise.yaml", "÷ pre-drive (95 %)", "÷ predicted (95 %)"
    despite = [sentence(choice.despite)] if choice.despite else []
    return [table_of(heads, [aided, *outage_rows(choice, scored)], words=len(heads)), *despite]


def outage_rows(choice: HeldOutChoice, scored: Sequence[Outage]) -> list[tuple[str, str, str, str]]:
    """Return the errors of scored outages, which the verdict reads, now, ÷ before, and ÷ predicted, one row a length.

    What they were before follows from the outages that were tried with both settings.
    """
    from tuner.diagnosis.drive.held_out_gain import change_interval  # loads the diagnosis of drives

    rows = []
    for one in scored:
        change = ""
        if (pairs := choice.outages.get(one.seconds)) is not None:
            old, new = np.sqrt(pairs.mean(axis=0)).tolist()
            low, high = change_interval(pairs)
            change = ratio_text(new / old, (max(1.0 + low / old, 0.0), 1.0 + high / old))
        size, predicted = f"{digits(one.rms)} m", ratio_text(one.score.ratio, one.interval)
        rows.append((f"{one.seconds:g} s without fixes", size, change, predicted))
    return rows


def fixes_parts(
    examined: ExaminedDrive, config: FilterConfig, *, written: bool, mended: bool = False
) -> list[Table | str]:
    """Return the sds of the fixes as reported and as a filter is given them, and what is taken out as delay.

    Of sds that differ from fix to fix these are medians; of a drive that is `mended`, those that are mended. Beside
    states for errors that last the filter has sds of the rest. No sd of a fix alone stands for what lasts: which one
    serves a filter without states, its export judges.
    """
    # load the navigation, which the answer on a log does without
    from tuner.navigation.compensation import compensate_settings
    from tuner.navigation.drive.run import assumed_sds, reported_sds
    from tuner.navigation.settings import filter_settings

    gnss = examined.drive.gnss
    settings = compensate_settings(filter_settings(config), config.compensation)
    raw = np.hstack([gnss.position_sd, gnss.velocity_sd])
    both = reported_sds(gnss, settings), assumed_sds(raw, gnss.solution, settings)
    lasting = _lasting(config)
    columns: dict[str, tuple[str, ...]] = {}
    for name, values, block in (
        ("positions, m", gnss.llh, slice(0, 3)),
        ("velocities, m/s", gnss.vel_n, slice(3, 6)),
    ):
        states = lasting.get(name, ())
        if (there := np.isfinite(values).any(axis=0)).any():
            known, used = (np.where(there, np.median(one[:, block], axis=0), np.nan) for one in both)
            stated = bool((raw[:, block] > 0.0).any())
            columns[name] = (
                _level_text(known) + " ASSUMED" * (not stated),
                _level_text(used),
                "; ".join(
                    f"{_level_text(np.where(there, [sd, sd, down], np.nan))}; {digits(t, 2)} s"
                    for sd, down, t in states
                )
                or "none",
                "" if columns or not written else "by export --to kf-gins",
            )
    where = "noise.yaml" if written else "the filter judged"
    with_states = (
        f"R of {where}, with its states",
        "states for GNSS errors, as set: sd; time",
        "R of a filter without states",
    )
    own = with_states if any(lasting.values()) else [f"R of {where}"]
    reported = f"reported by the receiver{', mended' * mended}"
    rows = zip([reported, *own], *columns.values(), strict=False)
    table = table_of(("sd of fixes: horizontal, down", *columns), rows, words=1 + len(columns))
    return [table, *_delay_lines(examined.drive.clock, config.compensation, gnss.t, written=written)]


def _level_text(sds: Iterable[float]) -> str:
    """Return a sd of an axis in the horizontal, and that down where there is one."""
    north, east, down = sds
    parts = math.hypot(north, east) / math.sqrt(2.0), down
    return ", ".join(digits(one, 2) for one in parts if math.isfinite(one))


def _lasting(config: FilterConfig) -> dict[str, list[tuple[float, float, float]]]:
    """Return the sds, horizontal and down, and the correlation times, s, of errors of fixes that have states."""
    gnss, name = config.gnss, "correlated_velocity"
    states = () if gnss is None else gnss.correlated
    down = 1.0 if gnss is None else gnss.correlated_down
    found = {"positions, m": [(one.sd, one.sd * down, one.time_constant) for one in states]}
    if sd := config.constants.get(name):
        time = config.time_constants.get(name, FILTER_STATES[name].time_constant)
        found["velocities, m/s"] = [(sd, sd, time)]
    return found


def _delay_lines(clock: Clock, applied: Compensation, t: FloatArray, *, written: bool) -> list[str]:
    """Return the line on delays of fixes and velocities: what takes them out, and what does not; none without any.

    A delay that drifts between the stamps t (k,) is said of the first and of the last fix.
    """
    delay, lag = (applied.value(cause, "delay") for cause in ("time_offset", "velocity_lag"))
    rate = applied.value("clock_drift", "rate")
    if (clock.delay.taken_out, clock.lag.taken_out, clock.drift.taken_out) != (delay, lag, rate):
        ends = float(t[0]), float(t[-1])
        clock = Clock(Delay(delay, 0.0), Delay(lag, 0.0), drift=Delay(rate, 0.0), ends=ends)
    text = clock_words(clock)
    out = "tuner with noise.yaml and the KF-GINS export take" if written else "the filter judged took"
    done = f"{out} that out; the recording still has it, so for another filter move its stamps"
    return [f"{sentence(text)}: {done}"] if text else []
