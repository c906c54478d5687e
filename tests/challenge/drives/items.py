"""Which effects are hidden in which drive.

Clean drives 30 % (half of them hard), single effects 50 %, pairs 15 %, near misses 5 %. Singles are log-uniform
in d from 3 to 1000 nats. From 35 nats on an effect is kept only if `APART_NATS` of them remain unexplained by the
best other cause (of the mean kind): else nobody could name it.
"""

from __future__ import annotations

import hashlib
import hmac
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from challenge.drives.errors import Errors
from challenge.drives.oracle import GROUPS, Oracle
from challenge.drives.scene import HARD, Scene, scene
from challenge.generator.effect import UnreachableError, sized
from challenge.generator.scene import log_uniform
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Figures = dict[str, float]

KINDS = {"null": 0.15, "hard": 0.15, "single": 0.50, "pair": 0.15, "twin": 0.05}
APART_NATS = 10.0
LIMIT = {
    "time_offset": 1.0, "velocity_lag": 1.0, "lever_arm": 5.0, "gnss_frame": 0.2, "gyro_scale": 0.05,
    "accel_scale": 0.05, "misalignment": 0.1, "g_sensitivity": 5e-3, "bias_jump": 0.05,
}  # fmt: skip
"""Largest amplitudes that are still taken for the effect."""
CATALOGUE = (
    "time_offset", "velocity_lag", "lever_arm", "gnss_frame", "gyro_scale", "accel_scale", "misalignment",
    "g_sensitivity", "bias_jump", "correlated_gnss", "gnss_noise_scale", "imu_noise_scale", "gnss_outliers",
    "gnss_velocity",
)  # fmt: skip
TWINS = (
    ("time_offset", "lever_arm", "straight"), ("lever_arm", "time_offset", "straight"),
    ("correlated_gnss", "gnss_noise_scale", "city"),
    ("velocity_lag", "time_offset", "city"),
)  # fmt: skip
"""Cause, what it may be taken for, road."""
EXCLUSIVE = (
    frozenset({"correlated_gnss", "gnss_noise_scale", "gnss_outliers"}),
    frozenset({"gnss_velocity", "gnss_noise_scale"}),
    frozenset({"gyro_scale", "misalignment", "g_sensitivity", "bias_jump", "imu_noise_scale"}),
)
"""Causes of which a pair has one at most: their sizes, found one by one, would not hold together."""
AXES = ("x", "y", "z")
TURNS = ("roll", "pitch", "yaw")


@dataclass(frozen=True)
class Hidden:
    """An effect: what it does, what a finding should say, how clear it is and against what."""

    cause: str
    errors: Errors
    truth: Figures
    nats: float
    rival: str = ""
    margin: float = 0.0
    twin: str = ""


@dataclass(frozen=True)
class Item:
    """One drive before it is made."""

    name: str
    kind: str
    seed: int
    scene: Scene
    hidden: tuple[Hidden, ...]

    @property
    def errors(self) -> Errors:
        """All effects together."""
        total = Errors()
        for h in self.hidden:
            total = total.plus(h.errors)
        return total

    def truth(self) -> dict[str, object]:
        """Return the key, as plain values."""
        effects = [
            {"cause": h.cause, "axes": ["drive"], "nats": h.nats, "rival": h.rival, "margin": h.margin,
             "twin": h.twin, "parameters": {"drive": h.truth}}
            for h in self.hidden
        ]  # fmt: skip
        return {
            "name": self.name,
            "kind": self.kind,
            "seed": self.seed,
            "scene": self.scene.told(),
            "effects": effects,
        }


def item(
    secret: str, number: int, kinds: tuple[str, ...] = tuple(KINDS), reference: bool | None = None
) -> Item:
    """Make item `number` of a secret; `reference` asks for the reference profile, or for none."""
    digest = hmac.new(secret.encode(), f"drive {number}".encode(), hashlib.sha256).digest()
    seed = int.from_bytes(digest[:7], "big")
    rng = np.random.default_rng(seed)
    weights = np.array([KINDS[kind] for kind in kinds])
    kind = str(rng.choice(list(kinds), p=weights / weights.sum()))
    for _ in range(60):
        try:
            place, hidden = _filled(kind, rng, reference)
        except UnreachableError:
            continue
        return Item(digest.hex()[-12:], kind, seed, place, hidden)
    msg = f"item {number} of kind '{kind}' could not be made in 60 tries"
    raise RuntimeError(msg)


def _filled(kind: str, rng: np.random.Generator, reference: bool | None) -> tuple[Scene, tuple[Hidden, ...]]:
    if kind in ("null", "hard"):
        hard = str(rng.choice(HARD)) if kind == "hard" else ""
        return scene(rng, hard=hard, reference=reference), ()
    if kind == "twin":
        cause, twin, road = TWINS[int(rng.integers(len(TWINS)))]
        oracle = Oracle(scene(rng, road=road, reference=reference))
        made = hide(oracle, cause, log_uniform(rng, 35.0, 300.0), rng)
        return oracle.scene, (replace(made, twin=twin),)
    oracle = Oracle(scene(rng, reference=reference))
    if kind == "single":
        cause = str(rng.choice(CATALOGUE))
        return oracle.scene, (apart(oracle, hide(oracle, cause, log_uniform(rng, 3.0, 1000.0), rng)),)
    while True:
        first, second = (str(c) for c in rng.choice(CATALOGUE, 2, replace=False))
        if not any({first, second} <= group for group in EXCLUSIVE):
            break
    made = [hide(oracle, cause, log_uniform(rng, 50.0, 500.0), rng) for cause in (first, second)]
    return oracle.scene, tuple(
        apart(oracle, h, other.cause) for h, other in zip(made, reversed(made), strict=True)
    )


def apart(oracle: Oracle, hidden: Hidden, *besides: str) -> Hidden:
    """Return an effect with its rival; raise UnreachableError where a clear one cannot be told from it."""
    answer = _answer(oracle, hidden)
    if answer is None:
        return hidden
    rival, margin = oracle.rival(answer, hidden.cause, *besides)
    if hidden.nats >= 35.0 and margin < APART_NATS:
        msg = f"{hidden.cause} of {hidden.nats:.0f} nats: {rival} leaves {margin:.1f}"
        raise UnreachableError(msg)
    return replace(hidden, rival=rival, margin=margin)


def _answer(oracle: Oracle, hidden: Hidden) -> FloatArray | None:
    if hidden.cause in GROUPS:
        return oracle.mean(hidden.cause, np.array(list(hidden.truth.values())))
    if hidden.cause == "bias_jump":
        return oracle.jump(hidden.errors.jump_time, hidden.errors.jump)
    return None


def hide(oracle: Oracle, cause: str, nats: float, rng: np.random.Generator) -> Hidden:
    """Draw an effect of a wanted detectability."""
    if cause in GROUPS:
        way = rng.standard_normal(GROUPS[cause])
        way /= np.linalg.norm(way)
        answer = oracle.mean(cause, way)
        size = _bounded(cause, np.sqrt(2.0 * nats / float(answer @ answer)))
        names, errors = _mean(cause, size * way)
        return Hidden(cause, errors, dict(zip(names, (size * way).tolist(), strict=True)), nats)
    return OTHERS[cause](oracle, nats, rng)


def _bounded(cause: str, size: float) -> float:
    if size > LIMIT[cause]:
        msg = f"{cause}: {size:.3g} is more than {LIMIT[cause]}"
        raise UnreachableError(msg)
    return float(size)


def _mean(cause: str, value: FloatArray) -> tuple[tuple[str, ...], Errors]:
    """Return the names of the parameters and what they do."""
    if cause in ("time_offset", "velocity_lag"):
        return ("delay",), Errors(**{"delay" if cause == "time_offset" else "lag": float(value[0])})
    if cause == "lever_arm":
        return AXES, Errors(arm=value)
    if cause == "gnss_frame":
        return TURNS, Errors(frame=value)
    matrix = np.zeros((6, 6))
    if cause == "g_sensitivity":
        matrix[:3, 3:] = value.reshape(3, 3)
        return tuple(a + b for a in AXES for b in AXES), Errors(matrix=matrix)
    if cause == "misalignment":
        x, y, z = value
        matrix[:3, :3] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
        return TURNS, Errors(matrix=matrix)
    first = 0 if cause == "gyro_scale" else 3
    matrix[range(first, first + 3), range(first, first + 3)] = value
    return AXES, Errors(matrix=matrix)


def _jump(oracle: Oracle, nats: float, rng: np.random.Generator) -> Hidden:
    time = oracle.scene.duration * float(rng.uniform(0.25, 0.75))
    way = np.zeros(6)
    first = int(rng.choice([0, 3]))
    way[first : first + 3] = rng.standard_normal(3)
    way /= np.linalg.norm(way)
    answer = oracle.jump(time, way)
    jump = _bounded("bias_jump", np.sqrt(2.0 * nats / float(answer @ answer))) * way
    figures = dict(zip(AXES, jump[first : first + 3].tolist(), strict=True))
    return Hidden("bias_jump", Errors(jump_time=time, jump=jump), {"time": time, **figures}, nats)


def _correlated(oracle: Oracle, nats: float, rng: np.random.Generator) -> Hidden:
    memory = log_uniform(rng, max(5.0, 5.0 / oracle.scene.gnss_rate), 200.0)
    unit = oracle.scene.position_sd[0]

    def gain(size: float) -> float:
        return oracle.divergence(np.ones(2), np.ones(6), size * unit, memory)

    size, reached = sized(gain, nats, 0.05, 5.0)
    errors = Errors(markov_sd=size * unit, markov_time=memory)
    return Hidden("correlated_gnss", errors, {"sd": size * unit, "time_constant": memory}, reached)


def _fix_noise(oracle: Oracle, nats: float, rng: np.random.Generator) -> Hidden:
    which = np.array([[1, 1, 1, 0, 0, 0], [0, 0, 0, 1, 1, 1], [1, 1, 1, 1, 1, 1]])[int(rng.integers(3))]
    up = bool(rng.random() < 0.6)

    def ratios(more: float) -> FloatArray:
        return np.where(which > 0, 1.0 + more if up else 1.0 / (1.0 + more), 1.0)

    size, reached = sized(lambda more: oracle.divergence(np.ones(2), ratios(more)), nats, 0.01, 5.0)
    r = ratios(size)
    names = ("position_horizontal", "position_vertical", "velocity_horizontal", "velocity_vertical")
    figures = {n: float(x) for n, x, w in zip(names, r[[0, 2, 3, 5]], which[[0, 2, 3, 5]], strict=True) if w}
    return Hidden("gnss_noise_scale", Errors(fixes=r), figures, reached)


def _unit_noise(oracle: Oracle, nats: float, rng: np.random.Generator) -> Hidden:
    sensor = int(rng.random() < 0.3)

    def ratios(more: float) -> FloatArray:
        return np.where(np.arange(2) == sensor, 1.0 + more, 1.0)

    size, reached = sized(lambda more: oracle.divergence(ratios(more), np.ones(6)), nats, 0.05, 20.0)
    figures = {("gyro", "accel")[sensor]: 1.0 + size}
    return Hidden("imu_noise_scale", Errors(noise=ratios(size)), figures, reached)


def _outliers(oracle: Oracle, nats: float, rng: np.random.Generator) -> Hidden:
    fixes, share = len(oracle.times), np.sqrt(oracle.weights(0))
    count, size, reached = _counted(fixes, 0.05, nats, (5.0, 50.0), lambda r, s: _shell(r, share * s), rng)
    errors = Errors(outliers=count, outlier_size=size)
    return Hidden("gnss_outliers", errors, {"fraction": count / fixes}, reached)


def _velocities(oracle: Oracle, nats: float, rng: np.random.Generator) -> Hidden:
    fixes, share = len(oracle.times), oracle.weights(3)
    unit = float(np.mean(oracle.reported[3:] ** -2.0)) ** -0.5
    count, size, reached = _counted(
        fixes, 0.3, nats, (8.0, 200.0), lambda r, s: _spread(r, 1.0 + share * s * s / 3.0), rng
    )
    errors = Errors(wrong=count, wrong_rms=size * unit)
    return Hidden("gnss_velocity", errors, {"fraction": count / fixes, "rms": size * unit}, reached)


def _shell(r: FloatArray, reach: float) -> FloatArray:
    """Return ln of the density at distance r about a point at `reach` in an unknown direction over that about 0."""
    x = reach * r
    return np.asarray(-0.5 * reach**2 + x + np.log(-np.expm1(-2.0 * x) / (2.0 * x)))


def _spread(r: FloatArray, variance: float) -> FloatArray:
    """Return ln of the density of a wider normal law at distance r over that of variance one."""
    return np.asarray(0.5 * r * r * (1.0 - 1.0 / variance) - 1.5 * np.log(variance))


def _counted(
    fixes: int,
    most: float,
    nats: float,
    bounds: tuple[float, float],
    excess: Callable[[FloatArray, float], FloatArray],
    rng: np.random.Generator,
) -> tuple[int, float, float]:
    """Draw how many fixes are wrong and return it with the size that has the wanted detectability, and that.

    A fix is a mixture of a normal law in three dimensions and one with the log ratio `excess` of densities to
    it; the gain of a fix is the divergence of the mixture from the normal law.
    """
    r = np.exp(np.linspace(-6.0, 7.0, 4001))
    good = np.log(4.0 * np.pi) + 2.0 * np.log(r) - 0.5 * r * r - 1.5 * np.log(2.0 * np.pi)

    def gain(count: int, size: float) -> float:
        share = count / fixes
        ratio = np.logaddexp(np.log1p(-share), np.log(share) + excess(r, size))
        return fixes * float(np.trapezoid(np.exp(good + ratio) * ratio * r, np.log(r)))

    counts = np.unique(np.geomspace(1.0, max(most * fixes, 1.0), 40).astype(int))
    able = [int(n) for n in counts if gain(int(n), bounds[0]) < nats < gain(int(n), bounds[1])]
    if not able:
        msg = f"{nats:.1f} nats cannot be had with fixes off by {bounds[0]} … {bounds[1]} sds"
        raise UnreachableError(msg)
    count = able[int(rng.integers(len(able)))]
    return count, *sized(lambda size: gain(count, size), nats, *bounds)


OTHERS: dict[str, Callable[[Oracle, float, np.random.Generator], Hidden]] = {
    "bias_jump": _jump,
    "correlated_gnss": _correlated,
    "gnss_noise_scale": _fix_noise,
    "imu_noise_scale": _unit_noise,
    "gnss_outliers": _outliers,
    "gnss_velocity": _velocities,
}
