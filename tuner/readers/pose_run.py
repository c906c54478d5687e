"""Runs with poses in place of fixes: bags, folders of EuRoC and TUM-VI, an IMU log beside a trajectory.

=============  ================================================================================================
bag            ROS 1, ROS 2 or MCAP without fixes: an IMU, and one topic of poses or odometry; of several,
               ``run.bag:/topic``
EuRoC, TUM-VI  folder with ``imu0/data.csv``, or with ``mav0``, and one of `EUROC_POSES` beside it
folder         ``imu.csv`` as any log, and ``poses.csv``, ``poses.txt`` or ``poses.tum`` in a form of `read_estimate`
=============  ================================================================================================
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tuner.readers import read
from tuner.readers.estimate import read_estimate
from tuner.readers.estimate_bag import POSE_KINDS, is_bag
from tuner.readers.log_format import file_of
from tuner.readers.messages.rosbag import FIX, opened_bag
from tuner.types.filter_output import FilterOutput
from tuner.types.records import DataError, Record

EUROC_POSES = ("vicon0", "mocap0", "state_groundtruth_estimate0")
"""Folders of poses, the best first: the last of them is computed with the samples of the IMU."""
ANY_FRAME = "NED"
"""Axes of the world as they are taken where a file does not state them: any right-handed ones do."""
SAMPLE_FILES = ("imu.csv", "data.csv")
"""Names of the samples of a run: any other file beside a trajectory is what it says itself, such as a drive."""
POSE_FILES = ("poses.csv", "poses.txt", "poses.tum")
"""Names of a trajectory beside ``imu.csv``."""


@dataclass(frozen=True)
class PoseRun:
    """Samples of a unit in motion and poses of another sensor, each on the clock of its stamps, s."""

    name: str
    records: tuple[Record, ...]
    poses: FilterOutput


def read_pose_run(source: str | Path) -> PoseRun | None:
    """Read a run with poses; None where a source is none.

    Raises
    ------
    DataError
        Where there are poses that cannot be used: one line.
    """
    path, _, topic = str(source).partition(":/")
    named = bool(topic) and not Path(source).exists()
    whole = Path(path) if named else Path(source)
    if not whole.exists():
        return None
    if is_bag(whole):
        topics = _topics(whole)
        if not named and (FIX in topics.values() or not topics):
            return None
        if not named and len(topics) > 1:
            raise DataError(
                f"{whole}: expected one topic of poses, found {', '.join(topics)}: name it behind the bag, as {whole}:"
                f"{next(iter(topics))}"
            )
        poses = read_estimate(whole, topic=f"/{topic}" if named else None, frame=ANY_FRAME)
        return PoseRun(whole.stem, read(whole, stamps=True), poses)
    samples = whole / "imu.csv" if (whole / "imu.csv").is_file() else file_of(whole)
    beside = [samples.parent / name for name in POSE_FILES]
    beside += [samples.parent.parent / name / "data.csv" for name in EUROC_POSES]
    found = next((file for file in beside if file.is_file()), None)
    own = samples.name in SAMPLE_FILES and samples.is_file()
    if found is None or not own or (whole / "gnss.csv").is_file():
        return None
    return PoseRun(whole.resolve().stem, read(samples, stamps=True), read_estimate(found, frame=ANY_FRAME))


def _topics(path: Path) -> dict[str, str]:
    """Return the topics of poses and of fixes in a bag, and their kinds."""
    with opened_bag(path) as bag:
        kinds = {connection.topic: connection.msgtype for connection in bag.connections}
    return {topic: kind for topic, kind in kinds.items() if kind in (*POSE_KINDS, FIX)}
