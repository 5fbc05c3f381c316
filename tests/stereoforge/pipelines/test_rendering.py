"""Rendering as a step of a pipeline."""

from __future__ import annotations

from pathlib import Path

import pytest

from datagen import Recipe
from datagen.formats import read_png
from scenes.families.flying_things import FlyingThingsConfig
from stereoforge.pipelines.rendering import render_all


def test_a_first_picture_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As soon as there is one, so that nobody waits for the last scene to see what the world is like."""
    recipe = Recipe(FlyingThingsConfig(width=64, height=36, frames=1), {"train": 2}, samples=1)
    render_all(recipe, tmp_path)
    said = "".join(capsys.readouterr().out.split())
    assert said.count("afirstpicture:") == 1
    (path,) = (
        picture
        for picture in tmp_path.glob("frames_cleanpass/TRAIN/*/*/left/*.png")
        if f"afirstpicture:{''.join(str(picture).split())}" in said
    )
    assert read_png(path).shape == (36, 64, 3)
    render_all(recipe, tmp_path)  # nothing is left to render
    assert "first picture" not in capsys.readouterr().out
