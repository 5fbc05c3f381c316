"""All checks of one frame whose files are as they were written: its arrays, and the scene they show."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from datagen.checks import (
    check_disparity,
    check_geometry,
    check_gradient,
    check_images,
    check_object_index,
    check_views,
)
from datagen.dataset import StereoSample
from datagen.layout import EYES, FIRST_FRAME, RENDER_PASSES, Eye
from datagen.raycast import SceneRayCaster
from datagen.recipe import Recipe
from scenes import Scene


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
        for sample in self.samples:
            messages = check_images(sample.left, sample.right, sample.disparity_left, sample.occlusion_left)
            for message in messages:
                yield self._file(RENDER_PASSES[sample.render_pass], "right"), message

    def _file(self, kind: str, eye: Eye) -> Path:
        sample = self.samples[0]
        return sample.layout.file(kind, sample.split, sample.scene, eye, sample.frame)

    def _check_view(self, eye: Eye) -> Iterator[str]:
        sample = self.samples[0]
        view, other = sample.view(eye), sample.view("right" if eye == "left" else "left")
        threshold_px = self.recipe.gradient_threshold_px
        yield from check_gradient(view.disparity, view.gradient, view.gradient_valid, threshold_px)
        yield from check_object_index(view.object_index, view.disparity, len(self.scene.objects))
        yield from check_views(eye, view.disparity, other.disparity, view.occlusion)
        if self.caster is None:
            return
        rng = np.random.default_rng((sample.scene, sample.frame, EYES.index(eye)))
        pixels = rng.integers(0, view.disparity.size, self.sampled_pixels)
        rows, columns = np.unravel_index(pixels, view.disparity.shape)
        yield from check_geometry(
            view.disparity[rows, columns],
            view.object_index[rows, columns],
            view.occlusion[rows, columns],
            self.caster.cast(eye, sample.frame - FIRST_FRAME, rows, columns),
        )
