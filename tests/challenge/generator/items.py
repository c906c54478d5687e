"""Which effects are hidden in which log: the composition of a challenge.

Nulls 30 % (half of them hard), single effects 40 %, pairs 15 %, triples 5 %, near misses with a stated twin
5 %, effects outside the catalogue 5 %. The detectability of singles is log-uniform from 3 to 1000 nats.
"""

from __future__ import annotations

import hashlib
import hmac
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace

import numpy as np
from challenge.generator.effect import Effect, Place, UnreachableError
from challenge.generator.laws import Burst, CrossAxis, HeavyTails, Spikes, Swelling, VarianceDrift
from challenge.generator.means import (
    Attitude,
    Bilinear,
    Chirp,
    Line,
    Motion,
    Step,
    Temperature,
    ThermalLag,
    ThreeLevels,
    Warmup,
)
from challenge.generator.sampling import Clipping, Duplicates, Lattice, Telegraph, Timing
from challenge.generator.scene import HARD, Scene, log_uniform, scene
from challenge.generator.spectra import Colour, LowPass, SecondMarkov, Vibration

KINDS = {
    "null": 0.15,
    "hard": 0.15,
    "single": 0.40,
    "pair": 0.15,
    "triple": 0.05,
    "twin": 0.05,
    "unknown": 0.05,
}
CATALOGUE: dict[type[Effect], float] = {
    Line: 1.0, Vibration: 1.0, LowPass: 1.0, Colour: 1.0, Temperature: 1.0, ThermalLag: 1.0, Warmup: 1.0,
    Step: 1.0, Telegraph: 1.0, SecondMarkov: 0.5, Spikes: 1.0, HeavyTails: 1.0, Burst: 1.0,
    VarianceDrift: 1.0, Duplicates: 1.0, Clipping: 1.0, CrossAxis: 1.0,
    Timing: 0.5, Lattice: 0.5, Attitude: 0.5, Motion: 0.5,
}  # fmt: skip
FOREIGN: tuple[type[Effect], ...] = (Chirp, Bilinear, ThreeLevels, Swelling)
TWINS: tuple[tuple[type[Effect], str], ...] = (
    (Warmup, "temperature"), (Temperature, "warmup"), (Telegraph, "gauss_markov"), (LowPass, "duplicates"),
    (HeavyTails, "spikes"), (Spikes, "heavy_tails"), (Burst, "heavy_tails"), (Step, "telegraph"),
    (Vibration, "line"),
)  # fmt: skip
APART: tuple[frozenset[str], ...] = (
    frozenset({"lowpass", "colour"}),
    frozenset({"temperature", "thermal_lag"}),
    frozenset({"heavy_tails", "spikes", "telegraph", "gauss_markov"}),
    frozenset({"lattice", "clipping", "duplicates", "timing"}),
    frozenset({"motion"}),
)
"""Causes of which a set has one at most: their sizes, found one by one, would not hold together."""


@dataclass(frozen=True)
class Hidden:
    """An effect and the axes that have it."""

    effect: Effect
    axes: tuple[str, ...]
    twin: str = ""


@dataclass(frozen=True)
class Item:
    """One data set before it is made."""

    name: str
    kind: str
    seed: int
    scene: Scene
    hidden: tuple[Hidden, ...]

    def truth(self) -> dict[str, object]:
        """Return the key, as plain values; sizes that depend on the samples are known once these are made."""
        return {
            "name": self.name,
            "kind": self.kind,
            "seed": self.seed,
            "scene": asdict(self.scene),
            "effects": [
                {
                    "cause": h.effect.cause,
                    "axes": list(h.axes),
                    "nats": h.effect.nats,
                    "twin": h.twin,
                    "parameters": {axis: h.effect.truth(axis, self.scene) for axis in h.axes},
                }
                for h in self.hidden
            ],
        }


def item(
    secret: str,
    number: int,
    kinds: tuple[str, ...] = tuple(KINDS),
    samples: int | None = None,
    width: int | None = None,
) -> Item:
    """Make item `number` of a secret; kinds in the proportions of `KINDS`.

    `samples` and `width` fix the length and the number of axes, where the effects allow it.
    """
    digest = hmac.new(secret.encode(), str(number).encode(), hashlib.sha256).digest()
    seed = int.from_bytes(digest[:7], "big")
    rng = np.random.default_rng(seed)
    weights = np.array([KINDS[kind] for kind in kinds])
    kind = str(rng.choice(list(kinds), p=weights / weights.sum()))
    for _ in range(40):
        try:
            place, hidden = _filled(kind, rng, seed, samples, width)
        except UnreachableError:
            continue
        return Item(digest.hex()[-12:], kind, seed, place, hidden)
    msg = f"item {number} of kind '{kind}' could not be made in 40 tries"
    raise RuntimeError(msg)


def _filled(
    kind: str, rng: np.random.Generator, seed: int, samples: int | None, width: int | None
) -> tuple[Scene, tuple[Hidden, ...]]:
    if kind in ("null", "hard"):
        hard = str(rng.choice(HARD)) if kind == "hard" else ""
        return scene(rng, hard=hard, samples=samples, width=width), ()
    if kind == "unknown":
        chosen: tuple[type[Effect], ...] = (FOREIGN[int(rng.integers(len(FOREIGN)))],)
        return _hide(rng, seed, chosen, lambda: log_uniform(rng, 35.0, 500.0), samples, width)
    if kind == "twin":
        effect, twin = TWINS[int(rng.integers(len(TWINS)))]
        where, hidden = _hide(
            rng, seed, (effect,), lambda: log_uniform(rng, 35.0, 300.0), samples, width, twin=twin
        )
        return where, tuple(replace(h, twin=twin) for h in hidden)
    number = {"single": 1, "pair": 2, "triple": 3}[kind]
    if number == 1:
        return _hide(rng, seed, _causes(rng, 1), lambda: log_uniform(rng, 3.0, 1000.0), samples, width)
    return _hide(rng, seed, _causes(rng, number), lambda: log_uniform(rng, 50.0, 500.0), samples, width)


def _causes(rng: np.random.Generator, number: int) -> tuple[type[Effect], ...]:
    """Draw causes that may stand together."""
    names, weights = list(CATALOGUE), np.array(list(CATALOGUE.values()))
    while True:
        at = rng.choice(len(names), number, replace=False, p=weights / weights.sum())
        chosen = tuple(names[int(i)] for i in at)
        causes = {effect.cause for effect in chosen}
        alone = number > 1 and "motion" in causes
        if not alone and all(len(causes & group) < 2 for group in APART):
            return chosen


def _hide(
    rng: np.random.Generator,
    seed: int,
    effects: tuple[type[Effect], ...],
    target: Callable[[], float],
    samples: int | None,
    width: int | None,
    *,
    twin: str = "",
) -> tuple[Scene, tuple[Hidden, ...]]:
    needs = {effect.needs for effect in effects}
    width = 6 if "accel" in needs else 3 if "triad" in needs else width
    where = scene(rng, samples=samples, width=width)
    if "temperature" in needs or "temperature" in twin:
        where = replace(where, profile=str(rng.choice(["warming", "diurnal", "chamber"])))
    if twin in ("temperature", "warmup"):
        where = replace(where, profile="warming")
    if Lattice in effects:
        where = _on_lattice(where, 0.0, tuple(where.axes))
    felt = where.felt(np.random.default_rng([seed, 0, 0]))
    hidden = []
    for effect in sorted(effects, key=lambda effect: effect is not Lattice):
        axis = "accel_y" if effect.needs == "accel" else str(rng.choice(list(where.axes)))
        made = effect.hide(Place(where, axis, felt, rng), target())
        hidden.append(Hidden(made, _axes(rng, effect, axis, where)))
        if isinstance(made, Lattice):
            where = _on_lattice(where, made.step, hidden[-1].axes)
    return where, tuple(hidden)


def _on_lattice(where: Scene, step: float, axes: tuple[str, ...]) -> Scene:
    """Return the scene with a lattice of so many white sd: what is hidden beside it is sized in its noise."""
    coarse = {name: replace(where.axes[name], step=step * where.axes[name].white) for name in axes}
    return replace(where, axes={**where.axes, **coarse})


def _axes(rng: np.random.Generator, effect: type[Effect], axis: str, where: Scene) -> tuple[str, ...]:
    """Draw which axes have an effect; `axis` first."""
    others = [name for name in where.axes if name != axis and name[:4] == axis[:4]]
    if effect.needs == "accel":
        return (axis, "accel_z")
    if effect.cause == "timing":
        return tuple(where.axes)
    if effect.alone or not others:
        return (axis,)
    if effect.shared:
        return (axis, *others)
    draw = rng.random()
    if draw < 0.6:
        return (axis,)
    return (axis, str(rng.choice(others))) if draw < 0.75 else (axis, *others)
