"""What Blender would clamp without a word is rendered as it is, or refused in a sentence."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from datagen.errors import DatasetError
from datagen.rendering.frames import RenderOptions, render_frames
from stereoforge.cli import main
from tests.datagen.worlds import Plate, plates


def test_what_is_clamped_is_refused() -> None:
    class Lens(SimpleNamespace):
        def __setattr__(self, name: str, value: float) -> None:
            super().__setattr__(name, max(float(np.float32(value)), 1.0))

    from datagen.blender.exact import set_exactly

    set_exactly(Lens(), "lens", 1.1)
    with pytest.raises(DatasetError, match=r"cannot render a lens of 0\.5: it makes 1 of it"):
        set_exactly(Lens(), "lens", 0.5)


def test_a_surface_nearer_than_a_millimetre_is_in_the_picture(tmp_path: Path) -> None:
    """The ground truth had it, the picture showed what is behind."""
    near, far = Plate((0.0, 0.0), 0.0004, (0.0001, 0.0001)), Plate((0.0, 0.0), 0.002, (1.0, 1.0))
    scene = plates(48, 32, near, far)
    scene = replace(scene, camera=replace(scene.camera, baseline_m=1e-5))
    pictures = []
    for each in (scene, replace(scene, objects=scene.objects[1:])):
        ((_, targets),) = render_frames(each, tmp_path, RenderOptions(samples=4))
        pictures.append(targets["left"].images["clean"])
    difference = np.abs(pictures[0].astype(int) - pictures[1]).max(axis=2)
    assert (difference[12:20, 20:28] > 8).mean() > 0.5
    assert (difference[:, :8] <= 8).mean() > 0.9


def test_clip_planes_are_those_of_before_in_ordinary_scenes() -> None:
    from datagen.blender.exact import FAR_M, NEAR_M, clip_planes
    from datagen.ground_truth.scene_geometry import build_geometry

    ordinary = build_geometry(plates(48, 32, Plate((0.0, 0.0), 2.0, (1.0, 1.0))))
    assert clip_planes(ordinary, np.zeros(3), 0.0) == (NEAR_M, FAR_M)
    wide = build_geometry(plates(48, 32, Plate((0.0, 0.0), 2e-4, (1e8, 1.0))))
    near, far = clip_planes(wide, np.zeros(3), 0.0)
    assert near == pytest.approx(2e-5)
    assert far > 1e8


@pytest.mark.parametrize("size", ["200x3", "3x200", "1x1"])
def test_sizes_that_blender_cannot_render_are_wrong_usage(
    size: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["render", "--scenes", "1", "--size", size, "--out", str(tmp_path / "set")])
    assert end.value.code == 2
    assert f"images of {size} cannot be rendered" in capsys.readouterr().err
    assert not (tmp_path / "set").exists()
