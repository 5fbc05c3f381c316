"""Targets that follow the surface a pixel shows: normals, optical flow, disparity change, motion boundaries.

The point seen through a pixel's centre is a place on a triangle; where the triangle's vertices are at another
instant, moved, turned and deformed, and seen by the camera of that instant, says exactly where the point has
gone. Everything is 64-bit and independent of what Blender rendered.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from datagen.dataset.layout import DIRECTIONS, Direction, Eye
from datagen.ground_truth.raycast import SceneRayCaster
from scenes import Scene

STEP: dict[Direction, int] = {"into_future": 1, "into_past": -1}
"""Frames from a pixel's instant to the one its point is followed to."""
BOUNDARY_STEP_PX = 1.5
"""Neighbouring pixels of two objects whose flows differ by at least this lie on a motion boundary."""
BOUNDARY_PIXELS = 10
"""A boundary of fewer connected pixels is none (both thresholds: Mayer et al. 2016, section 4)."""


class PixelSurfaces:
    """What some pixels of one eye see at one instant, ready to be followed to other instants.

    The pixels are rows and columns of one shape S, which may be the whole image's or a list's; what the methods give
    has that shape too.
    """

    def __init__(
        self,
        caster: SceneRayCaster,
        eye: Eye,
        time_frames: float,
        rows: NDArray[np.intp],
        columns: NDArray[np.intp],
    ) -> None:
        self._geometry, self._eye, self._time = caster.geometry, eye, time_frames
        self._shape = rows.shape
        rows, columns = rows.ravel(), columns.ravel()
        points = caster.surface_points(eye, time_frames, rows, columns)
        self._met = points.triangle >= 0
        self._corners = self._geometry.triangles[points.triangle[self._met]]
        self._weights = points.weights[self._met]
        self._centres = np.stack([columns, rows], -1) + 0.5
        self._rays = caster.directions(rows, columns)
        """Directions through the pixels' centres in the camera's frame (x right, y up, looking along -z)."""

    def normals(self) -> NDArray[np.float32]:
        """(*S, 3) unit normals of the triangles in the camera's frame, towards the eye; 0 for the sky."""
        a, b, c = np.moveaxis(self._seen_from(self._time)[self._corners], 1, 0)
        normals = np.cross(b - a, c - a)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        away = np.einsum("ij,ij->i", normals, self._rays[self._met]) > 0
        normals[away] *= -1
        return self._picture(normals, np.zeros((len(self._met), 3)))

    def flow(self, direction: Direction) -> NDArray[np.float32]:
        """(*S, 2) displacement [to the right, down] in px to where the point is seen one frame on.

        NaN for points that will be behind the camera. The sky moves with the camera's rotation only.
        """
        time = self._time + STEP[direction]
        camera = self._geometry.scene.camera
        turn = camera.pose(self._eye, time)[:3, :3].T @ camera.pose(self._eye, self._time)[:3, :3]
        there = self._rays @ turn.T
        there[self._met] = self._points_at(time)
        with np.errstate(divide="ignore", invalid="ignore"):
            x, y = (camera.focal_px * there[:, :2] / -there[:, 2:]).T
        seen = np.stack([camera.width / 2 + x, camera.height / 2 - y], -1)
        seen[there[:, 2] >= 0] = np.nan
        return (seen - self._centres).reshape(*self._shape, 2).astype(np.float32)

    def disparity_change(self, direction: Direction) -> NDArray[np.float32]:
        """(*S,) px by which the point's disparity grows until one frame on; NaN behind the camera, sky 0."""
        fb = self._geometry.scene.camera.disparity_metres
        now, then = (-self._points_at(time)[:, 2] for time in (self._time, self._time + STEP[direction]))
        with np.errstate(divide="ignore"):
            change = np.where(then > 0, fb / then - fb / now, np.nan)
        return self._picture(change, np.zeros(len(self._met)))

    def _seen_from(self, time_frames: float) -> NDArray[np.float64]:
        """(V, 3) all vertices at an instant in this eye's frame of that instant."""
        camera = self._geometry.scene.camera
        return self._geometry.vertices(time_frames, np.linalg.inv(camera.pose(self._eye, time_frames)))

    def _points_at(self, time_frames: float) -> NDArray[np.float64]:
        """(M, 3) where the surface points are at an instant, in this eye's frame of that instant."""
        corners = self._seen_from(time_frames)[self._corners]
        return np.einsum("ij,ijk->ik", self._weights, corners)

    def _picture(self, values: NDArray[np.float64], sky: NDArray[np.float64]) -> NDArray[np.float32]:
        """An image of the values where something is hit, and of `sky` elsewhere."""
        picture = sky.copy()
        picture[self._met] = values
        return picture.reshape(*self._shape, *sky.shape[1:]).astype(np.float32)


def material_index(scene: Scene, object_index: NDArray[np.integer[Any]]) -> NDArray[np.uint16]:
    """(H, W) 0 for the sky, else 1 + the index in `Scene.materials`, of what (H, W) objects wear."""
    worn = [0, *(1 + thing.material for thing in scene.objects)]
    return np.array(worn, np.uint16)[object_index]


def object_edges(object_index: NDArray[np.integer[Any]]) -> NDArray[np.bool_]:
    """(H, W) where a pixel shows another object than one of its four neighbours."""
    marked = np.zeros(object_index.shape, bool)
    down, across = object_index[1:] != object_index[:-1], object_index[:, 1:] != object_index[:, :-1]
    marked[1:] |= down
    marked[:-1] |= down
    marked[:, 1:] |= across
    marked[:, :-1] |= across
    return marked


def motion_boundaries(flow: NDArray[np.float32], object_index: NDArray[np.integer[Any]]) -> NDArray[np.bool_]:
    """(H, W) where two objects meet that move differently, by the (H, W, 2) flow of one direction.

    The flow matters at the objects' edges only (`object_edges`).
    """
    marked = np.zeros(object_index.shape, bool)
    for axis in (0, 1):
        first = tuple(slice(0, -1) if k == axis else slice(None) for k in (0, 1))
        second = tuple(slice(1, None) if k == axis else slice(None) for k in (0, 1))
        step = np.linalg.norm(flow[first] - flow[second], axis=-1)
        meets = (object_index[first] != object_index[second]) & (step >= BOUNDARY_STEP_PX)
        marked[first] |= meets
        marked[second] |= meets
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(marked.astype(np.uint8), connectivity=8)
    large = statistics[:, cv2.CC_STAT_AREA] >= BOUNDARY_PIXELS
    return marked & large[labels]


class ExtraTargets:
    """Makes the targets a recipe asks for besides the basic ones."""

    def __init__(self, caster: SceneRayCaster, kinds: tuple[str, ...]) -> None:
        """kinds: among `datagen.dataset.layout.EXTRA_TARGETS`."""
        self._caster, self._kinds = caster, kinds

    def make(
        self, eye: Eye, frame: int, object_index: NDArray[np.integer[Any]]
    ) -> dict[tuple[str, Direction | None], NDArray[Any]]:
        """The arrays of one eye and frame, by kind and direction. object_index: (H, W), the frame's."""
        made: dict[tuple[str, Direction | None], NDArray[Any]] = {}
        if "material_index" in self._kinds:
            made["material_index", None] = material_index(self._caster.geometry.scene, object_index)
        if set(self._kinds) <= {"material_index"}:
            return made
        pixels = np.indices(object_index.shape)
        surfaces = PixelSurfaces(self._caster, eye, frame, pixels[0], pixels[1])
        if "normals" in self._kinds:
            made["normals", None] = surfaces.normals()
        for direction in DIRECTIONS:
            if "disparity_change" in self._kinds:
                made["disparity_change", direction] = surfaces.disparity_change(direction)
            if not {"optical_flow", "motion_boundaries"} & set(self._kinds):
                continue
            flow = surfaces.flow(direction)
            if "optical_flow" in self._kinds:
                made["optical_flow", direction] = flow
            if "motion_boundaries" in self._kinds:
                made["motion_boundaries", direction] = motion_boundaries(flow, object_index)
        return made
