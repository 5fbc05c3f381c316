"""Reading a data set: a sequence of stereo samples whose arrays are read when they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from datagen.dataset.integrity import compare
from datagen.dataset.layout import EYES, RENDER_PASSES, SPLITS, Direction, Eye, Layout
from datagen.dataset.manifest import FileEntry, read_manifest
from datagen.dataset.remote_cache import open_mirror
from datagen.errors import DatasetError
from datagen.formats import (
    read_flow,
    read_gradient,
    read_mask,
    read_normals,
    read_occlusion,
    read_pfm,
    read_png,
)
from datagen.formats.limits import MAX_JSON_BYTES, read_bounded
from datagen.formats.png import read_png_size
from scenes import Scene, scene_from_json
from scenes.user_assets.pool import use_store
from stereoforge_kit.files import LocalTree, open_tree


@dataclass(frozen=True)
class EyeView:
    """What one eye of a sample sees; shapes and meanings are those of `StereoSample`."""

    image: NDArray[np.uint8]
    disparity: NDArray[np.float32]
    gradient: NDArray[np.float32]
    gradient_valid: NDArray[np.bool_]
    occlusion: NDArray[np.uint8]
    object_index: NDArray[np.uint16]


@dataclass(frozen=True)
class StereoSample:
    """One frame of a scene. Every array is read at its first use and kept as long as the sample is.

    Reading raises DatasetError, naming the file, for one that is missing, not the one that the scene's manifest
    describes by its SHA-256, or not of the size of the left image.
    """

    layout: Layout
    split: str
    scene: int
    frame: int
    """The frame's number on disk."""
    render_pass: str = "clean"

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
        """(H, W) pixels, x_right = x_left - d; NaN invalid, 0 infinitely far."""
        return self._disparity("left")

    @cached_property
    def disparity_right(self) -> NDArray[np.float32]:
        """(H, W) pixels, x_left = x_right + d; NaN invalid, 0 infinitely far."""
        return self._disparity("right")

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
        """(H, W) where the gradient exists and is no discontinuity."""
        return self._gradient_left[1]

    @property
    def gradient_valid_right(self) -> NDArray[np.bool_]:
        """(H, W) where the gradient exists and is no discontinuity."""
        return self._gradient_right[1]

    @cached_property
    def occlusion_left(self) -> NDArray[np.uint8]:
        """(H, W) 0 visible in the right image, 1 occluded, 2 out of its frame."""
        return self._occlusion("left")

    @cached_property
    def occlusion_right(self) -> NDArray[np.uint8]:
        """(H, W) 0 visible in the left image, 1 occluded, 2 out of its frame."""
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
        """None: the object index numbers everything, and none of it is called the foreground."""
        return None

    def view(self, eye: Eye) -> EyeView:
        """Everything of the "left" or "right" eye."""
        if eye not in EYES:
            raise ValueError(f"an eye is 'left' or 'right', not {eye!r}")
        return EyeView(
            image=getattr(self, eye),
            disparity=getattr(self, f"disparity_{eye}"),
            gradient=getattr(self, f"gradient_{eye}"),
            gradient_valid=getattr(self, f"gradient_valid_{eye}"),
            occlusion=getattr(self, f"occlusion_{eye}"),
            object_index=getattr(self, f"object_index_{eye}"),
        )

    def material_index(self, eye: Eye) -> NDArray[np.uint16]:
        """(H, W) 0 sky, else 1 + index in the scene's materials. Needs the target, as the methods below do;
        what they return is read anew at each call."""
        return self._extra("material_index", eye, read_png, (), np.uint16)

    def normals(self, eye: Eye) -> NDArray[np.float32]:
        """(H, W, 3) unit vectors in the camera's frame (x right, y up, z back), 0 for the sky."""
        return self._extra("normals", eye, read_normals, (3,), np.float32)

    def flow(self, eye: Eye, direction: Direction) -> NDArray[np.float32]:
        """(H, W, 2) px [right, down] to where the pixel's point is one frame on; NaN invalid."""
        return self._extra("optical_flow", eye, read_flow, (2,), np.float32, direction)

    def disparity_change(self, eye: Eye, direction: Direction) -> NDArray[np.float32]:
        """(H, W) px the disparity of the pixel's point grows by until one frame on; NaN invalid."""
        return self._extra("disparity_change", eye, read_pfm, (), np.float32, direction)

    def motion_boundaries(self, eye: Eye, direction: Direction) -> NDArray[np.bool_]:
        """(H, W) where objects that move differently meet."""
        return self._extra("motion_boundaries", eye, read_mask, (), np.bool_, direction)

    @cached_property
    def scene_record(self) -> Scene:
        """The world that was rendered, with its camera."""
        return read_scene(self.intact(self.layout.scene_record(self.split, self.scene)))

    def intact(self, path: Path) -> Path:
        """A path of one of the scene's files, compared with its manifest. Raises DatasetError."""
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

    def _file(self, kind: str, eye: Eye, direction: Direction | None = None) -> Path:
        return self.intact(self.layout.file(kind, self.split, self.scene, eye, self.frame, direction))

    def _image(self, eye: Eye) -> NDArray[np.uint8]:
        path = self._file(self._image_kind, eye)
        image = read_png(path)
        self._check(path, image, (*self.size, 3), np.uint8)
        return image  # type: ignore[return-value]

    def _disparity(self, eye: Eye) -> NDArray[np.float32]:
        path = self._file("disparity", eye)
        disparity = read_pfm(path)
        self._check(path, disparity, self.size, np.float32)
        return disparity

    def _gradient(self, eye: Eye) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        path = self._file("disparity_gradient", eye)
        gradient, valid = read_gradient(path)
        self._check(path, gradient, (*self.size, 2), np.float32)
        return gradient, valid

    def _occlusion(self, eye: Eye) -> NDArray[np.uint8]:
        path = self._file("occlusion", eye)
        labels = read_occlusion(path)
        self._check(path, labels, self.size, np.uint8)
        return labels

    def _object_index(self, eye: Eye) -> NDArray[np.uint16]:
        path = self._file("object_index", eye)
        index = read_png(path)
        self._check(path, index, self.size, np.uint16)
        return index  # type: ignore[return-value]

    def _extra(
        self,
        kind: str,
        eye: Eye,
        read: Callable[[Path], NDArray[Any]],
        channels: tuple[int, ...],
        dtype: type,
        direction: Direction | None = None,
    ) -> NDArray[Any]:
        path = self._file(kind, eye, direction)
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
    """The frames of all finished scenes of one split, in order; a scene without its manifest is not there."""

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

    Raises DatasetError for a folder that is missing or is none.
    """
    tree = open_tree(root)
    if not isinstance(tree, LocalTree):
        return open_mirror(tree)
    layout = Layout(tree.root)
    if not layout.root.is_dir():
        raise DatasetError(f"{layout.root}: there is no such folder")
    if not layout.recipe.is_file():
        raise DatasetError(f"{layout.root}: is not a data set, it has no {layout.recipe.name}")
    return layout


def read_scene(path: Path) -> Scene:
    """Read a Scene record of a data set. Raises DatasetError for one that is missing or describes no scene."""
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
