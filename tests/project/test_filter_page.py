"""The equations of the filter stand beside code that exists, and the page has all of the model that the filter uses."""

from __future__ import annotations

import importlib
import inspect
import re
from pathlib import Path

import numpy as np

from models.earth import radii
from models.error_state import coupling
from tuner.navigation import reference_filter

PAGE = (Path(__file__).resolve().parents[2] / "docs/filter.md").read_text(encoding="utf-8")
NAMED = re.findall(r"`((?:models|tuner)\.[\w.]+\.\w+)`", PAGE)


def test_every_function_that_the_page_names_exists():
    """The name of a function that is renamed or moved stays on a page unless something looks."""
    modules = {"tuner.navigation.reference_filter", "tuner.navigation.engine"}
    functions = [name.rpartition(".") for name in NAMED if name not in modules]
    assert len(functions) > 30
    for module, _, name in functions:
        assert inspect.isfunction(getattr(importlib.import_module(module), name, None)), f"{module}.{name}"


def test_every_equation_of_the_model_that_the_filter_calls_is_on_the_page():
    """What the readable filter imports from error model, mechanisation, sensor errors, measurements."""
    used = {
        f"{own.__module__}.{name}"
        for name, own in vars(reference_filter).items()
        if inspect.isfunction(own) and own.__module__.startswith("models.")
    }
    assert len(used) > 10
    assert used <= set(NAMED)


def test_every_equation_has_its_code():
    """Labels of the formulas, (1a) and so on, and those that the tables explain."""
    blocks = "\n".join(line for line in PAGE.splitlines() if line.startswith("    "))
    labels = set(re.findall(r" \((\d[a-z])\)$", blocks, flags=re.MULTILINE))
    explained = set(re.findall(r"\((\d[a-z])\)", "\n".join(re.findall(r"^\|.*", PAGE, flags=re.MULTILINE))))
    between = {"1b"}  # (1a) to (1c)
    assert len(labels) > 15
    assert labels == explained | between


def test_the_matrices_of_the_page_are_those_of_the_code():
    """F_rr and F_φv (2c), entry by entry as printed, at 48° north, 300 m, with all three velocities."""
    lat, height, (north, east, down) = 0.84, 300.0, (12.0, -7.0, 1.5)
    meridian, normal = radii(np.sin(lat))
    at = {
        "m": meridian + height, "k": normal + height, "t": np.tan(lat),
        "v_N": north, "v_E": east, "v_D": down,
    }  # fmt: skip
    first = PAGE.splitlines().index(next(line for line in PAGE.splitlines() if "F_rr = (" in line)) - 1
    rows = np.array([_entries(line, at) for line in PAGE.splitlines()[first : first + 3]])
    f_rr, _, _, _, f_av, _ = coupling((lat, 0.1, height), (north, east, down))
    np.testing.assert_allclose(rows, np.hstack([f_rr, f_av]), rtol=1e-12)


def _entries(line, at):
    """Numbers of a row of two matrices with entries such as `v_E t/k`, `−(v_N t + v_D)/k`, `0`."""
    words = re.split(r"\s{2,}", re.sub(r"F_\S+ =|\(2c\)", "", line).strip())
    balanced = [
        w[1:] if w.count("(") > w.count(")") else w.rstrip(")") if w.count(")") > w.count("(") else w
        for w in words
    ]
    return [eval(re.sub(r"(?<=\w) (?=t\b)", "*", w.replace("−", "-")), {}, at) for w in balanced]
