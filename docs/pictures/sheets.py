"""Make the contact sheets of docs/families/flying_things.md: one of each kind of shape, texture or finish.

python docs/pictures/sheets.py shapes|textures|finishes OUT.jpg [--seed 8]

Shapes are ray cast from one direction, with one light. Finishes are rendered by Blender on a ball over a checkered
floor.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from scipy.spatial.transform import Rotation

from datagen.rendering.frames import RenderOptions, render_frames
from scenes import Scene
from scenes.appearance.materials import FINISHES
from scenes.geometry.mesh import Mesh
from scenes.motion.trajectories import quaternion
from scenes.shapes import SHAPES
from scenes.shapes.solids.basic import Plane, Superquadric
from scenes.spec import Material, SceneObject, StereoCamera, SunLight, Texture, Trajectory, World
from scenes.textures import TEXTURES
from scenes.textures.sky import Sky
from scenes.textures.tiles import Checkers
from stereoforge_kit.viewing import Picture

SIDE, LABEL, GAP, COLUMNS = 96, 11, 6, 10
"""Pixels: of a tile, of the line under it, between tiles; tiles in a row."""


def shapes(rng: np.random.Generator) -> Iterator[tuple[str, Picture]]:
    """Name and picture of one shape of each kind that flying_things draws."""
    for name in sorted(SHAPES):
        if SHAPES[name].popularity > 0:
            yield name, ray_cast_picture(SHAPES[name].sample(rng).mesh())


def textures(rng: np.random.Generator) -> Iterator[tuple[str, Picture]]:
    """Name and picture of one texture of each kind that flying_things draws."""
    for name in sorted(TEXTURES):
        if TEXTURES[name].popularity > 0:
            image = TEXTURES[name].sample(rng, 2 * SIDE).image()
            yield name, cv2.resize(image, (SIDE, SIDE), interpolation=cv2.INTER_AREA)


def finishes(rng: np.random.Generator) -> Iterator[tuple[str, Picture]]:
    """Name and rendered picture of a ball in each finish."""
    for name, finish in FINISHES.items():
        ranges = {field: limits for field, limits in vars(finish).items() if isinstance(limits, tuple)}
        middle = {field: (low + high) / 2 for field, (low, high) in ranges.items()}
        scene = ball(Material(TEXTURES["Marble"].sample(rng, 256), 0.5, **middle), Checkers.sample(rng, 256))
        with tempfile.TemporaryDirectory() as scratch:
            _, targets = next(render_frames(scene, Path(scratch), RenderOptions(samples=64)))
        yield name, targets["left"].images["clean"]


def ball(material: Material, floor: Texture) -> Scene:
    """A ball on a floor, in the middle of the picture."""
    level = quaternion(Rotation.from_euler("X", 80.0, degrees=True))
    ground = Trajectory.static((0.0, 0.0, -1.0))
    return Scene(
        family="flying_things",
        frames=1,
        camera=StereoCamera(SIDE, SIDE, 50.0, 0.1, Trajectory.static((0.0, -4.5, 0.8), level)),
        objects=(
            SceneObject("ball", Superquadric((1.0, 1.0, 1.0), 1.0, 1.0), 0, Trajectory.static()),
            SceneObject("floor", Plane(), 1, ground, (30.0, 30.0, 1.0)),
        ),
        materials=(material, Material(floor, 6.0)),
        lights=(SunLight((0.5, 0.6, -0.8), (1.0, 1.0, 1.0), 3.0, 2.0),),
        world=World(Sky.sample(np.random.default_rng(0), 256)),
    )


def ray_cast_picture(mesh: Mesh) -> Picture:
    """An orthographic picture of a mesh, its triangles shaded by a light from above."""
    right, up = np.array((-0.57, 0.82, 0.0)), np.array((-0.38, -0.27, 0.88))
    towards = np.cross(right, up)
    flat = np.stack([mesh.vertices @ right, mesh.vertices @ up], -1)
    middle, half = (flat.max(axis=0) + flat.min(axis=0)) / 2, np.ptp(flat, axis=0).max() * 0.54
    steps = (np.arange(2 * SIDE) + 0.5) / SIDE - 1
    across, down = np.meshgrid(steps * half, -steps * half)
    origins = (across.ravel() + middle[0])[:, None] * right + (down.ravel() + middle[1])[:, None] * up
    origins = origins + 10 * towards
    rays = EmbreeScene()
    TriangleMesh(rays, mesh.vertices.astype(np.float32), mesh.triangles.astype(np.int32))
    directions = np.broadcast_to(-towards, origins.shape).astype(np.float32)
    triangle = rays.run(origins.astype(np.float32), directions, query="INTERSECT")
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    light = (0.5 * towards + 0.2 * right + 0.84 * up) @ normals.T
    levels = np.where(triangle < 0, 255.0, 235 * (0.35 + 0.65 * np.clip(light, 0, 1))[triangle])
    small = cv2.resize(levels.reshape(across.shape), (SIDE, SIDE), interpolation=cv2.INTER_AREA)
    return np.repeat(small[..., None], 3, axis=2).astype(np.uint8)


def sheet(tiles: list[tuple[str, Picture]]) -> Picture:
    """Tiles in rows, each over its name."""
    columns = min(COLUMNS, len(tiles))
    rows = -(-len(tiles) // columns)
    width, height = SIDE + GAP, SIDE + LABEL + GAP
    page = np.full((rows * height + GAP, columns * width + GAP, 3), 255, np.uint8)
    for index, (name, tile) in enumerate(tiles):
        y, x = index // columns * height + GAP, index % columns * width + GAP
        page[y : y + SIDE, x : x + SIDE] = tile
        whole = cv2.getTextSize(name, cv2.FONT_HERSHEY_SIMPLEX, 1.0, 1)[0][0]
        size = min(0.36, SIDE / whole)
        place = (x, y + SIDE + LABEL - 2)
        cv2.putText(page, name, place, cv2.FONT_HERSHEY_SIMPLEX, size, (40, 40, 40), 1, cv2.LINE_AA)
    return page


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    kinds = {"shapes": shapes, "textures": textures, "finishes": finishes}
    parser.add_argument("kind", choices=kinds)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, default=8)
    arguments = parser.parse_args()
    page = sheet(list(kinds[arguments.kind](np.random.default_rng(arguments.seed))))
    cv2.imwrite(str(arguments.out), page[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])


if __name__ == "__main__":
    main()
