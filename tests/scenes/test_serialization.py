"""Scenes and configs as JSON: nothing lost, nothing executed, mistakes named."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from scenes import FAMILIES, FamilyConfig, sample_scene, scene_from_json, scene_to_json
from scenes.families.flying_things import FlyingThingsConfig
from scenes.motion.deformations.sway import Sway
from scenes.serialization import from_plain, to_plain
from scenes.spec import FinalPass, Fog, Scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return sample_scene(np.random.default_rng(5), "flying_things", FlyingThingsConfig(frames=12))


@pytest.mark.parametrize("family", sorted(FAMILIES))
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_scene_of_every_family_survives_json(family: str, seed: int) -> None:
    scene = sample_scene(np.random.default_rng(seed), family)
    text = scene_to_json(scene)
    assert scene_from_json(text) == scene
    assert scene_to_json(scene_from_json(text)) == text


def test_json_is_plain_and_tags_kinds(scene: Scene) -> None:
    data = json.loads(scene_to_json(scene))
    assert data["world"]["environment"]["kind"] == "Sky"
    assert data["objects"][0]["shape"]["kind"] == "Terrain"
    assert {light["kind"] for light in data["lights"]} <= {"SunLight", "AreaLight"}


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_configs_survive_plain_data(family: str) -> None:
    config = dataclasses.replace(FAMILIES[family].config(), width=640, frames=3)
    assert from_plain(to_plain(config), FAMILIES[family].config) == config


def test_mistakes_are_named(scene: Scene) -> None:
    with pytest.raises(ValueError, match="not JSON"):
        scene_from_json("{")
    data = json.loads(scene_to_json(scene))
    data["objects"][0]["shape"]["kind"] = "os.system"
    with pytest.raises(ValueError, match=r"a Shape needs 'kind'.*os\.system"):
        scene_from_json(json.dumps(data))
    data = json.loads(scene_to_json(scene))
    data["camera"]["focal_inches"] = 1.4
    with pytest.raises(ValueError, match="focal_inches"):
        scene_from_json(json.dumps(data))
    data = json.loads(scene_to_json(scene))
    data["objects"][0]["material"] = 10_000
    with pytest.raises(ValueError, match="material 10000"):
        scene_from_json(json.dumps(data))


def test_unknown_families_and_foreign_configs_are_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match=r"no scene family 'flying_cars'; there are .*flying_things"):
        sample_scene(rng, "flying_cars")
    with pytest.raises(ValueError, match="takes a FlyingThingsConfig"):
        sample_scene(rng, "flying_things", FamilyConfig())


def test_deformations_and_the_final_pass_survive(scene: Scene) -> None:
    bent = dataclasses.replace(scene.objects[0], deformation=Sway(0.2, 30.0, 12.0))
    final = FinalPass(fog=Fog((0.5, 0.6, 0.7), 40.0), f_number=2.8)
    changed = dataclasses.replace(scene, objects=(bent, *scene.objects[1:]), final=final)
    assert scene_from_json(scene_to_json(changed)) == changed
