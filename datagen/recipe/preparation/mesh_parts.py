"""Mesh files as triangles with materials: what trimesh reads, in the arrays that the preparation of a mesh takes."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.resolvers import Resolver

from datagen.formats.limits import read_bounded
from datagen.recipe.preparation.mesh_materials import (
    FileMaterial,
    GltfMaterials,
    data_of,
    read_obj_materials,
    transformed,
)
from datagen.recipe.preparation.side_files import SideFiles, read_gltf
from stereoforge_kit.errors import InputError
from stereoforge_kit.messages import shortened
from stereoforge_kit.srgb import to_srgb

GLTF = (".gltf", ".glb")
_COMPRESSED = {
    "KHR_draco_mesh_compression": "Draco",
    "EXT_meshopt_compression": "meshopt",
}


@dataclass(frozen=True)
class MeshSurface:
    """The triangles of a mesh file, and what they are made of."""

    vertices: NDArray[np.float64]
    """(V, 3) as in the file."""
    triangles: NDArray[np.int64]
    """(T, 3)."""
    corner_uv: NDArray[np.float64]
    """(T, 3, 2) texture coordinates with (0, 0) at the lower left; NaN where the file has none."""
    corner_colors: NDArray[np.uint8]
    """(T, 3, 3) sRGB vertex colours; white where the file has none."""
    slots: NDArray[np.int64]
    """(T,) index into `materials`."""
    materials: tuple[FileMaterial, ...]
    """Empty if the file has neither materials nor vertex colours."""

    def chosen(self, kept: NDArray[Any]) -> MeshSurface:
        """Some of the triangles, by a mask or indices."""
        return MeshSurface(
            self.vertices,
            self.triangles[kept],
            self.corner_uv[kept],
            self.corner_colors[kept],
            self.slots[kept],
            self.materials,
        )


class _InMemory(Resolver):
    """Gives trimesh what has been read already, so that it never opens a file itself."""

    def __init__(self, content: Mapping[str, bytes]) -> None:
        self._content = content

    def get(self, key: str) -> bytes:
        """The content under a name, or under any name if there is one content only."""
        return self._content[key if key in self._content else ""]

    def keys(self) -> Any:
        """The names."""
        return self._content.keys()

    def namespaced(self, namespace: str) -> Resolver:  # noqa: ARG002
        """There are no folders here."""
        return self

    def write(self, name: str, data: Any) -> None:
        """Nothing is written."""


def read_surface(files: SideFiles, remarks: list[str]) -> MeshSurface:
    """The surface of a mesh file. What its materials lack goes into `remarks`.

    Raises InputError for a file that cannot be used, and whatever the parser raises.
    """
    suffix = files.mesh.suffix.lower()
    if suffix in GLTF:
        return _read_gltf(files, remarks)
    if suffix == ".obj":
        materials = read_obj_materials(files, remarks)
        names = "".join(f"newmtl {name}\n" for name in materials).encode()
        return _joined(_load(files, _InMemory({"": names})), materials.get)
    return _joined(_load(files, _InMemory({})), lambda _: None)


def _load(files: SideFiles, resolver: Resolver) -> trimesh.Scene:
    with files.mesh.open("rb") as file:
        suffix = files.mesh.suffix[1:].lower()
        return trimesh.load_scene(file, file_type=suffix, process=False, resolver=resolver)


def _read_gltf(files: SideFiles, remarks: list[str]) -> MeshSurface:
    header, binary = read_gltf(files.mesh)
    needed = [*header.get("extensionsRequired", ()), *header.get("extensionsUsed", ())]
    for extension, name in _COMPRESSED.items():
        if extension in needed:
            raise InputError(f"it is compressed with {name}, which is not read here; export it without")
    buffers = [_buffer(entry, binary, files) for entry in header.get("buffers", ())]
    materials = GltfMaterials(header, buffers, files, remarks).read()
    # trimesh gets materials that are mere numbers, no pictures to decode, and buffers that have been read.
    plain = {
        key: value for key, value in header.items() if key not in ("images", "textures", "extensionsRequired")
    }
    plain["materials"] = [{"name": str(number)} for number in range(len(materials))]
    plain["buffers"] = [
        {"uri": f"buffer {number}", "byteLength": len(content)} for number, content in enumerate(buffers)
    ]
    content = {f"buffer {number}": buffer for number, buffer in enumerate(buffers)}
    text = io.BytesIO(json.dumps(plain).encode())
    scene = trimesh.load_scene(text, file_type="gltf", process=False, resolver=_InMemory(content))
    return _joined(scene, lambda name: materials[int(name)], linear_colors=True)


def _buffer(entry: dict[str, Any], binary: bytes | None, files: SideFiles) -> bytes:
    uri = entry.get("uri")
    if uri is None:
        if binary is None:
            raise InputError("it has no binary chunk, though its header names one")
        return binary
    if uri.startswith("data:"):
        return data_of(uri)
    place = files.find_uri(uri)
    if place is None:
        raise InputError(f"its buffer {shortened(uri, 60)} is not beside it")
    return read_bounded(place)


def _joined(
    scene: trimesh.Scene, material_of: Callable[[str], FileMaterial | None], linear_colors: bool = False
) -> MeshSurface:
    """All meshes of a scene, in their places, as one surface."""
    meshes = [mesh for mesh in scene.dump() if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces)]
    if not meshes:
        raise InputError("it has no triangles")
    slot_of: dict[FileMaterial | None, int] = {}
    surfaces = [_surface(mesh, material_of, linear_colors, slot_of) for mesh in meshes]
    first = np.cumsum([0, *(len(surface.vertices) for surface in surfaces)])
    bare = not any(material is not None for material in slot_of) and all(
        (surface.corner_colors == 255).all() for surface in surfaces
    )
    return MeshSurface(
        np.concatenate([surface.vertices for surface in surfaces]),
        np.concatenate([s.triangles + start for s, start in zip(surfaces, first, strict=False)]),
        np.concatenate([surface.corner_uv for surface in surfaces]),
        np.concatenate([surface.corner_colors for surface in surfaces]),
        np.concatenate([surface.slots for surface in surfaces]),
        () if bare else tuple(FileMaterial() if material is None else material for material in slot_of),
    )


def _surface(
    mesh: trimesh.Trimesh,
    material_of: Callable[[str], FileMaterial | None],
    linear_colors: bool,
    slot_of: dict[FileMaterial | None, int],
) -> MeshSurface:
    triangles = np.asarray(mesh.faces, np.int64)
    if triangles.min() < 0 or triangles.max() >= len(mesh.vertices):
        raise InputError("its triangles name vertices that are not there")
    visual = mesh.visual
    material, uv, colors = None, None, None
    if visual.kind == "texture":
        material = material_of(str(visual.material.name))
        uv, colors = visual.uv, visual.vertex_attributes.get("color")
    elif visual.kind in ("vertex", "face"):
        colors = visual.vertex_colors if visual.kind == "vertex" else None
    corner_uv = np.full((len(triangles), 3, 2), np.nan)
    if uv is not None and np.shape(uv) == (len(mesh.vertices), 2):
        corner_uv = np.asarray(uv, np.float64)[triangles]
        if material is not None and material.uv_matrix is not None:
            corner_uv = transformed(corner_uv, material.uv_matrix)
    corner_colors = np.full((len(triangles), 3, 3), 255, np.uint8)
    if visual.kind == "face":
        corner_colors = np.repeat(np.asarray(visual.face_colors)[:, None, :3], 3, axis=1).astype(np.uint8)
    elif colors is not None and len(colors) == len(mesh.vertices):
        corner_colors = _bytes(np.asarray(colors), linear_colors)[triangles]
    if material is None and not (corner_colors == 255).all():
        material = FileMaterial((1.0, 1.0, 1.0))
    slot = slot_of.setdefault(material, len(slot_of))
    return MeshSurface(
        np.asarray(mesh.vertices, np.float64),
        triangles,
        corner_uv,
        corner_colors,
        np.full(len(triangles), slot, np.int64),
        (),
    )


def _bytes(colors: NDArray[Any], linear: bool) -> NDArray[np.uint8]:
    """(V, 3) 8-bit sRGB of colours (V, 3 or 4) as bytes, 16-bit numbers or 0..1."""
    most = float(np.iinfo(colors.dtype).max) if colors.dtype.kind == "u" else 1.0
    level = np.nan_to_num(np.clip(colors[:, :3].astype(np.float64) / most, 0, 1))
    return np.rint(255 * (to_srgb(level) if linear else level)).astype(np.uint8)
