"""The notebooks of the documents run from the first cell to the last, with nothing but generated data."""

from __future__ import annotations

from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / "docs" / "notebooks").glob("*.ipynb"))
MAX_CELL_TIME = 600
"""Time that a cell may take, s."""


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    content = nbformat.read(path, as_version=4)
    assert all(not cell.get("outputs") for cell in content.cells)
    nbclient.NotebookClient(
        content, timeout=MAX_CELL_TIME, resources={"metadata": {"path": str(path.parent)}}
    ).execute()


def test_there_are_three_of_them():
    assert [path.stem for path in NOTEBOOKS] == ["drive", "my_own_filter", "static_log"]
