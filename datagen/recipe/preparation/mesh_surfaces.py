"""The materials of a mesh as arrays: pictures with their factors, baked vertex colours, and what is reflective.

What a scene needs of them is stored beside the mesh (`scenes.user_assets.pool.UserMesh`):

- `slots` (T,) the material of each triangle, `own_uv` (T, 3, 2) its texture coordinates
- `finishes` (M, 5) roughness, specular, metallic, transmission and emission of each material
- `colors` (M, 3) uint8 sRGB, and `picture_of`, `finish_of` (M,) which pictures it has, -1 for none
- `picture_0`, `picture_1`, ... (H, W, 3) uint8: sRGB colours, or numbers where they are finishes
- `sources` the SHA-256 of each picture of the file, as text
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.picture import decode_picture
from datagen.recipe.preparation.mesh_materials import FileMaterial, Picture
from datagen.recipe.preparation.mesh_parts import MeshSurface
from scenes.spec import GLOSSY
from stereoforge_kit.messages import shortened
from stereoforge_kit.srgb import to_linear, to_srgb

MAX_SIDE_PX = 4096
"""Larger pictures are made smaller."""
MAX_PIXELS = 1 << 24
"""Pixels that all pictures of a mesh may have together; if they have more, all are made smaller."""
MAX_UV = 1e6
"""Texture coordinates beyond this are taken for damaged: as 32-bit floats they would have no fraction."""
METAL = 0.5
"""A triangle whose picture says that it is metallic by this share and more counts as metal."""


@dataclass
class _Pictures:
    """The pictures of a mesh, each stored once."""

    remarks: list[str]
    images: list[NDArray[np.uint8]] = field(default_factory=list)
    baked: set[int] = field(default_factory=set)
    """Numbers of those whose pixels are colours of vertices, which cannot be made smaller."""
    sources: dict[str, None] = field(default_factory=dict)
    _number: dict[object, int] = field(default_factory=dict)
    _decoded: dict[Picture, NDArray[np.uint8] | None] = field(default_factory=dict)

    def decoded(self, picture: Picture) -> NDArray[np.uint8] | None:
        """The picture's values (H, W, 3); None, with a remark, if it is damaged or of a kind that is not read."""
        if picture not in self._decoded:
            try:
                self._decoded[picture] = decode_picture(
                    picture.data, shortened(picture.name, 40), MAX_SIDE_PX
                )
                self.sources[hashlib.sha256(picture.data).hexdigest()] = None
            except FormatError as error:
                self.remarks.append(f"its texture {shortened(str(error), 100)}")
                self._decoded[picture] = None
        return self._decoded[picture]

    def add(self, key: object, image: NDArray[np.uint8]) -> int:
        """The number of a picture under which it is stored."""
        if key not in self._number:
            self._number[key] = len(self.images)
            self.images.append(image)
        return self._number[key]


def surface_arrays(surface: MeshSurface, remarks: list[str]) -> dict[str, NDArray[np.generic]]:
    """The arrays of a mesh's materials as in this module's description, its triangles in the surface's order.

    Empty if it has no materials. What could not be used goes into `remarks`.
    """
    if not surface.materials:
        return {}
    pictures = _Pictures(remarks)
    uv, slots = _usable_uv(surface, remarks), surface.slots.copy()
    finishes: list[tuple[float, ...]] = []
    colors: list[NDArray[np.uint8]] = []
    picture_of: list[int] = []
    finish_of: list[int] = []
    for number in range(len(surface.materials)):
        own = np.flatnonzero(surface.slots == number)
        finish, groups = _by_finish(surface.materials[number], own, uv, pictures)
        for mixed, triangles in groups:
            slots[triangles] = len(finishes)
            material, picture = _colored(mixed, triangles, surface, uv, pictures)
            picture_of.append(picture)
            finish_of.append(finish)
            finishes.append(
                (
                    material.roughness,
                    material.specular,
                    material.metallic,
                    material.transmission,
                    material.emission,
                )
            )
            colors.append(np.rint(255 * to_srgb(np.array(material.color))).astype(np.uint8))
    arrays: dict[str, NDArray[np.generic]] = {
        "slots": slots.astype(np.int32),
        "own_uv": np.nan_to_num(uv).astype(np.float32),
        "finishes": np.array(finishes, np.float64),
        "colors": np.array(colors, np.uint8),
        "picture_of": np.array(picture_of, np.int32),
        "finish_of": np.array(finish_of, np.int32),
        "sources": np.array(sorted(pictures.sources), "U64"),
    }
    return arrays | {f"picture_{number}": image for number, image in enumerate(_within_limit(pictures))}


def _usable_uv(surface: MeshSurface, remarks: list[str]) -> NDArray[np.float64]:
    """Texture coordinates, NaN for the triangles that have none of use."""
    uv = surface.corner_uv.copy()
    unusable = ~(np.abs(uv) <= MAX_UV).all(axis=(1, 2))
    textured = np.array([bool(one.picture or one.finish) for one in surface.materials])[surface.slots]
    if (without := int((unusable & textured).sum())) and surface.materials:
        every = without == textured.sum()
        remarks.append(
            f"its texture has no usable coordinates on {'it' if every else f'{without} of its triangles'}, which "
            f"{'gets' if every else 'get'} the texture's mean colour"
        )
    uv[unusable] = np.nan
    return uv


def _by_finish(
    material: FileMaterial, triangles: NDArray[np.intp], uv: NDArray[np.float64], pictures: _Pictures
) -> tuple[int, list[tuple[FileMaterial, NDArray[np.intp]]]]:
    """The number of the picture that says how the material reflects, and the material with its triangles.

    If there is such a picture (the number is not -1), the material comes once for the triangles that show their
    surroundings and once for the others, each with its mean roughness: so the mask of reflective surfaces follows the
    picture. A group's mean that would tell otherwise is moved to the limit.
    """
    values = pictures.decoded(material.finish) if material.finish else None
    if values is None:
        return -1, [(material, triangles)]
    scaled = np.rint(values * np.array((1.0, material.roughness, material.metallic))).astype(np.uint8)
    number = pictures.add((material.finish, material.roughness, material.metallic), scaled)
    seen = np.nan_to_num(uv[triangles])
    spots = np.concatenate([seen, seen.mean(axis=1, keepdims=True)], axis=1)
    _, rough, metal = np.moveaxis(_at(scaled, spots).mean(axis=1) / 255.0, -1, 0)
    shows = (metal >= METAL) | (rough <= GLOSSY)
    groups = []
    for group, shown in ((shows, True), (~shows, False)):
        if group.any():
            roughness, metallic = float(rough[group].mean()), float(metal[group].mean())
            if not shown:
                roughness, metallic = max(roughness, np.nextafter(GLOSSY, 1.0)), 0.0
            groups.append((replace(material, roughness=roughness, metallic=metallic), triangles[group]))
    return number, groups


def _colored(
    material: FileMaterial,
    triangles: NDArray[np.intp],
    surface: MeshSurface,
    uv: NDArray[np.float64],
    pictures: _Pictures,
) -> tuple[FileMaterial, int]:
    """The material and the number of its picture, or -1 and its colour; vertex colours change `uv`."""
    values = pictures.decoded(material.picture) if material.picture else None
    if values is not None and np.isfinite(uv[triangles]).any():
        plain = np.isnan(uv[triangles]).any(axis=(1, 2))
        if plain.any():  # The texel whose colour is nearest to the mean.
            uv[triangles[plain]] = _typical_uv(values)
        return material, pictures.add((material.picture, material.color), _tinted(values, material.color))
    if values is not None:
        mean = to_linear(values.reshape(-1, 3) / 255.0).mean(axis=0)
        red, green, blue = (float(level) for level in mean * np.array(material.color))
        return replace(material, color=(red, green, blue), picture=None), -1
    corners = surface.corner_colors[triangles]
    if (corners == corners[:1, :1]).all():
        red, green, blue = to_linear(corners[0, 0] / 255.0) * np.array(material.color)
        return replace(material, color=(float(red), float(green), float(blue))), -1
    baked, uv[triangles] = bake(_tinted(corners, material.color))
    number = pictures.add(material, baked)
    pictures.baked.add(number)
    return material, number


def bake(corner_colors: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """A picture of the colours (T, 3, 3) of triangles' corners, and the texture coordinates (T, 3, 2) in it.

    Each triangle has two by two pixels. Between their centres linear interpolation, which is what Blender does, gives
    the colours that are linear over the triangle.
    """
    count = len(corner_colors)
    across = int(np.ceil(np.sqrt(count)))
    first, second, third = np.moveaxis(corner_colors.astype(np.int16), 1, 0)
    cells = np.full((across * across, 2, 2, 3), 128, np.uint8)
    cells[:count, 0, 0], cells[:count, 0, 1], cells[:count, 1, 0] = first, second, third
    cells[:count, 1, 1] = np.clip(second + third - first, 0, 255)
    picture = cells.reshape(across, across, 2, 2, 3).swapaxes(1, 2).reshape(2 * across, 2 * across, 3)
    row, column = np.divmod(np.arange(count), across)
    corner = np.stack([2 * column + 0.5, 2 * row + 0.5], -1)[:, None] + np.array([(0, 0), (1, 0), (0, 1)])
    uv = corner / (2 * across)
    uv[..., 1] = 1 - uv[..., 1]
    return np.ascontiguousarray(picture), uv


def _at(values: NDArray[np.uint8], uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """The pixels (..., 3) of a repeated picture at texture coordinates (..., 2)."""
    height, width = values.shape[:2]
    column = np.floor(uv[..., 0] % 1 * width).astype(int) % width
    row = np.floor((1 - uv[..., 1]) % 1 * height).astype(int) % height
    return values[row, column].astype(np.float64)


def _typical_uv(values: NDArray[np.uint8]) -> NDArray[np.float64]:
    small = cv2.resize(values, (64, 64), interpolation=cv2.INTER_NEAREST).astype(np.float64)
    row, column = divmod(int(((small - small.mean(axis=(0, 1))) ** 2).sum(axis=2).argmin()), 64)
    return np.array(((column + 0.5) / 64, 1 - (row + 0.5) / 64))


def _tinted(values: NDArray[np.uint8], factor: tuple[float, float, float]) -> NDArray[np.uint8]:
    """sRGB values (..., 3) times a linear factor."""
    if factor == (1.0, 1.0, 1.0):
        return values
    levels = to_linear(np.arange(256) / 255.0)
    tables = [np.rint(255 * to_srgb(levels * part)).astype(np.uint8) for part in factor]
    return np.stack([table[values[..., channel]] for channel, table in enumerate(tables)], -1)


def _within_limit(pictures: _Pictures) -> list[NDArray[np.uint8]]:
    """The pictures, made smaller if they have more than `MAX_PIXELS` together."""
    pixels = sum(image.shape[0] * image.shape[1] for image in pictures.images)
    if pixels <= MAX_PIXELS:
        return pictures.images
    pictures.remarks.append(
        f"its textures have {pixels / 1e6:.0f} million pixels together and are made smaller"
    )
    return [
        image if number in pictures.baked else _scaled(image, (MAX_PIXELS / pixels) ** 0.5)
        for number, image in enumerate(pictures.images)
    ]


def _scaled(image: NDArray[np.uint8], scale: float) -> NDArray[np.uint8]:
    width, height = (max(1, int(length * scale)) for length in image.shape[1::-1])
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
