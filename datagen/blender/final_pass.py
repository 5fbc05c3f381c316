"""The final pass: Cycles with the shutter open, a real lens and fog in every shader.

Everything is set up for one picture and removed after it. So clean pictures and ground truth come from the same world,
whether a final pass is rendered or not.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from datagen.blender.build import BuiltWorld, place
from datagen.blender.camera import render_radiance
from datagen.blender.exact import set_exactly
from datagen.dataset.layout import VIEWS, View
from scenes.spec import FinalPass, Fog

SHUTTER_FRAME = 10
"""The frame of Blender's clock on which the shutter interval is centred, whichever instant it shows."""
HAZE_HEIGHT = 0.2
"""Height of the layer of haze before the sky, in visibilities: the zenith keeps exp(-0.2) of its light."""
_FINAL_SEED = 1 << 20
"""Added to Cycles' seed, so that the two passes do not share their noise."""


def render_final(
    world: BuiltWorld, frame: int, exposure: float, scratch: Path
) -> dict[View, NDArray[np.float32]]:
    """(H, W, 3) float32 scene-linear RGB of each view with motion blur, defocus and fog.

    Args:
        world: The world to render.
        frame: The frame's number from 0, in the middle of the shutter interval.
        exposure: The factor that the pictures will be exposed with. The fog's colour is that of the exposed picture.
        scratch: An existing folder for Blender's temporary file.
    """
    final = world.scene.final
    with ExitStack() as stack:
        if final.f_number > 0:
            stack.enter_context(_lens(world, final))
        if final.fog is not None:
            stack.enter_context(_foggy(world, final.fog, exposure))
        return {view: _render_view(world, view, frame, scratch) for view in VIEWS}


def _render_view(world: BuiltWorld, view: View, frame: int, scratch: Path) -> NDArray[np.float32]:
    place(world, view, float(frame))
    shutter_frames = world.scene.final.shutter_frames
    with _open_shutter(world, view, frame, shutter_frames) if shutter_frames > 0 else nullcontext():
        seed = _FINAL_SEED + 2 * frame + (view == "right")
        return render_radiance(world, f"final_{view}_{frame}", seed, scratch)


@contextmanager
def _lens(world: BuiltWorld, final: FinalPass) -> Iterator[None]:
    focus = world.camera.data.dof
    focus.use_dof = True
    set_exactly(focus, "focus_distance", final.focus_m)
    set_exactly(focus, "aperture_fstop", final.f_number)
    try:
        yield
    finally:
        focus.use_dof = False


@contextmanager
def _open_shutter(world: BuiltWorld, view: str, frame: int, shutter_frames: float) -> Iterator[None]:
    """Give everything that moves key frames at the shutter's opening, middle and closing.

    Cycles takes the motion at these three instants and interpolates linearly between them.
    """
    half = shutter_frames / 2
    keys = [(SHUTTER_FRAME + offset, frame + offset) for offset in (-half, 0.0, half)]
    render = world.blender_scene.render
    moving = [
        (block, [thing.pose(time) for _, time in keys])
        for thing, block in zip(world.scene.objects, world.objects, strict=True)
        if len(thing.motion.times_frames) > 1
    ]
    moving.append((world.camera, [world.scene.camera.pose(view, time) for _, time in keys]))
    deforming = [k for k, thing in enumerate(world.scene.objects) if thing.deformation is not None]
    try:
        for block, poses in moving:
            _key_poses(block, poses, [clock for clock, _ in keys])
        for index in deforming:
            shapes = [world.geometry.local_vertices(index, time) for _, time in keys]
            _key_shapes(world.objects[index], shapes, [clock for clock, _ in keys])
        render.use_motion_blur = True
        set_exactly(render, "motion_blur_shutter", shutter_frames)
        render.motion_blur_position = "CENTER"
        world.blender_scene.frame_set(SHUTTER_FRAME)
        yield
    finally:
        render.use_motion_blur = False
        for block, _ in moving:
            block.animation_data_clear()
        for index in deforming:
            world.objects[index].shape_key_clear()
            world.deformed_at.pop(index, None)
        place(world, view, float(frame))


def _key_poses(block: bpy.types.Object, poses: list[NDArray[np.float64]], clocks: list[float]) -> None:
    before = None
    for clock, pose in zip(clocks, poses, strict=True):
        position, turn, scale = Matrix(pose.tolist()).decompose()
        if before is not None:
            turn.make_compatible(before)  # Of a quaternion's two signs, the nearer one.
        block.location, block.rotation_quaternion, block.scale = position, turn, scale
        before = turn
        for path in ("location", "rotation_quaternion", "scale"):
            block.keyframe_insert(path, frame=clock)


def _key_shapes(block: bpy.types.Object, shapes: list[NDArray[np.float64]], clocks: list[float]) -> None:
    """Shape keys: the middle shape is the basis, and the other two are blended in and out."""
    opening, middle, closing = shapes
    block.shape_key_add(name="middle").data.foreach_set("co", middle.astype(np.float32).ravel())
    for shape, clock in ((opening, clocks[0]), (closing, clocks[2])):
        key = block.shape_key_add(name=f"at {clock}")
        key.data.foreach_set("co", shape.astype(np.float32).ravel())
        for when in clocks:
            key.value = float(when == clock)
            key.keyframe_insert("value", frame=when)


@contextmanager
def _foggy(world: BuiltWorld, fog: Fog, exposure: float) -> Iterator[None]:
    """Mix every surface with the fog's colour by its distance, in the shaders themselves and for camera rays only.

    So each path through lens and shutter gets the fog of its own length, no compositing is needed, and light is not
    dimmed on its way to the surfaces.
    """
    trees = [(block.node_tree, False) for block in bpy.data.materials if block.use_nodes]
    trees.append((world.blender_scene.world.node_tree, True))
    added = [_add_fog(tree, fog, exposure, sky) for tree, sky in trees]
    try:
        yield
    finally:
        for (tree, _), (nodes, surface, output) in zip(trees, added, strict=True):
            tree.links.new(surface, output)
            for node in nodes:
                tree.nodes.remove(node)


_FogNodes = tuple[list[bpy.types.Node], bpy.types.NodeSocket, bpy.types.NodeSocket]


def _add_fog(tree: bpy.types.NodeTree, fog: Fog, exposure: float, sky: bool) -> _FogNodes:
    """Insert fog behind a shader; return the nodes added and the link that they replace."""
    (output,) = (
        node.inputs["Surface"] for node in tree.nodes if node.type in ("OUTPUT_MATERIAL", "OUTPUT_WORLD")
    )
    surface = output.links[0].from_socket
    before = set(tree.nodes)
    clear = _through_haze(tree) if sky else _through_distance(tree, fog.visibility_m)
    path = tree.nodes.new("ShaderNodeLightPath")
    share = _math(tree, "MULTIPLY", _math(tree, "SUBTRACT", 1.0, clear), path.outputs["Is Camera Ray"])
    glow = tree.nodes.new("ShaderNodeBackground" if sky else "ShaderNodeEmission")
    glow.inputs["Color"].default_value = (*fog.color, 1.0)
    glow.inputs["Strength"].default_value = 1.0 / exposure
    mix = tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(share, mix.inputs[0])
    tree.links.new(surface, mix.inputs[1])
    tree.links.new(glow.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output)
    return [node for node in tree.nodes if node not in before], surface, output


def _through_distance(tree: bpy.types.NodeTree, visibility_m: float) -> bpy.types.NodeSocket:
    """Share of a surface's light that reaches the camera: exp(-distance / visibility)."""
    distance = tree.nodes.new("ShaderNodeCameraData").outputs["View Distance"]
    return _math(tree, "EXPONENT", _math(tree, "MULTIPLY", distance, -1.0 / visibility_m))


def _through_haze(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket:
    """Share of the sky's light that gets through a layer of haze: exp(-height / sine of the elevation)."""
    towards = tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"]
    split = tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(towards, split.inputs[0])
    above = _math(tree, "MAXIMUM", split.outputs["Z"], 1e-4)
    return _math(tree, "EXPONENT", _math(tree, "DIVIDE", -HAZE_HEIGHT, above))


def _math(
    tree: bpy.types.NodeTree, operation: str, *operands: bpy.types.NodeSocket | float
) -> bpy.types.NodeSocket:
    node = tree.nodes.new("ShaderNodeMath")
    node.operation = operation
    for socket, operand in zip(node.inputs, operands, strict=False):
        if isinstance(operand, float):
            socket.default_value = operand
        else:
            tree.links.new(operand, socket)
    return node.outputs[0]
