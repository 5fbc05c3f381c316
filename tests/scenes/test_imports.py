"""`scenes` runs on machines that have neither Blender nor torch."""

from __future__ import annotations

import subprocess
import sys


def test_sampling_and_building_a_scene_imports_neither_bpy_nor_torch() -> None:
    program = """
import sys
import numpy as np
from scenes import sample_scene, scene_to_json
scene = sample_scene(np.random.default_rng(0), "flying_things")
scene_to_json(scene)
scene.objects[0].shape.mesh()
scene.materials[0].color.image()
loaded = {name.split(".")[0] for name in sys.modules}
print(sorted(loaded & {"bpy", "mathutils", "torch", "cv2", "datagen", "training", "refine"}))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
