"""Time of day, weather, surfaces and close things of streets, by the config fields that rule them."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from scenes import sample_scene
from scenes.families.driving import DrivingConfig
from scenes.shapes.street.boundaries import Fence
from scenes.shapes.street.buildings import HouseWalls
from scenes.shapes.street.cars import CarBody, CarGlass
from scenes.shapes.street.pedestrians import PersonFeatures, PersonHair, PersonSkin, PersonThings
from scenes.shapes.street.puddles import Puddles
from scenes.shapes.street.road import RoadStrip, crown_height
from scenes.shapes.street.shops import ROOM_M, ShopGoods, ShopPanes
from scenes.shapes.street.vans import CargoBox, VanBody
from scenes.shapes.street.vehicle_details import CarInterior
from scenes.spec import AreaLight, Scene, SceneObject
from scenes.streets.daylight import HOURS
from tests.scenes.families.test_driving import corners, street

DAY = DrivingConfig(
    width=96,
    height=54,
    view_m=(60.0, 70.0),
    headway_m=(25.0, 40.0),
    parked_share=(0.1, 0.2),
    pedestrians_per_100m=(0.0, 2.0),
    furniture_per_100m=(2.0, 4.0),
    tree_spacing_m=(18.0, 20.0),
    junction_share=0.0,
    night_share=0.0,
    dusk_share=0.0,
    overcast_share=0.0,
    low_sun_share=0.0,
    rain_share=0.0,
    wet_share=0.0,
)


@lru_cache(maxsize=40)
def sampled(seed: int, **changes: object) -> Scene:
    return sample_scene(np.random.default_rng([seed, 77]), "driving", replace(DAY, **changes))  # type: ignore[arg-type]


def hour(scene: Scene) -> str:
    return HOURS[int(scene.notes["hour"])]


@pytest.mark.parametrize(
    ("share", "name"),
    [
        ({"night_share": 1.0}, "night"),
        ({"dusk_share": 1.0}, "dusk"),
        ({"overcast_share": 1.0}, "overcast"),
        ({"low_sun_share": 1.0}, "low sun"),
        ({}, "day"),
    ],
)
def test_the_time_of_day_is_what_the_shares_ask_for(share: dict[str, float], name: str) -> None:
    scene = sampled(1, **share)
    assert hour(scene) == name
    lamps = [light for light in scene.lights if isinstance(light, AreaLight)]
    heights = [-light.direction[2] for light in scene.lights if not isinstance(light, AreaLight)]
    assert bool(lamps) == (name in ("night", "dusk"))
    if name == "low sun":
        assert np.degrees(np.arcsin(heights[0])) < 14.0
    if name == "day":
        assert np.degrees(np.arcsin(heights[0])) > 15.0


def test_by_night_street_lamps_shine_and_beams_drive_along() -> None:
    scene = sampled(2, night_share=1.0, frames=4)
    carried = [light for light in scene.lights if isinstance(light, AreaLight) and light.motion is not None]
    fixed = [light for light in scene.lights if isinstance(light, AreaLight) and light.motion is None]
    assert carried
    assert fixed
    own = carried[0].motion
    assert own is not None
    for time in (0.0, 3.0):
        camera, lamp = scene.camera.pose("left", time), own.pose(time)
        ahead = (lamp[:3, 3] - camera[:3, 3]) @ -camera[:3, 2]
        assert 0.3 < ahead < 3.5  # below the bonnet's front
        assert lamp[:2, 0] @ -camera[:2, 2] > 0.9  # and looking the same way
    emitting = [scene.materials[t.material].emission for t in scene.objects if "head lamps" in t.name]
    assert not emitting or min(emitting) > 1.0


def test_rain_is_in_the_final_pass_and_on_the_road_only() -> None:
    wet, dry = sampled(3, rain_share=1.0), sampled(3)
    assert wet.final.rain is not None
    assert wet.final.fog is not None
    assert wet.final.rain.streak_m[2] < 0
    assert hour(wet) == "overcast"
    assert dry.final.rain is None
    road_wet, road_dry = (scene.materials[scene.objects[0].material] for scene in (wet, dry))
    assert road_wet.is_reflective
    assert not road_dry.is_reflective
    assert wet.notes["wetness"] >= 0.5


def test_a_wet_street_without_rain() -> None:
    scene = sampled(4, wet_share=1.0)
    assert scene.final.rain is None
    assert scene.notes["wetness"] > 0
    assert scene.materials[scene.objects[0].material].specular > 0


def test_puddles_lie_on_the_road_and_rise_above_it_by_less_than_a_kerb() -> None:
    checked = 0
    for seed in range(4):
        scene = sampled(seed, rain_share=1.0)
        course, road = street(scene)
        for thing in scene.objects:
            if not isinstance(thing.shape, Puddles):
                continue
            points = corners(thing, 0.0)
            top = points[
                points[:, 2] > -0.015 + crown_height(thing.shape.road, course.locate(points[:, :2])[:, 1])
            ]
            place = course.locate(top[:, :2])
            above = top[:, 2] - crown_height(thing.shape.road, place[:, 1])
            assert place[:, 1].max() < road.left_m
            assert place[:, 1].min() > road.right_m
            assert 0.005 < above.max() < 0.012
            checked += 1
    assert checked >= 2


def materials_of(scene: Scene, kind: type | tuple[type, ...]) -> list[int]:
    return sorted({thing.material for thing in scene.objects if isinstance(thing.shape, kind)})


def test_shares_of_glass_gloss_and_metal() -> None:
    clear, dark = sampled(5, transparent_share=1.0), sampled(5, transparent_share=0.0)
    assert all(clear.materials[k].thin for k in materials_of(clear, CarGlass))
    assert not any(dark.materials[k].thin for k in materials_of(dark, (CarGlass, ShopPanes)))
    assert materials_of(clear, CarInterior)
    assert not materials_of(dark, CarInterior)
    coated, dull = sampled(5, glossy_share=1.0), sampled(5, glossy_share=0.0)
    assert all(coated.materials[k].coat > 0 for k in materials_of(coated, (CarBody, VanBody)))
    assert not any(dull.materials[k].coat > 0 for k in materials_of(dull, (CarBody, VanBody)))
    painted, bare = sampled(5, metallic_share=0.0), sampled(5, metallic_share=1.0)
    assert not any(material.metallic > 0 for material in painted.materials)
    assert any(material.metallic == 1.0 for material in bare.materials)
    patterned = sampled(6, plain_share=0.0, large_vehicle_share=(1.0, 1.0))
    names = {type(patterned.materials[k].color).__name__ for k in materials_of(patterned, CargoBox)}
    assert names <= {"GlyphRows"}


def test_shops_show_goods_between_their_panes_and_their_back_wall() -> None:
    seen = 0
    for seed in range(5):
        scene = sampled(seed, transparent_share=1.0)
        walls = {
            thing.name.rsplit(" ", 1)[0]: thing
            for thing in scene.objects
            if isinstance(thing.shape, HouseWalls)
        }
        for thing in scene.objects:
            if not isinstance(thing.shape, ShopGoods):
                continue
            house = walls[" ".join(thing.name.split()[:2])]
            goods, panes = thing.shape.surface().vertices, ShopPanes(thing.shape.design).surface().vertices
            assert goods[:, 1].min() > panes[:, 1].max() + 0.05
            assert goods[:, 1].max() < ROOM_M + 0.02
            assert goods[:, 0].min() > 0
            assert goods[:, 0].max() < thing.shape.design.width
            np.testing.assert_allclose(house.motion.pose(0.0)[:3, :3], thing.motion.pose(0.0)[:3, :3])
            seen += 1
    assert seen >= 2


def test_people_have_faces_before_their_hair() -> None:
    scene = sampled(7, pedestrians_per_100m=(20.0, 20.0))
    designs = {thing.shape.design for thing in scene.objects if isinstance(thing.shape, PersonSkin)}
    assert designs
    for design in designs:
        skin = PersonSkin(design).surface().vertices
        face, hair = PersonFeatures(design).surface().vertices, PersonHair(design).surface().vertices
        assert face[:, 0].max() > hair[:, 0].max()
        head = skin[skin[:, 2] > 0.85 * skin[:, 2].max()]
        assert head[:, 2].min() < face[:, 2].min()
        assert face[:, 2].max() < head[:, 2].max()
        shoes = PersonThings(design).surface().vertices
        assert abs(shoes[:, 2].min()) < 0.02


def test_close_walls_stand_between_the_kerb_and_the_houses() -> None:
    found: list[SceneObject] = []
    for seed in range(3):
        scene = sampled(seed, close_wall_share=1.0)
        _, road = street(scene)
        barriers = [thing for thing in scene.objects if thing.name.startswith("barrier")]
        for thing in barriers:
            assert isinstance(thing.shape, Fence)
            assert abs(thing.shape.t_m) > min(road.left_m, -road.right_m)
        found += barriers
    assert len(found) > 2
    none = sampled(1, close_wall_share=0.0)
    assert not any(thing.name.startswith("barrier") for thing in none.objects)


def test_no_vehicle_covers_more_of_the_view_than_allowed() -> None:
    for seed in range(3):
        scene = sampled(seed, headway_m=(7.0, 9.0), large_vehicle_share=(1.0, 1.0), largest_cover_share=0.15)
        to_left = np.linalg.inv(scene.camera.pose("left", 0.0))
        camera = scene.camera
        for thing in scene.objects:
            if not isinstance(thing.shape, CarBody | VanBody | CargoBox):
                continue
            x, y, z = to_left[:3, :3] @ corners(thing, 0.0).T + to_left[:3, 3:]
            if (z > -0.5).any():
                continue
            across = np.clip(camera.focal_px * x / -z, -48, 48)
            up = np.clip(camera.focal_px * y / -z, -27, 27)
            assert np.ptp(across) * np.ptp(up) <= 0.16 * 96 * 54, thing.name


def test_a_side_street_is_free_of_what_lines_the_street_and_has_houses_of_its_own() -> None:
    seen = 0
    for seed in range(4):
        scene = sampled(seed, junction_share=1.0, parked_share=(0.8, 0.9), lamp_spacing_m=(8.0, 9.0))
        roads = [
            thing
            for thing in scene.objects
            if thing.name.startswith("side ") and thing.name.endswith(" road")
        ]
        assert 1 <= len(roads) <= 2
        for road in roads:
            strip = road.shape
            assert isinstance(strip, RoadStrip)
            assert corners(road, 0.0)[:, 2].max() < 0.0  # just below the main road, where they overlap
            for thing in scene.objects:
                if not thing.name.startswith(("parked", "house", "lamp", "fence", "barrier", "tree", "bin")):
                    continue
                place = strip.course.locate(corners(thing, 0.0)[:, :2])
                # Behind the kerb line, arms and crowns may reach over the road, but nothing stands on it.
                low = corners(thing, 0.0)[:, 2] < 0.6
                on_road = (
                    (np.abs(place[:, 1]) < strip.left_m - 0.1) & (place[:, 0] > 0.3) & (place[:, 0] < 60.0)
                )
                assert not (on_road & low).any(), thing.name
        seen += sum("house" in thing.name and thing.name.split()[1][1] in "ab" for thing in scene.objects)
    assert seen > 0


def test_no_two_objects_share_a_name() -> None:
    scene = sampled(2, junction_share=1.0)
    names = [thing.name for thing in scene.objects]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"night_share": 0.7, "dusk_share": 0.4}, "must add up to at most 1"),
        ({"rain_share": -0.1}, r"rain_share must be in 0\.\.1"),
        ({"plain_share": 2.0}, r"plain_share must be in 0\.\.1"),
        ({"largest_cover_share": 0.0}, "largest_cover_share must be above 0"),
        ({"shutter_frames": (-0.1, 0.5)}, "shutter_frames must not be negative"),
        ({"shutter_frames": (0.6, 0.5)}, r"shutter_frames must be \(low, high\)"),
    ],
)
def test_what_no_street_can_have_is_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        DrivingConfig(**change)  # type: ignore[arg-type]
