"""OpenVINS ``kalibr_imu_chain.yaml``: Kalibr's four densities, and the geometry it wants beside them.

Units as Kalibr's. Extrinsics and intrinsics are identities here: a static log does not show them.
"""

from __future__ import annotations

from tuner.exporters import kalibr
from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.formats.yaml_text import Inline, Noted, yaml_text
from tuner.synthesis.projection import CAMERA
from tuner.types import FilterConfig


def _identity(size: int) -> list[Inline]:
    return [Inline([1.0 if i == j else 0.0 for j in range(size)]) for i in range(size)]


def write(config: FilterConfig, target: Target) -> str:
    """Return the YAML of OpenVINS' IMU chain."""
    intrinsics = {name: _identity(3) for name in ("Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC")}
    imu = {
        "T_i_b": _identity(4),
        **kalibr.noise_entries(config, target),
        "rostopic": Noted("/imu0", "set to the topic of the IMU"),
        "time_offset": 0.0,
        "update_rate": Noted(target.rate, "Hz"),
        "model": "kalibr",
        **intrinsics,
        "Tg": [Inline([0.0, 0.0, 0.0])] * 3,
    }
    header = provenance(config, "OpenVINS kalibr_imu_chain.yaml", target)
    return "%YAML:1.0\n" + yaml_text({"imu0": imu}, header=header)


DIALECT = Dialect(
    "openvins", "OpenVINS kalibr_imu_chain.yaml", kalibr.DIALECT.units, write, aiding=CAMERA, shared=True
)
