"""Statements per room stay within the budgets of pyproject.toml: who needs more takes it from another room."""

from __future__ import annotations

import ast
import tomllib
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]
SLACK = 25
"""Statements below its budget from which a room's budget is to be lowered."""


def statements(path: Path) -> int:
    """Return the statements of a module; docstrings and imports are none, layout and comments change nothing."""
    found = 0
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.stmt) and not isinstance(node, ast.Import | ast.ImportFrom):
            text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
            found += not (text and isinstance(node.value.value, str))
    return found


def room_of(path: Path) -> str:
    """Return the room of a module: a folder of `tuner`, of its diagnosis, `tuner` itself, or a top folder."""
    parts = path.relative_to(ROOT).parts
    if parts[0] != "tuner":
        return parts[0]
    depth = 3 if parts[1] == "diagnosis" else 2
    return "/".join(parts[: min(depth, len(parts) - 1)])


def test_every_room_keeps_its_budget() -> None:
    budgets = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["budgets"]
    sizes: Counter[str] = Counter()
    for top in ("models", "tuner", "tests", "examples"):
        for path in sorted((ROOT / top).rglob("*.py")):
            if path.parent == ROOT / "tests/cases":  # recordings, counted by nobody
                continue
            sizes[room_of(path)] += statements(path)
    assert sizes.keys() == budgets.keys()
    over = {room: f"{n} of {budgets[room]}" for room, n in sizes.items() if n > budgets[room]}
    assert not over, f"over budget, statements: {over}"
    loose = {room: n for room, n in sizes.items() if n < budgets[room] - SLACK}
    assert not loose, f"lower these budgets in pyproject.toml to: {loose}"


def test_few_modules_lie_outside_the_rooms() -> None:
    loose = {path.stem for path in (ROOT / "tuner").glob("*.py")} - {"__init__", "__main__"}
    assert len(loose) <= 8, sorted(loose)
