"""The monkaa family: what every scene promises, and what its camera sees."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from datagen.ground_truth.scene_geometry import build_geometry
from scenes import sample_scene
from scenes.families.monkaa import PLACES, MonkaaConfig
from scenes.landscapes.framing import FRAMINGS
from scenes.serialization import scene_from_json, scene_to_json
from scenes.spec import Scene
from tests.scenes.families.landscapes import encloses, first_hits, heights_of_feet, nearest_m, world_vertices

SMALL = MonkaaConfig(
    width=96,
    height=54,
    fur_locks=(50, 100),
    undergrowth=(8, 12),
    grass_tufts=(5, 8),
    trees=(4, 6),
    boulders=(4, 6),
)
FEW = dataclasses.replace(SMALL, frames=24)
seeds = st.integers(0, 2**32 - 1)


def sampled(seed: int, config: MonkaaConfig = SMALL) -> Scene:
    return sample_scene(np.random.default_rng(seed), "monkaa", config)


def test_the_same_seed_gives_the_same_scene_and_json_keeps_it() -> None:
    scene = sampled(11)
    assert sampled(11) == scene
    assert sampled(12) != scene
    again = scene_from_json(scene_to_json(scene))
    assert again == scene
    before, after = (build_geometry(s).vertices(0.0) for s in (scene, again))
    assert np.array_equal(before, after)


@settings(max_examples=4, deadline=None)
@given(seed=seeds)
def test_neither_camera_is_ever_inside_or_near_anything(seed: int) -> None:
    scene = sampled(seed, FEW)
    geometry = build_geometry(scene)
    closest = scene.camera.disparity_metres / (SMALL.largest_disparity_share * scene.camera.width)
    for time in (0.0, 11.5, 23.0):
        for view in ("left", "right"):
            position = scene.camera.pose(view, time)[:3, 3]
            # The ground below the image may be nearer than what is in it.
            assert nearest_m(geometry, time, view) > 0.3 * closest
            for index, thing in enumerate(scene.objects):
                if thing.name in ("ground", "cave"):
                    assert abs(encloses(geometry, index, position, time)) < 0.02


@settings(max_examples=4, deadline=None)
@given(seed=seeds)
@example(seed=450)  # a tree on a hill, whose boughs hang lower than its foot
def test_what_stands_stands_on_the_ground_throughout(seed: int) -> None:
    scene = sampled(seed, FEW)
    geometry = build_geometry(scene)
    standing = [
        index
        for index, thing in enumerate(scene.objects)
        if thing.name.split()[0] not in ("ground", "water", "cave", "vine", "stalactite", "creature")
        and not thing.name.endswith(("cap", "leaves"))
    ]
    assert len(standing) > 10
    for time in (0.0, 17.0):
        # A foot in the air would be more than a few hundredths of the thing's size above the ground.
        above = heights_of_feet(geometry, standing, time)
        assert above.max() < 0.06, [scene.objects[k].name for k in np.array(standing)[above >= 0.06]]


def test_all_parts_of_a_creature_stay_together() -> None:
    scene = sampled(5, dataclasses.replace(FEW, empty_share=0.0))
    geometry = build_geometry(scene)
    body = next(k for k, t in enumerate(scene.objects) if t.name.startswith("creature 0 fur"))
    eyes = next(k for k, t in enumerate(scene.objects) if t.name.startswith("creature 0 eye"))
    gaps = []
    for time in (0.0, 4.0, 9.0, 16.0, 23.0):
        skin, ball = (world_vertices(geometry, k, time) for k in (body, eyes))
        centre = ball.mean(axis=0)
        gaps.append(np.linalg.norm(skin - centre, axis=1).min())
    size = np.ptp(world_vertices(geometry, body, 0.0), axis=0).max()
    assert max(gaps) - min(gaps) < 0.05 * size


def test_creatures_move_and_do_not_burst() -> None:
    scene = sampled(6, dataclasses.replace(FEW, empty_share=0.0))
    geometry = build_geometry(scene)
    moved = 0
    for index, thing in enumerate(scene.objects):
        if thing.deformation is None:
            continue
        one, two, later = (world_vertices(geometry, index, time) for time in (3.0, 4.0, 20.0))
        size = np.ptp(one, axis=0).max()
        assert np.abs(two - one).max() < 0.25 * size
        assert np.ptp(later, axis=0).max() < 2.0 * size
        moved += bool(np.abs(two - one).max() > 1e-4 * size)
    assert moved > 3


@pytest.mark.slow
def test_what_the_camera_sees_over_many_scenes() -> None:
    disparities, places, seen_creatures = [], set(), 0
    for seed in range(14):
        scene = sampled(seed)
        seen = first_hits(scene, build_geometry(scene))
        near = seen.disparity_960[seen.disparity_960 > 0]
        assert near.max() < 1.15 * SMALL.largest_disparity_share * 960
        assert np.percentile(near, 1) < 0.6 * np.percentile(near, 95)
        share = np.bincount(seen.index[seen.index >= 0], minlength=len(scene.objects)) / seen.index.size
        rigid = [k for k, thing in enumerate(scene.objects) if thing.name not in ("ground", "cave")]
        assert share[rigid].max() < 0.65
        assert share.max() < 0.97
        first = [k for k, thing in enumerate(scene.objects) if thing.name.startswith("creature 0")]
        seen_creatures += scene.notes["framing"] == FRAMINGS.index("none") or share[first].sum() > 0.002
        places.add(PLACES[int(scene.notes["place"])])
        disparities.append(near)
    assert seen_creatures >= 13
    assert len(places) >= 3
    pooled = np.concatenate(disparities)
    low, middle, high = np.percentile(pooled, (2, 50, 98))
    assert 0.3 < low < 8
    assert 12 < middle < 55
    assert 50 < high < 182


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"focal_mm": (50.0, 35.0)}, r"focal_mm must be \(low, high\)"),
        ({"focus_disparity_share": (0.0, 0.02)}, "focus_disparity_share must be above 0"),
        ({"focus_disparity_share": (0.01, 0.2)}, "focus_disparity_share must not exceed"),
        ({"cave_share": 1.5}, "cave_share must be in"),
        ({"glossy_share": -0.1}, r"glossy_share must be in 0\.\.1"),
        ({"near_share": 0.7, "far_share": 0.4}, "must not exceed 1 together"),
        ({"largest_disparity_share": 0.1}, "focus_disparity_share must not exceed half"),
        ({"frames": 0}, "frames must be at least 1"),
    ],
)
def test_bad_configs_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        MonkaaConfig(**change)  # type: ignore[arg-type]
