"""Preparing a mesh of the user's: clean triangles in the unit cube, and the materials that its file has."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from datagen.recipe.preparation.mesh_materials import distinct
from datagen.recipe.preparation.mesh_parts import GLTF, MeshSurface, read_surface
from datagen.recipe.preparation.mesh_surfaces import surface_arrays
from datagen.recipe.preparation.side_files import SideFiles
from scenes.geometry.building import fit_to_cube, traced_solid
from stereoforge_kit.errors import InputError

MESH_SUFFIXES = (".obj", ".ply", ".glb", ".gltf", ".stl")
Y_UP = GLTF
"""glTF says that y points up; the other formats say nothing, and z does here."""
UpAxis = Literal["auto", "y", "z"]
MAX_TRIANGLES = 300_000
"""Meshes of more are decimated (Garland and Heckbert, "Surface simplification using quadric error metrics", 1997)."""
REMARK = "remark"
"""What a preparer returns beside the arrays where it changed something that the user should know."""


def prepare_mesh(
    path: Path, up_axis: UpAxis = "auto", root: Path | None = None
) -> dict[str, NDArray[np.generic]]:
    """A mesh's `vertices` (V, 3), z upwards, `triangles` (T, 3) and `corner_uv` (3 T, 2) of box mapping.

    With `half_size`, half its longest side in the file's unit, and with its materials, where it has any
    (`datagen.recipe.preparation.mesh_surfaces`). With a remark if it is decimated to `MAX_TRIANGLES`, or if its
    materials lack something.

    root: The folder that the user gave, in which the files may be that the mesh names; None for its own.

    Raises ValueError for a mesh of no use, and whatever the parser raises.
    """
    remarks: list[str] = []
    surface = _sound(read_surface(SideFiles(path, root or path.parent), remarks))
    if is_y_up(path, up_axis):
        x, y, z = surface.vertices.T
        surface = replace(surface, vertices=np.stack([x, -z, y], axis=1))
    surface = _decimated(surface, remarks)
    mesh, corners = traced_solid(surface.vertices, surface.triangles, smooth=True)
    if len(mesh.triangles) < 4:
        raise InputError("its triangles have no area")
    prepared: dict[str, NDArray[np.generic]] = {
        "vertices": mesh.vertices,
        "triangles": mesh.triangles,
        "corner_uv": mesh.corner_uv,
        "half_size": np.array(1 / fit_to_cube(surface.vertices)[1]),
    }
    prepared |= surface_arrays(_by_corners(surface, corners), remarks)
    return prepared | ({REMARK: np.array(distinct(remarks))} if remarks else {})


def is_y_up(path: Path, up_axis: UpAxis) -> bool:
    """Whether y points up in a file, by what the user says or by its format."""
    return up_axis == "y" or (up_axis == "auto" and path.suffix.lower() in Y_UP)


def _sound(surface: MeshSurface) -> MeshSurface:
    """The triangles with finite corners, and the vertices in use. Raises InputError if they are no surface."""
    if len(surface.triangles) < 4:
        raise InputError(f"it has {len(surface.triangles)} triangles, too few for a thing")
    finite = np.isfinite(surface.vertices).all(axis=1)[surface.triangles].all(axis=1)
    surface = surface.chosen(finite)
    used, triangles = np.unique(surface.triangles, return_inverse=True)
    vertices, triangles = surface.vertices[used], triangles.reshape(-1, 3)
    if not len(triangles) or np.sort(np.ptp(vertices, axis=0))[1] == 0:
        raise InputError("it has no surface")
    return replace(surface, vertices=vertices, triangles=triangles)


def _decimated(surface: MeshSurface, remarks: list[str]) -> MeshSurface:
    """The surface with at most `MAX_TRIANGLES`; each gets the material of the triangle that was nearest to it.

    That triangle's texture coordinates are continued over the new one, as far as it reaches.
    """
    if (count := len(surface.triangles)) <= MAX_TRIANGLES:
        return surface
    fewer = trimesh.Trimesh(surface.vertices, surface.triangles).simplify_quadric_decimation(
        face_count=MAX_TRIANGLES
    )
    vertices, triangles = np.asarray(fewer.vertices, np.float64), np.asarray(fewer.faces, np.int64)
    remarks.append(f"its {count:,} triangles are decimated to {len(triangles):,}")
    if not surface.materials:
        return MeshSurface(vertices, triangles, *_nothing(len(triangles)), ())
    old, new = surface.vertices[surface.triangles], vertices[triangles]
    _, nearest = cKDTree(old.mean(axis=1)).query(new.mean(axis=1))
    _, corners = cKDTree(surface.vertices).query(vertices)
    color_of = np.zeros((len(surface.vertices), 3), np.uint8)
    color_of[surface.triangles] = surface.corner_colors
    return MeshSurface(
        vertices,
        triangles,
        _continued(old[nearest], surface.corner_uv[nearest], new),
        color_of[corners][triangles],
        surface.slots[nearest],
        surface.materials,
    )


def _nothing(count: int) -> tuple[NDArray[np.float64], NDArray[np.uint8], NDArray[np.int64]]:
    """Texture coordinates, colours and slots of triangles that have none."""
    return np.full((count, 3, 2), np.nan), np.full((count, 3, 3), 255, np.uint8), np.zeros(count, np.int64)


def _continued(
    old: NDArray[np.float64], uv: NDArray[np.float64], new: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Texture coordinates (T, 3, 2) of corners `new` (T, 3, 3) in the planes of triangles `old` that have `uv`."""
    a, b = old[:, 1] - old[:, 0], old[:, 2] - old[:, 0]
    aa, ab, bb = (np.einsum("ij,ij->i", p, q)[:, None] for p, q in ((a, a), (a, b), (b, b)))
    offset = new - old[:, :1]
    along = np.einsum("ikj,ij->ik", offset, a), np.einsum("ikj,ij->ik", offset, b)
    scale = np.maximum(aa * bb - ab * ab, 1e-30)
    first, second = (along[0] * bb - along[1] * ab) / scale, (along[1] * aa - along[0] * ab) / scale
    # Thin triangles say little about what is far beside them.
    first, second = np.clip(first, -2, 3)[..., None], np.clip(second, -2, 3)[..., None]
    return uv[:, :1] + first * (uv[:, 1:2] - uv[:, :1]) + second * (uv[:, 2:] - uv[:, :1])


def _by_corners(surface: MeshSurface, corners: NDArray[np.intp]) -> MeshSurface:
    """The surface with the triangles whose corners are the given ones, (T, 3) (`traced_solid`)."""
    return replace(
        surface,
        corner_uv=surface.corner_uv.reshape(-1, 2)[corners],
        corner_colors=surface.corner_colors.reshape(-1, 3)[corners],
        slots=surface.slots[corners[:, 0] // 3],
    )
