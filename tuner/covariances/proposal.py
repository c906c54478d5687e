"""Covariances of a recording for robot_localization: what each stream errs, what to write, what that is good for."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from models.probability import chi2_quantile
from tuner.covariances.robot_localization_form import PLACE, Settings, chosen, course_of
from tuner.covariances.streams import StreamErrors, stream_errors
from tuner.diagnosis.drive.noise_in_motion import with_noise_in_motion
from tuner.examination.examined_drive import examined_drive
from tuner.exporters.judged_drive import Compared
from tuner.formats.digits import rounded
from tuner.formats.yaml_text import Inline, Noted, yaml_text
from tuner.identification import identify
from tuner.limits import HONEST_RATIO, TOLERATED_RATIO
from tuner.readers import read
from tuner.readers.drive import read_drive
from tuner.readers.pose_run import read_pose_run
from tuner.segments.conditions import at_rest
from tuner.synthesis import synthesize
from tuner.synthesis.from_drive import config_of_drive, receiver_of, stationary_noise
from tuner.types.progress import Progress, silent
from tuner.types.records import DataError, Drive

FILE = "robot_localization.yaml"
"""Name of what is written."""
HOUR = 3600.0
"""Time in which a gate should refuse no more than one right reading, s."""
MESSAGES: Mapping[str, tuple[str, str, str, int]] = {
    "fixes": ("gnss_driver", "position_covariance", "odom0_pose_rejection_threshold", 3),
    "wheels": ("wheel_driver", "twist_covariance_vx_vy", "twist0_rejection_threshold", 2),
    "gyro": ("imu_driver", "angular_velocity_covariance", "imu0_twist_rejection_threshold", 3),
    "accel": ("imu_driver", "linear_acceleration_covariance", "", 3),
}
"""Of each stream the driver, the field of its message, the gate of the filter, and the components of a reading."""


@dataclass(frozen=True)
class Covariances:
    """Covariances for a recording.

    Attributes
    ----------
    name : str
        Of the recording.
    span : float
        Its length, s.
    streams : tuple of StreamErrors
        What each stream errs.
    settings : Settings
        What robot_localization should be given.
    ratios : mapping of str to float
        True ÷ predicted errors of that filter with them, by what they are of.
    rms : float
        Its error of the position, three axes, m.
    unit_from : str
        Where the noise of the unit to begin with comes from.
    notes : tuple of str
        What was mended before.
    """

    name: str
    span: float
    streams: tuple[StreamErrors, ...]
    settings: Settings
    ratios: Mapping[str, float]
    rms: float
    unit_from: str
    notes: tuple[str, ...]

    @property
    def factors(self) -> Mapping[str, float]:
        """How far each ratio is from 1, either way, as a factor; the farthest first."""
        found = {name: max(one, 1.0 / one) for name, one in self.ratios.items()}
        return dict(sorted(found.items(), key=lambda pair: -pair[1]))

    @property
    def written(self) -> bool:
        """Whether the settings are written at all."""
        return max(self.factors.values()) <= TOLERATED_RATIO

    @property
    def verdict(self) -> str:
        """For what the settings can be used."""
        said = f"errors are {min(self.ratios.values()):.2f} to {max(self.ratios.values()):.2f} × predicted"
        if not self.written:
            worst = next(iter(self.factors))
            return (
                "do not use: with none of the settings tried is robot_localization honest around this motion; at best "
                f"its error of the {worst} is {self.ratios[worst]:.2g} × predicted. Nothing is written"
            )
        far = [name for name in self.ratios if self.factors[name] > HONEST_RATIO]
        if far:
            return f"usable except for {', '.join(far)}: {said}"
        return f"usable: robot_localization's {said} here"

    def gates(self) -> Mapping[str, float]:
        """Return the Mahalanobis distance beyond which one right reading lies in an hour, by parameter."""
        found: dict[str, float] = {}
        for one in self.streams if self.written else ():
            _, _, gate, size = MESSAGES.get(one.stream, ("", "", "", 1))
            if gate:
                found[gate] = math.sqrt(chi2_quantile(1.0 - one.interval / HOUR, size))
        return found

    def sd(self, one: StreamErrors) -> float | None:
        """Return the sd to write for a stream; None where nothing is, and for velocities in axes of the world."""
        if not self.written:
            return None
        if one.stream == "accel":
            return one.size.value if one.size.value is not None else one.size.upper
        return self.settings.sds.get(key_of(one))


def key_of(one: StreamErrors) -> str:
    """Return the name of some components of a stream."""
    return f"{one.stream} {one.part}".strip()


def covariances_of(
    source: str | Path | Drive, rest: str | Path | None = None, progress: Progress = silent
) -> Covariances:
    """Return the covariances of a recording for robot_localization.

    Parameters
    ----------
    source : str, Path or Drive
        The recording, or where it is stored.
    rest : str or Path, optional
        Log of the unit at rest, for its noise.
    progress : callable, optional
        Called with what is being done.

    Raises
    ------
    DataError
        Where the recording cannot be used, or holds poses in place of fixes.
    """
    if isinstance(source, str | Path) and read_pose_run(source) is not None:
        raise DataError(
            f"{source}: expected fixes, found poses: white noise is all that poses show of themselves, what lasts "
            f"looks like motion; `tuner tune REST --drive {source} --to vins` holds their covariance against it"
        )
    recorded = source if isinstance(source, Drive) else read_drive(source)
    notes: tuple[str, ...] = ()
    if recorded.wheels is not None and recorded.mounting is None:
        notes = (
            "wheels are left out: nothing states the axes of the unit in the vehicle, as imu_frame of an NPZ does",
        )
        recorded = replace(recorded, wheels=None)
    drive, examination = examined_drive(recorded, progress)
    if rest is None:
        config = config_of_drive(drive, stationary_noise(drive))
        unit_from, notes = "its rest and a built-in grade", (*notes, *config.notes[:1])
    else:
        progress("identifying the noise at rest")
        records = at_rest(read(rest), progress)
        config = synthesize(identify(records), records=records, gnss=receiver_of(drive))
        unit_from = f"the log at rest {Path(rest).name}"
    progress("separating white and lasting errors of the streams")
    streams, run = stream_errors(drive, with_noise_in_motion(drive, config, examination), recorded)
    progress("choosing the settings of robot_localization")
    settings, found = chosen(course_of(drive, run), {key_of(one): one for one in streams})
    return Covariances(
        drive.name,
        float(np.ptp(drive.imu_t)),
        streams,
        settings,
        dict(_ratios(found)),
        found[0].rms,
        unit_from,
        (*notes, *drive.notes),
    )


def _ratios(found: tuple[Compared, ...]) -> list[tuple[str, float]]:
    """Return true ÷ predicted error of the position and velocity with fixes, and of the position without."""

    def ratio(one: Compared, own: slice) -> float:
        return math.sqrt(float(np.mean(one.squares(own))) / 3.0)

    with_fixes, *without = found
    named = [("position", ratio(with_fixes, PLACE)), ("velocity", ratio(with_fixes, slice(3, 6)))]
    return named + [(f"position {one.seconds:g} s without fixes", ratio(one, PLACE)) for one in without]


def yaml_of(found: Covariances) -> str:
    """Return the settings as YAML, parameters that robot_localization reads and what drivers are to declare."""
    tree: dict[str, Any] = {}
    by_stream: dict[str, list[StreamErrors]] = {}
    for one in found.streams:
        by_stream.setdefault(one.stream, []).append(one)
    for stream, parts in by_stream.items():
        sds = [sd for one in parts if (sd := found.sd(one)) is not None]
        if stream not in MESSAGES or not sds:
            continue
        driver, field, _, _ = MESSAGES[stream]
        unit = parts[0].white.unit
        own = tree.setdefault(driver, {"ros__parameters": {}})["ros__parameters"]
        if stream == "wheels":
            value: list[float] = [rounded(sd**2) for sd in sds]
        else:
            value = _diagonal([sds[0]] * 2 + [sds[-1]])
        note = f"({unit})²; sds {', '.join(f'{sd:.3g}' for sd in sds)} {unit}"
        own[field] = Noted(Inline(value), note + "; not fused in the form judged" * (stream == "accel"))
    gates = {name: Noted(rounded(gate), "Mahalanobis distance") for name, gate in found.gates().items()}
    tree["ekf_filter_node"] = {
        "ros__parameters": {
            "process_noise_covariance": Noted(
                Inline([rounded(one) for one in found.settings.process_noise.tolist()]),
                "diagonal, a second: x y z roll pitch yaw vx vy vz vroll vpitch vyaw ax ay az",
            ),
            **gates,
        }
    }
    header = (
        f"robot_localization: covariances of {found.name}, {found.span:.0f} s",
        f"Verdict: {found.verdict}",
        "sds of messages stand for white and lasting errors: this filter has no states for errors that last",
        "process noise: the motion of this recording; another motion needs another recording",
        f"noise of the unit to begin with: {found.unit_from}",
        "gates: one right reading an hour lies beyond; odom0: fixes of navsat_transform, twist0: wheels, imu0: rates",
        "drivers: names of fields of their messages; one without such parameters has to fill its messages so",
    )
    return yaml_text(tree, header=header)


def _diagonal(sds: list[float]) -> list[float]:
    return [rounded(sds[i] ** 2) if i == j else 0.0 for i in range(3) for j in range(3)]
