"""Sentences about several axes that differ in their numbers alone become one sentence with ranges."""

from __future__ import annotations

import re
from collections.abc import Iterable

from tuner.formats.axis_words import axes_text
from tuner.formats.grouping import gathered

_ALONE = r"[-+\u2212]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
NUMBER = re.compile(rf"(?<![\w.]){_ALONE}(?: ± {_ALONE}| \({_ALONE} … {_ALONE}\))?")
"""A number that stands alone, as it is written in a sentence, with its interval."""


def alike_sentences(pairs: Iterable[tuple[str, str]]) -> list[str]:
    """Return each sentence once, behind the axes it is about, with numbers that differ from least to largest.

    Parameters
    ----------
    pairs : iterable of (str, str)
        Sentence and axis.
    """
    alike = gathered(
        (tuple(NUMBER.split(text)), (NUMBER.findall(text), axis)) for text, axis in dict.fromkeys(pairs)
    )
    answer = []
    for words, stated in alike.items():
        ranges = [_range(column) for column in zip(*(numbers for numbers, _ in stated), strict=True)]
        text = "".join(part for pair in zip(words, [*ranges, ""], strict=True) for part in pair)
        answer.append(f"{axes_text(list(dict.fromkeys(axis for _, axis in stated)))}: {text}")
    return answer


def _range(numbers: Iterable[str]) -> str:
    """Return numbers from least to largest; only one that is the same everywhere keeps its interval."""
    every = list(dict.fromkeys(numbers))
    alone = sorted((one.split(" ")[0] for one in every), key=lambda text: float(text.replace("\u2212", "-")))
    return every[0] if len(every) == 1 else " to ".join(dict.fromkeys((alone[0], alone[-1])))
