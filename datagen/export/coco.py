"""Instance masks as COCO has them: run-length encoded, one JSON file for each split.

    annotations/instances_train.json

Each view of each frame is an image, whose `file_name` is its path in the data set. Each object that it shows is an
annotation; its category is the kind of its shape, and `name` is what the Scene record calls it. pycocotools encodes the
masks and reads the files.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from datagen.dataset.layout import RENDER_PASSES, VIEWS, View
from datagen.dataset.samples import StereoDataset, StereoSample
from datagen.errors import DatasetError
from scenes import Scene
from stereoforge_kit.files import Tree


def export_coco(sets: Sequence[StereoDataset], out: Tree, progress: Callable[[int, int], None]) -> None:
    """Write the instance masks of both views of every frame.

    Args:
        sets: One data set for each split.
        out: The folder or URL to write to.
        progress: Called with (frames done, frames in all).

    Raises:
        DatasetError: For damaged files, and without pycocotools.
    """
    try:
        from pycocotools import mask
    except ImportError as error:
        raise DatasetError("COCO's masks need pycocotools: pip install 'stereoforge[coco]'") from error
    categories = _categories(sets)
    total, done = sum(map(len, sets)), 0
    for frames in sets:
        with out.writing(f"annotations/instances_{frames.split}.json") as path, path.open("w") as file:
            json.dump({"images": _images(frames), "categories": _described(categories)}, file)
            file.seek(
                file.tell() - 1
            )  # Over the closing bracket: the annotations of a large set fit no memory.
            file.write(', "annotations": [')
            number = 0
            for index, sample in enumerate(frames):
                for k, view in enumerate(VIEWS):
                    for annotation in _annotations(sample, view, categories, mask):
                        number += 1
                        _append(
                            file, {"id": number, "image_id": 2 * index + k + 1, **annotation}, number == 1
                        )
                done += 1
                progress(done, total)
            file.write("]}\n")


def _append(file: IO[str], annotation: dict[str, Any], is_first: bool) -> None:
    file.write("\n" if is_first else ",\n")
    json.dump(annotation, file)


def _kind(scene: Scene, index: int) -> str:
    """The category of an object, by its number from 1."""
    return type(scene.objects[index - 1].shape).__name__


def _categories(sets: Sequence[StereoDataset]) -> dict[str, int]:
    """The number of each category, the same in every split."""
    kinds: set[str] = set()
    for frames in sets:
        seen = None
        for sample in frames:
            if sample.scene != seen:
                seen = sample.scene
                kinds |= {type(thing.shape).__name__ for thing in sample.scene_record.objects}
    return {kind: number for number, kind in enumerate(sorted(kinds), start=1)}


def _described(categories: dict[str, int]) -> list[dict[str, Any]]:
    return [{"id": number, "name": kind, "supercategory": "shape"} for kind, number in categories.items()]


def _images(frames: StereoDataset) -> list[dict[str, Any]]:
    found = []
    for index, sample in enumerate(frames):
        for k, view in enumerate(VIEWS):
            kind = RENDER_PASSES[sample.render_pass]
            path = sample.layout.file(kind, sample.split, sample.scene, view, sample.frame)
            height, width = sample.size
            found.append(
                {
                    "id": 2 * index + k + 1,
                    "file_name": sample.layout.relative(path),
                    "width": width,
                    "height": height,
                }
            )
    return found


def _annotations(
    sample: StereoSample, view: View, categories: dict[str, int], mask: Any
) -> Iterator[dict[str, Any]]:
    index: NDArray[np.uint16] = getattr(sample, f"object_index_{view}")
    scene = sample.scene_record
    for number in np.unique(index).tolist():
        if number == 0:
            continue
        if number > len(scene.objects):
            raise DatasetError(
                f"{sample.name}: object index {number} is beyond the scene's {len(scene.objects)} objects"
            )
        code = mask.encode(np.asfortranarray(index == number, np.uint8))
        yield {
            "category_id": categories[_kind(scene, number)],
            "name": scene.objects[number - 1].name,
            "segmentation": {"size": code["size"], "counts": code["counts"].decode("ascii")},
            "area": int(mask.area(code)),
            "bbox": mask.toBbox(code).tolist(),
            "iscrowd": 0,
        }
