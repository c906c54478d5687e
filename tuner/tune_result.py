"""What `tune` is given, what it knows of the unit, and what it returns: frozen values without a step of their own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from textwrap import wrap
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from tuner.examination.examine import Examination
from tuner.formats.yaml_text import comment
from tuner.judgement import Settings, judge_settings
from tuner.segments.multi_position import PoseCalibration
from tuner.types import Diagnosis, FilterConfig, GnssNoise, Identification
from tuner.types.consistency import Check
from tuner.types.judgement import Judgement, Use
from tuner.types.prediction import PredictedBlock
from tuner.types.records import Drive, Record
from tuner.types.shown import Shown

if TYPE_CHECKING:
    from tuner.consistency.score_drive import DriveResult
    from tuner.diagnosis.drive import ExaminedDrive
    from tuner.diagnosis.drive.held_out_choice import HeldOutChoice
    from tuner.poses.run_with_poses import RunWithPoses
    from tuner.readers.pose_run import PoseRun


NATIVE = "noise.yaml"
"""File of the native configuration."""
COMMENT_WIDTH = 110
"""Longest line of the verdict atop it."""


@dataclass(frozen=True)
class TuneInputs:
    """What a configuration is made from.

    Attributes
    ----------
    name : str
        Name of the log, the drive, or both.
    records : tuple of Record
        Static log; empty where there is none.
    source : str or Path or Identification or None
        What stands for a log without samples: a datasheet, a grade, an Allan curve, a stored identification.
    drive : Drive or None
        Measured drive, without what its examination found.
    receiver : GnssNoise or None
        Errors of the aiding.
    key : mapping or None
        Ground truth of a simulated log.
    examination : Examination or None
        What was wrong with the streams of the drive.
    run : PoseRun or None
        Measured run with poses.
    """

    name: str
    records: tuple[Record, ...]
    source: str | Path | Identification | None
    drive: Drive | None
    receiver: GnssNoise | None
    key: Mapping[str, Any] | None = None
    examination: Examination | None = None
    run: PoseRun | None = None


@dataclass(frozen=True)
class LogResult:
    """Noise of the unit, what a simulation of it gets wrong, what is absent and why, and the samples at rest."""

    identification: Identification
    diagnosis: Diagnosis | None
    absent: Mapping[str, str]
    still: tuple[Record, ...] = ()


@dataclass(frozen=True, repr=False)
class TuneResult(Shown):
    """A filter configuration with everything it rests on.

    Attributes
    ----------
    name : str
        Name of the log, the drive, or both.
    records : tuple of Record
        Static log; empty where there is none.
    identification : Identification
        Noise terms of every channel.
    diagnosis : Diagnosis or None
        What a simulation of the noise gets wrong.
    drive : ExaminedDrive or None
        What the drive shows to be wrong with the filter.
    calibration : PoseCalibration or None
        Calibration, where the log has several poses.
    config : FilterConfig
        Settings of the filter.
    check : Check or None
        Monte-Carlo consistency of the filter.
    predictions : mapping of str to PredictedBlock
        How well the settings of each axis predict the static log, by axis; before a drive changed them.
    absent : mapping of str to str
        Parts that were not run, each with the reason.
    exports : mapping of str to str
        Text of each configuration file by its name: ``noise.yaml`` and the dialects.
    key : mapping or None
        Ground truth of a simulated log.
    replicas, seed : int
        As given.
    choice : HeldOutChoice or None
        What the drive keeps of its findings, by its last part.
    datasheet : Identification or None
        What the data sheet states, to be shown beside what was measured.
    measured : DriveResult or None
        The filter with the settings as written on the whole drive, scored as `navigate` scores it.
    withheld : mapping of str to str
        Files of settings that are not written, each with the reason.
    examination : Examination or None
        What was wrong with the streams of the drive, and was mended before it was filtered.
    run : RunWithPoses or None
        What a run with poses shows of the noise.
    """

    name: str
    records: tuple[Record, ...]
    identification: Identification
    diagnosis: Diagnosis | None
    drive: ExaminedDrive | None
    calibration: PoseCalibration | None
    config: FilterConfig
    check: Check | None
    predictions: Mapping[str, PredictedBlock]
    absent: Mapping[str, str]
    exports: Mapping[str, str]
    key: Mapping[str, Any] | None = None
    replicas: int = 0
    seed: int = 0
    choice: HeldOutChoice | None = None
    datasheet: Identification | None = None
    measured: DriveResult | None = None
    withheld: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    examination: Examination | None = None
    run: RunWithPoses | None = None

    @cached_property
    def verdict(self) -> Judgement:
        """For what the settings can be used, from everything that is known of them."""
        return judge_settings(
            Settings(
                self.identification,
                self.config,
                self.predictions,
                self.diagnosis,
                self.check,
                None if self.drive is None else self.drive.diagnosis,
                self.choice,
                None if self.measured is None else self.measured.consistency,
            )
        )

    @property
    def written(self) -> TuneResult:
        """The result without the files of settings that its verdict forbids to use; else with it atop noise.yaml."""
        if self.verdict.use is not Use.DO_NOT_USE:
            said = wrap(f"Verdict: {self.verdict.text}", COMMENT_WIDTH)
            head = "".join(f"{comment(line)}\n" for line in said)
            texts = {name: head * (name == NATIVE) + text for name, text in self.exports.items()}
            return replace(self, exports=MappingProxyType(texts))
        reasons = dict.fromkeys(self.exports, self.verdict.text)
        withheld = MappingProxyType({**self.withheld, **reasons})
        return replace(self, exports=MappingProxyType({}), withheld=withheld)
