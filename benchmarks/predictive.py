"""How well the settings written for a recording predict it: every axis of every recording, whole and in parts.

    TUNER_DATA=FOLDER python benchmarks/predictive.py

Each recording below FOLDER/static is cut to its still parts and taken whole and as thirds of an hour. A row counts axes
of such a cut: how many settings come from the identified terms (the others from the Allan curve), how many predict the
curve (95 % of the deviations within 0.8 ... 1.25, all within 0.7 ... 1.4, from ten samples to T/30) and the errors of
forecasts over 10, 60 and 300 s, and the worst of both. The last table takes settings from the first half of a recording
to its second half: noise differs from hour to hour, and nothing is promised there.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tuner.identification import identify
from tuner.identification.predictive.criteria import follows_curve
from tuner.identification.predictive.measured_allan import measured_allan
from tuner.readers import read
from tuner.segments.conditions import at_rest
from tuner.synthesis import synthesize
from tuner.synthesis.prediction import hold_to_records
from tuner.types.prediction import BlockSource, PredictedBlock
from tuner.types.records import DataError, Record

OPTIONS = {"stim300_static": {"rate": 125.0}}
"""What a file does not state of itself."""
TWENTY_MINUTES = 1200.0


def recordings(folder: Path) -> Iterator[tuple[str, tuple[Record, ...]]]:
    """Yield the still parts of every recording that can be read as it is."""
    for path in sorted(folder.glob("*.npz")):
        try:
            yield path.stem, at_rest(read(path, **OPTIONS.get(path.stem, {})))
        except DataError as error:
            print(f"{path.stem}: left out: {error}")


def between(records: Sequence[Record], first: float, last: float) -> tuple[Record, ...]:
    """Return the part of records between two times after their start, s."""
    parts = []
    for record in records:
        low, high = (int(np.searchsorted(record.t - record.t[0], edge)) for edge in (first, last))
        segments = [(max(a, low), min(b, high)) for a, b in record.segments]
        parts.append(replace(record, segments=tuple((a, b) for a, b in segments if b - a > 64)))
    return tuple(part for part in parts if part.segments and part.segments != ((0, 0),))


def cuts(records: tuple[Record, ...]) -> Iterator[tuple[str, tuple[Record, ...]]]:
    """Yield the whole, the first 20 minutes, and the thirds of the first hour, as far as the recording goes."""
    yield "whole", records
    span = max(record.t[-1] - record.t[0] for record in records)
    if span < TWENTY_MINUTES:
        return
    for third in range(3 if span >= 3.0 * TWENTY_MINUTES else 1):
        part = between(records, third * TWENTY_MINUTES, (third + 1) * TWENTY_MINUTES)
        if part:
            yield f"minutes {20 * third} to {20 * third + 20}", part


def judged(records: tuple[Record, ...]) -> dict[str, PredictedBlock]:
    """Return how well the settings made from records predict them, by axis."""
    config = synthesize(identify(records, arma=None))
    return dict(hold_to_records(config, records)[1])


def row(name: str, found: Sequence[PredictedBlock], seconds: float) -> str:
    """Return one row of the table."""
    kept = sum(one.source is BlockSource.LIKELIHOOD for one in found)
    worst = max((one.curve.worst for one in found), key=lambda ratio: abs(np.log(ratio)))
    ratios = [f.ratio for one in found for f in one.forecasts]
    ahead = f"{min(ratios):.2f} … {max(ratios):.2f}" if ratios else "–"
    curves = sum(one.curve.passes for one in found)
    forecasts = sum(all(f.passes for f in one.forecasts) for one in found)
    return (
        f"| {name} | {len(found)} | {kept} | {curves} | {worst:.2f} | {forecasts} | {ahead} | {seconds:.0f} |"
    )


def other_half(records: tuple[Record, ...]) -> list[float]:
    """Return the worst predicted ÷ measured deviation of the second half by settings of the first, by axis."""
    middle = 0.5 * max(record.t[-1] - record.t[0] for record in records)
    first, second = between(records, 0.0, middle), between(records, middle, 2.0 * middle + 1.0)
    if not first or not second:
        return []
    settings, worst = judged(first), []
    for record in second:
        for axis in record.axes:
            measured = measured_allan(record.pieces(axis), record.interval)
            if axis in settings and measured is not None:
                predicted = settings[axis].block.allan_variance(measured.tau, record.interval)
                worst.append(follows_curve(measured, predicted).worst)
    return worst


def main() -> None:
    """Print the tables."""
    folder = Path(os.environ.get("TUNER_DATA", "")) / "static"
    if not folder.is_dir():
        sys.exit("TUNER_DATA: expected a folder with recordings in 'static', found none")
    print(
        "| recording | axes | from identified terms | predict the curve | worst ratio "
        "| predict forecasts | true ÷ predicted | s |"
    )
    print("|---|---|---|---|---|---|---|---|")
    every: list[PredictedBlock] = []
    halves: list[tuple[str, list[float]]] = []
    for name, records in recordings(folder):
        for cut, part in cuts(records):
            start = time.process_time()
            try:
                found = list(judged(part).values())
            except DataError as error:
                print(f"| {name}, {cut} | 0 | {error} |")
                continue
            if found:
                every += found
                print(row(f"{name}, {cut}", found, time.process_time() - start), flush=True)
        halves.append((name, other_half(records)))
    print(row("**all**", every, 0.0))
    print(
        "\n| settings of the first half, record of the second | axes | within 0.7 … 1.4 | median of the worst ratio |"
    )
    print("|---|---|---|---|")
    for name, worst in halves:
        if worst:
            within = sum(0.7 <= ratio <= 1.4 for ratio in worst)
            middle = float(np.exp(np.median(np.abs(np.log(worst)))))
            print(f"| {name} | {len(worst)} | {within} | {middle:.2f} |")


if __name__ == "__main__":
    main()
