"""The recipe of a data set: everything that decides its bytes, as a typed record and as `recipe.yaml`.

The user assets are listed in a file of their own beside it, `assets.json`, which the recipe names by its SHA-256.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from datagen.dataset.layout import ENGINES, EXTRA_TARGETS, RENDER_PASSES, SPLITS, Layout
from datagen.errors import DatasetError
from datagen.formats.limits import MAX_ELEMENTS, read_bounded
from datagen.recipe.asset_pool import (
    ASSET_KINDS,
    MAX_POOL_BYTES,
    pool_difference,
    pool_from_text,
    pool_sha256,
    pool_to_text,
)
from datagen.recipe.curation import Curation
from datagen.recipe.disparity_histogram import DisparityHistogram, fit_components, with_depths
from datagen.recipe.disparity_range import REACHED_PERCENT, with_disparity_at
from scenes import FAMILIES, FamilyConfig, Scene, sample_scene
from scenes.serialization import from_plain, to_plain
from scenes.spec import OMIT_DEFAULT
from scenes.user_assets.pool import AssetPool
from stereoforge_kit.errors import InputError
from stereoforge_kit.files import Tree, write_text
from stereoforge_kit.messages import shortened

MAX_RECIPE_BYTES = 1 << 20
"""Largest recipe file that is read."""
MAX_RECIPE_DEPTH = 32
"""Deepest nesting that a recipe file may have."""

LONGEST_SETTING = 60
"""Characters of a setting in a message."""
LONGEST_REASON = 180
"""Characters of what is wrong with a recipe's text."""
LEAST_SIDE_PX = 4
"""Blender clamps the sides of a picture to this."""


@dataclass(frozen=True)
class Recipe:
    """What to render. Two runs of one recipe give the same bytes, however the work is spread.

    Constructing a recipe checks its values and does nothing else. Raises DatasetError for values that no data
    set can have.
    """

    world: FamilyConfig
    """The family's config, which has the image size and the number of frames in a scene too."""
    scenes: dict[str, int]
    """How many scenes each split has."""
    seed: int = 0
    """Everything random follows from it."""
    samples: int = 4
    """Paths per pixel for the pictures. Ground truth is exact whatever this is."""
    passes: tuple[str, ...] = ("clean",)
    """Render passes, among "clean" and "final" (motion blur, defocus, fog, sensor noise)."""
    targets: tuple[str, ...] = ()
    """Targets besides disparity, gradient, occlusion and object index, which are always made."""
    gradient_threshold_px: float = 1.0
    """Larger forward differences are discontinuities and masked out of the gradient targets."""

    assets: AssetPool = field(default_factory=AssetPool)
    """The user assets. Each belongs to one split only."""
    curriculum_scenes: int = 0
    """Over so many scenes the worlds of the train split grow from few and simple things to the family's own; 0 for no
    such curriculum. Scenes of the other splits are the family's own from the first."""
    curation: Curation = field(default_factory=Curation)
    """Which scenes are rejected and sampled again."""
    engine: str = field(default="cycles", metadata=OMIT_DEFAULT)
    """What makes the pictures, among `ENGINES`: Workbench makes drafts, of the clean pass only."""
    disparities: DisparityHistogram | None = field(default=None, metadata=OMIT_DEFAULT)
    """The histogram of disparities that all scenes together shall have; None for whatever the family gives.

    Its components are found by `fit_disparities`, which everything that samples scenes needs first.
    """

    def __post_init__(self) -> None:
        for split, count in self.scenes.items():
            if split not in SPLITS:
                raise DatasetError(f"there is no split {split!r}; there are {', '.join(SPLITS)}")
            if count < 0:
                raise DatasetError(f"the number of {split} scenes must not be negative, got {count}")
        if not self.passes:
            raise DatasetError(f"passes must be among {', '.join(RENDER_PASSES)}, got none")
        _check_names("passes", self.passes, RENDER_PASSES)
        _check_names("engine", (self.engine,), ENGINES)
        if self.engine == "workbench" and "final" in self.passes:
            raise DatasetError(
                "workbench makes drafts of the clean pass; the final pass needs the engine cycles"
            )
        _check_names("targets", self.targets, EXTRA_TARGETS)
        at_least_one = {
            "samples": self.samples,
            "width": self.world.width,
            "height": self.world.height,
            "frames per scene": self.world.frames,
        }
        for name, value in at_least_one.items():
            if value < 1:
                raise DatasetError(f"{name} must be at least 1, got {value}")
        self._check_size()
        if not 0 < self.gradient_threshold_px < math.inf:
            raise DatasetError(f"gradient_threshold_px must be above 0, got {self.gradient_threshold_px:g}")
        if self.curriculum_scenes < 0:
            raise DatasetError(f"curriculum_scenes must not be negative, got {self.curriculum_scenes}")
        if self.assets and not FAMILIES[self.family].takes_assets:
            raise DatasetError(
                f"worlds of {self.family} take no user assets (meshes, textures, environments)"
            )
        try:
            self.world.at_complexity(0.0 if self.curriculum_scenes else 1.0)
            if self.curation.disparity_px:
                self.world.within_disparities(*self.curation.disparity_px)
        except ValueError as error:
            raise DatasetError(str(error)) from error
        if self.world.rig and (self.disparities or self.curation.disparity_px):
            raise DatasetError(
                "a recipe has a rig of its own or asks for disparities, not both: they are met by choosing the baseline"
            )
        if self.disparities and self.curation.disparity_px:
            raise DatasetError("a recipe has a range of disparities or a histogram of them, not both")
        if self.seed < 0:
            raise DatasetError(f"the seed must not be negative, got {self.seed}")

    def _check_size(self) -> None:
        """Raise DatasetError for images that no reader would take, and disparities that no image could show."""
        width, height = self.world.width, self.world.height
        if min(width, height) < LEAST_SIDE_PX:
            raise DatasetError(
                f"images of {width}x{height} cannot be rendered: Blender makes no side shorter than {LEAST_SIDE_PX} px"
            )
        if 3 * width * height > MAX_ELEMENTS:
            raise DatasetError(
                f"images of {width}x{height} are too large: files of a data set hold {MAX_ELEMENTS // 3} pixels"
            )
        ranges = (self.curation.disparity_px, self.disparities and self.disparities.edges_px)
        greatest = max((limits[-1] for limits in ranges if limits), default=0.0)
        if greatest > width:
            raise DatasetError(
                f"a disparity of {greatest:g} px is never seen in images that are {width} px wide"
            )

    @property
    def family(self) -> str:
        """The name of the family of worlds."""
        return next(name for name, family in FAMILIES.items() if type(self.world) is family.config)

    @property
    def pictures_made_by(self) -> str:
        """What makes the pictures, for readers."""
        if self.engine == "workbench":
            return "drafts by Blender's Workbench"
        return f"Cycles, {self.samples} paths a pixel, denoised"

    def settings_sha256(self) -> str:
        """The SHA-256 of all settings but the numbers of scenes, which may grow."""
        settings = recipe_to_plain(replace(self, scenes={}))
        return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()

    def sample(self, split: str, index: int, attempt: int = 0) -> Scene:
        """Sample the index-th scene of a split. Splits, scenes and attempts draw from unrelated random streams.

        Raises ValueError if the recipe's disparity histogram has no components yet (`fit_disparities`).
        """
        key = (SPLITS.index(split), index) + ((attempt,) if attempt else ())
        sequence = np.random.SeedSequence(self.seed, spawn_key=key)
        world = self.world
        if split == "train" and index < self.curriculum_scenes:
            world = world.at_complexity(index / self.curriculum_scenes)
        wanted = self.curation.disparity_px
        world = world.within_disparities(*wanted) if wanted else world
        component = self.disparities.component(index) if self.disparities else None
        world = with_depths(world, component) if component else world
        scene = sample_scene(np.random.default_rng(sequence), self.family, world, self.assets.of_split(split))
        if wanted and not world.depths_for_range:
            scene = with_disparity_at(scene, REACHED_PERCENT, wanted[1])
        return with_disparity_at(scene, 50.0, component.median_px) if component else scene


def fit_disparities(recipe: Recipe) -> Recipe:
    """The recipe with the components of its disparity histogram, ready to sample scenes.

    Unchanged if the recipe asks for no histogram or already has the components. Otherwise some scenes are
    sampled and ray-cast, which takes seconds.
    """
    if recipe.disparities is None or recipe.disparities.components:
        return recipe
    return replace(recipe, disparities=fit_components(recipe.disparities, recipe.world, recipe.seed))


def _check_names(what: str, names: tuple[str, ...], known: Collection[str]) -> None:
    for name in names:
        if name not in known:
            raise DatasetError(f"{what} must be among {', '.join(known)}, got {name!r}")
        if names.count(name) > 1:
            raise DatasetError(f"{what} name {name!r} {names.count(name)} times")


def recipe_from_plain(data: Any, origin: str, read_pool: Callable[[], bytes] | None = None) -> Recipe:
    """A recipe from parsed YAML.

    Args:
        data: What `recipe_to_plain` gives.
        origin: The file's name or another one, for messages.
        read_pool: Gives the content of the recipe's `assets.json`, or raises FileNotFoundError; None if there
            can be none.

    Raises:
        DatasetError: For anything that is not a recipe, and a pool that is not the one it names.
    """
    if not isinstance(data, dict):
        raise DatasetError(f"{origin} is not a valid recipe: it has no settings, such as world: and scenes:")
    assets, pool = data.get("assets"), AssetPool()
    if isinstance(assets, dict) and any(map(assets.get, ASSET_KINDS)):
        raise DatasetError(f"{origin} is not a valid recipe: it lists user assets itself, not in assets.json")
    if isinstance(assets, dict) and "pool" in assets:
        pool = _named_pool(str(assets["pool"]), origin, read_pool)
        data = {**data, "assets": {key: value for key, value in assets.items() if key != "pool"}}
    try:
        recipe = from_plain(data, Recipe)
        files = {kind: getattr(pool, kind) for kind in ASSET_KINDS}
        return replace(recipe, assets=replace(recipe.assets, **files)) if pool else recipe
    except (ValueError, RecursionError) as error:
        raise DatasetError(
            f"{origin} is not a valid recipe: {shortened(str(error), LONGEST_REASON)}"
        ) from error


def _named_pool(sha256: str, origin: str, read_pool: Callable[[], bytes] | None) -> AssetPool:
    """The pool that a recipe names. Raises DatasetError if there is none, or another one."""
    try:
        text = b"" if read_pool is None else read_pool()
    except FileNotFoundError:
        text = b""
    if not text:
        raise DatasetError(f"{origin} names a list of user assets, but there is no assets.json beside it")
    if hashlib.sha256(text).hexdigest() != sha256:
        raise DatasetError(
            f"{origin}: the assets.json beside it is not the list of user assets that it names"
        )
    return pool_from_text(text, f"the assets.json of {origin}")


def recipe_from_text(text: bytes, origin: str, read_pool: Callable[[], bytes] | None = None) -> Recipe:
    """A recipe from YAML text in UTF-8; `read_pool` as in `recipe_from_plain`.

    Raises DatasetError, naming `origin`, for text that is no YAML or no recipe.
    """
    if len(text) > MAX_RECIPE_BYTES:
        raise DatasetError(f"cannot read the recipe {origin}: {len(text)} bytes are more than any recipe has")
    try:
        _check_shape(text.decode("utf-8"))
        data = yaml.safe_load(text.decode("utf-8"))
    except (UnicodeDecodeError, yaml.YAMLError, RecursionError, ValueError) as error:
        reason = shortened(_reason(error), LONGEST_REASON)
        raise DatasetError(f"cannot read the recipe {origin}: {reason}") from error
    return recipe_from_plain(data, origin, read_pool)


def _reason(error: Exception) -> str:
    """What is wrong with a YAML text, and in which line, without the parser's account of what it was doing."""
    if isinstance(error, yaml.MarkedYAMLError) and error.problem and error.problem_mark:
        return f"line {error.problem_mark.line + 1}: {error.problem}"
    return " ".join(str(error).split())


def _check_shape(text: str) -> None:
    """Raise ValueError for deep nesting and for references, which no recipe has and which could grow without end."""
    depth = 0
    for event in yaml.parse(text, yaml.SafeLoader):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if isinstance(event, yaml.AliasEvent) or depth > MAX_RECIPE_DEPTH:
            raise InputError("it refers to another place in it or is nested too deeply")


def read_recipe(path: Path) -> Recipe:
    """Read a recipe file, and the list of user assets beside it if it names one.

    Raises DatasetError for a file that is missing, no YAML or no recipe.
    """
    if not path.exists():
        raise DatasetError(f"there is no recipe {path}")
    return recipe_from_text(
        read_bounded(path, MAX_RECIPE_BYTES), str(path), partial(_read_pool, Layout(path.parent).asset_pool)
    )


def recipe_in(tree: Tree) -> Recipe:
    """The recipe of a data set in a folder or behind a URL. Raises DatasetError as `read_recipe` does."""
    names = Layout(Path())
    return recipe_from_text(
        tree.read(names.recipe.name), f"{tree.name}/{names.recipe}", lambda: tree.read(names.asset_pool.name)
    )


def _read_pool(path: Path) -> bytes:
    if not path.exists():
        raise FileNotFoundError(path)
    return read_bounded(path, MAX_POOL_BYTES)


def recipe_to_plain(recipe: Recipe) -> dict[str, Any]:
    """A recipe as dicts, lists, strings and numbers, which `recipe_from_plain` takes."""
    plain: dict[str, Any] = to_plain(replace(recipe, assets=AssetPool()))
    if recipe.assets:
        settings = to_plain(replace(recipe.assets, meshes=(), textures=(), environments=()))
        for kind in ASSET_KINDS:
            del settings[kind]
        plain["assets"] = {"pool": pool_sha256(recipe.assets), **settings}
    return plain


def recipe_to_text(recipe: Recipe) -> str:
    """A recipe as YAML text, which `recipe_from_text` reads."""
    return yaml.safe_dump(recipe_to_plain(recipe), sort_keys=False)


def write_recipe(path: Path, recipe: Recipe) -> None:
    """Write a recipe file, which `read_recipe` reads, and before it the list of its user assets, if it has any."""
    if recipe.assets:
        write_text(Layout(path.parent).asset_pool, pool_to_text(recipe.assets))
    write_text(path, recipe_to_text(recipe))


def merge_into(existing: Recipe, wanted: Recipe, folder: str) -> Recipe:
    """The recipe of a folder that already has one, with the scenes that another recipe adds.

    Nothing else may change. Raises DatasetError, naming `folder` and the first setting that differs.
    """
    before, after = (_flat(recipe_to_plain(replace(recipe, scenes={}))) for recipe in (existing, wanted))
    # Another family has other settings altogether: name the family first, and the user assets by their files.
    for key in sorted(set(before) | set(after), key=lambda key: (key != "world.family", key)):
        if before.get(key) != after.get(key):
            files = pool_difference(existing.assets, wanted.assets) if key.startswith("assets.") else None
            # What is not written is at its default.
            was, now = (_brief(plain.get(key, "the default")) for plain in (before, after))
            settings = f"{key} {was}, not {now}"
            raise DatasetError(
                f"{folder} was rendered with {f'other user assets, there are now {files}' if files else settings}: "
                "use the same settings to finish or extend it, or another folder"
            )
    splits = [split for split in SPLITS if split in existing.scenes or split in wanted.scenes]
    counts = {split: max(existing.scenes.get(split, 0), wanted.scenes.get(split, 0)) for split in splits}
    return replace(existing, scenes=counts)


def _brief(value: Any) -> str:
    """A setting for a sentence."""
    return shortened(str(value), LONGEST_SETTING)


def _flat(data: Any, prefix: str = "") -> dict[str, Any]:
    if not isinstance(data, dict):
        return {prefix: data}
    return {
        name: value
        for key, item in data.items()
        for name, value in _flat(item, f"{prefix}.{key}" if prefix else key).items()
    }
