"""Material records to shader nodes: one picture and one of two BSDFs."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from scenes.spec import Material


def image_from_array(name: str, pixels: NDArray[np.uint8]) -> bpy.types.Image:
    """A Blender image with the given sRGB pixels, (H, W, 3) uint8, row 0 at the top."""
    height, width, _ = pixels.shape
    image = bpy.data.images.new(name, width, height, alpha=False)
    rgba = np.ones((height, width, 4), np.float32)
    rgba[:, :, :3] = pixels[::-1].astype(np.float32) / 255.0
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    return image


def build_material(name: str, material: Material) -> bpy.types.Material:
    """Make a Blender material: a bare diffuse BSDF where that is all there is, as it renders fastest."""
    block = bpy.data.materials.new(name)
    block.use_nodes = True
    nodes, links = block.node_tree.nodes, block.node_tree.links
    nodes.clear()
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = image_from_array(name, material.color.image())
    surface = _surface_node(nodes, material)
    links.new(texture.outputs["Color"], surface.inputs[0])
    if material.emission > 0 and surface.type == "BSDF_PRINCIPLED":
        links.new(texture.outputs["Color"], surface.inputs["Emission Color"])
    output = nodes.new("ShaderNodeOutputMaterial")
    links.new(surface.outputs[0], output.inputs["Surface"])
    return block


def _surface_node(nodes: bpy.types.Nodes, material: Material) -> bpy.types.ShaderNode:
    shiny = material.specular > 0 or material.metallic > 0 or material.transmission > 0
    if not shiny and material.emission == 0:
        return nodes.new("ShaderNodeBsdfDiffuse")
    surface = nodes.new("ShaderNodeBsdfPrincipled")
    surface.inputs["Roughness"].default_value = material.roughness
    surface.inputs["Specular IOR Level"].default_value = material.specular
    surface.inputs["Metallic"].default_value = material.metallic
    surface.inputs["Transmission Weight"].default_value = material.transmission
    surface.inputs["Emission Strength"].default_value = material.emission
    return surface
