"""Study of static records that tempt: how often a wrong name, silence, or a negative gain of a right one.

``python tests/challenge/beyond.py --seed ANYTHING [--number 10] [--kinds A,B] [--details]``

A record is refused where the diagnosis says in a line why it has nothing to work on.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parents[1])]

from challenge.generator import outside, outside_last, outside_more, outside_named, quiet  # noqa: E402
from challenge.generator.beyond import INTERVAL, KINDS, Made, record  # noqa: E402

from tuner.diagnosis import diagnose  # noqa: E402
from tuner.types import Diagnosis  # noqa: E402
from tuner.types.records import DataError, Record  # noqa: E402


def records(made: Made) -> list[Record]:
    """Return a record of each sensor."""
    found = []
    for sensor, unit in (("gyro", "rad/s"), ("accel", "m/s^2")):
        axes = tuple(name for name in made.axes if name.startswith(sensor))
        if not axes:
            continue
        y = np.stack([made.axes[name] for name in axes], axis=1)
        covariates = {} if made.temperature is None else {"temperature": made.temperature}
        found.append(
            Record(sensor, INTERVAL * np.arange(len(y)), y, axes, unit, INTERVAL, covariates=covariates)
        )
    return found


def judged(made: Made, diagnosis: Diagnosis) -> dict[str, bool]:
    """Return what is right and wrong about a diagnosis."""
    told = [f for f in diagnosis.findings if f.cause != "lattice" or "lattice" in made.right]
    wrong = [f for f in told if f.cause not in made.right]
    listed = {a.cause for f in wrong for a in f.alternatives}
    right = [f for f in told if f.cause in made.right]
    gains = [f.gain.nats for f in right if f.gain is not None]
    return {
        "named": bool(right),
        "shortlist": bool(right) or bool(listed & made.right),
        "wrong": any(not {a.cause for a in f.alternatives} & {*made.right, "unknown"} for f in wrong),
        "unexplained": bool(diagnosis.unexplained),
        "silent": diagnosis.quiet,
        "gain < 0": any(gain < 0.0 for gain in gains),
    }


def line(diagnosis: Diagnosis) -> str:
    """Return a diagnosis in one line."""
    found = [
        f"{f.cause}@{len(f.channels)}[{'' if f.gain is None else round(f.gain.nats)}]"
        + "".join(f"/{a.cause}:{a.score:.2g}" for a in f.alternatives)
        for f in diagnosis.findings
    ]
    return "; ".join([*found, *(f"?{u.statistic}" for u in diagnosis.unexplained)])


def say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seed", required=True, help="any text")
    parser.add_argument("--number", type=int, default=10, help="records of a kind")
    parser.add_argument(
        "--kinds",
        default="beyond",
        help="or groups: beyond, without, outside, more, last, named; with commas between",
    )
    parser.add_argument("--details", action="store_true", help="every diagnosis in one line")
    args = parser.parse_args()
    groups = {
        "beyond": KINDS,
        "without": quiet.KINDS,
        "outside": outside.KINDS,
        "more": outside_more.KINDS,
        "last": outside_last.KINDS,
        "named": outside_named.KINDS,
    }
    kinds = [kind for name in args.kinds.split(",") for kind in groups.get(name, {name: None})]
    total: dict[str, int] = defaultdict(int)
    for kind in kinds:
        count: dict[str, int] = defaultdict(int)
        seconds = []
        for number in range(args.number):
            made = record(kind, args.seed, number)
            began = time.process_time()
            try:
                diagnosis = diagnose(records(made))
            except DataError as error:
                count["refused"] += 1
                say(f"  {kind} {number}: {error}")
                continue
            seconds.append(time.process_time() - began)
            for what, so in judged(made, diagnosis).items():
                count[what] += so
            if args.details:
                say(f"  {kind} {number} d={made.nats:.0f}: {line(diagnosis)}")
        rates = ", ".join(f"{what} {many}" for what, many in count.items())
        say(f"{kind}: {args.number} sets, {rates}; {np.median(seconds or [0.0]):.1f} s")
        for what, many in count.items():
            total[what] += many
    say(
        f"all: {args.number * len(kinds)} sets, "
        + ", ".join(f"{what} {many}" for what, many in total.items())
    )


if __name__ == "__main__":
    main()
