"""What sintel and monkaa share: framings, things near the camera, ponds, and shares of materials."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from datagen.ground_truth.scene_geometry import SceneGeometry, build_geometry
from scenes import FAMILIES, sample_scene
from scenes.appearance.material_textures import fur
from scenes.landscapes.framing import FRAMINGS
from scenes.landscapes.terrain import Land, LandscapeConfig
from scenes.landscapes.water import water_size_m, with_pond
from scenes.motion.trajectories import quaternion
from scenes.placement.ground import GroundPlacement
from scenes.random_draws import uniform
from scenes.shapes.nature.landforms import Landscape, eroded_relief
from scenes.spec import Scene, StereoCamera, Trajectory
from tests.scenes.families.landscapes import first_hits, ground_below, world_vertices

FAMILY_NAMES = ("monkaa", "sintel")
SHARES = ("near_share", "far_share", "several_share", "empty_share")


def config_of(family: str, **changes: object) -> LandscapeConfig:
    few = {
        "monkaa": {"fur_locks": (50, 100), "undergrowth": (4, 6), "grass_tufts": (3, 5), "trees": (3, 4)},
        "sintel": {"people": (1, 3), "trees": (3, 4), "structures": (3, 4), "plants": (3, 4)},
    }[family]
    config = FAMILIES[family].config(width=96, height=54)
    changed: LandscapeConfig = dataclasses.replace(config, boulders=(4, 6), **few | changes)
    return changed


def sampled(family: str, seed: int, **changes: object) -> Scene:
    return sample_scene(np.random.default_rng(seed), family, config_of(family, **changes))


def framed(family: str, kind: str, seed: int) -> Scene:
    only = dict.fromkeys(SHARES, 0.0) | ({f"{_FIELDS[kind]}": 1.0} if kind in _FIELDS else {})
    return sampled(family, seed, **only)


_FIELDS = {"near": "near_share", "far": "far_share", "several": "several_share", "none": "empty_share"}


def main_height(scene: Scene, geometry: SceneGeometry) -> float:
    """Height of the first character as a share of the image's, as it would be seen on the optical axis."""
    parts = [
        k
        for k, thing in enumerate(scene.objects)
        if thing.name.split()[:2] in (["person", "0"], ["creature", "0"])
    ]
    points = np.concatenate([world_vertices(geometry, k, 0.0) for k in parts])
    pose = scene.camera.pose("left", 0.0)
    depth = float((points.mean(axis=0) - pose[:3, 3]) @ -pose[:3, 2])
    return float(np.ptp(points[:, 2])) / depth * scene.camera.focal_px / scene.camera.height


@pytest.mark.parametrize("family", FAMILY_NAMES)
def test_framings_are_near_far_several_or_none(family: str) -> None:
    heights: dict[str, list[float]] = {}
    for kind in FRAMINGS:
        for seed in range(2):
            scene = framed(family, kind, seed)
            assert FRAMINGS[int(scene.notes["framing"])] == kind
            characters = scene.notes["people" if family == "sintel" else "creatures"]
            if kind == "none":
                assert characters == 0
                continue
            assert characters >= 1
            heights.setdefault(kind, []).append(main_height(scene, build_geometry(scene)))
    assert np.median(heights["near"]) > 1.3 * np.median(heights["middle"])
    assert np.median(heights["far"]) < 0.6 * np.median(heights["middle"])


@pytest.mark.parametrize("family", FAMILY_NAMES)
def test_poses_differ_and_bodies_are_not_upright_dummies(family: str) -> None:
    """Heads, hands and feet of different characters are at different places relative to their bodies."""
    ends = []
    for seed in range(5):
        scene = framed(family, "middle", seed)
        body = next(t for t in scene.objects if t.name.split()[:2] in (["person", "0"], ["creature", "0"]))
        joints = body.deformation.joints  # type: ignore[union-attr]
        axes = np.array([np.subtract(joint.end, joint.start) for joint in joints])
        axes /= np.maximum(np.linalg.norm(axes, axis=1, keepdims=True), 1e-9)
        # A dummy's bones lie along the axes, in the plane that halves it or square to it.
        ends.append(float((np.abs(axes).max(axis=1) < 0.985).mean()))
    assert np.median(ends) > 0.3


@pytest.mark.parametrize("family", FAMILY_NAMES)
def test_ponds_lie_in_basins_and_nothing_but_stones_stands_in_them(family: str) -> None:
    found = 0
    for seed in range(7):
        scene = sampled(family, seed, water_share=1.0)
        water = next((k for k, thing in enumerate(scene.objects) if thing.name == "water"), None)
        shape = scene.objects[0].shape
        assert isinstance(shape, Landscape)
        assert (water is not None) == (shape.basin is not None) == bool(scene.notes["water"])
        if water is None:
            continue
        found += 1
        geometry = build_geometry(scene)
        surface = world_vertices(geometry, water, 0.0)
        level = float(np.median(surface[surface[:, 2] > surface[:, 2].min() + 1e-6, 2]))
        middle = np.append(surface[:, :2].mean(axis=0), 0.0)[None]
        assert ground_below(geometry, middle)[0] < level
        assert scene.camera.pose("left", 0.0)[2, 3] > level
        assert scene.materials[scene.objects[water].material].is_reflective
        for index, thing in enumerate(scene.objects):
            kind = thing.name.split()[0]
            if kind in ("tree", "plant", "house", "near", "bamboo", "column"):
                foot = world_vertices(geometry, index, 0.0).mean(axis=0)[None]
                assert ground_below(geometry, foot)[0] > level - 0.6 * np.ptp(
                    world_vertices(geometry, index, 0.0)[:, 2]
                )
    assert found >= 2


def test_the_edge_of_a_ponds_water_is_under_the_shore() -> None:
    ponds = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        shape = Landscape(
            0.15, uniform(rng, 0.0001, 0.0006), 0.2, uniform(rng, 3.0, 9.0), 7, 0.5, 120, 2.4, seed
        )
        land = with_pond(rng, Land(shape, uniform(rng, 30.0, 60.0)), 1.0, 1.0)
        basin = land.shape.basin
        if basin is None:
            continue
        ponds += 1
        long_m, wide_m = water_size_m(land)
        along, ends = np.linspace(-1.0, 1.0, 101), np.repeat([-1.0, 1.0], 101)
        rim = np.concatenate(
            [np.stack([np.tile(along, 2), ends], -1), np.stack([ends, np.tile(along, 2)], -1)]
        )
        cos, sin = np.cos(basin.heading_rad), np.sin(basin.heading_rad)
        turned = rim * (long_m, wide_m) @ np.array([[cos, sin], [-sin, cos]])
        assert (land.height_m(turned + np.array((basin.x, basin.y)) * land.half_m) > land.water_m).all(), seed
    assert ponds > 6


def test_eroded_land_has_no_steps() -> None:
    """Along a line, heights hardly differ between points that are very near to each other."""
    line = np.stack([np.linspace(-1.0, 1.0, 40_001), np.full(40_001, 0.3)], -1)
    for seed in range(8):
        heights = eroded_relief(np.random.default_rng(seed), line, 3.6, 3, 0.7)
        assert np.abs(np.diff(heights)).max() < 0.01 * np.ptp(heights), seed


@pytest.mark.parametrize("family", FAMILY_NAMES)
def test_shares_of_materials_are_fields(family: str) -> None:
    def reflective(share: float) -> float:
        changes = {f"{name}_share": share for name in ("glossy", "metallic", "transparent")}
        scenes = [sampled(family, seed, water_share=0.0, **changes) for seed in range(2)]
        return float(np.mean([material.is_reflective for scene in scenes for material in scene.materials]))

    def plain(share: float) -> float:
        scenes = [sampled(family, seed, plain_share=share) for seed in range(2)]
        kinds = [type(material.color).__name__ for scene in scenes for material in scene.materials]
        return kinds.count("NearTextureless") / len(kinds)

    assert reflective(1.0) > reflective(0.0) + 0.08
    assert plain(1.0) > plain(0.0) + 0.05


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILY_NAMES)
def test_scenes_are_near_and_far(family: str) -> None:
    medians, largest = [], []
    for seed in range(16):
        scene = sample_scene(
            np.random.default_rng(seed), family, FAMILIES[family].config(width=96, height=54)
        )
        disparity = first_hits(scene, build_geometry(scene)).disparity_960
        medians.append(np.median(disparity))
        largest.append(np.percentile(disparity, 99))
    assert 15 < np.median(medians) < 42
    assert np.percentile(medians, 90) > 2.2 * max(np.percentile(medians, 10), 1.0)
    assert np.median(largest) > 40


def numbered(name: str) -> str:
    """The name up to its first number: of `near plant 3 leaf 1` that is `near plant 3`."""
    words = name.split()
    first = next((place for place, word in enumerate(words) if word.isdigit()), len(words))
    return " ".join(words[: first + 1])


@pytest.mark.parametrize("family", FAMILY_NAMES)
def test_nothing_stands_in_the_middle_of_a_character(family: str) -> None:
    for seed in range(3):
        scene = framed(family, "several", seed)
        geometry = build_geometry(scene)
        things: dict[str, list[int]] = {}
        for index, thing in enumerate(scene.objects):
            things.setdefault(numbered(thing.name), []).append(index)
        boxes = {}
        for name, indices in things.items():
            points = np.concatenate([world_vertices(geometry, index, 0.0) for index in indices])
            boxes[name] = points.min(axis=0), points.max(axis=0)
        bodies = [name for name in boxes if name.startswith(("person", "creature"))]
        for body in bodies:
            low, high = boxes[body]
            heart = low + (high - low) * (0.5, 0.5, 0.45)
            for other, (other_low, other_high) in boxes.items():
                if other != body and not other.startswith(
                    ("ground", "water", "cave", "bush", "tree", "ruin", "house")
                ):
                    assert not ((heart > other_low) & (heart < other_high)).all(), (seed, body, other)


def test_a_texture_may_have_a_largest_size() -> None:
    land = Land(Landscape(0.15, 0.0003, 0.2, 6.0, 3, 0.5, 20, 2.4, 0), 40.0)
    level = quaternion(Rotation.from_euler("X", 90.0, degrees=True))
    camera = StereoCamera(96, 54, 35.0, 0.1, Trajectory.static((0.0, 0.0, 1.6), level))
    placement = GroundPlacement(land, camera, 1, 1.0)
    free, bound = (
        placement.new_material(np.random.default_rng(0), fur, 3.0, 20.0, size=512, largest_m=most)
        for most in (np.inf, 6.0)
    )
    assert placement.materials[free].repeats < 0.5
    assert placement.materials[bound].repeats == pytest.approx(0.5)
