"""All checks of one frame whose files are intact: of its arrays, and of the scene that they show."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.dataset.layout import DIRECTIONS, FIRST_FRAME, RENDER_PASSES, VIEWS, Direction, View
from datagen.dataset.samples import StereoSample
from datagen.ground_truth.raycast import SceneRayCaster
from datagen.ground_truth.targets import (
    PixelSurfaces,
    find_surfaces,
    motion_boundaries,
    object_edges,
    reflective,
)
from datagen.recipe.recipe import Recipe
from datagen.verify.checks import (
    check_boundaries,
    check_depth,
    check_derived,
    check_disparity,
    check_geometry,
    check_gradient,
    check_images,
    check_materials,
    check_object_index,
    check_vectors,
    check_views,
)
from scenes import Scene

NORMAL_TOLERANCE = 1e-4
"""How far a component of a unit normal may be from the scene's geometry."""
MOTION_TOLERANCE_PX = 1e-2
"""How far flow and disparity change may be from the scene's geometry, relative where they are above 1 px."""


@dataclass(frozen=True)
class FrameCheck:
    """One frame, in every pass that was rendered, and what it is checked against."""

    samples: tuple[StereoSample, ...]
    """The same frame in each pass."""
    recipe: Recipe
    scene: Scene
    caster: SceneRayCaster | None
    """None to leave out the geometry."""
    sampled_pixels: int
    """Number of pixels of each view that are compared with the geometry."""

    def problems(self) -> Iterator[tuple[Path, str]]:
        """Yield (file, sentence) for each problem.

        Raises DatasetError for a file that does not decode or does not fit the others.
        """
        size = (self.scene.camera.height, self.scene.camera.width)
        sample = self.samples[0]
        if sample.size != size:
            left = self._file(RENDER_PASSES[sample.render_pass], "left")
            yield left, f"is {sample.size} where the scene's camera makes {size}"
            return
        unusable = [
            (self._file("disparity", view), message)
            for view in VIEWS
            for message in check_disparity(
                sample.view(view).disparity, self.scene.camera.disparity_at_infinity
            )
        ]
        if unusable:  # Other problems would only follow from this one.
            yield from unusable
            return
        for view in VIEWS:
            for message in self._check_view(view):
                yield self._file("disparity", view), message
            yield from self._check_extra_targets(view)
        for sample in self.samples:
            messages = check_images(sample.left, sample.right, sample.disparity_left, sample.occlusion_left)
            for message in messages:
                yield self._file(RENDER_PASSES[sample.render_pass], "right"), message

    def _file(self, kind: str, view: View, direction: Direction | None = None) -> Path:
        sample = self.samples[0]
        return sample.layout.file(kind, sample.split, sample.scene, view, sample.frame, direction)

    def _check_view(self, view: View) -> Iterator[str]:
        sample = self.samples[0]
        arrays, other = sample.view(view), sample.view("right" if view == "left" else "left")
        threshold_px = self.recipe.gradient_threshold_px
        yield from check_gradient(arrays.disparity, arrays.gradient, arrays.gradient_valid, threshold_px)
        at_infinity = self.scene.camera.disparity_at_infinity
        yield from check_object_index(
            arrays.object_index, arrays.disparity, len(self.scene.objects), at_infinity
        )
        yield from check_views(view, arrays.disparity, other.disparity, arrays.occlusion)
        if self.caster is None:
            return
        rows, columns = self._sampled(view)
        yield from check_geometry(
            arrays.disparity[rows, columns],
            arrays.object_index[rows, columns],
            arrays.occlusion[rows, columns],
            self.caster.cast(view, sample.frame - FIRST_FRAME, rows, columns),
        )

    def _sampled(self, view: View) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows and columns of the pixels that are compared with the geometry."""
        sample = self.samples[0]
        rng = np.random.default_rng((sample.scene, sample.frame, VIEWS.index(view)))
        pixels = rng.integers(0, sample.size[0] * sample.size[1], self.sampled_pixels)
        rows, columns = np.unravel_index(pixels, sample.size)
        return rows, columns

    def _check_extra_targets(self, view: View) -> Iterator[tuple[Path, str]]:
        """The targets that the recipe asks for besides the basic ones."""
        sample, kinds = self.samples[0], self.recipe.targets
        rows, columns = self._sampled(view)
        surfaces = None
        followed = {"depth", "material_index", "reflective", "motion_boundaries"}
        if self.caster is not None and not set(kinds) <= followed:
            surfaces = find_surfaces(self.caster, view, sample.frame - FIRST_FRAME, rows, columns)
        index = sample.view(view).object_index
        if index.max() <= len(self.scene.objects):  # Otherwise that is the problem and has been reported.
            for kind in ("material_index", "reflective"):
                if kind in kinds:
                    for message in self._check_materials(view, kind):
                        yield self._file(kind, view), message
        if "depth" in kinds:
            for message in check_depth(sample.depth(view), sample.view(view).disparity, self.scene.camera):
                yield self._file("depth", view), message
        if "normals" in kinds:
            normals = sample.normals(view)[rows, columns]
            if surfaces is not None:
                for message in check_vectors(normals, surfaces.normals(), NORMAL_TOLERANCE):
                    yield self._file("normals", view), message
        for direction in DIRECTIONS:
            yield from self._check_motion(view, direction, surfaces)
        if "motion_boundaries" in kinds:
            yield from self._check_boundaries(view)

    def _check_materials(self, view: View, kind: str) -> Iterator[str]:
        """A target that follows from the materials has, in each pixel, a value that one of the object's materials has.

        Which one of several shows the geometry alone, at the sampled pixels.
        """
        sample, scene = self.samples[0], self.scene
        index, stored = sample.view(view).object_index, getattr(sample, kind)(view)

        def value(materials: Any) -> NDArray[Any]:
            named = np.asarray(materials)
            return named if kind == "material_index" else reflective(scene, named)

        first = value([0, *(1 + thing.material for thing in scene.objects)])
        expected = first[index]
        for number, thing in enumerate(scene.objects, start=1):
            if thing.more_materials:
                own = (index == number) & np.isin(stored, value([1 + one for one in thing.materials]))
                expected[own] = stored[own]
        yield from check_derived(stored, expected, "the objects' materials")
        if self.caster is not None:
            rows, columns = self._sampled(view)
            hits = self.caster.cast(view, sample.frame - FIRST_FRAME, rows, columns)
            yield from check_materials(stored[rows, columns], value(hits.material_index))

    def _check_motion(
        self, view: View, direction: Direction, surfaces: PixelSurfaces | None
    ) -> Iterator[tuple[Path, str]]:
        sample, kinds = self.samples[0], self.recipe.targets
        rows, columns = self._sampled(view)
        if "optical_flow" in kinds:
            flow = sample.flow(view, direction)[rows, columns]
            if surfaces is not None:
                for message in check_vectors(flow, surfaces.flow(direction), MOTION_TOLERANCE_PX):
                    yield self._file("optical_flow", view, direction), message
        if "disparity_change" in kinds:
            change = sample.disparity_change(view, direction)[rows, columns]
            if surfaces is not None:
                for message in check_vectors(
                    change, surfaces.disparity_change(direction), MOTION_TOLERANCE_PX
                ):
                    yield self._file("disparity_change", view, direction), message

    def _check_boundaries(self, view: View) -> Iterator[tuple[Path, str]]:
        """Motion boundaries follow from the stored flow, or from the geometry's flow if none is stored."""
        sample, stored = self.samples[0], "optical_flow" in self.recipe.targets
        index = sample.view(view).object_index
        for direction in DIRECTIONS:
            marked = sample.motion_boundaries(view, direction)
            messages: Iterator[str] = iter(())
            if stored:
                expected = motion_boundaries(sample.flow(view, direction), index)
                messages = check_derived(marked, expected, "optical flow and object index")
            elif self.caster is not None:
                flow = self._flow_at(self.caster, view, direction, object_edges(index))
                messages = check_boundaries(marked, motion_boundaries(flow, index))
            for message in messages:
                yield self._file("motion_boundaries", view, direction), message

    def _flow_at(
        self, caster: SceneRayCaster, view: View, direction: Direction, where: NDArray[np.bool_]
    ) -> NDArray[np.float32]:
        """(H, W, 2) the geometry's flow at some pixels (H, W), NaN at all others."""
        flow = np.full((*where.shape, 2), np.nan, np.float32)
        if where.any():
            instant = self.samples[0].frame - FIRST_FRAME
            flow[where] = find_surfaces(caster, view, instant, *np.nonzero(where)).flow(direction)
        return flow
