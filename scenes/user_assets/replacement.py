"""User assets in a scene that a family has sampled: meshes for props, pictures for surfaces, environments.

All draws here come after the family's, and there are none without files: so a scene without user assets does
not change.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scenes.motion.trajectories import vector
from scenes.random_draws import chance, choose
from scenes.spec import Material, Scene, SceneObject, Texture, Trajectory
from scenes.user_assets.pool import AssetPool, UserEnvironment, UserMesh, UserTexture

USER_SHARE = 0.5
"""Share of the replaceable props, materials and environments that become user assets, where the pool names none."""


@dataclass(frozen=True)
class Replaceable:
    """What user assets may replace in a family's scenes: regular expressions for the whole names of objects."""

    props: str
    """Objects that a user's mesh may replace; all of them rigid."""
    painted: str
    """Objects whose materials may get a user's picture."""
    groups: str | None = None
    """Objects that are parts of one thing, which a user's mesh may replace as a whole; the expression's first group is
    the thing's name. All of them are rigid and do not move. None if there are no such things."""


def with_user_assets(
    rng: np.random.Generator, scene: Scene, assets: AssetPool, replaceable: Replaceable
) -> Scene:
    """The scene with a share of what is replaceable made from the user's files, `USER_SHARE` if the pool has none."""
    objects, materials, world = scene.objects, scene.materials, scene.world
    share = USER_SHARE if assets.share is None else assets.share
    if assets.meshes:
        objects = tuple(_with_user_mesh(rng, thing, assets, replaceable, share) for thing in objects)
        objects = _with_user_groups(rng, objects, assets, replaceable, share)
    if assets.textures:
        painted = {t.material for t in scene.objects if re.fullmatch(replaceable.painted, t.name)}
        materials = tuple(
            _with_user_texture(rng, material, assets, share) if index in painted else material
            for index, material in enumerate(materials)
        )
    if assets.environments and chance(rng, share):
        sky: Texture = UserEnvironment(choose(rng, assets.environments).sha256)
        world = replace(world, environment=sky)
    return replace(scene, objects=objects, materials=materials, world=world)


def _with_user_texture(
    rng: np.random.Generator, material: Material, assets: AssetPool, share: float
) -> Material:
    if not chance(rng, share):
        return material
    return replace(material, color=UserTexture(choose(rng, assets.textures).sha256))


def _with_user_mesh(
    rng: np.random.Generator, thing: SceneObject, assets: AssetPool, replaceable: Replaceable, share: float
) -> SceneObject:
    """A user's mesh in a prop's place, on the same foot and within its box, so that nothing new is in the way."""
    if not re.fullmatch(replaceable.props, thing.name) or not chance(rng, share):
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


def _with_user_groups(
    rng: np.random.Generator,
    objects: tuple[SceneObject, ...],
    assets: AssetPool,
    replaceable: Replaceable,
    share: float,
) -> tuple[SceneObject, ...]:
    """A user's mesh in the place of all parts of a thing, on the thing's foot and within its box."""
    if replaceable.groups is None:
        return objects
    things: dict[str, list[SceneObject]] = {}
    for part in objects:
        if match := re.fullmatch(replaceable.groups, part.name):
            things.setdefault(match[1], []).append(part)
    instead: dict[str, SceneObject | None] = {}
    for name, parts in things.items():
        if chance(rng, share):
            instead |= dict.fromkeys(part.name for part in parts)
            instead[parts[0].name] = _in_box(name, parts, UserMesh(choose(rng, assets.meshes).sha256))
    replaced = (instead.get(part.name, part) for part in objects)
    return tuple(part for part in replaced if part is not None)


def _in_box(name: str, parts: list[SceneObject], shape: UserMesh) -> SceneObject:
    """The mesh as large as fits into the box around the parts, which is upright in the first part's frame."""
    motion = parts[0].motion
    pose = motion.pose(motion.times_frames[0])
    into = np.linalg.inv(pose)
    corners = np.concatenate([_vertices_in(into, part) for part in parts])
    low, high = corners.min(axis=0), corners.max(axis=0)
    own = np.abs(shape.mesh().vertices).max(axis=0)
    factor = float(((high - low) / 2 / np.maximum(own, 1e-6)).min())
    foot = (low + high) / 2
    foot[2] = low[2] + factor * own[2]
    places = tuple(vector(np.array(place) + pose[:3, :3] @ foot) for place in motion.positions_m)
    return replace(
        parts[0],
        name=f"{name} of the user",
        shape=shape,
        motion=Trajectory(motion.times_frames, places, motion.rotations),
        scale_m=(factor, factor, factor),
    )


def _vertices_in(into: NDArray[np.float64], part: SceneObject) -> NDArray[np.float64]:
    """The vertices (V, 3) of a part in the frame that a matrix (4, 4) leads to from the world."""
    pose = into @ part.motion.pose(part.motion.times_frames[0])
    return part.shape.mesh().vertices * np.array(part.scale_m) @ pose[:3, :3].T + pose[:3, 3]
