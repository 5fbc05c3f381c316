"""User assets in a scene that a family has sampled: meshes for props, pictures for surfaces, environments.

All draws here come after the family's, and there are none without files: so a scene without user assets does
not change.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np

from scenes.motion.trajectories import vector
from scenes.random_draws import chance, choose
from scenes.spec import Material, Scene, SceneObject, Texture, Trajectory
from scenes.user_assets.pool import AssetPool, UserEnvironment, UserMesh, UserTexture

USER_SHARE = 0.5
"""Share of the replaceable props, materials and environments that become user assets, where there are any."""


@dataclass(frozen=True)
class Replaceable:
    """What user assets may replace in a family's scenes: regular expressions for the whole names of objects."""

    props: str
    """Objects that a user's mesh may replace; all of them rigid."""
    painted: str
    """Objects whose materials may get a user's picture."""


def with_user_assets(
    rng: np.random.Generator, scene: Scene, assets: AssetPool, replaceable: Replaceable
) -> Scene:
    """The scene with `USER_SHARE` of what is replaceable made from the user's files."""
    objects, materials, world = scene.objects, scene.materials, scene.world
    if assets.meshes:
        objects = tuple(_with_user_mesh(rng, thing, assets, replaceable) for thing in objects)
    if assets.textures:
        painted = {t.material for t in scene.objects if re.fullmatch(replaceable.painted, t.name)}
        materials = tuple(
            _with_user_texture(rng, material, assets) if index in painted else material
            for index, material in enumerate(materials)
        )
    if assets.environments and chance(rng, USER_SHARE):
        sky: Texture = UserEnvironment(choose(rng, assets.environments).sha256)
        world = replace(world, environment=sky)
    return replace(scene, objects=objects, materials=materials, world=world)


def _with_user_texture(rng: np.random.Generator, material: Material, assets: AssetPool) -> Material:
    if not chance(rng, USER_SHARE):
        return material
    return replace(material, color=UserTexture(choose(rng, assets.textures).sha256))


def _with_user_mesh(
    rng: np.random.Generator, thing: SceneObject, assets: AssetPool, replaceable: Replaceable
) -> SceneObject:
    """A user's mesh in a prop's place, on the same foot and within its box, so that nothing new is in the way."""
    if not re.fullmatch(replaceable.props, thing.name) or not chance(rng, USER_SHARE):
        return thing
    shape = UserMesh(choose(rng, assets.meshes).sha256)
    room, own = (np.abs(s.mesh().vertices).max(axis=0) for s in (thing.shape, shape))
    factor = float((room / np.maximum(own, 1e-6)).min())
    down = np.array((0.0, 0.0, (factor * own[2] - room[2]) * thing.scale_m[2]))
    motion = thing.motion
    places = tuple(
        vector(np.array(place) + motion.pose(time)[:3, :3] @ down)
        for time, place in zip(motion.times_frames, motion.positions_m, strict=True)
    )
    return replace(
        thing,
        shape=shape,
        motion=Trajectory(motion.times_frames, places, motion.rotations),
        scale_m=vector(factor * np.array(thing.scale_m)),
    )
