"""From a log, a measured drive or both to a filter configuration: identify, diagnose, synthesise, check.

`tune` runs the stages in order; each is a function of its own from frozen values to frozen values. Nothing is printed
and no file is written: `tuner.report.result_set` does that.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from models.sensors import SensorGrade
from tuner.catalogue.grades import DEFAULT_RECEIVER, grade_identification, load_grade
from tuner.diagnosis import diagnose
from tuner.diagnosis.data_quality.overflow import without_overflow
from tuner.diagnosis.static.position_drift import found_signals, without_events
from tuner.examination.examined_drive import examined_drive
from tuner.exporters import DIALECTS, dialect_named, export, lacking, withheld
from tuner.exporters.withheld import NATIVE_DIALECT
from tuner.formats.noise_yaml import as_written
from tuner.formats.prediction import prediction_json
from tuner.identification import identify
from tuner.identification.identify import with_terms_found
from tuner.identification.identify_source import identify_source, receiver_of_source, records_name
from tuner.navigation.compensation import with_stated_arm
from tuner.pipeline.compile_ahead import compiled_ahead
from tuner.poses.run_with_poses import compare_with_poses, poses_of, with_run
from tuner.readers import read
from tuner.readers.pose_run import read_pose_run
from tuner.readers.source_kind import is_log, source_name
from tuner.segments.conditions import at_rest, expect_rest
from tuner.segments.multi_position import PoseCalibration, calibrate
from tuner.segments.stationary import parts_text
from tuner.simulation.static import demo
from tuner.stages import stage, task
from tuner.synthesis import inflate, synthesize
from tuner.synthesis.calibration import with_calibration
from tuner.synthesis.findings import (
    findings_for_config,
    left_out,
    noisier_stretches,
    terms_found,
    with_notes_on_findings,
    without_stretches,
)
from tuner.synthesis.from_drive import identification_of_drive, receiver_of, stationary_noise
from tuner.synthesis.prediction import hold_to_records
from tuner.synthesis.rest_and_motion import with_rest_and_motion
from tuner.synthesis.sufficient import decisive_limits, with_terms_of_sheet
from tuner.synthesis.worst_case import worst_case
from tuner.tune_result import NATIVE, LogResult, TuneInputs, TuneResult
from tuner.types import Diagnosis, FilterConfig, GnssNoise, Identification
from tuner.types.arguments import expect_records
from tuner.types.consistency import Check
from tuner.types.number_ranges import Latitude, Positive, Whole
from tuner.types.prediction import PredictedBlock
from tuner.types.progress import Progress, silent
from tuner.types.public import public
from tuner.types.records import DataError, Drive, Record

if TYPE_CHECKING:
    from tuner.consistency.score_drive import DriveResult

CHECK_RUNS = 25
"""Simulated runs behind the verdict of `tune`: the position ratio is then known to 5 %, in half a minute."""
CHECK_TRAJECTORY = "city"
CHECK_DURATION = 3600.0
"""Length of each run, s: as long as a GNSS-aided filter takes to show a bias that is modelled too small."""
EXPORTED_DIALECTS = ("kalibr", "kf-gins")
"""Dialects that `tune` adds to the native configuration; `tuner.export` writes the others."""
NO_SAMPLES = "the source holds no samples that could be compared with a simulation"
LOG = "the path of a log, records, an Identification or nothing"
NO_LOG = "without a static log; of the unit only the standing parts of the drive are known"


@public("tune")
@task()
def tune(
    log: str | Path | Sequence[Record] | Identification | None = None,
    *,
    drive: str | Path | Drive | None = None,
    lever_arm: tuple[float, float, float] | None = None,
    horizon: Positive = 1000.0,
    complete: str | SensorGrade | None = None,
    datasheet: str | Path | None = None,
    gnss: str | Path | GnssNoise | None = None,
    terms: Sequence[str] | None = None,
    latitude: Latitude | None = None,
    conservative: bool = False,
    replicas: Whole = 0,
    seed: Whole = 0,
    dialect: str | None = None,
    progress: Progress = silent,
) -> TuneResult:
    """Turn a static log, a measured drive or both into a filter configuration, and check that filter.

    Parameters
    ----------
    log : str, Path, sequence of Record or Identification, optional
        Records of a static log, or anything `identify_source` takes. Without it the standing parts of the drive
        are the log; without a drive either, a simulated unit with a hidden effect, drawn from the seed.
    drive : str, Path or Drive, optional
        A measured drive of the unit, or a run with poses of another sensor (`tuner.readers.pose_run`): what it shows
        enters the configuration.
    lever_arm : tuple of 3 floats, optional
        From the inertial unit to the antenna of that drive, forward, right, down, m, in place of what the drive states;
        it is used as stated, also where the drive shows another.
    horizon : float, optional
        Longest time the filter must predict without aiding, s.
    complete : str or SensorGrade, optional
        Grade that stands in for a sensor the log lacks, and for `datasheet`.
    datasheet : str or Path, optional
        Built-in grade or data sheet to compare with; its slow terms stand in where the log shows a limit alone that
        decides the drift of a minute.
    gnss : str, Path or GnssNoise, optional
        Receiver: a built-in grade, a log of fixes at rest, or its errors; by default what the fixes of the drive
        report.
    terms : sequence of str, optional
        Fit exactly this sum of noise terms.
    latitude : float, optional
        Degrees; takes the Earth's rate out of the gyro means.
    conservative : bool, optional
        Use the noise of the worst stretch of the log throughout, instead of its share of the time.
    replicas : int, optional
        Simulated records a finding, for bands.
    seed : int, optional
        Seed of everything random.
    dialect : str, optional
        A further dialect to write the settings in: a key of `DIALECTS`.
    progress : callable, optional
        Called with one line at each step.

    Returns
    -------
    TuneResult

    Raises
    ------
    DataError
        Where log, drive, grade or receiver cannot be used, or a lever arm is stated without a drive: one line.
    """
    if lever_arm is not None and drive is None:
        raise DataError("tune: lever_arm: expected a drive with it, found none")
    wanted = [] if dialect is None else [dialect_named(dialect).name]
    completion = load_grade(complete) if isinstance(complete, str) else complete
    stated = None if datasheet is None else identify_source(datasheet)
    inputs = gather_inputs(log, drive, gnss, lever_arm, seed=seed, progress=progress)
    stage("identifying and diagnosing the log", 0.9 if inputs.drive is None else 0.15)
    with compiled_ahead(log=bool(inputs.records), check=inputs.receiver is not None or not wanted):
        noise = identify_and_diagnose(
            inputs, terms=terms, latitude=latitude, replicas=replicas, seed=seed, progress=progress
        )
    progress("synthesising the filter configuration")
    stage("comparing the settings with the log", 0.95 if inputs.drive is None else 0.2)
    calibration = calibrate(inputs.records) if inputs.records else None
    config, predictions = configure(
        inputs,
        noise,
        calibration=calibration,
        horizon=horizon,
        complete=completion,
        sheet=stated or (None if completion is None else grade_identification(completion)),
        conservative=conservative,
        seed=seed,
    )
    compared = None
    if inputs.run is not None:
        progress("comparing the run with its poses")
        compared = compare_with_poses(
            inputs.run.records, poses_of(inputs.run.poses), config, inputs.run.name, noise.still
        )
        config = with_run(config, compared)
    examined, choice, measured, judged = None, None, None, None
    unmeasured: Mapping[str, str] = {}
    if inputs.drive is not None:  # the diagnosis of drives takes a third of a second to load
        from tuner.consistency.reference_check import with_trusted_reference
        from tuner.diagnosis.drive.config_after_drive import config_after_drive
        from tuner.diagnosis.drive.explained_drive import examine_and_explain
        from tuner.diagnosis.drive.held_out_choice import choose_config
        from tuner.diagnosis.drive.noise_in_motion import with_noise_in_motion

        stage("diagnosing the drive", 0.6)
        judged = with_trusted_reference(inputs.drive)
        begun = with_noise_in_motion(judged, config, inputs.examination)
        examined = examine_and_explain(judged, begun, inputs.examination, progress=progress)
        began, found = (config_after_drive(examined, kept=kept) for kept in (False, True))
        stage("choosing the settings of the drive", 0.85)
        choice = choose_config(judged, examined, began, found, progress)
        config, left_out = with_stated_arm(with_rest_and_motion(config, choice.config), lever_arm)
        config = replace(config, notes=(*config.notes, choice.note, *left_out))
    config = as_written(config)  # what is judged and returned is what the file says
    if judged is not None:
        stage("scoring the settings on the whole drive", 0.95)
        measured, unmeasured = measured_or_reason(judged, config, progress)
    exports, kept_back = exports_of(config, wanted)
    stage("checking the filter on simulated drives", 1.0)
    aided = config.gnss is not None or not wanted
    checked, unchecked = check_or_reason(config, seed=seed, progress=progress) if aided else (None, {})
    return TuneResult(
        inputs.name,
        inputs.records,
        noise.identification,
        noise.diagnosis,
        examined,
        calibration,
        config,
        checked,
        MappingProxyType(dict(predictions)),
        MappingProxyType({**noise.absent, **unmeasured, **unchecked}),
        MappingProxyType(dict(exports)),
        inputs.key,
        replicas,
        seed,
        choice,
        stated,
        measured,
        MappingProxyType(dict(kept_back)),
        inputs.examination,
        compared,
    ).written


def exports_of(config: FilterConfig, wanted: Sequence[str]) -> tuple[Mapping[str, str], Mapping[str, str]]:
    """Return the text of each configuration file by its name, and why others are not written.

    Parameters
    ----------
    config : FilterConfig
        Settings.
    wanted : sequence of str
        Dialects wanted beside ``noise.yaml`` and `EXPORTED_DIALECTS` where they have their sensors.

    Raises
    ------
    DataError
        Where a wanted dialect lacks a sensor.
    """
    names = [*wanted, *(name for name in EXPORTED_DIALECTS if not lacking(config, DIALECTS[name]))]
    files = {NATIVE: NATIVE_DIALECT, **{file_of_dialect(name): name for name in names}}
    kept_back = {file: why for file, name in files.items() if (why := withheld(config, name))}
    return {file: export(config, name) for file, name in files.items() if file not in kept_back}, kept_back


def file_of_dialect(name: str) -> str:
    """Return the name of the file that `tune` writes in a dialect."""
    return f"{name}.yaml" if name in EXPORTED_DIALECTS else f"{name}.txt"


def gather_inputs(
    log: str | Path | Sequence[Record] | Identification | None,
    drive: str | Path | Drive | None,
    gnss: str | Path | GnssNoise | None,
    lever_arm: tuple[float, float, float] | None = None,
    *,
    seed: int,
    progress: Progress,
) -> TuneInputs:
    """Read what is named by a path, choose name and receiver, and simulate where there is neither log nor drive."""
    run = read_pose_run(drive) if isinstance(drive, str | Path) else None
    measured, examination = (
        (None, None) if drive is None or run else examined_drive(drive, progress, lever_arm=lever_arm)
    )
    if run and (log is None or lever_arm is not None):
        wanted = "a log at rest before --drive" if log is None else "no --lever-arm"
        raise DataError(f"tune: {drive} is a run with poses in place of fixes: expected {wanted}")
    key: Mapping[str, Any] | None = None
    records: tuple[Record, ...] = ()
    source: str | Path | Identification | None = None
    if isinstance(log, Identification) or (isinstance(log, str | Path) and not is_log(log)):
        source = log
    elif isinstance(log, str | Path):
        records = read(log)
    elif log is not None:
        records = expect_records(log, "tune", LOG)
    if gnss is None and measured is not None:
        receiver: GnssNoise | None = receiver_of(measured)
    elif isinstance(gnss, GnssNoise):
        receiver = gnss
    elif gnss is not None or log is None:
        receiver = receiver_of_source(gnss or DEFAULT_RECEIVER, progress)
    else:
        receiver = None
    if log is None and measured is None:
        progress("simulating an IMU with a hidden effect")
        records, key = demo(seed)
        return TuneInputs(f"simulated-{seed}", records, None, None, receiver, key)
    names = [] if log is None else [_log_name(log, records)]
    names += [one.name for one in (measured, run) if one is not None]
    return TuneInputs("-".join(names), records, source, measured, receiver, key, examination, run)


def _log_name(log: str | Path | Sequence[Record] | Identification, records: Sequence[Record]) -> str:
    if isinstance(log, Identification):
        return str(log.source.get("name", "unnamed"))
    return source_name(log) if isinstance(log, str | Path) else records_name(records)


@task()
def identify_and_diagnose(
    inputs: TuneInputs,
    *,
    terms: Sequence[str] | None,
    latitude: float | None,
    replicas: int,
    seed: int,
    progress: Progress,
) -> LogResult:
    """Return the noise of the unit and, where there are samples, what a simulation of that noise gets wrong."""
    if inputs.records:
        stage("finding where the sensor is at rest", 0.05)
        still = at_rest(inputs.records, progress)
        expect_rest(still)
        progress("identifying")
        stage("identifying the noise", 0.25)
        found = identify(still, terms=terms, latitude=latitude)
        stage("searching for what the noise does not explain", 0.95)
        try:
            diagnosis = diagnose(
                inputs.records, identification=found, replicas=replicas, seed=seed, progress=progress
            )
        except DataError as error:
            return LogResult(found, None, {"diagnosis": str(error)}, still)
        stage("identifying the noise beside the findings", 1.0)
        before = {record.segments for record in still}
        still, found = identified_again(still, found, diagnosis, terms=terms, latitude=latitude)
        if terms is None:
            found = with_terms_found(still, found, terms_found(diagnosis))
            found = with_notes_on_findings(found, diagnosis, still)
        for record in {one.segments: one for one in still if one.segments not in before}.values():
            note = f"the diagnosis found more that is no noise at rest; used: {parts_text(record, record.segments)}"
            progress(note)
            found = replace(found, notes=(*found.notes, note))
        return LogResult(found, diagnosis, {}, still)
    if isinstance(inputs.source, Identification):
        return LogResult(inputs.source, None, {"diagnosis": NO_SAMPLES})
    if inputs.source is not None:
        found = identify_source(inputs.source, terms=terms, latitude=latitude, progress=progress)
        return LogResult(found, None, {"diagnosis": NO_SAMPLES})
    assert inputs.drive is not None
    found = identification_of_drive(inputs.drive, stationary_noise(inputs.drive))
    return LogResult(found, None, {"static diagnosis": NO_LOG})


def identified_again(
    still: tuple[Record, ...],
    found: Identification,
    diagnosis: Diagnosis,
    *,
    terms: Sequence[str] | None,
    latitude: float | None,
) -> tuple[tuple[Record, ...], Identification]:
    """Return records and their noise without what a diagnosis takes out of them; as given where it takes nothing.

    Wrapped samples are put back, events are taken out; motion and what is noisier for a while are left out, unless too
    little would be left.
    """
    findings = diagnosis.findings
    widths = {axis: one.value for one in findings if one.cause == "overflow" for axis in one.channels}
    whole = tuple(without_events(without_overflow(record, widths), findings) for record in still)
    resting = tuple(
        without_stretches(record, (*diagnosis.left_out, *noisier_stretches(diagnosis, record)))
        for record in whole
    )

    def noise(records: tuple[Record, ...]) -> Identification:
        if len(records) == len(still) and all(map(operator.is_, records, still)):
            return found
        return identify(records, terms=terms, latitude=latitude)

    try:
        return resting, noise(resting)
    except DataError:
        moved = noise(whole)
        left = "the noise was identified with the motion that was found in it: too little is left without it"
        return whole, replace(moved, notes=(*moved.notes, left))


def configure(
    inputs: TuneInputs,
    noise: LogResult,
    *,
    calibration: PoseCalibration | None,
    horizon: float,
    complete: SensorGrade | None,
    sheet: Identification | None,
    conservative: bool,
    seed: int,
) -> tuple[FilterConfig, Mapping[str, PredictedBlock]]:
    """Return the configuration that the static log implies, and how well each of its axes predicts that log.

    Axes that fail to predict their log get settings that do; slow terms that a log does not show and that decide the
    drift of a minute are those of a sheet, where one is given; noise that is larger for a part of the time is advice,
    unless the configuration is to be conservative.
    """
    found = () if noise.diagnosis is None else noise.diagnosis.findings
    signals = found_signals([one for one in found if one not in left_out(found)], noise.still)

    def settings(identification: Identification) -> tuple[FilterConfig, Mapping[str, PredictedBlock]]:
        made = synthesize(
            identification,
            name=inputs.name,
            horizon=horizon,
            complete=complete,
            gnss=inputs.receiver,
            seed=seed,
            findings=() if noise.diagnosis is None else findings_for_config(noise.diagnosis),
        )
        return hold_to_records(made, noise.still, signals)

    config, predictions = settings(noise.identification)
    axes = list(dict.fromkeys(one.quantity.owner for one, _ in decisive_limits(config)))
    if sheet is not None and axes:
        config, predictions = settings(with_terms_of_sheet(noise.identification, axes, sheet))
    stored = {axis: prediction_json(found, curve=False) for axis, found in predictions.items()}
    config = replace(config, provenance={**config.provenance, "prediction": stored})
    if noise.diagnosis is not None:
        worst = worst_case(noise.diagnosis, config, noise.still)
        config = inflate(config, worst) if conservative else replace(config, worst_case=worst)
    if calibration is not None:
        config = with_calibration(config, calibration)
    return config, predictions


def measured_or_reason(
    drive: Drive, config: FilterConfig, progress: Progress
) -> tuple[DriveResult | None, Mapping[str, str]]:
    """Return the filter of a configuration on the drive it was made for, or None and why it cannot be scored.

    Raises
    ------
    DataError
        Where that filter diverged: what it shows of the drive is then no finding.
    """
    from tuner.consistency.score_drive import navigate_drive  # with the filter, loaded where it runs

    progress("scoring the settings on the whole drive")
    try:
        measured = navigate_drive(drive, config)
    except DataError as error:
        return None, {"scores on the drive": str(error)}
    if measured.consistency.diverged:
        raise DataError(diverged_on(drive, measured))
    return measured, {}


def diverged_on(drive: Drive, measured: DriveResult) -> str:
    """Return in one line why nothing is concluded from a drive on which the filter diverged: what was measured."""
    found = measured.consistency
    worst = "".join(f", innovations {one.ratio:.3g} × predicted" for one in found.nis[:1])
    return (
        f"{drive.source or drive.name}: expected a filter that follows the drive, found one that diverged with the "
        f"settings as tuned: {100.0 * found.gated:.0f} % of the fixes refused{worst}; nothing is "
        "concluded from this drive"
    )


def check_or_reason(
    config: FilterConfig, *, seed: int, progress: Progress
) -> tuple[Check | None, Mapping[str, str]]:
    """Return the check of a configuration as `tuner check` makes it, or None and why it cannot be checked."""
    from tuner.consistency.check import check  # with the filter, loaded where it runs
    from tuner.navigation.settings import filter_settings

    try:
        filter_settings(config, constants=config.constants)
        progress(f"checking the filter on {CHECK_RUNS} simulated hours")
        return check(config, CHECK_TRAJECTORY, duration=CHECK_DURATION, runs=CHECK_RUNS, seed=seed), {}
    except DataError as error:
        return None, {"consistency": str(error)}
