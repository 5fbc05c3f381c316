"""From material records to shader nodes: an image texture and one of two BSDFs."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from scenes.spec import Material, Texture


def image_from_array(name: str, pixels: NDArray[np.uint8], is_data: bool = False) -> bpy.types.Image:
    """A Blender image of (H, W, 3) uint8, row 0 at the top: sRGB colours, or numbers if it `is_data`."""
    image = bpy.data.images.new(name, pixels.shape[1], pixels.shape[0], alpha=False, is_data=is_data)
    _set_pixels(image, pixels, 255.0)
    return image


def image_from_radiance(name: str, radiance: NDArray[np.float32]) -> bpy.types.Image:
    """A Blender image of linear RGB, (H, W, 3) float32 of any range, row 0 at the top."""
    image = bpy.data.images.new(
        name, radiance.shape[1], radiance.shape[0], alpha=False, float_buffer=True, is_data=True
    )
    _set_pixels(image, radiance, 1.0)
    return image


def _set_pixels(image: bpy.types.Image, values: NDArray[Any], white: float) -> None:
    height, width, _ = values.shape
    rgba = np.ones((height, width, 4), np.float32)
    np.divide(values[::-1], np.float32(white), out=rgba[:, :, :3], dtype=np.float32, casting="same_kind")
    image.pixels.foreach_set(rgba.ravel())
    image.update()


def build_material(name: str, material: Material) -> bpy.types.Material:
    """Make a Blender material. It is a diffuse BSDF where that is enough, which renders fastest."""
    block = bpy.data.materials.new(name)
    block.use_nodes = True
    nodes, links = block.node_tree.nodes, block.node_tree.links
    nodes.clear()
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = image_from_array(name, material.color.image())
    surface = _surface_node(nodes, material)
    links.new(texture.outputs["Color"], surface.inputs[0])
    if material.finish is not None and surface.type == "BSDF_PRINCIPLED":
        _link_finish(block.node_tree, material.finish, surface)
    if material.emission > 0 and surface.type == "BSDF_PRINCIPLED":
        links.new(texture.outputs["Color"], surface.inputs["Emission Color"])
    output = nodes.new("ShaderNodeOutputMaterial")
    shader = _sheet(block.node_tree, material, surface.outputs[0]) if material.thin else surface.outputs[0]
    links.new(shader, output.inputs["Surface"])
    # What Workbench shows of it: the active picture, under a roughness and a metallic share of its own.
    nodes.active = texture
    block.roughness, block.metallic = material.roughness, material.metallic
    return block


def _link_finish(tree: bpy.types.NodeTree, finish: Texture, surface: bpy.types.ShaderNode) -> None:
    """Let a picture of numbers say how rough and how metallic a surface is."""
    texture, split = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeSeparateColor")
    texture.image = image_from_array("finish", finish.image(), is_data=True)
    tree.links.new(texture.outputs["Color"], split.inputs[0])
    tree.links.new(split.outputs["Green"], surface.inputs["Roughness"])
    tree.links.new(split.outputs["Blue"], surface.inputs["Metallic"])


def _sheet(
    tree: bpy.types.NodeTree, material: Material, surface: bpy.types.NodeSocket
) -> bpy.types.NodeSocket:
    """The shader of a thin sheet: light passes straight on, but for what is reflected or not transmitted.

    Light from lamps passes too, which a refracting pane would stop where there are no caustics. Only the outer faces
    reflect: from within, as out of dense glass, a sheet would be a mirror at most angles.
    """
    clear, glossy = tree.nodes.new("ShaderNodeBsdfTransparent"), tree.nodes.new("ShaderNodeBsdfGlossy")
    glossy.inputs["Roughness"].default_value = material.roughness
    opaque, mirrored = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeMixShader")
    opaque.inputs[0].default_value = material.transmission
    tree.links.new(surface, opaque.inputs[1])
    tree.links.new(clear.outputs[0], opaque.inputs[2])
    inside, share = (
        tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"],
        tree.nodes.new("ShaderNodeMix"),
    )
    share.inputs["B"].default_value = 0.0
    tree.links.new(inside, share.inputs["Factor"])
    tree.links.new(tree.nodes.new("ShaderNodeFresnel").outputs[0], share.inputs["A"])
    tree.links.new(share.outputs["Result"], mirrored.inputs[0])
    tree.links.new(opaque.outputs[0], mirrored.inputs[1])
    tree.links.new(glossy.outputs[0], mirrored.inputs[2])
    return mirrored.outputs[0]


def _surface_node(nodes: bpy.types.Nodes, material: Material) -> bpy.types.ShaderNode:
    shiny = max(material.specular, material.metallic, material.transmission, material.coat) > 0
    shiny = shiny or material.finish is not None
    shiny = shiny and not material.thin
    if not shiny and material.emission == 0:
        return nodes.new("ShaderNodeBsdfDiffuse")
    surface = nodes.new("ShaderNodeBsdfPrincipled")
    surface.inputs["Roughness"].default_value = material.roughness
    surface.inputs["Specular IOR Level"].default_value = material.specular
    surface.inputs["Metallic"].default_value = material.metallic
    surface.inputs["Transmission Weight"].default_value = material.transmission
    surface.inputs["Emission Strength"].default_value = material.emission
    surface.inputs["Coat Weight"].default_value = material.coat
    return surface
