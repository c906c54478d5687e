"""The blind challenge: effects are hidden in data, found without the key, and scored afterwards.

``python tests/challenge/run.py --items 1000 --seed 1 --out DIR [--processes 2] [--drives]``

Three steps, each a process of its own, for parts of the items: *generate* writes logs with anonymous names
and a sealed key, whose SHA-256 goes into ``manifest``; *analyse* (`answer`) sees the folder of the logs;
*score* opens the key after the answers are written, and only if its hash is the published one. Finished parts
are kept: a second run with the same arguments goes on. The tables are printed to standard output.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.append(str(HERE.parent))

from challenge.drives.files import generate as generate_drives  # noqa: E402
from challenge.drives.items import KINDS as DRIVE_KINDS  # noqa: E402
from challenge.drives.sizes import sizes  # noqa: E402
from challenge.generator.items import KINDS  # noqa: E402
from challenge.seal import generate, opened  # noqa: E402
from challenge.tables import page  # noqa: E402
from challenge.verdict import Verdict, judge  # noqa: E402

PART = 25
"""Items in a part."""


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--items", type=int, required=True)
    parser.add_argument("--seed", required=True, help="secret of the draw; any text")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--drives", action="store_true", help="drives instead of static logs")
    parser.add_argument("--reference", action="store_true", help="drives of the reference profile only")
    parser.add_argument("--kinds", default=None, help="kinds of items, with commas between")
    parser.add_argument(
        "--samples", type=int, default=None, help="samples of every record, else 3.6e5 or 1e6"
    )
    parser.add_argument(
        "--axes", type=int, choices=(1, 3, 6), help="axes of every log, where the effects allow it"
    )
    parser.add_argument("--held-out", action="store_true", help="make a second record of each sensor")
    parser.add_argument("--part", type=int, default=None, help=argparse.SUPPRESS)
    parser.add_argument("--keep-logs", action="store_true")
    parser.add_argument("--score-only", action="store_true", help="score the answers that are there")
    args = parser.parse_args(argv)
    args.kinds = args.kinds or ",".join(DRIVE_KINDS if args.drives else KINDS)
    return args


def generate_part(args: argparse.Namespace, part: int) -> None:
    """Step 1, in a process of its own (``--part``)."""
    numbers = range(part * PART, min(args.items, (part + 1) * PART))
    logs, key = args.out / "logs" / str(part), args.out / "keys" / f"{part}.json"
    kinds = tuple(args.kinds.split(","))
    if args.drives:
        published = generate_drives(
            numbers, args.seed, logs, key, kinds=kinds, reference=args.reference or None
        )
    else:
        published = generate(
            numbers, args.seed, logs, key,
            kinds=kinds, samples=args.samples, width=args.axes, held_out=args.held_out,
        )  # fmt: skip
    (args.out / "manifest" / f"{part}.sha256").write_text(published)


def finish_part(args: argparse.Namespace, argv: list[str], part: int) -> None:
    """Steps 1 and 2 for one part."""
    if (args.out / "done" / str(part)).exists():
        return
    one = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    environment = {**os.environ, **one, "PYTHONPATH": str(ROOT)}
    logs = args.out / "logs" / str(part)
    subprocess.run(
        [sys.executable, str(HERE / "run.py"), *argv, "--part", str(part)], check=True, env=environment
    )
    subprocess.run(
        [sys.executable, str(HERE / "answer.py"), str(logs), str(args.out / "answers")],
        check=True,
        env=environment,
    )
    if not args.keep_logs:
        shutil.rmtree(logs)
    (args.out / "done" / str(part)).touch()


def score(out: Path) -> list[Verdict]:
    """Step 3: open the keys and judge the answers that are there."""
    verdicts = []
    for truth in keys(out):
        answer = out / "answers" / f"{truth['name']}.json"
        if answer.exists():
            verdicts.append(judge(truth, json.loads(answer.read_text())))
    return verdicts


def keys(out: Path) -> list[dict[str, Any]]:
    """Return the keys of all parts, each if its hash is the published one."""
    manifest = sorted((out / "manifest").iterdir(), key=lambda path: int(path.stem))
    return [
        truth for hashed in manifest
        for truth in opened(out / "keys" / f"{hashed.stem}.json", hashed.read_text())
    ]  # fmt: skip


def revision() -> str:
    """Return the revision of the analysed code."""
    told = subprocess.run(
        ["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    return told.stdout.strip() or "unknown"


def main(argv: list[str] | None = None) -> int:
    """Run all steps; print the tables."""
    argv = sys.argv[1:] if argv is None else argv
    args = arguments(argv)
    for folder in ("logs", "keys", "manifest", "answers", "done"):
        (args.out / folder).mkdir(parents=True, exist_ok=True)
    if args.part is not None:
        generate_part(args, args.part)
        return 0
    parts = 0 if args.score_only else -(-args.items // PART)
    began = time.monotonic()
    with ThreadPoolExecutor(args.processes) as pool:
        for finished, _ in enumerate(pool.map(lambda part: finish_part(args, argv, part), range(parts)), 1):
            left = (time.monotonic() - began) / finished * (parts - finished)
            sys.stderr.write(f"part {finished} of {parts}, {left / 60.0:.0f} min left\n")
    extent = (
        f"drives{' of the reference profile' if args.reference else ''}, "
        if args.drives
        else f"samples {args.samples or 'mixed'}, axes {args.axes or 'mixed'}, "
    )
    about = (
        f"Seed `{args.seed}`, first {args.items} items, kinds {args.kinds}, {extent}revision `{revision()}`."
    )
    verdicts = score(args.out)
    text = page(verdicts, about)
    if args.drives and args.reference:
        text += f"\n### Sizes\n\n{sizes(keys(args.out), verdicts)}"
    (args.out / "tables.md").write_text(text)
    sys.stdout.write(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
