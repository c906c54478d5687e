#!/usr/bin/env python3
"""Recordings at rest as public reports describe them, simulated: `python make.py FOLDER [NAME ...]` writes them.

Own numbers, seeds and code; of a report only the facts are taken, its address stands behind them. `CASES` holds for
each name its function and the truth: white noise of gyroscopes and accelerometers in SI (one-sample sd = N √rate), or
None where no number can be right.
"""

import json
import sys
from pathlib import Path

import numpy as np
from scipy.io import savemat
from scipy.signal import lfilter

NG, NA = 1.2e-4, 1.5e-3  # rad/s/√Hz, m/s²/√Hz: 0.4125 deg/√h, 153 µg/√Hz
G, DEG = 9.80665, 180 / np.pi
CASES = {}


def case(gyro=NG, accel=NA, gyro_axes="xyz", accel_axes="xyz"):
    """Enter a function in `CASES` with the white noise that is to be found, and the axes that have one."""

    def enter(write):
        CASES[write.__name__] = (write, {"gyro": (gyro, gyro_axes), "accel": (accel, accel_axes)})
        return write

    return enter


def rest(seed, fs, n, ng=NG, na=NA, bg=(0.004, -0.003, 0.006), ba=(0.12, -0.21, 9.79), kg=2e-6, ka=3e-5):
    """Return n samples of gyroscopes (rad/s) and accelerometers (m/s²): bias, white noise, random walk."""
    r = np.random.default_rng(seed)
    white, step = r.standard_normal((2, n, 6))
    walk = np.cumsum(step * np.repeat([kg, ka], 3) / np.sqrt(fs), axis=0)
    x = np.array(bg + ba) + white * np.repeat([ng, na], 3) * np.sqrt(fs) + walk
    return x[:, :3], x[:, 3:], r


def to_step(x, step):
    return np.round(x / step) * step


def table(path, head, *columns, fmt="%.7g", sep=","):
    """Write columns under a head of any lines; `fmt` is one format, or a list with the last one repeated."""
    whole = any(
        np.asarray(c).dtype.kind == "i" for c in columns
    )  # stamps in ns have more digits than a float
    x = np.column_stack([np.asarray(c, dtype=object) if whole else c for c in columns])
    fmt = [fmt] if isinstance(fmt, str) else fmt
    fmt = fmt + [fmt[-1]] * (x.shape[1] - len(fmt))
    np.savetxt(path, x, fmt=fmt, delimiter=sep, header=head, comments="", encoding="utf-8")


def topic_csv(path, seq, ns, gyro, accel):
    """Write a sensor_msgs/Imu as `rostopic echo -p` does (without covariances, which are constant)."""
    head = "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.orientation.w,"
    head += ",".join(
        f"field.{kind}.{a}" for kind in ("angular_velocity", "linear_acceleration") for a in "xyz"
    )
    with Path(path).open("w", encoding="utf-8") as f:
        f.write(head + "\n")
        for s, t, g, a in zip(seq, ns, gyro, accel, strict=True):
            f.write(f"{t},{s},{t},imu,1.0," + ",".join(f"{v:.6g}" for v in (*g, *a)) + "\n")


EUROC = ",".join(
    ["#timestamp [ns]", *(f"w_RS_S_{a} [rad s^-1]" for a in "xyz"), *(f"a_RS_S_{a} [m s^-2]" for a in "xyz")]
)
PLAIN = "t,gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s],accel_x [m/s^2],accel_y [m/s^2],accel_z [m/s^2]"
XYZ = "gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"


# repeated, frozen and constant readings


@case(gyro=2e-4)
def optor5(to):
    """A camera sends each reading seven times with new stamps: https://github.com/optor-vis/optor_vi-stereo-v1/issues/5."""
    g, a, r = rest(1, 200 / 7, 7000, ng=2e-4)
    t = 1559247409.732608 + np.cumsum(0.005 + 4e-5 * r.standard_normal(49000))
    x = np.hstack([to_step(g * DEG, 1 / 16.4), to_step(a, 16 * G / 65536)]).repeat(7, axis=0)
    table(to + ".csv", "IMUTime,Gyr_x,Gyr_y,Gyr_z,Acc_x,Acc_y,Acc_z", t, x, fmt=["%.6f", "%.4f"])


@case(gyro=4e-3, accel=4e-3)  # 3e-3 without the readings held, 5.2e-3 as a filter meets them: either is right
def mesh585(to):
    """A robot's sensor stands still for 100 ms now and then, at 100 Hz: https://github.com/robotology/mesh-support/issues/585."""
    g, a, r = rest(2, 100, 30000, ng=3e-3, na=3e-3)
    src = np.arange(30000)
    for k in np.flatnonzero(r.random(30000 - 10) < 0.03):
        src[k : k + 10] = k
    t = 1513177142.8 + np.arange(30000) / 100
    x = np.hstack([to_step(a, 0.01), to_step(g * DEG, 1 / 16)])[src]
    head = "count,t,roll,pitch,yaw,acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2],gyr_x [deg/s],gyr_y [deg/s],gyr_z [deg/s]"
    table(
        to + ".csv",
        head,
        10344 + np.arange(30000),
        t,
        np.tile([0.56, -40.6, 16.4], (30000, 1)),
        x,
        fmt=["%d", "%.5f", "%.7g"],
    )


@case(gyro=None)
def wit14(to):
    """Gyroscopes of a WitMotion read exactly 0 at rest, export in g and deg/s: https://github.com/WITMOTION/WitStandardProtocol_JY901/issues/14."""
    _, a, r = rest(3, 50, 30000)
    clock = [f"12:{i // 3000 % 60:02d}:{i // 50 % 60:02d}.{i % 50 * 20:03d}" for i in range(30000)]
    rows = to_step(a / G, 16 / 32768)
    with Path(to + ".txt").open("w", encoding="utf-8") as f:
        f.write("Time\tax(g)\tay(g)\taz(g)\twx(deg/s)\twy(deg/s)\twz(deg/s)\tT(°)\n")
        f.writelines(
            f"{c}\t{x:.4f}\t{y:.4f}\t{z:.4f}\t0.0000\t0.0000\t0.0000\t{26 + b / 100:.2f}\n"
            for c, (x, y, z), b in zip(clock, rows, r.integers(0, 3, 30000), strict=True)
        )


@case(gyro_axes="x")
def rs5601(to):
    """Two gyroscope axes of a D435i hold 56.8 and -25.1 rad/s, moved or not: https://github.com/realsenseai/librealsense/issues/5601."""
    g, a, _ = rest(4, 200, 48000)
    g[:, 1], g[:, 2] = 56.8157043, -25.1048164
    table(to + ".csv", PLAIN, np.arange(48000) / 200, g, a, fmt=["%.3f", "%.8g"])


@case(gyro=4.4e-5, accel=7e-4, gyro_axes="xz")
def stim9(to):
    """A driver of a STIM300 never fills the y rate, which stays 0: https://github.com/vortexntnu/stim300-driver/pull/9."""
    g, a, _ = rest(5, 125, 32000, ng=4.4e-5, na=7e-4, kg=1e-8, bg=(2e-4, -1e-4, 3e-4))
    g[:, 1] = 0
    topic_csv(to + ".csv", np.arange(32000), 1666430000 * 10**9 + np.arange(32000) * 8000000, g, a)


@case(gyro=None)
def avros10(to):
    """The topic of a camera's accelerometer alone has only zeros as rates: https://github.com/ori-drs/allan_variance_ros/issues/10."""
    g, a, _ = rest(6, 250, 32000)
    topic_csv(to + ".csv", np.arange(32000), 1641100000 * 10**9 + np.arange(32000) * 3200000, g * 0, a)


@case(gyro=1e-4)
def xrp72(to):
    """After a reset in the middle the gyroscopes read only 0 (mdps and mg): https://github.com/Open-STEM/XRP_MicroPython/issues/72."""
    g, a, _ = rest(7, 100, 45000, ng=1e-4)
    g[27000:] = 0
    table(
        to + ".csv",
        "time_ms," + XYZ,
        np.arange(45000) * 10,
        np.round(g * DEG * 1000),
        np.round(a / G * 1000, 1),
        fmt=["%d"] * 4 + ["%.1f"],
    )


@case(gyro=None, accel=0.0029, accel_axes="xy")
def adxl7(to):
    """The vertical axis of an ADXL345 is always 511, at full scale: https://github.com/wollewald/ADXL345_WE/issues/7."""
    _, a, _ = rest(8, 100, 40000, na=0.0029)
    c = np.round(a / G * 256)
    c[:, 2] = 511
    table(to + ".csv", "ms,Raw-x,Raw-y,Raw-z", np.arange(40000) * 10, c, fmt="%d")


# wrong units, wrong scales, missing gravity


@case(gyro=9e-5)
def septentrio104(to):
    """A ROS driver fills angular_velocity with deg/s: https://github.com/septentrio-gnss/septentrio_gnss_driver/issues/104."""
    g, a, _ = rest(9, 100, 32000, ng=9e-5)
    topic_csv(to + ".csv", np.arange(32000), 1697630000 * 10**9 + np.arange(32000) * 10**7, g * DEG, a)


@case()
def livox98(to):
    """A lidar's driver fills linear_acceleration with g: https://github.com/Livox-SDK/livox_ros_driver/pull/98."""
    g, a, _ = rest(10, 200, 32000, bg=(-0.0216, -0.0182, -0.0124), ba=(0.47, -0.09, 9.79))
    topic_csv(to + ".csv", np.arange(32000), 1628129261482877970 + np.arange(32000) * 5000000, g, a / G)


@case()
def vcu13(to):
    """A data set in the form of EuRoC divides accelerations by 9.8 under a head of m/s²: https://github.com/rising-turtle/VCU_RVI_Benchmark/issues/13."""
    g, a, _ = rest(11, 200, 40000, ba=(9.79, 0.1, -0.2))
    table(to + ".csv", EUROC, 1661300000 * 10**9 + np.arange(40000) * 5000000, g, a / 9.8, fmt=["%d", "%.8g"])


@case()
def una314(to):
    """A manual says g, the watch gives m/s² (its reader states g): https://github.com/UNAWatch/una-sdk/issues/314."""
    g, a, _ = rest(12, 100, 40000)
    table(
        to + ".csv",
        "t," + XYZ,
        np.arange(40000) / 100,
        to_step(g * DEG, 0.01),
        to_step(a, 8 * G / 32767),
        fmt=["%.2f", "%.6g"],
    )


@case()
def icm2(to):
    """The range of an ICM-20602 is set through wrong bits: at rest z reads 2 g: https://github.com/mreutman/icm20602/pull/2."""
    g, a, _ = rest(13, 100, 40000)
    head = "t [s],gyro_x [deg/s],gyro_y [deg/s],gyro_z [deg/s],accel_x [g],accel_y [g],accel_z [g]"
    table(
        to + ".csv", head, np.arange(40000) / 100, g * DEG, to_step(2 * a / G, 1 / 8192), fmt=["%.2f", "%.6g"]
    )


@case(accel=2.5e-3)
def depthai319(to):
    """Gravity of a BNO085 reads 10.2 m/s², 4 % too much, stamps in whole ms: https://github.com/luxonis/depthai-core/issues/319."""
    g, a, _ = rest(14, 100, 40000, na=2.5e-3, bg=(0.008, -0.007, 0.004), ba=(-0.33, 10.19, -0.48))
    head = "timestamp [ms],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s],accel_x [m/s^2],accel_y [m/s^2],accel_z [m/s^2]"
    table(
        to + ".csv",
        head,
        np.round(3867 + np.arange(40000) * 10.02),
        to_step(g, 1 / 512 / 4),
        to_step(a, 1 / 256),
        fmt=["%d", "%.6g"],
    )


@case()
def ford3(to):
    """Recordings of cars have gravity taken out of linear_acceleration: https://github.com/Ford/AVData/issues/3."""
    g, a, _ = rest(15, 200, 32000, ba=(0.02, -0.01, 0.015))
    topic_csv(to + ".csv", np.arange(32000), 1503500000 * 10**9 + np.arange(32000) * 5000000, g, a)


@case()
def gins6(to):
    """Sets of GNSS/INS give increments of angle and velocity at 200 Hz, text without names: https://github.com/i2Nav-WHU/awesome-gins-datasets/issues/6."""
    g, a, _ = rest(16, 200, 34000, ba=(0.1, -0.2, -9.79))
    table(to + ".txt", "", 456300 + np.arange(34000) / 200, g / 200, a / 200, fmt=["%.3f", "%.9e"], sep=" ")
    Path(to + ".txt").write_text(Path(to + ".txt").read_text(encoding="utf-8").lstrip("\n"), encoding="utf-8")


@case(gyro=40 * NG)
def openlog45(to):
    """Gyroscopes are ten times noisier than the sheet, as the filter is off: https://github.com/sparkfun/OpenLog_Artemis/issues/45."""
    g, a, _ = rest(17, 50, 40000, ng=40 * NG, bg=(0.02, -0.01, 0.03))
    clock = [
        f"{14 + i // 180000}:{i // 3000 % 60:02d}:{i // 50 % 60:02d}.{i % 50 * 2:02d}" for i in range(40000)
    ]
    rows = np.hstack([to_step(a / G * 1000, 2000 / 32768), to_step(g * DEG, 1 / 131)])
    with Path(to + ".csv").open("w", encoding="utf-8") as f:
        f.write("rtcDate,rtcTime,aX,aY,aZ,gX,gY,gZ,imu_degC,output_Hz\n")
        for c, row in zip(clock, rows, strict=True):
            f.write(f"10/16/2020,{c}," + ",".join(f"{v:.2f}" for v in row) + ",27.41,50.000\n")


# counts of a converter: wrap, bytes, spikes, steps


@case()
def berry30(to):
    """Signed 16-bit counts are printed as 0 … 65535: https://github.com/ozzmaker/BerryIMU/pull/30."""
    g, a, _ = rest(18, 100, 40000, bg=(0.0005, -0.003, 0.006), ba=(0.05, -0.21, 9.79))
    c = np.hstack([np.round(a / G / 0.000244), np.round(g * DEG / 0.07 * 4)]).astype(int) & 0xFFFF
    table(to + ".csv", "ms,ACCx,ACCy,ACCz,GYRx,GYRy,GYRz", np.arange(40000) * 10, c, fmt="%d")


@case(gyro=None, accel=1.8e-3, accel_axes="yz")
def st737858(to):
    """An axis near 0 g jumps between -2 g and +2 g, the others are fine: https://community.st.com/t5/mems-sensors/ism330dlc-reads-when-it-is-stationary/td-p/737858."""
    _, a, _ = rest(19, 104, 40000, na=1.8e-3, ba=(0.01, 6.1, 7.6))
    c = np.round(a / G * 16384).astype(int)
    c[:, 0] = (c[:, 0] & 0xFFFF) - 32768
    table(
        to + ".csv",
        "t [s],accel_x [g],accel_y [g],accel_z [g]",
        np.arange(40000) / 104,
        c / 16384,
        fmt=["%.4f", "%.6f"],
    )


@case()
def riot22135(to):
    """High and low byte of each reading of an MPU-9150 are exchanged: https://github.com/RIOT-OS/RIOT/pull/22135."""
    g, a, _ = rest(20, 100, 40000)
    c = np.hstack([np.round(g * DEG * 16.4 * 8), np.round(a / G * 16384)]).astype(np.int16).byteswap()
    table(to + ".csv", "ms,gx,gy,gz,ax,ay,az", np.arange(40000) * 10, c, fmt="%d")


@case()
def bmi160(to):
    """Every second row repeats the one before, with -32768 in two axes: https://github.com/hanyazou/BMI160-Arduino/issues/1."""
    g, a, _ = rest(21, 50, 20000, bg=(1e-4, -2e-4, 1e-4))
    c = np.hstack([np.round(a / G * 16384), np.round(g * DEG * 131.072)]).repeat(2, axis=0)
    c[1::2, 3:5] = -32768
    table(to + ".txt", "ms\tax\tay\taz\tgx\tgy\tgz", np.arange(40000) * 10, c, fmt="%d", sep="\t")


@case(gyro=2e-4, accel=4e-3)
def mpu333174(to):
    """Bytes read one at a time from an MPU-6050: single readings are 256 counts off: https://electronics.stackexchange.com/questions/333174."""
    g, a, r = rest(22, 57, 40000, ng=2e-4, na=4e-3, bg=(-0.068, 0.0343, 0.006), ba=(0.3, -0.31, 9.7))
    c = np.hstack([np.round(a / G * 16384), np.round(g * DEG * 131)])
    hit = (r.random((40000, 6)) < 0.01) & (np.abs((c + 128) % 256 - 128) < 30)
    t = np.cumsum(1 / 57 + 2e-4 * r.standard_normal(40000))
    table(
        to + ".csv",
        "t,ax,ay,az,gx,gy,gz",
        t,
        c + 256 * hit * r.choice([-1, 1], (40000, 6)),
        fmt=["%.4f", "%d"],
    )


@case(gyro=4e-4, accel=None)
def ard128654(to):
    """Counts of an MPU-6050 at 2000 deg/s spread over eight values at most: https://forum.arduino.cc/index.php?topic=128654.0."""
    g, _, _ = rest(23, 100, 40000, ng=4e-4, bg=(45 / 16.4 / DEG, -10 / 16.4 / DEG, 29 / 16.4 / DEG))
    table(to + ".txt", "gx gy gz", np.round(g * DEG * 16.4), fmt="%d", sep=" ")


@case(gyro=6.7e-5, accel=2.2e-3)
def cats408(to):
    """A sensor of 104 Hz is polled at 100 Hz without its buffer, stamps of the system's ticks: https://github.com/catsystems/cats-embedded/issues/408."""
    g, a, _ = rest(24, 104, 41600, ng=6.7e-5, na=2.2e-3)
    k = np.arange(40000)
    src = np.floor((k * 0.01 + 0.003) * 104).astype(int)
    head = "ts_ms,gyro_x_dps,gyro_y_dps,gyro_z_dps,acc_x_g,acc_y_g,acc_z_g"
    table(
        to + ".csv",
        head,
        k * 10,
        to_step(g[src] * DEG, 0.07),
        to_step(a[src] / G, 0.000976),
        fmt=["%d", "%.2f", "%.2f", "%.2f", "%.5f"],
    )


@case(accel=None)
def gyroflow54(to):
    """Raw counts of 70 mdps under t,gx,gy,gz, time in ms: https://github.com/ElvinC/gyroflow/issues/54."""
    g, _, _ = rest(25, 500, 60000, bg=(0.0183, -0.0342, 0.0305))
    table(to + ".csv", "t,gx,gy,gz", 7364 + np.arange(60000) * 2, np.round(g * DEG / 0.07), fmt="%d")


# clocks


@case()
def m2ud13(to):
    """Stamps are printed with six digits, 1.73234e+09: https://github.com/Yaepiii/M2UD/issues/13."""
    g, a, _ = rest(26, 200, 40000)
    table(
        to + ".csv", "time,ax,ay,az,gx,gy,gz", 1732340000 + np.arange(40000) / 200, a, g, fmt=["%.6g", "%.6g"]
    )


@case()
def slict18(to):
    """385 Hz is read each 5 ms, two samples then have nearly one stamp: https://github.com/brytsknguyen/slict/issues/18."""
    g, a, r = rest(27, 385, 50000)
    poll = np.ceil(np.arange(50000) / 385 / 0.005) * 0.005
    late = np.concatenate([[0.0], np.where(np.diff(poll) == 0, 3e-4, 0.0)])
    table(to + ".csv", PLAIN, 1623000000 + poll + late + 2e-5 * r.random(50000), g, a, fmt=["%.6f", "%.6g"])


@case()
def sick487(to):
    """The clock of a lidar is set back by NTP each 600 s, 60 ms at once: https://github.com/SICKAG/sick_scan_xd/issues/487."""
    g, a, _ = rest(28, 50, 32000)
    true = np.arange(32000) / 50
    t = true + 1e-4 * ((true + 300) % 600)
    topic_csv(to + ".csv", np.arange(32000), 1750000000 * 10**9 + np.round(t * 1e9).astype(np.int64), g, a)


@case()
def xsens52(to):
    """Stamps are times of arrival by USB, sometimes 0.1 s late: https://github.com/ethz-asl/ethzasl_xsens_driver/issues/52."""
    g, a, r = rest(29, 200, 32000)
    t = np.arange(32000) / 200 + 3e-4 * r.exponential(size=32000)
    for k in r.integers(0, 31900, 80):
        t[k : k + 20] = np.maximum(t[k : k + 20], t[k] + 0.1 + 5e-5 * np.arange(20))
    ns = 1502280000 * 10**9 + np.round(np.maximum.accumulate(t) * 1e9).astype(np.int64)
    topic_csv(to + ".csv", np.arange(32000), ns, g, a)


@case()
def mynt25(to):
    """One to five messages are missing at a time, sequence numbers too: https://github.com/slightech/MYNT-EYE-S-SDK/issues/25."""
    g, a, r = rest(30, 200, 32000)
    keep = np.ones(32000, bool)
    for k in r.integers(10, 31900, 300):
        keep[k : k + r.integers(1, 6)] = False
    s = np.flatnonzero(keep)
    topic_csv(to + ".csv", s, 1542960000 * 10**9 + s * 5000000, g[s], a[s])


@case(gyro=2e-4, accel=3e-3)
def sitl26230(to):
    """SCALED_IMU of a simulation, milliseconds with steps of 0, 4 and 8: https://github.com/PX4/PX4-Autopilot/issues/26230."""
    g, a, r = rest(31, 250, 50000, ng=2e-4, na=3e-3)
    src = np.sort(np.arange(50000) - (r.random(50000) < 0.12))
    src = np.clip(src, 0, None)
    head = "time_boot_ms,xacc,yacc,zacc,xgyro,ygyro,zgyro"
    table(to + ".csv", head, 51000 + 4 * src, np.round(a[src] / G * 1000), np.round(g[src] * 1000), fmt="%d")


@case()
def avros3(to):
    """One stamp of a simulated robot lies 80 000 s ahead, the others go on: https://github.com/ori-drs/allan_variance_ros/issues/3."""
    g, a, _ = rest(32, 50, 32000)
    ns = np.arange(32000, dtype=np.int64) * 20000000 + 12 * 10**9
    ns[700] = 93877317622759
    topic_csv(to + ".csv", np.arange(32000), ns, g, a)


@case()
def pymav58(to):
    """Every tenth sample is not in the log, stamps in µs since the start: https://github.com/ArduPilot/pymavlink/pull/58."""
    g, a, r = rest(33, 1000, 60000)
    k = np.flatnonzero(np.arange(60000) % 10 != 7)
    us = np.round(37785000 + 1000 * k + 15 * r.standard_normal(len(k))).astype(int)
    table(to + ".csv", "TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", us, g[k], a[k], fmt=["%d", "%.6g"])


@case()
def plotj473(to):
    """The nanoseconds of the stamp repeat the seconds, the first column is right: https://github.com/PlotJuggler/PlotJuggler/issues/473."""
    g, a, _ = rest(34, 75, 36000)
    t = 1624979471.31 + np.arange(36000) / 75
    head = "__time,/imu/header/stamp/sec,/imu/header/stamp/nanosec," + ",".join(
        f"/imu/angular_velocity/{i}" for i in "xyz"
    )
    head += "," + ",".join(f"/imu/linear_acceleration/{i}" for i in "xyz")
    table(to + ".csv", head, t, np.floor(t), np.floor(t), g, a, fmt=["%.6f", "%d", "%d", "%.7g"])


@case()
def xsens14(to):
    """Every second message has zeros in place of rates and accelerations: https://github.com/xsens/xsens_mti_ros_node/issues/14."""
    g, a, _ = rest(35, 50, 32000)
    g[1::2], a[1::2] = 0, 0
    topic_csv(to + ".csv", np.arange(32000), 593403200000 + np.arange(32000, dtype=np.int64) * 20000000, g, a)


# forms of files


@case(accel=2e-3)
def shimmer2(to):
    """Consensys writes three rows of names, CAL and units, separated by tabs: https://github.com/seemoo-lab/pyshimmer/issues/2."""
    g, a, _ = rest(36, 51.2, 30000, na=2e-3)
    names = ["Timestamp_Unix_CAL", *(f"Accel_LN_{i}_CAL" for i in "XYZ"), *(f"Gyro_{i}_CAL" for i in "XYZ")]
    head = "\t".join(f"Shimmer_86A5_{n}" for n in names) + "\n" + "\t".join(["CAL"] * 7)
    head += "\nms\t" + "\t".join(["m/(s^2)"] * 3 + ["deg/s"] * 3)
    table(
        to + ".csv",
        head,
        1620390000000 + np.arange(30000) / 51.2 * 1000,
        a,
        g * DEG,
        fmt=["%.4f", "%.7g"],
        sep="\t",
    )


@case()
def pupil446(to):
    """Glasses write names with deg/s and G, stamps in ns beside two identifiers: https://github.com/pupil-labs/pupil-docs/pull/446."""
    g, a, _ = rest(37, 200, 24000)
    ident = ["9a1c0f", "b7e2d4"]
    axes = ",".join([*(f"gyro {i} [deg/s]" for i in "xyz"), *(f"acceleration {i} [G]" for i in "xyz")])
    x = np.hstack([to_step(g * DEG, 1 / 131.072), to_step(a / G, 1 / 16384)])
    with Path(to + ".csv").open("w", encoding="utf-8") as f:
        f.write(f"section id,recording id,timestamp [ns],{axes},roll [deg],pitch [deg]\n")
        f.writelines(
            f"{ident[0]},{ident[1]},{1626430000000000000 + 5000000 * i},"
            + ",".join(f"{v:.6f}" for v in row)
            + ",1.2,-0.4\n"
            for i, row in enumerate(x)
        )


@case()
def blackbox34(to):
    """A blackbox table: gyroADC in deg/s, accSmooth 2048 a g: https://github.com/AdrianEddy/telemetry-parser/issues/34."""
    g, a, _ = rest(38, 500, 60000)
    head = '"Product","Blackbox flight data recorder by Nicholas Sherlock"\n"acc_1G","2048"\n'
    head += '"gyro_scale","0x3f800000"\n'
    head += '"loopIteration","time"'
    head += "".join(f',"gyroADC[{i}]"' for i in range(3)) + "".join(f',"accSmooth[{i}]"' for i in range(3))
    k = np.arange(60000)
    table(
        to + ".csv",
        head,
        k,
        k * 2000,
        to_step(g * DEG, 0.01),
        np.round(a / G * 2048),
        fmt=["%d", "%d", "%.2f", "%.2f", "%.2f", "%d"],
    )


@case()
def mscl215(to):
    """SensorConnect writes blocks of information before the data, dates with nanoseconds, g and rad/s: https://github.com/LORD-MicroStrain/MSCL/issues/215."""
    g, a, _ = rest(39, 100, 36000)
    names = ",".join(
        [
            "Time",
            *(f"inertial-6251.43591:scaledAccel{i}" for i in "XYZ"),
            *(f"inertial-6251.43591:scaledGyro{i}" for i in "XYZ"),
        ]
    )
    with Path(to + ".csv").open("w", encoding="utf-8") as f:
        f.write("FILE_INFO\nListSeparator=,\nDecimalSeparator=.\n\nSESSION_INFO\nTimeZone,UTC\n")
        f.write(f"DateTimeFormat,MM/DD/YY h:mm:ss.nnnnnnnnn\n\nDATA_START\n{names}\n")
        for i, row in enumerate(np.hstack([a / G, g])):
            clock = f"02/17/22 10:{35 + i // 6000}:{i // 100 % 60:02d}.{i % 100:02d}0000000"
            f.write(clock + "," + ",".join(f"{v:.7g}" for v in row) + "\n")


@case()
def opensim2812(to):
    """MT Manager 2019.2 no longer writes the rate, rows have a counter alone: https://github.com/opensim-org/opensim-core/issues/2812."""
    g, a, _ = rest(40, 40, 30000)
    head = "// Start Time: Unknown\n// Sample rate: Unknown\n// Firmware Version: 4.0.2\n"
    head += "\t".join(
        ["PacketCounter", "SampleTimeFine", *(f"Acc_{i}" for i in "XYZ"), *(f"Gyr_{i}" for i in "XYZ")]
    )
    rows = (
        "\t".join([str((7001 + i) % 65536), "", *(f"{v:.6f}" for v in row)])
        for i, row in enumerate(np.hstack([a, g]))
    )
    Path(to + ".txt").write_text(head + "\n" + "\n".join(rows) + "\n", encoding="utf-8")


@case(gyro=2.9e-6, accel=3e-4)
def gici10(to):
    """A fibre-optic unit of 1 kHz, tabs also at the end, whole steps of 6.7e-8 rad: https://github.com/chichengcn/gici-open-dataset/issues/10."""
    g, a, _ = rest(
        41,
        1000,
        44000,
        ng=2.9e-6,
        na=3e-4,
        kg=1e-9,
        ka=1e-6,
        bg=(-2e-4, -4.7e-4, 1.7e-3),
        ba=(9.7, 0.013, -0.049),
    )
    turn = np.diff(np.floor(np.cumsum(g, axis=0) / 1000 / 6.6579e-8), axis=0, prepend=0) * 6.6579e-5
    with Path(to + ".txt").open("w", encoding="utf-8") as f:
        f.write("Timestamp\tAcc-X\tAcc-Y\tAcc-Z\tGyro-X\tGyro-Y\tGyro-Z\t\n")
        f.writelines(
            f"{1684646035 + (102 + i) / 1000:.3f}\t" + "\t ".join(f"{v:.8f}" for v in row) + "\n"
            for i, row in enumerate(np.hstack([a, turn]))
        )


@case()
def orbbec37(to):
    """Lines of JSON, one a reading, gyroscope and accelerometer in turn, whole ms: https://github.com/orbbec/OrbbecSDK/issues/37."""
    g, a, _ = rest(42, 100, 15000, bg=(0.002, -0.016, 0.0032))
    with Path(to + ".jsonl").open("w", encoding="utf-8") as f:
        for i in range(15000):
            for kind, row in (("gyroscope", g[i]), ("accelerometer", a[i])):
                f.write(
                    json.dumps(
                        {
                            "sensor": {"type": kind, "values": [float(f"{v:.6g}") for v in row]},
                            "time": round(10.659 + i / 100, 3),
                        }
                    )
                    + "\n"
                )


@case()
def gps21(to):
    """A phone's GNSS logger writes a row a reading: sensor, stamp in ns, x, y, z: https://github.com/google/gps-measurement-tools/pull/21."""
    g, a, r = rest(43, 100, 24000)
    ns = 61423000000000 + np.arange(24000) * 10**7 + r.integers(-20000, 20000, 24000)
    with Path(to + ".txt").open("w", encoding="utf-8") as f:
        f.write(
            "# Version: v3.0.0.1\n#\n# accelerometer,timestamp,x,y,z\n#\n# gyroscope,timestamp,x,y,z\n#\n"
        )
        for t, gg, aa in zip(ns, g, a, strict=True):
            f.write(
                f"accelerometer,{t},"
                + ",".join(f"{v:.6g}" for v in aa)
                + f"\ngyroscope,{t + 350000},"
                + ",".join(f"{v:.6g}" for v in gg)
                + "\n"
            )


@case(gyro=None, accel=None)
def accelexp11(to):
    """A phone's file has names Timestamp,X,Y,Z and rows of a time alone: https://github.com/KalebKE/AccelerationExplorer/issues/11."""
    t = 0.002 + np.arange(20000) * 0.0205
    table(to + ".csv", "Timestamp,X,Y,Z", t, fmt="%.3f")


@case()
def nave20(to):
    """A MATLAB struct imu of a toolbox: t, fb, wb, freq: https://github.com/rodralez/NaveGo/issues/20."""
    g, a, _ = rest(44, 100, 40000, ba=(0.1, -0.2, -9.79))
    savemat(
        to + ".mat",
        {"imu": {"t": np.arange(40000)[:, None] / 100, "fb": a, "wb": g, "freq": 100.0}},
        do_compression=True,
    )


@case()
def kallan3(to):
    """A MATLAB matrix without names: seconds, three accelerations, three rates: https://github.com/rpng/kalibr_allan/issues/3."""
    g, a, _ = rest(45, 100, 40000)
    savemat(
        to + ".mat",
        {"data_imu": np.column_stack([1519460000 + np.arange(40000) / 100, a, g])},
        do_compression=True,
    )


# effects, length, motion


@case()
def mpu78490(to):
    """100 000 raw records: the vertical accelerometer drifts as the chip warms up, its temperature in counts beside: https://arduino.stackexchange.com/questions/78490."""
    g, a, _ = rest(46, 50, 50000, bg=(-0.05, 0.01, 0.008))
    t = np.arange(50000) / 50
    heat = 34 - 9 * np.exp(-t / 250)
    a[:, 2] += 0.03 * (heat - 34)
    c = [np.round(a / G * 4096), np.round((heat - 36.53) * 340), np.round(g * DEG * 65.5)]
    table(
        to + ".csv", "msecs,acc_x,acc_y,acc_z,temp,gyro_x,gyro_y,gyro_z", np.arange(50000) * 20, *c, fmt="%d"
    )


@case(gyro=1e-4)
def slime222(to):
    """A BNO085 on a table sets its bias to zero again and again, which cannot be switched off: https://github.com/SlimeVR/SlimeVR-Tracker-ESP/pull/222."""
    g, a, _ = rest(47, 100, 60000, ng=1e-4, kg=5e-5)
    for k in range(58000, 0, -2000):
        g[k : k + 2000] -= g[k - 300 : k].mean(axis=0)
    table(
        to + ".csv",
        PLAIN,
        np.arange(60000) / 100,
        to_step(g, 1 / 2048 / 4),
        to_step(a, 1 / 256),
        fmt=["%.2f", "%.6g"],
    )


@case(accel=None)
def instk64(to):
    """After thinning a hidden sine of a MEMS gyroscope appears at a low frequency, MATLAB: http://instk.org/blog/index.html%3Fp=64.html."""
    g, _, _ = rest(48, 100, 60000)
    g[:, 1] += 2 * NG * np.sin(2 * np.pi * 0.437 * np.arange(60000) / 100)
    savemat(to + ".mat", {"gyro": g, "fs": 100.0}, do_compression=True)


@case()
def avros43(to):
    """A record of 830 samples, 2.4 s, to try a tool: https://github.com/ori-drs/allan_variance_ros/issues/43."""
    g, a, _ = rest(49, 346, 830)
    ns = 1703961685420000000 + np.round(np.arange(830) / 346 * 1e9).astype(np.int64)
    table(
        to + ".csv", "timestamp,omega_x,omega_y,omega_z,alpha_x,alpha_y,alpha_z", ns, g, a, fmt=["%d", "%.9g"]
    )


@case(gyro=None, accel=None)
def allan3(to):
    """A camera is moved by hand for a minute and the record taken as one at rest: https://github.com/CruxDevStuff/allan_ros2/issues/3."""
    g, a, r = rest(50, 200, 12000)
    low = lfilter([0.02], [1, -0.98], r.standard_normal((12000, 6)) * 10, axis=0)
    topic_csv(
        to + ".csv",
        np.arange(12000),
        1708600000 * 10**9 + np.arange(12000) * 5000000,
        g + 0.7 * low[:, :3],
        a + 2.5 * low[:, 3:],
    )


@case(gyro=None, accel=3e-3)
def klip3323(to):
    """A printer's ADXL345 at 3200 Hz in mm/s², a fan's faint line at 70 Hz: https://github.com/Klipper3d/klipper/pull/3323."""
    _, a, _ = rest(51, 3200, 60000, na=3e-3)
    a[:, 0] += 0.08 * np.sin(2 * np.pi * 70.3 * np.arange(60000) / 3200)
    table(
        to + ".csv",
        "#time,accel_x,accel_y,accel_z",
        1600.5 + np.arange(60000) / 3200,
        to_step(a / G, 0.0039) * 9806.65,
        fmt=["%.6f"] + ["%.3f"] * 3,
    )


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[2:] or CASES:
        CASES[name][0](str(folder / name))
