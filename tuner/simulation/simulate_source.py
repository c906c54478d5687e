"""A simulated log or drive of a built-in grade, or of a configuration with the findings that `tune` stored in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from models.effects.static.temperature_profiles import Diurnal, Profile
from tuner.catalogue.grades import DEFAULT_RECEIVER, grade_names, load_gnss, load_grade
from tuner.catalogue.trajectories import load_trajectory
from tuner.formats import noise_yaml
from tuner.formats.customary_units import stamp
from tuner.readers.source_kind import is_file
from tuner.simulation.drive import simulate_drive
from tuner.simulation.effect_spec import PlacedEffect, within_record
from tuner.simulation.from_config import channels_of_config, drive_effects_of_config
from tuner.simulation.static import simulate
from tuner.types import FilterConfig
from tuner.types.number_ranges import Positive, Whole
from tuner.types.public import public
from tuner.types.records import DataError, Drive, Record

MIDDLE_TEMPERATURE, TEMPERATURE_SWING, TEMPERATURE_CYCLES = 25.0, 8.0, 1.5
"""Middle (°C), swing (K) and cycles in a record of the temperature that findings follow.

Chosen as the swing of a warm-up, so that slopes are as clear.
"""


@dataclass(frozen=True)
class Simulated:
    """A simulated log or drive, its ground truth, and notes on findings that could not be simulated."""

    name: str
    data: tuple[Record, ...] | Drive
    key: dict[str, Any]
    notes: tuple[str, ...] = ()


@public("simulate")
def simulate_source(
    source: str,
    *,
    trajectory: str | None = None,
    gnss: str | None = None,
    duration: Positive = 3600.0,
    rate: Positive | None = None,
    effects: Sequence[str] = (),
    seed: Whole = 0,
) -> Simulated:
    """Simulate a static log, or a drive along a trajectory with a receiver.

    Parameters
    ----------
    source : str
        Name of a built-in grade, or a noise.yaml, whose noise and findings are simulated again.
    trajectory : str, optional
        Name of a built-in trajectory; without it, a static log.
    gnss : str, optional
        Built-in receiver of a drive; default that of the configuration, or `DEFAULT_RECEIVER`.
    duration : float
        s.
    rate : float, optional
        Hz; default that of the source.
    effects : sequence of str
        Effects, as of `tuner.simulation.effect_spec`.
    seed : int
        Seed of everything random.

    Raises
    ------
    DataError
        For an unknown source, trajectory, receiver or effect.
    """
    grade = source in grade_names()
    if not grade and not is_file(source):
        raise DataError(f"{source}: expected a built-in grade ({' '.join(grade_names())}) or a noise.yaml")
    if gnss is not None and trajectory is None:
        raise DataError(f"--gnss {gnss}: expected --trajectory with it; a static log has no receiver")
    if trajectory is not None:
        motion = load_trajectory(trajectory, duration)
        if not grade:
            return _drive_of_config(
                noise_yaml.load(Path(source)), trajectory, gnss, duration, rate, tuple(effects), seed
            )
        receiver = load_gnss(gnss or DEFAULT_RECEIVER)
        drive, key = simulate_drive(
            load_grade(source), motion, receiver, rate=rate, seed=seed, effects=effects
        )
        return Simulated(source, drive, key)
    if grade:
        records, key = simulate(load_grade(source), duration=duration, rate=rate, seed=seed, effects=effects)
        return Simulated(source, records, key)
    config = noise_yaml.load(Path(source))
    channels, findings, notes = channels_of_config(config)
    findings, beyond = _within(findings, duration)
    records, key = simulate(
        channels,
        duration=duration,
        rate=rate or 1.0 / config.interval,
        seed=seed,
        effects=(*findings, *effects),
        temperature=_profile(findings, duration),
    )
    return Simulated(config.name, records, key, (*notes, *beyond))


def _within(
    findings: tuple[PlacedEffect, ...], duration: float
) -> tuple[tuple[PlacedEffect, ...], tuple[str, ...]]:
    """Return the findings that happen in a simulation of a length, s, and what is said of those that do not."""
    kept: list[PlacedEffect] = []
    beyond: dict[tuple[str, float], list[str]] = {}
    for one in findings:
        try:
            within_record(one.effect, 0.0, duration)
        except DataError:
            values = vars(one.effect)
            begins = float(values.get("time") or values.get("start") or 0.0)
            beyond.setdefault((one.effect.name, begins), []).extend(one.axes)
        else:
            kept.append(one)
    notes = tuple(
        f"{name} in {', '.join(axes)} is left out: at {stamp(begins)} s of its log, beyond the {duration:g} s simulated"
        for (name, begins), axes in beyond.items()
    )
    return tuple(kept), notes


def _profile(findings: tuple[PlacedEffect, ...], duration: float) -> Profile | None:
    """Return a temperature that rises and falls where there are findings: no transient resembles it."""
    if not findings:
        return None
    return Diurnal(MIDDLE_TEMPERATURE, TEMPERATURE_SWING, period=duration / TEMPERATURE_CYCLES)


def _drive_of_config(
    config: FilterConfig,
    trajectory: str,
    gnss: str | None,
    duration: float,
    rate: float | None,
    effects: tuple[str, ...],
    seed: int,
) -> Simulated:
    """Simulate a drive of the unit and the receiver that a configuration describes, with its findings."""
    own = config.gnss if gnss is None else None
    channels, at_rest, notes = channels_of_config(config, drive=True)
    at_rest, beyond = _within(at_rest, duration)
    findings, more = drive_effects_of_config(config, receiver=own is not None)
    drive, key = simulate_drive(
        channels,
        load_trajectory(trajectory, duration),
        own or load_gnss(gnss or DEFAULT_RECEIVER),
        rate=rate or 1.0 / config.interval,
        seed=seed,
        effects=(*findings, *effects),
        at_rest=at_rest,
        name=config.name,
    )
    return Simulated(config.name, drive, key, (*notes, *beyond, *more))
