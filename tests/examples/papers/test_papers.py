"""A small version of every figure and table of the papers: it runs, is judged and drawn."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from examples.papers import ITEMS, Item, Settings, chosen, run
from examples.papers.__main__ import command
from examples.papers.figures import draw_item
from examples.papers.pages import papers_json, papers_markdown
from tuner.stages import watched

CORRECTED = {
    "rlg-static": ("σ(10 s) if N were 0.09 deg/√h as printed", "σ(10 s), the accuracy in use"),
    "rlg-dynamic": ("white noise from the still parts",),
    "lowpass-n": ("deviation with ÷ without filter at τ = 10/f_c",),
    "example-curve": ("N in the sum, read ÷ true", "B in the sum, read ÷ true"),
    "kf-parameters": ("ARW and BI: true error ÷ predicted sd after 60 s",),
    "fog-edf": ("quantization: ν of total variance at T/2",),
    "fog-sim": ("random walk, τ = 3 s: total ÷ Allan variance",),
    "fog-bias": (
        "bias instability: bias of total variance at T/2",
        "rate random walk: bias of total variance at T/2",
        *(f"ramp: Allan ÷ Thêo1 at m = {m}" for m in (10, 40, 100, 400)),
    ),
    "fog-record": ("bias of ThêoH at τ = T/2",),
    "mems-allan": ("mean change of the deviation by the second grouping",),
    "mems-arma": ("possible Z of 10 groups that is nearest to 0.2141",),
}
"""Claims that even a small sample corrects."""


PROGRESS: dict[str, list[float]] = {}
"""Shares that the items said to have done."""


@cache
def small(name: str) -> Item:
    said = PROGRESS.setdefault(name, [])
    with watched(lambda _doing, share, _until: said.append(share)):
        return run(name, Settings(seed=0, small=True))


UNTESTABLE = {"fog-record": 1, "mems-allan": 1}
"""Claims of which the papers do not publish what a test needs."""


@pytest.mark.parametrize("name", ITEMS)
def test_every_claim_of_a_small_version_has_a_verdict_and_every_item_a_figure(
    name: str, tmp_path: Path
) -> None:
    item = small(name)
    path = tmp_path / f"{name}.png"
    draw_item(item, path, dpi=40)
    assert path.stat().st_size > 1_500
    assert item.name == name
    assert item.claims
    for claim in item.claims:
        assert claim.verdict in ("reproduced", "corrected", "untestable"), claim
        assert claim.why
        if claim.ours.value is not None:
            assert claim.ours.interval is not None
            assert claim.ours.interval[0] <= claim.ours.value <= claim.ours.interval[1]
    assert sum(claim.verdict == "untestable" for claim in item.claims) == UNTESTABLE.get(name, 0)
    corrected = [claim.text for claim in item.claims if claim.verdict == "corrected"]
    assert set(CORRECTED.get(name, ())) <= set(corrected)


def test_figures_of_a_smaller_study_lie_within_its_scatter() -> None:
    told = [claim.why for claim in small("fog-sim").claims if "smaller study" in claim.why]
    assert len(told) == 7
    assert all(" holds " in why for why in told)


def test_items_have_streams_of_their_own() -> None:
    again = run("fog-bias", Settings(seed=0, small=True))
    other = run("fog-bias", Settings(seed=1, small=True))
    values = [[claim.ours.value for claim in item.claims] for item in (small("fog-bias"), again, other)]
    assert values[0] == values[1]
    assert values[0] != values[2]


def test_page_and_json_hold_every_claim() -> None:
    items = [small(name) for name in ("fog-bias", "test-design")]
    page, content = papers_markdown(items, "figures/"), papers_json(items)
    for item in items:
        assert f"## {item.name}" in page
        assert f"(figures/{item.name}.png)" in page
        assert len(content["items"][item.name]["claims"]) == len(item.claims)
        assert all(claim.text in page for claim in item.claims)
    json.dumps(content, allow_nan=False)


def test_names_are_taken_once_in_order() -> None:
    assert chosen(("mems-arma", "rlg-static", "mems-arma")) == ("rlg-static", "mems-arma")
    assert chosen(("all",)) == tuple(ITEMS)


def test_command_writes_page_figure_and_json(tmp_path: Path) -> None:
    told = CliRunner().invoke(command, ["test-design", "--small", "-o", str(tmp_path), "--json", "-"])
    assert told.exit_code == 0
    content = json.loads(told.stdout)
    assert content["schema"] == "tuner.papers/1"
    assert content == json.loads((tmp_path / "papers" / "papers.json").read_text(encoding="utf-8"))
    assert (tmp_path / "papers" / "test-design.png").exists()
    assert "test-design" in (tmp_path / "papers.md").read_text(encoding="utf-8")
    assert "test-design: " in told.stderr


def test_command_lists_items_and_refuses_others() -> None:
    told = CliRunner().invoke(command, [])
    assert (told.exit_code, told.stdout.split()) == (0, list(ITEMS))
    told = CliRunner().invoke(command, ["rlg"])
    assert told.exit_code == 2
    assert "'rlg' is not one of 'rlg-static'" in told.stderr


def test_a_directory_that_cannot_be_made_is_refused_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "papers").write_text("a file", encoding="utf-8")
    monkeypatch.setattr(
        "examples.papers.__main__.run", lambda name, settings: pytest.fail("work before the directory")
    )
    told = CliRunner().invoke(command, ["test-design", "-o", str(tmp_path)])
    assert told.exit_code != 0
    assert str(tmp_path / "papers") in str(told.exception)


def test_an_interrupted_run_keeps_what_is_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(name: str, settings: Settings) -> Item:
        if name == "fog-bias":
            raise KeyboardInterrupt
        return run(name, settings)

    monkeypatch.setattr("examples.papers.__main__.run", interrupted)
    told = CliRunner().invoke(command, ["test-design", "fog-bias", "--small", "-o", str(tmp_path)])
    assert told.exit_code != 0
    content = json.loads((tmp_path / "papers" / "papers.json").read_text(encoding="utf-8"))
    assert list(content["items"]) == ["test-design"]
    assert "## test-design" in (tmp_path / "papers.md").read_text(encoding="utf-8")
    assert "fog-bias …" in told.stderr


def test_long_items_tell_of_their_progress() -> None:
    small("method-table")
    told = PROGRESS["method-table"]
    assert len(told) > 3
    assert told == sorted(told)


@pytest.mark.slow
@pytest.mark.parametrize("name", ITEMS)
def test_every_claim_is_judged_alike_by_another_seed(name: str) -> None:
    first, second = (run(name, Settings(seed)) for seed in (0, 1))
    assert not [c for item in (first, second) for c in item.claims if c.verdict == "not reproduced"]
    verdicts = [[claim.verdict for claim in item.claims] for item in (first, second)]
    assert np.mean([a == b for a, b in zip(*verdicts, strict=True)]) > 0.8
