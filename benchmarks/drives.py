"""What `tuner tune --drive` makes of measured drives: clocks by configuration, and outages of the part left out.

    TUNER_DATA=FOLDER python benchmarks/drives.py [NAME …]

Each drive below FOLDER/drives. The first table has the delays of the fixes by the motion alone, with intervals at 95
%: no configuration plays a part in them. In the second, configurations filter the drive with these clocks; the last
40 % are scored: position with fixes (3D, against the reference where there is one, else the fixes), and outages of
10, 30 and 60 s, one after another, as error and true ÷ predicted with its 95 % interval and the number of outages.
*began*: noise at rest, sds as reported; *× 10*: its process noise ten times as large; *Sage–Husa*: sds of the fixes
by the well-known adaptation to the innovations; *written*: by `tune --drive`. The last column is processor time of
what is written. The third table compares began and written in all outages of the drive, in pairs; the fourth has what
is written where every fix is moved by `MOVED_SDS` of its reported sds at random, the diagnosis kept.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from models.earth import llh_displaced
from tuner.consistency.reference_check import trusted_reference
from tuner.diagnosis.drive.config_after_drive import config_after_drive
from tuner.diagnosis.drive.configured_run import ConfiguredRun, configured_run
from tuner.diagnosis.drive.explained_drive import examine_and_explain
from tuner.diagnosis.drive.held_out_choice import HeldOutChoice, choose_config
from tuner.diagnosis.drive.held_out_gain import change_interval
from tuner.diagnosis.drive.noise_factors import with_noise_factors
from tuner.diagnosis.drive.outage_errors import OutageErrors, all_outages
from tuner.diagnosis.drive.predictive_score import PredictiveScore, predictive_score
from tuner.diagnosis.drive.score_tests import FITTED_SHARE
from tuner.examination.examined_drive import examined_drive
from tuner.formats.clock_words import clock_note
from tuner.formats.outage_words import interval_words
from tuner.navigation.data import USED, Solution
from tuner.navigation.drive.run import Stretch, navigate
from tuner.synthesis.from_drive import config_of_drive, stationary_noise
from tuner.types import FilterConfig
from tuner.types.progress import silent
from tuner.types.records import DataError, Drive

FloatArray = NDArray[np.float64]

FORGETTING = 0.98
"""Factor by which an innovation counts less with each later one: usual values are 0.95 to 0.995."""
LEAST_VARIANCE = 0.01
"""Least variance of a fix, in units of the reported: Sage and Husa's may become negative."""
ADAPTATIONS = 4
"""Runs in which the sds settle: each takes its covariances from the one before."""


MOVED_SDS = 0.003
"""Random change of fixes, in the sds that they report: millimetres, far below what a fix is off."""
MOVED_SEEDS = (1, 2)
"""Seeds of it."""


def moved(drive: Drive, seed: int) -> Drive:
    """Return a drive whose fixes are moved at random."""
    rng, gnss = np.random.default_rng(seed), drive.gnss
    off = [MOVED_SDS * sd * rng.standard_normal(sd.shape) for sd in (gnss.position_sd, gnss.velocity_sd)]
    llh = llh_displaced(gnss.llh, np.nan_to_num(off[0]))
    return replace(drive, gnss=replace(gnss, llh=llh, vel_n=gnss.vel_n + np.nan_to_num(off[1])))


def drives(folder: Path, names: list[str]) -> Iterator[Drive]:
    """Yield the drives of a folder, those with a name where names are given."""
    for path in sorted(folder.glob("*.npz")):
        if not names or path.stem in names:
            yield examined_drive(path)[0]


def adapted(run: ConfiguredRun) -> ConfiguredRun:
    """Return a run with the sds of Sage and Husa [1]_: r ← (1 − d) r + d (z² − h P hᵀ), one r for each row of a fix.

    References
    ----------
    .. [1] A. P. Sage, G. W. Husa, Adaptive filtering with unknown prior statistics, Joint Automatic Control
       Conf. (1969).
    """
    reported = [stretch.fixes.sd for stretch in run.stretches]
    for _ in range(ADAPTATIONS):
        solutions = navigate(run.stretches, run.settings, np.zeros((0, 2)))
        stretches = tuple(
            replace(s, fixes=replace(s.fixes, sd=_adapted_sds(s, solution, sd)))
            for s, solution, sd in zip(run.stretches, solutions, reported, strict=True)
        )
        run = replace(run, stretches=stretches)
    return run


def _adapted_sds(stretch: Stretch, solution: Solution, reported: FloatArray) -> FloatArray:
    spread = np.diagonal(solution.innovation_covariance, axis1=1, axis2=2)
    of_fix = (solution.innovation**2 - (spread - stretch.fixes.sd**2)) / reported**2
    taken = np.repeat(solution.use == USED, 3, axis=1)
    r, seen, out = np.ones(6), np.zeros(6), np.empty_like(reported)
    for k in range(len(reported)):
        seen += taken[k]
        weight = np.where(taken[k], (1.0 - FORGETTING) / (1.0 - FORGETTING ** (seen + 1.0)), 0.0)
        r = np.maximum((1.0 - weight) * r + weight * of_fix[k], LEAST_VARIANCE)
        out[k] = reported[k] * np.sqrt(r)
    return out


def compared(name: str, choice: HeldOutChoice) -> str:
    """Return one row of the third table."""
    cells = []
    for seconds in (10.0, 30.0, 60.0):
        pairs = choice.outages.get(seconds)
        if pairs is None:
            cells.append("–")
            continue
        (before, after), (low, high) = np.sqrt(pairs.mean(axis=0)), change_interval(pairs)
        cells.append(f"{before:.3g} → {after:.3g} ({_signed(low)} … {_signed(high)}), {len(pairs)}")
    return f"| {name} | {' | '.join(cells)} |"


def _signed(value: float) -> str:
    """Return a number with its sign, rounded to two digits."""
    return f"{float(f'{value:.2g}'):+g}".replace("-", "−")


Judged = tuple[PredictiveScore, Mapping[float, OutageErrors]]
"""Score of a part of a drive, and its outages."""


def row(name: str, found: Judged | None, seconds: float | None = None) -> str:
    """Return one row of the second table."""
    took = "" if seconds is None else f"{seconds:.0f}"
    if found is None:
        return f"| {name} | too short, or lost | | | | {took} |"
    score, outages = found
    cells = " | ".join(cell(outages.get(length)) for length in (10.0, 30.0, 60.0))
    return f"| {name} | {score.tracking_rms:.3g} | {cells} | {took} |"


def cell(one: OutageErrors | None) -> str:
    """Return error and true ÷ predicted in outages of one length, with its interval and their number."""
    if one is None or not len(one.square):
        return "–"
    return f"{one.rms:.3g} m, {one.ratio:.2f} ({interval_words(one.interval)}, {len(one.square)})"


def trusted(drive: Drive, began: FilterConfig) -> Drive:
    """Return a drive without those times of its reference at which it is wrong, as `tune --drive` judges by."""
    if drive.reference is None:
        return drive
    run = configured_run(drive, began)
    return replace(drive, reference=trusted_reference(drive.reference, run.stretches, run.settings)[0])


def judged(drive: Drive, config: FilterConfig, begin: float, *, adapt: bool = False) -> Judged | None:
    """Return the score of a configuration on the drive from a time on, by its reference."""
    try:
        run = configured_run(drive, config)
        run, end = adapted(run) if adapt else run, float(drive.gnss.t[-1])
        score = predictive_score(run, begin, end)
        outages = all_outages(run, float(drive.gnss.t[0]), end)
        return None if score is None else (score, {s: one.since(begin) for s, one in outages.items()})
    except DataError:
        return None


def main() -> None:
    """Print the tables."""
    folder = Path(os.environ.get("TUNER_DATA", "")) / "drives"
    if not folder.is_dir():
        sys.exit("TUNER_DATA: expected a folder with recordings in 'drives', found none")
    clocks, scores, outages, changes = [], [], [], []
    for drive in drives(folder, sys.argv[1:]):
        clocks.append(f"| {drive.name} | {clock_note(drive.clock)} |")
        t = drive.gnss.t
        begin = float(t[0] + FITTED_SHARE * (t[-1] - t[0]))
        start = time.process_time()
        began = config_of_drive(drive, stationary_noise(drive))
        examined = examine_and_explain(drive, began, progress=silent)
        choice = choose_config(drive, examined, began, config_after_drive(examined, kept=True), silent)
        took = time.process_time() - start
        times_ten = with_noise_factors(began, {"white": 10.0, "bias": 10.0})
        right = trusted(drive, began)
        own = [
            row(f"{drive.name}, began", judged(right, began, begin)),
            row("… process noise × 10", judged(right, times_ten, begin)),
            row("… Sage–Husa", judged(right, began, begin, adapt=True)),
            row(f"… written: {choice.kept}", judged(right, choice.config, begin), took),
        ]
        if choice.after is not None and choice.after.fixes_rms is not None:
            own.append(f"| … fixes alone | {choice.after.fixes_rms:.3g} | | | | |")
            by_all = judged(drive, choice.config, begin)
            if by_all is not None and by_all[0].fixes_rms is not None:
                own.append(row("… written, by the whole reference", by_all))
                own.append(f"| … fixes alone, by the whole reference | {by_all[0].fixes_rms:.3g} | | | | |")
            changes += [
                f"| {drive.name} | {other.kept}, {len(other.factors)} factors | {other.after.tracking_rms:.3g} | "
                f"{' | '.join(map(cell, other.late))} |"
                for seed in MOVED_SEEDS
                if (
                    other := choose_config(
                        moved(drive, seed), examined, began, config_after_drive(examined, kept=True), silent
                    )
                ).after
            ]
        outages.append(compared(drive.name, choice))
        scores += own
        print(clocks[-1], *own, outages[-1], choice.note, sep="\n", flush=True)
    print("\n| drive | clocks by the motion alone |\n|---|---|", *clocks, sep="\n")
    print("\n| drive | position, m | 10 s | 30 s | 60 s | s |\n|---|---|---|---|---|---|", *scores, sep="\n")
    print(
        "\n| fixes moved | written | position, m | 10 s | 30 s | 60 s |\n|---|---|---|---|---|---|",
        *changes,
        sep="\n",
    )
    print("\n| all outages of the drive, m | 10 s | 30 s | 60 s |\n|---|---|---|---|", *outages, sep="\n")


if __name__ == "__main__":
    main()
