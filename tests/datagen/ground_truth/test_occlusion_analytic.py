"""Rendered ground truth of plates against closed forms: disparity, object index and occlusion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from datagen.dataset.layout import View
from datagen.formats.occlusion import OCCLUDED, OUT_OF_FRAME, VISIBLE
from datagen.rendering.frames import ViewTargets, render_frames
from tests.datagen.worlds import BASELINE_M, Plate, plates

WIDTH, HEIGHT = 192, 108
WALL = Plate((0.0, 0.0), 20.0, (60.0, 60.0))
DISPARITY_TOLERANCE_PX = 1e-4
TIE = 2e-3
"""Metres on the plate's plane within which a pixel is a tie between two labels."""

SCENES = {
    "square before a plane": (Plate((0.3, -0.2), 8.0, (1.03, 0.81)), WALL),
    "thin pole": (Plate((-0.4, 0.0), 6.0, (0.053, 3.0)), WALL),
    "cut by the frame": (Plate((3.4, 0.5), 7.0, (0.9, 1.2)), Plate((-4.1, 0.0), 8.0, (0.7, 0.9)), WALL),
    "beside the frame": (Plate((4.55, 0.0), 8.0, (0.5, 1.5)), WALL),
    "slanted plane": (Plate((0.0, 0.0), 20.0, (80.0, 80.0), yaw_deg=35.0),),
    "slanted plane behind a square": (
        Plate((0.5, 0.1), 7.0, (0.77, 0.9)),
        Plate((0.0, 0.0), 20.0, (80.0, 80.0), yaw_deg=-40.0),
    ),
}


def hit_depth(plate: Plate, origin_x: float, x: NDArray, y: NDArray) -> tuple[NDArray, NDArray]:
    """Depth where the rays (origin_x, 0, 0) + t (x, y, -1) meet the plate, inf where they miss; margin to edge."""
    yaw = np.deg2rad(plate.yaw_deg)
    normal = np.array([np.sin(yaw), 0.0, np.cos(yaw)])
    along = np.array([np.cos(yaw), 0.0, -np.sin(yaw)])
    center = np.array([*plate.center, -plate.depth_m])
    origin = np.array([origin_x, 0.0, 0.0])
    depth = (normal @ (center - origin)) / (normal[0] * x - normal[2])
    point = origin + depth[..., None] * np.stack([x, y, -np.ones_like(x)], -1)
    u, v = (point - center) @ along, point[..., 1] - center[1]
    margin = np.minimum(plate.half[0] - np.abs(u), plate.half[1] - np.abs(v))
    return np.where((margin >= 0) & (depth > 0), depth, np.inf), np.abs(margin)


def closed_form(
    items: tuple[Plate, ...], view: View, pixel_centre: float = 0.5, baseline_m: float = BASELINE_M
) -> dict[str, NDArray]:
    """Object index, disparity, occlusion labels, and which pixels are too close to an edge to call."""
    own, other = (0.0, baseline_m) if view == "left" else (baseline_m, 0.0)
    x, y = np.meshgrid(
        (np.arange(WIDTH) + pixel_centre - WIDTH / 2) / WIDTH,
        -(np.arange(HEIGHT) + pixel_centre - HEIGHT / 2) / WIDTH,
    )
    hits = [hit_depth(item, own, x, y) for item in items]
    depths = np.stack([depth for depth, _ in hits])
    tie = np.any([margin < TIE for _, margin in hits], axis=0)
    depth = depths.min(axis=0)
    disparity = WIDTH * abs(baseline_m) / depth
    # The ray from the other view through the point, in the same direction parametrisation.
    x_other = x + (own - other) / depth
    label = np.zeros(depth.shape, np.uint8)
    for item in items:
        from_other, margin = hit_depth(item, other, x_other, y)
        label[from_other < depth * (1 - 1e-3)] = OCCLUDED
        tie |= (margin < TIE) & np.isfinite(depth)
    column = x_other * WIDTH + WIDTH / 2
    label[(column < 0) | (column > WIDTH)] = OUT_OF_FRAME
    tie |= (np.abs(column) < TIE) | (np.abs(column - WIDTH) < TIE)
    index = np.where(np.isfinite(depth), depths.argmin(axis=0) + 1, 0)
    return {"index": index, "disparity": disparity, "label": label, "tie": tie}


@pytest.fixture(scope="module", params=SCENES, ids=lambda name: name.replace(" ", "-"))
def rendered(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, dict[View, ViewTargets]]:
    scene = plates(WIDTH, HEIGHT, *SCENES[request.param])
    ((_, targets),) = render_frames(scene, tmp_path_factory.mktemp("blender"))
    return request.param, targets


@pytest.mark.parametrize("view", ["left", "right"])
def test_every_pixel_but_the_ties_equals_the_closed_form(
    rendered: tuple[str, dict[View, ViewTargets]], view: View
) -> None:
    name, targets = rendered
    truth = closed_form(SCENES[name], view)
    sure = ~truth["tie"]
    assert sure.mean() > 0.9
    np.testing.assert_array_equal(targets[view].object_index[sure], truth["index"][sure])
    np.testing.assert_allclose(
        targets[view].disparity[sure], truth["disparity"][sure], rtol=0, atol=DISPARITY_TOLERANCE_PX
    )
    np.testing.assert_array_equal(targets[view].occlusion[sure], truth["label"][sure])


def test_the_closed_forms_hold_every_label(rendered: tuple[str, dict[View, ViewTargets]]) -> None:
    """Guards the scenes themselves: each must exercise what its name says."""
    name, targets = rendered
    found = set(np.unique(targets["left"].occlusion)) | set(np.unique(targets["right"].occlusion))
    assert found == (
        {VISIBLE, OUT_OF_FRAME} if name == "slanted plane" else {VISIBLE, OCCLUDED, OUT_OF_FRAME}
    )


MISTAKES = {
    "pixel corners for centres": {"view": "left", "pixel_centre": 0.0},
    "half a pixel too far": {"view": "left", "pixel_centre": 1.0},
    "right camera on the left": {"view": "left", "baseline_m": -BASELINE_M},
    "views swapped": {"view": "right"},
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_the_classical_mistakes_would_be_seen(tmp_path: Path, mistake: str) -> None:
    """The comparison above must fail for ground truth made with half-pixel, sign and left/right errors."""
    items = SCENES["slanted plane behind a square"]
    ((_, targets),) = render_frames(plates(WIDTH, HEIGHT, *items), tmp_path)
    wrong = closed_form(items, **MISTAKES[mistake])
    sure = ~wrong["tie"]
    disparity_error = np.abs(targets["left"].disparity - wrong["disparity"])[sure]
    if mistake == "right camera on the left":  # which does not move what the left view itself sees
        assert (targets["left"].occlusion != wrong["label"])[sure].sum() > 20
    else:
        assert np.median(disparity_error) > 10 * DISPARITY_TOLERANCE_PX
