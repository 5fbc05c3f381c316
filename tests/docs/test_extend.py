"""The code of docs/howto/extend.md, run as it stands there."""

from __future__ import annotations

import re
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from datagen.cameras.calibration import Calibration, CalibrationText
from datagen.formats import write_pfm, write_png
from datagen.ground_truth.raycast import SceneRayCaster
from datagen.ground_truth.scene_geometry import build_geometry
from datagen.recipe.curation import fault_before_rendering
from datagen.recipe.recipe import Recipe
from refine.method import EvaluationFrame
from scenes import scene_from_json, scene_to_json
from scenes.random_draws import integer
from scenes.spec import Rig
from training.networks import ConfNet, HeadConfig
from training.networks.inference import estimate

PAGE = Path(__file__).parents[2] / "docs" / "howto" / "extend.md"
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


def module(defines: str, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The namespace of the one block that defines something."""
    (block,) = (block for block in BLOCKS if defines in block)
    made = types.ModuleType(f"docs_{re.sub('[^a-z]', '', defines.lower())}")
    monkeypatch.setitem(sys.modules, made.__name__, made)
    exec(compile(block, str(PAGE), "exec"), made.__dict__)
    return made.__dict__


def test_the_page_has_a_block_a_kind() -> None:
    assert len(BLOCKS) == 7


def test_the_family_samples_worlds_that_can_be_rendered(monkeypatch: pytest.MonkeyPatch) -> None:
    family = module("FAMILY = ", monkeypatch)["FAMILY"]
    config = family.config(width=96, height=54)
    scenes = [family.sample(np.random.default_rng(seed), config) for seed in (1, 1, 2)]
    assert scene_to_json(scenes[0]) == scene_to_json(scenes[1]) != scene_to_json(scenes[2])
    assert scene_from_json(scene_to_json(scenes[0])) == scenes[0]
    assert 10 <= len(scenes[0].objects) - 1 <= 30
    curation = Recipe(config, {"train": 1}).curation
    assert any(
        fault_before_rendering(SceneRayCaster(build_geometry(scene)), curation) is None for scene in scenes
    )


def test_the_family_can_be_seen_by_a_rig_of_ones_own(monkeypatch: pytest.MonkeyPatch) -> None:
    family = module("FAMILY = ", monkeypatch)["FAMILY"]
    rig = Rig(96, 54, 90, 95, 50, 44, 30, 0.3)
    camera = family.sample(np.random.default_rng(1), family.config(width=96, height=54, rig=rig)).camera
    assert camera == rig.camera(camera.motion)


def test_the_calibration_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    reader = module("READER = ", monkeypatch)["READER"]
    texts = (CalibrationText("rig.txt", "rig 700 320 240 0.12 640 480\n"),)
    assert reader.recognises(texts)
    assert reader.read(texts) == Calibration(700, 700, 320, 320, 240, 0.12, (640, 480))
    with pytest.raises(ValueError, match="are the views swapped"):
        reader.read((CalibrationText("rig.txt", "rig 700 320 240 -0.12 640 480"),))


def test_the_shape_is_closed_and_faces_outwards(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = module("class Tent", monkeypatch)["Tent"](height=0.7).mesh()
    edges = {(a, b) for t in mesh.triangles for a, b in zip(t, np.roll(t, -1), strict=True)}
    assert edges == {(b, a) for a, b in edges}
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(2 * 2 * 0.7 / 2)


def test_the_texture_is_a_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    texture = module("class Tartan", monkeypatch)["Tartan"].sample(np.random.default_rng(0), 64)
    picture = texture.image()
    assert picture.shape == (64, 64, 3)
    assert picture.dtype == np.uint8
    assert np.array_equal(picture, texture.image())
    assert integer(np.random.default_rng(0), 4, 12) == texture.bands


def test_the_regressor_answers_and_learns(monkeypatch: pytest.MonkeyPatch) -> None:
    made = module("class PlainNet", monkeypatch)
    torch.manual_seed(0)
    network = made["PlainNet"](made["PlainConfig"](channels=8, levels=8))
    confnet = ConfNet(HeadConfig(width=4, hidden=4).on(network)).eval()
    right = torch.rand(1, 3, 12, 40)
    left = right.roll(6, -1)
    found = estimate(network, confnet, None, left[..., :39], right[..., :39])
    assert found.disparity.shape == (1, 1, 12, 39)
    assert found.confidence is not None
    objective, truth = made["PlainObjective"](), torch.full((1, 1, 12, 40), 6.0)
    optimizer = torch.optim.Adam(network.parameters(), 0.02)
    losses = []
    for _ in range(60):
        optimizer.zero_grad()
        loss = objective(network(left, right), truth, 0.0)
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < 0.3 * losses[0]


def test_the_method_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    method = module("class Box", monkeypatch)["Box"](side_px=3)
    rng = np.random.default_rng(0)
    disparity = rng.random((9, 9), np.float32)
    frame = EvaluationFrame(
        "a", np.zeros((9, 9, 3), np.uint8), disparity, np.zeros((9, 9), np.uint8), disparity
    )
    assert method.run(frame).disparity[4, 4] == pytest.approx(disparity[3:6, 3:6].mean())


def test_the_reader_reads(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (kind,) = module("FORMATS = ", monkeypatch)["FORMATS"]
    picture = np.full((4, 6, 3), 7, np.uint8)
    disparity = np.linspace(0, 6, 24, dtype=np.float32).reshape(4, 6)  # no wider than the picture
    write_png(tmp_path / "a.png", picture)
    write_png(tmp_path / "a-right.png", picture)
    write_pfm(tmp_path / "a.pfm", disparity)
    assert kind.recognises(tmp_path)
    (frame,) = kind.find_frames(str(tmp_path), "test")
    assert frame.name == "a"
    assert np.array_equal(frame.disparity_left, disparity)
    assert np.array_equal(frame.right, picture)
