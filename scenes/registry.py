"""The families of scenes. A new family is one new module in `scenes.families` with a `FAMILY` in it."""

from __future__ import annotations

import numpy as np

import scenes.families
from scenes.family import Family, FamilyConfig
from scenes.imperfections import with_imperfections
from scenes.spec import Scene
from scenes.user_assets.pool import AssetPool
from scenes.user_assets.replacement import with_user_assets
from stereoforge_kit.discovery import modules_in
from stereoforge_kit.errors import InputError

FAMILIES: dict[str, Family] = {module.FAMILY.name: module.FAMILY for module in modules_in(scenes.families)}
"""Every family by name."""


def sample_scene(
    rng: np.random.Generator, family: str, config: FamilyConfig | None = None, assets: AssetPool | None = None
) -> Scene:
    """Sample a random scene of a family; with `assets`, some of it is made from the user's files.

    The same generator state, family, config and assets give the same scene on any machine. `config` is the
    family's default if it is None. Raises ValueError for a family that does not exist and for a config of
    another family.
    """
    if family not in FAMILIES:
        raise InputError(f"there is no scene family {family!r}; there are {', '.join(sorted(FAMILIES))}")
    kind = FAMILIES[family]
    config = kind.config() if config is None else config
    if not isinstance(config, kind.config):
        raise InputError(f"{family} takes a {kind.config.__name__}, not a {type(config).__name__}")
    assets = AssetPool() if assets is None else assets
    scene = kind.sample(rng, config.with_assets(assets))
    if config.rig and scene.camera != config.rig.camera(scene.camera.motion):
        raise InputError(
            f"{family} takes no rig of one's own: it makes its camera without FamilyConfig.camera"
        )
    if kind.replaceable:
        scene = with_user_assets(rng, scene, assets, kind.replaceable)
    return with_imperfections(rng, scene, config.imperfections)
