"""Diagnosis of a measured drive: search for causes, gain on the last part, configuration with the findings."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models import rotation
from models.filter_states import FILTER_STATES
from models.filter_states.built_in import CORRELATED_VELOCITY
from tuner.consistency.reference_check import with_trusted_reference
from tuner.diagnosis.drive.against_reference import against_reference
from tuner.diagnosis.drive.causes.correlated_gnss import of_several_processes
from tuner.diagnosis.drive.causes.mounting import mounting, untestable_causes
from tuner.diagnosis.drive.causes.quantizer import coarse_quantizer_notes
from tuner.diagnosis.drive.causes.registry import DRIVE_CAUSES, significance_threshold
from tuner.diagnosis.drive.causes.sensor_bias import biases_beyond_prior
from tuner.diagnosis.drive.causes.time_offset import RATE, clock_coefficients, delays_of
from tuner.diagnosis.drive.findings import finding, inseparable_causes, of_first_and_last
from tuner.diagnosis.drive.held_out_gain import held_out_gain
from tuner.diagnosis.drive.hypothesis import (
    FilterRun,
    Hypothesis,
    in_sensor_axes,
    run_filter,
)
from tuner.diagnosis.drive.hypothesis_tests import Candidate, noise_hypothesis_of
from tuner.diagnosis.drive.plausibility import plausible
from tuner.diagnosis.drive.posterior_check import with_something_else
from tuner.diagnosis.drive.search import Accepted, SearchResult, search_causes
from tuner.diagnosis.drive.staying_errors import OPEN, with_stated_rest
from tuner.formats.clock_words import clock_note
from tuner.formats.diagnosis import config_finding
from tuner.linear_run.likelihood import as_configured, evaluate
from tuner.navigation.drive.run import expect_settled
from tuner.navigation.drive.vehicle_constraints import turned_from
from tuner.stages import stage, task
from tuner.types import Compensation, DriveDiagnosis, FilterConfig, Gain, Parameter, Unexplained
from tuner.types.clock import Clock
from tuner.types.records import DataError, Drive


@dataclass(frozen=True)
class ExaminedDrive:
    """A drive with its diagnosis: as filtered, the runs before and after, and the result."""

    drive: Drive
    search: SearchResult
    diagnosis: DriveDiagnosis


def diagnose_drive(
    drive: Drive,
    config: FilterConfig,
    *,
    wheels: bool = False,
    progress: Callable[[str], None] | None = None,
) -> DriveDiagnosis:
    """Find what the filter's model gets wrong on a drive, and why; see `examine_drive`."""
    return examine_drive(drive, config, wheels=wheels, progress=progress).diagnosis


def examine_drive(
    drive: Drive,
    config: FilterConfig,
    *,
    wheels: bool = False,
    progress: Callable[[str], None] | None = None,
) -> ExaminedDrive:
    """Find what the filter's model gets wrong on a drive, and why.

    Parameters
    ----------
    drive : Drive
        The drive.
    config : FilterConfig
        Noise of the sensor and of the receiver as configured; sds that the receiver reports replace the latter.
    wheels : bool
        Whether the vehicle's wheels do not slip: then the stated mounting of the unit is tested.
    progress : callable, optional
        Called with what is being done.

    Raises
    ------
    DataError
        Where the drive cannot be aligned, the configuration lacks an axis, or its covariances are lost in rounding.
    """
    try:
        return _examine(drive, config, wheels, progress)
    except np.linalg.LinAlgError as error:
        raise DataError(
            f"{drive.source or drive.name}: the covariances of the filter are lost in rounding ({error}), expected "
            "a configuration whose noise is of the size of the sensor's and the receiver's"
        ) from error


@task()
def _examine(
    drive: Drive, config: FilterConfig, wheels: bool, progress: Callable[[str], None] | None
) -> ExaminedDrive:
    drive = with_trusted_reference(drive)
    stage("filtering the drive", 0.1)
    sensor = in_sensor_axes(drive)
    base = run_filter(sensor, Hypothesis.first(sensor, config, config.compensation))
    spans = [float(np.ptp(solution.t)) for solution in base.solutions]
    expect_settled(bool(base.linearized.counted.any()), drive.source or drive.name, spans)
    stage("searching for causes", 0.85)
    outcome = search_causes(sensor, base, delays_of(drive.clock, config.compensation), progress)
    outcome = outcome.as_measured(clock_coefficients(drive.clock, config.compensation))
    notes = (
        *base.notes,
        *(filter(None, [clock_note(drive.clock)]) if _one_clock(drive.clock, outcome) else []),
        *outcome.notes,
        *coarse_quantizer_notes(sensor),
    )
    if (every := round(1.0 / np.mean(~base.hypothesis.not_looked_at))) > 1:
        notes = (*notes, f"one fix of {every} is looked at")
    if lacking := config.constants.keys() - {CORRELATED_VELOCITY.name}:
        states = ", ".join(FILTER_STATES[name].meaning for name in config.constants if name in lacking)
        notes = (*notes, f"searched without the further states of the configuration: {states}")
    stage("testing the findings on the last part of the drive", 1.0)
    gain = held_out_gain(sensor, outcome)
    seen, beyond = against_reference(drive, outcome.final, config.gnss)
    diagnosis = plausible(_diagnosis(drive, config, wheels, outcome, (*notes, *seen), gain), outcome.final)
    diagnosis = replace(diagnosis, unexplained=(*diagnosis.unexplained, *beyond))
    if turned := _turned_axes(drive, outcome.final):
        diagnosis = replace(diagnosis, unexplained=(*diagnosis.unexplained, turned))
    return ExaminedDrive(sensor, outcome, diagnosis)


def _one_clock(clock: Clock, outcome: SearchResult) -> bool:
    """Return whether what a drive shows of its clock without a filter is all that is known of it."""
    return clock.drift.certain or RATE.cause not in outcome.shifts


def _turned_axes(drive: Drive, run: FilterRun) -> Unexplained | None:
    """Return what the motion says of a stated mounting that it contradicts; a run is in the axes of the sensor."""
    if drive.mounting is None:
        return None
    solution = run.solutions[0]
    to_vehicle = rotation.quat_from_mat(drive.mounting)
    quat = rotation.quat_multiply(
        solution.state.quat_nb, np.broadcast_to(to_vehicle, solution.state.quat_nb.shape)
    )
    text = turned_from(replace(solution, state=replace(solution.state, quat_nb=quat)))
    return None if text is None else Unexplained(text, ("imu",), 0.0)


def not_named(tests: Sequence[Candidate], causes: Collection[str]) -> tuple[Unexplained, ...]:
    """Return significant tests without those of causes that are named: a cause has one status.

    A named one stays significant where the filter cannot follow its estimate any further.
    """
    return tuple(
        Unexplained(f"{a.cause}: {a.result.name}", ("drive",), a.result.p_value)
        for a in tests
        if a.cause not in causes
    )


def _diagnosis(
    drive: Drive,
    config: FilterConfig,
    wheels: bool,
    outcome: SearchResult,
    notes: tuple[str, ...],
    gain: Gain | None,
) -> DriveDiagnosis:
    """Return the result of a search; the gain on the last part counts for a finding only where it is the only one."""
    n = max(1, int(np.count_nonzero(outcome.base.linearized.counted.any(axis=1))))
    before = evaluate(as_configured(outcome.base.linearized)).value / n
    own = [
        gain
        if gain is not None and len(outcome.accepted) == 1
        else Gain("in sample", before, before + one.candidate.result.gain / n, one.candidate.result.gain)
        for one in outcome.accepted
    ]
    pairs = zip(of_first_and_last(outcome.accepted, drive.gnss.t), own, strict=True)
    noise, limit = noise_hypothesis_of(outcome.final, outcome.shifts), significance_threshold()

    def doubted(one: Accepted) -> tuple[str, ...]:
        states = DRIVE_CAUSES[one.cause].joins == "states"
        several = states and of_several_processes(one.cause, noise, limit)
        return tuple(one.parameters) if several else outcome.doubted(one)

    findings = tuple(
        sorted((finding(one, drive, of, doubted(one)) for one, of in pairs), key=lambda f: f.p_value)
    )
    biases = biases_beyond_prior(outcome.final, config, outcome.shifts, significance_threshold())
    # A bias is what named causes leave: it comes last.
    turned = (
        mounting(outcome.final, drive.mounting, significance_threshold())
        if wheels and drive.mounting is not None
        else None
    )
    findings = (*findings, *biases) if turned is None else (*findings, turned, *biases)
    findings = with_something_else(findings, outcome)
    final = outcome.final.hypothesis
    wider = {axis: abs(c.value or 0.0) for f in biases for axis, c in f.parameters.items()}
    channels = {
        axis: replace(noise, constant_sd=max(noise.constant_sd, wider.get(axis, 0.0)))
        for axis, noise in final.config.channels.items()
    }
    determined = outcome.determined(final.compensation)
    taken_out = Compensation({p: value for p, value in determined.items() if value != 0.0})
    if turned is not None:
        angles = {Parameter(turned.cause, name): c.value or 0.0 for name, c in turned.parameters.items()}
        taken_out = taken_out.with_values({p: taken_out.get(p, 0.0) + value for p, value in angles.items()})
    states = [one for one in outcome.accepted if DRIVE_CAUSES[one.cause].joins == "states" and doubted(one)]
    after = replace(
        final.config,
        channels=channels,
        compensation=taken_out,
        findings=(*config.findings, *map(config_finding, findings)),
        notes=(*final.config.notes, *(f"{one.cause.replace('_', ' ')}: {OPEN}" for one in states)),
    )
    after = with_stated_rest(after, drive.gnss)
    causes = tuple(finding.cause for finding in findings)
    left = not_named(outcome.unexplained, causes)
    all_notes = (*drive.notes, *notes)
    untestable = untestable_causes(outcome.final, drive.mounting, wheels=wheels, accepted=causes)
    return DriveDiagnosis(
        findings, config, after, left, (*inseparable_causes(outcome.accepted), *untestable), all_notes, gain
    )
