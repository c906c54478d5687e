"""Files of a drive from a challenge item: samples and fixes as NPZ, data sheets of sensor and receiver.

The truth is written apart, to be sealed with the key.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
from challenge.drives.earth import axes, geodetic
from challenge.drives.errors import Errors
from challenge.drives.items import KINDS, Item, item
from challenge.drives.outside import Fixes, Outside
from challenge.drives.scene import MG, Scene
from challenge.drives.truth import turn
from challenge.generator.noise import Noise
from challenge.seal import sealed
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

SENSOR_SHEET = """format: tuner-datasheet/1
name: unit
title: Unit of a drive
kind: measured
rate: {rate}
reference: its maker
gyro:
  noise_density: {{value: {arw:.9g}, unit: deg/√h}}
  bias_instability: {{value: {gyro_floor:.9g}, unit: deg/h}}
  turn_on_sd: {{value: {gyro_bias:.9g}, unit: deg/s}}
accel:
  noise_density: {{value: {vrw:.9g}, unit: m/s/√h}}
  bias_instability: {{value: {accel_floor:.9g}, unit: µg}}
  turn_on_sd: {{value: {accel_bias:.9g}, unit: mg}}
"""
RECEIVER_SHEET = """format: tuner-gnss/1
name: receiver
title: Receiver of a drive
position_sd: [{0:.9g}, {1:.9g}, {2:.9g}]
velocity_sd: [{3:.9g}, {4:.9g}, {5:.9g}]
interval: {6:.9g}
gate: 5.0
reference: its maker
"""


def drive(made: Item) -> dict[str, NDArray[Any]]:
    """Return the arrays of a drive; names and units of the project's input format."""
    return arrays(made.scene, made.errors, made.seed)


def arrays(s: Scene, e: Errors, seed: int, outside: Outside | None = None) -> dict[str, NDArray[Any]]:
    """Return the arrays of a drive with errors, and with an effect outside the catalogue."""
    units, fixes, more = (np.random.default_rng([seed, number]) for number in range(3))
    t, rates = _unit(s, e, units)
    if outside is not None and outside.unit is not None:
        rates = rates + outside.unit(t, s.truth.state(t - 0.5 / s.imu_rate), s, more)
    at, llh, vel = _fixes(s, e, fixes, outside or Outside(), more)
    said = np.tile(np.array([*s.position_sd, *s.velocity_sd]), (len(at), 1))
    meta = {"imu_frame": "FRD", "mounting_rpy_deg": [0.0, 0.0, 0.0], "lever_arm_frd_m": list(s.arm)}
    return {
        "imu_t": t, "gyro": rates[:, :3], "accel": rates[:, 3:], "gnss_t": at, "gnss_llh": llh,
        "gnss_vned": vel, "gnss_pstd": said[:, :3], "gnss_vstd": said[:, 3:], "meta": np.array(json.dumps(meta)),
    }  # fmt: skip


def truth(made: Item) -> dict[str, NDArray[Any]]:
    """Return the true motion twice a second."""
    t = np.arange(0.0, made.scene.duration, 0.5)
    state = made.scene.truth.state(t)
    llh = np.column_stack([np.degrees(state.llh[:, :2]), state.llh[:, 2]])
    return {"t": t, "llh": llh, "vned": state.vel_n, "rpy": np.degrees(made.scene.route.motion(t)[1])}


def sheets(s: Scene) -> tuple[str, str]:
    """Return the sheets of sensor and receiver, as their makers would write them."""
    deg_h = np.degrees(1.0) * 3600.0
    sensor = SENSOR_SHEET.format(
        rate=s.imu_rate,
        arw=np.degrees(s.arw) * 60.0,
        gyro_floor=0.664 * s.gyro_flicker * deg_h,
        gyro_bias=np.degrees(s.gyro_bias),
        vrw=s.vrw * 60.0,
        accel_floor=0.664 * s.accel_flicker / MG * 1000.0,
        accel_bias=s.accel_bias / MG,
    )
    return sensor, RECEIVER_SHEET.format(*s.position_sd, *s.velocity_sd, 1.0 / s.gnss_rate)


def generate(
    numbers: range,
    secret: str,
    drives: Path,
    keys: Path,
    *,
    kinds: tuple[str, ...] = tuple(KINDS),
    reference: bool | None = None,
) -> str:
    """Write drives ``NAME.npz`` with their sheets, the truth beside the key, and the key; return its SHA-256."""
    drives.mkdir(parents=True, exist_ok=True)
    keys.parent.mkdir(parents=True, exist_ok=True)
    told = []
    for number in numbers:
        made = item(secret, number, kinds, reference)
        np.savez(drives / f"{made.name}.npz", **drive(made))  # type: ignore[arg-type]
        for kind, text in zip(("sensor", "gnss"), sheets(made.scene), strict=True):
            (drives / f"{made.name}.{kind}.yaml").write_text(text, encoding="utf-8")
        motion = keys.parent / f"{made.name}.truth.npz"
        np.savez_compressed(motion, **truth(made))  # type: ignore[arg-type]
        told.append({**made.truth(), "motion": hashlib.sha256(motion.read_bytes()).hexdigest()})
    return sealed(told, keys)


def _unit(s: Scene, e: Errors, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Return stamps (n,) and samples (n, 6)."""
    t, true = s.truth.unit(s.imu_rate, s.duration)
    sensed = true @ (np.eye(6) + e.matrix).T
    levels = (s.arw, s.gyro_bias, s.gyro_flicker), (s.vrw, s.accel_bias, s.accel_flicker)
    for axis in range(6):
        density, spread, level = levels[axis // 3]
        constant = spread * (rng.choice([-1.0, 1.0]) * s.turn_on if s.turn_on else rng.standard_normal())
        white = density * np.sqrt(s.imu_rate)
        own = Noise(white, 0.0, level, 0.0, 0.0, 0.0, 0.0, 0.0, float(constant))
        sensed[:, axis] += e.noise[axis // 3] * white * rng.standard_normal(len(t))
        sensed[:, axis] += own.slow(len(t), 1.0 / s.imu_rate, rng)
    return t, sensed + np.where(t[:, None] > e.jump_time, e.jump, 0.0)


def _seen(s: Scene, t: FloatArray, arm: FloatArray, off: FloatArray) -> Fixes:
    """Return what a receiver sees at times t."""
    x, velocity = s.truth.antenna(t, arm)
    way = (x - x[:1]) @ axes(geodetic(x[:1]))[0]
    return Fixes(t, s.truth.state(t), way, velocity, off)


def _fixes(
    s: Scene, e: Errors, rng: np.random.Generator, outside: Outside, more: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return stamps (k,), latitude and longitude in degrees with height (k, 3), velocities (k, 3)."""
    t = np.arange(1, int(s.duration * s.gnss_rate)) / s.gnss_rate
    k, arm = len(t), np.array(s.arm) + e.arm
    then = t - e.delay
    if outside.late is not None:
        then = then - outside.late(_seen(s, t, arm, np.zeros((k, 6))), s, more)
    x, _ = s.truth.antenna(then, arm)
    _, vel = s.truth.antenna(then - e.lag, arm)
    vel = vel @ turn(*(np.array([angle]) for angle in e.frame))[0].T
    sd = np.array([*s.position_sd, *s.velocity_sd])
    off = e.fixes * sd * rng.standard_normal((k, 6))
    if e.markov_sd:
        decay = np.exp(-1.0 / (s.gnss_rate * e.markov_time))
        walk = rng.standard_normal((k, 3))
        for i in range(1, k):
            walk[i] = decay * walk[i - 1] + np.sqrt(1.0 - decay**2) * walk[i]
        off[:, :3] += e.markov_sd * walk
    if e.outliers:
        which = rng.choice(np.arange(k // 10, k), e.outliers, replace=False)
        way = rng.standard_normal((e.outliers, 3))
        off[which, :3] += e.outlier_size * sd[:3] * way / np.linalg.norm(way, axis=1, keepdims=True)
    if e.wrong:
        which = rng.choice(np.arange(k // 10, k), e.wrong, replace=False)
        off[which, 3:] += e.wrong_rms / np.sqrt(3.0) * rng.standard_normal((e.wrong, 3))
    if outside.fixes is not None:
        off = outside.fixes(_seen(s, then, arm, off), s, more)
    local = axes(geodetic(x))
    llh = geodetic(x + np.einsum("nij,nj->ni", local, off[:, :3]))
    kept = np.ones(k, dtype=bool)
    for begin, end in s.gaps:
        kept &= ~((t > begin) & (t < end))
    degrees = np.column_stack([np.degrees(llh[:, :2]), llh[:, 2]])
    return t[kept], degrees[kept], (vel + off[:, 3:])[kept]
