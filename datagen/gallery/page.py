"""The gallery of a data set: one HTML file with pictures of some scenes and statistics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from datagen.dataset.layout import SPLITS, Layout
from datagen.dataset.manifest import SceneManifest, read_manifest
from datagen.dataset.samples import StereoDataset, StereoSample, open_layout
from datagen.dataset.statistics import TEXTURE_DEVIATION, TEXTURE_WINDOW_PX, SetStatistics, measure
from datagen.errors import DatasetError
from datagen.recipe.disparity_histogram import DisparityHistogram
from datagen.recipe.recipe import Recipe, read_recipe
from stereoforge_kit.files import write_text
from stereoforge_kit.viewing import (
    Picture,
    disparity_picture,
    gradient_picture,
    index_picture,
    normals_picture,
    occlusion_picture,
    render_page,
    shrunk,
)
from stereoforge_kit.viewing.pictures import OCCLUDED_COLOR, OUT_OF_FRAME_COLOR
from stereoforge_kit.viewing.plots import histogram, svg

T = TypeVar("T")

LONGEST_SIDE_PX = 480
"""Larger pictures are made smaller, so that a gallery of 24 scenes stays below 10 MB."""
FULL_COLOR_GRADIENT = 0.25
"""Gradient in px per px that is drawn in full colour."""
FULL_COLOR_FLOW = 0.025
"""Flow, as a share of the image width, that is drawn in full colour."""
FULL_COLOR_CHANGE = 0.005
"""Change of disparity, as a share of the image width, that is drawn brightest."""
MEASURED_FRAMES = 100
"""Statistics are computed from at most so many frames of each split, evenly spaced."""


@dataclass(frozen=True)
class FramePanel:
    """The pictures of one frame and a summary."""

    name: str
    summary: str
    left: Picture
    right: Picture
    targets: tuple[tuple[str, Picture, int | None], ...]
    """Caption, picture, and JPEG quality or None for PNG."""


def write_gallery(
    root: Path | str,
    out_html: Path | str,
    *,
    scenes: int = 24,
    render_pass: str = "clean",
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write a gallery of a data set.

    Args:
        root: The data set's folder.
        out_html: The file to write. It needs no other file and opens from disk.
        scenes: Number of scenes to show by their first frames, evenly spaced over all finished ones.
        render_pass: Which images to show, "clean" or "final".
        progress: Called with (frames read, frames in all).

    Raises:
        DatasetError: For a folder that is no data set or has no finished scene, or for damaged files.
    """
    layout = open_layout(root)
    recipe = read_recipe(layout.recipe)
    splits = [split for split in SPLITS if layout.committed_scenes(split)]
    if not splits:
        raise DatasetError(f"{layout.root}: has no finished scene to show")
    datasets = {split: StereoDataset(layout.root, split, render_pass) for split in splits}
    measured = {split: evenly_spaced(dataset, MEASURED_FRAMES) for split, dataset in datasets.items()}
    shown = evenly_spaced(
        [sample for dataset in datasets.values() for sample in _first_frames(dataset)], scenes
    )
    tick = Ticker(sum(map(len, measured.values())) + len(shown), progress)
    statistics = {split: measure(map(tick, samples)) for split, samples in measured.items()}
    nearest = max(float(np.percentile(one.disparity, 99.9)) for one in statistics.values())
    nearest = max(nearest, 1.0)
    page = render_page(
        "datagen.gallery",
        "gallery.html",
        title=layout.root.resolve().name,
        lead=_lead(recipe, datasets),
        tiles=_tiles(layout, statistics, splits, recipe),
        plots=[svg(figure) for figure in histograms(statistics, recipe.disparities)],
        measured=sum(map(len, statistics.values())),
        keys=_keys(nearest),
        nearest_px=round(nearest),
        full_color_gradient=FULL_COLOR_GRADIENT,
        occluded_color=OCCLUDED_COLOR,
        out_of_frame_color=OUT_OF_FRAME_COLOR,
        texture_window=TEXTURE_WINDOW_PX,
        texture_deviation=TEXTURE_DEVIATION,
        panels=[_panel(tick(sample), recipe, nearest) for sample in shown],
        finished=sum(len(layout.committed_scenes(split)) for split in splits),
        facts=_facts(
            recipe, read_manifest(layout.manifest(splits[0], layout.committed_scenes(splits[0])[0]))
        ),
    )
    write_text(Path(out_html), page)


def evenly_spaced(items: Sequence[T], count: int) -> list[T]:
    """At most `count` of the items in order, evenly spaced, the first and the last among them."""
    if len(items) <= count:
        return list(items)
    return [items[int(index)] for index in np.linspace(0, len(items) - 1, count).round()]


class Ticker:
    """Passes samples through and reports how many have passed."""

    def __init__(self, total: int, progress: Callable[[int, int], None] | None) -> None:
        self._done, self._total, self._progress = 0, total, progress

    def __call__(self, sample: StereoSample) -> StereoSample:
        self._done += 1
        if self._progress is not None:
            self._progress(self._done, self._total)
        return sample


def _first_frames(dataset: StereoDataset) -> list[StereoSample]:
    first: dict[int, StereoSample] = {}
    for sample in dataset:
        first.setdefault(sample.scene, sample)
    return list(first.values())


def _panel(sample: StereoSample, recipe: Recipe, nearest_px: float) -> FramePanel:
    low, middle, high = np.percentile(sample.disparity_left, (1, 50, 99))
    not_visible = (sample.occlusion_left > 0).mean()
    objects = np.count_nonzero(np.unique(sample.object_index_left))
    gradient = np.where(sample.gradient_valid_left[..., None], sample.gradient_left, np.nan)
    pictures: tuple[tuple[str, Picture, int | None], ...] = (
        ("Disparity", disparity_picture(sample.disparity_left, nearest_px), 90),
        ("Not visible in the right view", occlusion_picture(sample.occlusion_left, sample.left), 85),
        ("Disparity gradient", gradient_picture(gradient, FULL_COLOR_GRADIENT), 90),
        ("Objects", index_picture(_thinned(sample.object_index_left)), None),
        *_extra_pictures(sample, recipe),
    )
    return FramePanel(
        name=sample.name,
        summary=(
            f"{objects} objects in view, disparity {low:.1f} to {high:.1f} px (1st to 99th percentile), "
            f"median {middle:.1f} px; {not_visible:.1%} of the left view is not visible in the right view."
        ),
        left=_small(sample.left),
        right=_small(sample.right),
        targets=tuple((name, _small(picture), quality) for name, picture, quality in pictures),
    )


def _extra_pictures(sample: StereoSample, recipe: Recipe) -> list[tuple[str, Picture, int | None]]:
    """Pictures of what the recipe asks for besides the basic targets: the other pass, then surfaces, then motion."""
    pictures: list[tuple[str, Picture, int | None]] = [
        (f"The {name} pass", replace(sample, render_pass=name).left, 82)
        for name in recipe.passes
        if name != sample.render_pass
    ]
    if "depth" in recipe.targets:
        with np.errstate(divide="ignore"):
            pictures.append(("Depth (inverse)", disparity_picture(1 / sample.depth("left")), 90))
    if "normals" in recipe.targets:
        pictures.append(("Surface normals", normals_picture(sample.normals("left")), 90))
    if "material_index" in recipe.targets:
        pictures.append(("Materials", index_picture(_thinned(sample.material_index("left"))), None))
    if "reflective" in recipe.targets:
        marked = (sample.reflective("left") > 0).astype(np.uint8)
        pictures.append(("Glossy, metallic or transparent", occlusion_picture(marked, sample.left), 85))
    if "optical_flow" in recipe.targets:
        full_px = FULL_COLOR_FLOW * sample.size[1]
        flow = gradient_picture(sample.flow("left", "into_future"), full_px)
        pictures.append((f"Flow to the next frame, full colour {full_px:.0f} px", flow, 90))
    if "disparity_change" in recipe.targets:
        change = np.abs(sample.disparity_change("left", "into_future"))
        full_px = FULL_COLOR_CHANGE * sample.size[1]
        pictures.append(
            (f"Change of disparity, brightest {full_px:.1f} px", disparity_picture(change, full_px), 90)
        )
    if "motion_boundaries" in recipe.targets:
        marked = sample.motion_boundaries("left", "into_future").astype(np.uint8)
        pictures.append(("Motion boundaries", occlusion_picture(marked, sample.left), 85))
    return pictures


def _small(picture: Picture) -> Picture:
    return shrunk(picture, LONGEST_SIDE_PX)


def _thinned(index: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Every n-th pixel. Unlike a mean, each is still the index of an object."""
    step = -(-max(index.shape) // LONGEST_SIDE_PX)
    return index[::step, ::step]


def _lead(recipe: Recipe, datasets: dict[str, StereoDataset]) -> str:
    counts = ", ".join(f"{len(dataset)} {split}" for split, dataset in datasets.items())
    return f"{recipe.family} at {recipe.world.width} × {recipe.world.height}: {counts} stereo pairs."


def _tiles(
    layout: Layout, statistics: dict[str, SetStatistics], splits: list[str], recipe: Recipe
) -> list[dict[str, str]]:
    disparity = np.concatenate([one.disparity for one in statistics.values()])
    low, middle, high = np.percentile(disparity, (1, 50, 99))
    joined = {
        name: np.concatenate([getattr(one, name) for one in statistics.values()])
        for name in ("occluded", "out_of_frame", "visible_objects", "textured")
    }
    values: tuple[tuple[str, str], ...] = (
        (f"{sum(len(layout.committed_scenes(split)) for split in splits)}", "finished scenes"),
        (f"{middle:.1f} px", f"median disparity; 98 % between {low:.1f} and {high:.1f} px"),
        (f"{joined['occluded'].mean():.1%}", "of the pixels occluded in the other view"),
        (f"{joined['out_of_frame'].mean():.1%}", "of the pixels out of the other view's frame"),
        (f"{joined['visible_objects'].mean():.0f}", "objects in view, on average"),
        (f"{joined['textured'].mean():.0%}", "of the pixels textured"),
    )
    if recipe.disparities:
        missed = recipe.disparities.missed(disparity)
        values += (
            (f"{missed:.1%}", "of the surfaces' pixels outside the histogram of disparities asked for"),
        )
    return [{"value": value, "label": label} for value, label in values]


def histograms(statistics: dict[str, SetStatistics], wanted: DisparityHistogram | None = None) -> list[Any]:
    """Histograms of the disparity over pixels, and of the other quantities over frames.

    Args:
        statistics: The statistics of each line by its name.
        wanted: The histogram of disparities asked for, drawn as one more line. It is scaled to the share of pixels
            that show surfaces.

    Returns:
        One matplotlib figure for each quantity.
    """
    nearest = max(float(np.percentile(one.disparity, 99.9)) for one in statistics.values())
    farthest = min(0.0, *(float(np.percentile(one.disparity, 0.1)) for one in statistics.values()))
    edges = np.linspace(farthest, max(nearest, 1.0), 61)
    lines = {split: _shares(one.disparity, edges) for split, one in statistics.items()}
    if wanted:
        disparity = np.concatenate([one.disparity for one in statistics.values()])
        below = np.interp(edges, wanted.edges_px, np.concatenate([[0], np.cumsum(wanted.shares)]))
        lines["asked for"] = 100 * float((disparity > 0).mean()) * np.diff(below)
    figures = [
        histogram(
            edges,
            lines,
            "disparity, px",
            "pixels, %",
            "Disparity",
        )
    ]
    for name, factor, x_label, title in (
        ("occluded", 100, "occluded pixels, %", "Occlusion"),
        ("visible_objects", 1, "objects in view", "Objects"),
        ("textured", 100, "textured pixels, %", "Texture"),
    ):
        values = {split: factor * np.asarray(getattr(one, name)) for split, one in statistics.items()}
        everything = np.concatenate(list(values.values()))
        bins = int(np.clip(np.sqrt(len(everything)), 4, 20))
        edges = np.linspace(everything.min(), max(everything.max(), everything.min() + 1), bins + 1)
        heights = {split: _shares(one, edges) for split, one in values.items()}
        figures.append(histogram(edges, heights, x_label, "frames, %", title))
    return figures


def _shares(values: NDArray[Any], edges: NDArray[np.float64]) -> NDArray[np.float64]:
    """Percentage of the values in each bin."""
    heights: NDArray[np.float64] = 100 * np.histogram(values, edges)[0] / len(values)
    return heights


def _keys(nearest_px: float) -> dict[str, Picture]:
    """The colour keys: a bar of disparities from 0 to the largest, and a disc of gradients."""
    bar = np.tile(np.linspace(0, nearest_px, 240), (12, 1))
    y, x = np.mgrid[-1:1:61j, -1:1:61j]
    disc = np.where((np.hypot(x, y) <= 1)[..., None], np.stack([x, y], axis=-1), np.nan)
    return {
        "disparity": disparity_picture(bar, nearest_px),
        "gradient": gradient_picture(FULL_COLOR_GRADIENT * disc, FULL_COLOR_GRADIENT),
    }


def _facts(recipe: Recipe, manifest: SceneManifest) -> dict[str, str]:
    seconds = ", ".join(f"{step} {value:.1f}" for step, value in manifest.seconds.items())
    return {
        "Family": recipe.family,
        "Seed": str(recipe.seed),
        "Pictures": recipe.pictures_made_by,
        "Passes": ", ".join(recipe.passes),
        "Recipe": recipe.settings_sha256(),
        "Made with": ", ".join(f"{name} {version}" for name, version in manifest.versions.items()),
        "Seconds for the first scene": seconds,
    }
