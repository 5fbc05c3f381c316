"""Rendering a data set: finding the missing scenes, giving them to workers and taking in the outcomes."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from zipfile import is_zipfile

from datagen.dataset.layout import SPLITS, Layout, SceneKey, scene_numbers
from datagen.dataset.manifest import SceneManifest
from datagen.errors import DatasetError, DiskFullError, MachineError
from datagen.executors import Executor, LocalExecutor, Outcome, RayExecutor, WorkerPolicy
from datagen.executors.devices import assign_devices, find_gpus
from datagen.recipe.asset_pool import require_assets
from datagen.recipe.recipe import Recipe, fit_disparities, merge_into, recipe_in, write_recipe
from datagen.rendering.card import update_card
from datagen.rendering.preflight import (
    NO_BLENDER,
    check_device,
    check_disparity_range,
    check_engine,
    has_blender,
)
from datagen.rendering.quarantine import (
    QuarantinedScene,
    put_in_quarantine,
    quarantined_scenes,
    read_quarantined,
    release,
)
from datagen.rendering.run_log import RunLog, run_log
from datagen.rendering.scene_job import SceneJob, render_scene
from datagen.rendering.staging import (
    StagingArea,
    begun_before,
    discard_uncommitted,
    manifest_digest,
    staging_area,
)
from stereoforge_kit.files import LocalTree, Tree, open_tree
from stereoforge_kit.processes import Limits, available_memory_bytes, check_main_guard

SCENE_TIMEOUT_S = 1800.0
"""How long one scene may take by default."""
MEMORY_SHARE = 0.8
"""Share of the machine's memory that all workers together may use."""
NO_ROOM_BYTES = 16 << 20
"""With less room than this a failure is put down to the full disk: Blender does not say so itself."""


@dataclass(frozen=True)
class RenderSummary:
    """What a run of `render_dataset` did."""

    recipe: Recipe
    """The folder's recipe after the run."""
    rendered: int
    """Scenes that this run rendered."""
    already_there: int
    """Scenes asked for that were finished before."""
    failures: tuple[QuarantinedScene, ...]
    """The scenes asked for that are in quarantine now, from this run or an earlier one, or could not be replaced."""


def render_dataset(
    recipe: Recipe,
    root: Path | str,
    *,
    workers: int | None = None,
    device: str = "cpu",
    shard: tuple[int, int] = (0, 1),
    executor: Executor | None = None,
    only: Collection[SceneKey] | None = None,
    again: bool = False,
    on_scene: Callable[[int, int, SceneManifest | None], None] | None = None,
) -> RenderSummary:
    """Render the missing scenes of a recipe under `root`. Running it again finishes or extends the data set.

    A scene that crashes, hangs, exceeds its memory or raises an error goes to quarantine with its record and log,
    and the others go on. Later runs leave it alone unless it is named in `only`.

    Args:
        recipe: What to render. Its disparity histogram is fitted first if need be (`fit_disparities`).
        root: A folder, or a URL that fsspec knows, such as s3://bucket/folder.
        workers: Worker processes; None for one per core or one per GPU.
        device: What Cycles computes on: cpu, cuda, optix, hip or metal.
        shard: (i, n) renders only every n-th scene from the i-th, so that n machines can share a folder.
        executor: Where scenes are rendered; None for worker processes on this machine.
        only: Render these (split, number) if they are missing, and nothing else.
        again: Render those in `only` though they are there. Each takes the old one's place when it is whole; one that
            cannot be rendered stays as it is and goes to no quarantine.
        on_scene: Called after each scene with (scenes done, scenes in all, the manifest or None if it failed).

    Raises:
        DatasetError: If the folder has other files or a data set of other settings, if this machine has no such
            device, or if scenes cannot have the disparities asked for. Nothing has been written then.
        MachineError: If this machine or the calling script is at fault, not a scene: no Blender, no main guard, a
            folder that cannot be written. The finished scenes are whole, and none is in quarantine for it.
        DiskFullError: If there is no room for more. The finished scenes are whole.
    """
    check_main_guard()
    tree = open_tree(root)
    if isinstance(tree, LocalTree) and tree.root.exists() and not tree.root.is_dir():
        raise DatasetError(f"{tree.name} is a file, not a folder; give a new or empty folder")
    wanted = list(_wanted(recipe, shard))
    recipe = fit_disparities(recipe)
    merged = _merge(tree, recipe)
    if wanted:
        check_store(tree, recipe)
    executor = executor or local_executor(workers, device)
    _check_possible(recipe, device, executor, tree, wanted)
    with staging_area(tree) as area, run_log(tree, area.folder) as log:
        _write_recipe(tree, area, merged)
        quarantined = set(quarantined_scenes(tree))
        present = committed_scenes(tree)
        chosen = set(wanted) - quarantined if only is None else set(only)
        missing = [scene for scene in wanted if scene in chosen and (again or scene not in present)]
        jobs = [
            SceneJob(
                tree,
                area,
                recipe,
                *scene,
                device,
                executor.threads,
                replaces=manifest_digest(tree, *scene) if scene in present else None,
            )
            for scene in missing
        ]
        run = _Run(tree, area, recipe, log, quarantined, len(jobs), on_scene)
        if jobs and not isinstance(tree, LocalTree):
            run.begun_before = begun_before(tree, recipe.scenes)
        run.go(executor, jobs)
        update_card(tree, area)
    asked = run.quarantined if only is None else run.quarantined & set(only)
    failures = tuple(
        read_quarantined(tree, *scene) for scene in wanted if scene in asked - run.not_replaced.keys()
    )
    failures += tuple(run.not_replaced.values())
    already_there = sum(scene in present for scene in wanted)
    return RenderSummary(replace(merged, scenes=recipe.scenes), run.rendered, already_there, failures)


def local_executor(
    workers: int | None = None,
    device: str = "cpu",
    timeout_s: float = SCENE_TIMEOUT_S,
    memory_bytes: int | None = None,
) -> LocalExecutor:
    """Worker processes on this machine that together fit into its memory.

    Args:
        workers: How many; None for one per core or one per GPU.
        device: What Cycles computes on.
        timeout_s: How long one scene may take.
        memory_bytes: How much memory one scene may use; None for its worker's share.
    """
    cores = len(os.sched_getaffinity(0))
    gpus = find_gpus(device, os.environ)
    environments = assign_devices(device, gpus, workers if gpus else workers or cores)
    share = int(MEMORY_SHARE * available_memory_bytes() / len(environments))
    return LocalExecutor(environments, WorkerPolicy(Limits(timeout_s, memory_bytes or share)))


def ray_executor(
    address: str | None = None,
    workers: int | None = None,
    device: str = "cpu",
    timeout_s: float = SCENE_TIMEOUT_S,
    memory_bytes: int | None = None,
) -> RayExecutor:
    """Workers of a Ray cluster: one per CPU, or one per GPU.

    Args:
        address: The cluster's address; None for a cluster of this machine alone.
        workers: At most so many; None for all that the cluster has room for.
        device: What Cycles computes on.
        timeout_s: How long one scene may take.
        memory_bytes: How much memory one scene may use; None for no limit, since the machines of a cluster differ.
    """
    policy = WorkerPolicy(Limits(timeout_s, memory_bytes))
    return RayExecutor(address, workers, gpus_per_job=0.0 if device == "cpu" else 1.0, policy=policy)


@dataclass
class _Run:
    """Takes in the outcomes of a run as they come: counts, logs and quarantines them."""

    tree: Tree
    area: StagingArea
    recipe: Recipe
    log: RunLog
    quarantined: set[SceneKey]
    total: int
    on_scene: Callable[[int, int, SceneManifest | None], None] | None
    begun_before: set[SceneKey] = field(default_factory=set)
    """Scenes behind a URL of which there were files before this run: they are not its to remove."""
    in_flight: set[SceneKey] = field(default_factory=set)
    rendered: int = 0
    bytes_written: int = 0
    not_replaced: dict[SceneKey, QuarantinedScene] = field(default_factory=dict)
    """The scenes that could not be rendered again and are as they were."""

    def go(self, executor: Executor, jobs: list[SceneJob]) -> None:
        settings = self.recipe.settings_sha256()
        self.log.write("run_started", scenes=self.total, executor=repr(executor), recipe_sha256=settings)
        try:
            with closing(executor.run(render_scene, self._handed_out(jobs))) as outcomes:
                for done, outcome in enumerate(outcomes, start=1):
                    self._take(outcome)
                    if self.on_scene:
                        self.on_scene(done, self.total, outcome.result)
        except BaseException as error:
            self.log.write("run_stopped", rendered=self.rendered, why=f"{type(error).__name__}: {error}")
            raise
        finally:
            for scene in self.in_flight:
                self._discard(scene)
        self.log.write("run_finished", rendered=self.rendered, failed=self.total - self.rendered)

    def _handed_out(self, jobs: Iterable[SceneJob]) -> Iterator[SceneJob]:
        for job in jobs:
            self.in_flight.add((job.split, job.scene))
            yield job

    def _discard(self, scene: SceneKey) -> None:
        """Remove what was uploaded of a scene behind a URL. In a folder the staging area sees to it."""
        if not isinstance(self.tree, LocalTree) and scene not in self.begun_before:
            discard_uncommitted(self.tree, *scene)

    def _take(self, outcome: Outcome[SceneJob, SceneManifest]) -> None:
        scene = (outcome.job.split, outcome.job.scene)
        if outcome.result is not None:
            self.in_flight.remove(scene)
            self._take_scene(scene, outcome.result, outcome.attempts)
            return
        assert outcome.failure is not None
        failure = outcome.failure
        self.log.write(
            "scene_failed",
            scene=outcome.job.name,
            kind=failure.kind,
            reason=failure.sentence,
            attempts=outcome.attempts,
        )
        if failure.kind == "disk_full" or self._no_room_left():
            raise DiskFullError(self._disk_full_sentence())
        if failure.kind == "environment":
            raise MachineError(_machine_sentence(failure.sentence))
        self.in_flight.remove(scene)
        self._discard(scene)
        if outcome.job.replaces is not None:
            digest = self.recipe.settings_sha256()
            self.not_replaced[scene] = QuarantinedScene(
                *scene, failure.kind, failure.sentence, outcome.attempts, digest, record=None
            )
            return
        put_in_quarantine(self.tree, self.area.folder, self.recipe, *scene, failure, outcome.attempts)
        self.quarantined.add(scene)

    def _take_scene(self, scene: SceneKey, manifest: SceneManifest, attempts: int) -> None:
        size = sum(entry.size for entry in manifest.files)
        self.rendered += 1
        self.bytes_written += size
        if scene in self.quarantined:
            release(self.tree, *scene)
            self.quarantined.remove(scene)
        name = f"{scene[0]}/{scene[1]:04d}"
        self.log.write("scene_committed", scene=name, bytes=size, seconds=manifest.seconds, attempts=attempts)

    def _no_room_left(self) -> bool:
        return isinstance(self.tree, LocalTree) and shutil.disk_usage(self.tree.root).free < NO_ROOM_BYTES

    def _disk_full_sentence(self) -> str:
        left = self.total - self.rendered
        need = f", about {left * self.bytes_written / self.rendered / 1e6:.0f} MB" if self.rendered else ""
        return (
            f"{self.tree.name}: the disk is full; {left} scenes are missing{need}: make room and run the same "
            "command again"
        )


def _machine_sentence(failure: str) -> str:
    """What stops a run, for a person."""
    if "No module named 'bpy'" in failure:
        return NO_BLENDER
    return f"rendering stopped, no scene is at fault: {failure}"


def _check_possible(
    recipe: Recipe, device: str, executor: Executor, tree: Tree, wanted: Sequence[SceneKey]
) -> None:
    """Raise DatasetError for what would make every scene fail, instead of putting all of them in quarantine."""
    here = isinstance(executor, LocalExecutor) or (isinstance(executor, RayExecutor) and executor.runs_here)
    without_blender = here and not has_blender()
    asks = device != "cpu" or recipe.curation.disparity_px is not None or recipe.engine != "cycles"
    asks = asks or without_blender
    if not asks or not set(wanted) - committed_scenes(tree):  # to list a large store takes a while
        return
    if without_blender:
        raise MachineError(NO_BLENDER)
    if here:
        check_device(device)
        check_engine(recipe.engine)
    check_disparity_range(recipe)


def _merge(tree: Tree, recipe: Recipe) -> Recipe:
    """The recipe that the folder will have: the one that is there, if any, with the scenes that `recipe` adds."""
    names = Layout(Path())
    if tree.exists(names.recipe.name):
        return merge_into(recipe_in(tree), recipe, tree.name)
    if set(tree.files_in("")) - {
        names.asset_pool.name
    }:  # It is written first, so a run may have ended after it.
        raise DatasetError(f"{tree.name} is neither empty nor a data set; give a new or empty folder")
    return recipe


def check_store(tree: Tree, recipe: Recipe) -> None:
    """Raise DatasetError unless each split has user assets, and all of them are in the data set's store."""
    if not recipe.assets:
        return
    require_assets(recipe.assets, (split for split, count in recipe.scenes.items() if count))
    if not isinstance(tree, LocalTree):
        raise DatasetError(f"{tree.name}: a recipe with user assets needs a folder, not a URL")
    store = Layout(tree.root).assets
    for asset in recipe.assets.files:
        prepared = store / f"{asset.sha256}.npz"
        if not prepared.is_file() or not is_zipfile(prepared):
            raise DatasetError(
                f"{tree.name} has no whole prepared file of {asset.name}, which the recipe names: give the folders of "
                "your meshes, textures and environments again"
            )


def _write_recipe(tree: Tree, area: StagingArea, recipe: Recipe) -> None:
    """Write the recipe by way of the staging area, so that a killed run leaves no temporary file."""
    staged = Layout(area.folder).recipe
    write_recipe(staged, recipe)
    for path in (Layout(area.folder).asset_pool, staged):
        if path.exists() and (not tree.exists(path.name) or tree.read(path.name) != path.read_bytes()):
            tree.adopt(path, path.name)


def committed_scenes(tree: Tree) -> set[SceneKey]:
    """(split, number) of every finished scene."""
    folders = {split: Layout(Path()).manifest(split, 0).parent.as_posix() for split in SPLITS}
    return {
        (split, scene) for split, folder in folders.items() for scene in scene_numbers(tree.files_in(folder))
    }


def _wanted(recipe: Recipe, shard: tuple[int, int]) -> Iterator[SceneKey]:
    index, count = shard
    if not 0 <= index < count:
        raise DatasetError(f"shard {index}/{count} does not exist: it takes 0 <= I < N")
    for split, scenes in recipe.scenes.items():
        for scene in range(index, scenes, count):
            yield split, scene
