"""How well the settings written for simulated logs predict them: every cause, alone and in pairs.

    python benchmarks/predictive_simulated.py [--pairs N] [--challenge N]

Logs of 40 minutes at 50 Hz with every effect of the catalogue, three of each and each pair once, sizes drawn at random
between hardly visible and obvious, and logs of the generator of the blind challenge, which shares no code with the
project. The settings are those that `tuner tune` writes, from the still parts of the log. Columns as in
`benchmarks/predictive.py`; logs that are not predicted are listed with what was hidden in them.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from predictive import judged

from models.effects import EFFECTS
from models.noise import BiasInstability, NoiseModel, RandomWalk, White
from tuner.diagnosis import diagnose
from tuner.diagnosis.static.position_drift import found_signals
from tuner.identification import identify
from tuner.jobs import each
from tuner.readers import read
from tuner.segments.conditions import at_rest
from tuner.simulation.static import simulate
from tuner.synthesis import synthesize
from tuner.synthesis.findings import without_stretches
from tuner.synthesis.prediction import hold_to_records
from tuner.types.prediction import INNER_LIMIT, BlockSource, PredictedBlock
from tuner.types.records import DataError, Record

RATE, DURATION = 50.0, 2400.0
"""Hz, s: the shortest log of which forecasts over 300 s are judged."""
SEEDS = 3
"""Logs of each single effect."""
NOISE = {
    "gyro": NoiseModel((White(1e-4), BiasInstability(2e-5), RandomWalk(1e-6))),
    "accel": NoiseModel((White(1e-3), BiasInstability(3e-4), RandomWalk(1e-5))),
}
"""An industrial MEMS unit, rad/s and m/s²."""
EXCLUSIVE = frozenset({"temperature", "thermal_lag"}), frozenset({"lattice", "clipping"})
"""Effects that change the same thing: one of them only in a log."""


@dataclass(frozen=True)
class SimulatedLog:
    """A log, what is hidden in it, and the axes that have it."""

    group: str
    name: str
    records: tuple[Record, ...]
    axes: tuple[str, ...]


def own_logs(pairs: int) -> Iterator[Callable[[], SimulatedLog]]:
    """Yield makers of logs of the project's own effects: each alone, and a number of pairs in random order."""
    codes = list(EFFECTS)
    for code in codes:
        for seed in range(SEEDS):
            yield partial(_log, "single", (code,), seed)
    every = [pair for pair in combinations(codes, 2) if frozenset(pair) not in EXCLUSIVE]
    for at in np.random.default_rng(0).permutation(len(every))[:pairs]:
        yield partial(_log, "pair", every[at], int(at))


def _log(group: str, codes: tuple[str, ...], seed: int) -> SimulatedLog:
    sensor = "accel" if "attitude" in codes else "gyro"
    triad = "cross_axis" in codes or "attitude" in codes
    axes = tuple(f"{sensor}_{letter}" for letter in ("xyz" if triad else "x"))
    effects = [code if code == "timing" else f"{code}@{'+'.join(axes)}" for code in codes]
    records, _ = simulate(
        dict.fromkeys(axes, NOISE[sensor]), duration=DURATION, rate=RATE, seed=1000 + seed, effects=effects
    )
    return SimulatedLog(group, f"{' + '.join(codes)}, seed {1000 + seed}", records, axes[:1])


def challenge_log(at: int) -> SimulatedLog:
    """Return a log of the independent generator, one axis that has an effect."""
    sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))
    from challenge.generator.files import log
    from challenge.generator.items import item

    one = item("predictive", at, ("single", "pair", "triple", "unknown"), samples=120_000, width=1)
    causes = " + ".join(hidden.effect.cause or type(hidden.effect).__name__ for hidden in one.hidden)
    axes = tuple(dict.fromkeys(axis for hidden in one.hidden for axis in hidden.axes))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "log.npz"
        np.savez(path, **log(one))
        records = read(path)
    return SimulatedLog("independent generator", f"{causes}, item {at}", records, axes[:1])


def prediction(one: SimulatedLog) -> PredictedBlock | None:
    """Return how well the settings of the first axis with the effect predict it; None where nothing is written.

    Where nothing predicts the samples as they are, what a diagnosis finds is taken out, as `tuner tune` does.
    """
    axis = one.axes[0]
    record = next(record for record in at_rest(one.records) if axis in record.axes)
    single = replace(record, y=record.column(axis)[:, None], axes=(axis,))
    found = judged((single,)).get(axis)
    if found is None or found.passes:
        return found
    diagnosis = diagnose(single, identification=identify((single,), arma=None))
    findings, resting = diagnosis.findings, without_stretches(single, diagnosis.left_out)
    settings = synthesize(identify((resting,), arma=None))
    return hold_to_records(settings, (resting,), found_signals(findings, (resting,)))[1].get(axis)


def row(group: str, found: Sequence[PredictedBlock]) -> str:
    """Return one row of the table."""
    ratio = np.concatenate([block.curve.ratio for block in found])
    ahead = np.array([f.ratio for block in found for f in block.forecasts])
    within = np.mean(np.abs(np.log(ratio)) <= np.log(INNER_LIMIT))
    kept = sum(block.source is BlockSource.LIKELIHOOD for block in found)
    curves = sum(block.curve.passes for block in found)
    forecasts = sum(all(f.passes for f in block.forecasts) for block in found)
    return (
        f"| {group} | {len(found)} | {kept} | {curves} | {100.0 * within:.1f} % "
        f"| {ratio.min():.2f} … {ratio.max():.2f} | {forecasts} "
        f"| {ahead.min():.2f} … {ahead.max():.2f} |"
    )


def outcome(make: Callable[[], SimulatedLog]) -> tuple[SimulatedLog, PredictedBlock | str | None]:
    """Return a log without its samples, and how well its settings predict it, or why it is refused."""
    one = make()
    named = replace(one, records=())
    try:
        return named, prediction(one)
    except DataError as error:
        return named, f"refused: {error}"


def failure(found: PredictedBlock | str | None) -> str | None:
    """Return where settings do not predict their log, None where they do."""
    if found is None:
        return "too short to be judged"
    if isinstance(found, str):
        return found
    ahead = ", ".join(f"{f.ratio:.2f} over {f.horizon:g} s" for f in found.forecasts if not f.passes)
    curve = "" if found.curve.passes else f"{found.curve.worst:.2f} at {found.curve.worst_tau:.3g} s"
    return "; ".join(filter(None, (curve, ahead))) or None


def main() -> None:
    """Print the table and what is not predicted."""
    options = argparse.ArgumentParser()
    options.add_argument("--pairs", type=int, default=1000, metavar="N")
    options.add_argument("--challenge", type=int, default=60, metavar="N")
    given = options.parse_args()
    makers = [*own_logs(given.pairs), *(partial(challenge_log, at) for at in range(given.challenge))]
    groups: dict[str, list[PredictedBlock]] = {}
    failures: list[str] = []
    for one, found in each(outcome, makers):
        if isinstance(found, PredictedBlock):
            groups.setdefault(one.group, []).append(found)
        if text := failure(found):
            failures.append(f"{one.name}: {text}")
    print(
        "| logs | number | from identified terms | predict the curve | points within 0.8 … 1.25 | all points "
        "| predict forecasts | true ÷ predicted |\n|---|---|---|---|---|---|---|---|"
    )
    for group, found_there in groups.items():
        print(row(group, found_there))
    print(row("**all**", [one for found_there in groups.values() for one in found_there]))
    print("\n".join(["", *(f"- {line}" for line in failures)]))


if __name__ == "__main__":
    main()
