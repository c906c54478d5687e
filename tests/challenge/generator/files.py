"""Arrays of a log from a challenge item: record A to be analysed, record B of the same unit held out."""

from __future__ import annotations

from typing import Any

import numpy as np
from challenge.generator.items import Item
from numpy.typing import NDArray

RECORDS = {"a": 0, "b": 1}
EVENTS = ("step", "burst", "motion", "warmup")
"""Causes that happen once: record B does not have them, but for the warm-up."""

FIRST = ("lowpass", "colour")
"""What shapes the white noise before anything else happens to it: the filter makes its own."""


def log(item: Item, record: str = "a") -> dict[str, NDArray[Any]]:
    """Return the arrays of a log: ``t``, the axes by name, ``temperature`` where there is a thermometer.

    Parameters
    ----------
    item : Item
        What to make.
    record : str
        ``a``, or ``b``: new noise, another temperature run, no events.
    """
    scene, number = item.scene, RECORDS[record]
    hidden = [h for h in item.hidden if record == "a" or h.effect.cause not in EVENTS[:3]]
    felt = scene.felt(np.random.default_rng([item.seed, number, 0]))
    rng = np.random.default_rng([item.seed, number, 1])
    for h in hidden:
        h.effect.begin(scene.samples, rng)
    arrays: dict[str, NDArray[Any]] = {}
    for axis, noise in scene.axes.items():
        mine = sorted(
            (h.effect for h in hidden if axis in h.axes), key=lambda effect: effect.cause not in FIRST
        )
        w = noise.white * rng.standard_normal(scene.samples)
        for effect in mine:
            w = effect.white(w, noise.white, scene, rng)
        y = w + noise.slow(scene.samples, scene.interval, rng)
        for effect in mine:
            y = y + effect.signal(axis, felt, scene, rng)
        if noise.step:
            y = noise.step * np.round(y / noise.step)
        for effect in mine:
            y = effect.codes(y, axis, scene)
        arrays[axis] = y
    stamps, temperature = scene.clock(), scene.read(felt, rng)
    for h in hidden:
        held = h.effect.rows(scene.samples, rng)
        if held is None:
            continue
        if len(held) < scene.samples:
            stamps, temperature = stamps[held], temperature[held]
            arrays = {name: y[held] for name, y in arrays.items()}
        else:
            arrays |= {name: arrays[name][held] for name in h.axes}
    for h in hidden:
        stamps = h.effect.stamps(stamps, scene, rng)
    out: dict[str, NDArray[Any]] = {"t": stamps, **arrays}
    if scene.profile != "none":
        out["temperature"] = temperature
    return out
