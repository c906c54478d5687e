"""Every dialect in its own units and time step, against figures computed by hand from its formulas.

N = 2e-4 rad/s/√Hz and 3e-3 m/s²/√Hz, one Gauss–Markov state each, 100 Hz. With the memory much shorter than
T the equivalent random walk is K = σ √(2/T), and with T the same the equivalent σ is σ.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from models.noise import GaussMarkov
from tests.tuner.exporters.made_by_hand import (
    B_ACCEL,
    B_GYRO,
    CONFIG,
    DT,
    K_ACCEL,
    K_GYRO,
    N_ACCEL,
    N_GYRO,
    S_ACCEL,
    S_GYRO,
    STEP,
    TIME,
    entries,
    near,
    python_values,
    written,
)
from tuner.exporters import export
from tuner.exporters.dialect import Target
from tuner.exporters.fifteen_state import diagonals
from tuner.synthesis.load_config import load_config
from tuner.synthesis.projection import STILL_TIME
from tuner.types import BoundUsed, Compensation, FilterConfig, GnssNoise, Quantity
from tuner.types.borrowed import with_borrowed


@pytest.mark.parametrize("dialect", ["kalibr", "openvins"])
def test_kalibr_and_openvins_take_continuous_densities(dialect: str) -> None:
    found = entries(dialect)
    found = found["imu0"] if dialect == "openvins" else found
    assert found["gyroscope_noise_density"] == near(2e-4)
    assert found["gyroscope_random_walk"] == near(K_GYRO)
    assert found["accelerometer_noise_density"] == near(3e-3)
    assert found["accelerometer_random_walk"] == near(K_ACCEL)
    assert found["update_rate"] == near(100.0)
    assert isinstance(found["rostopic"], str)


def test_openvins_has_its_geometry() -> None:
    imu = entries("openvins")["imu0"]
    assert np.array_equal(imu["T_i_b"], np.eye(4))
    assert all(np.array_equal(imu[key], np.eye(3)) for key in ("Tw", "Ta", "R_IMUtoGYRO", "R_IMUtoACC"))
    assert np.array_equal(imu["Tg"], np.zeros((3, 3)))
    assert written("openvins").startswith("%YAML:1.0\n")


def test_vins_restores_the_true_growth() -> None:
    found = entries("vins")
    assert 0.5 * DT**2 * found["gyr_n"] ** 2 == near(N_GYRO**2 * DT)
    assert 0.5 * DT**2 * found["acc_n"] ** 2 == near(N_ACCEL**2 * DT)
    assert DT**2 * found["gyr_w"] ** 2 == near(K_GYRO**2 * DT)
    assert DT**2 * found["acc_w"] ** 2 == near(K_ACCEL**2 * DT)
    assert found["gyr_n"] == near(2e-4 * 14.142135623730951)


def test_orbslam3_takes_continuous_densities_as_real_numbers() -> None:
    found = entries("orbslam3")
    assert found["IMU.NoiseGyro"] == near(2e-4)
    assert found["IMU.NoiseAcc"] == near(3e-3)
    assert found["IMU.GyroWalk"] == near(K_GYRO)
    assert found["IMU.AccWalk"] == near(K_ACCEL)
    assert all(isinstance(value, float) for key, value in found.items() if key.startswith("IMU."))
    assert found["File.version"] == "1.0"


def test_orbslam3_without_version_takes_an_integer_frequency() -> None:
    found = entries("orbslam3-old")
    assert found["IMU.Frequency"] == 100
    assert isinstance(found["IMU.Frequency"], int)
    assert "File.version" not in found
    assert found["IMU.NoiseGyro"] == near(2e-4)


@pytest.mark.parametrize("dialect", ["liosam", "liosam-ros2"])
def test_liosam_takes_continuous_densities(dialect: str) -> None:
    found = entries(dialect)
    found = found["lio_sam"] if dialect == "liosam" else found["/**"]["ros__parameters"]
    assert found["imuGyrNoise"] == near(2e-4)
    assert found["imuAccNoise"] == near(3e-3)
    assert found["imuGyrBiasN"] == near(K_GYRO)
    assert found["imuAccBiasN"] == near(K_ACCEL)


@pytest.mark.parametrize("dialect", ["fastlio", "fastlio-ros2"])
def test_fastlio_takes_variances_of_a_step(dialect: str) -> None:
    found = entries(dialect)
    found = (found if dialect == "fastlio" else found["/**"]["ros__parameters"])["mapping"]
    assert found["gyr_cov"] == near(4e-6)
    assert found["acc_cov"] == near(9e-4)
    assert DT**2 * found["b_gyr_cov"] == near(K_GYRO**2 * DT)
    assert DT**2 * found["b_acc_cov"] == near(K_ACCEL**2 * DT)


LASTING = 24.0 * 3600.0
"""T of `corrtime`, s: src/kf-gins/gi_engine.cpp drives each state by 2σ²/T."""


def test_kf_gins_takes_customary_units_and_a_time_that_outlasts_drives() -> None:
    found = entries("kf-gins")
    noise = found["imunoise"]
    assert noise["arw"] == near([N_GYRO * 180.0 / math.pi * 60.0] * 3)
    assert noise["vrw"] == near([60.0 * N_ACCEL] * 3)
    root = math.sqrt(0.5 * LASTING)
    assert noise["gbstd"] == near([root * K_GYRO * 180.0 / math.pi * 3600.0] * 3)
    assert noise["abstd"] == near([root * K_ACCEL * 1e5] * 3)
    assert noise["corrtime"] == LASTING / 3600.0
    # One state is the whole bias, constant and Gauss–Markov together (src/kf-gins/gi_engine.cpp, initialize).
    assert found["initbgstd"] == near([math.hypot(1e-3, 5e-5) * 180.0 / math.pi * 3600.0] * 3)
    assert found["initbastd"] == near([math.hypot(0.05, 4e-4) * 1e5] * 3)
    assert "aided by RTK positions at 1 Hz, 2 cm (assumed)" in export(CONFIG, "kf-gins")
    assert "gyroscopes: true ÷ predicted error: position 1.00" in export(CONFIG, "kf-gins")


def test_kf_gins_gets_the_scale_factors_of_the_grade_or_of_the_nearest() -> None:
    # As noise of a fading state, 3 % of an MPU-9250 wandered by 50 m within a minute; a constant is known by its start.
    own = load_config("stim300")
    text = export(own, "kf-gins")
    found = yaml.safe_load(text)
    assert found["initsgstd"] == [500.0] * 3  # configs/sensors/stim300.yaml
    assert found["initsastd"] == [300.0] * 3
    assert found["imunoise"]["gsstd"] == found["imunoise"]["asstd"] == [0.0] * 3
    assert "of the sheet stim300" in text
    measured = replace(own, provenance={})
    assert yaml.safe_load(export(measured, "kf-gins"))["initsgstd"] == [500.0] * 3
    assert "assumed: of stim300" in export(measured, "kf-gins")
    # Of a drive whose biases are lent it said "of the sheet" of the drive, which there is not.
    axes = [axis for axis in own.channels if axis.startswith("gyro")]
    source = with_borrowed({**own.provenance["source"], "name": "a drive"}, axes, "stim300")
    lent = replace(own, provenance={**own.provenance, "source": source})
    text = export(lent, "kf-gins")
    assert "assumed: of stim300" in text
    assert "of the sheet a drive" in text  # of the accelerometers, which are its own


def test_a_sheet_is_stated_and_its_scale_factor_kept(tmp_path: Path) -> None:
    """A sheet with 0.5 % had that of a built-in sensor, and its numbers were "identified"."""
    sheet = Path(__file__).parents[3] / "configs/examples/datasheet.yaml"
    text = sheet.read_text(encoding="utf-8").replace(
        "gyro:\n", 'gyro:\n  scale_factor_sd: {value: 0.5, unit: "%"}\n', 1
    )
    (tmp_path / "sheet.yaml").write_text(text, encoding="utf-8")
    written = export(load_config(tmp_path / "sheet.yaml"), "kf-gins")
    assert yaml.safe_load(written)["initsgstd"] == [5000.0] * 3
    assert "identified" not in written
    assert "stated: white" in written


def test_kf_gins_gets_the_sds_of_the_start() -> None:
    found = entries("kf-gins", replace(CONFIG, constants={"accel_scale": 1e-3}))
    assert found["initposstd"] == [1.0] * 3
    assert found["initvelstd"] == [0.1] * 3
    assert found["initattstd"] == near([math.degrees(0.005)] * 2 + [math.degrees(0.1)])
    assert found["initsastd"] == near([1000.0] * 3)


def test_navego_gives_its_filter_the_driving_density() -> None:
    found = python_values(written("navego"))
    assert found["arw"] == near([N_GYRO] * 3)
    assert found["vrw"] == near([N_ACCEL] * 3)
    assert found["gb_psd"] == near([K_GYRO] * 3)
    assert found["ab_psd"] == near([K_ACCEL] * 3)
    assert found["g_std"] == near([10.0 * N_GYRO] * 3)
    assert found["gb_corr"] == near([LASTING] * 3)
    # ins_gnss.m subtracts gb_sta from every sample, starts from gb_dyn, and squares it into P0.
    assert found["ab_sta"] == found["gb_sta"] == [0.0] * 3
    assert found["gb_dyn"] == near([math.hypot(B_GYRO, S_GYRO)] * 3)
    # simulation/gyro_gen.m adds the walk to the state: one of them is the bias.
    assert found["arrw"] == found["vrrw"] == [0.0] * 3


def test_gtsam_takes_densities_squared() -> None:
    text = written("gtsam")
    compile(text, "params.py", "exec")
    found = python_values(text)
    assert found["setGyroscopeCovariance"] == near([4e-8] * 3)
    assert found["setAccelerometerCovariance"] == near([9e-6] * 3)
    assert found["setBiasOmegaCovariance"] == near([K_GYRO**2] * 3)
    assert found["setBiasAccCovariance"] == near([K_ACCEL**2] * 3)
    assert found["Sigmas"] == near([math.hypot(B_ACCEL, S_ACCEL)] * 3 + [math.hypot(B_GYRO, S_GYRO)] * 3)
    # Up to 4.2 the "initial" covariance is noise of every step, and 4.3 has none.
    assert 'if hasattr(p, "setBiasAccOmegaInit")' in text
    assert "setBiasAccOmegaInit(np.zeros((6, 6)))" in text
    assert "setIntegrationCovariance(1e-12 * np.eye(3))" in text


IN_MOTION = {axis: channel.white_density for axis, channel in CONFIG.channels.items()}
MOVED = replace(CONFIG, noise=IN_MOTION, noise_in_motion=IN_MOTION)


def parameters(dialect: str, config: FilterConfig = MOVED) -> dict[str, float]:
    lines = [line for line in written(dialect, config).splitlines() if not line.startswith("#")]
    split = [line.split("\t")[2:4] if dialect == "px4" else line.split(",") for line in lines]
    return {name: float(value) for name, value in split}


def test_px4_takes_noise_of_its_prediction_step() -> None:
    found = parameters("px4")
    assert found["EKF2_GYR_NOISE"] == near(2e-4 / math.sqrt(STEP))
    assert found["EKF2_ACC_NOISE"] == near(3e-3 / math.sqrt(STEP))
    assert STEP**2 * found["EKF2_GYR_B_NOISE"] ** 2 == pytest.approx(K_GYRO**2 * STEP, rel=2e-5)
    assert found["EKF2_ACC_B_NOISE"] == near(K_ACCEL / math.sqrt(STEP))
    assert not {"EKF2_GBIAS_INIT", "EKF2_ABIAS_INIT"} & found.keys()  # one switch-on shows no spread


@pytest.mark.parametrize("dialect", ["px4", "ardupilot"])
def test_a_bench_log_lowers_no_parameter_of_an_autopilot(dialect: str) -> None:
    # Seen on a PX4 log at rest: EKF2_GYR_NOISE 21 times below stock, in a file that loads.
    assert parameters(dialect, CONFIG) == {}
    text = written(dialect, CONFIG)
    assert text.count("keep stock") == {"px4": 6, "ardupilot": 4}[dialect]
    assert all(line.startswith("#") for line in text.splitlines())


def test_noise_above_stock_is_loaded_from_a_bench_log_but_no_limit_and_nothing_borrowed() -> None:
    name = "EKF2_GYR_NOISE"
    loud = replace(
        CONFIG, channels={axis: replace(c, white_density=0.01) for axis, c in CONFIG.channels.items()}
    )
    assert parameters("px4", loud)[name] == near(0.01 / math.sqrt(STEP))
    limits = tuple(BoundUsed(Quantity(axis, "white.density"), 0.5, "short") for axis in loud.channels)
    assert name not in parameters("px4", replace(loud, inflations=limits))
    lent = replace(loud, provenance={"source": {"borrowed": dict.fromkeys(loud.channels, "mpu9250")}})
    assert parameters("px4", lent) == {}
    assert "keep stock 0.015: assumed from mpu9250, not measured on this unit" in written("px4", lent)


def test_ardupilot_takes_noise_of_its_step() -> None:
    found = parameters("ardupilot")
    assert found["EK3_GYRO_P_NSE"] == near(2e-4 / math.sqrt(STEP))
    assert found["EK3_ACC_P_NSE"] == near(3e-3 / math.sqrt(STEP))
    assert (STEP**2 * found["EK3_GBIAS_P_NSE"]) ** 2 == pytest.approx(STEP**2 * K_GYRO**2 * STEP, rel=2e-5)
    assert found["EK3_ABIAS_P_NSE"] == near(K_ACCEL / math.sqrt(STEP))


def test_each_autopilot_has_a_step_of_its_own() -> None:
    # AP_NavEKF3_Measurements.cpp: samples are taken together until 12 ms less half a sample.
    white = replace(
        MOVED,
        channels={
            axis: replace(c, markov=(), random_walk_density=1e-9) for axis, c in CONFIG.channels.items()
        },
        inflations=(),
    )
    for rate, step in ((400.0, 0.0125), (300.0, 4.0 / 300.0), (100.0, 0.01), (50.0, 0.02)):
        found = export(white, "ardupilot", interval=1.0 / rate)
        assert f"EK3_GYRO_P_NSE,{2e-4 / math.sqrt(step):.6g}"[:20] in found
    assert f"{2e-4 / math.sqrt(0.012):.6g}" in export(white, "ardupilot")
    assert f"{2e-4 / math.sqrt(0.01):.6g}" in export(white, "px4")


@pytest.mark.parametrize(("dialect", "name"), [("px4", "EKF2_GYR_NOISE"), ("ardupilot", "EK3_GYRO_P_NSE")])
def test_numbers_outside_the_advised_range_are_true_with_a_warning(dialect: str, name: str) -> None:
    quiet = {
        axis: replace(c, white_density=1e-6, markov=(), random_walk_density=1e-12)
        for axis, c in CONFIG.channels.items()
    }
    config = replace(MOVED, channels=quiet, inflations=())
    assert parameters(dialect, config)[name] == near(1e-6 / math.sqrt(STEP))
    assert f"{name}: rad/s; N/√dt; for all axes; stock 0.015; WARNING outside" in written(dialect, config)
    assert "WARNING" not in written(dialect)


def test_robot_localization_puts_noise_into_the_messages() -> None:
    found = entries("robot-localization")
    assert all(set(node) == {"ros__parameters"} for node in found.values())
    message = found["imu_driver"]["ros__parameters"]
    assert np.reshape(message["angular_velocity_covariance"], (3, 3)) == near(np.eye(3) * 4e-6)
    assert np.reshape(message["linear_acceleration_covariance"], (3, 3)) == near(np.eye(3) * 9e-4)
    start = found["ekf_filter_node"]["ros__parameters"]["initial_estimate_covariance"]
    expected = [1.0] * 3 + [2.5e-5] * 2 + [0.01] + [0.01] * 3 + [1.0] * 6  # rates and accelerations
    assert start == near(expected)


def test_gnss_ins_sim_takes_customary_units_and_a_finite_time() -> None:
    text = written("gnss-ins-sim")
    compile(text, "imu.py", "exec")
    found = python_values(text)
    assert found["gyro_arw"] == near([2e-4 * 180.0 / math.pi * 60.0] * 3)
    assert found["gyro_b_stability"] == pytest.approx([5e-5 * 180.0 / math.pi * 3600.0] * 3, rel=2e-3)
    assert found["accel_vrw"] == near([0.18] * 3)
    assert found["accel_b_stability"] == pytest.approx([4e-4] * 3, rel=2e-3)
    assert found["gyro_b_corr"] == pytest.approx([TIME] * 3, rel=2e-3)


def test_matlab_random_walk_is_the_walk_of_the_bias() -> None:
    # A state of 1800 s is, up to 300 s, a walk of its driving density: σ√(2/T).
    gyro, accel = written("matlab").split("imu.Accelerometer")
    for text, white, sd in ((gyro, 2e-4, S_GYRO), (accel, 3e-3, S_ACCEL)):
        found = python_values(text)
        assert found["NoiseDensity"] == near([white] * 3)
        assert found["RandomWalk"] == pytest.approx([sd * math.sqrt(2.0 / TIME)] * 3, rel=0.1)
        assert "'NoiseType', 'single-sided'" in text


def test_matlab_gets_flicker_as_flicker() -> None:
    config = load_config("icm20602")
    found = python_values(export(config, "matlab").split("imu.Accelerometer")[0])
    level = config.channels["gyro_x"].identified[-1]
    assert level.name == "bias_instability"
    assert found["BiasInstability"] == near([level.coefficients["level"].value] * 3)
    assert found["RandomWalk"] == [0.0] * 3


def test_gazebo_takes_sample_noise_and_driving_density() -> None:
    root = ET.fromstring(written("gazebo"))
    noise = root.find("angular_velocity/z/noise")
    values = {child.tag: float(child.text) for child in noise}
    assert values["stddev"] == near(2e-3)
    assert values["dynamic_bias_stddev"] == pytest.approx(S_GYRO * math.sqrt(2.0 / TIME), rel=2e-3)
    assert values["dynamic_bias_correlation_time"] == pytest.approx(TIME, rel=2e-3)
    # src/GaussianNoiseModel.cc: the drawn bias is the state's first value and fades with it; a turn-on would too.
    assert values["bias_stddev"] == pytest.approx(S_GYRO, rel=2e-3)
    assert "gyro_z 0.001 rad/s" in written("gazebo")
    assert float(root.find("linear_acceleration/x/noise/stddev").text) == near(0.03)


def test_gazebo_starts_a_walk_from_the_turn_on() -> None:
    walking = {
        axis: replace(channel, markov=(), random_walk_density=1e-4)
        for axis, channel in CONFIG.channels.items()
    }
    noise = ET.fromstring(written("gazebo", replace(CONFIG, channels=walking))).find(
        "angular_velocity/x/noise"
    )
    values = {child.tag: float(child.text) for child in noise}
    assert values["bias_stddev"] == near(B_GYRO)
    assert values["dynamic_bias_stddev"] == pytest.approx(1e-4, rel=1e-3)


def test_pyins_takes_continuous_densities() -> None:
    text = written("pyins")
    compile(text, "models.py", "exec")
    gyro, accel = text.split("accel_model")
    assert python_values(gyro)["noise"] == near([2e-4] * 3)
    assert python_values(gyro)["bias_walk"] == near([K_GYRO] * 3)
    assert python_values(accel)["bias_sd"] == near([math.hypot(B_ACCEL, S_ACCEL)] * 3)


def test_pyins_gets_no_walk_of_a_bias_without_sd() -> None:
    # pyins/inertial_sensor.py refuses "bias_walk" where "bias_sd" is 0.
    known = {
        axis: replace(channel, constant_sd=0.0, markov=(), random_walk_density=1e-6)
        for axis, channel in CONFIG.channels.items()
    }
    gyro = written("pyins", replace(CONFIG, channels=known)).split("accel_model")[0]
    assert python_values(gyro)["bias_sd"] == near([1e-6 * math.sqrt(STILL_TIME)] * 3)


def test_the_table_of_15_states_is_the_settings_squared() -> None:
    # Q of a step is that of a second × dt; R holds what lasts; φ and the noise of a step keep σ (Groves 14.2.6).
    receiver = GnssNoise(
        (1.0, 1.0, 2.0), (0.1, 0.1, 0.2), 1.0, 5.0, (GaussMarkov(2.0, 60.0),), correlated_down=1.5
    )
    config = replace(CONFIG, gnss=receiver)
    found = yaml.safe_load(written("15-state", config))
    for name, rows in found["Q_per_second"].items():
        assert found["Q_per_step"][name] == pytest.approx(np.array(rows) * DT, rel=1e-5)
    assert found["R"]["position"] == pytest.approx([5.0, 5.0, 13.0])
    assert found["R"]["velocity"] == pytest.approx([0.01, 0.01, 0.04])
    for axis, one in found["gauss_markov"].items():
        assert one["N"] == pytest.approx(config.channels[axis].white_density)
        for state in one["states"]:
            assert state["step_sd"] ** 2 == pytest.approx(
                state["sd"] ** 2 * (1.0 - state["phi"] ** 2), rel=1e-3
            )
    arrays = diagonals(config, Target(DT))
    assert arrays["P0"][9:12] == pytest.approx(found["P0"]["gyro_bias"], rel=1e-5)
    assert len(diagonals(replace(config, gnss=None), Target(DT))["R"]) == 0
    assert "R" not in yaml.safe_load(written("15-state", replace(config, gnss=None)))


@pytest.mark.parametrize("dialect", ["gtsam", "kalibr", "navego"])
def test_what_is_taken_out_of_the_data_is_said_where_no_setting_holds_it(dialect: str) -> None:
    """A user of GTSAM had the noise of a drive, and nothing of the 0.2 s by which its fixes were late."""
    taken = replace(CONFIG, compensation=Compensation.parse({"time_offset.delay": 0.2}))
    assert "take it out of the data before the filter (SI): time_offset.delay 0.200" in export(taken, dialect)
    assert "take it out" not in export(CONFIG, dialect)
