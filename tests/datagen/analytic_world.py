"""A small data set whose every value has a closed form: rectangles before a sky, no Blender, no mesh.

Two squares and a slanted wall, each an affine image of the square [-1, 1]^2, seen by a rig in a general pose
that moves between two frames. Rays meet a rectangle where a 3x3 linear system says; nothing here uses the
package's own ray casts, gradients or occlusion tests.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from datagen.dataset.layout import FIRST_FRAME, Layout
from datagen.dataset.manifest import FileEntry, SceneManifest, file_entry, read_manifest, write_manifest
from datagen.formats import (
    write_camera_data,
    write_cameras,
    write_gradient,
    write_occlusion,
    write_pfm,
    write_png,
)
from datagen.recipe.recipe import Recipe, write_recipe
from scenes import FAMILIES, Scene, scene_to_json
from scenes.shapes.solids.basic import Plane
from scenes.spec import Material, SceneObject, StereoCamera, Trajectory, World
from scenes.textures.plain import SolidColor

WIDTH, HEIGHT, BASELINE_M = 96, 64, 0.5
FOCAL_PX = 96.0
FRAMES = 2
CAMERA_OFFSET = {"left": 0.0, "right": BASELINE_M}

Quaternion = tuple[float, float, float, float]


def make_scene(number: int) -> Scene:
    """The world of a scene: shifted a little by its number, so that no two scenes are alike."""
    head = Rotation.from_euler("zxy", (0.4, 0.9, -0.3))
    start = np.array([2.0, -1.0, 3.0])
    rig = Trajectory(
        times_frames=(0.0, 1.0),
        positions_m=(tuple(start), tuple(start + head.apply((0.2, 0.1, -0.3)))),
        rotations=(_wxyz(head), _wxyz(head * Rotation.from_euler("y", 0.02))),
    )
    objects = (
        # Position and attitude in the first camera's frame; the wall leaves the top of the view to the sky.
        _rectangle("wall", head, start, (0.1, -1.5, -6.0), (-0.35, 0.3, 0.1), (9.0, 3.0)),
        _rectangle("near", head, start, (0.4 + 0.03 * number, 0.2, -3.0), (0.1, -0.2, 0.5), (0.7, 0.5)),
        _rectangle("edge", head, start, (-1.6, -0.3, -3.6), (0.0, 0.3, 0.0), (0.5, 0.9)),
    )
    grey = SolidColor((128, 128, 128))
    return Scene(
        family="analytic",
        frames=FRAMES,
        camera=StereoCamera(WIDTH, HEIGHT, focal_mm=32.0, baseline_m=BASELINE_M, motion=rig),
        objects=objects,
        materials=(Material(grey),),
        lights=(),
        world=World(grey),
    )


def _wxyz(rotation: Rotation) -> Quaternion:
    x, y, z, w = (float(value) for value in rotation.as_quat())
    return (w, x, y, z)


def _rectangle(
    name: str,
    head: Rotation,
    view: NDArray[np.float64],
    center: tuple[float, float, float],
    angles: tuple[float, float, float],
    half: tuple[float, float],
) -> SceneObject:
    motion = Trajectory.static(
        tuple(float(v) for v in view + head.apply(center)), _wxyz(head * Rotation.from_euler("xyz", angles))
    )
    return SceneObject(name, Plane(), material=0, motion=motion, scale_m=(*half, 1.0))


@dataclasses.dataclass(frozen=True)
class RenderedView:
    """The closed-form arrays of one view."""

    image: NDArray[np.uint8]
    disparity: NDArray[np.float32]
    gradient: NDArray[np.float32]
    gradient_valid: NDArray[np.bool_]
    occlusion: NDArray[np.uint8]
    object_index: NDArray[np.uint16]


def render(scene: Scene, view: str, instant: int, threshold_px: float = 1.0) -> RenderedView:
    """All arrays of one view at an instant."""
    pose = scene.camera.pose(view, instant)
    x = np.arange(WIDTH) + 0.5 - WIDTH / 2
    y = np.arange(HEIGHT) + 0.5 - HEIGHT / 2
    rays = np.stack([*np.meshgrid(x / FOCAL_PX, -y / FOCAL_PX), np.full((HEIGHT, WIDTH), -1.0)], axis=-1)
    directions = rays @ pose[:3, :3].T
    depth, index, surface = _first_hits(scene, instant, pose[:3, 3], directions)
    disparity = (FOCAL_PX * BASELINE_M / depth).astype(np.float32)
    gradient = np.zeros((HEIGHT, WIDTH, 2), np.float32)
    gradient[:, :-1, 0] = np.diff(disparity, axis=1)
    gradient[:-1, :, 1] = np.diff(disparity, axis=0)
    valid = np.abs(gradient).max(axis=-1) <= threshold_px
    valid[:, -1] = valid[-1, :] = False
    x_other = np.arange(WIDTH) + 0.5 + (-1 if view == "left" else 1) * disparity.astype(np.float64)
    outside = (x_other < 0) | (x_other > WIDTH)
    occluded = _occluded(scene, instant, view, pose, depth, directions, index)
    return RenderedView(
        image=_paint(index, surface, directions),
        disparity=disparity,
        gradient=gradient,
        gradient_valid=valid,
        occlusion=np.where(outside, 2, np.where(occluded, 1, 0)).astype(np.uint8),
        object_index=index,
    )


def _meet(
    pose: NDArray[np.float64], origin: NDArray[np.float64], directions: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Ray lengths (inf for a miss) and (u, v) where rays meet the rectangle `pose` makes of [-1, 1]^2."""
    inverse = np.linalg.inv(pose)
    local_origin = inverse[:3, :3] @ origin + inverse[:3, 3]
    local = directions @ inverse[:3, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        length = -local_origin[2] / local[..., 2]
    uv = local_origin[:2] + length[..., None] * local[..., :2]
    missed = ~((np.abs(uv) <= 1).all(axis=-1) & (length > 0))
    return np.where(missed, np.inf, length), uv


def _first_hits(
    scene: Scene, instant: int, origin: NDArray[np.float64], directions: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.uint16], NDArray[np.float64]]:
    met = [_meet(thing.pose(instant), origin, directions) for thing in scene.objects]
    lengths = np.stack([length for length, _ in met])
    first = lengths.argmin(axis=0)
    depth = lengths.min(axis=0)
    surface = np.take_along_axis(np.stack([uv for _, uv in met]), first[None, ..., None], axis=0)[0]
    index = np.where(np.isfinite(depth), first + 1, 0).astype(np.uint16)
    return depth, index, surface


def _occluded(
    scene: Scene,
    instant: int,
    view: str,
    pose: NDArray[np.float64],
    depth: NDArray[np.float64],
    directions: NDArray[np.float64],
    index: NDArray[np.uint16],
) -> NDArray[np.bool_]:
    """Whether another rectangle crosses the way from the surface point (or the sky) to the other view."""
    other = scene.camera.pose("right" if view == "left" else "left", instant)[:3, 3]
    sky = index == 0
    towards = np.where(
        sky[..., None], directions, pose[:3, 3] + np.where(sky, 0, depth)[..., None] * directions - other
    )
    occluded = np.zeros(depth.shape, bool)
    for number, thing in enumerate(scene.objects, start=1):
        length, _ = _meet(thing.pose(instant), other, towards)
        occluded |= (length < np.where(sky, np.inf, 1.0)) & (index != number)
    return occluded


def _paint(
    index: NDArray[np.uint16], surface: NDArray[np.float64], directions: NDArray[np.float64]
) -> NDArray[np.uint8]:
    """A smooth pattern fixed to each surface, so that both views see the same colour at the same point."""
    angle = np.arctan2(directions[..., 1], directions[..., 0])
    place = np.where((index == 0)[..., None], np.stack([angle, directions[..., 2]], axis=-1), surface)
    u, v = place[..., 0], place[..., 1]
    phase = index * 1.7
    channels = [
        127.5 + 60 * np.sin(a * u + phase + k) + 60 * np.cos(b * v - phase + 2 * k)
        for k, (a, b) in enumerate(((9, 5), (14, 11), (23, 17)))
    ]
    return np.stack(channels, axis=-1).round().clip(0, 255).astype(np.uint8)


def make_recipe(scenes: dict[str, int]) -> Recipe:
    """A recipe to lie at the root; its family plays no part in the analytic world."""
    return Recipe(world=FAMILIES["flying_things"].config(width=WIDTH, height=HEIGHT), scenes=scenes)


def write_dataset(root: Path, scenes: dict[str, int]) -> None:
    """Write that many scenes of each split, whole, with recipe and manifests."""
    recipe = make_recipe(scenes)
    layout = Layout(root)
    write_recipe(layout.recipe, recipe)
    for split, count in scenes.items():
        for number in range(count):
            write_scene(layout, split, number, recipe)


def write_scene(layout: Layout, split: str, number: int, recipe: Recipe) -> None:
    scene = make_scene(number)
    record = layout.scene_record(split, number)
    record.parent.mkdir(parents=True, exist_ok=True)
    record.write_text(scene_to_json(scene))
    paths = [record, layout.file("camera_data", split, number)]
    poses = {
        FIRST_FRAME + k: (scene.camera.pose("left", k), scene.camera.pose("right", k)) for k in range(FRAMES)
    }
    write_camera_data(paths[1], poses)
    paths.append(layout.file("cameras", split, number))
    write_cameras(paths[2], cameras_of(scene))
    for instant in range(FRAMES):
        for view in ("left", "right"):
            paths += write_view(
                layout, split, number, view, FIRST_FRAME + instant, render(scene, view, instant)
            )
    commit(layout, split, number, [file_entry(layout.root, path) for path in paths], recipe)


def cameras_of(scene: Scene) -> dict[str, object]:
    """cameras.json by hand: OpenCV has y down, z forward and the first pixel's centre at 0."""
    matrix = [[FOCAL_PX, 0, WIDTH / 2 - 0.5], [0, FOCAL_PX, HEIGHT / 2 - 0.5], [0, 0, 1]]
    frames = {}
    for k in range(FRAMES):
        poses = {view: scene.camera.pose(view, k) @ np.diag((1, -1, -1, 1)) for view in CAMERA_OFFSET}
        frames[str(FIRST_FRAME + k)] = {
            view: {
                "K": matrix,
                "camera_to_world": pose.tolist(),
                "world_to_camera": np.linalg.inv(pose).tolist(),
            }
            for view, pose in poses.items()
        }
    return {
        "width": WIDTH,
        "height": HEIGHT,
        "fx": FOCAL_PX,
        "fy": FOCAL_PX,
        "cx_left": WIDTH / 2 - 0.5,
        "cx_right": WIDTH / 2 - 0.5,
        "cy": HEIGHT / 2 - 0.5,
        "baseline_m": BASELINE_M,
        "disparity_at_infinity": 0.0,
        "frames": frames,
    }


def write_view(
    layout: Layout, split: str, scene: int, view: str, frame: int, arrays: RenderedView
) -> list[Path]:
    """Write one view's files; return their paths."""
    kinds = ("frames_cleanpass", "disparity", "disparity_gradient", "occlusion", "object_index")
    paths = [layout.file(kind, split, scene, view, frame) for kind in kinds]
    write_png(paths[0], arrays.image)
    write_pfm(paths[1], arrays.disparity)
    write_gradient(paths[2], arrays.gradient, arrays.gradient_valid)
    write_occlusion(paths[3], arrays.occlusion)
    write_png(paths[4], arrays.object_index)
    return paths


def commit(layout: Layout, split: str, number: int, files: list[FileEntry], recipe: Recipe) -> None:
    """Write the manifest over whatever the scene's files are now."""
    manifest = SceneManifest(
        family=recipe.family,
        split=split,
        scene=number,
        recipe_sha256=recipe.settings_sha256(),
        files=tuple(sorted(files, key=lambda entry: entry.path)),
        seconds={"render": 0.5},
        statistics={},
        versions={},
    )
    write_manifest(layout.manifest(split, number), manifest)


def vouch(root: Path, split: str, scene: int) -> None:
    """Make a scene's manifest say of its files what they are now."""
    path = Layout(root).manifest(split, scene)
    manifest = read_manifest(path)
    entries = tuple(file_entry(root, root / entry.path) for entry in manifest.files)
    write_manifest(path, dataclasses.replace(manifest, files=entries))
