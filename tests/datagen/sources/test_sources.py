"""Every reader on files in the published encoding: values, signs, rows, holes, labels; and the choice of reader."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import fsspec
import numpy as np
import pytest
from PIL import Image

from datagen import DatasetError, StereoDataset
from datagen.dataset.shards import CACHE_VARIABLE
from datagen.export import EXPORTERS, ExportOptions
from datagen.formats import read_pfm, write_pfm
from datagen.ground_truth.from_disparity import derive_occlusion
from datagen.sources.registry import DataSource, open_source, source_formats
from datagen.sources.webdataset import scene_of
from stereoforge_kit.files import open_tree
from tests.datagen.sources import published
from tests.datagen.sources.published import World, png, shard, shard_members, world

SETS: dict[str, Callable[[Path], World]] = {
    name: getattr(published, name.replace("-", "_"))
    for name in (
        "flyingthings3d", "flyingthings3d-subset", "driving", "monkaa", "sintel", "kitti2012", "kitti2015",
        "middlebury", "eth3d", "middlebury2003", "middlebury2006", "crestereo", "webdataset",
    )
}  # fmt: skip
WITH_RIGHT_TRUTH = {
    "flyingthings3d", "flyingthings3d-subset", "driving", "monkaa", "middlebury", "middlebury2003", "middlebury2006",
    "crestereo", "webdataset",
}  # fmt: skip
DERIVED_LABELS = WITH_RIGHT_TRUTH - {"middlebury", "webdataset"}
GREY = {"eth3d"}
JPEG_TOLERANCE = 60
"""Of single pixels of noise, which JPEG hardly keeps."""


@pytest.mark.parametrize("name", SETS)
def test_frame(name: str, tmp_path: Path) -> None:
    """Recognised without being told, and every array means in memory what docs/conventions.md says."""
    w = SETS[name](tmp_path / "set")
    source = open_source(tmp_path / "set")
    assert source.format.name == name
    frames = source.frames("train")
    assert len(frames) == 1
    frame = frames[0]
    assert frame.size == (published.HEIGHT, published.WIDTH)
    expected_images = [np.repeat(i[..., :1], 3, axis=2) if name in GREY else i for i in (w.left, w.right)]
    for image, expected in zip((frame.left, frame.right), expected_images, strict=True):
        assert image.dtype == np.uint8
        error = np.abs(image.astype(int) - expected).mean()
        assert error == 0 or (name == "crestereo" and error < JPEG_TOLERANCE)

    truth = holes(name, w.disparity_left)
    np.testing.assert_array_equal(frame.disparity_left, truth)
    assert frame.disparity_left.dtype == np.float32
    if name in WITH_RIGHT_TRUTH:
        right = w.disparity_right.copy()
        if name in ("middlebury2003", "middlebury2006"):
            right[0] = np.nan
        np.testing.assert_array_equal(frame.disparity_right, right)
    else:
        assert frame.disparity_right is None

    valid = ~np.isnan(truth)
    assert frame.occlusion_left is not None
    certain = valid & ~w.silhouette if name in DERIVED_LABELS else valid
    assert (w.occlusion_left[certain] == 1).any()
    np.testing.assert_array_equal(frame.occlusion_left[certain], w.occlusion_left[certain])
    both = valid[:-1, :-1] & valid[:-1, 1:] & valid[1:, :-1]
    smooth = both & (np.abs(np.diff(truth, axis=1)[:-1]) <= 1) & (np.abs(np.diff(truth, axis=0)[:, :-1]) <= 1)
    np.testing.assert_array_equal(frame.gradient_valid_left[:-1, :-1], smooth)
    np.testing.assert_array_equal(
        frame.gradient_left[:-1, :-1, 1][smooth], np.diff(truth, axis=0)[:, :-1][smooth]
    )
    assert np.isfinite(frame.gradient_left).all()


def holes(name: str, truth: np.ndarray) -> np.ndarray:
    """The truth with NaN where the set leaves it out."""
    truth = truth.copy()
    if name.startswith("kitti"):
        truth[::2] = np.nan
    elif name in ("middlebury", "eth3d", "middlebury2003", "middlebury2006"):
        truth[0] = np.nan
    return truth


def test_every_format_is_tested() -> None:
    formats = {name.removesuffix("-final") for name in source_formats()}
    assert formats == set(SETS) | {
        "native",
        "folder",
        "list",
    }  # the last two in tests/datagen/sources/own_data


def test_final_passes(tmp_path: Path) -> None:
    w = published.flyingthings3d(tmp_path)
    frame = open_source(f"flyingthings3d-final:{tmp_path}").frames("train")[0]
    np.testing.assert_array_equal(frame.right, w.left)


SCENES = {
    "flyingthings3d": "TRAIN/B/0017",
    "flyingthings3d-subset": "train/0000017",
    "driving": "driving",
    "monkaa": "eating",
    "sintel": "alley_1",
    "kitti2012": "000003_10",
    "kitti2015": "000003_10",
    "middlebury": "Adirondack",
    "eth3d": "delivery_area",
    "middlebury2003": "cones",
    "middlebury2006": "Aloe",
    "crestereo": "tree/0a1b",
    "webdataset": "train-0000",
}


@pytest.mark.parametrize("name", SETS)
def test_a_frame_says_which_scene_it_is_of(name: str, tmp_path: Path) -> None:
    SETS[name](tmp_path)
    assert open_source(tmp_path).frames("train")[0].scene_name == SCENES[name]


@pytest.mark.parametrize(
    ("folders", "scenes"),
    [
        (
            ["Piano", "PianoL", "Classroom2", "Classroom2E", "Teddy"],
            ["Piano"] * 2 + ["Classroom"] * 2 + ["Teddy"],
        ),
        (["Sword1-perfect", "Sword1-imperfect", "Mask-perfect"], ["Sword", "Sword", "Mask"]),
        (["chess1", "chess2", "artroom1"], ["chess", "chess", "artroom"]),
        (["trainingQ/ArtL", "trainingF/ArtL"], ["Art", "Art"]),
        (["0001", "0002", "room_12", "room_13"], ["0001", "0002", "room_12", "room_13"]),
    ],
)
def test_pictures_of_one_middlebury_scene(folders: list[str], scenes: list[str], tmp_path: Path) -> None:
    published.middlebury(tmp_path / "set")
    for folder in folders:
        shutil.copytree(tmp_path / "set/trainingQ/Adirondack", tmp_path / "other" / folder)
    found = {frame.name: frame.scene_name for frame in open_source(tmp_path / "other").frames("test")}
    assert found == dict(zip(folders, scenes, strict=True))


@pytest.mark.parametrize(
    ("key", "scene"),
    [
        ("train-0003-0006", "train-0003"),
        ("test-12345-0007", "test-12345"),
        ("000042", "000042"),
        ("kitchen-3", "kitchen-3"),
        ("kitchen/0003", "kitchen"),
    ],
)
def test_scenes_of_shards_keys(key: str, scene: str) -> None:
    assert scene_of(key) == scene


def test_monkaas_folders_show_eight_worlds(tmp_path: Path) -> None:
    published.monkaa(tmp_path)
    more = (
        "eating_naked_camera2_x2",
        "lonetree_difftex2_x2",
        "lonetree_winter_x2",
        "funnyworld_camera2_augmented1_x2",
    )
    for folder in ("disparity", "frames_cleanpass"):
        for name in more:
            shutil.copytree(tmp_path / folder / "eating_x2", tmp_path / folder / name)
    found = [frame.scene_name for frame in open_source(tmp_path).frames("test")]
    assert found == ["eating", "eating", "funnyworld", "lonetree", "lonetree"]


@pytest.mark.parametrize("name", ["flyingthings3d", "driving", "monkaa", "sintel"])
def test_a_tree_with_the_final_pass_alone_is_read_by_it(name: str, tmp_path: Path) -> None:
    w = SETS[name](tmp_path)
    for clean in sorted(tmp_path.glob("**/*clean*")):
        final = clean.with_name(clean.name.replace("clean", "final"))
        if final.exists():
            shutil.rmtree(final)
        clean.rename(final)
    source = open_source(tmp_path)
    assert source.format.name == f"{name}-final"
    frame = source.frames("test")[0]
    np.testing.assert_array_equal(frame.left, w.left)
    np.testing.assert_array_equal(frame.right, w.right)


def test_a_set_of_ours_with_the_final_pass_alone_is_read_by_it(tmp_path: Path) -> None:
    """What `render --passes final` leaves, and what it leaves with both passes or before the first scene is done."""
    (tmp_path / "recipe.yaml").write_text("")
    assert open_source(tmp_path).format.name == "native"
    (tmp_path / "frames_finalpass").mkdir()
    assert open_source(tmp_path).format.name == "native-final"
    (tmp_path / "frames_cleanpass").mkdir()
    assert open_source(tmp_path).format.name == "native"


def test_sceneflow_errors_of_the_set_are_missing(tmp_path: Path) -> None:
    """Negative disparities among positive ones, and those beyond the image's width, mark no point."""
    w = published.monkaa(tmp_path)
    truth = w.disparity_left.copy()
    truth[0, :3] = (-5, 1000, np.inf)
    published.pfm(tmp_path / "disparity/eating_x2/left/0000.pfm", truth)
    got = open_source(tmp_path).frames("test")[0].disparity_left
    assert np.isnan(got[0, :3]).all()
    assert np.isnan(got).sum() == 3


@pytest.mark.parametrize(("width", "scale"), [(450, 4), (900, 2), (1800, 1)])
def test_middlebury_2003_scales_go_with_the_resolution(width: int, scale: int, tmp_path: Path) -> None:
    code = np.full((4, width), 88, np.uint8)
    code[0] = 0
    for name in ("im2", "im6"):
        png(tmp_path / f"teddy/{name}.png", np.zeros((4, width, 3), np.uint8))
    png(tmp_path / "teddy/disp2.png", code)
    truth = open_source(tmp_path).frames("test")[0].disparity_left
    assert np.isnan(truth[0]).all()
    assert (truth[1:] == 88 / scale).all()


@pytest.mark.parametrize(
    ("folder", "width", "scale"),
    [
        ("", 1240, 1),
        ("", 690, 2),
        ("", 413, 3),
        ("FullSize", 60, 1),
        ("HalfSize", 60, 2),
        ("ThirdSize", 60, 3),
    ],
)
def test_middlebury_2006_scales_go_with_the_size(folder: str, width: int, scale: int, tmp_path: Path) -> None:
    code = np.full((4, width), 45, np.uint8)
    code[0] = 0
    scene = tmp_path / folder / "Art"
    for name in ("view1", "view5"):
        png(scene / f"{name}.png", np.zeros((4, width, 3), np.uint8))
    png(scene / "disp1.png", code)
    truth = open_source(tmp_path).frames("test")[0].disparity_left
    assert np.isnan(truth[0]).all()
    assert (truth[1:] == 45 / scale).all()


def test_middlebury_2006_with_all_lights_and_exposures(tmp_path: Path) -> None:
    published.middlebury2006(tmp_path)
    scene = tmp_path / "ThirdSize/Aloe"
    for light in ("Illum1/Exp0", "Illum3/Exp2"):
        (scene / light).mkdir(parents=True)
        for name in ("view1.png", "view5.png"):
            shutil.copy(scene / name, scene / light)
    for name in ("view1.png", "view5.png"):
        (scene / name).unlink()
    frames = open_source(tmp_path).frames("test")
    assert [(frame.name, frame.scene_name) for frame in frames] == [
        ("ThirdSize/Aloe/Illum1/Exp0", "Aloe"),
        ("ThirdSize/Aloe/Illum3/Exp2", "Aloe"),
    ]
    assert np.isfinite(frames[1].disparity_left).any()


@pytest.mark.parametrize("folder", ["", "_webp"])
@pytest.mark.parametrize("name", ["flyingthings3d", "flyingthings3d-subset", "driving", "monkaa"])
def test_sceneflow_in_webp(name: str, folder: str, tmp_path: Path) -> None:
    w = SETS[name](tmp_path)
    for path in list(tmp_path.rglob("*.png")):
        target = Path(
            str(path).replace("pass/", f"pass{folder}/").replace("image_clean/", f"image_clean{folder}/")
        )
        target.parent.mkdir(parents=True, exist_ok=True)
        Image.open(path).save(target.with_suffix(".webp"), lossless=True)
        path.unlink()
    for images in ("frames_cleanpass", "frames_finalpass", "train/image_clean", "val/image_clean"):
        if folder:
            shutil.rmtree(tmp_path / images, ignore_errors=True)
    source = open_source(tmp_path)
    assert source.format.name == name
    np.testing.assert_array_equal(source.frames("train")[0].left, w.left)
    np.testing.assert_array_equal(source.frames("train")[0].right, w.right)


def test_kitti_tells_its_cars_from_the_background(tmp_path: Path) -> None:
    w = published.kitti2015(tmp_path)
    cars = open_source(tmp_path).frames("test")[0].foreground_left
    assert cars is not None
    np.testing.assert_array_equal(cars, np.where(w.disparity_left > 10, 3, 0))


def test_the_object_index_of_shards_is_no_foreground(tmp_path: Path) -> None:
    w = published.webdataset(tmp_path)
    frame = open_source(tmp_path).frames("train")[0]
    np.testing.assert_array_equal(frame.object_index_left, w.disparity_left > 10)
    assert frame.foreground_left is None


def test_splits(tmp_path: Path) -> None:
    published.flyingthings3d(tmp_path / "flying")
    source = open_source(tmp_path / "flying")
    assert [source.frames(split)[0].name for split in ("train", "test")] == [
        "TRAIN/B/0017/0009",
        "TEST/B/0017/0009",
    ]
    assert list(source.validation_frames()) == []
    assert source.held_out_frames()[0].name.startswith("TEST")
    with pytest.raises(DatasetError, match="FlyingThings3D has no split 'val'"):
        source.frames("val")


def test_selection(tmp_path: Path) -> None:
    w = world()
    folder = tmp_path / "training"
    for index in range(5):
        for name in ("image_2", "image_3"):
            png(folder / f"{name}/{index:06d}_10.png", w.left)
        png(folder / f"disp_occ_0/{index:06d}_10.png", np.full((12, 40), 256, np.uint16))
    names = [frame.name for frame in open_source(f"{tmp_path}#1-3").frames("train")]
    assert names == ["000001_10", "000002_10", "000003_10"]
    assert len(open_source(f"kitti2015:{tmp_path}#0-0").frames("train")) == 1
    assert open_source(tmp_path).frames("train")[0].occlusion_left is None
    with pytest.raises(DatasetError, match=r"frames 3 to 5 were asked for, it has 5 \(from 0\)"):
        open_source(f"{tmp_path}#3-5").frames("train")


def test_wrong_sources_are_sentences(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"nothing: there is no such folder"):
        open_source(tmp_path / "nothing")
    with pytest.raises(
        DatasetError, match="looks like no data set of a known layout; name the format in front"
    ):
        open_source(tmp_path)
    with pytest.raises(DatasetError, match="has no frame with ground truth in the layout of KITTI 2015"):
        open_source(f"kitti2015:{tmp_path}").frames("train")
    with pytest.raises(DatasetError, match=f"^{tmp_path}/gone: there is no such folder$"):
        open_source(f"kitti2015:{tmp_path}/gone")
    with pytest.raises(DatasetError, match=r"gone\.tar: there is no such file$"):
        open_source(f"webdataset:{tmp_path}/gone.tar")
    with pytest.raises(DatasetError, match=r"there is no format kiti2015; there are .*kitti2015") as caught:
        open_source(f"kiti2015:{tmp_path}")
    assert len(str(caught.value)) < 300
    with pytest.raises(DatasetError, match="say what is there, for example webdataset:s3://bucket/set"):
        open_source("s3://bucket/set")
    published.kitti2015(tmp_path / "a")
    published.sintel(tmp_path / "a")
    with pytest.raises(DatasetError, match="looks like KITTI 2015 and MPI Sintel"):
        open_source(tmp_path / "a")


def test_the_home_folder_after_a_format(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    published.kitti2015(tmp_path / "sets/kitti")
    for source in ("kitti2015:~/sets/kitti", "~/sets/kitti", "kitti2015:~/sets/kitti#0-0"):
        assert len(open_source(source).frames("train")) == 1
    with pytest.raises(DatasetError, match="~nobody-at-all/x: there is no such folder"):
        open_source("kitti2015:~nobody-at-all/x")


@pytest.mark.parametrize(
    ("name", "file", "reason"),
    [
        ("kitti2015", "training/disp_occ_0/000003_10.png", "16-bit grey PNG"),
        ("crestereo", "tree/0a1b_left.disp.png", "16-bit grey PNG"),
        ("sintel", "training/disparities/alley_1/frame_0001.png", "8-bit colour PNG"),
    ],
)
def test_other_encodings_are_refused(name: str, file: str, reason: str, tmp_path: Path) -> None:
    SETS[name](tmp_path)
    png(tmp_path / file, np.zeros((12, 40), np.uint8))
    with pytest.raises(DatasetError, match=reason):
        _ = open_source(tmp_path).frames("train")[0].disparity_left


def problem_of(root: Path) -> str | None:
    """What is said of a set's first frame, None if all of it can be read."""
    try:
        frame = open_source(root).frames("train")[0]
        for attribute in ("left", "right", "disparity_left", "disparity_right", "occlusion_left"):
            getattr(frame, attribute)
    except DatasetError as error:
        return str(error)
    return None


@pytest.mark.parametrize("name", SETS)
def test_damaged_files_are_sentences(name: str, tmp_path: Path) -> None:
    """Every file cut short: an error that names it, never an array."""
    SETS[name](tmp_path)
    for path in [path for path in tmp_path.rglob("*") if path.is_file()]:
        whole = path.read_bytes()
        path.write_bytes(whole[: len(whole) // 3])
        problem = problem_of(tmp_path)
        if problem is None:
            untouched = ("disp_occ_1", "_11.png", "image_0", "final", "TEST", "obj_map", "/val/")
            assert any(part in str(path) for part in untouched), path
        else:
            assert path.name in problem
            assert "\n" not in problem
        path.write_bytes(whole)


def test_views_of_other_sizes_are_refused(tmp_path: Path) -> None:
    published.monkaa(tmp_path)
    png(tmp_path / "frames_cleanpass/eating_x2/right/0000.png", np.zeros((12, 41, 3), np.uint8))
    frame = open_source(tmp_path).frames("train")[0]
    with pytest.raises(DatasetError, match="its right image is 41x12, its left image 40x12"):
        _ = frame.right


def test_derived_occlusion_of_the_right_view() -> None:
    """The mirrored world's left labels are the right labels mirrored."""
    w = world()
    right = derive_occlusion("right", w.disparity_right, w.disparity_left)
    mirrored = derive_occlusion("left", w.disparity_right[:, ::-1], w.disparity_left[:, ::-1])
    np.testing.assert_array_equal(right[:, ::-1], mirrored)


class TestShards:
    """Samples in tar files, at any URL."""

    @staticmethod
    def samples() -> dict[str, dict[str, dict[str, bytes]]]:
        """Two shards of three and two samples, and one of another split."""
        return {
            "train-000000.tar": {f"train-0000-{i:04d}": shard_members(world(i)) for i in range(3)},
            "train-000001.tar": {f"train-0001-{i:04d}": shard_members(world(3 + i)) for i in range(2)},
            "val-000000.tar": {"val-0000-0000": shard_members(world(9))},
        }

    @pytest.fixture
    def url(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
        monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
        system = fsspec.filesystem("memory")
        folder = f"/{tmp_path.name}"
        for name, samples in self.samples().items():
            system.pipe_file(f"{folder}/{name}", shard(samples))
        return f"memory:/{folder}"

    def check(self, source: DataSource) -> None:
        frames = source.frames("train")
        assert [frame.name for frame in frames] == [
            *(f"train-0000-{i:04d}" for i in range(3)),
            *(f"train-0001-{i:04d}" for i in range(2)),
        ]
        for index in (4, 0, 2):
            np.testing.assert_array_equal(frames[index].left, world(index).left)
        assert [frame.name for frame in source.frames("val")] == ["val-0000-0000"]

    def test_url_without_index(self, url: str) -> None:
        self.check(open_source(f"webdataset:{url}"))

    def test_url_with_index_fetches_what_is_read(self, url: str, tmp_path: Path) -> None:
        names = {name: list(samples) for name, samples in self.samples().items()}
        fsspec.filesystem("memory").pipe_file(
            f"{url.removeprefix('memory:/')}/index.json", json.dumps({"shards": names}).encode()
        )
        frames = open_source(f"webdataset:{url}").frames("train")
        assert len(frames) == 5
        assert not (tmp_path / "cache").exists()
        _ = frames[4].left
        assert [path.name for path in (tmp_path / "cache").rglob("*.tar")] == ["train-000001.tar"]
        assert frames.groups == [3, 2]  # type: ignore[attr-defined]
        assert frames[1:4].groups == [2, 1]  # type: ignore[attr-defined]
        self.check(open_source(f"webdataset:{url}"))

    @pytest.mark.parametrize("indexed", [False, True])
    @pytest.mark.parametrize("folder", ["wds[v1]", "wds{a,b}", "wds*", "wds?"])
    def test_a_folder_s_name_is_no_pattern(self, folder: str, indexed: bool, tmp_path: Path) -> None:
        place = tmp_path / folder
        place.mkdir()
        for name, samples in self.samples().items():
            (place / name).write_bytes(shard(samples))
        if indexed:
            names = {name: list(samples) for name, samples in self.samples().items()}
            (place / "index.json").write_text(json.dumps({"shards": names}))
        for source in (f"webdataset:{place}", str(place)):
            self.check(open_source(source))
        for pattern in ("train-{000000..000001}.tar", "*.tar", "{train-000000,train-000001,val-000000}.tar"):
            assert len(open_source(f"webdataset:{place}/{pattern}").frames("train")) == 5

    @pytest.mark.parametrize(
        ("pattern", "count"),
        [
            ("train-{000000..000001}.tar", 5),
            ("train-{000001..000001}.tar", 2),
            ("train-00000[1-9].tar", 2),
            ("*.tar", 5),
            ("{train,val}-000000.tar", 3),
        ],
    )
    def test_shards_are_named_as_webdataset_names_them(self, url: str, pattern: str, count: int) -> None:
        assert len(open_source(f"webdataset:{url}/{pattern}").frames("train")) == count

    def test_shards_that_are_named_and_not_there_are_sentences(self, url: str, tmp_path: Path) -> None:
        with pytest.raises(DatasetError, match=r"train-000002\.tar"):
            open_source(f"webdataset:{url}/train-{{000000..000002}}.tar").frames("train")
        (tmp_path / "mine.tar").write_bytes(shard({}))
        with pytest.raises(DatasetError, match=r"mine\.tar: is not named after its split"):
            open_source(f"webdataset:{tmp_path}/*.tar").frames("train")
        with pytest.raises(DatasetError, match="more than 1000000 files"):
            open_source(f"webdataset:{tmp_path}/train-{{000000..999999999}}.tar").frames("train")

    def test_a_damaged_index_and_a_missing_bucket_are_sentences(self, url: str) -> None:
        fsspec.filesystem("memory").pipe_file(f"{url.removeprefix('memory:/')}/index.json", b'{"shards": 3}')
        with pytest.raises(DatasetError, match=r"index\.json: is not an index of shards"):
            open_source(f"webdataset:{url}").frames("train")
        with pytest.raises(
            DatasetError, match="no frame with ground truth in the layout of WebDataset shards"
        ):
            open_source("webdataset:memory://nothing/here").frames("train")


def test_linked_folders_are_not_lost(tmp_path: Path) -> None:
    """Two of CREStereo's four folders on another disk; only `Path.rglob` of Python 3.13 follows links."""
    published.crestereo(tmp_path / "set")
    shutil.copytree(tmp_path / "set/tree", tmp_path / "set/hole")
    for name in ("reflective", "shapenet"):
        shutil.copytree(tmp_path / "set/tree", tmp_path / "disk" / name)
        (tmp_path / "set" / name).symlink_to(tmp_path / "disk" / name)
    names = [frame.name for frame in open_source(tmp_path / "set").frames("test")]
    assert names == ["hole/0a1b", "reflective/0a1b", "shapenet/0a1b", "tree/0a1b"]


@pytest.mark.parametrize("name", SETS)
def test_droppings_are_no_frames(name: str, tmp_path: Path) -> None:
    """What macOS and Windows leave beside every file, and what an archive made on macOS has in it."""
    SETS[name](tmp_path)
    before = [frame.name for frame in open_source(tmp_path).frames("train")]
    for path in [path for path in tmp_path.rglob("*") if path.is_file()]:
        path.with_name(f"._{path.name}").write_bytes(b"Mac OS X")
        (path.parent / ".DS_Store").write_bytes(b"Bud1")
        (path.parent / "Thumbs.db").write_bytes(b"")
        (path.parent / "desktop.ini").write_bytes(b"")
    shutil.copytree(tmp_path, tmp_path / "__MACOSX")
    source = open_source(tmp_path)
    assert (source.format.name, [frame.name for frame in source.frames("train")]) == (name, before)
    assert problem_of(tmp_path) is None


@pytest.mark.parametrize("name", ["flyingthings3d", "monkaa", "middlebury", "eth3d"])
def test_endings_in_upper_case_and_three_channels(name: str, tmp_path: Path) -> None:
    SETS[name](tmp_path)
    before = open_source(tmp_path).frames("train")[0].disparity_left
    for path in list(tmp_path.rglob("*.pfm")):
        write_pfm(path.with_suffix(".PFM"), np.repeat(read_pfm(path)[..., None], 3, axis=2))
        path.unlink()
    np.testing.assert_array_equal(open_source(tmp_path).frames("train")[0].disparity_left, before)


def test_droppings_in_shards_are_no_samples(tmp_path: Path) -> None:
    members = shard_members(world())
    samples = {"./train-0000-0006": members, "./._train-0000-0006": members, ".DS_Store": {"x": b""}}
    (tmp_path / "train-000000.tar").write_bytes(shard(samples))
    assert [frame.name for frame in open_source(tmp_path).frames("train")] == ["train-0000-0006"]


def test_frames_do_not_pile_up(tmp_path: Path) -> None:
    """A frame keeps what it has read, the list of frames does not."""
    published.monkaa(tmp_path)
    frames = open_source(tmp_path).frames("train")
    frame = frames[0]
    assert frame.left is frame.left
    assert frames[0] is not frame
    assert not {"left", "disparity_left"} & vars(frames[0]).keys()


def test_a_split_without_frames_is_told_from_a_set_without_any(
    analytic_dataset: Path, tmp_path: Path
) -> None:
    """Shards without a test split were said to have no frame in the layout of shards."""
    sets = [StereoDataset(analytic_dataset, "train")]
    EXPORTERS["webdataset"](sets, open_tree(tmp_path / "wds"), ExportOptions(), lambda *_: None)
    shards = tmp_path / "wds/*.tar"
    for location in (tmp_path / "wds", shards):
        with pytest.raises(DatasetError, match="has no test frames; there are 4 train"):
            open_source(f"webdataset:{location}").frames("test")
    with pytest.raises(DatasetError, match=r"there is no such file; of shards write webdataset:.*/\*\.tar"):
        open_source(str(shards))
