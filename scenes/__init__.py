"""Scenes as plain records, and the families that sample them. Needs neither Blender nor torch."""

from scenes.family import Family, FamilyConfig
from scenes.registry import FAMILIES, sample_scene
from scenes.serialization import scene_from_json, scene_to_json
from scenes.spec import Scene

__all__ = [
    "FAMILIES",
    "Family",
    "FamilyConfig",
    "Scene",
    "sample_scene",
    "scene_from_json",
    "scene_to_json",
]
