"""What `tuner tune --drive` makes of measured drives: clocks by configuration, and outages of the part left out.

    TUNER_DATA=FOLDER python benchmarks/drives.py [NAME …]

Each drive below FOLDER/drives. The first table has the delays of the fixes by the motion alone, with intervals
at 95 %: no configuration plays a part in them. In the second, configurations filter the drive with these clocks; the
last 40 % are scored: position with fixes (3D, against the reference where there
is one, else the fixes), and outages of 10, 30 and 60 s as error and true ÷ predicted. *began*: noise at rest, sds as
reported; *× 10*: its process noise ten times as large; *written*: by `tune --drive`. The last column is processor time
of what is written.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from models.earth import ned_between
from tuner.consistency.drive_scores import reference_at
from tuner.diagnosis.drive.config_after_drive import config_after_drive
from tuner.diagnosis.drive.explained_drive import examine_and_explain
from tuner.diagnosis.drive.held_out_choice import choose_config, with_noise_factors
from tuner.diagnosis.drive.predictive_score import PredictiveScore, configured_run, predictive_score
from tuner.diagnosis.drive.score_tests import FITTED_SHARE
from tuner.navigation.drive.clock import clock_of_drive
from tuner.navigation.drive.gross_outliers import without_gross_outliers
from tuner.readers.drive import read_drive
from tuner.synthesis.from_drive import config_of_drive, stationary_noise
from tuner.types import FilterConfig
from tuner.types.progress import silent
from tuner.types.records import DataError, Drive


def drives(folder: Path, names: list[str]) -> Iterator[Drive]:
    """Yield the drives of a folder, those with a name where names are given."""
    for path in sorted(folder.glob("*.npz")):
        if not names or path.stem in names:
            yield read_drive(path)


def raw_rms(drive: Drive, begin: float) -> float | None:
    """Return the rms error of the fixes themselves from a time on, m; None without a reference."""
    if drive.reference is None:
        return None
    late = drive.gnss.t > begin
    off = ned_between(reference_at(drive.reference, drive.gnss.t[late])[0], drive.gnss.llh[late])
    return float(np.sqrt(np.nanmean(np.sum(off**2, axis=1))))


def row(name: str, score: PredictiveScore | None, seconds: float | None = None) -> str:
    """Return one row of the second table."""
    took = "" if seconds is None else f"{seconds:.0f}"
    if score is None:
        return f"| {name} | too short, or lost | | | | {took} |"
    by = {one.seconds: f"{one.rms:.3g} m, {one.ratio:.2f}" for one in score.outages}
    cells = " | ".join(by.get(length, "–") for length in (10.0, 30.0, 60.0))
    return f"| {name} | {score.tracking_rms:.3g} | {cells} | {took} |"


def judged(drive: Drive, config: FilterConfig, begin: float) -> PredictiveScore | None:
    """Return the score of a configuration on the drive from a time on."""
    clean = replace(drive, gnss=without_gross_outliers(drive.gnss)[0])
    try:
        return predictive_score(
            configured_run(clean, config, clock_of_drive(drive)), begin, float(drive.gnss.t[-1])
        )
    except DataError:
        return None


def main() -> None:
    """Print both tables."""
    folder = Path(os.environ.get("TUNER_DATA", "")) / "drives"
    if not folder.is_dir():
        sys.exit("TUNER_DATA: expected a folder with recordings in 'drives', found none")
    clocks, scores = [], []
    for drive in drives(folder, sys.argv[1:]):
        clocks.append(f"| {drive.name} | {clock_of_drive(drive).note} |")
        t = drive.gnss.t
        begin = float(t[0] + FITTED_SHARE * (t[-1] - t[0]))
        start = time.process_time()
        began = config_of_drive(drive, stationary_noise(drive))
        examined = examine_and_explain(drive, began, progress=silent)
        choice = choose_config(drive, examined, began, config_after_drive(examined, kept=True), silent)
        took = time.process_time() - start
        raw = raw_rms(drive, begin)
        scores += [
            row(f"{drive.name}, began", judged(drive, began, begin)),
            row(
                "… process noise × 10",
                judged(drive, with_noise_factors(began, {"white": 10.0, "bias": 10.0}), begin),
            ),
            row(f"… written: {choice.kept}", judged(drive, choice.config, begin), took),
        ]
        if raw is not None:
            scores.append(f"| … fixes alone | {raw:.3g} | | | | |")
        print(clocks[-1], *scores[-4:], sep="\n", flush=True)
    print("\n| drive | clocks by the motion alone |\n|---|---|")
    print(*clocks, sep="\n")
    print("\n| drive | position, m | 10 s | 30 s | 60 s | s |\n|---|---|---|---|---|---|")
    print(*scores, sep="\n")


if __name__ == "__main__":
    main()
