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
from scenes.spec import Material, Scene, SceneObject, Trajectory, Vector
from scenes.user_assets.pool import AssetPool, UserMesh, UserTexture

USER_SHARE = 0.5
"""Share of the replaceable props, materials and environments that become user assets, where the pool names none."""
ROOM = 2.0
"""A mesh that keeps its size may be so many times as wide as what it replaces; a larger one would stand in other
things."""
CLEARANCE_M = 0.1
"""Least distance of a mesh that keeps its size from a camera."""


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
    share = USER_SHARE if assets.share is None else assets.share
    objects, materials, world = scene.objects, list(scene.materials), scene.world
    if assets.meshes:
        meshes = _Meshes(assets, scene, materials)
        objects = tuple(_with_user_mesh(rng, thing, meshes, replaceable, share) for thing in objects)
        objects = _with_user_groups(rng, objects, meshes, replaceable, share)
    if assets.textures:
        painted = {t.material for t in scene.objects if re.fullmatch(replaceable.painted, t.name)}
        materials = [
            _with_user_texture(rng, material, assets, share) if index in painted else material
            for index, material in enumerate(materials)
        ]
    if assets.environments and chance(rng, share):
        world = assets.world(world, choose(rng, assets.environments))
    return replace(scene, objects=objects, materials=tuple(materials), world=world)


def _with_user_texture(
    rng: np.random.Generator, material: Material, assets: AssetPool, share: float
) -> Material:
    if not chance(rng, share):
        return material
    return replace(material, color=UserTexture(choose(rng, assets.textures).sha256))


@dataclass(frozen=True)
class _Meshes:
    """Puts the user's meshes in the place of things."""

    assets: AssetPool
    scene: Scene
    materials: list[Material]
    """Those of the new scene, to which the meshes' own are added."""

    def draw(self, rng: np.random.Generator) -> UserMesh:
        """One of the meshes."""
        return self.assets.mesh(choose(rng, self.assets.meshes))

    def scale_m(
        self, shape: UserMesh, room_m: NDArray[np.float64], stretch: NDArray[np.float64]
    ) -> Vector | None:
        """The mesh's scale within a box of half extents `room_m` (3,); None if it is too large to stand there.

        It is as large as fits, stretched by `stretch` (3,), or as large as its file says.
        """
        own = np.abs(shape.mesh().vertices).max(axis=0)
        if not self.assets.keep_size:
            return vector(stretch * float((room_m / stretch / np.maximum(own, 1e-6)).min()))
        size_m = shape.half_size()
        if (own[:2] * size_m > ROOM * room_m[:2]).any():
            return None
        return size_m, size_m, size_m

    def instead_of(
        self, thing: SceneObject, shape: UserMesh, scale_m: Vector, foot: NDArray[np.float64]
    ) -> SceneObject:
        """A mesh with its middle at `foot` (3,) in the thing's frame; the thing itself if a camera would be near."""
        motion = thing.motion
        places = tuple(
            vector(np.array(place) + motion.pose(time)[:3, :3] @ foot)
            for time, place in zip(motion.times_frames, motion.positions_m, strict=True)
        )
        moved = Trajectory(motion.times_frames, places, motion.rotations)
        if self.assets.keep_size and self._is_near_a_camera(shape, scale_m, moved):
            return thing
        numbers = (
            tuple(self._number(material) for material in shape.materials()) if shape.own_materials else ()
        )
        first, *more = numbers or (thing.material,)
        return replace(
            thing, shape=shape, motion=moved, scale_m=scale_m, material=first, more_materials=tuple(more)
        )

    def _is_near_a_camera(self, shape: UserMesh, scale_m: Vector, motion: Trajectory) -> bool:
        reach_m = float(np.linalg.norm(shape.mesh().vertices * scale_m, axis=1).max()) + CLEARANCE_M
        camera = self.scene.camera
        return any(
            np.linalg.norm(camera.pose(view, time)[:3, 3] - motion.pose(time)[:3, 3]) < reach_m
            for time in range(self.scene.frames)
            for view in ("left", "right")
        )

    def _number(self, material: Material) -> int:
        """The index of a material, which is added if it is not there."""
        if material not in self.materials:
            self.materials.append(material)
        return self.materials.index(material)


def _with_user_mesh(
    rng: np.random.Generator, thing: SceneObject, meshes: _Meshes, replaceable: Replaceable, share: float
) -> SceneObject:
    """A user's mesh in a prop's place, on the same foot and within its box, so that nothing new is in the way."""
    if not re.fullmatch(replaceable.props, thing.name) or not chance(rng, share):
        return thing
    shape = meshes.draw(rng)
    room, own = (np.abs(s.mesh().vertices).max(axis=0) for s in (thing.shape, shape))
    stretch = np.array(thing.scale_m)
    scale_m = meshes.scale_m(shape, room * stretch, stretch)
    if scale_m is None:
        return thing
    down = np.array((0.0, 0.0, own[2] * scale_m[2] - room[2] * stretch[2]))
    return meshes.instead_of(thing, shape, scale_m, down)


def _with_user_groups(
    rng: np.random.Generator,
    objects: tuple[SceneObject, ...],
    meshes: _Meshes,
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
        if chance(rng, share) and (whole := _in_box(name, parts, meshes.draw(rng), meshes)):
            instead |= dict.fromkeys(part.name for part in parts)
            instead[parts[0].name] = whole
    replaced = (instead.get(part.name, part) for part in objects)
    return tuple(part for part in replaced if part is not None)


def _in_box(name: str, parts: list[SceneObject], shape: UserMesh, meshes: _Meshes) -> SceneObject | None:
    """The mesh in the box around the parts, which is upright in the first part's frame; None if it cannot be there."""
    motion = parts[0].motion
    into = np.linalg.inv(motion.pose(motion.times_frames[0]))
    corners = np.concatenate([_vertices_in(into, part) for part in parts])
    low, high = corners.min(axis=0), corners.max(axis=0)
    scale_m = meshes.scale_m(shape, (high - low) / 2, np.ones(3))
    if scale_m is None:
        return None
    foot = (low + high) / 2
    foot[2] = low[2] + scale_m[2] * np.abs(shape.mesh().vertices[:, 2]).max()
    whole = meshes.instead_of(parts[0], shape, scale_m, foot)
    return None if whole is parts[0] else replace(whole, name=f"{name} of the user")


def _vertices_in(into: NDArray[np.float64], part: SceneObject) -> NDArray[np.float64]:
    """The vertices (V, 3) of a part in the frame that a matrix (4, 4) leads to from the world."""
    pose = into @ part.motion.pose(part.motion.times_frames[0])
    return part.shape.mesh().vertices * np.array(part.scale_m) @ pose[:3, :3].T + pose[:3, 3]
