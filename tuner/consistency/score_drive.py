"""Score a filter on a measured drive: innovations, errors against a reference where there is one, simulated outages.

An outage withholds the fixes of a window and scores the position at its end against the reference, or else
against the withheld fix itself, whose own error is part of the prediction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from models.earth import ned_between
from models.filter_states import FILTER_STATES, Origin
from tuner.catalogue.grades import receiver_or_default
from tuner.consistency.drive_scores import (
    against_reference,
    against_smoother,
    blocks,
    errors,
    on_clock_of,
    reference_at,
    settled,
)
from tuner.consistency.reference_attitude import without_wrong_attitude
from tuner.consistency.reference_check import with_trusted_reference
from tuner.consistency.scores import (
    DIVERGED_RATIO,
    DIVERGED_REFUSED_SHARE,
    OUTAGE_LENGTHS,
    innovation_scores,
    outage_score,
    whiteness,
)
from tuner.consistency.verdicts import verdicts
from tuner.examination.examined_drive import examined_drive
from tuner.formats.clock_words import stated_words
from tuner.formats.customary_units import digits
from tuner.navigation.compensation import compensate, compensate_settings
from tuner.navigation.data import GATED, WITHHELD, Solution
from tuner.navigation.drive.run import Stretch, expect_settled, navigate, outage_windows, prepare
from tuner.navigation.drive.vehicle_constraints import (
    MOUNTING_SD,
    Vehicle,
    constraint_counts,
    constraint_notes,
    stationary_noise,
    turned_from,
    with_constraints,
)
from tuner.navigation.settings import ACCELS, GYROS, FilterSettings, filter_settings
from tuner.simulation.imu import sensor_of_config
from tuner.stages import counted, stage, task
from tuner.synthesis.from_drive import config_for_drive, receiver_of
from tuner.synthesis.rest_and_motion import in_motion
from tuner.types import FilterConfig, GnssNoise
from tuner.types.consistency import Consistency, Outage
from tuner.types.honesty import LONGEST_CLAIM
from tuner.types.named_cause import NamedCause
from tuner.types.number_ranges import Positive
from tuner.types.public import public
from tuner.types.records import Drive, Reference
from tuner.types.shown import Shown

CLAIMED_LENGTHS = tuple(length for length in OUTAGE_LENGTHS if length <= LONGEST_CLAIM)
"""Lengths of outage that are scored on a measured drive, s: those that decide."""
UNCONSTRAINED = Vehicle()
"""A vehicle of which nothing is assumed."""
MIN_NOISE_RATIO = 2.0
"""Measured ÷ configured noise over 1 s at rest from which a note is made: more than units of one type differ by."""
UNKNOWN_DELAY_SD = 0.1
"""Sd of an unknown delay of the fixes, s; smaller where the drive determines it better."""
UNKNOWN_LEVER_ARM_SD = 1.0
"""Prior sd of a lever arm that nobody gave, m: the size of a car."""


@dataclass(frozen=True, repr=False)
class DriveResult(Shown):
    """The outcome of filtering a measured drive.

    Attributes
    ----------
    consistency : Consistency
        Scores and verdicts.
    config : FilterConfig
        What the filter was configured with.
    settings : FilterSettings
        The filter.
    stretches : tuple of Stretch
        What was filtered.
    solutions : tuple of Solution
        One a stretch, all fixes used.
    estimates : mapping of str to tuple of (value, sd)
        Final estimates of lever arm, time offset and other constants, SI.
    notes : tuple of str
        What was repaired, found and done.
    """

    consistency: Consistency
    config: FilterConfig
    settings: FilterSettings
    stretches: tuple[Stretch, ...]
    solutions: tuple[Solution, ...]
    estimates: Mapping[str, tuple[tuple[float, float], ...]]
    notes: tuple[str, ...]


def drive_filter(
    drive: Drive,
    config: FilterConfig,
    *,
    states: Mapping[str, float] | None = None,
) -> tuple[FilterSettings, tuple[str, ...]]:
    """Return the filter of a configuration for a drive: with an unknown lever arm, and what its clock leaves open."""
    left = drive.clock.delay.left
    open_delay = {"time_offset": min(UNKNOWN_DELAY_SD, left)} if math.isfinite(left) else {}
    constants = {**open_delay, **config.constants, **(states or {})}
    arm, notes = drive.lever_arm, []
    if arm is not None and drive.mounting is None and any(arm):
        arm = None
        notes.append("the lever arm is given in vehicle axes, but the mounting of the sensor is unknown")
    if arm is None:
        constants.setdefault("lever_arm", UNKNOWN_LEVER_ARM_SD)
        notes.append(f"lever arm not stated: estimated from 0 ± {constants['lever_arm']:g} m")
    if not (drive.gnss.position_sd > 0.0).any():
        sds = ", ".join(digits(sd, 2) for sd in receiver_or_default(config.gnss).position_sd)
        notes.append(f"sds of the fixes not stated: those of the settings are ASSUMED, {sds} m")
    settings = filter_settings(config, constants=constants, lever_arm=arm or (0.0, 0.0, 0.0))
    return compensate_settings(settings, config.compensation), tuple(notes)


@public("navigate")
def navigate_recorded(
    drive: Drive | str | Path,
    config: FilterConfig | str | Path,
    *,
    gnss: GnssNoise | str | None = None,
    states: Mapping[str, Positive] | None = None,
    vehicle: Vehicle = UNCONSTRAINED,
) -> DriveResult:
    """Examine a recorded drive, filter it with and without its fixes, and score the filter.

    Parameters
    ----------
    drive : Drive, str or Path
        The drive, or where it is stored.
    config : FilterConfig, str or Path
        The filter: a configuration, its file, or the name of a built-in grade.
    gnss : GnssNoise or str, optional
        Receiver, or the name of a built-in one, in place of that of the configuration.
    states : mapping of str to float, optional
        Further states, names of `models.filter_states.named_states`, with the sd of their prior.
    vehicle : Vehicle
        What may be assumed of the vehicle: that it does not slip, and is stationary where it seems so.

    Raises
    ------
    DataError
        Where the configuration lacks an axis or the drive cannot be aligned.
    """
    measured, _ = examined_drive(drive)
    return navigate_drive(measured, config, gnss=gnss, states=states, vehicle=vehicle)


@task()
def navigate_drive(
    drive: Drive,
    config: FilterConfig | str | Path,
    *,
    gnss: GnssNoise | str | None = None,
    states: Mapping[str, float] | None = None,
    vehicle: Vehicle = UNCONSTRAINED,
) -> DriveResult:
    """Filter a drive that was examined; see `navigate_recorded`."""
    as_reported = receiver_of(drive)
    config = config_for_drive(drive, config, gnss=gnss)
    drive = with_trusted_reference(drive)
    drive = compensate(drive, config.compensation)
    if vehicle.sideways is not None:
        states = {"mounting": MOUNTING_SD, **(states or {})}
    settings, assumed = drive_filter(drive, config, states=states)
    stage("aligning", 0.57)
    stretches, notes = prepare(drive, settings)
    stage("filtering the drive", 0.62)
    solutions = navigate(stretches, settings, np.zeros((0, 2)))
    contradicted = turned_from(solutions[0]) if drive.mounting is not None else None
    if not vehicle.free:
        stretches, more = with_constraints(
            stretches, solutions, settings, vehicle, mounted=drive.mounting is not None and not contradicted
        )
        solutions = navigate(stretches, settings, np.zeros((0, 2)))
        notes = (*notes, *more, *constraint_notes(constraint_counts(solutions), vehicle))
    scored = [settled(stretch, solution) for stretch, solution in zip(stretches, solutions, strict=True)]
    expect_settled(
        any(map(len, scored)), drive.source, [float(s.fixes.t[-1] - s.fixes.t[0]) for s in stretches]
    )
    groups = [
        block for stretch, rows in zip(solutions, scored, strict=True) for block in blocks(stretch, rows)
    ]
    reference = drive.reference
    notes = (*notes, *filter(None, [drive.judged]))
    if reference is None:
        stage("smoothing the drive", 0.75)
        compared = against_smoother(settings, stretches, scored)
    else:
        stage("finding the offset of the reference", 0.8)
        reference, late = on_clock_of(reference, solutions, scored)
        reference, turned = without_wrong_attitude(reference, stretches, solutions)
        stage("comparing with the reference", 0.88)
        compared, more = against_reference(reference, solutions, scored, timed=late is not None)
        notes = (*notes, *(one for one in (late, turned) if one), *more)
    stage("filtering without fixes", 1.0)
    longest, own = max(zip(solutions, scored, strict=True), key=lambda pair: len(pair[1]))
    found = Consistency(
        None,
        compared,
        innovation_scores(
            [s.innovation[rows] for s, rows in groups],
            [s.innovation_covariance[rows] for s, rows in groups],
            [s.use[rows] for s, rows in groups],
        ),
        whiteness(
            longest.t[own],
            [longest.innovation[own]],
            [longest.innovation_covariance[own]],
            [longest.use[own]],
        ),
        tuple(
            outage
            for horizon in counted(CLAIMED_LENGTHS)
            if (outage := _outage(reference, stretches, settings, horizon)) is not None
        ),
        errors(reference, solutions, scored),
        float(
            np.mean(
                np.concatenate([s.use[rows, 0] == GATED for s, rows in zip(solutions, scored, strict=True)])
            )
        ),
        False,
    )
    found = replace(found, diverged=_diverged(found, solutions))
    if not found.outages or any(one.interval[0] > 1.0 for one in found.outages):
        notes = (*notes, *_noisier_than_configured(stretches[0], config))
    if contradicted and not found.diverged:
        notes = (NamedCause(f"{contradicted} (likely)"), *notes)
    if reference is None and found.blocks:
        notes = (*notes, "no reference: position, velocity and attitude are compared with the smoother")
    if config.gnss == as_reported and not as_reported.correlated:
        notes = (
            *notes,
            "no receiver is named: fixes are assumed to err as they report, independently of one another; --gnss GRADE "
            "adds time-correlated errors",
        )
    return DriveResult(
        replace(found, verdicts=verdicts(found)),
        config,
        settings,
        stretches,
        solutions,
        _estimates(settings, solutions[-1]),
        (*drive.notes, *filter(None, [stated_words(config.compensation)]), *assumed, *notes),
    )


def _noisier_than_configured(stretch: Stretch, config: FilterConfig) -> tuple[str, ...]:
    """Return a note where sensors at rest are noisier over a second than the filter expects.

    A body that swings about an antenna at rest seems noisy, too: what the filter errs by without fixes decides first.
    """
    found = stationary_noise(stretch.steps, stretch.alignment)
    if found is None:
        return ()
    said = np.array([model.allan_variance(1.0) for model in sensor_of_config(in_motion(config)).noise])
    ratios = found / np.sqrt(said)
    noisier = [
        f"{axis} {ratio:.1f}"
        for axis, ratio in zip(GYROS + ACCELS, ratios, strict=True)
        if ratio > MIN_NOISE_RATIO
    ]
    if not noisier:
        return ()
    more = ", or from this drive" if "drive" not in config.provenance else ""
    return (
        NamedCause.of(
            f"at rest, the sensors are noisier over 1 s than configured: {', '.join(noisier)} times",
            "certain",
            "without fixes it errs more than it predicts",
            f"make the settings from a log of this unit{more}",
        ),
    )


def _outage(
    reference: Reference | None, stretches: tuple[Stretch, ...], settings: FilterSettings, horizon: float
) -> Outage | None:
    """Withhold windows of one length and score the position at their ends; None where no window fits."""
    windows = outage_windows(stretches, horizon)
    if not windows:
        return None
    parts = []
    for solution in navigate(stretches, settings, np.array(windows)):
        for begin, end in windows:
            inside = np.flatnonzero(
                (solution.t > begin) & (solution.t <= end) & (solution.use[:, 0] == WITHHELD)
            )
            if not len(inside) or end - solution.t[inside[-1]] > 0.2 * horizon + 0.5:
                continue
            k = int(inside[-1])
            if reference is None:
                error, spread = solution.innovation[k, :3], solution.innovation_covariance[k, :3, :3]
            else:
                error = ned_between(
                    reference_at(reference, solution.t[k : k + 1])[0][0], solution.state.llh[k]
                )
                spread = solution.covariance[k, :3, :3]
            if np.isfinite(error).all():
                parts.append((error[None], spread[None]))
    return outage_score(horizon, *zip(*parts, strict=True)) if parts else None


def _diverged(found: Consistency, solutions: Sequence[Solution]) -> bool:
    """Tell whether the filter diverged: not finite, most fixes refused, or innovations far beyond prediction."""
    finite = all(np.isfinite(s.state.llh).all() and np.isfinite(s.covariance).all() for s in solutions)
    return (
        not finite or found.gated > DIVERGED_REFUSED_SHARE or any(s.ratio > DIVERGED_RATIO for s in found.nis)
    )


def _estimates(settings: FilterSettings, last: Solution) -> dict[str, tuple[tuple[float, float], ...]]:
    sd = np.sqrt(np.diag(last.final_covariance))
    layout = settings.model.layout
    return {
        name: tuple(zip(last.final_parameters[layout[name]].tolist(), sd[layout[name]].tolist(), strict=True))
        for name in settings.model.components
        if FILTER_STATES[name].origin not in (Origin.AXIS_PROCESSES, Origin.FIX_PROCESSES)
    }
