"""Building a Scene record as objects of the open Blender file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import bpy
import numpy as np
from mathutils import Matrix, Vector
from numpy.typing import NDArray

from datagen.blender.exact import clip_planes, set_exactly
from datagen.blender.materials import build_material, image_from_array, image_from_radiance
from datagen.ground_truth.scene_geometry import SceneGeometry
from scenes.geometry.mesh import Mesh
from scenes.spec import AreaLight, Light, Scene, StereoCamera, SunLight, World
from scenes.user_assets.pool import UserEnvironment


@dataclass(frozen=True)
class BuiltWorld:
    """A Scene that is built in the open Blender file."""

    scene: Scene
    geometry: SceneGeometry
    blender_scene: bpy.types.Scene
    camera: bpy.types.Object
    """One camera, moved from view to view."""
    objects: tuple[bpy.types.Object, ...]
    """In the order of `Scene.objects`."""
    lamps: tuple[bpy.types.Object, ...]
    """In the order of `Scene.lights`."""
    deformed_at: dict[int, float] = field(default_factory=dict)
    """The instant whose vertices an object's mesh has, by the object's index."""


def build_world(geometry: SceneGeometry, blender_scene: bpy.types.Scene) -> BuiltWorld:
    """Build everything in the geometry's scene into an empty Blender file.

    Raises DatasetError for a camera that Blender cannot have.
    """
    scene = geometry.scene
    # Families sample some materials that no object has: painting those would be for nothing.
    worn = sorted({material for thing in scene.objects for material in thing.materials})
    materials = {k: build_material(f"material_{k}", scene.materials[k]) for k in worn}
    objects = _build_objects(geometry, materials, blender_scene)
    lamps = tuple(_build_light(index, light, blender_scene) for index, light in enumerate(scene.lights))
    _build_environment(scene.world, blender_scene)
    camera = _build_camera(scene.camera, blender_scene)
    return BuiltWorld(scene, geometry, blender_scene, camera, objects, lamps)


def place(world: BuiltWorld, view: str, time_frames: float) -> None:
    """Place every object, deformed, and the camera of one view as they are at an instant.

    Raises DatasetError for a scene that Blender would clip.
    """
    for index, (thing, block) in enumerate(zip(world.scene.objects, world.objects, strict=True)):
        if len(thing.motion.times_frames) > 1:
            block.matrix_world = Matrix(thing.pose(time_frames).tolist())
        # The second view shows the same instant: moved again, the mesh would be handed to Cycles again.
        if thing.deformation is not None and world.deformed_at.get(index) != time_frames:
            world.deformed_at[index] = time_frames
            _move_vertices(block.data, world.geometry.local_vertices(index, time_frames))
    for light, block in zip(world.scene.lights, world.lamps, strict=True):
        if isinstance(light, AreaLight) and light.motion is not None:
            carrier = Matrix(light.motion.pose(time_frames).tolist())
            block.matrix_world = carrier @ _aimed(light.position_m, light.target_m)
    camera = world.scene.camera
    pose = camera.pose(view, time_frames)
    world.camera.matrix_world = Matrix(pose.tolist())
    # Blender moves the image instead of the principal point, up and to the right, in widths of square pixels.
    center_x, center_y = camera.principal_point(view)
    set_exactly(world.camera.data, "shift_x", 0.5 - center_x / camera.width)
    set_exactly(
        world.camera.data, "shift_y", (center_y - camera.height / 2) / camera.focal_ratio / camera.width
    )
    # Anything in front of the camera counts, however near or far.
    near, far = clip_planes(world.geometry, pose[:3, 3], time_frames)
    set_exactly(world.camera.data, "clip_start", near)
    set_exactly(world.camera.data, "clip_end", far)
    bpy.context.view_layer.update()


def _build_objects(
    geometry: SceneGeometry, materials: Mapping[int, bpy.types.Material], blender_scene: bpy.types.Scene
) -> tuple[bpy.types.Object, ...]:
    """One Blender object for each of the scene's. Rigid ones of the same shape and material share one mesh."""
    shared: dict[tuple[int, tuple[int, ...]], bpy.types.Mesh] = {}
    objects = []
    for index, thing in enumerate(geometry.scene.objects):
        data = geometry.meshes[index]
        key = (id(data), thing.materials)
        mesh = shared.get(key) if thing.deformation is None else None
        if mesh is None:
            repeats = [geometry.scene.materials[material].repeats for material in thing.materials]
            mesh = _build_mesh(thing.name, data, np.array(repeats, np.float32))
            for material in thing.materials:
                mesh.materials.append(materials[material])
            if thing.deformation is None:
                shared[key] = mesh
        block = bpy.data.objects.new(thing.name, mesh)
        block.rotation_mode = "QUATERNION"
        blender_scene.collection.objects.link(block)
        if len(thing.motion.times_frames) == 1:  # What moves is placed at each instant.
            block.matrix_world = Matrix(thing.pose(0.0).tolist())
        objects.append(block)
    return tuple(objects)


def _build_mesh(name: str, data: Mesh, repeats: NDArray[np.float32]) -> bpy.types.Mesh:
    """A Blender mesh; `repeats` (S,) are `Material.repeats` of each slot's material."""
    mesh = bpy.data.meshes.new(name)
    count = len(data.triangles)
    mesh.vertices.add(len(data.vertices))
    mesh.vertices.foreach_set("co", data.vertices.astype(np.float32).ravel())
    mesh.loops.add(3 * count)
    # The attribute behind `loops.vertex_index`, which takes an array whole instead of a number at a time.
    mesh.attributes[".corner_vert"].data.foreach_set("value", data.triangles.astype(np.int32).ravel())
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * count, 3, dtype=np.int32))
    mesh.polygons.foreach_set("use_smooth", np.full(count, data.smooth))
    layer = mesh.uv_layers.new(name="uv")
    scale = repeats[0] if data.slots is None else repeats[data.slots][:, None, None]
    layer.uv.foreach_set("vector", (data.corner_uv * scale).astype(np.float32).ravel())
    if data.slots is not None:
        mesh.polygons.foreach_set("material_index", data.slots.astype(np.int32))
    mesh.update(calc_edges=True)
    return mesh


def _move_vertices(mesh: bpy.types.Mesh, vertices: NDArray[np.float64]) -> None:
    mesh.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    mesh.update()  # Blender's normals and Cycles' persistent copy follow only when told.


def _build_light(index: int, light: Light, blender_scene: bpy.types.Scene) -> bpy.types.Object:
    if isinstance(light, SunLight):
        lamp = bpy.data.lights.new(f"sun_{index}", "SUN")
        lamp.energy = light.irradiance
        lamp.angle = np.deg2rad(light.angle_deg)
        pose = _aimed((0.0, 0.0, 0.0), light.direction)
    else:
        assert isinstance(light, AreaLight)
        lamp = bpy.data.lights.new(f"area_{index}", "AREA")
        lamp.energy = light.power_w
        lamp.size = light.size_m
        lamp.spread = np.deg2rad(light.spread_deg)
        pose = _aimed(light.position_m, light.target_m)
    lamp.color = light.color
    block = bpy.data.objects.new(lamp.name, lamp)
    block.matrix_world = pose
    # Cycles would show the lamp's own glowing square to a camera that happens to look at it.
    block.visible_camera = False
    blender_scene.collection.objects.link(block)
    return block


def _aimed(position_m: tuple[float, float, float], target_m: tuple[float, float, float]) -> Matrix:
    """The pose of a lamp that shines from a position towards a target."""
    turn = (Vector(target_m) - Vector(position_m)).to_track_quat("-Z", "Y")
    return Matrix.LocRotScale(Vector(position_m), turn, None)


def _build_environment(world: World, blender_scene: bpy.types.Scene) -> None:
    block = bpy.data.worlds.new("environment")
    block.use_nodes = True
    # Left to itself Cycles tabulates 4096 x 2048 directions, which takes three seconds a scene.
    block.cycles.sampling_method = "MANUAL" if world.sampled else "NONE"
    block.cycles.sample_map_resolution = 256
    nodes, links = block.node_tree.nodes, block.node_tree.links
    nodes.clear()
    texture = nodes.new("ShaderNodeTexEnvironment")
    environment = world.environment
    if isinstance(environment, UserEnvironment):
        texture.image = image_from_radiance("environment", environment.radiance())
    else:
        texture.image = image_from_array("environment", environment.image())
    background = nodes.new("ShaderNodeBackground")
    background.inputs["Strength"].default_value = world.strength
    output = nodes.new("ShaderNodeOutputWorld")
    links.new(texture.outputs["Color"], background.inputs["Color"])
    links.new(background.outputs["Background"], output.inputs["Surface"])
    blender_scene.world = block


def _build_camera(camera: StereoCamera, blender_scene: bpy.types.Scene) -> bpy.types.Object:
    lens = bpy.data.cameras.new("camera")
    lens.sensor_fit = "HORIZONTAL"
    set_exactly(lens, "sensor_width", camera.sensor_width_mm)
    set_exactly(lens, "lens", camera.focal_mm)
    block = bpy.data.objects.new("camera", lens)
    block.rotation_mode = "QUATERNION"
    blender_scene.collection.objects.link(block)
    blender_scene.camera = block
    # A pixel is as wide as fy is long, and as high as fx; Blender takes no number below 1.
    least = min(camera.focal_ratio, 1.0)
    set_exactly(blender_scene.render, "pixel_aspect_x", camera.focal_ratio / least)
    set_exactly(blender_scene.render, "pixel_aspect_y", 1.0 / least)
    set_exactly(blender_scene.render, "resolution_x", camera.width)
    set_exactly(blender_scene.render, "resolution_y", camera.height)
    return block
