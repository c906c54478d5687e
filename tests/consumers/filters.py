"""What each filter that reads an export makes of its numbers: noise of a step, fading of the bias, from its source.

A filter is described by what one step of ``dt`` adds to the variance of an angle (or velocity) and of a bias, and by
the factor of the bias over the step: the program's own formula, with repository, file and line of the snapshot that
was read.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from models.units import to_si
from tests.consumers.numbers import from_assignments, from_ini, from_json, from_parameters, from_yaml

STEP = 0.01
"""Sampling interval of the IMU in all examples, s."""


@dataclass(frozen=True)
class Step:
    """One step of a filter: its length, s, variances it adds (unit² s², unit²), and the bias's factor."""

    dt: float
    angle: float
    bias: float
    fades: float = 1.0


@dataclass(frozen=True)
class Filter:
    """A program that predicts: from the text of an export and a sensor to its step; `run` says what it did itself."""

    dialect: str
    keys: str
    use: str
    step: Callable[[str, str], Step]
    has_bias: bool = True
    run: str = ""

    def growth(self, text: str, sensor: str, lags: np.ndarray) -> np.ndarray:
        """Return the variance of the integrated error after each lag, the bias known at first, unit² s²."""
        step = self.step(text, sensor)
        dt, fades = step.dt, step.fades
        # Variance of the angle, its covariance with the bias, variance of the bias, and 1.
        recursion = np.array(
            [
                [1.0, 2.0 * dt, dt**2, step.angle],
                [0.0, fades, fades * dt, 0.0],
                [0.0, 0.0, fades**2, step.bias],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
        return np.array([np.linalg.matrix_power(recursion, round(lag / dt))[0, 3] for lag in lags])


def _densities(values: dict, n: str, k: str) -> Step:
    return Step(STEP, float(values[n]) ** 2 * STEP, float(values[k]) ** 2 * STEP)


def _kalibr(values: dict, sensor: str) -> Step:
    name = {"gyro": "gyroscope", "accel": "accelerometer"}[sensor]
    return _densities(values, f"{name}_noise_density", f"{name}_random_walk")


def _vins(text: str, sensor: str) -> Step:
    v = from_yaml(text)
    letter = {"gyro": "gyr", "accel": "acc"}[sensor]
    # V = ½ dt for each of two samples, dt for the walk; covariance += V noise Vᵀ
    return Step(STEP, 2.0 * (0.5 * STEP * v[f"{letter}_n"]) ** 2, (STEP * v[f"{letter}_w"]) ** 2)


def _liosam(values: dict, sensor: str) -> Step:
    name = {"gyro": "Gyr", "accel": "Acc"}[sensor]
    return _densities(values, f"imu{name}Noise", f"imu{name}BiasN")


def _fastlio(values: dict, white: dict[str, str], walk: dict[str, str], sensor: str) -> Step:
    return Step(STEP, values[white[sensor]] * STEP**2, values[walk[sensor]] * STEP**2)


FASTLIO_WHITE = {"gyro": "gyr_cov", "accel": "acc_cov"}
FASTLIO_WALK = {"gyro": "b_gyr_cov", "accel": "b_acc_cov"}


def _fast_livo2(text: str, sensor: str) -> Step:
    v = from_yaml(text, "imu")
    return Step(STEP, v[FASTLIO_WHITE[sensor]] * STEP**2, 0.0)  # its own bias noise, fixed, is left out


def _point_lio(text: str, sensor: str) -> Step:
    keys = {"gyro": "gyr_cov_input", "accel": "acc_cov_input"}
    return _fastlio(from_yaml(text, "mapping"), keys, FASTLIO_WALK, sensor)


def _fading(density: float, sd: float, time: float) -> Step:
    """Return Φ = 1 − dt/T, Q = 2σ²/T dt."""
    return Step(STEP, density**2 * STEP, 2.0 * sd**2 / time * STEP, 1.0 - STEP / time)


def _first(value: float | list[float]) -> float:
    return value[0] if isinstance(value, list) else value


def _gins(values: dict, sensor: str) -> Step:
    n, level = (
        {
            "gyro": (to_si(_first(values["arw"]), "deg/sqrt(h)"), to_si(_first(values["gbstd"]), "deg/h")),
            "accel": (_first(values["vrw"]) / 60.0, _first(values["abstd"]) * 1e-5),
        }[sensor]
        if sensor in ("gyro", "accel")
        else (0.0, 0.0)
    )
    return _fading(n, level, values["corrtime"] * 3600.0)


def _ginav(text: str, sensor: str) -> Step:
    v = from_ini(text)
    white, walk = {"gyro": ("psd_gyro", "psd_bg"), "accel": ("psd_acce", "psd_ba")}[sensor]
    return Step(1.0 / v["sample_rate"], v[white] / v["sample_rate"], v[walk] / v["sample_rate"])


def _fifteen_state(text: str, sensor: str) -> Step:
    v = from_yaml(text)
    white, walk = {"gyro": ("attitude", "gyro_bias"), "accel": ("velocity", "accel_bias")}[sensor]
    return Step(v["interval"], v["Q_per_step"][white][0], v["Q_per_step"][walk][0])


def _psins(text: str, sensor: str) -> Step:
    v = from_assignments(text)
    micro_g = 1e-6 * 9.7803267715
    if sensor == "gyro":
        n, sd, time = to_si(v["web"][0], "deg/sqrt(h)"), to_si(v["sqrtR0G"][0], "deg/h"), v["TauG"][0]
    else:
        n, sd, time = v["wdb"][0] * micro_g, v["sqrtR0A"][0] * micro_g, v["TauA"][0]
    return Step(STEP, n**2 * STEP, (sd * math.sqrt(2.0 / time)) ** 2 * STEP)  # ins.tauG is infinite


def _navego(text: str, sensor: str) -> Step:
    v = from_assignments(text)
    white, psd, time = {"gyro": ("arw", "gb_psd", "gb_corr"), "accel": ("vrw", "ab_psd", "ab_corr")}[sensor]
    return Step(STEP, v[white][0] ** 2 * STEP, v[psd][0] ** 2 * STEP, math.exp(-STEP / v[time][0]))


def _gtsam(text: str, sensor: str) -> Step:
    v = from_assignments(text)
    white, walk = {
        "gyro": ("setGyroscopeCovariance", "setBiasOmegaCovariance"),
        "accel": ("setAccelerometerCovariance", "setBiasAccCovariance"),
    }[sensor]
    return Step(STEP, v[white][0] / STEP * STEP**2, v[walk][0] * STEP)


def _px4(text: str, sensor: str) -> Step:
    v, dt = from_parameters(text), 0.01  # EKF2_PREDICT_US
    letter = {"gyro": "GYR", "accel": "ACC"}[sensor]
    return Step(dt, (dt * v[f"EKF2_{letter}_NOISE"]) ** 2, (dt * v[f"EKF2_{letter}_B_NOISE"]) ** 2)


def _ardupilot(text: str, sensor: str) -> Step:
    v, dt = from_parameters(text), 0.012  # EKF_TARGET_DT
    white, walk = {
        "gyro": ("EK3_GYRO_P_NSE", "EK3_GBIAS_P_NSE"),
        "accel": ("EK3_ACC_P_NSE", "EK3_ABIAS_P_NSE"),
    }[sensor]
    return Step(dt, (dt * v[white]) ** 2, (dt**2 * v[walk]) ** 2 / dt**2)  # its bias is an angle a step


def _robot_localization(text: str, sensor: str) -> Step:
    key = {"gyro": "angular_velocity_covariance", "accel": "linear_acceleration_covariance"}[sensor]
    return Step(STEP, from_yaml(text, "imu_driver", "ros__parameters")[key][0] * STEP**2, 0.0)


def _pyins(text: str, sensor: str) -> Step:
    v = from_assignments(text.split("accel_model")[0 if sensor == "gyro" else 1])
    return Step(STEP, v["noise"][0] ** 2 * STEP, v["bias_walk"][0] ** 2 * STEP)


def _basalt(text: str, sensor: str) -> Step:
    v = from_json(text, "value0")
    sample = v[f"{sensor}_noise_std"][0] * math.sqrt(v["imu_update_rate"])
    return Step(STEP, sample**2 * STEP**2, v[f"{sensor}_bias_std"][0] ** 2 * STEP)


def _okvis2(text: str, sensor: str) -> Step:
    letter = {"gyro": "g", "accel": "a"}[sensor]
    return _densities(from_yaml(text, "imu_parameters"), f"sigma_{letter}_c", f"sigma_{letter}w_c")


def _mins(text: str, sensor: str) -> Step:
    return _densities(from_yaml(text, "imu"), f"{sensor}_noise", f"{sensor}_bias")


def _isaac(text: str, sensor: str) -> Step:
    v = from_yaml(text, "/**", "ros__parameters")
    rate = v["calibration_frequency"]
    return Step(
        STEP, v[f"{sensor}_noise_density"] ** 2 * rate * STEP**2, v[f"{sensor}_random_walk"] ** 2 / rate
    )


def _orbslam3(text: str, sensor: str) -> Step:
    v, name = from_yaml(text), {"gyro": ("NoiseGyro", "GyroWalk"), "accel": ("NoiseAcc", "AccWalk")}[sensor]
    rate = v["IMU.Frequency"]
    sample, walk = v[f"IMU.{name[0]}"] * math.sqrt(rate), v[f"IMU.{name[1]}"] / math.sqrt(rate)
    return Step(STEP, sample**2 * STEP**2, walk**2)


FILTERS = (
    Filter(
        "kalibr",
        "gyroscope_noise_density gyroscope_random_walk accelerometer_noise_density accelerometer_random_walk",
        "ethz-asl/kalibr kalibr_common/ConfigReader.py:473, 491",
        lambda text, sensor: _kalibr(from_yaml(text), sensor),
    ),
    Filter(
        "openvins",
        "gyroscope_noise_density gyroscope_random_walk accelerometer_noise_density accelerometer_random_walk",
        "rpng/open_vins ov_msckf/src/state/Propagator.cpp:225–228",
        lambda text, sensor: _kalibr(from_yaml(text, "imu0"), sensor),
    ),
    Filter(
        "mins",
        "gyro_noise gyro_bias accel_noise accel_bias",
        "rpng/MINS mins/src/state/Propagator.cpp:234–240",
        _mins,
    ),
    Filter(
        "vins",
        "gyr_n gyr_w acc_n acc_w",
        "HKUST-Aerial-Robotics/VINS-Fusion integration_base.h:117–134",
        _vins,
        run="its integration_base.h compiled: 1.0000",
    ),
    Filter(
        "okvis2",
        "sigma_g_c sigma_gw_c sigma_a_c sigma_aw_c",
        "smartroboticslab/okvis2 okvis_ceres/src/ImuError.cpp:708–727",
        _okvis2,
    ),
    Filter(
        "basalt",
        "gyro_noise_std gyro_bias_std accel_noise_std accel_bias_std",
        "basalt-headers calibration.hpp:151–160; basalt sqrt_keypoint_vio.cpp:115, 161, imu_block.hpp:76",
        _basalt,
    ),
    Filter(
        "isaac-visual-slam",
        "gyro_noise_density gyro_random_walk accel_noise_density accel_random_walk calibration_frequency",
        "nvidia-isaac/cuVSLAM libs/common/imu_calibration.cpp, libs/imu/imu_preintegration.cpp (update_state)",
        _isaac,
    ),
    Filter(
        "kimera-vio",
        "gyroscope_noise_density gyroscope_random_walk accelerometer_noise_density accelerometer_random_walk",
        "MIT-SPARK/Kimera-VIO ImuFrontend.cpp:229–234, VioBackend.cpp:943–948",
        lambda text, sensor: _kalibr(from_yaml(text), sensor),
        run="GTSAM's ImuFactor: test_gtsam.py",
    ),
    Filter(
        "dm-vio",
        "gyroscope_noise_density gyroscope_random_walk accelerometer_noise_density accelerometer_random_walk",
        "lukasvst/dm-vio IMUIntegration.cpp:47–55, IMUUtils.cpp:46–47",
        lambda text, sensor: _kalibr(from_yaml(text), sensor),
        run="GTSAM's ImuFactor: test_gtsam.py",
    ),
    Filter(
        "orbslam3",
        "IMU.NoiseGyro IMU.GyroWalk IMU.NoiseAcc IMU.AccWalk IMU.Frequency",
        "UZ-SLAMLab/ORB_SLAM3 src/Tracking.cc, src/ImuTypes.cc",
        _orbslam3,
    ),
    Filter(
        "orbslam3-old",
        "IMU.NoiseGyro IMU.GyroWalk IMU.NoiseAcc IMU.AccWalk IMU.Frequency",
        "UZ-SLAMLab/ORB_SLAM3 src/Tracking.cc (ParseIMUParamFile)",
        _orbslam3,
    ),
    Filter(
        "liosam",
        "imuGyrNoise imuGyrBiasN imuAccNoise imuAccBiasN",
        "TixiaoShan/LIO-SAM src/imuPreintegration.cpp:215–225, 375",
        lambda text, sensor: _liosam(from_yaml(text, "lio_sam"), sensor),
        run="GTSAM's ImuFactor: test_gtsam.py",
    ),
    Filter(
        "liosam-ros2",
        "imuGyrNoise imuGyrBiasN imuAccNoise imuAccBiasN",
        "TixiaoShan/LIO-SAM (ros2) src/imuPreintegration.cpp:249–259, 409",
        lambda text, sensor: _liosam(from_yaml(text, "/**", "ros__parameters"), sensor),
        run="GTSAM's ImuFactor: test_gtsam.py",
    ),
    Filter(
        "lvi-sam",
        "imuGyrNoise imuGyrBiasN imuAccNoise imuAccBiasN",
        "TixiaoShan/LVI-SAM src/lidar_odometry/imuPreintegration.cpp:89–98, 254",
        lambda text, sensor: _liosam(from_yaml(text, "lvi_sam"), sensor),
        run="GTSAM's ImuFactor: test_gtsam.py",
    ),
    Filter(
        "lvi-sam-camera",
        "gyr_n gyr_w acc_n acc_w",
        "TixiaoShan/LVI-SAM visual_estimator/factor/integration_base.h:59–64",
        _vins,
    ),
    Filter(
        "fastlio",
        "gyr_cov b_gyr_cov acc_cov b_acc_cov",
        "hku-mars/FAST_LIO IMU_Processing.hpp:281, esekfom.hpp:378–381",
        lambda text, sensor: _fastlio(from_yaml(text, "mapping"), FASTLIO_WHITE, FASTLIO_WALK, sensor),
    ),
    Filter(
        "fastlio-ros2",
        "gyr_cov b_gyr_cov acc_cov b_acc_cov",
        "hku-mars/FAST_LIO (ROS2) laserMapping.cpp:820–858",
        lambda text, sensor: _fastlio(
            from_yaml(text, "/**", "ros__parameters", "mapping"), FASTLIO_WHITE, FASTLIO_WALK, sensor
        ),
    ),
    Filter(
        "fast-livo2",
        "gyr_cov acc_cov",
        "hku-mars/FAST-LIVO2 LIVMapper.cpp:81, 150–154, IMU_Processing.cpp:396–399",
        _fast_livo2,
        has_bias=False,
    ),
    Filter(
        "point-lio",
        "gyr_cov_input b_gyr_cov acc_cov_input b_acc_cov imu_meas_omg_cov imu_meas_acc_cov",
        "hku-mars/Point-LIO Estimator.cpp:30–33, 329, esekfom.hpp:180",
        _point_lio,
    ),
    Filter(
        "kf-gins",
        "arw gbstd vrw abstd corrtime",
        "i2Nav-WHU/KF-GINS gi_engine.cpp:47–52, 291–297, 369",
        lambda text, sensor: _gins(from_yaml(text, "imunoise"), sensor),
        run="its gi_engine.cpp compiled: 1.00 to 1.01",
    ),
    Filter(
        "ob-gins",
        "arw gbstd vrw abstd corrtime",
        "i2Nav-WHU/OB_GINS preintegration_normal.cc:215, 229–231, 248–253 (IC-GVINS the same)",
        lambda text, sensor: _gins(from_yaml(text, "imumodel"), sensor),
    ),
    Filter(
        "ginav",
        "psd_gyro psd_bg psd_acce psd_ba",
        "kaichen686/GINav ins_init.m:42–49, ins_time_updata.m:15–17",
        _ginav,
    ),
    Filter(
        "psins",
        "web sqrtR0G TauG wdb sqrtR0A TauA",
        "WangShanpeng/PSINS imuerrset.m, kfinit.m (kfinit186), kfinit0.m:14",
        _psins,
        run="its imuerrset in Octave: 1.00000; test_octave.py",
    ),
    Filter(
        "navego",
        "arw gb_psd gb_corr vrw ab_psd ab_corr",
        "rodralez/NaveGo ins_gnss.m:202, F_update.m:164–171, kf_prediction.m",
        _navego,
        run="its F_update, kf_prediction in Octave: 0.999 to 1.002; test_octave.py",
    ),
    Filter(
        "gtsam",
        "setGyroscopeCovariance setBiasOmegaCovariance setAccelerometerCovariance setBiasAccCovariance",
        "borglab/gtsam gtsam/navigation/CombinedImuFactor.cpp:146–190",
        _gtsam,
        run="GTSAM 4.3.0 and 4.2.2: 0.9991 to 1.0000; test_gtsam.py",
    ),
    Filter(
        "15-state",
        "attitude gyro_bias velocity accel_bias",
        "Groves, Principles of GNSS, Inertial, and Multisensor Systems, 2nd ed., 14.2.6",
        _fifteen_state,
    ),
    Filter(
        "px4",
        "EKF2_GYR_NOISE EKF2_GYR_B_NOISE EKF2_ACC_NOISE EKF2_ACC_B_NOISE",
        "PX4/PX4-Autopilot src/modules/ekf2/EKF/covariance.cpp",
        _px4,
    ),
    Filter(
        "ardupilot",
        "EK3_GYRO_P_NSE EK3_GBIAS_P_NSE EK3_ACC_P_NSE EK3_ABIAS_P_NSE",
        "ArduPilot/ardupilot AP_NavEKF3_core.cpp (CovariancePrediction)",
        _ardupilot,
    ),
    Filter(
        "robot-localization",
        "angular_velocity_covariance linear_acceleration_covariance",
        "cra-ros-pkg/robot_localization src/ros_filter.cpp:605, 2670",
        _robot_localization,
        has_bias=False,
    ),
    Filter(
        "pyins",
        "noise bias_walk",
        "nmayorov/pyins pyins/inertial_sensor.py:94–129",
        _pyins,
        run="its EstimationModel: 1.0000; test_python.py",
    ),
)
"""Every filter a dialect is written for."""
