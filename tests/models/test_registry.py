"""Registries: names are unique, other packages can add theirs, unknown names are refused in one line."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from models.registry import Registry, RegistryError


def shapes() -> Registry[type]:
    def check(kind: type) -> None:
        if not hasattr(kind, "corners"):
            msg = "expected an attribute 'corners'"
            raise TypeError(msg)

    return Registry("shape", "tuner.test_shapes", name_of=lambda kind: kind.__name__, check=check)


class Square:
    corners = 4


class Round:
    pass


def test_declarations_are_found_by_name_in_the_order_in_which_they_were_made() -> None:
    registry = shapes()
    triangle = type("Triangle", (), {"corners": 3})
    registry.extend((Square, triangle))
    assert list(registry) == ["Square", "Triangle"]
    assert registry["Square"] is Square
    assert registry.get("Circle") is None
    assert len(registry) == 2


def test_an_unknown_name_is_answered_in_one_line_with_the_known_and_the_likely_one() -> None:
    registry = shapes()
    registry.add(Square)
    for name in ("Sqare", "square-with-a-handle"):
        expected = rf"^unknown shape '{name}' \(did you mean 'Square'\?\); known are Square$"
        with pytest.raises(RegistryError, match=expected):
            registry[name]


def test_a_name_is_declared_once() -> None:
    registry = shapes()
    registry.add(Square)
    registry.add(Square)
    with pytest.raises(RegistryError, match="shape 'Square' is declared twice"):
        registry.add(type("Square", (), {"corners": 4}))


def test_an_incomplete_declaration_is_refused_and_not_kept() -> None:
    registry = shapes()
    with pytest.raises(RegistryError, match="shape 'Round': expected an attribute 'corners'"):
        registry.add(Round)
    assert "Round" not in registry


def test_a_declaration_can_be_temporary() -> None:
    registry = shapes()
    with registry.added(Square):
        assert "Square" in registry
    assert "Square" not in registry


def install(folder: Path, code: str) -> None:
    """Lay a package with one entry point as pip would."""
    (folder / "other_shapes.py").write_text(code)
    facts = folder / "other_shapes-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: other-shapes\nVersion: 1.0\n")
    (facts / "entry_points.txt").write_text("[tuner.test_shapes]\nHexagon = other_shapes:Hexagon\n")


@pytest.fixture(autouse=True)
def _forget_the_package(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "other_shapes", raising=False)


def test_another_package_adds_its_own_by_an_entry_point(tmp_path: Path) -> None:
    install(tmp_path, "class Hexagon:\n    corners = 6\n")
    registry = shapes()
    registry.add(Square)
    assert registry["Hexagon"].corners == 6
    assert list(registry) == ["Square", "Hexagon"]


def test_a_package_that_cannot_be_loaded_is_named_in_one_line(tmp_path: Path) -> None:
    install(tmp_path, "import a_package_that_is_not_there\n")
    expected = r"shape 'Hexagon' of package 'other-shapes' cannot be loaded \(ModuleNotFoundError: .*\); mend"
    with pytest.raises(RegistryError, match=expected):
        list(shapes())


def test_a_declaration_without_a_name_is_refused_in_one_line() -> None:
    registry: Registry[type] = Registry("shape", "tuner.no_shapes", name_of=lambda kind: kind.code)
    with pytest.raises(
        RegistryError, match=r"^shape: a declaration must state its name, got <class '.*Square'>$"
    ):
        registry.add(Square)


def test_an_entry_point_may_hold_nothing_for_one_of_the_registries_of_its_group(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "shapes_without_corners.py").write_text("class Line:\n    corners = None\n")
    facts = tmp_path / "lines-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: lines\nVersion: 1.0\n")
    (facts / "entry_points.txt").write_text("[tuner.test_corners]\nline = shapes_without_corners:Line\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    registry: Registry[int] = Registry(
        "corner", "tuner.test_corners", name_of=str, declared_by=lambda kind: kind.corners
    )
    assert list(registry) == []
