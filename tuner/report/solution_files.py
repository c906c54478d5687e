"""The navigation solution of a measured drive as files: CSV of all estimates, KML and GPX of the track.

Times in the CSV are on the clock of the drive's file. KML and GPX carry no times: that clock is not known to be UTC.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import numpy as np

from models.arrays import FloatArray
from models.earth import in_degrees, in_tangent_plane
from models.rotation import rpy_from_quat
from tuner.consistency.drive_scores import reference_at
from tuner.consistency.score_drive import DriveResult
from tuner.navigation.data import Fixes, Solution
from tuner.navigation.settings import FilterSettings, total_bias
from tuner.types.records import Reference

COLUMNS = {
    "t [s]": "%.6f",
    "lat [deg]": "%.10f",
    "lon [deg]": "%.10f",
    "height [m]": "%.4f",
    "vn [m/s]": "%.5f",
    "ve [m/s]": "%.5f",
    "vd [m/s]": "%.5f",
    "roll [deg]": "%.6f",
    "pitch [deg]": "%.6f",
    "yaw [deg]": "%.6f",
    "bg_x [rad/s]": "%.5e",
    "bg_y [rad/s]": "%.5e",
    "bg_z [rad/s]": "%.5e",
    "ba_x [m/s^2]": "%.5e",
    "ba_y [m/s^2]": "%.5e",
    "ba_z [m/s^2]": "%.5e",
    "sd_n [m]": "%.4e",
    "sd_e [m]": "%.4e",
    "sd_d [m]": "%.4e",
    "sd_vn [m/s]": "%.4e",
    "sd_ve [m/s]": "%.4e",
    "sd_vd [m/s]": "%.4e",
    "sd_roll [deg]": "%.4e",
    "sd_pitch [deg]": "%.4e",
    "sd_yaw [deg]": "%.4e",
    "sd_bg_x [rad/s]": "%.4e",
    "sd_bg_y [rad/s]": "%.4e",
    "sd_bg_z [rad/s]": "%.4e",
    "sd_ba_x [m/s^2]": "%.4e",
    "sd_ba_y [m/s^2]": "%.4e",
    "sd_ba_z [m/s^2]": "%.4e",
}
"""Columns of the CSV and how their numbers are printed: positions to 0.01 mm, angles to 10⁻⁶ degrees."""

ANGLE = re.compile(r"(?<![a-z])(roll|pitch|yaw)")
"""Names of angles in those of columns."""
TRACK_COLOURS = {"filter": "ffa85f1f", "reference": "ff3d8015", "fixes": "ff0c41c2"}
"""Colours of the lines in KML: alpha, blue, green, red in hexadecimal digits."""

KML_NAMESPACE = "http://www.opengis.net/kml/2.2"
GPX_NAMESPACE = "http://www.topografix.com/GPX/1/1"


def solution_csv(found: DriveResult, origin: float = 0.0, *, mounted: bool = True) -> str:
    """Return one row for every fix, after it was used: time, position, velocity, attitude, biases and all their sds.

    Parameters
    ----------
    found : DriveResult
        Of `tuner.navigate`.
    origin : float
        Time of t = 0 on the clock of the file, s.
    mounted : bool
        Whether the filter ran in the axes of the vehicle; else angles are of the unit and named so (``imu_roll``).
    """
    names = list(COLUMNS) if mounted else [ANGLE.sub(r"imu_\1", name) for name in COLUMNS]
    rows = np.concatenate([_rows(found.settings, solution) for solution in found.solutions])
    rows[:, 0] += origin
    form = ",".join(COLUMNS.values())
    return "\n".join([",".join(names), *(form % tuple(row) for row in rows.tolist())]) + "\n"


def tracks(found: DriveResult, reference: Reference | None = None) -> dict[str, list[FloatArray]]:
    """Return the tracks to draw by name, one array (k, 3) of latitude, longitude, rad, height, m, for each stretch.

    Parameters
    ----------
    found : DriveResult
        Of `tuner.navigate`.
    reference : Reference, optional
        A better solution; its positions are taken at the times of the filter's.
    """
    lines = {
        "filter": [solution.state.llh for solution in found.solutions],
        "fixes": [_known(stretch.fixes) for stretch in found.stretches],
    }
    if reference is None:
        return lines
    theirs = [reference_at(reference, solution.t)[0] for solution in found.solutions]
    return {**lines, "reference": [llh[np.isfinite(llh).all(axis=1)] for llh in theirs]}


def track_kml(lines: dict[str, list[FloatArray]], name: str) -> str:
    """Return the tracks as KML 2.2 (OGC 07-147r2), each name a folder that can be switched off."""
    styles = (
        _element(
            "Style",
            _element(
                "LineStyle",
                _element("color", TRACK_COLOURS[kind]),
                _element("width", "3" if kind == "filter" else "2"),
            ),
            id=kind,
        )
        for kind in lines
    )
    folders = (
        _element("Folder", _element("name", kind), *(_placemark(kind, llh) for llh in parts))
        for kind, parts in lines.items()
    )
    document = _element("Document", _element("name", name), *styles, *folders)
    return _text(_element("kml", document, xmlns=KML_NAMESPACE))


def _placemark(kind: str, llh: FloatArray) -> ET.Element:
    """Return a line of KML through latitudes, longitudes, rad, and heights, m, shape (k, 3)."""
    corners = " ".join(f"{lon:.9f},{lat:.9f},{h:.3f}" for lat, lon, h in in_degrees(llh).tolist())
    return _element(
        "Placemark",
        _element("name", kind),
        _element("styleUrl", f"#{kind}"),
        _element("LineString", _element("tessellate", "1"), _element("coordinates", corners)),
    )


def track_gpx(lines: dict[str, list[FloatArray]], name: str) -> str:
    """Return the tracks as GPX 1.1, each name a track with a segment for each stretch; heights are ellipsoidal."""
    tracks = (
        _element(
            "trk",
            _element("name", f"{name}: {kind}"),
            *(
                _element(
                    "trkseg",
                    *(
                        _element("trkpt", _element("ele", f"{h:.3f}"), lat=f"{lat:.9f}", lon=f"{lon:.9f}")
                        for lat, lon, h in in_degrees(llh).tolist()
                    ),
                )
                for llh in parts
            ),
        )
        for kind, parts in lines.items()
    )
    return _text(_element("gpx", *tracks, xmlns=GPX_NAMESPACE, version="1.1", creator="tuner"))


def local_track(lines: dict[str, list[FloatArray]]) -> dict[str, list[FloatArray]]:
    """Return the tracks as metres east and north in the tangent plane of the filter's first point, shapes (k, 2)."""
    first = lines["filter"][0][0]
    return {
        kind: [in_tangent_plane(llh, first)[0][:, 1::-1] for llh in parts] for kind, parts in lines.items()
    }


def _rows(settings: FilterSettings, solution: Solution) -> FloatArray:
    """Return the numbers of the CSV for one stretch, shape (k, 31)."""
    sd = np.sqrt(np.diagonal(solution.covariance, axis1=1, axis2=2))
    biases = (solution.parameters @ total_bias(settings.model).T)[:, 9:]
    angles = np.degrees(rpy_from_quat(solution.state.quat_nb))
    return np.column_stack(
        [
            solution.t,
            in_degrees(solution.state.llh),
            solution.state.vel_n,
            angles,
            biases,
            sd[:, :6],
            np.degrees(_angle_sds(solution)),
            sd[:, 9:],
        ]
    )


def _angle_sds(solution: Solution) -> FloatArray:
    """Return sds of roll, pitch and yaw, (k, 3), rad, from the covariance of the rotation vector φ in n.

    φ = Rz Ry e_x δroll + Rz e_y δpitch + e_z δyaw with Rz of yaw and Ry of pitch, solved for the angles; at pitch ± 90°
    roll and yaw are undefined.
    """
    _, pitch, yaw = rpy_from_quat(solution.state.quat_nb).T
    c, s = np.cos(yaw), np.sin(yaw)
    zero, one = np.zeros_like(yaw), np.ones_like(yaw)
    slope = np.array(
        [
            [c / np.cos(pitch), s / np.cos(pitch), zero],
            [-s, c, zero],
            [c * np.tan(pitch), s * np.tan(pitch), one],
        ]
    ).transpose(2, 0, 1)
    of_rotation = solution.covariance[:, 6:9, 6:9]
    variances = np.einsum("kij,kjl,kil->ki", slope, of_rotation, slope)
    sds: FloatArray = np.sqrt(variances)
    return sds


def _known(fixes: Fixes) -> FloatArray:
    return fixes.llh[np.isfinite(fixes.llh).all(axis=1)]


def _element(tag: str, *content: ET.Element | str, **attributes: str) -> ET.Element:
    """Return an XML element with its text or the elements in it."""
    element = ET.Element(tag, attributes)
    element.extend(one for one in content if isinstance(one, ET.Element))
    element.text = "".join(one for one in content if isinstance(one, str)) or None
    return element


def _text(root: ET.Element) -> str:
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"
