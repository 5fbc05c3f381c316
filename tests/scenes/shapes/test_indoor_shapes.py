"""Indoor shapes: no two faces coincide, which Cycles would render black."""

from __future__ import annotations

import numpy as np
import pytest

from scenes.shapes import SHAPES
from scenes.shapes.indoor.parts import IndoorShape, slabs
from scenes.spec import Shape


def doubled_area(vertices: np.ndarray, triangles: np.ndarray) -> float:
    """Area of the axis-aligned triangles in which another one's middle lies, in the same plane and facing alike."""
    corners = vertices[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    level = np.abs(normal).max(axis=1) > (1 - 1e-9) * np.maximum(length, 1e-9)
    corners, normal, area = corners[level], normal[level], length[level] / 2
    axis = np.abs(normal).argmax(axis=1)
    rows = np.arange(len(axis))
    planes = np.stack([axis, np.sign(normal[rows, axis]), np.round(corners[rows, 0, axis], 5)], -1)
    total = 0.0
    for plane in np.unique(planes, axis=0):
        here = np.flatnonzero((planes == plane).all(axis=1))
        flat = np.delete(corners[here], int(plane[0]), axis=2)
        middles = flat.mean(axis=1)
        for index, (a, b, c) in enumerate(flat):
            u, v = np.linalg.solve(np.array([b - a, c - a]).T, (middles - a).T)
            inside = (u > 1e-6) & (v > 1e-6) & (u + v < 1 - 1e-6)
            inside[index] = False
            total += float(area[here[index]]) if inside.any() else 0.0
    return total


def test_the_measure_sees_overlapping_faces() -> None:
    one, two = slabs((0.0, 0.0, 0.0, 1.0, 1.0, 1.0)), slabs((0.2, 0.2, 0.0, 0.8, 0.8, 1.0))
    both = np.concatenate([one[0], two[0]]), np.concatenate([one[1], two[1] + len(one[0])])
    assert doubled_area(*both) > 0.5
    assert doubled_area(*one) == 0.0


def test_boxes_that_overlap_have_no_faces_in_one_plane_and_others_stay_as_they_are() -> None:
    overlapping = slabs(
        (0.0, 0.0, 0.0, 1.0, 1.0, 1.0), (0.2, 0.0, 0.0, 0.8, 2.0, 1.0), (0.4, 0.0, 0.0, 0.6, 2.0, 1.0)
    )
    assert doubled_area(*overlapping) == 0.0
    assert overlapping[0].min() >= 0.0
    assert overlapping[0].max() <= 2.0
    beside = slabs((0.0, 0.0, 0.0, 1.0, 1.0, 1.0), (1.0, 0.0, 0.0, 2.0, 1.0, 1.0))
    np.testing.assert_array_equal(np.unique(beside[0]), [0.0, 1.0, 2.0])


@pytest.mark.parametrize("name", ["BookRow", "Desk", "RoomDoor", "RoomWindow", "Shelf", "Skirting"])
def test_faces_of_furniture_and_frames_do_not_coincide(name: str) -> None:
    kind: type[Shape] = SHAPES[name]
    for seed in range(4):
        shape = kind.sample(np.random.default_rng(seed))
        assert isinstance(shape, IndoorShape)
        for part, surface in shape.parts().items():
            if part in ("metal", "chrome", "wood") and name == "Desk":
                continue  # The legs' upper ends are under the board.
            assert doubled_area(surface.vertices, surface.triangles) == 0.0, part
