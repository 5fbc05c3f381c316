"""`stereoforge render`: make a data set, or finish or extend one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from rich.table import Table

from datagen import DatasetError, Recipe, RenderSummary, read_recipe, render_dataset
from datagen.cameras.registry import read_calibration
from datagen.dataset.layout import EXTRA_TARGETS, Layout
from datagen.dataset.manifest import SceneManifest
from datagen.executors import Executor
from datagen.recipe.asset_pool import ASSET_KINDS, describe_splits, require_assets
from datagen.recipe.assets import ImportedAssets, copy_prepared, import_assets, prepared_assets_folder
from datagen.recipe.recipe import fit_disparities
from datagen.rendering.estimate import estimate_run
from datagen.rendering.quarantine import QuarantinedScene, quarantined_scenes
from datagen.rendering.run import SCENE_TIMEOUT_S, local_executor, ray_executor
from scenes import FAMILIES, FamilyConfig
from scenes.user_assets.pool import AssetPool
from stereoforge.errors import CommandError, UsageError
from stereoforge.inputs.flag_values import parse_histogram, parse_range, parse_shard, parse_size, shown
from stereoforge.pipelines.rendering import CyclesDevice, choose_device
from stereoforge.places import keep_apart
from stereoforge.progress import console, progress_bar, remark
from stereoforge_kit.errors import InputError
from stereoforge_kit.files import open_tree
from stereoforge_kit.viewing import duration

DEFAULT_FAMILY = "flying_things"
DEFAULT_SCENES = 20


@dataclass(frozen=True)
class Render:
    """Render a stereo data set with exact ground truth; run it again to finish or extend it.

    With --recipe, the file says what to render and the flags given besides it change it. A scene that crashes,
    hangs or exceeds its memory twice goes to DIR/quarantine and the others go on.
    """

    interrupted: ClassVar[str] = "the same command run again continues where it stopped"

    out: Annotated[str, shown("DIR")]
    """Folder of the data set, or a URL such as s3://bucket/folder."""
    family: Annotated[
        str | None, shown("NAME", DEFAULT_FAMILY, f"What kind of world: {', '.join(FAMILIES)}.")
    ] = None
    scenes: Annotated[int | None, shown("N", f"{DEFAULT_SCENES}, or the recipe's")] = None
    """How many scenes the split shall have in all."""
    frames_per_scene: Annotated[int | None, shown("N", 1)] = None
    """Frames in each scene."""
    size: Annotated[str | None, shown("WxH", "960x540, or the camera's")] = None
    """Image size in pixels."""
    camera: Annotated[str | None, shown("FILE", "the family's cameras")] = None
    """Render as a rig of your own sees: a calibration by OpenCV (YAML), Middlebury, KITTI, ROS (LEFT.yaml,RIGHT.yaml)
    or as JSON. --size scales it to another size of the same shape."""
    split: Annotated[Literal["train", "val", "test"] | None, shown("train|val|test", "train")] = None
    """Which split to render; splits never share a scene, a mesh or a texture."""
    seed: Annotated[int | None, shown("N", 0)] = None
    """Everything random follows from it."""
    samples: Annotated[int | None, shown("N", 4)] = None
    """Paths a pixel for the pictures, denoised; ground truth is exact whatever this is."""
    engine: Annotated[Literal["cycles", "workbench"] | None, shown("cycles|workbench", "cycles")] = None
    """What makes the pictures: cycles follows light; workbench draws drafts with OpenGL, without lamps, shadows and
    reflections, in a quarter to seven tenths of the time. Networks learn more from as many minutes of drafts."""
    passes: Annotated[str | None, shown("LIST", "clean")] = None
    """Render passes, comma-separated: clean, and final with motion blur, defocus, fog and sensor noise."""
    targets: Annotated[str | None, shown("all|LIST", "none")] = None
    """Targets besides disparity, gradient, occlusion and object index, comma-separated: depth,
    material_index, reflective, normals, optical_flow, disparity_change, motion_boundaries."""
    device: Literal["auto", "cpu", "cuda", "optix", "hip", "metal"] = "auto"
    """What Cycles computes on; auto takes the GPU that Blender finds on this machine, else the cpu."""
    workers: Annotated[int | None, shown("N", "one a core")] = None
    """Worker processes."""
    only_failed: bool = False
    """Try again the scenes in quarantine, and nothing else."""
    scene_timeout: Annotated[float, shown("S")] = SCENE_TIMEOUT_S
    """Seconds after which a scene's worker is ended."""
    worker_memory: Annotated[float | None, shown("GB", "this machine's memory, shared by the workers")] = None
    """Memory in GB beyond which a scene's worker is ended."""
    executor: Literal["local", "ray"] = "local"
    """Where the workers run: on this machine, or on those of a Ray cluster."""
    ray_address: Annotated[str | None, shown("ADDR", "a cluster of this machine alone")] = None
    """The Ray cluster to use, such as auto or ray://host:10001."""
    shard: Annotated[str, shown("I/N")] = "0/1"
    """Render only scenes I, I + N, I + 2N, ..., so that N machines can share a folder."""
    recipe: Annotated[Path | None, shown("FILE", "none")] = None
    """A recipe.yaml to render."""
    meshes: Annotated[Path | None, shown("DIR", "none")] = None
    """Your own OBJ, PLY, glTF, GLB and STL files, with their materials and textures, for things among the generated
    ones; each is used in one split only."""
    up_axis: Annotated[Literal["auto", "y", "z"], shown("auto|y|z")] = "auto"
    """Which axis of your meshes points up; auto: y in glTF and GLB files, as glTF has it, and z in the others."""
    mesh_materials: Annotated[Literal["keep", "replace"] | None, shown("keep|replace", "keep")] = None
    """Whether your meshes keep the materials that their files have or get the family's own."""
    keep_size: bool = False
    """Take your meshes' units as metres, instead of scaling each to what it replaces."""
    textures: Annotated[Path | None, shown("DIR", "none")] = None
    """Your own pictures, to paint things with."""
    environments: Annotated[Path | None, shown("DIR", "none")] = None
    """Your own equirectangular panoramas, HDR, EXR, JPEG or PNG, to light the worlds."""
    environment_exposure: Annotated[float | None, shown("EV", 0)] = None
    """How much brighter your panoramas shine than the generated skies, in stops; below 0 they are darker."""
    own_share: Annotated[float | None, shown("SHARE", 0.5)] = None
    """Share from 0 to 1 of the things, surfaces and skies that can be replaced to make from your own files."""
    disparity_range: Annotated[str | None, shown("LOW,HIGH", "the family's")] = None
    """Least and greatest disparity of surfaces in pixels, met by choosing depths (flying_things) or the baseline
    (the others, which reach to the horizon: LOW is 0); scenes outside are drawn anew."""
    disparity_histogram: Annotated[str | None, shown("LOW-HIGH:WEIGHT,...", "the family's")] = None
    """How many pixels of surfaces shall have which disparity over all scenes together, such as
    2-20:30,20-60:50,60-120:20: ranges in pixels and their weights, met by choosing depths and baseline."""
    curriculum: Annotated[int | None, shown("N", 0)] = None
    """Over the first N scenes of the train split the worlds grow from a tenth of their things to all of them."""
    dry_run: bool = False
    """Say what would be rendered, how long it would take and how much disk, measured on one frame of one
    scene; nothing is written."""

    def run(self) -> None:
        """Render what is missing, showing progress; exit code 1 if a scene failed."""
        parse_shard(self.shard)
        if not self.out:
            raise UsageError("--out needs a folder or a URL")
        for flag in ("meshes", "textures", "environments"):
            keep_apart("--out", self.out, f"--{flag}", getattr(self, flag))
        if self.own_share is not None:
            if not 0 < self.own_share <= 1:
                raise UsageError(f"--own-share must be above 0 and at most 1, got {self.own_share:g}")
            if not (self.meshes or self.textures or self.environments):
                raise UsageError("--own-share goes with --meshes, --textures or --environments")
        for flag in ("mesh_materials", "keep_size"):
            if getattr(self, flag) and not self.meshes:
                raise UsageError(f"--{flag.replace('_', '-')} goes with --meshes")
        if self.environment_exposure is not None and not self.environments:
            raise UsageError("--environment-exposure goes with --environments")
        if self.dry_run and self.only_failed:
            raise UsageError(
                "--dry-run counts what is missing, not what is in quarantine: leave --only-failed out"
            )
        recipe = self._recipe()
        replace(self, device=self._device_for(recipe))._run(recipe)

    def _device_for(self, recipe: Recipe) -> CyclesDevice:
        """What Cycles computes on; a recipe of drafts has no use for it."""
        if recipe.engine == "workbench":
            for flag, said in (("device", self.device not in ("auto", "cpu")), ("samples", self.samples)):
                if said:
                    raise UsageError(f"--{flag} is for the engine cycles; workbench draws with OpenGL")
            return "cpu"
        return choose_device() if self.device == "auto" else self.device

    def _run(self, recipe: Recipe) -> None:
        executor = self._executor()
        recipe = fit_disparities(recipe)  # Once, also where assets make the folder first.
        if self.meshes or self.textures or self.environments:
            recipe = self._with_assets(recipe)
        if self.dry_run:
            self._estimate(recipe)
            return
        summary = self._render(recipe, executor)
        console.print(
            f"{self.out}: {summary.rendered} scenes rendered, {summary.already_there} were there already"
        )
        if summary.failures:
            console.print(_failure_table(summary.failures))
            raise CommandError(
                f"{len(summary.failures)} scenes could not be rendered; {self.out}/quarantine has their records and "
                "logs, and --only-failed tries them again"
            )

    def _with_assets(self, recipe: Recipe) -> Recipe:
        """Prepare the user's own files into the data set's folder and add them to the recipe."""
        if self.dry_run:
            raise UsageError("--dry-run reads no --meshes, --textures or --environments: leave them out")
        if "://" in self.out:
            raise UsageError("--meshes, --textures and --environments need a folder for --out, not a URL")
        with prepared_assets_folder() as store:
            present = Layout(Path(self.out)).recipe
            known = read_recipe(present).assets if present.is_file() else recipe.assets
            imported = self._import(store, known, self._asset_settings(recipe.assets).keep_materials)
            for sentence in imported.skipped:
                remark(f"skipped {sentence}")
            for sentence in (*imported.remarks, *describe_splits(imported.pool)):
                remark(sentence)
            try:
                require_assets(imported.pool, (split for split, count in recipe.scenes.items() if count))
                given = {kind: getattr(imported.pool, kind) for kind in ASSET_KINDS if getattr(self, kind)}
                recipe = replace(recipe, assets=replace(self._asset_settings(recipe.assets), **given))
            except InputError as error:
                raise UsageError(str(error)) from error
            render_dataset(replace(recipe, scenes={}), self.out)  # Claims the folder, or refuses it.
            copy_prepared(imported.pool, store, Layout(Path(self.out)).assets)
        return recipe

    def _asset_settings(self, before: AssetPool) -> AssetPool:
        """The recipe's settings for user assets, changed as the flags say."""
        changes: dict[str, Any] = {}
        if self.own_share is not None:
            changes["share"] = self.own_share
        if self.mesh_materials is not None:
            changes["keep_materials"] = self.mesh_materials == "keep"
        if self.keep_size:
            changes["keep_size"] = True
        if self.environment_exposure is not None:
            changes["environment_ev"] = self.environment_exposure
        return replace(before, **changes)

    def _import(self, store: Path, known: AssetPool, keep_materials: bool) -> ImportedAssets:
        with progress_bar() as progress:
            task = progress.add_task("preparing your files", total=None)
            return import_assets(
                store,
                meshes=self.meshes,
                textures=self.textures,
                environments=self.environments,
                up_axis=self.up_axis,
                keep_materials=keep_materials,
                known=known,
                progress=lambda kind, done, total: progress.update(
                    task, completed=done, total=total, description=f"preparing {kind}"
                ),
            )

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
                f"  about {duration(found.seconds)} on all cores of this machine, "
                f"{found.scene_seconds:.1f} s a scene"
            )
            console.print(
                f"  about {found.bytes / 1e6:,.0f} MB of disk, {found.scene_bytes / 1e6:.1f} MB a scene"
            )

    def _executor(self) -> Executor:
        if self.workers is not None and self.workers < 1:
            raise UsageError(f"--workers must be at least 1, got {self.workers}")
        if not self.scene_timeout > 0:
            raise UsageError(f"--scene-timeout must be positive, got {self.scene_timeout:g}")
        if self.worker_memory is not None and not self.worker_memory > 0:
            raise UsageError(f"--worker-memory must be positive, got {self.worker_memory:g}")
        memory_bytes = None if self.worker_memory is None else int(self.worker_memory * 1e9)
        if self.executor == "ray":
            return ray_executor(self.ray_address, self.workers, self.device, self.scene_timeout, memory_bytes)
        if self.ray_address is not None:
            raise UsageError("--ray-address goes with --executor ray")
        return local_executor(self.workers, self.device, self.scene_timeout, memory_bytes)

    def _render(self, recipe: Recipe, executor: Executor) -> RenderSummary:
        with progress_bar() as progress:
            task = progress.add_task(f"rendering {recipe.family}", total=None)

            def on_scene(done: int, total: int, _: SceneManifest | None) -> None:
                progress.update(task, completed=done, total=total)

            return render_dataset(
                recipe,
                self.out,
                device=self.device,
                shard=parse_shard(self.shard),
                executor=executor,
                only=quarantined_scenes(open_tree(self.out)) if self.only_failed else None,
                on_scene=on_scene,
            )

    def _recipe(self) -> Recipe:
        base = read_recipe(self.recipe) if self.recipe else self._default_recipe()
        if self.recipe and self.family not in (None, base.family):
            raise UsageError(f"--recipe {self.recipe} is of family {base.family}, not {self.family}")
        world = self._sized(base.world)
        if self.frames_per_scene is not None:
            if self.frames_per_scene < 1:
                raise UsageError(f"--frames-per-scene must be at least 1, got {self.frames_per_scene}")
            world = replace(world, frames=self.frames_per_scene)
        changes: dict[str, Any] = {"world": world}
        if self.scenes is not None or self.split is not None:
            split = self.split or "train"
            changes["scenes"] = {split: self._count(base, split) if self.scenes is None else self.scenes}
        if self.passes is not None:
            changes["passes"] = tuple(self.passes.split(","))
        if self.targets is not None:
            changes["targets"] = EXTRA_TARGETS if self.targets == "all" else tuple(self.targets.split(","))
        if self.disparity_range is not None:
            limits = parse_range(self.disparity_range)
            changes["curation"] = replace(base.curation, disparity_px=limits)
        if self.disparity_histogram is not None:
            changes["disparities"] = parse_histogram(self.disparity_histogram)
        if self.curriculum is not None:
            changes["curriculum_scenes"] = self.curriculum
        changes |= {
            key: getattr(self, key) for key in ("seed", "samples", "engine") if getattr(self, key) is not None
        }
        try:
            return replace(base, **changes)
        except DatasetError as error:
            raise UsageError(str(error)) from error

    def _sized(self, world: FamilyConfig) -> FamilyConfig:
        """The family's config with the images' size, and with the rig that is to see it."""
        size = parse_size(self.size) if self.size is not None else None
        if self.camera is None:
            if size is None:
                return world
            if world.rig:
                raise UsageError("--size goes with --camera here: the recipe has a rig of its own")
            return replace(world, width=size[0], height=size[1])
        calibration = read_calibration(self.camera)
        try:
            rig = calibration.rig(size)
        except InputError as error:
            raise UsageError(f"--camera {self.camera}: {error}") from error
        if calibration.size not in (None, (rig.width, rig.height)):
            console.print(
                f"{self.camera}: scaled from {calibration.size[0]}x{calibration.size[1]} to {self.size}"
            )
        return replace(world, width=rig.width, height=rig.height, rig=rig)

    def _count(self, base: Recipe, split: str) -> int:
        """Scenes of a split of which --scenes does not say how many."""
        if self.recipe is None:
            return DEFAULT_SCENES
        if split not in base.scenes:
            raise UsageError(f"--recipe {self.recipe} has no scenes of split {split}; --scenes says how many")
        return base.scenes[split]

    def _default_recipe(self) -> Recipe:
        family = self.family or DEFAULT_FAMILY
        if family not in FAMILIES:
            raise UsageError(f"there is no --family {family}; there are {', '.join(FAMILIES)}")
        return Recipe(FAMILIES[family].config(), {"train": DEFAULT_SCENES})


def _failure_table(failures: tuple[QuarantinedScene, ...]) -> Table:
    table = Table(title="in quarantine", title_justify="left")
    for heading in ("scene", "what happened", "attempts"):
        table.add_column(heading, overflow="fold")
    for entry in failures:
        table.add_row(entry.name, entry.reason, str(entry.attempts))
    return table
