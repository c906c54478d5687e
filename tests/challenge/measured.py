"""Known effects hidden in real recordings, and the same recordings unchanged.

``TUNER_DATA=FOLDER python tests/challenge/measured.py`` prints the table. The noise that sizes the effects is
read from the recording: white sd from the Allan deviation of 64 samples, floor from the smallest one. Codes are
dithered before an effect is added and rounded again after it, as a converter would have done.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.append(str(Path(__file__).resolve().parents[1]))

from challenge.generator.effect import Effect, Place
from challenge.generator.laws import Burst, Spikes
from challenge.generator.means import Line, Step
from challenge.generator.noise import Noise
from challenge.generator.sampling import Duplicates
from challenge.generator.scene import Scene
from challenge.generator.spectra import Vibration
from challenge.tables import table

from tuner.diagnosis import diagnose
from tuner.types.records import Record

FloatArray = NDArray[np.float64]

EFFECTS: tuple[type[Effect], ...] = (Line, Step, Burst, Spikes, Vibration, Duplicates)
NATS = 60.0


@dataclass(frozen=True)
class Recording:
    """One axis of a file: its array and column, rate (Hz), code (0 for none), effects that can be seen in it."""

    file: str
    array: str
    column: int
    rate: float
    code: float
    effects: tuple[type[Effect], ...] = EFFECTS


RECORDINGS = (
    Recording("adis16405_run1", "gyro_counts", 0, 100.0, 1.0),
    Recording("adis16405_run2", "gyro_counts", 1, 100.0, 1.0),
    Recording("galaxy_s5_static", "gyro_raw", 0, 10.0, 0.0, (Line, Step)),
)
"""A filter has taken from the last what is faster than its plateau: effects hidden there afterwards are not seen."""


def folder() -> Path | None:
    """Return the folder of the static recordings, where ``TUNER_DATA`` names one."""
    path = Path(os.environ.get("TUNER_DATA", "nowhere")) / "static"
    return path if path.is_dir() else None


def samples(recording: Recording, where: Path) -> FloatArray:
    """Return the samples of one axis."""
    with np.load(where / f"{recording.file}.npz") as arrays:
        return np.asarray(arrays[recording.array][:, recording.column], dtype=float)


def seen(y: FloatArray, recording: Recording) -> Noise:
    """Return the noise of an axis as its Allan deviation shows it."""
    total = np.concatenate(([0.0], np.cumsum(y)))

    def deviation(m: int) -> float:
        return float(np.sqrt(0.5 * np.mean(np.diff(np.diff(total[::m]) / m) ** 2)))

    white = 8.0 * deviation(64)  # beyond the corner of a filter, if there is one
    floor = min(deviation(int(m)) for m in np.geomspace(10, len(y) // 30, 30))
    code = recording.code
    inner = float(np.sqrt(max(white**2 - code**2 / 12.0, 0.0)))
    return Noise(inner, 0.0, floor / 0.664, 0.0, 0.0, 0.0, 0.0, code, 0.0)


def with_effect(
    y: FloatArray, recording: Recording, effect: type[Effect] | None, seed: int = 3
) -> FloatArray:
    """Return the samples with an effect of `NATS` nats."""
    if effect is None:
        return y
    rng = np.random.default_rng(seed)
    noise = seen(y, recording)
    scene = Scene("industrial", recording.rate, len(y), 0.0, {"gyro_x": noise}, "none", {})
    felt = np.zeros(len(y))
    hidden: Any = effect.hide(Place(scene, "gyro_x", felt, rng), NATS)
    held = hidden.rows(len(y), rng)
    if held is not None:
        return y[held]
    level = float(np.mean(y))
    dithered = y - level + recording.code * rng.uniform(-0.5, 0.5, len(y))
    changed = (
        level + hidden.white(dithered, noise.white, scene, rng) + hidden.signal("gyro_x", felt, scene, rng)
    )
    return np.asarray(recording.code * np.round(changed / recording.code) if recording.code else changed)


def told(y: FloatArray, recording: Recording) -> tuple[list[str], list[str]]:
    """Return what is found in the samples of one axis, and what stays unexplained."""
    t = np.arange(len(y)) / recording.rate
    record = Record("gyro", t, 1e-3 * y[:, None], ("gyro_x",), "rad/s", 1.0 / recording.rate)
    found = diagnose(record)
    return sorted({f.cause for f in found.findings}), sorted({u.statistic for u in found.unexplained})


def main() -> None:
    """Print the table."""
    where = folder()
    if where is None:
        sys.exit("TUNER_DATA does not name a folder with recordings")
    rows = []
    for recording in RECORDINGS:
        y = samples(recording, where)
        for effect in (None, *recording.effects):
            found, left = told(with_effect(y, recording, effect), recording)
            name = f"{recording.file} {recording.array} {'xyz'[recording.column]}"
            cause = effect.cause if effect else "–"
            rows.append((name, cause, ", ".join(found) or "nothing", ", ".join(left) or "–"))
            sys.stderr.write(f"{rows[-1]}\n")
    sys.stdout.write(table(("recording", "hidden", "found", "unexplained"), rows))


if __name__ == "__main__":
    main()
