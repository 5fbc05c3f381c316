"""`stereoforge render`: make a data set, or finish or extend one."""

from __future__ import annotations

import shutil
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from datagen import DatasetError, Recipe, RenderSummary, read_recipe, render_dataset
from datagen.assets import import_assets
from datagen.estimate import estimate_run
from datagen.layout import EXTRA_TARGETS, Layout
from datagen.manifest import SceneManifest
from scenes import FAMILIES
from stereoforge.errors import CommandError, UsageError
from stereoforge.progress import console, progress_bar
from stereoforge.values import parse_shard, parse_size, shown, shown_duration

DEFAULT_FAMILY = "flying_things"
DEFAULT_SCENES = 20


@dataclass(frozen=True)
class Render:
    """Render a stereo data set with exact ground truth; run it again to finish or extend it.

    With --recipe, the file says what to render and the flags given besides it change it.
    """

    out: Annotated[Path, shown("DIR")]
    """Folder of the data set."""
    family: Annotated[str | None, shown("NAME", DEFAULT_FAMILY)] = None
    """What kind of world."""
    scenes: Annotated[int | None, shown("N", DEFAULT_SCENES)] = None
    """How many scenes the split shall have in all."""
    frames_per_scene: Annotated[int | None, shown("N", 1)] = None
    """Frames in each scene."""
    size: Annotated[str | None, shown("WxH", "960x540")] = None
    """Image size in pixels."""
    split: Annotated[Literal["train", "val", "test"] | None, shown("train|val|test", "train")] = None
    """Which split to render; splits never share a scene, a mesh or a texture."""
    seed: Annotated[int | None, shown("N", 0)] = None
    """Everything random follows from it."""
    samples: Annotated[int | None, shown("N", 4)] = None
    """Paths a pixel for the pictures, denoised; ground truth is exact whatever this is."""
    passes: Annotated[str | None, shown("LIST", "clean")] = None
    """Render passes, comma-separated: clean, and final with motion blur, defocus, fog and sensor noise."""
    targets: Annotated[str | None, shown("all|LIST", "none")] = None
    """Targets besides disparity, gradient, occlusion and object index, comma-separated: material_index,
    normals, optical_flow, disparity_change, motion_boundaries."""
    device: Literal["cpu", "cuda", "optix", "hip", "metal"] = "cpu"
    """What Cycles computes on."""
    workers: Annotated[int | None, shown("N", "one a core")] = None
    """Worker processes."""
    executor: Literal["local"] = "local"
    """Where the workers run."""
    shard: Annotated[str, shown("I/N")] = "0/1"
    """Render only scenes I, I + N, I + 2N, ..., so that N machines can share a folder."""
    recipe: Annotated[Path | None, shown("FILE", "none")] = None
    """A recipe.yaml to render."""
    meshes: Annotated[Path | None, shown("DIR", "none")] = None
    """Your own OBJ, PLY, GLB and STL files, to fly among the generated things; each is used in one split only."""
    textures: Annotated[Path | None, shown("DIR", "none")] = None
    """Your own pictures, to paint things with."""
    environments: Annotated[Path | None, shown("DIR", "none")] = None
    """Your own equirectangular HDR and EXR pictures, to light the worlds."""
    dry_run: bool = False
    """Say what would be rendered, how long it would take and how much disk, measured on one frame of one
    scene; nothing is written."""

    def run(self) -> None:
        recipe = self._recipe()
        if self.workers is not None and self.workers < 1:
            raise UsageError(f"--workers must be at least 1, got {self.workers}")
        if self.meshes or self.textures or self.environments:
            recipe = self._with_assets(recipe)
        if self.dry_run:
            self._estimate(recipe)
            return
        summary = self._render(recipe)
        console.print(
            f"{self.out}: {summary.rendered} scenes rendered, {summary.already_there} were there already"
        )
        if summary.failures:
            for scene, reason in summary.failures:
                console.print(f"  {scene}: {reason}", markup=False)
            raise CommandError(f"{len(summary.failures)} scenes of {self.out} could not be rendered")

    def _with_assets(self, recipe: Recipe) -> Recipe:
        """Prepare the user's own files into the data set's folder and add them to the recipe."""
        if self.dry_run:
            raise UsageError("--dry-run reads no --meshes, --textures or --environments: leave them out")
        with tempfile.TemporaryDirectory(prefix="stereoforge-assets-") as prepared:
            imported = import_assets(
                Path(prepared), meshes=self.meshes, textures=self.textures, environments=self.environments
            )
            for sentence in imported.skipped:
                console.print(f"skipped {sentence}", markup=False)
            try:
                recipe = replace(recipe, assets=imported.pool)
            except DatasetError as error:
                raise UsageError(str(error)) from error
            render_dataset(replace(recipe, scenes={}), self.out)  # Claims the folder, or refuses it.
            shutil.copytree(prepared, Layout(self.out).assets, dirs_exist_ok=True)
        return recipe

    def _estimate(self, recipe: Recipe) -> None:
        found = estimate_run(recipe, self.out, device=self.device, shard=parse_shard(self.shard))
        splits = ", ".join(f"{count} {split}" for split, count in found.missing.items()) or "no"
        console.print(
            f"{self.out}: {splits} scenes of {recipe.family} to render, {found.already_there} are there already"
        )
        if found.frames:
            world, kinds = (
                recipe.world,
                ("disparity", "gradient", "occlusion", "object_index", *recipe.targets),
            )
            console.print(
                f"  {found.frames} stereo pairs of {world.width}x{world.height} in the passes "
                f"{', '.join(recipe.passes)}, with {', '.join(kinds)}"
            )
            console.print(
                f"  about {shown_duration(found.seconds)} on all cores of this machine, "
                f"{found.scene_seconds:.1f} s a scene"
            )
            console.print(
                f"  about {found.bytes / 1e6:,.0f} MB of disk, {found.scene_bytes / 1e6:.1f} MB a scene"
            )

    def _render(self, recipe: Recipe) -> RenderSummary:
        with progress_bar() as progress:
            task = progress.add_task(f"rendering {recipe.family}", total=None)

            def on_scene(done: int, total: int, _: SceneManifest | None) -> None:
                progress.update(task, completed=done, total=total)

            return render_dataset(
                recipe,
                self.out,
                workers=self.workers,
                device=self.device,
                shard=parse_shard(self.shard),
                on_scene=on_scene,
            )

    def _recipe(self) -> Recipe:
        base = read_recipe(self.recipe) if self.recipe else self._default_recipe()
        if self.recipe and self.family not in (None, base.family):
            raise UsageError(f"--recipe {self.recipe} is of family {base.family}, not {self.family}")
        world = base.world
        if self.size is not None:
            width, height = parse_size(self.size)
            world = replace(world, width=width, height=height)
        if self.frames_per_scene is not None:
            world = replace(world, frames=self.frames_per_scene)
        changes: dict[str, Any] = {"world": world}
        if self.scenes is not None or self.split is not None:
            split = self.split or "train"
            changes["scenes"] = {split: DEFAULT_SCENES if self.scenes is None else self.scenes}
        if self.passes is not None:
            changes["passes"] = tuple(self.passes.split(","))
        if self.targets is not None:
            changes["targets"] = EXTRA_TARGETS if self.targets == "all" else tuple(self.targets.split(","))
        changes |= {key: getattr(self, key) for key in ("seed", "samples") if getattr(self, key) is not None}
        try:
            return replace(base, **changes)
        except DatasetError as error:
            raise UsageError(str(error)) from error

    def _default_recipe(self) -> Recipe:
        family = self.family or DEFAULT_FAMILY
        if family not in FAMILIES:
            raise UsageError(f"there is no --family {family}; there are {', '.join(FAMILIES)}")
        return Recipe(FAMILIES[family].config(), {"train": DEFAULT_SCENES})
