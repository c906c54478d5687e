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
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = sorted(path for room in ("models", "tuner") for path in (ROOT / room).rglob("*.py"))

PRIVATE = {
    r"told": "known, given, reported, distinguished",
    r"asked|asks": "estimated, needed, requested",
    r"held(?![ _-]out)": "identifiable, constant, kept",
    r"leaning|leans|upright": "errors-in-variables bias",
    r"loud|louder|loudest|loudness": "local variance, larger, noisier",
    r"driven(?! by)|driving(?![ -](noise|density|variance|white|force))": "after a drive, in motion",
    r"lanes?|straighten(ed)?": "columns",
    r"ow(ed|ing|es)": "widened",
    r"doubts?|doubtful": "uncertainty, warning",
    r"passages?": "filter run",
    r"fly|flies|flown|flying": "run, simulate",
    r"belief|beliefs|believe|believes|believed": "configuration, hypothesis, as configured",
    r"polished?|polishing": "refit",
    r"hygiene": "data quality",
    r"hops?|hopping": "switching",
    r"fates?": "handling of terms",
    r"criticis\w+|criticism": "search for causes, test",
    r"(?<!false )(?<!false-)alarms?": "test result, rejection",
    r"leftovers?": "residual misfit",
    r"humps?": "resonance, peak",
    r"remade": "from configuration",
    r"yielding": "mount tilt",
    r"stillness": "stationary",
    r"swallow(s|ed)?": "absorb",
    r"demands?": "noise-scale estimate",
}
"""Words of this code alone and what the field says instead; each is matched as a whole part of a name or a sentence."""

PATTERN = re.compile(rf"\b(?:{'|'.join(PRIVATE)})\b")

ALLOWED: dict[str, tuple[str, ...]] = {
    # Keys of the files that users keep: they do not change.
    "tuner/formats/configuration.py": ("fates",),
    "tuner/formats/noise_yaml.py": ("fates",),
    "tuner/formats/diagnosis.py": ("asked", "demands"),
}
"""Words that are right in one file."""

ONE_WORD = {
    "ABSENT",
    "GATED",
    "USED",
    "WITHHELD",
    "ARCMIN",
    "ARCSEC",
    "DEG",
    "FLATTENING",
    "FOOT",
    "GAL",
    "GRAVITY",
    "HOUR",
    "KNOT",
    "LEVEL",
    "MGAL",
    "PHI",
    "THETA",
}
"""Numbers whose one word says all: units, gravity, level of an interval, ARMA coefficients, codes of a fix's use."""


def words_of(text: str) -> str:
    """Return a text in lower case; names in snake case and in camel case come apart into words."""
    apart = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", text)
    return apart.replace("_", " ").lower()


def private_words(text: str) -> list[str]:
    """Return the private words in a text."""
    return [match.group() for match in PATTERN.finditer(words_of(text))]


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


def is_number(node: ast.expr | None) -> bool:
    """Return whether an expression is a number, a sum or product of numbers, or a function of numpy or math of them."""
    match node:
        case ast.Constant(value=value):
            return isinstance(value, int | float) and not isinstance(value, bool)
        case ast.UnaryOp(operand=operand):
            return is_number(operand)
        case ast.BinOp(left=left, right=right):
            return is_number(left) and is_number(right)
        case ast.Call(args=args):
            return bool(args) and all(map(is_number, args))
    return False


def one_word_constants(path: Path) -> list[str]:
    """Return the numbers of a file whose names are one word, which says no quantity."""
    found = []
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign):
            continue
        target = node.targets[0] if isinstance(node, ast.Assign) else node.target
        several = isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
        pairs = zip(target.elts, node.value.elts, strict=True) if several else [(target, node.value)]
        for name, value in pairs:
            if isinstance(name, ast.Name) and is_number(value):
                plain = name.id.strip("_")
                if plain.isupper() and "_" not in plain and len(plain) > 2 and plain not in ONE_WORD:
                    found.append(f"{node.lineno}: {name.id}")
    return found


def without_first_line(path: Path) -> list[str]:
    """Return the public functions and classes of a file, and the file itself, that have no first line."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = [
        node
        for parent in ast.walk(tree)
        if isinstance(parent, ast.Module) or (isinstance(parent, ast.ClassDef) and parent.name[0] != "_")
        for node in parent.body
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_")
    ]
    overloads = {
        node for node in nodes for d in node.decorator_list if isinstance(d, ast.Name) and d.id == "overload"
    }
    missing = [] if ast.get_docstring(tree) else ["the module"]
    return missing + [node.name for node in nodes if not ast.get_docstring(node) and node not in overloads]


def listed(check: Callable[[Path], list[str]], paths: list[Path]) -> list[str]:
    """Return what a check finds in files, as FILE:LINE: WHAT."""
    return [f"{path.relative_to(ROOT)}:{entry}" for path in paths for entry in check(path)]


def test_the_words_are_those_of_the_field() -> None:
    assert listed(found_in, FILES) == []


def test_constants_say_their_quantity() -> None:
    assert listed(one_word_constants, FILES) == []


def test_everything_public_has_a_first_line() -> None:
    assert listed(without_first_line, FILES) == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("what the filter is told", ["told"]),
        ("MarkovFate", ["fate"]),
        ("_asked_for", ["asked"]),
        ("a held-out part, driven by white noise, without a false alarm", []),
    ],
)
def test_a_word_is_seen_in_names_and_sentences(text: str, words: list[str]) -> None:
    assert private_words(text) == words


@pytest.mark.parametrize(
    ("source", "names"),
    [
        ("MOST = 4\n", ["1: MOST"]),
        ("NEAR, FAR_AWAY = 4.0, -1.0\n", ["1: NEAR"]),
        ("DRIFT = np.radians(3.0)\n", ["1: DRIFT"]),
        ("MAX_BURSTS = 4\nGRAVITY = 9.8\nTABLE = {}\n", []),
    ],
)
def test_a_number_of_one_word_is_seen(source: str, names: list[str], tmp_path: Path) -> None:
    (tmp_path / "constants.py").write_text(source)
    assert one_word_constants(tmp_path / "constants.py") == names
