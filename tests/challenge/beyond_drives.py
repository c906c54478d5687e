"""Study of drives of other vehicles: clean, with effects of the catalogue, and with effects outside of it.

``python tests/challenge/beyond_drives.py --seed 31 [--number 3] [--kinds clean,single,pair,known,fresh] [--details]``

A number is one drive of each of eight vehicles. Effects outside the catalogue are of two groups: `known` holds some
that shaped the checks, `fresh` none. A wrong name is
confident where `unknown` is not beside it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parents[1])]

from challenge.answer import configured  # noqa: E402
from challenge.drives import outside  # noqa: E402
from challenge.drives.errors import Errors  # noqa: E402
from challenge.drives.files import arrays, sheets  # noqa: E402
from challenge.drives.items import CATALOGUE, EXCLUSIVE, Hidden, apart, hide  # noqa: E402
from challenge.drives.oracle import Oracle  # noqa: E402
from challenge.drives.scene import Scene  # noqa: E402
from challenge.drives.vehicles import KINDS as VEHICLES  # noqa: E402
from challenge.drives.vehicles import scene_of  # noqa: E402
from challenge.generator.effect import UnreachableError  # noqa: E402
from challenge.generator.scene import log_uniform  # noqa: E402

from tuner.diagnosis.drive import diagnose_drive  # noqa: E402
from tuner.readers.drive import read_drive  # noqa: E402
from tuner.types import Diagnosis, DriveDiagnosis, FilterConfig  # noqa: E402
from tuner.types.records import DataError, Drive  # noqa: E402

STUDIES = ("clean", "single", "pair", "known", "fresh")
UNKNOWN = "unknown"
MIN_DELAY_LEFT = 0.5
"""Part of the larger of two delays that both together must leave in the velocities."""


@dataclass(frozen=True)
class Made:
    """One drive of a study: what is in it, and the names that say so."""

    study: str
    vehicle: str
    seed: int
    scene: Scene
    errors: Errors
    hidden: tuple[Hidden, ...] = ()
    outside: str = ""

    @property
    def right(self) -> frozenset[str]:
        """Names that are no wrong ones."""
        if self.outside:
            return {**outside.KINDS, **outside.FRESH}[self.outside].right
        return frozenset(h.cause for h in self.hidden)

    def __str__(self) -> str:
        effects = self.outside or " + ".join(f"{h.cause} ({h.nats:.0f} nats)" for h in self.hidden)
        return f"{self.study} {self.vehicle} {self.seed} {effects}"


def make(study: str, vehicle: str, seed: int) -> Made:
    """Draw a drive of a study; the seed and the vehicle say which."""
    column = list(VEHICLES).index(vehicle)
    rng = np.random.default_rng([seed, column, STUDIES.index(study), 77])
    scene = scene_of(rng, vehicle)
    if study in ("known", "fresh"):
        names = list(outside.KINDS if study == "known" else outside.FRESH)
        which = names[(seed * len(VEHICLES) + 7 * column) % len(names)]
        return Made(study, vehicle, seed, scene, Errors(), outside=which)
    hidden = () if study == "clean" else _hidden(Oracle(scene), 1 + (study == "pair"), rng)
    errors = Errors()
    for one in hidden:
        errors = errors.plus(one.errors)
    return Made(study, vehicle, seed, scene, errors, hidden)


def _hidden(oracle: Oracle, count: int, rng: np.random.Generator) -> tuple[Hidden, ...]:
    for _ in range(60):
        causes = [str(c) for c in rng.choice(CATALOGUE, count, replace=False)]
        if count > 1 and any(set(causes) <= group for group in EXCLUSIVE):
            continue
        try:
            drawn = [hide(oracle, cause, log_uniform(rng, 60.0, 500.0), rng) for cause in causes]
            delays = [h.errors.delay + h.errors.lag for h in drawn]
            if abs(sum(delays)) < MIN_DELAY_LEFT * max(map(abs, delays)):
                continue  # velocities late by one and early by the other: little is left of both
            return tuple(apart(oracle, h, *(c for c in causes if c != h.cause)) for h in drawn)
        except UnreachableError:
            continue
    msg = "no effect could be drawn in 60 tries"
    raise RuntimeError(msg)


def written(made: Made, folder: Path) -> tuple[Drive, FilterConfig]:
    """Return the drive and the configuration of its sheets, through files."""
    effect = {**outside.KINDS, **outside.FRESH}.get(made.outside)
    path = folder / "drive.npz"
    np.savez(path, **arrays(made.scene, made.errors, made.seed, effect))  # type: ignore[arg-type]
    for kind, text in zip(("sensor", "gnss"), sheets(made.scene), strict=True):
        (folder / f"drive.{kind}.yaml").write_text(text, encoding="utf-8")
    return read_drive(path), configured(folder / "drive.sensor.yaml")


def judged(made: Made, told: DriveDiagnosis | Diagnosis) -> dict[str, bool]:
    """Return what is right and wrong about a diagnosis."""
    others = {f.cause: {a.cause for a in f.alternatives} for f in told.findings}
    wrong = [cause for cause, beside in others.items() if cause not in made.right]
    named = made.right & {*others, *(a for beside in others.values() for a in beside)}
    return {
        "something said": bool(others) or bool(told.unexplained),
        "named": bool(made.right) and named == made.right,
        "wrong and confident": any(not others[cause] & {*made.right, UNKNOWN} for cause in wrong),
        "right name doubted": any(UNKNOWN in others[cause] for cause in made.right & others.keys()),
    }


def line(told: DriveDiagnosis | Diagnosis) -> str:
    """Return a diagnosis in one line."""
    found = [
        f"{f.cause}[{f.value:.3g}]" + "".join(f"/{a.cause}:{a.score:.2g}" for a in f.alternatives)
        for f in told.findings
    ]
    return "; ".join([*found, *(f"?{u.statistic[:70]}" for u in told.unexplained)])


def say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--number", type=int, default=1)
    parser.add_argument("--kinds", default=",".join(STUDIES), help="with commas between")
    parser.add_argument("--vehicles", default=",".join(VEHICLES), help="with commas between")
    parser.add_argument("--details", action="store_true", help="every diagnosis in one line")
    args = parser.parse_args()
    for study in args.kinds.split(","):
        count: Counter[str] = Counter()
        seconds, sets = [], 0
        for seed in range(args.seed, args.seed + args.number):
            for vehicle in args.vehicles.split(","):
                made = make(study, vehicle, seed)
                sets += 1
                with tempfile.TemporaryDirectory() as folder:
                    drive, config = written(made, Path(folder))
                    began = time.process_time()
                    try:
                        told = diagnose_drive(drive, config)
                    except DataError as error:
                        count["refused"] += 1
                        say(f"  {made}: {error}")
                        continue
                seconds.append(time.process_time() - began)
                verdict = judged(made, told)
                count.update(what for what, so in verdict.items() if so)
                if args.details:
                    flaws = "WRONG " if verdict["wrong and confident"] else ""
                    say(f"  {flaws}{made} {seconds[-1]:.0f} s: {line(told)}")
        rates = ", ".join(f"{what} {many}" for what, many in count.items())
        say(f"{study}: {sets} drives, {rates}; {np.median(seconds):.1f} s, at most {max(seconds):.0f} s")


if __name__ == "__main__":
    main()
