r"""A loosely coupled INS/GNSS filter in a page, as a program of its own that `tuner tune --filter` can tune.

    tuner tune noise.yaml --drive drive.npz --to kalibr \
        --filter "python examples/loose_filter.py {config} {imu} {gnss} {output}.csv"

It reads noise as Kalibr states it and sds of the fixes, and writes its estimates and innovations with their sds.
"""

import sys
from pathlib import Path

import numpy as np
import yaml
from filterpy.kalman import KalmanFilter
from scipy.spatial.transform import Rotation

SUBSTEPS = 10  # samples of the inertial unit in one step of the covariance
RADIUS, GRAVITY = 6371000.0, 9.80665

config, imu_path, gnss_path, out_path = sys.argv[1:]
noise = yaml.safe_load(Path(config).read_text(encoding="utf-8"))
imu = np.loadtxt(imu_path, delimiter=",", skiprows=1)
gnss = np.genfromtxt(gnss_path, delimiter=",", skip_header=1)

moving = np.flatnonzero(np.hypot(gnss[:, 7], gnss[:, 8]) > 3.0)[0]  # the heading is that of the velocity
origin, scale = gnss[moving, 1:4], np.array([1.0, 1.0, -1.0])
scale[:2] = np.radians(RADIUS + origin[2]) * np.array([1.0, np.cos(np.radians(origin[0]))])
fixes = np.column_stack([gnss[:, 0], (gnss[:, 1:4] - origin) * scale, gnss[:, 4:7]])[moving:]
imu = imu[imu[:, 0] > fixes[0, 0]]
gyro, accel, dt = imu[:, 1:4], imu[:, 4:7], np.diff(imu[:, 0], prepend=fixes[0, 0])

position, velocity = np.zeros(3), gnss[moving, 7:10].copy()
heading = np.arctan2(velocity[1], velocity[0])
attitude = Rotation.from_euler("ZYX", [heading, 0.0, 0.0])
gyro_bias, accel_bias = np.zeros(3), np.zeros(3)

kf = KalmanFilter(dim_x=15, dim_z=3)  # errors: position, velocity, attitude, gyro bias, accelerometer bias
kf.P = np.diag(np.repeat([1.0, 0.3, 0.05, 3e-3, 0.05], 3) ** 2)
kf.P[8, 8] = 0.1**2
kf.H = np.eye(3, 15)
densities = [noise[f"accelerometer_{k}"] for k in ("noise_density", "random_walk")]
densities += [noise[f"gyroscope_{k}"] for k in ("noise_density", "random_walk")]
power = np.repeat([0.0, densities[0], densities[2], densities[3], densities[1]], 3) ** 2

rows, k = [], 1
for i in range(0, len(imu) - SUBSTEPS, SUBSTEPS):
    step = 0.0
    for j in range(i, i + SUBSTEPS):
        force = attitude.apply(accel[j] - accel_bias)
        acceleration = force + np.array([0.0, 0.0, GRAVITY])
        position = position + (velocity + 0.5 * acceleration * dt[j]) * dt[j]
        velocity = velocity + acceleration * dt[j]
        attitude = attitude * Rotation.from_rotvec((gyro[j] - gyro_bias) * dt[j])
        step += dt[j]
    x, y, z = force
    mat = attitude.as_matrix()
    kf.F = np.eye(15)
    kf.F[0:3, 3:6] = step * np.eye(3)
    kf.F[3:6, 6:9] = -step * np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    kf.F[3:6, 12:15], kf.F[6:9, 9:12] = -step * mat, -step * mat
    kf.Q = np.diag(power * step)
    kf.predict()
    z_row = np.full(6, np.nan)
    now = imu[i + SUBSTEPS - 1, 0]
    if k < len(fixes) and now >= fixes[k, 0]:
        late = now - fixes[k, 0]
        innovation = fixes[k, 1:4] + velocity * late - position
        kf.x = np.zeros(15)
        kf.update(innovation, R=np.diag(fixes[k, 4:7] ** 2))
        z_row = np.concatenate([innovation, np.sqrt(np.diag(kf.S))])
        error = kf.x.ravel()
        position, velocity = position + error[:3], velocity + error[3:6]
        attitude = Rotation.from_rotvec(error[6:9]) * attitude
        gyro_bias, accel_bias = gyro_bias + error[9:12], accel_bias + error[12:15]
        k += 1
    angles = attitude.as_euler("ZYX", degrees=True)[::-1]
    sds = np.sqrt(np.diag(kf.P))[:9] * np.repeat([1.0, 1.0, 180.0 / np.pi], 3)
    rows.append(np.concatenate([[now], origin + position / scale, velocity, angles, sds, z_row]))

names = "t lat lon height vn ve vd roll pitch yaw sd_n sd_e sd_d sd_vn sd_ve sd_vd sd_phi_n sd_phi_e sd_phi_d"
names += " z_n z_e z_d sd_z_n sd_z_e sd_z_d"
np.savetxt(out_path, rows, delimiter=",", header=",".join(names.split()), comments="", fmt="%.12g")
