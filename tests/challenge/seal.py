"""Step 1: generate logs without hints; the ground truth lies elsewhere, its hash is published beforehand."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
from challenge.generator.files import log
from challenge.generator.items import KINDS, item


def generate(
    numbers: range,
    secret: str,
    logs: Path,
    keys: Path,
    *,
    kinds: tuple[str, ...] = tuple(KINDS),
    samples: int | None = None,
    width: int | None = None,
    held_out: bool = False,
) -> str:
    """Write the logs of some items, and their key.

    Parameters
    ----------
    numbers : range
        Items to make.
    secret : str
        Seeds are its HMACs of the numbers.
    logs, keys : Path
        Folder of ``NAME.npz`` (and ``NAME.b.npz``), and the file of the key, which is not to lie in it.
    kinds, samples, width
        As in `items.item`.
    held_out : bool
        Write record B too, where there is something to find.

    Returns
    -------
    str
        SHA-256 of the key.
    """
    logs.mkdir(parents=True, exist_ok=True)
    keys.parent.mkdir(parents=True, exist_ok=True)
    truths = []
    for number in numbers:
        made = item(secret, number, kinds, samples, width)
        np.savez(logs / f"{made.name}.npz", **log(made))  # type: ignore[arg-type]
        truths.append(made.truth())
        if held_out and made.hidden:
            np.savez(logs / f"{made.name}.b.npz", **log(made, "b"))  # type: ignore[arg-type]
    return sealed(truths, keys)


def sealed(truths: list[dict], keys: Path) -> str:
    """Write a key and return its SHA-256."""
    text = json.dumps(truths, indent=1, default=float)
    keys.write_text(text)
    return digest(text)


def digest(text: str) -> str:
    """Return the SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def opened(keys: Path, published: str) -> list[dict]:
    """Return the key, if it is the one whose hash was published.

    Raises
    ------
    ValueError
        Where it is not.
    """
    text = keys.read_text()
    if digest(text) != published:
        msg = f"{keys} is not the key whose hash was published: {digest(text)} ≠ {published}"
        raise ValueError(msg)
    return list(json.loads(text))
