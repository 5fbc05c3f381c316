"""The Python of the tutorials, run as it stands there, one page after the other in one folder."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from datagen import Recipe, render_dataset
from datagen.formats import read_pfm
from scenes import FAMILIES
from tests.docs.pages import ROOT, blocks

TUTORIALS = ROOT / "docs" / "tutorials"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the reader is after the commands of the first tutorial, with fewer and smaller scenes."""
    folder = tmp_path_factory.mktemp("tutorials")
    world = FAMILIES["flying_things"].config(width=160, height=90)
    summary = render_dataset(
        Recipe(world, {"train": 1, "test": 1}, seed=1, samples=1), folder / "data", workers=1
    )
    assert summary.failures == ()
    return folder


def run(page: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    """Execute the page's Python in the folder, block after block; its names afterwards."""
    monkeypatch.chdir(folder)
    names: dict[str, object] = {}
    for block in blocks(TUTORIALS / page, "python"):
        exec(compile(block, page, "exec"), names)
    return names


@pytest.mark.slow
def test_your_own_data_set(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run("own_data_set.md", folder, monkeypatch)
    assert capsys.readouterr().out.startswith("TRAIN/A/0000/0006\n(90, 160, 3)\n")


@pytest.mark.slow
def test_refine_a_disparity(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = run("refine_a_disparity.md", folder, monkeypatch)
    assert read_pfm(folder / "predicted.pfm").shape == (90, 160)
    rate, truth = names["bad_pixel_rate"], names["sample"].disparity_left
    assert rate(names["refined"], truth) < rate(names["disparity"], truth)


def test_a_domain_gap_study(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    row = {"bad1": 0.5, "epe": 2.0, "gradient": 0.3}
    results = tmp_path / "gap" / "results"
    results.mkdir(parents=True)
    summary = {"driving": {"regressor": row, "ours": {**row, "epe": 1.5}}}
    (results / "summary.json").write_text(json.dumps(summary))
    run("domain_gap.md", tmp_path, monkeypatch)
    assert capsys.readouterr().out == "driving: 2.00 px before refinement, 1.50 px after\n"
