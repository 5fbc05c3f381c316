from .family import Family, FamilyConfig
from .registry import FAMILIES, sample_scene
from .serialization import scene_from_json, scene_to_json
from .spec import Scene

__all__ = [
    "FAMILIES",
    "Family",
    "FamilyConfig",
    "Scene",
    "sample_scene",
    "scene_from_json",
    "scene_to_json",
]
