"""Optical flow, disparity change, motion boundaries and normals against closed forms and rendered pictures."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from scipy.spatial.transform import Rotation

from datagen import DatasetError, Recipe, StereoDataset, StereoSample, render_dataset
from datagen.dataset.layout import DIRECTIONS, EXTRA_TARGETS, VIEWS, Direction, Layout, View
from datagen.dataset.manifest import file_entry, read_manifest, write_manifest
from datagen.formats import write_depth, write_flow, write_mask, write_normals, write_pfm, write_png
from datagen.gallery.page import write_gallery
from datagen.ground_truth.raycast import SceneRayCaster
from datagen.ground_truth.scene_geometry import build_geometry
from datagen.ground_truth.targets import STEP, ExtraTargets, PixelSurfaces, find_surfaces, reflective
from datagen.recipe.recipe import read_recipe, recipe_to_text
from datagen.rendering.card import CARD
from datagen.verify.dataset_check import verify_dataset
from scenes import FAMILIES, Scene
from scenes.motion.trajectories import quaternion
from scenes.shapes.solids.basic import Plane
from scenes.spec import Deformation, Material, Rig, SceneObject, StereoCamera, Trajectory, World
from scenes.textures.plain import SolidColor
from tests.datagen.worlds import plates

WIDTH, HEIGHT = 96, 64
FOCAL_PX, BASELINE_M = 96.0, 0.4
NOW = 1
"""The frame looked at, so that there is a past."""
TOLERANCE_PX = 1e-2


@dataclass(frozen=True)
class Stretch(Deformation):
    """An affine change of shape, growing with time: a plane stays a plane, so there is a closed form."""

    matrix: tuple[tuple[float, float, float], ...]

    def deformed(self, vertices: NDArray[np.float64], time_frames: float) -> NDArray[np.float64]:
        return vertices + time_frames * vertices @ np.array(self.matrix).T


STRETCH = ((0.05, 0.02, 0.0), (-0.03, 0.04, 0.0), (0.06, -0.05, 0.0))


@dataclass(frozen=True)
class Motion:
    """x(t) = position + t velocity, R(t) = exp(t turn) start; keys at t = 0 and t = 2 make it exactly so."""

    position: tuple[float, float, float]
    velocity: tuple[float, float, float]
    turn: tuple[float, float, float]
    start: Rotation

    def trajectory(self) -> Trajectory:
        poses = [self.at(time) for time in (0.0, 2.0)]
        return Trajectory(
            (0.0, 2.0),
            tuple(tuple(float(v) for v in position) for _, position in poses),
            tuple(quaternion(Rotation.from_matrix(matrix)) for matrix, _ in poses),
        )

    def at(self, time: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        position = np.array(self.position) + time * np.array(self.velocity)
        return (Rotation.from_rotvec(time * np.array(self.turn)) * self.start).as_matrix(), position


RIG = Motion((0.3, -0.2, 0.5), (0.2, 0.1, -0.3), (0.02, -0.03, 0.04), Rotation.from_euler("xyz", (0.1, 0, 0)))
PLANE = Motion(
    (0.0, 0.0, -6.0), (-0.3, 0.2, 0.4), (0.05, 0.1, -0.15), Rotation.from_euler("xyz", (0.4, -0.3, 0.2))
)
PLANE_HALF_M = 3.0
KINDS = {"rigid": np.zeros((3, 3)), "deforming": np.array(STRETCH)}


CENTRED = Rig(WIDTH, HEIGHT, FOCAL_PX, FOCAL_PX, WIDTH / 2, WIDTH / 2, HEIGHT / 2, BASELINE_M)
RIGS = {
    "centred": CENTRED,
    "somebody's": Rig(
        WIDTH, HEIGHT, 1.1 * FOCAL_PX, 0.9 * FOCAL_PX, 0.46 * WIDTH, 0.55 * WIDTH, 0.57 * HEIGHT, BASELINE_M
    ),
}


def moving_plane(stretch: NDArray[np.float64], rig: Rig = CENTRED) -> Scene:
    deformation = Stretch(tuple(map(tuple, stretch))) if stretch.any() else None
    thing = SceneObject(
        "plane", Plane(), 0, PLANE.trajectory(), (PLANE_HALF_M, PLANE_HALF_M, 1.0), deformation
    )
    camera = rig.camera(RIG.trajectory())
    scene = plates(WIDTH, HEIGHT)
    return replace(
        scene, frames=3, camera=camera, objects=(thing,), materials=(Material(SolidColor((90, 90, 90))),)
    )


@dataclass(frozen=True)
class Expected:
    hit: NDArray[np.bool_]
    flow: NDArray[np.float64]
    disparity_change: NDArray[np.float64]
    normal: NDArray[np.float64]
    depth: NDArray[np.float64]


def closed_form(
    stretch: NDArray[np.float64], view: View, step: float, centre: float = 0.5, rig: Rig = CENTRED
) -> Expected:
    """Where the plane's points and the sky go from frame `NOW` on, from the motions' own formulas."""
    columns, rows = np.meshgrid(np.arange(WIDTH) + centre, np.arange(HEIGHT) + centre)
    cx = rig.cx_left if view == "left" else rig.cx_right
    rays = np.stack([(columns - cx) / rig.fx, (rig.cy - rows) / rig.fy, -np.ones_like(rows)], -1)
    spans, middle = plane_seen(stretch, view, NOW)
    # The ray meets middle + u spans_x + v spans_y: three linear equations in (depth, u, v).
    system = np.concatenate([rays[..., None], np.broadcast_to(-spans, (*rays.shape[:2], 3, 2))], -1)
    depth, u, v = np.moveaxis(
        np.linalg.solve(system, np.broadcast_to(middle, rays.shape)[..., None])[..., 0], -1, 0
    )
    hit = (np.abs(u) <= 1) & (np.abs(v) <= 1) & (depth > 0)
    spans_then, middle_then = plane_seen(stretch, view, NOW + step)
    there = middle_then + np.stack([u, v], -1) @ spans_then.T
    camera_now, camera_then = RIG.at(NOW)[0], RIG.at(NOW + step)[0]
    there = np.where(hit[..., None], there, rays @ camera_now.T @ camera_then)
    x = cx + rig.fx * there[..., 0] / -there[..., 2]
    y = rig.cy - rig.fy * there[..., 1] / -there[..., 2]
    change = np.where(hit, rig.fx * BASELINE_M * (1 / -there[..., 2] - 1 / depth), 0.0)
    normal = np.cross(spans[:, 0], spans[:, 1])
    normal *= -np.sign(normal @ middle) / np.linalg.norm(normal)
    return Expected(hit, np.stack([x - columns, y - rows], -1), change, normal, np.where(hit, depth, np.inf))


def plane_seen(
    stretch: NDArray[np.float64], view: View, time: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """In the view's frame: (3, 2) images of the plane's half axes, and its centre."""
    turn, position = PLANE.at(time)
    axes = turn @ np.diag((PLANE_HALF_M, PLANE_HALF_M, 1.0)) @ (np.eye(3) + time * stretch)[:, :2]
    camera, place = RIG.at(time)
    place = place + (BASELINE_M * camera[:, 0] if view == "right" else 0.0)
    return camera.T @ axes, camera.T @ (position - place)


def surfaces(scene: Scene, view: View, time: float = NOW) -> PixelSurfaces:
    geometry = build_geometry(scene)
    rows, columns = np.indices((scene.camera.height, scene.camera.width))
    return find_surfaces(SceneRayCaster(geometry), view, time, rows, columns)


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("lens", RIGS)
def test_flow_disparity_change_and_normals_have_their_closed_form(
    kind: str, view: View, direction: Direction, lens: str
) -> None:
    stretch, rig = KINDS[kind], RIGS[lens]
    found = surfaces(moving_plane(stretch, rig), view)
    expected = closed_form(stretch, view, STEP[direction], rig=rig)
    assert 0.3 < expected.hit.mean() < 0.95
    # Pixels on the plane's rim may fall to either side.
    rim = np.zeros_like(expected.hit)
    for axis in (0, 1):
        rim |= (np.diff(expected.hit, axis=axis, append=0) != 0) | (
            np.diff(expected.hit, axis=axis, prepend=0) != 0
        )
    flow = found.flow(direction)
    error = np.linalg.norm(flow - expected.flow, axis=-1)[~rim]
    print(f"{kind} {view} {direction}: flow p99.9 {np.percentile(error, 99.9):.2e}, max {error.max():.2e} px")
    assert np.percentile(error, 99.9) < TOLERANCE_PX
    assert np.abs(found.disparity_change(direction) - expected.disparity_change)[~rim].max() < TOLERANCE_PX
    normals = found.normals()[expected.hit & ~rim]
    assert np.abs(normals - expected.normal).max() < 1e-5
    hits = SceneRayCaster(build_geometry(moving_plane(stretch, rig))).cast_all(view, NOW)
    made = ExtraTargets(SceneRayCaster(found.geometry), ("depth",)).make(view, 0, hits)
    np.testing.assert_allclose(made["depth", None][~rim], expected.depth[~rim], rtol=1e-5)
    # What would be wrong: half a pixel, the sign, the direction, the other view, a forgotten deformation.
    other_view: View = "right" if view == "left" else "left"
    wrong = {
        "half a pixel": closed_form(stretch, view, STEP[direction], 0.0, rig).flow,
        "sign": -expected.flow,
        "direction": closed_form(stretch, view, -STEP[direction], rig=rig).flow,
        "view": closed_form(stretch, other_view, STEP[direction], rig=rig).flow,
        "shape": closed_form(0.5 * stretch + 0.01, view, STEP[direction], rig=rig).flow,
    }
    for name, other in wrong.items():
        assert np.percentile(np.linalg.norm(flow - other, axis=-1)[~rim], 50) > TOLERANCE_PX, name


@pytest.mark.parametrize("kinds", [(), *((kind,) for kind in EXTRA_TARGETS), EXTRA_TARGETS])
def test_only_what_was_asked_for_is_made(kinds: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """A target costs nothing where it is not wanted: flow is followed for flow and motion boundaries alone."""
    followed: list[Direction] = []
    flow = PixelSurfaces.flow

    def counted(surfaces: PixelSurfaces, direction: Direction) -> NDArray[np.float32]:
        followed.append(direction)
        return flow(surfaces, direction)

    monkeypatch.setattr(PixelSurfaces, "flow", counted)
    caster = SceneRayCaster(build_geometry(moving_plane(KINDS["rigid"])))
    hits = caster.cast_all("left", NOW)
    made = ExtraTargets(caster, kinds).make("left", NOW, hits)
    assert {kind for kind, _ in made} == set(kinds)
    assert followed == (list(DIRECTIONS) if {"optical_flow", "motion_boundaries"} & set(kinds) else [])


def test_points_that_go_behind_the_camera_have_no_flow() -> None:
    scene = moving_plane(np.zeros((3, 3)))
    path = Trajectory((0.0, 2.0), ((0.0, 0.0, -2.0), (0.0, 0.0, 9.0)), ((1.0, 0.0, 0.0, 0.0),) * 2)
    camera = replace(scene.camera, motion=Trajectory.static())
    scene = replace(scene, camera=camera, objects=(replace(scene.objects[0], motion=path),))
    found = surfaces(scene, "left", 0.0)
    assert np.isnan(found.flow("into_future")).all()
    assert np.isnan(found.disparity_change("into_future")).all()
    assert np.isfinite(found.flow("into_past")).all()


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two frames of one small world with every target."""
    root = tmp_path_factory.mktemp("targets") / "set"
    world = FAMILIES["flying_things"].config(
        width=160,
        height=96,
        frames=2,
        background_objects=(10, 10),
        flying_objects=(6, 6),
        camera_speed=(0.02, 0.03),
        flying_speed=(0.02, 0.03),
    )
    recipe = Recipe(world, {"train": 1}, seed=5, samples=4, targets=EXTRA_TARGETS)
    assert render_dataset(recipe, root, workers=1).failures == ()
    return root


def warp_errors(
    here: StereoSample, there: StereoSample, flow: NDArray[np.float32], view: View
) -> NDArray[np.float64]:
    """(H, W) mean squared difference, levels^2, of one picture and the other one fetched along the flow."""
    rows, columns = np.indices(here.size)
    where = [rows + flow[..., 1], columns + flow[..., 0]]
    picture = there.view(view).image
    fetched = [
        map_coordinates(picture[..., c].astype(float), where, order=1, mode="nearest") for c in range(3)
    ]
    return ((np.stack(fetched, -1) - here.view(view).image) ** 2).mean(axis=-1)


def psnr(errors: NDArray[np.float64]) -> float:
    return float(10 * np.log10(255**2 / errors.mean()))


@pytest.mark.parametrize("view", VIEWS)
def test_warping_the_next_frame_by_the_flow_gives_this_one_where_it_is_visible(
    dataset: Path, view: View
) -> None:
    first, second = StereoDataset(dataset, "train")
    for here, there, direction in ((first, second, "into_future"), (second, first, "into_past")):
        flow = here.flow(view, direction)
        height, width = here.size
        rows, columns = np.indices(here.size)
        x, y = columns + flow[..., 0], rows + flow[..., 1]
        inside = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)
        # Visible: the disparity that the point will have is found where the point will be.
        expected = here.view(view).disparity + here.disparity_change(view, direction)
        around = np.stack(
            [
                there.view(view).disparity[
                    np.clip(np.floor(y).astype(int) + i, 0, height - 1),
                    np.clip(np.floor(x).astype(int) + j, 0, width - 1),
                ]
                for i in (0, 1)
                for j in (0, 1)
            ]
        )
        low, high = around.min(axis=0), around.max(axis=0)
        visible = inside & (high - low < 0.5) & (expected > low - 0.02) & (expected < high + 0.02)
        occluded = inside & (low > expected + 0.5)
        errors = warp_errors(here, there, flow, view)
        turned = warp_errors(here, there, -flow, view)
        print(
            f"{view} {direction}: visible {visible.mean():.1%} {psnr(errors[visible]):.1f} dB, occluded "
            f"{occluded.mean():.1%} {psnr(errors[occluded]):.1f} dB, sign turned {psnr(turned[visible]):.1f} dB"
        )
        assert visible.mean() > 0.5
        assert psnr(errors[visible]) > 25
        assert psnr(errors[occluded]) < psnr(errors[visible]) - 6
        assert psnr(turned[visible]) < psnr(errors[visible]) - 3


def test_all_targets_are_there_and_agree_among_themselves(dataset: Path) -> None:
    assert verify_dataset(dataset, workers=1).problems == ()
    for sample in StereoDataset(dataset, "train"):
        materials = np.array([0, *(1 + thing.material for thing in sample.scene_record.objects)])
        for view in VIEWS:
            arrays = sample.view(view)
            assert np.array_equal(sample.material_index(view), materials[arrays.object_index])
            shiny = [
                k
                for k, thing in enumerate(sample.scene_record.objects, 1)
                if (material := sample.scene_record.materials[thing.material]).metallic > 0
                or material.transmission > 0
                or (material.specular > 0 and material.roughness <= 0.35)
            ]
            assert np.array_equal(sample.reflective(view), 255 * np.isin(arrays.object_index, shiny))
            length = np.linalg.norm(sample.normals(view), axis=-1)
            assert (np.abs(length[arrays.object_index > 0] - 1) < 1e-5).mean() > 0.99  # silhouettes are ties
            assert (length[arrays.object_index == 0] == 0).mean() > 0.99
            for direction in DIRECTIONS:
                flow, marked = sample.flow(view, direction), sample.motion_boundaries(view, direction)
                assert 0 < marked.mean() < 0.3
                # Inside one object the flow is smooth; marked pixels touch another object.
                index = np.pad(arrays.object_index.astype(int), 1, mode="edge")
                touching = np.zeros(sample.size, bool)
                for rows, columns in ((0, 1), (2, 1), (1, 0), (1, 2)):
                    shifted = index[rows : rows + sample.size[0], columns : columns + sample.size[1]]
                    touching |= shifted != arrays.object_index
                assert (touching[marked]).mean() > 0.99
                assert np.isfinite(flow).all()


def test_what_shows_its_surroundings_is_reflective() -> None:
    chalk = Material(SolidColor((200, 200, 200)))
    kinds = {
        chalk: 0,
        replace(chalk, specular=0.5, roughness=0.6): 0,
        replace(chalk, specular=0.5, roughness=0.1): 255,
        replace(chalk, metallic=1.0): 255,
        replace(chalk, transmission=0.5): 255,
        replace(chalk, emission=2.0): 0,
    }
    things = tuple(SceneObject(str(k), Plane(), k, Trajectory.static()) for k in range(len(kinds)))
    world = World(SolidColor((0, 0, 0)))
    camera = StereoCamera(8, 8, 32.0, 0.1, Trajectory.static())
    scene = Scene("kinds", 1, camera, things, tuple(kinds), (), world)
    index = np.arange(len(kinds) + 1)[None]
    assert reflective(scene, index).tolist() == [[0, *kinds.values()]]


def commit_again(root: Path) -> None:
    """Make the manifest say what the files are now."""
    layout = Layout(root)
    path = layout.manifest("train", 0)
    manifest = read_manifest(path)
    write_manifest(
        path, replace(manifest, files=tuple(file_entry(root, root / f.path) for f in manifest.files))
    )


def test_verify_finds_targets_that_are_not_of_the_scene(dataset: Path, tmp_path: Path) -> None:
    """Files that are whole and well-formed, but say something wrong."""
    root = Path(shutil.copytree(dataset, tmp_path / "set"))
    sample, layout = StereoDataset(root, "train")[0], Layout(root)
    turned = sample.normals("left") * np.float32([1, -1, 1])
    mistakes: list[tuple[str, Direction | None, Callable[[Path, Any], None], Any]] = [
        ("material_index", None, write_png, sample.material_index("right")),
        ("reflective", None, write_png, np.uint8(255) - sample.reflective("left")),
        ("normals", None, write_normals, turned),
        ("depth", None, write_depth, sample.depth("left") * np.float32(1.001)),
        ("depth", None, write_depth, np.minimum(sample.depth("left"), np.float32(1e4))),
        ("optical_flow", "into_future", write_flow, sample.flow("left", "into_future") + np.float32(0.5)),
        ("optical_flow", "into_past", write_flow, -sample.flow("left", "into_past")),
        ("disparity_change", "into_future", write_pfm, sample.disparity_change("left", "into_past")),
        ("motion_boundaries", "into_past", write_mask, ~sample.motion_boundaries("left", "into_past")),
    ]
    for kind, direction, write, values in mistakes:
        path = layout.file(kind, "train", 0, "left", sample.frame, direction)
        good = path.read_bytes()
        write(path, values)
        commit_again(root)
        problems = verify_dataset(root, workers=1).problems
        assert problems, kind
        # Motion boundaries follow from the flow, so a wrong flow is seen in them too.
        alike = (kind, "motion_boundaries") if kind == "optical_flow" else (kind,)
        assert all(any(k in str(problem) for k in alike) for problem in problems)
        path.write_bytes(good)
    commit_again(root)
    assert verify_dataset(root, workers=1).problems == ()


def keep_targets(root: Path, kinds: tuple[str, ...]) -> None:
    """Make it the set that is rendered with these targets only."""
    layout = Layout(root)
    recipe = replace(read_recipe(layout.recipe), targets=kinds)
    layout.recipe.write_text(recipe_to_text(recipe), encoding="utf-8")
    (root / CARD).unlink()  # it is of the set with all targets
    for kind in set(EXTRA_TARGETS) - set(kinds):
        shutil.rmtree(root / kind)
    path = layout.manifest("train", 0)
    manifest = read_manifest(path)
    files = tuple(entry for entry in manifest.files if (root / entry.path).is_file())
    write_manifest(path, replace(manifest, files=files, recipe_sha256=recipe.settings_sha256()))


@pytest.mark.parametrize("mistake", ["none marked", "all marked", "moved by a pixel"])
def test_motion_boundaries_are_verified_without_stored_flow_too(
    mistake: str, dataset: Path, tmp_path: Path
) -> None:
    root = Path(shutil.copytree(dataset, tmp_path / "set"))
    keep_targets(root, ("motion_boundaries",))
    assert verify_dataset(root, workers=1).problems == ()
    sample = StereoDataset(root, "train")[0]
    right = sample.motion_boundaries("left", "into_past")
    wrong = {
        "none marked": right & False,
        "all marked": right | True,
        "moved by a pixel": np.roll(right, 1, axis=1),
    }[mistake]
    write_mask(Layout(root).file("motion_boundaries", "train", 0, "left", sample.frame, "into_past"), wrong)
    commit_again(root)
    (problem,) = verify_dataset(root, workers=1).problems
    assert "pixels of motion boundaries differ from the scene's geometry" in str(problem)


@pytest.mark.parametrize("kind", EXTRA_TARGETS)
def test_targets_are_read_and_what_follows_from_others_compared_without_rays_too(
    kind: str, dataset: Path, tmp_path: Path
) -> None:
    root = Path(shutil.copytree(dataset, tmp_path / "set"))
    layout, sample = Layout(root), StereoDataset(root, "train")[0]
    still = ("depth", "material_index", "reflective", "normals")
    direction: Direction | None = None if kind in still else "into_past"
    path = layout.file(kind, "train", 0, "left", sample.frame, direction)
    if kind == "material_index":
        write_png(path, sample.material_index("left") + np.uint16(1))
    elif kind == "reflective":
        write_png(path, np.uint8(255) - sample.reflective("left"))
    elif kind == "motion_boundaries":
        write_mask(path, ~sample.motion_boundaries("left", "into_past"))
    else:
        path.write_bytes(path.read_bytes()[:100])
    commit_again(root)
    (problem,) = verify_dataset(root, workers=1, sampled_pixels=0).problems
    assert kind in problem.place


def test_objects_beyond_the_scene_are_a_problem_and_no_crash(dataset: Path, tmp_path: Path) -> None:
    root = Path(shutil.copytree(dataset, tmp_path / "set"))
    sample = StereoDataset(root, "train")[0]
    path = Layout(root).file("object_index", "train", 0, "left", sample.frame)
    write_png(path, sample.object_index_left + np.uint16(1000))
    commit_again(root)
    assert "is beyond the scene's" in "".join(map(str, verify_dataset(root, workers=1).problems))


def test_flow_loaders_find_the_published_names(dataset: Path) -> None:
    """The globs of torchvision's FlyingThings3D and RAFT's loader: as many flows as pictures, in order."""
    for direction, towards in (("into_future", "IntoFuture"), ("into_past", "IntoPast")):
        for view in VIEWS:
            folder = dataset / "optical_flow/TRAIN/A/0000" / direction / view
            names = sorted(path.name for path in folder.glob("*.pfm"))
            assert names == [f"OpticalFlow{towards}_{k:04d}_{view[0].upper()}.pfm" for k in (6, 7)]
            first = (folder / names[0]).read_bytes()
            assert first.startswith(b"PF\n160 96\n-1.0\n")
            values = np.frombuffer(first[-4 * 3 * 160 * 96 :], "<f4").reshape(96, 160, 3)[::-1]
            sample = StereoDataset(dataset, "train")[0]
            assert np.array_equal(values[..., :2], sample.flow(view, direction))
            assert not values[..., 2].any()


def test_unknown_targets_are_refused() -> None:
    world = FAMILIES["flying_things"].config()
    with pytest.raises(DatasetError, match=r"targets must be among depth, material_index.*'albedo'"):
        Recipe(world, {"train": 1}, targets=("albedo",))


def test_the_gallery_shows_the_targets_on_request(dataset: Path, tmp_path: Path) -> None:
    write_gallery(dataset, tmp_path / "gallery.html")
    page = (tmp_path / "gallery.html").read_text()
    for caption in ("Surface normals", "Materials", "Flow to the next frame", "Change of disparity"):
        assert caption in page
    assert "Motion boundaries" in page
