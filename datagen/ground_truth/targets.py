"""Targets that follow the surface a pixel shows: normals, optical flow, disparity change, motion boundaries.

A pixel's centre shows a point of a triangle. At another instant the triangle's vertices have moved, turned and
deformed, and so has the camera; where they are then gives the point's place exactly. Everything is computed with
64-bit floats and independent of what Blender rendered.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from datagen.dataset.layout import DIRECTIONS, Direction, View
from datagen.ground_truth.raycast import Hits, SceneRayCaster
from datagen.ground_truth.scene_geometry import SceneGeometry
from scenes import Scene

STEP: dict[Direction, int] = {"into_future": 1, "into_past": -1}
"""Frames from a pixel's instant to the one that its point is followed to."""
BOUNDARY_STEP_PX = 1.5
"""Neighbouring pixels of two objects whose flows differ by at least this lie on a motion boundary."""
BOUNDARY_PIXELS = 10
"""Fewer connected pixels than this are no boundary (both thresholds: Mayer et al., CVPR 2016, section 4)."""


@dataclass(frozen=True, eq=False)
class PixelSurfaces:
    """The surface points that N pixels of one view show at one instant; made by `find_surfaces`.

    The pixels form an array of shape S, the whole image's or a list's. What the methods return has that shape too.
    """

    geometry: SceneGeometry
    view: View
    time_frames: float
    """The instant, in frames."""
    shape: tuple[int, ...]
    """S."""
    is_hit: NDArray[np.bool_]
    """(N,) False where a pixel shows the sky. M pixels show a surface."""
    corners: NDArray[np.int32]
    """(M, 3) the vertices of the triangle that is hit, as indices into `SceneGeometry.vertices`."""
    weights: NDArray[np.float64]
    """(M, 3) barycentric coordinates of the point in its triangle."""
    centres: NDArray[np.float64]
    """(N, 2) pixel centres [x, y] in pixels."""
    rays: NDArray[np.float64]
    """(N, 3) directions through the pixel centres in the camera's frame (x right, y up, looking along -z)."""

    def normals(self) -> NDArray[np.float32]:
        """(*S, 3) unit normals of the triangles in the camera's frame, towards the camera; 0 for the sky."""
        a, b, c = np.moveaxis(self._seen_from(self.time_frames)[self.corners], 1, 0)
        normals = np.cross(b - a, c - a)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        away = np.einsum("ij,ij->i", normals, self.rays[self.is_hit]) > 0
        normals[away] *= -1
        return self._picture(normals, np.zeros((len(self.is_hit), 3)))

    def flow(self, direction: Direction) -> NDArray[np.float32]:
        """(*S, 2) optical flow [to the right, down] in px to the next or the previous frame.

        It is NaN for points that are behind the camera then. The sky moves with the camera's rotation only.
        """
        time = self.time_frames + STEP[direction]
        camera = self.geometry.scene.camera
        turn = camera.pose(self.view, time)[:3, :3].T @ camera.pose(self.view, self.time_frames)[:3, :3]
        there = self.rays @ turn.T
        there[self.is_hit] = self._points_at(time)
        with np.errstate(divide="ignore", invalid="ignore"):
            x, y = (there[:, :2] / -there[:, 2:]).T
        center_x, center_y = camera.principal_point(self.view)
        seen = np.stack([center_x + camera.focal_px * x, center_y - camera.focal_y_px * y], -1)
        seen[there[:, 2] >= 0] = np.nan
        return (seen - self.centres).reshape(*self.shape, 2).astype(np.float32)

    def disparity_change(self, direction: Direction) -> NDArray[np.float32]:
        """(*S,) px by which the point's disparity grows until the next or the previous frame.

        It is NaN for points that are behind the camera then, and 0 for the sky.
        """
        fb = self.geometry.scene.camera.disparity_metres
        now, then = (
            -self._points_at(time)[:, 2] for time in (self.time_frames, self.time_frames + STEP[direction])
        )
        with np.errstate(divide="ignore"):
            change = np.where(then > 0, fb / then - fb / now, np.nan)
        return self._picture(change, np.zeros(len(self.is_hit)))

    def _seen_from(self, time_frames: float) -> NDArray[np.float64]:
        """(V, 3) all vertices at an instant in this view's camera frame of that instant."""
        camera = self.geometry.scene.camera
        return self.geometry.vertices(time_frames, np.linalg.inv(camera.pose(self.view, time_frames)))

    def _points_at(self, time_frames: float) -> NDArray[np.float64]:
        """(M, 3) where the surface points are at an instant, in this view's camera frame of that instant."""
        corners = self._seen_from(time_frames)[self.corners]
        return np.einsum("ij,ijk->ik", self.weights, corners)

    def _picture(self, values: NDArray[np.float64], sky: NDArray[np.float64]) -> NDArray[np.float32]:
        """An image of the values where something is hit, and of `sky` elsewhere."""
        picture = sky.copy()
        picture[self.is_hit] = values
        return picture.reshape(*self.shape, *sky.shape[1:]).astype(np.float32)


def find_surfaces(
    caster: SceneRayCaster, view: View, time_frames: float, rows: NDArray[np.intp], columns: NDArray[np.intp]
) -> PixelSurfaces:
    """Cast a ray through the centre of each pixel; rows and columns have one shape S."""
    shape = rows.shape
    rows, columns = rows.ravel(), columns.ravel()
    points = caster.surface_points(view, time_frames, rows, columns)
    is_hit = points.triangle >= 0
    return PixelSurfaces(
        geometry=caster.geometry,
        view=view,
        time_frames=time_frames,
        shape=shape,
        is_hit=is_hit,
        corners=caster.geometry.triangles[points.triangle[is_hit]],
        weights=points.weights[is_hit],
        centres=np.stack([columns, rows], -1) + 0.5,
        rays=caster.directions(view, rows, columns),
    )


def reflective(scene: Scene, material_index: NDArray[np.integer[Any]]) -> NDArray[np.uint8]:
    """(...) 255 where the material that (...) material_index names is glossy, metallic or transparent, else 0.

    material_index: 0 for the sky, else 1 + the index in `Scene.materials`.
    """
    shows = [False, *(material.is_reflective for material in scene.materials)]
    return (np.array(shows) * np.uint8(255))[material_index]


def object_edges(object_index: NDArray[np.integer[Any]]) -> NDArray[np.bool_]:
    """(H, W) True where a pixel shows another object than one of its four neighbours."""
    marked = np.zeros(object_index.shape, bool)
    down, across = object_index[1:] != object_index[:-1], object_index[:, 1:] != object_index[:, :-1]
    marked[1:] |= down
    marked[:-1] |= down
    marked[:, 1:] |= across
    marked[:, :-1] |= across
    return marked


def motion_boundaries(flow: NDArray[np.float32], object_index: NDArray[np.integer[Any]]) -> NDArray[np.bool_]:
    """(H, W) True where two objects that move differently meet.

    flow: (H, W, 2) px, of one direction; only its values at the objects' edges matter (`object_edges`).
    object_index: (H, W).
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
    """Makes the targets that a recipe asks for besides the basic ones."""

    def __init__(self, caster: SceneRayCaster, kinds: tuple[str, ...]) -> None:
        """kinds: Names among `datagen.dataset.layout.EXTRA_TARGETS`."""
        self._caster, self._kinds = caster, kinds

    def make(self, view: View, frame: int, hits: Hits) -> dict[tuple[str, Direction | None], NDArray[Any]]:
        """The arrays of one view and frame, by kind and direction of time.

        frame: The instant, from 0. hits: Of all pixels (H, W) of that view and frame.
        """
        made: dict[tuple[str, Direction | None], NDArray[Any]] = {}
        scene = self._caster.geometry.scene
        if "material_index" in self._kinds:
            made["material_index", None] = hits.material_index.astype(np.uint16)
        if "depth" in self._kinds:
            made["depth", None] = scene.camera.depth(hits.disparity).astype(np.float32)
        if "reflective" in self._kinds:
            made["reflective", None] = reflective(scene, hits.material_index)
        if set(self._kinds) <= {"depth", "material_index", "reflective"}:
            return made
        pixels = np.indices(hits.object_index.shape)
        surfaces = find_surfaces(self._caster, view, frame, pixels[0], pixels[1])
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
                made["motion_boundaries", direction] = motion_boundaries(flow, hits.object_index)
        return made
