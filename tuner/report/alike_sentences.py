"""Sentences about several axes that differ in their numbers alone become one sentence with ranges."""

from __future__ import annotations

import re
from collections.abc import Iterable

from tuner.formats.axis_words import axes_text

NUMBER = re.compile(r"(?<![\w.])[-+\u2212]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
"""A number that stands alone, as it is written in a sentence."""


def alike_sentences(pairs: Iterable[tuple[str, str]]) -> list[str]:
    """Return each sentence once, behind the axes it is about; numbers that differ are stated from least to largest.

    Parameters
    ----------
    pairs : iterable of (str, str)
        Sentence and axis.
    """
    alike: dict[tuple[str, ...], list[tuple[list[str], str]]] = {}
    for text, axis in pairs:
        stated = alike.setdefault(tuple(NUMBER.split(text)), [])
        if (one := (NUMBER.findall(text), axis)) not in stated:
            stated.append(one)
    answer = []
    for words, stated in alike.items():
        ranges = [_range(column) for column in zip(*(numbers for numbers, _ in stated), strict=True)]
        text = "".join(part for pair in zip(words, [*ranges, ""], strict=True) for part in pair)
        answer.append(f"{axes_text(list(dict.fromkeys(axis for _, axis in stated)))}: {text}")
    return answer


def _range(numbers: Iterable[str]) -> str:
    every = sorted(dict.fromkeys(numbers), key=lambda text: float(text.replace("\u2212", "-")))
    return every[0] if len(every) == 1 else f"{every[0]} to {every[-1]}"
