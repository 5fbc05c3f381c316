"""Reading a data set: a sequence of stereo samples whose arrays are read at first use."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from datagen.dataset.integrity import compare
from datagen.dataset.layout import RENDER_PASSES, SPLITS, VIEWS, Direction, Layout, View
from datagen.dataset.manifest import FileEntry, read_manifest
from datagen.dataset.remote_cache import open_remote
from datagen.errors import DatasetError
from datagen.formats import (
    read_cameras,
    read_depth,
    read_flow,
    read_gradient,
    read_mask,
    read_normals,
    read_occlusion,
    read_pfm,
    read_png,
)
from datagen.formats.impossible_disparity import ImpossibleShare
from datagen.formats.limits import MAX_JSON_BYTES, read_bounded
from datagen.formats.png import read_png_size
from scenes import Scene, scene_from_json
from scenes.user_assets.pool import use_store
from stereoforge_kit.errors import InputError
from stereoforge_kit.files import LocalTree, open_tree, temporary_folder


@dataclass(frozen=True)
class SampleView:
    """The arrays of one view of a sample; shapes and meanings are those of `StereoSample`."""

    image: NDArray[np.uint8]
    disparity: NDArray[np.float32]
    gradient: NDArray[np.float32]
    gradient_valid: NDArray[np.bool_]
    occlusion: NDArray[np.uint8]
    object_index: NDArray[np.uint16]


@dataclass(frozen=True)
class StereoSample:
    """One frame of a scene: both views with their ground truth.

    An array is read at its first use and kept as long as the sample. Reading raises DatasetError, naming the file,
    for a file that is missing, differs from its SHA-256 in the scene's manifest, or does not have the size of the
    left image.
    """

    layout: Layout
    split: str
    scene: int
    frame: int
    """The frame's number on disk."""
    render_pass: str = "clean"
    """Which images are read, "clean" or "final"."""

    @property
    def name(self) -> str:
        """Split, scene and frame, for example `TEST/A/0003/0006`."""
        left = self.layout.file(self._image_kind, self.split, self.scene, "left", self.frame)
        split, group, scene, _, _ = left.parts[-5:]
        return "/".join((split, group, scene, left.stem))

    @property
    def scene_name(self) -> str:
        """Split and scene, for example `TEST/A/0003`."""
        return self.name.rpartition("/")[0]

    @cached_property
    def size(self) -> tuple[int, int]:
        """(height, width) in pixels, from the header of the left image."""
        return read_png_size(self._file(self._image_kind, "left"))

    @cached_property
    def left(self) -> NDArray[np.uint8]:
        """(H, W, 3) sRGB."""
        return self._image("left")

    @cached_property
    def right(self) -> NDArray[np.uint8]:
        """(H, W, 3) sRGB."""
        return self._image("right")

    @cached_property
    def disparity_left(self) -> NDArray[np.float32]:
        """(H, W) pixels, x_right = x_left - d; NaN invalid, 0 infinitely far unless the principal points differ."""
        return self._disparity("left")

    @cached_property
    def disparity_right(self) -> NDArray[np.float32]:
        """(H, W) pixels, x_left = x_right + d; NaN invalid, 0 infinitely far unless the principal points differ."""
        return self._disparity("right")

    @property
    def impossible_left(self) -> ImpossibleShare:
        """None: these disparities are exact, and a file that was changed is found by its SHA-256."""
        return ImpossibleShare()

    @property
    def gradient_left(self) -> NDArray[np.float32]:
        """(H, W, 2) forward differences of the disparity, [dx, dy]."""
        return self._gradient_left[0]

    @property
    def gradient_right(self) -> NDArray[np.float32]:
        """(H, W, 2) forward differences of the disparity, [dx, dy]."""
        return self._gradient_right[0]

    @property
    def gradient_valid_left(self) -> NDArray[np.bool_]:
        """(H, W) True where the gradient exists and is no discontinuity."""
        return self._gradient_left[1]

    @property
    def gradient_valid_right(self) -> NDArray[np.bool_]:
        """(H, W) True where the gradient exists and is no discontinuity."""
        return self._gradient_right[1]

    @cached_property
    def occlusion_left(self) -> NDArray[np.uint8]:
        """(H, W) 0 visible in the right view, 1 occluded there, 2 out of its frame."""
        return self._occlusion("left")

    @cached_property
    def occlusion_right(self) -> NDArray[np.uint8]:
        """(H, W) 0 visible in the left view, 1 occluded there, 2 out of its frame."""
        return self._occlusion("right")

    @cached_property
    def object_index_left(self) -> NDArray[np.uint16]:
        """(H, W) 0 sky, else 1 + index in the scene's objects."""
        return self._object_index("left")

    @cached_property
    def object_index_right(self) -> NDArray[np.uint16]:
        """(H, W) 0 sky, else 1 + index in the scene's objects."""
        return self._object_index("right")

    @property
    def foreground_left(self) -> NDArray[np.uint16] | None:
        """None: the object index numbers all objects, and none of them is the foreground."""
        return None

    def view(self, view: View) -> SampleView:
        """All arrays of the "left" or "right" view. Raises ValueError for another name."""
        if view not in VIEWS:
            raise InputError(f"a view is 'left' or 'right', not {view!r}")
        return SampleView(
            image=getattr(self, view),
            disparity=getattr(self, f"disparity_{view}"),
            gradient=getattr(self, f"gradient_{view}"),
            gradient_valid=getattr(self, f"gradient_valid_{view}"),
            occlusion=getattr(self, f"occlusion_{view}"),
            object_index=getattr(self, f"object_index_{view}"),
        )

    def material_index(self, view: View) -> NDArray[np.uint16]:
        """(H, W) 0 sky, else 1 + index in the scene's materials.

        This method and those below read their file at each call. They raise DatasetError for a data set that was
        rendered without the target.
        """
        return self._extra("material_index", view, read_png, (), np.uint16)

    def depth(self, view: View) -> NDArray[np.float32]:
        """(H, W) metres along the optical axis, infinite for the sky."""
        return self._extra("depth", view, read_depth, (), np.float32)

    def reflective(self, view: View) -> NDArray[np.uint8]:
        """(H, W) 255 where the surface is glossy, metallic or transparent, else 0."""
        return self._extra("reflective", view, read_png, (), np.uint8)

    def normals(self, view: View) -> NDArray[np.float32]:
        """(H, W, 3) unit normals in the camera's frame (x right, y up, z towards the camera), 0 for the sky."""
        return self._extra("normals", view, read_normals, (3,), np.float32)

    def flow(self, view: View, direction: Direction) -> NDArray[np.float32]:
        """(H, W, 2) optical flow in px [to the right, down] to the next or the previous frame; NaN invalid."""
        return self._extra("optical_flow", view, read_flow, (2,), np.float32, direction)

    def disparity_change(self, view: View, direction: Direction) -> NDArray[np.float32]:
        """(H, W) px by which the disparity of a pixel's point grows until that frame; NaN invalid."""
        return self._extra("disparity_change", view, read_pfm, (), np.float32, direction)

    def motion_boundaries(self, view: View, direction: Direction) -> NDArray[np.bool_]:
        """(H, W) True where objects that move differently meet."""
        return self._extra("motion_boundaries", view, read_mask, (), np.bool_, direction)

    @cached_property
    def cameras(self) -> dict[str, dict[str, NDArray[np.float64]]]:
        """Each view's `K` (3, 3), `world_to_camera` and `camera_to_world` (4, 4), in OpenCV's convention and metres."""
        path = self.intact(self.layout.file("cameras", self.split, self.scene))
        try:
            views = read_cameras(path)["frames"][str(self.frame)]
            return {view: {name: np.array(one) for name, one in views[view].items()} for view in VIEWS}
        except (KeyError, TypeError, AttributeError) as error:
            raise DatasetError(f"{path}: has no cameras of frame {self.frame}") from error

    @cached_property
    def scene_record(self) -> Scene:
        """The world that was rendered, with its camera."""
        return read_scene(self.intact(self.layout.scene_record(self.split, self.scene)))

    @property
    def evaluated_files(self) -> tuple[Path, ...]:
        """The files that an evaluation on the left view reads: both images, its disparity and its occlusion."""
        wanted: tuple[tuple[str, View], ...] = (
            (self._image_kind, "left"),
            (self._image_kind, "right"),
            ("disparity", "left"),
            ("occlusion", "left"),
        )
        return tuple(
            self.layout.file(kind, self.split, self.scene, view, self.frame) for kind, view in wanted
        )

    def has(self, path: Path) -> bool:
        """Whether the scene's manifest has a file, as those of targets that were asked for and rendered."""
        return self.layout.relative(path) in self._entries

    def intact(self, path: Path) -> Path:
        """Compare one of the scene's files with the manifest and return its path.

        Raises DatasetError for a file that is missing, damaged or not in the manifest.
        """
        entry = self._entries.get(self.layout.relative(path))
        if entry is None:
            raise DatasetError(f"{path}: is not in the scene's manifest")
        _, problem = compare(self.layout, entry)
        if problem:
            raise DatasetError(f"{path}: {problem}; verify --repair renders it again")
        return path

    @cached_property
    def _entries(self) -> dict[str, FileEntry]:
        manifest = read_manifest(self.layout.local(self.layout.manifest(self.split, self.scene)))
        return {entry.path: entry for entry in manifest.files}

    @cached_property
    def _gradient_left(self) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        return self._gradient("left")

    @cached_property
    def _gradient_right(self) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        return self._gradient("right")

    @property
    def _image_kind(self) -> str:
        return RENDER_PASSES[self.render_pass]

    def _file(self, kind: str, view: View, direction: Direction | None = None) -> Path:
        return self.intact(self.layout.file(kind, self.split, self.scene, view, self.frame, direction))

    def _image(self, view: View) -> NDArray[np.uint8]:
        path = self._file(self._image_kind, view)
        image = read_png(path)
        self._check(path, image, (*self.size, 3), np.uint8)
        return image  # type: ignore[return-value]

    def _disparity(self, view: View) -> NDArray[np.float32]:
        path = self._file("disparity", view)
        disparity = read_pfm(path)
        self._check(path, disparity, self.size, np.float32)
        return disparity

    def _gradient(self, view: View) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        path = self._file("disparity_gradient", view)
        gradient, valid = read_gradient(path)
        self._check(path, gradient, (*self.size, 2), np.float32)
        return gradient, valid

    def _occlusion(self, view: View) -> NDArray[np.uint8]:
        path = self._file("occlusion", view)
        labels = read_occlusion(path)
        self._check(path, labels, self.size, np.uint8)
        return labels

    def _object_index(self, view: View) -> NDArray[np.uint16]:
        path = self._file("object_index", view)
        index = read_png(path)
        self._check(path, index, self.size, np.uint16)
        return index  # type: ignore[return-value]

    def _extra(
        self,
        kind: str,
        view: View,
        read: Callable[[Path], NDArray[Any]],
        channels: tuple[int, ...],
        dtype: type,
        direction: Direction | None = None,
    ) -> NDArray[Any]:
        path = self._file(kind, view, direction)
        values = read(path)
        self._check(path, values, (*self.size, *channels), dtype)
        return values

    def _check(self, path: Path, array: NDArray[Any], shape: tuple[int, ...], dtype: type) -> None:
        if array.shape != shape or array.dtype != dtype:
            raise DatasetError(
                f"{path}: holds {array.shape} of {array.dtype} where the left image's size asks for "
                f"{shape} of {np.dtype(dtype)}"
            )


class StereoDataset(Sequence[StereoSample]):
    """The frames of all finished scenes of one split, in order, as `StereoSample`s."""

    def __init__(self, root: Path | str, split: str, render_pass: str = "clean") -> None:
        """Find the frames; no array is read yet.

        Args:
            root: The data set's folder, or a URL; files behind a URL are copied to a cache at first use.
            split: "train", "val" or "test".
            render_pass: Which images to read, "clean" or "final".

        Raises:
            DatasetError: For a folder that is missing or no data set, a split without a finished scene, a
                damaged manifest, or a pass that was not rendered.
        """
        if render_pass not in RENDER_PASSES:
            raise DatasetError(
                f"there is no render pass {render_pass!r}; there are {', '.join(RENDER_PASSES)}"
            )
        layout = open_layout(root)
        scenes = layout.committed_scenes(split)
        if not scenes:
            raise DatasetError(f"{layout.root}: has no finished {split} scene{_splits_present(layout)}")
        self.layout, self.split, self.render_pass = layout, split, render_pass
        self._frames = [(scene, frame) for scene in scenes for frame in self._frames_of(scene)]

    def __len__(self) -> int:
        return len(self._frames)

    @overload
    def __getitem__(self, index: int) -> StereoSample: ...

    @overload
    def __getitem__(self, index: slice) -> list[StereoSample]: ...

    def __getitem__(self, index: int | slice) -> StereoSample | list[StereoSample]:
        if isinstance(index, slice):
            return [self._sample(*frame) for frame in self._frames[index]]
        return self._sample(*self._frames[index])

    def __repr__(self) -> str:
        return f"StereoDataset({str(self.layout.root)!r}, {self.split!r}): {len(self)} frames"

    def _sample(self, scene: int, frame: int) -> StereoSample:
        return StereoSample(self.layout, self.split, scene, frame, self.render_pass)

    def _frames_of(self, scene: int) -> list[int]:
        """The numbers of a scene's frames, as its manifest lists their left images."""
        manifest = self.layout.manifest(self.split, scene)
        folder = self.layout.scene_folder(RENDER_PASSES[self.render_pass], self.split, scene) / "left"
        prefix = f"{self.layout.relative(folder)}/"
        names = (entry.path for entry in read_manifest(self.layout.local(manifest)).files)
        numbers = [Path(name).stem for name in names if name.startswith(prefix)]
        if not all(number.isascii() and number.isdigit() and len(number) < 10 for number in numbers):
            raise DatasetError(f"{manifest}: lists a left image whose name is no number")
        frames = sorted(map(int, numbers))
        if not frames:
            raise DatasetError(f"{manifest}: lists no image of the {self.render_pass} pass")
        return frames


def open_layout(root: Path | str) -> Layout:
    """The layout of an existing data set, in a folder or behind a URL.

    Raises DatasetError for a folder that is missing or no data set.
    """
    tree = open_tree(root)
    if not isinstance(tree, LocalTree):
        return open_remote(tree)
    layout = Layout(tree.root)
    if not layout.root.is_dir():
        what = "is a file, not a folder" if layout.root.exists() else "there is no such folder"
        raise DatasetError(f"{layout.root}: {what}")
    if not layout.recipe.is_file():
        raise DatasetError(f"{layout.root}: is not a data set, it has no {layout.recipe.name}")
    return layout


@contextmanager
def opened_layout(root: Path | str) -> Iterator[Layout]:
    """The layout of a folder, or that of a URL with a cache that is removed afterwards. Raises DatasetError."""
    tree = open_tree(root)
    if isinstance(tree, LocalTree):
        yield open_layout(root)
        return
    with temporary_folder() as folder:
        yield open_remote(tree, folder)


def read_scene(path: Path) -> Scene:
    """Read a Scene record of a data set. Raises DatasetError for a file that is missing or no such record."""
    use_store(Layout(path.parents[3]).assets)
    try:
        return scene_from_json(read_bounded(path, MAX_JSON_BYTES).decode("utf-8"))
    except DatasetError:
        raise
    except (ValueError, RecursionError) as error:
        raise DatasetError(f"{path}: is not a scene ({error})") from error


def _splits_present(layout: Layout) -> str:
    counts = {split: len(layout.committed_scenes(split)) for split in SPLITS}
    present = " and ".join(f"{count} {split}" for split, count in counts.items() if count)
    return f"; there are {present}" if present else " and none of another split"
