"""Materials as mesh files have them: Wavefront's lists of materials, and those of glTF."""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.formats.limits import read_bounded
from datagen.recipe.preparation.side_files import MAX_LIST_BYTES, SideFiles, picture_name
from stereoforge_kit.errors import UserError
from stereoforge_kit.messages import shortened

GLASS = 0.95
"""Most light that goes through a surface: of a perfectly clear one nothing would be seen."""
DULL = 0.9
"""A dielectric of this roughness and more has no highlight worth computing."""
_DIELECTRIC = 0.5
"""`Material.specular` of an index of refraction of 1.5, which glTF has for all."""
Rgb = tuple[float, float, float]


@dataclass(frozen=True)
class Picture:
    """A picture as it is in a file."""

    name: str
    data: bytes = field(repr=False)


@dataclass(frozen=True)
class FileMaterial:
    """One material of a mesh file. The numbers are those of `scenes.spec.Material`."""

    color: Rgb = (0.8, 0.8, 0.8)
    """Linear RGB, 0..1; that of the whole surface, or a factor of the picture's."""
    picture: Picture | None = None
    roughness: float = 1.0
    specular: float = 0.0
    metallic: float = 0.0
    transmission: float = 0.0
    emission: float = 0.0
    finish: Picture | None = None
    """Green times `roughness` is the roughness, blue times `metallic` the metallic share."""
    uv_matrix: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    """(2, 3) from the mesh's texture coordinates, with (0, 0) at the top, to the picture's; None for no change."""


def read_obj_materials(files: SideFiles, remarks: list[str]) -> dict[str, FileMaterial]:
    """The materials of an OBJ file by their names; what is missing or unreadable is remarked on."""
    materials: dict[str, FileMaterial] = {}
    for name, place in files.material_lists():
        if place is None:
            remarks.append(f"its materials {shortened(name, 60)} are not beside it")
            continue
        try:
            text = read_bounded(place, MAX_LIST_BYTES).decode("utf-8", "replace")
        except UserError as error:
            remarks.append(f"its materials cannot be read ({shortened(str(error), 80)})")
            continue
        materials |= _ListReader(files, place, remarks).read(text)
    return materials


@dataclass
class _ListReader:
    """Reads one list of materials (`.mtl`, with the usual extensions for physically based materials)."""

    files: SideFiles
    place: Path
    remarks: list[str]

    def read(self, text: str) -> dict[str, FileMaterial]:
        materials: dict[str, FileMaterial] = {}
        entries: dict[str, dict[str, str]] = {}
        current: dict[str, str] | None = None
        for line in text.splitlines():
            key, _, rest = line.strip().partition(" ")
            if key.lower() == "newmtl":
                current = entries.setdefault(" ".join(rest.split()), {})
            elif current is not None and rest.strip():
                current[key.lower()] = rest.strip()
        for name, entry in entries.items():
            materials[name] = self._material(entry)
        if not materials:
            self.remarks.append(f"its materials {shortened(self.place.name, 60)} have none that can be read")
        return materials

    def _material(self, entry: dict[str, str]) -> FileMaterial:
        picture = self._picture(entry["map_kd"]) if "map_kd" in entry else None
        # As in Blender, the picture stands alone: many programs write a black or grey factor beside it.
        color = (1.0, 1.0, 1.0) if picture else self._color(entry, "kd", 0.8)
        opacity = self._number(entry, "d", 1.0 - self._number(entry, "tr", 0.0))
        metallic = _clipped(self._number(entry, "pm", 0.0))
        specular = float(np.mean(self._color(entry, "ks", 0.0)))
        if self._number(entry, "illum", 2.0) < 2:
            specular = 0.0
        # Phong's exponent n as the width of a microfacet distribution: alpha^2 = 2 / (n + 2) (Walter et al. 2007).
        exponent = max(self._number(entry, "ns", 0.0), 0.0)
        roughness = _clipped(self._number(entry, "pr", (2.0 / (exponent + 2.0)) ** 0.25))
        glow = float(np.mean(self._color(entry, "ke", 0.0)))
        return _simplified(
            FileMaterial(
                color,
                picture,
                roughness,
                _DIELECTRIC if "pr" in entry else _clipped(specular),
                metallic,
                min(1.0 - _clipped(opacity), GLASS),
                max(glow, 0.0),
            )
        )

    def _picture(self, line: str) -> Picture | None:
        name = picture_name(line)
        place = self.files.find(name, self.place)
        if place is None:
            self.remarks.append(f"its texture {shortened(name, 60)} is not beside it")
            return None
        try:
            return Picture(name, read_bounded(place))
        except UserError as error:
            self.remarks.append(f"its texture cannot be read ({shortened(str(error), 80)})")
            return None

    def _color(self, entry: dict[str, str], key: str, default: float) -> Rgb:
        values = [_number(word) for word in entry.get(key, "").split()[:3]]
        if len(values) == 1:
            values *= 3
        if len(values) != 3 or None in values:
            if key in entry:
                self.remarks.append(
                    f"a colour of its materials is none: {shortened(f'{key} {entry[key]}', 40)}"
                )
            values = [default] * 3
        red, green, blue = (_clipped(value) for value in values if value is not None)
        return red, green, blue

    def _number(self, entry: dict[str, str], key: str, default: float) -> float:
        words = [word for word in entry.get(key, "").split() if not word.startswith("-")]
        value = _number(words[0]) if words else None
        if key in entry and value is None:
            self.remarks.append(f"a number of its materials is none: {shortened(f'{key} {entry[key]}', 40)}")
        return default if value is None else value


def _number(word: str) -> float | None:
    try:
        value = float(word)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _clipped(value: float) -> float:
    return min(max(value, 0.0), 1.0)


def _simplified(material: FileMaterial) -> FileMaterial:
    """The material without what is not seen: highlights of dull surfaces, which cost much to render."""
    if material.roughness >= DULL and not material.finish:
        material = replace(material, specular=0.0)
    if not (material.specular or material.metallic or material.transmission or material.finish):
        material = replace(material, roughness=1.0)
    return material


class GltfMaterials:
    """The materials of a glTF file, read by its specification (version 2.0, section 3.9) and its common extensions."""

    def __init__(
        self, header: dict[str, Any], buffers: list[bytes], files: SideFiles, remarks: list[str]
    ) -> None:
        self._header, self._buffers, self._files, self._remarks = header, buffers, files, remarks

    def read(self) -> list[FileMaterial]:
        """All materials, in the file's order. One that is malformed is plain, with a remark."""
        materials = []
        for number, entry in enumerate(self._header.get("materials", ())):
            try:
                materials.append(_simplified(self._material(entry)))
            except (TypeError, ValueError, KeyError, IndexError, AttributeError):
                self._remarks.append(f"its material {number} is malformed, it is taken for grey")
                materials.append(FileMaterial())
        return materials

    def _material(self, entry: dict[str, Any]) -> FileMaterial:
        extensions = entry.get("extensions", {})
        if "KHR_materials_pbrSpecularGlossiness" in extensions:
            return self._specular_glossiness(extensions["KHR_materials_pbrSpecularGlossiness"], entry)
        values = entry.get("pbrMetallicRoughness", {})
        roughness, metallic = (
            _clipped(float(values.get(f"{name}Factor", 1.0))) for name in ("roughness", "metallic")
        )
        material = self._based(values.get("baseColorFactor"), values.get("baseColorTexture"), entry)
        if "KHR_materials_unlit" in extensions:
            return material
        finish, _ = self._texture(values.get("metallicRoughnessTexture"))
        clear = float(extensions.get("KHR_materials_transmission", {}).get("transmissionFactor", 0.0))
        material = replace(
            material,
            roughness=roughness,
            specular=_DIELECTRIC,
            metallic=metallic,
            transmission=min(max(material.transmission, clear), GLASS),
            finish=finish,
        )
        return self._glowing(material, entry)

    def _specular_glossiness(self, values: dict[str, Any], entry: dict[str, Any]) -> FileMaterial:
        """The older kind: a specular colour well above that of dielectrics means metal."""
        material = self._based(values.get("diffuseFactor"), values.get("diffuseTexture"), entry)
        specular = float(np.max(values.get("specularFactor", (1.0, 1.0, 1.0))))
        is_metal = specular > 0.3 and "specularGlossinessTexture" not in values
        roughness = 1.0 - _clipped(float(values.get("glossinessFactor", 1.0)))
        if "specularGlossinessTexture" in values:
            roughness = max(roughness, 0.6)  # How glossy it is where is in a picture that is not read.
        return replace(material, roughness=roughness, specular=_DIELECTRIC, metallic=float(is_metal))

    def _based(self, factor: Any, texture: Any, entry: dict[str, Any]) -> FileMaterial:
        """A matte material of a base colour, transparent as its factor says."""
        red, green, blue, alpha = (_clipped(float(value)) for value in (factor or (1.0,) * 4))
        picture, matrix = self._texture(texture)
        clear = 1.0 - alpha if entry.get("alphaMode") == "BLEND" else 0.0
        return FileMaterial((red, green, blue), picture, transmission=min(clear, GLASS), uv_matrix=matrix)

    def _glowing(self, material: FileMaterial, entry: dict[str, Any]) -> FileMaterial:
        color = [max(float(value), 0.0) for value in entry.get("emissiveFactor", (0.0, 0.0, 0.0))]
        strength = (
            entry.get("extensions", {})
            .get("KHR_materials_emissive_strength", {})
            .get("emissiveStrength", 1.0)
        )
        if "emissiveTexture" in entry or max(color) == 0:
            return material
        if material.picture is None and max(material.color) < 0.05:
            material = replace(material, color=(_clipped(color[0]), _clipped(color[1]), _clipped(color[2])))
        return replace(material, emission=float(strength) * max(color))

    def _texture(self, use: Any) -> tuple[Picture | None, Any]:
        """The picture that a material uses, and the matrix of its texture coordinates."""
        if use is None:
            return None, None
        if use.get("texCoord", 0) != 0:
            self._remarks.append("a texture of it uses a second set of coordinates, which is not read")
            return None, None
        texture = self._header["textures"][use["index"]]
        source = (
            texture.get("extensions", {})
            .get("EXT_texture_webp", texture)
            .get("source", texture.get("source"))
        )
        if source is None:
            self._remarks.append("a texture of it is of a kind that is not read, such as KTX2")
            return None, None
        picture = self._image(self._header["images"][source], source)
        return picture, _uv_matrix(use.get("extensions", {}).get("KHR_texture_transform"))

    def _image(self, image: dict[str, Any], number: int) -> Picture | None:
        name = str(image.get("name") or image.get("uri", f"image {number}"))[:200]
        if image.get("mimeType") == "image/ktx2" or str(image.get("uri", "")).lower().endswith(".ktx2"):
            self._remarks.append("a texture of it is KTX2, which is not read")
            return None
        if "bufferView" in image:
            return Picture(name, view_bytes(self._header, self._buffers, image["bufferView"]))
        uri = image["uri"]
        if uri.startswith("data:"):
            return Picture(f"image {number}", data_of(uri))
        place = self._files.find_uri(uri)
        if place is None:
            self._remarks.append(f"its texture {shortened(uri, 60)} is not beside it")
            return None
        return Picture(name, read_bounded(place))


def view_bytes(header: dict[str, Any], buffers: list[bytes], number: int) -> bytes:
    """The content of one of a glTF file's buffer views."""
    view = header["bufferViews"][number]
    start = view.get("byteOffset", 0)
    return buffers[view["buffer"]][start : start + view["byteLength"]]


def data_of(uri: str) -> bytes:
    """The content of a `data:` URI in base64. Raises ValueError for another one."""
    _, found, text = uri.partition("base64,")
    if not found:
        raise ValueError("a data URI is not in base64")
    try:
        return base64.b64decode(text)
    except binascii.Error as error:
        raise ValueError("a data URI is damaged") from error


def _uv_matrix(transform: dict[str, Any] | None) -> Any:
    """That of KHR_texture_transform: offset after rotation after scale."""
    if transform is None:
        return None
    (x, y), (across, down) = transform.get("offset", (0.0, 0.0)), transform.get("scale", (1.0, 1.0))
    angle = float(transform.get("rotation", 0.0))
    cosine, sine = math.cos(angle), math.sin(angle)
    return (cosine * across, sine * down, float(x)), (-sine * across, cosine * down, float(y))


def transformed(uv: NDArray[np.float64], matrix: Any) -> NDArray[np.float64]:
    """Texture coordinates (..., 2) with (0, 0) at the bottom, by a matrix for those with (0, 0) at the top."""
    turned = np.stack([uv[..., 0], 1 - uv[..., 1], np.ones(uv.shape[:-1])], -1) @ np.array(matrix).T
    return np.stack([turned[..., 0], 1 - turned[..., 1]], -1)


def distinct(remarks: Iterable[str], most: int = 3) -> str:
    """Remarks as the end of a sentence, each once."""
    each = list(dict.fromkeys(remarks))
    more = f"; and {len(each) - most} more" if len(each) > most else ""
    return "; ".join(each[:most]) + more
