"""Stereo pairs with closed-form images and disparity, and data sets made of them.

A world is a stack of slanted layers. A layer covers a rectangle of the left image, has an affine disparity there and a
colour that is a sum of sinusoids of left-image coordinates, so either view can be evaluated at any real position.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.dataset.layout import FIRST_FRAME, Layout
from datagen.dataset.manifest import SceneManifest, file_entry, write_manifest
from datagen.formats import write_pfm, write_png
from training.data.augmentation import AugmentationConfig, StereoPair

WAVES = 12
NO_AUGMENTATION = AugmentationConfig(0.0, (0.0, 0.0), (0.0, 0.0), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Centre crops, unchanged."""


@dataclass(frozen=True)
class Layer:
    """d(x, y) = offset + slope_x x + slope_y y over x0 <= x < x1, y0 <= y < y1 of the left image."""

    offset: float
    slope_x: float
    slope_y: float
    box: tuple[float, float, float, float]
    waves: NDArray[np.float64]
    """(WAVES, 6): frequency along x, along y, phase, amplitudes of R, G, B."""

    def color(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        phases = self.waves[:, 0] * x[..., None] + self.waves[:, 1] * y[..., None] + self.waves[:, 2]
        return 0.5 + np.sin(phases) @ self.waves[:, 3:]

    def contains(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.bool_]:
        x0, x1, y0, y1 = self.box
        return (x0 <= x) & (x < x1) & (y0 <= y) & (y < y1)

    def disparity_left(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.offset + self.slope_x * x + self.slope_y * y

    def left_of_right(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        """The left column seen at a right column: x_right = x_left - d(x_left, y)."""
        return (x + self.offset + self.slope_y * y) / (1 - self.slope_x)


def random_layer(
    rng: np.random.Generator,
    offset: float,
    slopes: tuple[float, float] = (0.0, 0.0),
    box: tuple[float, float, float, float] = (-1e9, 1e9, -1e9, 1e9),
    longest_wave_px: float = 60.0,
    shortest_wave_px: float = 8.0,
) -> Layer:
    length = np.exp(rng.uniform(np.log(shortest_wave_px), np.log(longest_wave_px), WAVES))
    angle = rng.uniform(0, 2 * np.pi, WAVES)
    frequency = 2 * np.pi / length
    amplitudes = rng.normal(0, 1, (WAVES, 3))
    amplitudes *= 0.45 / np.abs(amplitudes).sum(axis=0)
    waves = np.column_stack(
        [frequency * np.cos(angle), frequency * np.sin(angle), rng.uniform(0, 2 * np.pi, WAVES), amplitudes]
    )
    return Layer(offset, *slopes, box, waves)


def render(layers: Sequence[Layer], height: int, width: int) -> StereoPair:
    """Both views and both disparities; later layers lie before earlier ones."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    images = np.zeros((2, height, width, 3))
    disparities = np.zeros((2, height, width), np.float32)
    for layer in layers:
        for view, x_left in enumerate((x, layer.left_of_right(x, y))):
            seen = layer.contains(x_left, y)
            images[view][seen] = layer.color(x_left, y)[seen]
            disparities[view][seen] = layer.disparity_left(x_left, y)[seen]
    left, right = np.rint(images * 255).astype(np.uint8)
    return StereoPair(left, right, *disparities)


def random_pair(rng: np.random.Generator, height: int, width: int, boxes: int = 3) -> StereoPair:
    """A slanted background and a few rectangles before it, 2 to about 30 px of disparity."""
    layers = [random_layer(rng, rng.uniform(2, 6), (0.0, rng.uniform(0, 4) / height))]
    for offset in np.sort(rng.uniform(8, 24, boxes)):
        x0, y0 = rng.uniform(0, width * 0.7), rng.uniform(0, height * 0.7)
        box = (x0, x0 + rng.uniform(0.2, 0.5) * width, y0, y0 + rng.uniform(0.2, 0.5) * height)
        layers.append(random_layer(rng, offset, (rng.uniform(-0.02, 0.02), 0.0), box))
    return render(layers, height, width)


def write_dataset(
    root: Path,
    seed: int,
    train: int = 4,
    val: int = 0,
    height: int = 64,
    width: int = 128,
    unknown_rows: int = 0,
) -> Path:
    """A data set in the native layout, as much of it as training reads: one frame a scene. The left ground
    truth of training scene n lacks its first n times `unknown_rows` rows."""
    layout = Layout(root)
    rng = np.random.default_rng(seed)
    for split, count in (("train", train), ("val", val)):
        for scene in range(count):
            pair = random_pair(rng, height, width)
            if split == "train":
                pair.disparity_left[: scene * unknown_rows] = np.nan
            _write_scene(layout, split, scene, pair)
    layout.recipe.write_text("family: synthetic\n")
    return root


def _write_scene(layout: Layout, split: str, scene: int, pair: StereoPair) -> None:
    entries = []
    views = {"left": (pair.left, pair.disparity_left), "right": (pair.right, pair.disparity_right)}
    for view, (image, disparity) in views.items():
        picture = layout.file("frames_cleanpass", split, scene, view, FIRST_FRAME)
        truth = layout.file("disparity", split, scene, view, FIRST_FRAME)
        for path in (picture, truth):
            path.parent.mkdir(parents=True, exist_ok=True)
        write_png(picture, image)
        write_pfm(truth, disparity)
        entries += [file_entry(layout.root, picture), file_entry(layout.root, truth)]
    manifest = layout.manifest(split, scene)
    manifest.parent.mkdir(parents=True, exist_ok=True)
    write_manifest(manifest, SceneManifest("synthetic", split, scene, "0" * 64, tuple(entries)))
