"""All checks of one frame whose files are as they were written: its arrays, and the scene they show."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.dataset.layout import DIRECTIONS, EYES, FIRST_FRAME, RENDER_PASSES, Direction, Eye
from datagen.dataset.samples import StereoSample
from datagen.ground_truth.raycast import SceneRayCaster
from datagen.ground_truth.targets import PixelSurfaces, material_index, motion_boundaries, object_edges
from datagen.recipe.recipe import Recipe
from datagen.verify.checks import (
    check_boundaries,
    check_derived,
    check_disparity,
    check_geometry,
    check_gradient,
    check_images,
    check_object_index,
    check_vectors,
    check_views,
)
from scenes import Scene

NORMAL_TOLERANCE = 1e-4
MOTION_TOLERANCE_PX = 1e-2
"""Of flow and disparity change, and relative where they are above 1 px."""


@dataclass(frozen=True)
class FrameCheck:
    """One frame, in every pass that was rendered, and what it is compared with."""

    samples: tuple[StereoSample, ...]
    """The same frame in each pass."""
    recipe: Recipe
    scene: Scene
    caster: SceneRayCaster | None
    """None to leave the geometry out."""
    sampled_pixels: int

    def problems(self) -> Iterator[tuple[Path, str]]:
        """Yield (file, sentence). Raises DatasetError for a file that does not decode or fit the others."""
        size = (self.scene.camera.height, self.scene.camera.width)
        sample = self.samples[0]
        if sample.size != size:
            left = self._file(RENDER_PASSES[sample.render_pass], "left")
            yield left, f"is {sample.size} where the scene's camera makes {size}"
            return
        unusable = [
            (self._file("disparity", eye), message)
            for eye in EYES
            for message in check_disparity(sample.view(eye).disparity)
        ]
        if unusable:  # Whatever else is wrong then follows from that.
            yield from unusable
            return
        for eye in EYES:
            for message in self._check_view(eye):
                yield self._file("disparity", eye), message
            yield from self._check_extra_targets(eye)
        for sample in self.samples:
            messages = check_images(sample.left, sample.right, sample.disparity_left, sample.occlusion_left)
            for message in messages:
                yield self._file(RENDER_PASSES[sample.render_pass], "right"), message

    def _file(self, kind: str, eye: Eye, direction: Direction | None = None) -> Path:
        sample = self.samples[0]
        return sample.layout.file(kind, sample.split, sample.scene, eye, sample.frame, direction)

    def _check_view(self, eye: Eye) -> Iterator[str]:
        sample = self.samples[0]
        view, other = sample.view(eye), sample.view("right" if eye == "left" else "left")
        threshold_px = self.recipe.gradient_threshold_px
        yield from check_gradient(view.disparity, view.gradient, view.gradient_valid, threshold_px)
        yield from check_object_index(view.object_index, view.disparity, len(self.scene.objects))
        yield from check_views(eye, view.disparity, other.disparity, view.occlusion)
        if self.caster is None:
            return
        rows, columns = self._sampled(eye)
        yield from check_geometry(
            view.disparity[rows, columns],
            view.object_index[rows, columns],
            view.occlusion[rows, columns],
            self.caster.cast(eye, sample.frame - FIRST_FRAME, rows, columns),
        )

    def _sampled(self, eye: Eye) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows and columns of the pixels that are compared with the geometry."""
        sample = self.samples[0]
        rng = np.random.default_rng((sample.scene, sample.frame, EYES.index(eye)))
        pixels = rng.integers(0, sample.size[0] * sample.size[1], self.sampled_pixels)
        rows, columns = np.unravel_index(pixels, sample.size)
        return rows, columns

    def _check_extra_targets(self, eye: Eye) -> Iterator[tuple[Path, str]]:
        """The targets that the recipe asks for besides the basic ones."""
        sample, kinds = self.samples[0], self.recipe.targets
        rows, columns = self._sampled(eye)
        surfaces = None
        if self.caster is not None and not set(kinds) <= {"material_index", "motion_boundaries"}:
            surfaces = PixelSurfaces(self.caster, eye, sample.frame - FIRST_FRAME, rows, columns)
        if "material_index" in kinds:
            stored, index = sample.material_index(eye), sample.view(eye).object_index
            if index.max() <= len(self.scene.objects):  # Else that is the problem, and has been told.
                worn = material_index(self.scene, index)
                for message in check_derived(stored, worn, "the objects' materials"):
                    yield self._file("material_index", eye), message
        if "normals" in kinds:
            normals = sample.normals(eye)[rows, columns]
            if surfaces is not None:
                for message in check_vectors(normals, surfaces.normals(), NORMAL_TOLERANCE):
                    yield self._file("normals", eye), message
        for direction in DIRECTIONS:
            yield from self._check_motion(eye, direction, surfaces)
        if "motion_boundaries" in kinds:
            yield from self._check_boundaries(eye)

    def _check_motion(
        self, eye: Eye, direction: Direction, surfaces: PixelSurfaces | None
    ) -> Iterator[tuple[Path, str]]:
        sample, kinds = self.samples[0], self.recipe.targets
        rows, columns = self._sampled(eye)
        if "optical_flow" in kinds:
            flow = sample.flow(eye, direction)[rows, columns]
            if surfaces is not None:
                for message in check_vectors(flow, surfaces.flow(direction), MOTION_TOLERANCE_PX):
                    yield self._file("optical_flow", eye, direction), message
        if "disparity_change" in kinds:
            change = sample.disparity_change(eye, direction)[rows, columns]
            if surfaces is not None:
                for message in check_vectors(
                    change, surfaces.disparity_change(direction), MOTION_TOLERANCE_PX
                ):
                    yield self._file("disparity_change", eye, direction), message

    def _check_boundaries(self, eye: Eye) -> Iterator[tuple[Path, str]]:
        """Motion boundaries follow from the stored flow; where none is stored, from that of the geometry."""
        sample, stored = self.samples[0], "optical_flow" in self.recipe.targets
        index = sample.view(eye).object_index
        for direction in DIRECTIONS:
            marked = sample.motion_boundaries(eye, direction)
            messages: Iterator[str] = iter(())
            if stored:
                expected = motion_boundaries(sample.flow(eye, direction), index)
                messages = check_derived(marked, expected, "optical flow and object index")
            elif self.caster is not None:
                flow = self._flow_at(self.caster, eye, direction, object_edges(index))
                messages = check_boundaries(marked, motion_boundaries(flow, index))
            for message in messages:
                yield self._file("motion_boundaries", eye, direction), message

    def _flow_at(
        self, caster: SceneRayCaster, eye: Eye, direction: Direction, where: NDArray[np.bool_]
    ) -> NDArray[np.float32]:
        """(H, W, 2) the geometry's flow at some pixels (H, W), NaN at all others."""
        flow = np.full((*where.shape, 2), np.nan, np.float32)
        if where.any():
            instant = self.samples[0].frame - FIRST_FRAME
            flow[where] = PixelSurfaces(caster, eye, instant, *np.nonzero(where)).flow(direction)
        return flow
