"""The documents at the root agree with the code: rooms and their order, links, versions, checks before a commit."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
ARCHITECTURE = (ROOT / "ARCHITECTURE.md").read_text()
DOCUMENTS = sorted(p for p in [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])


def _import_order() -> list[str]:
    """Layers of the import contract, from the top, as paths."""
    (contract,) = (c for c in PROJECT["tool"]["importlinter"]["contracts"] if c["type"] == "layers")
    return [layer.replace(".", "/") for layer in contract["layers"]]


def _rooms_listed() -> list[str]:
    """First column of the table of rooms."""
    table = ARCHITECTURE.split("## The rooms")[1].split("Inside the larger ones")[0]
    return re.findall(r"^\| `([\w/.]+)`", table, flags=re.MULTILINE)


def test_rooms_are_listed_in_the_order_of_the_import_contract():
    assert [room.rstrip("/").removesuffix(".py") for room in _rooms_listed()] == _import_order()


def test_every_folder_of_the_packages_is_a_listed_room():
    folders = {f"tuner/{p.name}/" for p in (ROOT / "tuner").iterdir() if (p / "__init__.py").exists()}
    assert folders <= set(_rooms_listed())


def test_every_path_named_in_the_architecture_exists():
    paths = re.findall(r"`((?:models|tuner|tests|benchmarks|configs)/[\w/.]*)`", ARCHITECTURE)
    assert len(paths) > 25
    assert [p for p in paths if not (ROOT / p).exists()] == []


def test_every_node_of_the_picture_is_a_room():
    picture = ARCHITECTURE.split("```mermaid")[1].split("```")[0]
    edges = re.findall(r"^ +(\w+)(?:\[/.*?/\])? --.*?> (\w+)(\[/)?", picture, flags=re.MULTILINE)
    assert len(edges) > 15
    inputs = {"log", "drive", "sheet"}
    nodes = {a for a, _, _ in edges} | {b for _, b, outside in edges if not outside}
    assert {n for n in nodes - inputs if not (ROOT / "tuner" / n).is_dir()} == set()


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_to_files(document):
    text = re.sub(r"```.*?```", "", document.read_text(), flags=re.DOTALL)
    links = [link.split("#")[0] for link in re.findall(r"\]\(([^)\s]+)\)", text) if "://" not in link]
    assert [link for link in links if link and not (document.parent / link).exists()] == []


def test_a_glossary_entry_defines_one_name_once():
    names = re.findall(r"^- \*\*(.+?)\*\*", (ROOT / "GLOSSARY.md").read_text(), flags=re.MULTILINE)
    assert len(names) > 60
    assert len(set(names)) == len(names)


def test_the_citation_has_the_last_release_and_only_keys_of_its_schema():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    # required and used keys of the schema of Citation File Format 1.2.0
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert set(citation) <= {
        "cff-version", "message", "type", "title", "abstract", "authors", "version", "date-released", "license",
        "keywords", "repository-code", "url", "doi", "identifiers", "references",
    }  # fmt: skip
    headings = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), flags=re.MULTILINE)
    released = [heading for heading in headings if heading != "Unreleased"]
    assert citation["version"] == released[0]
    here = PROJECT["project"]["version"]
    # code that differs from the last release must not bear its number
    assert here.endswith(".dev0") and here > released[0] if "Unreleased" in headings else here == released[0]


def test_hooks_before_a_commit_run_the_checks_of_ci_and_download_nothing():
    config = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())
    assert [repo["repo"] for repo in config["repos"]] == ["local"]
    hooks = [hook["entry"].replace(" --force-exclude", "") for hook in config["repos"][0]["hooks"]]
    checks = [line.removesuffix(" .") for line in (ROOT / "check").read_text().splitlines()]
    assert {hook["language"] for hook in config["repos"][0]["hooks"]} == {"system"}
    assert [hook for hook in hooks if hook not in checks] == []
    assert len(hooks) == 4
    assert "./check --quick" in (ROOT / ".ci/run").read_text()
