"""The sintel family: what every scene promises, and what its camera sees."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from datagen.ground_truth.scene_geometry import build_geometry
from scenes import sample_scene
from scenes.families.sintel import SintelConfig
from scenes.landscapes.framing import FRAMINGS
from scenes.serialization import scene_from_json, scene_to_json
from scenes.spec import Scene
from tests.scenes.families.landscapes import (
    encloses,
    first_hits,
    ground_below,
    heights_of_feet,
    nearest_m,
    world_vertices,
)

SMALL = SintelConfig(
    width=96, height=54, people=(1, 2), trees=(4, 6), structures=(4, 6), boulders=(5, 8), plants=(4, 6)
)
FEW = dataclasses.replace(SMALL, frames=24)
seeds = st.integers(0, 2**32 - 1)
ON_SOMETHING = ("leaves", "roof", "cap", "statue", "cloth")
"""Parts of things whose other parts stand on the ground."""


def sampled(seed: int, config: SintelConfig = SMALL) -> Scene:
    return sample_scene(np.random.default_rng(seed), "sintel", config)


def test_the_same_seed_gives_the_same_scene_and_json_keeps_it() -> None:
    scene = sampled(11)
    assert sampled(11) == scene
    assert sampled(12) != scene
    assert scene_from_json(scene_to_json(scene)) == scene


@settings(max_examples=4, deadline=None)
@given(seed=seeds)
def test_neither_camera_is_ever_inside_or_near_anything(seed: int) -> None:
    scene = sampled(seed, FEW)
    geometry = build_geometry(scene)
    closest = scene.camera.disparity_metres / (SMALL.largest_disparity_share * scene.camera.width)
    for time in (0.0, 23.0):
        for view in ("left", "right"):
            position = scene.camera.pose(view, time)[:3, 3]
            # The ground below the image may be nearer than what is in it.
            assert nearest_m(geometry, time, view) > 0.3 * closest
            assert abs(encloses(geometry, 0, position, time)) < 0.02


@settings(max_examples=4, deadline=None)
@given(seed=seeds)
def test_what_stands_stands_on_the_ground_throughout(seed: int) -> None:
    scene = sampled(seed, FEW)
    geometry = build_geometry(scene)
    standing = [
        index
        for index, thing in enumerate(scene.objects)
        if thing.name not in ("ground", "water")
        and not thing.name.endswith(ON_SOMETHING)
        and thing.name.split()[0] not in ("person", "beast")
    ]
    assert len(standing) > 8
    for time in (0.0, 17.0):
        # A foot in the air would be more than a few hundredths of the thing's size above the ground.
        above = heights_of_feet(geometry, standing, time)
        assert above.max() < 0.06, [scene.objects[k].name for k in np.array(standing)[above >= 0.06]]


def test_masonry_stands_on_the_lowest_ground_under_it() -> None:
    """No corner of a wall or a house hangs over a slope."""
    checked = 0
    for seed in range(8):
        scene = sampled(seed)
        geometry = build_geometry(scene)
        for index, thing in enumerate(scene.objects):
            if not (thing.name.startswith("house") and thing.name.endswith("walls")):
                continue
            vertices = world_vertices(geometry, index, 0.0)
            foot = vertices[vertices[:, 2] < vertices[:, 2].min() + 1e-6]
            assert (foot[:, 2] <= ground_below(geometry, foot) + 0.02).all()
            checked += 1
    assert checked > 3


def test_the_final_pass_is_focused_on_the_first_person_and_its_fog_fits_the_scene() -> None:
    foggy = 0
    peopled = dataclasses.replace(SMALL, empty_share=0.0)
    for seed in range(12):
        scene = sampled(seed, peopled)
        body = next(thing for thing in scene.objects if thing.name.startswith("person 0 cloth"))
        camera = scene.camera.pose("left", 0.0)
        depth = float((body.pose(0.0)[:3, 3] - camera[:3, 3]) @ -camera[:3, 2])
        assert scene.final.focus_m == pytest.approx(depth, rel=0.12)
        assert 0 < scene.final.shutter_frames < 1
        assert scene.final.f_number > 1
        if scene.final.fog is not None:
            foggy += 1
            assert 2 * scene.final.focus_m < scene.final.fog.visibility_m < 50 * scene.final.focus_m
    assert 2 < foggy < 12


@pytest.mark.slow
def test_what_the_camera_sees_over_many_scenes() -> None:
    disparities, places, seen_people, sky = [], set(), 0, []
    for seed in range(16):
        scene = sampled(seed)
        seen = first_hits(scene, build_geometry(scene))
        near = seen.disparity_960[seen.disparity_960 > 0]
        assert near.max() < 1.15 * SMALL.largest_disparity_share * 960
        share = np.bincount(seen.index[seen.index >= 0], minlength=len(scene.objects)) / seen.index.size
        assert share[1:].max() < 0.65
        assert share[0] < 0.95
        first = [k for k, thing in enumerate(scene.objects) if thing.name.startswith("person 0")]
        seen_people += scene.notes["framing"] == FRAMINGS.index("none") or share[first].sum() > 0.002
        places.add(scene.notes["place"])
        sky.append(np.mean(seen.index < 0))
        disparities.append(near)
    assert seen_people >= 15
    assert len(places) >= 4
    assert 0.03 < np.mean(sky) < 0.5
    low, middle, high = np.percentile(np.concatenate(disparities), (2, 50, 98))
    assert 0.1 < low < 6
    assert 10 < middle < 50
    assert 50 < high < 182


def test_bad_configs_are_refused() -> None:
    with pytest.raises(ValueError, match=r"people must be \(low, high\)"):
        SintelConfig(people=(4, 1))
    with pytest.raises(ValueError, match="beast_share must be in"):
        SintelConfig(beast_share=-0.1)
