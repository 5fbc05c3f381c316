"""The materials of the user's meshes: read from their files, or a sentence says what is missing."""

from __future__ import annotations

import base64
import io
import json
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import trimesh
from PIL import Image
from trimesh.visual.color import ColorVisuals

from datagen.recipe.preparation.mesh_materials import DULL
from datagen.recipe.preparation.mesh_surfaces import MAX_PIXELS, bake
from datagen.recipe.preparation.meshes import MAX_TRIANGLES, prepare_mesh
from datagen.recipe.preparation.side_files import SideFiles, picture_name
from scenes.geometry.building import solid, traced_solid
from scenes.spec import GLOSSY, Material
from scenes.textures.plain import SolidColor
from scenes.user_assets.pool import UserMesh, UserMeshTexture, use_store
from stereoforge_kit.errors import InputError
from stereoforge_kit.srgb import to_linear, to_srgb

RED, GREEN = (200, 20, 10), (10, 180, 30)
QUARTERS = np.array([[RED, GREEN], [(20, 30, 220), (240, 240, 240)]], np.uint8).repeat(8, 0).repeat(8, 1)


def stored(prepared: dict[str, np.ndarray], tmp_path: Path) -> UserMesh:
    sha256 = f"{abs(hash(tmp_path)):x}".zfill(64)
    np.savez(tmp_path / f"{sha256}.npz", **prepared)
    use_store(tmp_path)
    return UserMesh(sha256, own_materials=True)


def png(pixels: np.ndarray) -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG")
    return file.getvalue()


CUBE = trimesh.creation.box()
"""Its 12 triangles come in pairs, two a side."""


def write_obj(folder: Path, mtl: str | None, faces: str | None = None, name: str = "cube.obj") -> Path:
    """A cube of which every side shows the whole texture; the sides below z = 0 have the material `b`."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = ["mtllib cube.mtl", *(f"v {x} {y} {z}" for x, y, z in CUBE.vertices)]
    lines += ["vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
    corner = {(-1, -1): 1, (1, -1): 2, (1, 1): 3, (-1, 1): 4}
    by_material: dict[str, list[str]] = {"a": [], "b": []}
    for triangle in CUBE.faces:
        points = CUBE.vertices[triangle]
        axis = int(np.argmin(np.ptp(points, axis=0)))
        flat = np.delete(np.sign(points), axis, axis=1).astype(int)
        words = [f"{v + 1}/{corner[u[0], u[1]]}" for v, u in zip(triangle, flat, strict=True)]
        by_material["b" if axis == 2 and points[0, 2] < 0 else "a"].append("f " + " ".join(words))
    for material, own in by_material.items():
        lines += [f"usemtl {material}", *own]
    (folder / name).write_text("\n".join(lines if faces is None else [*lines[:9], faces]) + "\n")
    if mtl is not None:
        (folder / "cube.mtl").write_text(mtl)
    return folder / name


MTL = "newmtl a\nKd 0 0 0\nmap_Kd -s 1 1 1 textures\\side of it.png\nnewmtl b\nKd 0.5 0.25 1\nKs .5 .5 .5\nNs 900\n"


def color_at(material: Material, uv: np.ndarray) -> np.ndarray:
    """The colours of a material at texture coordinates (N, 2), by nearest pixel."""
    image = material.color.image()
    height, width = image.shape[:2]
    column = np.floor(uv[:, 0] % 1 * width).astype(int) % width
    return image[np.floor((1 - uv[:, 1]) % 1 * height).astype(int) % height, column]


def test_obj_materials_and_textures_are_kept(tmp_path: Path) -> None:
    path = write_obj(tmp_path / "mine", MTL)
    (tmp_path / "mine/textures").mkdir()
    (tmp_path / "mine/textures/side of it.png").write_bytes(png(QUARTERS))
    prepared = prepare_mesh(path)
    assert "remark" not in prepared
    shape = stored(prepared, tmp_path)
    kinds = [type(one.color) for one in shape.materials()]
    assert {*kinds} == {UserMeshTexture, SolidColor}
    textured, plain = (shape.materials()[kinds.index(kind)] for kind in (UserMeshTexture, SolidColor))
    np.testing.assert_array_equal(textured.color.image(), QUARTERS)
    assert not textured.is_reflective
    assert plain.color == SolidColor(
        tuple(np.rint(255 * to_srgb(np.array([0.5, 0.25, 1.0]))).astype(int).tolist())
    )
    assert plain.specular == 0.5
    assert plain.roughness == pytest.approx((2 / 902) ** 0.25)
    assert plain.is_reflective
    mesh = shape.mesh()
    below = mesh.vertices[mesh.triangles][..., 2].max(axis=1) < 0
    assert mesh.slots is not None
    assert np.array_equal(mesh.slots == kinds.index(SolidColor), below)
    # The picture's lower left corner is at the corner of each side where both coordinates are least.
    corners, uv = mesh.vertices[mesh.triangles][~below], mesh.corner_uv[~below]
    least = (corners < 0).sum(axis=2) >= 2
    for points, coordinates in zip(corners, uv, strict=True):
        axis = int(np.argmin(np.ptp(points, axis=0)))
        np.testing.assert_allclose(coordinates, np.delete(points, axis, axis=1) / 2 + 0.5, atol=1e-6)
    assert least.any()
    assert shape.half_size() == pytest.approx(0.5)
    boxed = UserMesh(shape.sha256).mesh()
    assert boxed.slots is None
    np.testing.assert_array_equal(boxed.vertices, mesh.vertices)


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("wood.png", "wood.png"),
        ("my wood 2.png", "my wood 2.png"),
        ("-s 2 2 2 -o 0.5 wood.png", "wood.png"),
        ("-bm 0.3 -clamp on -blendu off C:\\tex\\wood.png", "C:\\tex\\wood.png"),
        ("-mm 0 1 3 wood.png", "3 wood.png"),
    ],
)
def test_names_of_pictures_in_lists_of_materials(line: str, name: str) -> None:
    assert picture_name(line) == name


def test_files_outside_the_folder_are_not_read(tmp_path: Path) -> None:
    """A mesh of somebody else's names what it likes, also by way of links."""
    (tmp_path / "secret.png").write_bytes(png(QUARTERS))
    root = tmp_path / "given/meshes"
    path = write_obj(root / "cube", None)
    (root / "textures").mkdir()
    (root / "textures/wood.png").write_bytes(png(QUARTERS))
    (root / "cube/link.png").symlink_to(tmp_path / "secret.png")
    files = SideFiles(path, root)
    assert files.find("../textures/wood.png") is not None
    for name in (
        "../../../secret.png",
        str(tmp_path / "secret.png"),
        "link.png",
        "../textures",
        "a\0b",
        "x" * 5000,
    ):
        assert files.find(name) is None, name
    (root / "cube/wood.png").write_bytes(png(QUARTERS))
    for name in ("/home/someone/wood.png", r"C:\Users\someone\wood.png", "../../elsewhere/wood.png"):
        found = files.find(name)
        assert found is not None
        assert found.resolve() == (root / "cube/wood.png").resolve()


@pytest.mark.parametrize(
    ("mtl", "remark"),
    [
        (None, "its materials cube.mtl are not beside it"),
        ("", "its materials cube.mtl have none that can be read"),
        ("\0\xff junk", "its materials cube.mtl have none that can be read"),
        ("newmtl a\nmap_Kd gone.png\nnewmtl b\n", "its texture gone.png is not beside it"),
        ("newmtl a\nmap_Kd ../../gone.png\nnewmtl b\n", "its texture ../../gone.png is not beside it"),
        ("newmtl a\nmap_Kd cube.mtl\nnewmtl b\n", "its texture cube.mtl: is no picture"),
        ("newmtl a\nKd red 1 2\nNs nan\nd\nnewmtl b\n", "a colour of its materials is none: kd red 1 2"),
    ],
)
def test_what_is_missing_is_a_remark(tmp_path: Path, mtl: str | None, remark: str) -> None:
    prepared = prepare_mesh(write_obj(tmp_path, mtl))
    assert remark in str(prepared["remark"])
    assert len(str(prepared["remark"])) < 300
    assert len(prepared["triangles"]) == 12
    if mtl and "newmtl" in mtl:
        assert all(isinstance(one.color, SolidColor) for one in stored(prepared, tmp_path).materials())
    else:
        assert "slots" not in prepared


def test_what_a_mesh_names_is_part_of_what_it_is(tmp_path: Path) -> None:
    """Another texture makes another mesh; a texture that comes later is seen."""
    path = write_obj(tmp_path, "newmtl a\nmap_Kd wood.png\n")
    files, digests = SideFiles(path, tmp_path), set()
    for content in (None, b"one", b"two"):
        if content:
            (tmp_path / "wood.png").write_bytes(content)
        digests.add(files.digest())
    (tmp_path / "cube.mtl").write_text("newmtl a\nmap_Kd wood.png\nKd 1 0 0\n")
    digests.add(files.digest())
    assert len(digests) == 4
    trimesh.creation.box().export(tmp_path / "box.stl")
    assert SideFiles(tmp_path / "box.stl", tmp_path).digest() == b""


INSET = 0.98
"""Side of the square of texture coordinates on a glTF cube's sides: at 1 a repeated picture begins anew."""


def gltf_of(tmp_path: Path, materials: list[dict[str, Any]], images: list[dict[str, Any]], kind: str) -> Path:
    """A glTF cube with a quarter-coloured picture; primitive k has material k, the primitives share the triangles."""
    uv = (INSET * CUBE.vertices[:, :2] + 0.5).astype("<f4")
    arrays = [
        CUBE.vertices.astype("<f4").tobytes(),
        uv.tobytes(),
        CUBE.faces.astype("<u4").tobytes(),
        png(QUARTERS),
    ]
    starts = np.cumsum([0, *(len(one) for one in arrays)]).tolist()
    binary = b"".join(arrays)
    share = 12 // max(len(materials), 1)
    header: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "scale": [2, 2, 2]}],
        "buffers": [{"byteLength": len(binary)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": len(one)}
            for start, one in zip(starts, arrays, strict=False)
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 8, "type": "VEC2"},
            *(
                {
                    "bufferView": 2,
                    "byteOffset": 12 * share * k,
                    "componentType": 5125,
                    "count": 3 * share,
                    "type": "SCALAR",
                }
                for k in range(max(len(materials), 1))
            ),
        ],
        "meshes": [
            {
                "primitives": [
                    {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2 + k, "material": k}
                    for k in range(len(materials))
                ]
            }
        ],
        "materials": materials,
        "textures": [{"source": k} for k in range(len(images))],
        "images": images,
    }
    path = tmp_path / f"cube.{kind}"
    if kind == "gltf":
        header["buffers"][0]["uri"] = "cube%20data.bin"
        (tmp_path / "cube data.bin").write_bytes(binary)
        path.write_text(json.dumps(header))
        return path
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = (
        struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    )
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path


TEXTURED = {
    "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0, "roughnessFactor": 0.6}
}
METAL = {"pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.25, 1], "roughnessFactor": 0.2}}
GLASS = {
    "alphaMode": "BLEND",
    "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 1, 0.25], "metallicFactor": 0, "roughnessFactor": 0.1},
}
GLOWING = {
    "emissiveFactor": [1, 1, 0],
    "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0},
}


@pytest.mark.parametrize("kind", ["gltf", "glb"])
@pytest.mark.parametrize("source", ["view", "file", "data"])
def test_gltf_materials_are_kept(tmp_path: Path, kind: str, source: str) -> None:
    (tmp_path / "a b.png").write_bytes(png(QUARTERS))
    image = {
        "view": {"bufferView": 3, "mimeType": "image/png"},
        "file": {"uri": "a%20b.png"},
        "data": {"uri": "data:image/png;base64," + base64.b64encode(png(QUARTERS)).decode()},
    }[source]
    prepared = prepare_mesh(gltf_of(tmp_path, [TEXTURED, METAL, GLASS, GLOWING], [image], kind))
    assert "remark" not in prepared
    shape = stored(prepared, tmp_path)
    textured, metal, glass, glowing = shape.materials()
    np.testing.assert_array_equal(textured.color.image(), QUARTERS)
    assert (textured.roughness, textured.metallic, textured.is_reflective) == (0.6, 0, False)
    assert (metal.roughness, metal.metallic) == (0.2, 1)
    assert glass.transmission == pytest.approx(0.75)
    assert glowing.emission == 1
    assert glowing.color == SolidColor((255, 255, 0))
    assert [one.is_reflective for one in (metal, glass, glowing)] == [True, True, False]
    assert shape.half_size() == pytest.approx(1.0)
    mesh = shape.mesh()
    assert mesh.slots is not None
    own = mesh.slots == 0
    # In the file y points up: its (x, y, z) is (x, -z, y) here, and v of the picture points down.
    points = mesh.vertices[mesh.triangles][own].reshape(-1, 3)
    expected = np.stack([INSET * points[:, 0] / 2 + 0.5, 0.5 - INSET * points[:, 2] / 2], -1)
    np.testing.assert_allclose(mesh.corner_uv[own].reshape(-1, 2), expected, atol=1e-6)


def test_a_picture_says_what_is_metal(tmp_path: Path) -> None:
    """As in glTF: green is the roughness and blue the metallic share. The mask of reflective surfaces follows it."""
    finish = np.zeros((16, 16, 3), np.uint8)
    finish[:, :8], finish[:, 8:] = (0, 200, 0), (0, 100, 255)
    (tmp_path / "finish.png").write_bytes(png(finish))
    entry = {"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}, "roughnessFactor": 0.9}}
    shape = stored(prepare_mesh(gltf_of(tmp_path, [entry], [{"uri": "finish.png"}], "gltf")), tmp_path)
    metal, dull = shape.materials()
    assert metal.is_reflective
    assert not dull.is_reflective
    assert metal.roughness == pytest.approx(0.9 * 100 / 255, abs=0.2)
    assert dull.metallic == 0
    assert dull.roughness > GLOSSY
    assert metal.finish == dull.finish
    assert metal.finish is not None
    np.testing.assert_allclose(metal.finish.image()[0, [0, -1]], [(0, 180, 0), (0, 90, 255)], atol=1)
    mesh = shape.mesh()
    assert mesh.slots is not None
    for limit, slot in ((0.5 - INSET / 2, 1), (0.5 + INSET / 2, 0)):
        side = np.isclose(mesh.corner_uv[..., 0], limit).all(axis=1)
        assert side.sum() == 2
        assert (mesh.slots[side] == slot).all()


@pytest.mark.parametrize(
    ("entry", "images", "remark"),
    [
        (TEXTURED, [{"uri": "gone.png"}], "its texture gone.png is not beside it"),
        (TEXTURED, [{"uri": "../../../gone.png"}], "is not beside it"),
        (TEXTURED, [{"uri": "a.ktx2"}], "KTX2"),
        (TEXTURED, [{"bufferView": 0, "mimeType": "image/ktx2"}], "KTX2"),
        (TEXTURED, [{"bufferView": 0}], "its texture image 0: is no picture"),
        (TEXTURED, [{"bufferView": 99}], "its material 0 is malformed"),
        (TEXTURED, [{"uri": "data:image/png,abc"}], "its material 0 is malformed"),
        (TEXTURED, [], "its material 0 is malformed"),
        ({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}}}, [], "second set"),
        ({"pbrMetallicRoughness": 7}, [], "its material 0 is malformed"),
        ({"pbrMetallicRoughness": {"baseColorFactor": [1, 2]}}, [], "its material 0 is malformed"),
    ],
)
def test_gltf_materials_that_cannot_be_used_are_plain(
    tmp_path: Path, entry: dict[str, Any], images: list[dict[str, Any]], remark: str
) -> None:
    prepared = prepare_mesh(gltf_of(tmp_path, [entry], images, "glb"))
    assert remark in str(prepared["remark"])
    (material,) = stored(prepared, tmp_path).materials()
    assert isinstance(material.color, SolidColor)


def test_gltf_files_that_cannot_be_used_say_why(tmp_path: Path) -> None:
    path = gltf_of(tmp_path, [METAL], [], "gltf")
    (tmp_path / "cube data.bin").unlink()
    with pytest.raises(InputError, match=r"its buffer cube%20data.bin is not beside it"):
        prepare_mesh(path)
    for name, content in (
        ("a.gltf", b"{nonsense"),
        ("b.gltf", b"[1]"),
        ("c.glb", b"glTF\1\0\0\0"),
        ("d.glb", struct.pack("<4sIII4s", b"glTF", 2, 99, 50, b"JSON") + b"{}"),
        ("e.gltf", b'{"extensionsRequired": ["EXT_meshopt_compression"]}'),
        ("f.gltf", b"[" * 100_000),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError) as caught:
            prepare_mesh(tmp_path / name)
        assert len(str(caught.value)) < 300
        assert list(SideFiles(tmp_path / name, tmp_path).named()) == []


def test_textures_without_usable_coordinates_give_their_mean_colour(tmp_path: Path) -> None:
    """Coordinates may be absent, not finite, or so large that they have no fraction."""
    (tmp_path / "a.png").write_bytes(png(QUARTERS))
    mtl = "newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd a.png\n"
    path = write_obj(tmp_path, mtl)
    text = path.read_text()
    mean = to_srgb(to_linear(QUARTERS.reshape(-1, 3) / 255).mean(axis=0)) * 255
    for spoiled in (text.replace("vt 1 1", "vt nan 1"), text.replace("vt 1 1", "vt 1e30 1")):
        path.write_text(spoiled)
        prepared = prepare_mesh(path)
        assert "get the texture's mean colour" in str(prepared["remark"])
        assert np.isfinite(prepared["own_uv"]).all()
    faces = "usemtl a\n" + "\n".join("f " + " ".join(str(v + 1) for v in face) for face in CUBE.faces)
    prepared = prepare_mesh(write_obj(tmp_path, mtl, faces))
    assert "no usable coordinates on it" in str(prepared["remark"])
    (material,) = stored(prepared, tmp_path).materials()
    assert np.abs(material.color.image()[0, 0] - mean).max() <= 1


@pytest.mark.parametrize("kind", ["ply", "glb", "obj"])
def test_vertex_colours_are_baked(tmp_path: Path, kind: str) -> None:
    rng = np.random.default_rng(3)
    ball = trimesh.creation.icosphere(2)
    ball.visual = ColorVisuals(ball, vertex_colors=rng.integers(0, 256, (len(ball.vertices), 4)))
    ball.export(tmp_path / f"ball.{kind}")
    shape = stored(prepare_mesh(tmp_path / f"ball.{kind}", up_axis="z"), tmp_path)
    (material,) = shape.materials()
    mesh = shape.mesh()
    colors = np.asarray(ball.visual.vertex_colors)[:, :3] / 255
    expected = np.rint(255 * (to_srgb(colors) if kind == "glb" else colors))
    for corner in range(3):
        points = mesh.vertices[mesh.triangles[:, corner]]
        nearest = np.linalg.norm(points[:, None] - ball.vertices, axis=2).argmin(axis=1)
        found = color_at(material, mesh.corner_uv[:, corner])
        assert np.abs(found - expected[nearest]).max() <= 1


def test_baked_colours_are_linear_over_each_triangle() -> None:
    """Against Blender's own interpolation: bilinear, between the centres of pixels."""
    rng = np.random.default_rng(0)
    colors = rng.integers(60, 120, (7, 3, 3)).astype(np.uint8)
    picture, uv = bake(colors)
    weights = rng.dirichlet((1, 1, 1), 50)
    for triangle in range(7):
        spots = weights @ uv[triangle]
        x, y = spots[:, 0] * picture.shape[1] - 0.5, (1 - spots[:, 1]) * picture.shape[0] - 0.5
        found = cv2.remap(
            picture.astype(np.float32), x.astype(np.float32)[None], y.astype(np.float32)[None], 1
        )
        assert np.abs(found[0] - weights @ colors[triangle]).max() < 1.5


def test_pictures_of_many_pixels_are_made_smaller(tmp_path: Path) -> None:
    for name in "ab":
        cv2.imwrite(str(tmp_path / f"{name}.png"), np.full((4096, 3000, 3), 90, np.uint8))
    prepared = prepare_mesh(write_obj(tmp_path, "newmtl a\nmap_Kd a.png\nnewmtl b\nKd 1 1 1\nmap_Kd b.png\n"))
    pictures = [array for name, array in prepared.items() if name.startswith("picture_") and array.ndim == 3]
    assert sum(one.shape[0] * one.shape[1] for one in pictures) <= MAX_PIXELS
    assert "25 million pixels" not in str(prepared.get("remark", "")) or len(pictures) == 2


def test_a_decimated_mesh_keeps_its_texture(tmp_path: Path) -> None:
    """A scan of more triangles than are kept: what is seen at a place is what was seen there before."""
    ball = trimesh.creation.icosphere(7)
    height = ball.vertices[:, 2] / 2 + 0.5
    picture = np.repeat(np.linspace(255, 0, 256).astype(np.uint8)[:, None, None], 3, axis=2)
    uv = np.stack([np.full(len(height), 0.5), height], -1)
    ball.visual = trimesh.visual.TextureVisuals(uv=uv, image=Image.fromarray(picture.repeat(4, axis=1)))
    ball.export(tmp_path / "ball.obj")
    prepared = prepare_mesh(tmp_path / "ball.obj")
    assert len(prepared["triangles"]) <= MAX_TRIANGLES
    corners = prepared["vertices"][prepared["triangles"]]
    error = prepared["own_uv"][..., 1] - (corners[..., 2] / 2 + 0.5)
    assert np.abs(error).max() < 0.02


def test_corners_are_traced_through_welding_and_turning() -> None:
    ball = trimesh.creation.icosphere(1)
    corners = ball.vertices[ball.faces]
    inside_out = np.arange(3 * len(ball.faces)).reshape(-1, 3)[:, ::-1]
    mesh, origin = traced_solid(corners.reshape(-1, 3), inside_out, smooth=True)
    np.testing.assert_allclose(
        mesh.vertices[mesh.triangles], corners.reshape(-1, 3)[inside_out.reshape(-1)[origin]], atol=1e-5
    )
    uv = np.random.default_rng(0).random((len(inside_out), 3, 2))
    with_uv = solid(corners.reshape(-1, 3), inside_out, uv=uv, smooth=True)
    np.testing.assert_allclose(with_uv.corner_uv, uv.reshape(-1, 2)[origin], rtol=1e-5)


def test_dull_surfaces_have_no_highlight(tmp_path: Path) -> None:
    """It would make them slow to render; and a list of materials that says nothing of gloss means a matte surface."""
    rough = {"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": DULL}}
    prepared = prepare_mesh(gltf_of(tmp_path, [rough], [], "gltf"))
    (material,) = stored(prepared, tmp_path).materials()
    assert (material.roughness, material.specular) == (1.0, 0.0)
