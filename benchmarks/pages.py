"""How long it takes to write the page of each command, and how large it is, as a table of docs/speed.md.

    python -m benchmarks.pages

The results are made first, by the verbs; only what comes after them is measured: figures, page, and the other files
that the command writes. The recordings are taken from the folder named by TUNER_DATA.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path

import tuner
from tuner.consistency.score_output import score_outputs
from tuner.diagnosis.drive.explained_drive import examine_drive_of
from tuner.jobs import usable
from tuner.readers.drive import read_drive
from tuner.readers.estimate import read_estimate
from tuner.report.fleet_files import write_fleet
from tuner.report.output_score_page import write_output_score
from tuner.report.result_set import write_tune_result
from tuner.report.result_views import page_of, pictures_of_drive, pictures_of_findings, pictures_of_solution
from tuner.report.solution_set import write_solution

MEGABYTE = 1e6


def works(data: Path, folder: Path) -> Iterator[tuple[str, Callable[[Path], object]]]:
    """Yield the name of each command and what writes its files into a folder."""

    def page(results: Mapping[str, object], to: Path) -> None:
        (to / "report.html").write_text(page_of(results, "a page", "a command"), encoding="utf-8")

    log, drive = data / "static/galaxy_s5_static.npz", read_drive(data / "drives/stim300_rtk_20180417.npz")
    records = tuner.read(log)
    noise = tuner.identify(records)
    yield "`identify`, galaxy_s5_static", partial(page, {"": noise})
    found = tuner.diagnose(records)
    yield (
        "`diagnose`, galaxy_s5_static",
        partial(page, {"found": found, "shown": lambda: pictures_of_findings(records, found)}),
    )
    examined = examine_drive_of(drive, "stim300")
    yield (
        "`diagnose`, stim300_rtk_20180417",
        partial(page, {"found": examined.diagnosis, "shown": lambda: pictures_of_drive(examined)}),
    )
    run = tuner.navigate(drive, "stim300")
    yield (
        "`navigate`, stim300_rtk_20180417",
        partial(page, {"scores": run, "shown": lambda: pictures_of_solution(run, drive)}),
    )
    write_solution(run, drive, folder)
    estimate = read_estimate(folder / "solution.csv")
    score = score_outputs([estimate], [estimate])
    yield "`score`, its solution", lambda to: write_output_score(score, {}, to)
    yield "`check`, mpu9250", partial(page, {"": tuner.check("mpu9250", runs=10)})
    yield "`compare`, adis16465 mpu9250", partial(page, {"": tuner.compare("adis16465", "mpu9250")})
    yield "`choose`", partial(page, {"": tuner.choose()})
    yield "`curve`, galaxy_s5_static", partial(page, {one.name: tuner.curve(one, "oadev") for one in records})
    yield "`plan`, galaxy_s5_static", partial(page, {"": tuner.plan(noise, hours=1.0, accuracy=0.1)})
    units_of_fleet = tuner.fleet(sorted((data / "static").glob("adis16405_run*.npz")))
    yield "`fleet`, three logs of 2.8 h", lambda to: write_fleet(units_of_fleet, to)
    for name, inputs in (
        ("`tune --drive`, stim300_rtk_20180417", {"drive": data / "drives/stim300_rtk_20180417.npz"}),
        ("`tune`, sample.ulg", {"log": data / "logs/sample.ulg"}),
        ("`tune`, adis16405_run1", {"log": data / "static/adis16405_run1.npz"}),
    ):
        result = tuner.tune(**inputs)
        yield name, partial(write_tune_result, result)


def main() -> None:
    """Print the table."""
    data = Path(os.environ.get("TUNER_DATA", ""))
    if not (data / "static").is_dir():
        sys.exit("TUNER_DATA names no folder with recordings")
    print(f"{usable()} processors.\n\n| page of | wall, s | processor, s | page, MB |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, write) in enumerate(works(data, Path(folder))):
            place = Path(folder) / str(number)
            place.mkdir()
            begin, before = time.perf_counter(), sum(os.times()[:4])
            write(place)
            wall, processor = time.perf_counter() - begin, sum(os.times()[:4]) - before
            (page,) = place.glob("*.html")
            size = page.stat().st_size / MEGABYTE
            print(f"| {name} | {wall:.2f} | {processor:.2f} | {size:.1f} |", flush=True)


if __name__ == "__main__":
    main()
