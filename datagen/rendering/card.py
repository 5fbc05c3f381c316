"""A data set's card, `README.md` and a picture: what the set is, so that it can be published as it is.

It follows from the recipe and the finished scenes alone, so it is the same however the set was rendered. Every run
writes it anew when the set has changed. A `README.md` that does not begin with `MARK` is somebody's own and stays. What
a `LICENSES.md` beside it says is taken over.
"""

from __future__ import annotations

import hashlib
import inspect
import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from datagen.dataset.layout import FIRST_FRAME, RENDER_PASSES, SPLITS, TARGETS, Layout
from datagen.dataset.manifest import SceneManifest, read_manifest
from datagen.dataset.samples import StereoSample, opened_layout
from datagen.errors import DatasetError
from datagen.formats import write_png
from datagen.recipe.recipe import Recipe, recipe_in
from datagen.rendering.staging import StagingArea
from scenes import FAMILIES
from stereoforge_kit.files import Tree

T = TypeVar("T")

CARD, PICTURE, LICENSES = "README.md", "card.png", "LICENSES.md"
MOST_FILES = 100
"""User assets that a card lists."""
MARK = "<!-- Written by stereoforge render, which replaces it; without this line it stays as it is. -->\n"
"""The first line of a card."""
MEASURED_SCENES = 200
"""Statistics are the means of so many scenes of each split at most, evenly spaced."""
SHOWN_SCENES = 3
TILE_PX = 320
"""Longest side of a picture in the card's."""
_MEANS = {
    "disparity_p01_px": ("disparity, 1st percentile", "{:.1f} px"),
    "disparity_median_px": ("disparity, median", "{:.1f} px"),
    "disparity_p99_px": ("disparity, 99th percentile", "{:.1f} px"),
    "occluded_share": ("occluded in the right view", "{:.1%}"),
    "out_of_frame_share": ("out of the right view's frame", "{:.1%}"),
    "visible_objects": ("objects in view", "{:.0f}"),
}
"""What a manifest's statistics are called here, and how they are written."""


@dataclass(frozen=True)
class Card:
    """A card that was composed."""

    text: str
    picture: NDArray[np.uint8] | None
    """(H, W, 3) sRGB: left view, right view and disparity of a few scenes; None if one of them is damaged."""


def update_card(tree: Tree, area: StagingArea) -> None:
    """Write the card of a data set anew if it has changed. A set without a finished scene has none.

    Another run may finish scenes meanwhile; then it is written again.
    """
    seen = None
    while (now := _finished(tree)) != seen and any(now.values()):
        seen = now
        present = tree.read(CARD).decode("utf-8", "replace") if tree.exists(CARD) else MARK
        if not present.startswith(MARK):
            return
        card = compose_card(tree)
        if card.picture is not None:
            write_png(area.folder / PICTURE, card.picture)
            _adopt(tree, area.folder / PICTURE)
        (area.folder / CARD).write_text(card.text, encoding="utf-8")
        _adopt(tree, area.folder / CARD)


def _adopt(tree: Tree, staged: Path) -> None:
    """Put a file into the data set unless it is there already."""
    if not tree.exists(staged.name) or tree.read(staged.name) != staged.read_bytes():
        tree.adopt(staged, staged.name)


def compose_card(tree: Tree) -> Card:
    """The card of a data set. Scenes that are damaged do not count. Raises DatasetError for a damaged recipe."""
    recipe = recipe_in(tree)
    with opened_layout(tree.name) as layout:
        scenes = {split: layout.committed_scenes(split) for split in SPLITS}
        manifests = {split: list(_manifests(layout, split, numbers)) for split, numbers in scenes.items()}
        picture = _picture(layout, recipe, scenes)
    notes = tree.read(LICENSES).decode("utf-8", "replace") if tree.exists(LICENSES) else None
    sections = (
        _lead(recipe, scenes),
        _contents(recipe, scenes),
        _statistics(manifests),
        _recipe(recipe, manifests),
        _licenses(recipe, notes),
        _loading(recipe, next(split for split in SPLITS if scenes[split] or split == "test")),
    )
    return Card(MARK + _stamp(recipe, scenes) + "\n" + "\n".join(sections), picture)


def is_of_these_scenes(layout: Layout, recipe: Recipe) -> bool:
    """Whether a data set's card, if it has one of ours, was written for the scenes that are finished now.

    Its wording may be that of another version.
    """
    if not layout.tree.exists(CARD):
        return True
    present = layout.tree.read(CARD).decode("utf-8", "replace")
    scenes = {split: layout.committed_scenes(split) for split in SPLITS}
    return not present.startswith(MARK) or _stamp(recipe, scenes) in present


def _stamp(recipe: Recipe, scenes: dict[str, list[int]]) -> str:
    """A line that stands for the scenes that a card is of."""
    said = json.dumps([recipe.settings_sha256(), scenes], sort_keys=True)
    return f"<!-- Of the scenes {hashlib.sha256(said.encode()).hexdigest()[:16]}. -->\n"


def _finished(tree: Tree) -> dict[str, list[str]]:
    folders = {split: Layout(Path()).manifest(split, 0).parent.as_posix() for split in SPLITS}
    return {split: tree.files_in(folder) for split, folder in folders.items()}


def _evenly_spaced(items: Sequence[T], count: int) -> list[T]:
    if len(items) <= count:
        return list(items)
    return [items[int(index)] for index in np.linspace(0, len(items) - 1, count).round()]


def _manifests(layout: Layout, split: str, scenes: list[int]) -> Iterator[SceneManifest]:
    for scene in _evenly_spaced(scenes, MEASURED_SCENES):
        with suppress(DatasetError):
            yield read_manifest(layout.local(layout.manifest(split, scene)))


def _picture(layout: Layout, recipe: Recipe, scenes: dict[str, list[int]]) -> NDArray[np.uint8] | None:
    # Imported here, since matplotlib's colours take a second that workers need not spend.
    from stereoforge_kit.viewing import disparity_picture, shrunk
    from stereoforge_kit.viewing.pictures import side_by_side, stacked

    rows = []
    first = [(split, scene) for split in SPLITS for scene in scenes[split]][:SHOWN_SCENES]
    for split, scene in first:
        sample = StereoSample(layout, split, scene, FIRST_FRAME, recipe.passes[0])
        try:
            nearest = max(float(np.percentile(sample.disparity_left, 99.5)), 1.0)
            pictures = (sample.left, sample.right, disparity_picture(sample.disparity_left, nearest))
        except DatasetError:
            return None  # The picture that is there may be of that scene before it was damaged.
        rows.append(side_by_side([shrunk(picture, TILE_PX) for picture in pictures]))
    return stacked(rows) if rows else None


def _lead(recipe: Recipe, scenes: dict[str, list[int]]) -> str:
    world = recipe.world
    pairs = sum(map(len, scenes.values())) * world.frames
    about = inspect.getdoc(inspect.getmodule(FAMILIES[recipe.family].sample)) or ""
    return (
        f"# {recipe.family}, {world.width} x {world.height}: {pairs} stereo pairs with exact ground truth\n"
        f"\n![left view, right view and disparity of the first scenes]({PICTURE})\n"
        f"\n{' '.join(about.split())}\n\n"
        "Rendered by StereoForge. Disparity, its gradient, occlusion and object indices of both views were computed "
        "from the scenes' geometry at the pixels' centres; they are not estimates.\n"
    )


def _contents(recipe: Recipe, scenes: dict[str, list[int]]) -> str:
    lines = ["| split | scenes | stereo pairs |", "|---|---|---|"]
    lines += [
        f"| {split} | {len(numbers)} | {len(numbers) * recipe.world.frames} |"
        for split, numbers in scenes.items()
        if numbers
    ]
    kinds = [RENDER_PASSES[name] for name in recipe.passes] + [*TARGETS, *recipe.targets]
    table = "\n".join(lines)
    return (
        f"## What is in it\n\n{table}\n\n"
        f"For every pair: {', '.join(kinds)}. No scene, mesh or texture is in two splits. Disparity is x_left - "
        "x_right in pixels; occlusion is 0 visible, 255 occluded, 128 out of the other frame. `manifest/` has the "
        "SHA-256 of every file, and `stereoforge verify` checks them.\n"
    )


def _statistics(manifests: dict[str, list[SceneManifest]]) -> str:
    used = {split: found for split, found in manifests.items() if found}
    lines = [f"| mean over scenes | {' | '.join(used)} |", "|---|" + "---|" * len(used)]
    for key, (title, form) in _MEANS.items():
        values = [
            [float(one.statistics[key]) for one in found if isinstance(one.statistics.get(key), int | float)]
            for found in used.values()
        ]
        if all(values):
            lines.append(f"| {title} | {' | '.join(form.format(float(np.mean(each))) for each in values)} |")
    return "## Statistics of the left views\n\n" + "\n".join(lines) + "\n"


def _recipe(recipe: Recipe, manifests: dict[str, list[SceneManifest]]) -> str:
    versions = {
        ", ".join(f"{name} {version}" for name, version in sorted(one.versions.items()))
        for found in manifests.values()
        for one in found
    }
    rig = recipe.world.rig
    camera = (
        f"one rig: fx {rig.fx:g}, fy {rig.fy:g}, cx {rig.cx_left:g} and {rig.cx_right:g}, cy {rig.cy:g} px, baseline "
        f"{rig.baseline_m:g} m"
        if rig
        else "drawn for every scene; `camera_data/` has K, poses and baseline of every frame"
    )
    return (
        "## How it was made\n\n"
        f"- `recipe.yaml`, settings SHA-256 `{recipe.settings_sha256()}`, seed {recipe.seed}.\n"
        "- The same scenes again: `stereoforge render --recipe recipe.yaml --out DIR`.\n"
        f"- Cameras: {camera}.\n"
        f"- Pictures: {recipe.pictures_made_by}.\n"
        + "".join(f"- Made with {made}.\n" for made in sorted(versions))
    )


def _licenses(recipe: Recipe, notes: str | None) -> str:
    pool = recipe.assets
    said = (
        "Everything else comes from rules and random numbers"
        if pool
        else "Everything in the pictures comes from rules and random numbers"
    )
    text = (
        f"## Licences\n\n{said}; StereoForge's own licence is that of the program, not of what it renders.\n"
    )
    if pool:
        rows = [
            f"| {kind} | {asset.name.replace('|', ' ')} | `{asset.sha256}` |"
            for kind, assets in (
                ("mesh", pool.meshes),
                ("texture", pool.textures),
                ("environment", pool.environments),
            )
            for asset in assets
        ]
        text += "\nFiles of the user's that the worlds are made with:\n\n| kind | file | SHA-256 |\n|---|---|---|\n"
        text += "\n".join(rows[:MOST_FILES]) + "\n"
        if len(rows) > MOST_FILES:
            text += f"\nAnd {len(rows) - MOST_FILES} more, which `assets.json` lists.\n"
        if notes is None:
            text += f"\nTheir licences: write them into `{LICENSES}` beside this file; the next run takes them over.\n"
    return text if notes is None else f"{text}\n{notes.strip()}\n"


def _loading(recipe: Recipe, split: str) -> str:
    clean = RENDER_PASSES[recipe.passes[0]]
    native = ', "final"' if recipe.passes[0] == "final" else ""
    return (
        "## Load it\n\n"
        "```python\n"
        'SceneFlowStereo("PARENT", variant="FlyingThings3D", pass_name='
        f'"{recipe.passes[0]}")  # torchvision, the set being PARENT/SceneFlow/FlyingThings3D\n'
        f'SceneFlowDatasets(root="PARENT", dstype="{clean}")  # RAFT-Stereo, the set being PARENT/FlyingThings3D\n'
        f'StereoDataset("PATH", "{split}"{native})  # from datagen import StereoDataset\n'
        "```\n"
    )
