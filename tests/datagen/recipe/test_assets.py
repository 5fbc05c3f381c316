"""User assets: prepared in a guarded process, used in one split each, part of the data set."""

from __future__ import annotations

import ctypes
import json
import re
import struct
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest
import trimesh
from PIL import Image

from datagen import DatasetError, Recipe, StereoDataset, read_recipe, render_dataset
from datagen.dataset.layout import Layout
from datagen.dataset.manifest import read_manifest
from datagen.dataset.shards import CACHE_VARIABLE
from datagen.errors import FormatError
from datagen.export import EXPORTERS, ExportOptions
from datagen.formats.picture import read_picture
from datagen.recipe.asset_pool import describe_splits, pool_to_text, require_assets
from datagen.recipe.assets import ImportedAssets, _FolderImport, copy_prepared, import_assets
from datagen.recipe.preparation.mesh_surfaces import MAX_SIDE_PX
from datagen.recipe.preparation.meshes import MAX_TRIANGLES, UpAxis, prepare_mesh
from datagen.recipe.preparation.pictures import prepare_environment, prepare_texture
from datagen.recipe.recipe import recipe_from_text, recipe_to_text, write_recipe
from datagen.rendering.estimate import estimate_run
from datagen.verify.dataset_check import verify_dataset
from scenes import FAMILIES, scene_from_json, scene_to_json
from scenes.spec import SceneObject
from scenes.user_assets.pool import (
    Asset,
    AssetPool,
    UserEnvironment,
    UserMesh,
    UserTexture,
    spread_over_splits,
    use_store,
)
from stereoforge.commands.render import Render
from stereoforge_kit.files import LocalTree, open_tree
from stereoforge_kit.processes import Limits

RNG = np.random.default_rng(0)


def write_user_files(folder: Path) -> None:
    for name in ("meshes", "textures", "environments"):
        (folder / name).mkdir(parents=True)
    meshes = folder / "meshes"
    for k in range(4):
        for suffix in ("obj", "ply", "glb", "stl"):
            body = trimesh.creation.icosphere(subdivisions=1, radius=3.0 + k)
            body.vertices += RNG.normal(size=body.vertices.shape) * 0.2 + 40
            body.export(meshes / f"body_{k}.{suffix}")
    (meshes / "empty.obj").write_text("# nothing\n")
    (meshes / "garbage.glb").write_bytes(RNG.bytes(400))
    (meshes / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\n" + "f 1 2 3\n" * 5)
    header = "ply\nformat binary_little_endian 1.0\nelement vertex 9000000000\n"
    (meshes / "huge.ply").write_text(
        header + "property double x\nproperty double y\nproperty double z\nend_header\n"
    )
    (meshes / "leak.obj").write_text("mtllib ../../secret.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")
    for k in range(6):
        cv2.imwrite(str(folder / f"textures/picture_{k}.png"), RNG.integers(0, 255, (30, 40, 3)))
    (folder / "textures/broken.png").write_bytes(b"\x89PNG\r\n\x1a\nno")
    sky = RNG.uniform(0.1, 2.0, (16, 32, 3)).astype(np.float32)
    sky[3, 20] = 5000.0
    cv2.imwrite(str(folder / "environments/sky.hdr"), sky)
    planes = {name: np.ascontiguousarray(sky[::-1, :, k]) for k, name in enumerate("RGB")}
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, planes).write(str(folder / "environments/sky.exr"))


@pytest.fixture(scope="module")
def user(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("user")
    write_user_files(folder)
    return folder


@pytest.fixture(scope="module")
def imported(user: Path, tmp_path_factory: pytest.TempPathFactory) -> ImportedAssets:
    store = tmp_path_factory.mktemp("store")
    found = import_assets(
        store, meshes=user / "meshes", textures=user / "textures", environments=user / "environments"
    )
    use_store(store)
    return found


def test_usable_files_are_normalised_and_the_others_skipped_with_a_sentence(imported: ImportedAssets) -> None:
    pool = imported.pool
    assert [len(kind) for kind in (pool.meshes, pool.textures, pool.environments)] == [16, 6, 2]
    for asset in pool.meshes:
        mesh = UserMesh(asset.sha256).mesh()
        assert np.abs(mesh.vertices).max() == pytest.approx(1.0)
        assert len(mesh.triangles) == 80
        assert mesh.corner_uv.shape == (80, 3, 2)
    said = {Path(sentence.split(": ")[0]).name: sentence for sentence in imported.skipped}
    assert said.keys() == {"empty.obj", "garbage.glb", "flat.obj", "huge.ply", "leak.obj", "broken.png"}
    assert all("\n" not in sentence and len(sentence) < 500 for sentence in said.values())
    assert "no surface" in said["flat.obj"]
    picture = UserTexture(pool.textures[0].sha256).image()
    assert picture.shape == (30, 40, 3)
    skies = [UserEnvironment(asset.sha256).radiance() for asset in pool.environments]
    for sky in skies:
        assert sky.mean() == pytest.approx(0.5, rel=1e-3)
        assert sky.max() > 100 * np.median(sky)


def names(rng: np.random.Generator, count: int) -> dict[str, str]:
    return {f"{int(rng.integers(2**32)):08x}" + "0" * 56: f"{k}.obj" for k in range(count)}


def by_split(files: tuple[Asset, ...]) -> list[set[str]]:
    pool = AssetPool(meshes=files)
    return [{asset.sha256 for asset in pool.of_split(split).meshes} for split in ("train", "val", "test")]


def test_each_file_is_in_one_split_and_which_one_depends_on_its_content_only() -> None:
    files = names(RNG, 2000)
    pools = by_split(spread_over_splits(files))
    assert set.union(*pools) == files.keys()
    assert [round(len(pool) / len(files), 1) for pool in pools] == [0.8, 0.1, 0.1]
    assert not pools[0] & pools[1] | pools[0] & pools[2] | pools[1] & pools[2]


@pytest.mark.parametrize("count", [3, 4, 6, 9, 12, 30])
def test_few_files_are_spread_over_all_splits(count: int) -> None:
    """Among three files the hash alone leaves a split empty nine times of ten."""
    rng = np.random.default_rng(count)
    for _ in range(20):
        files = names(rng, count)
        pools = by_split(spread_over_splits(files))
        assert all(pools)
        assert len(pools[0]) >= count // 3
        assert set.union(*pools) == files.keys()
        assert spread_over_splits(dict(reversed(files.items()))) == spread_over_splits(files)


@pytest.mark.parametrize("before", [1, 2, 3, 5, 20])
def test_a_file_keeps_its_split_when_the_pool_grows(before: int) -> None:
    """What was trained on must not be tested on. By their number alone one of three files changed its split."""
    rng = np.random.default_rng(before)
    for _ in range(30):
        every = names(rng, before + int(rng.integers(1, 10)))
        first = spread_over_splits(dict(list(every.items())[:before]))
        grown = spread_over_splits(every, {asset.sha256: asset.split for asset in first})
        assert {*first} <= {*grown}
        assert len(grown) == len(every)
        if before > 1:
            assert all(by_split(grown)) or len(every) < 3


def test_a_split_without_files_is_refused_and_the_others_are_counted() -> None:
    files = spread_over_splits({f"{k:064x}": f"{k}.obj" for k in range(5)})
    one = AssetPool(meshes=spread_over_splits({"0" * 64: "0.obj"}))
    two = AssetPool(meshes=spread_over_splits({f"{k:064x}": f"{k}.obj" for k in range(2)}), textures=files)
    require_assets(one, ["train"])
    with pytest.raises(DatasetError, match="split test has none of the 1 files of --meshes"):
        require_assets(one, ["train", "test"])
    require_assets(two, ["train", "test"])
    with pytest.raises(DatasetError, match="split val has none of the 2 files of --meshes"):
        require_assets(two, ["val"])
    assert describe_splits(two) == [
        "meshes: 2 files, 1 train, 0 val, 1 test",
        "textures: 5 files, 3 train, 1 val, 1 test",
    ]


def test_the_share_of_the_user_s_files(imported: ImportedAssets) -> None:
    config = FAMILIES["driving"].config()
    counts = []
    for share in (0.1, None, 1.0):
        pool = replace(imported.pool, share=share)
        recipe = Recipe(config, {"train": 1}, assets=pool)
        scene = recipe.sample("train", 0)
        counts.append(sum(isinstance(thing.shape, UserMesh) for thing in scene.objects))
        assert ("\n  share: " in recipe_to_text(recipe)) == (share is not None)
        text, files = recipe_to_text(recipe).encode(), pool_to_text(pool).encode()
        assert recipe_from_text(text, "recipe", lambda files=files: files) == recipe
    assert counts[0] < counts[1] < counts[2]
    with pytest.raises(ValueError, match="above 0 and at most 1"):
        AssetPool(share=1.5)


def test_in_driving_parked_cars_are_replaced_as_a_whole(imported: ImportedAssets) -> None:
    """Props alone covered a thousandth of the pixels. The mesh stands where the wheels did, within the car's box."""
    recipe = Recipe(FAMILIES["driving"].config(), {"train": 1}, assets=replace(imported.pool, share=1.0))
    own = replace(recipe, assets=AssetPool())
    scenes = ((index, own.sample("train", index)) for index in range(9))
    index, before = next(
        found for found in scenes if any("parked" in thing.name for thing in found[1].objects)
    )
    after = {thing.name: thing for thing in recipe.sample("train", index).objects}
    assert not any(re.fullmatch(r"parked \S+ (body|wheels|glass)", name) for name in after)
    cars = {thing.name.removesuffix(" body") for thing in before.objects if thing.name.startswith("parked")}
    cars = {name for name in cars if name.count(" ") == 1}
    assert len(cars) > 5
    for name in cars:
        new = world_box([after[f"{name} of the user"]])
        old = world_box([thing for thing in before.objects if thing.name.startswith(f"{name} ")])
        assert new[0][2] == pytest.approx(old[0][2], abs=0.1)
        assert (new[0] >= old[0] - 0.5).all()
        assert (new[1] <= old[1] + 0.5).all()
        assert new[1][2] - new[0][2] > 0.5


def world_box(parts: list[SceneObject]) -> tuple[np.ndarray, np.ndarray]:
    vertices = []
    for part in parts:
        pose = part.motion.pose(0.0)
        vertices.append(part.shape.mesh().vertices * part.scale_m @ pose[:3, :3].T + pose[:3, 3])
    every = np.concatenate(vertices)
    return every.min(axis=0), every.max(axis=0)


def test_scenes_of_a_split_use_that_split_s_files(imported: ImportedAssets) -> None:
    config = FAMILIES["flying_things"].config(
        flying_objects=(15, 15), background_objects=(1, 1), user_share=0.8
    )
    recipe = Recipe(config, {"train": 1}, assets=imported.pool)
    for split in ("train", "val", "test"):
        scene = recipe.sample(split, 0)
        used = {thing.shape.sha256 for thing in scene.objects if isinstance(thing.shape, UserMesh)}
        allowed = {asset.sha256 for asset in imported.pool.of_split(split).meshes}
        assert used <= allowed
        assert bool(used) == bool(allowed)
        assert scene_from_json(scene_to_json(scene)) == scene
    assert Recipe(config, {"train": 1}).sample("train", 0).objects


@pytest.mark.parametrize("family", ["driving", "monkaa", "sintel"])
def test_every_family_takes_the_user_s_files_in_the_place_of_its_own(
    family: str, imported: ImportedAssets
) -> None:
    recipe = Recipe(FAMILIES[family].config(), {"train": 1})
    own = Recipe(recipe.world, {"train": 1}, assets=imported.pool)
    meshes, pictures, changed = set(), set(), 0
    for index in range(3):
        before, after = recipe.sample("train", index), own.sample("train", index)
        assert scene_from_json(scene_to_json(after)) == after
        pictures |= {m.color.sha256 for m in after.materials if isinstance(m.color, UserTexture)}
        whole = {thing.name: thing for thing in after.objects}
        kept = [(old, whole[old.name]) for old in before.objects if old.name in whole]
        assert len(kept) == len(whole) - sum(name.endswith("of the user") for name in whole)
        for old, new in kept:
            if not isinstance(new.shape, UserMesh):
                assert new == old
                continue
            meshes.add(new.shape.sha256)
            changed += 1
            inside, room = (thing.shape.mesh().vertices * thing.scale_m for thing in (new, old))
            offset = np.linalg.inv(old.motion.pose(0.0)) @ new.motion.pose(0.0)
            assert (np.abs(inside + offset[:3, 3]).max(axis=0) <= np.abs(room).max(axis=0) + 1e-6).all()
            assert (inside + offset[:3, 3])[:, 2].min() >= -np.abs(room[:, 2]).max() - 1e-6
    assert changed > 5
    assert meshes <= {asset.sha256 for asset in imported.pool.of_split("train").meshes}
    assert pictures
    assert pictures <= {asset.sha256 for asset in imported.pool.of_split("train").textures}


def crash_or_grow(path: Path) -> dict[str, np.ndarray]:
    if path.stem == "crash":
        ctypes.string_at(0)
    if path.stem == "greedy":
        return {"held": np.ones(1 << 28)}
    if path.stem == "slow":
        time.sleep(600)
    return {"fine": np.zeros(1)}


@pytest.mark.slow
def test_a_file_that_brings_its_reader_down_is_skipped(tmp_path: Path) -> None:
    for number, name in enumerate(("crash", "fine", "greedy", "slow")):
        (tmp_path / f"{name}.stl").write_bytes(bytes([number]))
    skipped: list[str] = []
    limits = Limits(timeout_s=2.0, memory_bytes=900 << 20)
    found = _FolderImport((".stl",), crash_or_grow, limits, tmp_path).run(tmp_path, skipped, [])
    assert [*found.values()] == ["fine.stl"]
    crash, greedy, slow = (sentence.removeprefix(f"{tmp_path}/") for sentence in skipped)
    assert crash == "crash.stl: cannot be read, its process crashed (SIGSEGV)"
    assert greedy.startswith("greedy.stl: ")
    assert "memory" in greedy or "used" in greedy
    assert slow == "slow.stl: cannot be read, ran longer than its limit of 2 s"


def test_what_a_store_has_is_not_prepared_again(tmp_path: Path) -> None:
    """An import that was interrupted, or of a folder that has grown, costs the new files only."""
    folder, store = tmp_path / "meshes", tmp_path / "store"
    folder.mkdir()
    for number in range(3):
        trimesh.creation.icosphere(1, 1.0 + number).export(folder / f"{number}.stl")
    first = import_assets(store, meshes=folder)
    before = {path.name: path.stat().st_mtime_ns for path in store.iterdir()}
    damaged = store / f"{first.pool.meshes[0].sha256}.npz"
    damaged.write_bytes(damaged.read_bytes()[:100])
    trimesh.creation.box().export(folder / "3.stl")
    told: list[tuple[str, int, int]] = []
    grown = import_assets(store, meshes=folder, known=first.pool, progress=lambda *state: told.append(state))
    assert told == [("meshes", 3, 4), ("meshes", 4, 4)], "the new file and the damaged one"
    assert {*first.pool.meshes} < {*grown.pool.meshes}
    after = {path.name: path.stat().st_mtime_ns for path in store.iterdir()}
    assert {name for name, time in before.items() if after[name] != time} == {damaged.name}


def test_pictures_of_large_cameras_and_panoramas_are_made_smaller(tmp_path: Path) -> None:
    """12,000 x 12,000 pixels of JPEG and 16,384 x 8,192 of HDR were refused."""
    side = 12_000
    photograph = np.zeros((side, side, 3), np.uint8)
    photograph[:, side // 2 :] = (10, 200, 60)
    assert cv2.imwrite(str(tmp_path / "photograph.jpg"), photograph[..., ::-1])
    image = prepare_texture(tmp_path / "photograph.jpg")["image"]
    assert image.shape == (MAX_SIDE_PX, MAX_SIDE_PX, 3)
    assert np.abs(image[::512, -1].astype(int) - (10, 200, 60)).max() < 8
    panorama = np.full((8192, 16_384, 3), 0.25, np.float32)
    assert cv2.imwrite(str(tmp_path / "sky.hdr"), panorama)
    radiance = prepare_environment(tmp_path / "sky.hdr")["radiance"]
    assert radiance.shape == (MAX_SIDE_PX // 2, MAX_SIDE_PX, 3)


def test_pictures_that_are_made_smaller_may_be_large(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """PNG files of more than 67 million pixels were refused, and above Pillow's limit all others."""
    rows = np.linspace(0, 255, 9000).astype(np.uint8)
    assert cv2.imwrite(str(tmp_path / "survey.png"), np.repeat(rows[:, None], 9000, axis=1))
    image = prepare_texture(tmp_path / "survey.png")["image"]
    assert image.shape == (MAX_SIDE_PX, MAX_SIDE_PX, 3)
    assert np.abs(image[:: MAX_SIDE_PX // 4, 0, 0] - (0, 64, 128, 191)).max() <= 1
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1000)
    Image.new("RGB", (90, 60), (10, 20, 200)).save(tmp_path / "small.bmp")
    assert prepare_texture(tmp_path / "small.bmp")["image"][0, 0].tolist() == [10, 20, 200]
    assert Image.MAX_IMAGE_PIXELS == 1000
    with pytest.raises(FormatError, match="more pixels"):
        read_picture(tmp_path / "small.bmp")


def test_fine_meshes_are_decimated(tmp_path: Path) -> None:
    trimesh.creation.icosphere(7).export(tmp_path / "ball.stl")  # 327,680 triangles.
    prepared = prepare_mesh(tmp_path / "ball.stl")
    assert len(prepared["triangles"]) <= MAX_TRIANGLES
    assert np.abs(np.linalg.norm(prepared["vertices"], axis=1) - 1).max() < 1e-3
    assert str(prepared["remark"]).startswith("its 327,680 triangles are decimated to ")


def test_draco_and_empty_files_are_called_by_their_name(tmp_path: Path) -> None:
    header = b'{"extensionsRequired": ["KHR_draco_mesh_compression"]}'
    start = struct.pack("<4sIII4s", b"glTF", 2, 20 + len(header), len(header), b"JSON")
    (tmp_path / "a.glb").write_bytes(start + header)
    (tmp_path / "b.stl").write_bytes(b"")
    trimesh.creation.box().export(tmp_path / "c.stl")
    skipped = import_assets(tmp_path / "store", meshes=tmp_path).skipped
    assert [sentence.removeprefix(f"{tmp_path}/") for sentence in skipped] == [
        "b.stl: is empty",
        "a.glb: cannot be read (it is compressed with Draco, which is not read here; export it without)",
    ]


def test_prepared_files_are_copied_whole_and_once(tmp_path: Path) -> None:
    sha256 = "0" * 64
    store, target = tmp_path / "store", tmp_path / "set" / "assets"
    store.mkdir()
    np.savez(store / f"{sha256}.npz", image=np.zeros((2, 2, 3), np.uint8))
    np.savez(store / f"{'1' * 64}.npz", image=np.zeros(1))  # of another data set
    pool = AssetPool(textures=(Asset("a.png", sha256, "train"),))
    copy_prepared(pool, store, target)
    assert [path.name for path in target.iterdir()] == [f"{sha256}.npz"]
    time = (target / f"{sha256}.npz").stat().st_mtime_ns
    copy_prepared(pool, store, target)
    assert (target / f"{sha256}.npz").stat().st_mtime_ns == time


def test_unknown_folders_and_files_are_refused(user: Path, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="there is no such folder"):
        import_assets(tmp_path / "store", meshes=tmp_path / "nowhere")
    with pytest.raises(DatasetError, match="no usable file"):
        import_assets(tmp_path / "store", textures=user / "environments")
    with pytest.raises(ValueError, match="in no store"):
        UserMesh("ab" * 32).mesh()
    for named in (UserMesh("../../etc/passwd").mesh, lambda: Asset("x", "../../etc/passwd", "train")):
        with pytest.raises(ValueError, match="named by its SHA-256"):
            named()


def test_a_data_set_carries_the_files_it_uses(
    user: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, recipe = tmp_path / "set", tmp_path / "recipe.yaml"
    recipe.write_text(
        "world: {family: flying_things, width: 96, height: 54, flying_objects: [6, 6], "
        "background_objects: [2, 2], background_materials: [2, 2], user_share: 1.0}\n"
        "scenes: {train: 1}\nsamples: 1\nseed: 1\n"
    )
    folders = {name: user / name for name in ("meshes", "textures", "environments")}
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    Render(out=str(out), recipe=recipe, workers=1, **folders).run()
    written = read_recipe(out / "recipe.yaml")
    assert len(written.assets.meshes) == 16
    statistics = read_manifest(Layout(out).manifest("train", 0)).statistics
    assert any(name.startswith("body_") for name in statistics["assets"])
    assert any(name.startswith("picture_") for name in statistics["assets"])
    record = json.loads(Layout(out).scene_record("train", 0).read_text())
    assert any(thing["shape"]["kind"] == "UserMesh" for thing in record["objects"])
    # Its recipe elsewhere lacks them, and is refused before anything is made.
    with pytest.raises(
        DatasetError, match="give the folders of your meshes, textures and environments again"
    ):
        render_dataset(written, tmp_path / "other")
    assert not (tmp_path / "other").exists()
    with pytest.raises(DatasetError, match="a folder, not a URL"):
        render_dataset(written, "memory://set")
    assert estimate_run(replace(written, scenes={"train": 2}), out).frames == 1
    # Elsewhere, and without the folders the files came from, the set is still whole.
    moved = out.rename(tmp_path / "moved")
    assert verify_dataset(moved, workers=1).problems == ()
    assert StereoDataset(moved, "train")[0].left.std() > 5
    # And behind a URL, and as shards.
    store = open_tree("memory://moved")
    for name in LocalTree(moved).files_below(""):
        store.write(name, (moved / name).read_bytes())
    monkeypatch.setattr("scenes.user_assets.pool._stores", [])
    assert verify_dataset("memory://moved").problems == ()
    shards = open_tree(tmp_path / "shards")
    EXPORTERS["webdataset"]([StereoDataset(moved, "train")], shards, ExportOptions(), lambda *_: None)
    assert read_recipe(tmp_path / "shards/recipe.yaml") == written


def test_a_split_without_files_is_refused_however_the_recipe_comes(
    imported: ImportedAssets, tmp_path: Path
) -> None:
    """The command checked the files of its flags only."""
    pool = AssetPool(meshes=spread_over_splits({imported.pool.meshes[0].sha256: "mine.obj"}))
    recipe = Recipe(FAMILIES["flying_things"].config(), {"train": 0, "test": 1}, assets=pool)
    write_recipe(tmp_path / "recipe.yaml", recipe)
    with pytest.raises(DatasetError, match="split test has none of the 1 files of --meshes"):
        Render(out=str(tmp_path / "set"), recipe=tmp_path / "recipe.yaml", workers=1).run()
    assert not (tmp_path / "set").exists()


def test_the_sun_of_half_floats_is_no_black_hole(tmp_path: Path) -> None:
    sky = np.full((16, 32), 0.5, np.float16)
    sky[3, 20], sky[4, 20], sky[5, 5], sky[6, 6] = np.inf, 900, np.nan, -np.inf
    (tmp_path / "skies").mkdir()
    OpenEXR.File({}, dict.fromkeys("RGB", sky)).write(str(tmp_path / "skies/sun.exr"))
    found = import_assets(tmp_path / "store", environments=tmp_path / "skies")
    assert found.remarks == (
        f"{tmp_path / 'skies/sun.exr'}: its infinite values are taken for 900, the brightest finite one",
    )
    again = import_assets(tmp_path / "store", environments=tmp_path / "skies")
    assert again == found, "said again where nothing is prepared again"
    use_store(tmp_path / "store")
    radiance = UserEnvironment(found.pool.environments[0].sha256).radiance()
    assert (radiance[3, 20] == radiance.max()).all()
    assert radiance[5, 5].max() == radiance[6, 6].max() == 0


@pytest.mark.parametrize(
    ("up_axis", "heights"),
    [("auto", {"obj": 0, "glb": 2}), ("y", {"obj": 2, "glb": 2}), ("z", {"obj": 0, "glb": 0})],
)
def test_meshes_stand_as_their_format_says(
    tmp_path: Path, up_axis: UpAxis, heights: dict[str, float]
) -> None:
    """A tall cone along y: upright where y points up, on its side where z does."""
    cone = trimesh.creation.cone(radius=0.3, height=2.0)
    cone.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))
    (tmp_path / "meshes").mkdir()
    for suffix in heights:
        cone.export(tmp_path / f"meshes/cone.{suffix}")
    found = import_assets(tmp_path / "store", meshes=tmp_path / "meshes", up_axis=up_axis)
    use_store(tmp_path / "store")
    for asset in found.pool.meshes:
        vertices = UserMesh(asset.sha256).mesh().vertices
        upright = np.ptp(vertices[:, 2]) > 1.9
        assert upright == (heights[asset.name.rpartition(".")[2]] > 0)
        if upright:  # Its tip is above.
            tip = vertices[np.argmax(vertices[:, 2])]
            assert np.abs(tip[:2]).max() < 0.01


def test_panoramas_may_be_jpeg_png_or_layered_exr(tmp_path: Path) -> None:
    levels = np.tile(np.linspace(20, 230, 64).astype(np.uint8)[None, :, None], (32, 1, 3))
    assert cv2.imwrite(str(tmp_path / "sky.png"), levels)
    radiance = prepare_environment(tmp_path / "sky.png")["radiance"]
    linear = ((levels / 255 + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(radiance / radiance[0, 0], linear / linear[0, 0], rtol=0.02)
    assert radiance.mean() == pytest.approx(0.5, rel=1e-3)
    assert cv2.imwrite(str(tmp_path / "wide.jpg"), np.tile(levels, (1, 3, 1)))
    assert "not 2:1" in str(prepare_environment(tmp_path / "wide.jpg")["remark"])
    plane = np.random.default_rng(0).uniform(0.1, 2, (32, 64)).astype(np.float32)
    layers = {f"ViewLayer.Normal.{c}": np.ones_like(plane) for c in "XYZ"}
    layers |= {f"ViewLayer.DiffCol.{c}": np.ones_like(plane) for c in "RGB"}
    layers |= {f"ViewLayer.Combined.{c}": plane * (1 + k) for k, c in enumerate("RGBA")}
    OpenEXR.File({}, layers).write(str(tmp_path / "layers.exr"))
    prepared = prepare_environment(tmp_path / "layers.exr")
    np.testing.assert_allclose(
        prepared["radiance"], np.stack([plane, 2 * plane, 3 * plane], -1) * (0.25 / plane.mean()), rtol=1e-4
    )
    assert "ViewLayer.Combined" in str(prepared["remark"])
    OpenEXR.File({}, {"Y": plane}).write(str(tmp_path / "grey.exr"))
    assert np.ptp(prepare_environment(tmp_path / "grey.exr")["radiance"], axis=2).max() == 0
    OpenEXR.File({}, {"Z": plane}).write(str(tmp_path / "depth.exr"))
    with pytest.raises(ValueError, match="no layer with R, G and B"):
        prepare_environment(tmp_path / "depth.exr")


def test_what_a_set_does_with_the_files_is_in_its_recipe(imported: ImportedAssets) -> None:
    settings = {"keep_materials": False, "keep_size": True, "environment_ev": -1.5}
    pool = replace(imported.pool, **settings)
    recipe = Recipe(FAMILIES["flying_things"].config(user_share=1.0), {"train": 1}, assets=pool)
    files = pool_to_text(pool).encode()
    assert pool_to_text(imported.pool) == pool_to_text(pool)
    assert recipe_from_text(recipe_to_text(recipe).encode(), "recipe", lambda: files) == recipe
    plain = replace(recipe, assets=imported.pool)
    assert "keep" not in recipe_to_text(plain)
    assert "environment_ev" not in recipe_to_text(plain)
    dim, usual = recipe.sample("train", 0).world, plain.sample("train", 0).world
    assert dim.strength == pytest.approx(usual.strength / 2**1.5)
    with pytest.raises(ValueError, match="within 20 stops"):
        replace(pool, environment_ev=float("nan"))


@pytest.mark.parametrize("family", ["flying_things", "driving", "indoor"])
def test_meshes_that_keep_their_size_are_as_large_as_their_files_say(family: str, tmp_path: Path) -> None:
    lengths = {"small": 0.2, "middling": 0.7, "large": 1.5, "tower": 60.0}
    (tmp_path / "meshes").mkdir()
    for k, (name, length) in enumerate(lengths.items()):
        trimesh.creation.box((length / 2, length / 2 + 1e-3 * k, length)).export(
            tmp_path / f"meshes/{name}.stl"
        )
    found = import_assets(tmp_path / "store", meshes=tmp_path / "meshes")
    use_store(tmp_path / "store")
    files = tuple(replace(asset, split="train") for asset in found.pool.meshes)
    name_of = {asset.sha256: asset.name.removesuffix(".stl") for asset in files}
    pool = AssetPool(meshes=files, keep_size=True, share=1.0)
    recipe = Recipe(FAMILIES[family].config(), {"train": 1}, assets=pool)
    shown = set()
    for index in range(3):
        scene = recipe.sample("train", index)
        for thing in scene.objects:
            if isinstance(thing.shape, UserMesh):
                name = name_of[thing.shape.sha256]
                shown.add(name)
                low, high = world_box(
                    [
                        replace(
                            thing,
                            motion=replace(
                                thing.motion,
                                rotations=((1.0, 0.0, 0.0, 0.0),) * len(thing.motion.times_frames),
                            ),
                        )
                    ]
                )
                assert high[2] - low[2] == pytest.approx(lengths[name], rel=1e-6)
                eye = scene.camera.pose("left", 0.0)[:3, 3]
                assert np.linalg.norm(thing.motion.pose(0.0)[:3, 3] - eye) > lengths[name] / 2
    assert "small" in shown
    assert ("tower" in shown) == (family == "flying_things"), "elsewhere it would stand in other things"


def test_meshes_that_share_a_texture_are_in_one_split(tmp_path: Path) -> None:
    """A network that learned the texture must not meet it again in the test."""
    folder = tmp_path / "meshes"
    folder.mkdir()
    for k in range(8):
        picture = np.random.default_rng(k // 2).integers(0, 255, (8, 8, 3), np.uint8)
        name = f"shared_{k // 2}.png"
        cv2.imwrite(str(folder / name), picture)
        ball = trimesh.creation.icosphere(1, 1.0 + k)
        uv = ball.vertices[:, :2] / (2.0 + 2 * k) + 0.5
        ball.visual = trimesh.visual.TextureVisuals(uv=uv, image=Image.open(folder / name))
        if k % 2:  # Embedded, the same picture is the same too.
            tree = json.loads(trimesh.exchange.gltf.export_gltf(trimesh.Scene(ball))["model.gltf"])
            files = trimesh.exchange.gltf.export_gltf(trimesh.Scene(ball))
            tree["images"] = [{"uri": name}]
            (folder / f"{k}.gltf").write_text(
                json.dumps(tree | {"buffers": [b | {"uri": f"{k}_{b['uri']}"} for b in tree["buffers"]]})
            )
            for buffer in tree["buffers"]:
                (folder / f"{k}_{buffer['uri']}").write_bytes(files[buffer["uri"]])
        else:
            lines = [f"mtllib {k}.mtl", "usemtl skin", *(f"v {x} {y} {z}" for x, y, z in ball.vertices)]
            lines += [
                *(f"vt {u} {v}" for u, v in uv),
                *(f"f {a}/{a} {b}/{b} {c}/{c}" for a, b, c in ball.faces + 1),
            ]
            (folder / f"{k}.obj").write_text("\n".join(lines))
            (folder / f"{k}.mtl").write_text(f"newmtl skin\nmap_Kd {name}\n")
    found = import_assets(tmp_path / "store", meshes=folder, textures=folder)
    assert found.skipped == ()
    split = {asset.name: asset.split for asset in (*found.pool.meshes, *found.pool.textures)}
    assert len(split) == 12
    for k in range(4):
        assert split[f"{2 * k}.obj"] == split[f"{2 * k + 1}.gltf"] == split[f"shared_{k}.png"]
    assert {*split.values()} == {"train", "val", "test"}
    use_store(tmp_path / "store")
    for asset in found.pool.meshes:
        (material,) = UserMesh(asset.sha256, own_materials=True).materials()
        assert material.color.image().shape == (8, 8, 3)
    # Another texture under the same name makes another mesh.
    cv2.imwrite(str(folder / "shared_0.png"), np.zeros((8, 8, 3)))
    again = import_assets(tmp_path / "store", meshes=folder)
    changed = {asset.name for asset in {*again.pool.meshes} - {*found.pool.meshes}}
    assert {"0.obj", "1.gltf"} <= changed
    before = {asset.sha256 for asset in found.pool.meshes}
    assert sum(asset.sha256 not in before for asset in again.pool.meshes) == 2
