"""Effects on drives that no cause of the catalogue describes.

`right` holds names that say the same about the data (accelerometers mounted apart are a lever arm): those are no wrong
names. Sizes are such that a filter which does not know of them errs visibly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from challenge.drives.scene import Scene
from challenge.drives.truth import State
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Fixes:
    """What a receiver sees at k fixes: times, motion, way from the first fix, velocity and its own errors, NED."""

    t: FloatArray
    state: State
    way: FloatArray
    velocity: FloatArray
    off: FloatArray


Draw = np.random.Generator
OnUnit = Callable[[FloatArray, State, Scene, Draw], FloatArray]
OnFixes = Callable[[Fixes, Scene, Draw], FloatArray]


@dataclass(frozen=True)
class Outside:
    """One effect.

    Attributes
    ----------
    unit : callable, optional
        What is added to rates and forces, (n, 6).
    late : callable, optional
        Seconds by which each fix is late, (k,).
    fixes : callable, optional
        Errors of the fixes, (k, 6), in place of `Fixes.off`.
    right : frozenset of str
        Names of the catalogue that say the same.
    """

    unit: OnUnit | None = None
    late: OnFixes | None = None
    fixes: OnFixes | None = None
    right: frozenset[str] = frozenset()


def _columns(*parts: FloatArray) -> FloatArray:
    return np.column_stack(parts)


def _heading(state: State) -> FloatArray:
    forward = np.einsum("nji,nj->ni", state.local, state.body[:, :, 0])
    return np.arctan2(forward[:, 1], forward[:, 0])


def _speed(state: State) -> FloatArray:
    return np.linalg.norm(state.vel_n, axis=1)


def _share_of_top_speed(state: State) -> FloatArray:
    speed = _speed(state)
    return speed / speed.max()


def _gyro(values: FloatArray) -> FloatArray:
    return _columns(values, np.zeros_like(values))


def _accel(values: FloatArray) -> FloatArray:
    return _columns(np.zeros_like(values), values)


def _about_down(values: FloatArray) -> FloatArray:
    return _gyro(np.outer(values, [0.0, 0.0, 1.0]))


def _vertical(off: FloatArray, more: FloatArray) -> FloatArray:
    return off + np.outer(more, [0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def _smoothed(y: FloatArray, t: FloatArray, memory: float) -> FloatArray:
    decay, out = np.exp(-float(t[1] - t[0]) / memory), y.copy()
    for i in range(1, len(y)):
        out[i] = decay * out[i - 1] + (1.0 - decay) * y[i]
    return out


def _walk(shape: tuple[int, int], step: float, memory: float, rng: Draw) -> FloatArray:
    decay, out = np.exp(-step / memory), rng.standard_normal(shape)
    for i in range(1, len(out)):
        out[i] = decay * out[i - 1] + np.sqrt(1.0 - decay**2) * out[i]
    return out


# Of the inertial unit.


def _pulled(t: FloatArray, m: State, s: Scene, rng: Draw) -> FloatArray:
    return _about_down(2e-3 * np.sin(_heading(m) + 1.0))


def _asymmetric(t: FloatArray, m: State, s: Scene, rng: Draw) -> FloatArray:
    return _about_down(0.02 * np.maximum(m.omega[:, 2], 0.0))


def _square_gyro(t: FloatArray, m: State, s: Scene, rng: Draw) -> FloatArray:
    return _gyro(0.03 * m.omega * np.abs(m.omega))


def _rectified(t: FloatArray, m: State, s: Scene, rng: Draw) -> FloatArray:
    return _accel(np.outer(_share_of_top_speed(m) ** 2, [0.05, 0.03, 0.05]))


def _shaken(t: FloatArray, m: State, s: Scene, rng: Draw) -> FloatArray:
    share = np.minimum(_share_of_top_speed(m) * 2.0, 1.0)[:, None]
    return _accel(share * (1.0 * rng.standard_normal((len(t), 3)) + np.array([0.04, -0.03, 0.03])))


def _apart(t: FloatArray, m: State, s: Scene, rng: Draw) -> FloatArray:
    arm, turn = np.array([0.3, -0.2, 0.4]), np.gradient(m.omega, 1.0 / s.imu_rate, axis=0)
    return _accel(np.cross(turn, arm) + np.cross(m.omega, np.cross(m.omega, arm)))


def _warming(t: FloatArray, m: State, s: Scene, rng: Draw) -> FloatArray:
    rise = 1.0 - np.exp(-t / 150.0)
    return _columns(
        np.outer(rise, 8.0 * s.gyro_bias * np.array([1.0, -0.7, 1.0])),
        np.outer(rise, 3.0 * s.accel_bias * np.array([1.0, 1.0, -1.0])),
    )


def _crossed(t: FloatArray, m: State, s: Scene, rng: Draw) -> FloatArray:
    matrix = np.array([[0.0, 0.02, -0.003], [-0.015, 0.0, 0.003], [0.0, 0.0, 0.0]])
    return _accel(m.force @ matrix.T)


def _saturated(t: FloatArray, m: State, s: Scene, rng: Draw) -> FloatArray:
    rail = 0.6 * np.abs(m.omega).max(axis=0)
    return _gyro(np.clip(m.omega, -rail, rail) - m.omega)


def _slipped(t: FloatArray, m: State, s: Scene, rng: Draw) -> FloatArray:
    after = (t > s.duration * rng.uniform(0.4, 0.7)).astype(float)[:, None]
    a, b, c = np.radians([0.8, -1.0, 2.0])
    turn = np.array([[0.0, c, -b], [-c, 0.0, a], [b, -a, 0.0]])
    return after * _columns(m.omega @ turn.T, m.force @ turn.T)


def _dropped(t: FloatArray, m: State, s: Scene, rng: Draw) -> FloatArray:
    held = np.zeros(len(t), dtype=bool)
    for begin in rng.uniform(60.0, s.duration, 12):
        held |= (t > begin) & (t < begin + 0.4)
    last = np.maximum.accumulate(np.where(held, 0, np.arange(len(t))))
    return _columns(m.omega[last] - m.omega, m.force[last] - m.force)


def _square_accel(t: FloatArray, m: State, s: Scene, rng: Draw) -> FloatArray:
    level = m.force * np.array([1.0, 1.0, 0.0])
    return _accel(0.02 * level * np.abs(level))


def _cycling(t: FloatArray, m: State, s: Scene, rng: Draw) -> FloatArray:
    wave = np.sin(2.0 * np.pi * t / 110.0 + rng.uniform(0.0, 6.0))
    return _gyro(np.outer(wave, 10.0 * s.gyro_bias * np.array([0.5, 0.7, 1.0])))


def _late_unit(t: FloatArray, m: State, s: Scene, rng: Draw) -> FloatArray:
    n = round(0.3 * s.imu_rate)
    kernel = np.ones(n) / n
    felt = _columns(m.omega, m.force)
    padded = np.vstack([np.repeat(felt[:1], n - 1, axis=0), felt])
    return np.column_stack([np.convolve(column, kernel, "valid") for column in padded.T]) - felt


# Of the receiver.


def _flexed(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    bend = -0.15 * f.state.force * np.array([1.0, 1.0, 0.0])
    level = np.einsum("nji,njk,nk->ni", f.state.local, f.state.body, bend)
    return f.off + _columns(level, np.zeros_like(level))


def _slowed(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    share = -0.15 * np.minimum(np.abs(f.state.omega[:, 2]) / 0.2, 1.0)
    return f.off + _columns(0.0 * f.velocity, share[:, None] * f.velocity)


def _turned_in_bends(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    angle = 0.15 * f.state.omega[:, 2]
    north, east, down = f.velocity.T
    return f.off + _columns(0.0 * f.velocity, -angle * east, angle * north, 0.0 * down)


def _late_by_steps(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    edges = np.sort(rng.uniform(60.0, s.duration, 5))
    return np.asarray(rng.uniform(0.0, 0.3, 6)[np.searchsorted(edges, f.t)])


def _late_at_random(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    return rng.uniform(-0.12, 0.12, len(f.t))


def _velocity_wanders(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    walk = 3.0 * np.array(s.velocity_sd) * _walk((len(f.t), 3), 1.0 / s.gnss_rate, 20.0, rng)
    return f.off + _columns(0.0 * walk, walk)


def _sloping(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    reach = max(float(np.linalg.norm(f.way[:, :2], axis=1).max()), 1.0)
    return _vertical(f.off, -14.0 * s.position_sd[2] / reach * (f.way[:, 0] + f.way[:, 1]))


def _heights_wave(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    wave = 4.0 * s.position_sd[2] * np.sin(2.0 * np.pi * f.t / 200.0)
    return _vertical(f.off, wave + 0.05 * f.way[:, 2])


def _datum(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    size = 6.0 * np.array([*s.position_sd, 0.0, 0.0, 0.0]) * np.array([1.0, -0.8, 0.5, 0.0, 0.0, 0.0])
    return f.off + np.outer(f.t > 0.55 * s.duration, size)


def _map_scale(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    return f.off + 0.012 * f.way @ np.eye(3, 6) * np.array([1.0, 1.0, 0.0, 0.0, 0.0, 0.0])


def _smoothed_positions(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    seen = f.way + f.off[:, :3]
    return _columns(_smoothed(seen, f.t, 1.5) - f.way, f.off[:, 3:])


def _extrapolated(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    off = f.off.copy()
    for begin in np.arange(70.0, s.duration, 45.0):
        out = np.flatnonzero((f.t > begin) & (f.t < begin + 6.0))
        last = out[0] - 1
        seen = f.velocity[last] + off[last, 3:]
        run = (f.t[out] - f.t[last])[:, None] * seen
        off[out, :3] = f.way[last] + off[last, :3] + run - f.way[out]
        off[out, 3:] = seen - f.velocity[out]
    return off


def _antenna_moved(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    after = f.t > s.duration * rng.uniform(0.4, 0.7)
    arm = np.einsum("nji,njk,k->ni", f.state.local, f.state.body, np.array([1.5, -1.0, -0.8]))
    return f.off + after[:, None] * _columns(arm, np.zeros_like(arm))


def _dead_band(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    seen = f.velocity + f.off[:, 3:]
    still = np.linalg.norm(seen, axis=1) < 0.35 * np.median(np.linalg.norm(f.velocity, axis=1))
    return _columns(f.off[:, :3], np.where(still[:, None], -f.velocity, f.off[:, 3:]))


def _dynamic_pressure(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    return _vertical(f.off, 8.0 * s.position_sd[2] * _share_of_top_speed(f.state) ** 2)


def _worse_in_motion(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    return f.off * (1.0 + 2.0 * _share_of_top_speed(f.state)[:, None])


def _satellites_change(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    edges = np.cumsum(rng.uniform(15.0, 60.0, 60))
    steps = 3.0 * np.array(s.position_sd) * rng.standard_normal((61, 3))
    return f.off + steps[np.searchsorted(edges, f.t)] @ np.eye(3, 6)


def _drawn_off(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    off = f.off.copy()
    for begin in rng.uniform(90.0, s.duration - 60.0, 2):
        way = rng.standard_normal(2)
        here = (f.t > begin) & (f.t < begin + 40.0)
        off[here, :2] += np.outer(f.t[here] - begin, 0.5 * s.position_sd[0] * way / np.linalg.norm(way))
    return off


def _heights_lag(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    off = f.off.copy()
    off[:, 2] = _smoothed(f.way[:, 2] + off[:, 2], f.t, 8.0) - f.way[:, 2]
    return off


def _rounded(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    step = 6.0 * np.array(s.position_sd)
    seen = f.way + f.off[:, :3]
    return _columns(np.round(seen / step) * step - f.way, f.off[:, 3:])


def _lagging_gyros(t: FloatArray, m: State, s: Scene, rng: Draw) -> FloatArray:
    late = np.column_stack([np.interp(t - 0.08, t, column) for column in m.omega.T])
    return _gyro(late - m.omega)


def _drifting_scale(t: FloatArray, m: State, s: Scene, rng: Draw) -> FloatArray:
    return _accel(np.outer(t / s.duration, [0.08, 0.08, 0.0]) * m.force)


def _one_noisy_axis(t: FloatArray, m: State, s: Scene, rng: Draw) -> FloatArray:
    return _about_down(12.0 * s.arw * np.sqrt(s.imu_rate) * rng.standard_normal(len(t)))


def _sheared_gyros(t: FloatArray, m: State, s: Scene, rng: Draw) -> FloatArray:
    return _gyro(m.omega @ np.array([[0.0, 0.0, 0.02], [0.0, 0.0, -0.02], [0.0, 0.0, 0.0]]).T)


def _shadowed(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    size = 5.0 * s.position_sd[0] * np.sin(_heading(f.state) - 0.5)
    return f.off + np.outer(size, [0.0, 1.0, 0.0, 0.0, 0.0, 0.0])


def _offset_velocity(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    return f.off + np.array([0.0, 0.0, 0.0, 4.0, -3.0, 0.0]) * s.velocity_sd[0]


def _rounded_stamps(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    return f.t - np.floor(f.t / 0.7) * 0.7


def _two_antennas(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    arm = np.einsum("nji,njk,k->ni", f.state.local, f.state.body, np.array([2.0, 0.0, 0.0]))
    second = (np.floor(f.t / 40.0) % 2.0)[:, None]
    return f.off + second * _columns(arm, np.zeros_like(arm))


def _sinking_heights(f: Fixes, s: Scene, rng: Draw) -> FloatArray:
    return _vertical(f.off, 20.0 * s.position_sd[2] * f.t / s.duration)


def _named(*names: str) -> frozenset[str]:
    return frozenset(names)


KINDS = {
    "heading_pull": Outside(unit=_pulled),
    "asymmetric_gyro": Outside(unit=_asymmetric),
    "square_gyro": Outside(unit=_square_gyro),
    "rectified_vibration": Outside(unit=_rectified),
    "accelerometers_apart": Outside(unit=_apart, right=_named("lever_arm")),
    "warming": Outside(unit=_warming),
    "crossed_accelerometers": Outside(unit=_crossed, right=_named("sensor_bias")),
    "bending_mast": Outside(fixes=_flexed, right=_named("velocity_lag", "time_offset")),
    "slow_in_bends": Outside(fixes=_slowed),
    "turned_in_bends": Outside(fixes=_turned_in_bends, right=_named("lever_arm")),
    "delay_steps": Outside(late=_late_by_steps),
    "delay_jitter": Outside(late=_late_at_random),
    "velocity_wanders": Outside(fixes=_velocity_wanders, right=_named("correlated_velocity")),
    "sloping_heights": Outside(fixes=_sloping, right=_named("gnss_frame", "vertical_velocity")),
    "waving_heights": Outside(fixes=_heights_wave, right=_named("correlated_gnss", "vertical_velocity")),
    "datum_step": Outside(fixes=_datum),
    "map_scale": Outside(fixes=_map_scale, right=_named("velocity_scale", "accel_scale")),
    "smoothed_positions": Outside(fixes=_smoothed_positions, right=_named("time_offset", "velocity_lag")),
    "cycling_bias": Outside(unit=_cycling),
    "square_accelerometer": Outside(unit=_square_accel),
    "extrapolated_fixes": Outside(fixes=_extrapolated, right=_named("gnss_velocity", "gnss_outliers")),
}
"""Kinds of which some shaped the checks."""
FRESH = {
    "shaken": Outside(unit=_shaken, right=_named("imu_noise_scale")),
    "saturated_gyro": Outside(unit=_saturated),
    "slipped_unit": Outside(unit=_slipped),
    "dropped_samples": Outside(unit=_dropped),
    "late_unit": Outside(unit=_late_unit, right=_named("time_offset", "velocity_lag")),
    "moved_antenna": Outside(fixes=_antenna_moved),
    "dead_band": Outside(fixes=_dead_band, right=_named("gnss_velocity")),
    "dynamic_pressure": Outside(fixes=_dynamic_pressure),
    "worse_in_motion": Outside(fixes=_worse_in_motion, right=_named("gnss_noise_scale")),
    "satellites_change": Outside(fixes=_satellites_change, right=_named("correlated_gnss")),
    "drawn_off": Outside(fixes=_drawn_off, right=_named("gnss_outliers", "correlated_gnss")),
    "lagging_heights": Outside(fixes=_heights_lag, right=_named("correlated_gnss")),
    "lagging_gyros": Outside(unit=_lagging_gyros),
    "drifting_scale": Outside(unit=_drifting_scale),
    "one_noisy_axis": Outside(unit=_one_noisy_axis, right=_named("imu_noise_scale")),
    "sheared_gyros": Outside(unit=_sheared_gyros, right=_named("misalignment")),
    "shadowed_antenna": Outside(fixes=_shadowed),
    "offset_velocity": Outside(fixes=_offset_velocity, right=_named("correlated_velocity")),
    "rounded_stamps": Outside(late=_rounded_stamps),
    "two_antennas": Outside(fixes=_two_antennas),
    "sinking_heights": Outside(fixes=_sinking_heights, right=_named("correlated_gnss", "vertical_velocity")),
    "rounded_positions": Outside(fixes=_rounded, right=_named("gnss_noise_scale")),
}
"""Kinds that were made after the checks and shaped none of them."""
