"""The words of the code: the field's terms in names, docstrings, comments and messages, constants that say a quantity.

The project keeps a list of words that once stood for something in this code alone, each with the field's term; none
of them comes back. A constant of one word (`MOST`, `CLOSE`) does not say what it is the most of. Every module and
every public function begins with a line that says what it does.
"""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = sorted(path for room in ("models", "tuner") for path in (ROOT / room).rglob("*.py"))
NAMES = [str(path.relative_to(ROOT)) for path in FILES]

PRIVATE = {
    r"told": "known, given, reported, distinguished",
    r"asked|asks": "estimated, needed, requested",
    r"held(?![ _-]out)": "identifiable, constant, kept",
    r"leaning|leans|upright": "errors-in-variables bias",
    r"loud|louder|loudest|loudness": "local variance, larger, noisier",
    r"driven|driving(?!_density|[ _-](noise|density|white|force))": "after a drive, in motion",
    r"lanes?|straighten(ed)?": "columns",
    r"ow(ed|ing|es)": "widened",
    r"doubts?|doubtful": "uncertainty, warning",
    r"passages?": "filter run",
    r"fly|flies|flown|flying|flights?": "run, simulate",
    r"belief|beliefs|believe|believes|believed": "configuration, hypothesis, as configured",
    r"polished?|polishing": "refit",
    r"hygiene": "data quality",
    r"hops?|hopping": "switching",
    r"fates?": "handling of terms",
    r"criticis\w+|criticism": "search for causes, test",
    r"alarms?": "test result, rejection",
    r"leftovers?": "residual misfit",
    r"humps?": "resonance, peak",
    r"remade": "from configuration",
    r"yielding": "mount tilt",
    r"stillness": "stationary",
    r"honest|honestly": "consistent",
    r"swallow(s|ed)?": "absorb",
    r"demands?": "noise-scale estimate",
}
"""Words of this code alone and what the field says instead; each is matched as a whole part of a name or a sentence."""

ALLOWED: dict[str, tuple[str, ...]] = {}
"""Words that are right in one file, with the reason in a comment beside them."""

ONE_WORD = {
    "ALIASES",
    "AXES",
    "CAUSES",
    "COLUMNS",
    "COMMANDS",
    "DIALECTS",
    "EFFECTS",
    "ESTIMATORS",
    "FORMAT",
    "FRAMES",
    "GRAVITY",
    "KINDS",
    "LEVEL",
    "METHODS",
    "PARAMETERS",
    "REGISTRY",
    "SCHEMA",
    "SYMBOLS",
    "TERMS",
    "TITLES",
    "TRAJECTORIES",
    "UNITS",
}
"""Constants of one word that name a table or a quantity by itself."""

SNAKE = re.compile(r"[^a-z0-9]+")


def words_of(text: str) -> str:
    """Return a text in lower case; names in snake case and in camel case come apart into words."""
    apart = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", text)
    return apart.replace("_", " ").lower()


def private_words(text: str) -> list[str]:
    """Return the private words in a text."""
    plain = words_of(text)
    return [m.group() for pattern in PRIVATE for m in re.finditer(rf"\b(?:{pattern})\b", plain)]


def pieces(source: str) -> Iterator[tuple[int, str]]:
    """Yield line and text of every name, string and comment."""
    kinds = {tokenize.NAME, tokenize.STRING, tokenize.COMMENT}
    if hasattr(tokenize, "FSTRING_MIDDLE"):
        kinds.add(tokenize.FSTRING_MIDDLE)
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type in kinds:
            yield token.start[0], token.string


def found_in(path: Path) -> list[str]:
    """Return the private words of a file as LINE: WORD."""
    allowed = ALLOWED.get(str(path.relative_to(ROOT)), ())
    return [
        f"{line}: {word}"
        for line, text in pieces(path.read_text(encoding="utf-8"))
        for word in private_words(text)
        if word not in allowed
    ]


def one_word_constants(path: Path) -> list[str]:
    """Return the constants of a file that are one word and no public name of a table."""
    found = []
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        for target in targets:
            for name in ast.walk(target) if isinstance(node, ast.Assign | ast.AnnAssign) else ():
                if isinstance(name, ast.Name) and re.fullmatch(r"_?[A-Z][A-Z0-9]*", name.id):
                    number = isinstance(
                        node.value, ast.Constant | ast.UnaryOp | ast.BinOp | ast.Call | ast.Tuple
                    )
                    if number and name.id.strip("_") not in ONE_WORD and len(name.id.strip("_")) > 1:
                        found.append(f"{node.lineno}: {name.id}")
    return found


def without_first_line(path: Path) -> list[str]:
    """Return the public functions and classes of a file, and the file itself, that have no first line."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = [
        node
        for parent in ast.walk(tree)
        if isinstance(parent, ast.Module | ast.ClassDef)
        for node in parent.body
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_")
    ]
    overloads = {
        node for node in nodes for d in node.decorator_list if isinstance(d, ast.Name) and d.id == "overload"
    }
    missing = [] if ast.get_docstring(tree) else ["the module"]
    return missing + [node.name for node in nodes if not ast.get_docstring(node) and node not in overloads]


@pytest.mark.parametrize("path", FILES, ids=NAMES)
def test_the_words_are_those_of_the_field(path: Path) -> None:
    assert found_in(path) == []


@pytest.mark.parametrize("path", FILES, ids=NAMES)
def test_constants_say_their_quantity(path: Path) -> None:
    assert one_word_constants(path) == []


@pytest.mark.parametrize("path", FILES, ids=NAMES)
def test_everything_public_has_a_first_line(path: Path) -> None:
    assert without_first_line(path) == []
