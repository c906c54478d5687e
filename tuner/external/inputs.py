"""What an external program reads: the configuration in its dialect, the drive, and fixes with scaled sds.

For KF-GINS the drive is written once in its layout, begun where our filter has settled; each run gets its noise and its
sds. Every other program gets its dialect at ``{config}``, and the drive as it is at ``{drive}``, or as ``{imu}`` and
``{gnss}``: CSVs with the columns t, gyro_x … accel_z (rad/s, m/s²), and t, lat, lon (deg), height, sd_n … (m), vn …,
sd_vn … (m/s). Times are those of the drive's file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from models.arrays import FloatArray
from tuner.exporters import text_of
from tuner.exporters.kf_gins import DIALECT, entries
from tuner.exporters.kf_gins_drive import drive_files, write_drive
from tuner.formats.documents import parse_yaml
from tuner.formats.files import write_text
from tuner.formats.yaml_text import yaml_text
from tuner.types import FilterConfig
from tuner.types.records import DataError, Drive

NO_LEVER_ARM = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Fixes:
    """The fixes that a program is given: times of the file, s, latitude, longitude, rad, height, m, sds, m, arm, m."""

    t: FloatArray
    llh: FloatArray
    sd: FloatArray
    lever_arm: FloatArray


@dataclass(frozen=True)
class Inputs:
    """The files of all runs, and what is written anew for each."""

    drive: Drive
    dialect: str
    fixes: Fixes
    tree: Mapping[str, Any] | None
    notes: tuple[str, ...]

    def write(self, config: FilterConfig, fix_factor: float, folder: Path) -> dict[str, Path]:
        """Write the input of one run; return the paths of the placeholders but ``{drive}``."""
        if self.tree is not None:
            return self._kf_gins(self.tree, config, fix_factor, folder)
        paths = {
            name: folder / f"{name}.{end}"
            for name, end in (("config", "txt"), ("imu", "csv"), ("gnss", "csv"))
        }
        write_text(paths["config"], text_of(config, self.dialect, _interval(self.drive)))
        drive, fixes = self.drive, self.fixes
        motion = np.column_stack([drive.imu_t + drive.origin, drive.rates])
        _csv(paths["imu"], "t,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z", motion)
        head = "t,lat [deg],lon [deg],height,sd_n,sd_e,sd_d,vn,ve,vd,sd_vn,sd_ve,sd_vd"
        places = np.column_stack([np.degrees(fixes.llh[:, :2]), fixes.llh[:, 2]])
        speeds = (drive.gnss.vel_n, fix_factor * drive.gnss.velocity_sd)
        _csv(paths["gnss"], head, np.column_stack([fixes.t, places, fix_factor * fixes.sd, *speeds]))
        return paths

    def _kf_gins(
        self, tree: Mapping[str, Any], config: FilterConfig, fix_factor: float, folder: Path
    ) -> dict[str, Path]:
        fixes = self.fixes
        gnss = folder / "gnss.txt"
        places = np.column_stack([np.degrees(fixes.llh[:, :2]), fixes.llh[:, 2]])
        np.savetxt(
            gnss,
            np.column_stack([fixes.t, places, fix_factor * fixes.sd]),
            fmt=["%.9f", *["%.12f"] * 2, *["%.6f"] * 4],
        )
        noise = entries(config, DIALECT.target(config, _interval(self.drive)))["imunoise"]
        settings = {**tree, "gnsspath": str(gnss), "outputpath": str(folder), "imunoise": noise}
        path = folder / "kf-gins.yaml"
        write_text(path, yaml_text(settings))
        return {"config": path, "imu": Path(tree["imupath"]), "gnss": gnss}


def inputs_of(drive: Drive, config: FilterConfig, dialect: str, folder: Path) -> Inputs:
    """Return what a program is given in every run; the files common to all are written into a folder.

    Raises
    ------
    DataError
        Fixes without sds, for which the configuration has none, or a drive that cannot be aligned.
    """
    if dialect == "kf-gins":
        path = folder / "drive.yaml"
        files = drive_files(drive, config)
        write_drive(files, path)
        tree = parse_yaml(path.read_text(encoding="utf-8"), source=str(path), expected="settings of KF-GINS")
        rows = np.loadtxt(tree["gnsspath"], ndmin=2)
        llh = np.column_stack([np.radians(rows[:, 1:3]), rows[:, 3]])
        fixes = Fixes(rows[:, 0], llh, rows[:, 4:7], np.array(tree["antlever"], dtype=float))
        return Inputs(drive, dialect, fixes, tree, files.notes)
    gnss = drive.gnss
    stated = np.isfinite(gnss.position_sd) & (gnss.position_sd > 0.0)
    if not stated.all() and config.gnss is None:
        raise DataError(
            f"{drive.name}: expected sds of the fixes, or a receiver in the configuration, found neither: --gnss"
        )
    assumed = np.array(config.gnss.position_sd if config.gnss is not None else (np.nan,) * 3)
    sd = np.where(stated, gnss.position_sd, assumed)
    arm = np.array(drive.lever_arm if drive.lever_arm is not None else NO_LEVER_ARM)
    return Inputs(drive, dialect, Fixes(gnss.t + drive.origin, gnss.llh, sd, arm), None, ())


def _interval(drive: Drive) -> float:
    return float(np.median(np.diff(drive.imu_t)))


def _csv(path: Path, head: str, rows: FloatArray) -> None:
    np.savetxt(path, rows, delimiter=",", header=head, comments="", fmt="%.12g")
