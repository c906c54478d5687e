"""Isaac ROS Visual SLAM: parameters of its node; continuous densities, which cuVSLAM turns into those of a sample.

gyro_noise_density rad/s/√Hz, gyro_random_walk rad/s²/√Hz, accel_noise_density m/s²/√Hz, accel_random_walk m/s³/√Hz,
calibration_frequency Hz. The library adds N²·f·dt² and K²/f a sample, f being the frequency stated: it has to be that
of the IMU. Its bundle adjustment multiplies the information of the IMU by penalties that it sets.

Source: NVIDIA-ISAAC-ROS/isaac_ros_visual_slam src/visual_slam_node.cpp, src/impl/visual_slam_impl.cpp;
nvidia-isaac/cuVSLAM libs/common/imu_calibration.cpp (constructor), libs/imu/imu_preintegration.cpp (update_state),
libs/imu/imu_sba_fixed_vel.cpp (EvaluateCost).
"""

from __future__ import annotations

from typing import Any

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import triad, walk, white
from tuner.formats.yaml_text import Noted, yaml_text
from tuner.synthesis.projection import CAMERA
from tuner.types import FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return the parameters of the node."""
    gyro, accel = triad(config, "gyro"), triad(config, "accel")
    entries: dict[str, Any] = {
        "gyro_noise_density": white(gyro, "rad/s/√Hz, N", target).noted(),
        "gyro_random_walk": walk(config, gyro, "rad/s²/√Hz, K", target).noted(),
        "accel_noise_density": white(accel, "m/s²/√Hz, N", target).noted(),
        "accel_random_walk": walk(config, accel, "m/s³/√Hz, K", target).noted(),
        "calibration_frequency": Noted(target.rate, "Hz; has to be that of the IMU: K²/f is added a sample"),
    }
    header = (
        *provenance(config, "Isaac ROS Visual SLAM: IMU parameters of the node", target),
        "cuVSLAM multiplies the information of the IMU by penalties of its own, which are not here",
    )
    return yaml_text({"/**": {"ros__parameters": entries}}, header=header)


DIALECT = Dialect(
    "isaac-visual-slam",
    "Isaac ROS Visual SLAM parameters of ROS 2",
    "rad/s/√Hz, rad/s²/√Hz, m/s²/√Hz, m/s³/√Hz, Hz (continuous)",
    write,
    aiding=CAMERA,
    shared=True,
)
