"""Data sets as other projects' trainers take them: dictionaries of tensors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import Dataset

from datagen.sources.registry import open_source
from training.errors import TrainingError

STEREO_TOOLBOX = {"left": "ref", "right": "tgt", "disparity": "gt_disp", "visible": "noc_mask"}
"""The keys of stereo-toolbox."""
GWCNET = {"left": "left", "right": "right", "disparity": "disparity"}
"""The keys of PSMNet's, GwcNet's and many later trainers."""
OPENSTEREO = {"left": "left", "right": "right", "disparity": "disp"}
"""The keys of OpenStereo."""
IMAGENET_MEAN = (0.485, 0.456, 0.406)
IMAGENET_DEVIATION = (0.229, 0.224, 0.225)
"""By which most of these trainers normalise images."""


class TrainerDataset(Dataset[dict[str, Tensor]]):
    """A data set of ours, or of any source that is read, for somebody else's training loop.

    Each item has, under the names that `keys` gives them,

    - left, right: (3, H, W) float32, 0..1 or normalised;
    - disparity: (H, W) float32 px, `unknown` where there is none;
    - visible: (H, W) float32, 1 where a pixel of the left view is seen in the right one too, else 0.

    Examples:
        dataset = TrainerDataset("data", crop=(256, 512), keys=GWCNET, normalized=True)
        loader = torch.utils.data.DataLoader(dataset, batch_size=4, shuffle=True)
    """

    def __init__(
        self,
        location: Path | str,
        split: str = "train",
        *,
        crop: tuple[int, int] | None = None,
        keys: Mapping[str, str] = STEREO_TOOLBOX,
        normalized: bool = False,
        unknown: float = 0.0,
    ) -> None:
        """Open the data set.

        Args:
            location: As `datagen.sources.registry.open_source` takes it.
            split: train, val or test.
            crop: (height, width) of random crops; None gives whole frames.
            keys: What the items' entries are called; those that it leaves out are not made.
            normalized: Subtract ImageNet's mean colour and divide by its deviation.
            unknown: What stands for a disparity that is not known.

        Raises:
            DatasetError: the location is no data set, or the split is empty.
            TrainingError: unknown entries, frames smaller than the crop, or a set that does not know what is visible.
        """
        if strange := sorted(set(keys) - set(STEREO_TOOLBOX)):
            raise TrainingError(f"there is no {strange[0]} to name; there are {', '.join(STEREO_TOOLBOX)}")
        self.frames = open_source(location).frames(split)
        self.crop, self.keys, self.normalized, self.unknown = crop, dict(keys), normalized, unknown
        height, width = self.frames[0].size
        if crop is not None and (crop[0] > height or crop[1] > width):
            raise TrainingError(
                f"{location}: frames of {width}x{height} are smaller than crops of {crop[1]}x{crop[0]}"
            )
        if "visible" in keys and self.frames[0].occlusion_left is None:
            raise TrainingError(f"{location}: does not know which pixels are visible in both views")

    def __len__(self) -> int:
        """How many frames there are."""
        return len(self.frames)

    def __getitem__(self, index: int) -> dict[str, Tensor]:
        """A frame, or a crop of it at a random place.

        The place comes from torch's global generator, which a DataLoader seeds anew in each of its workers.
        """
        frame = self.frames[index]
        cut = self._place(*frame.size)
        entries: dict[str, Any] = {}
        for name in self.keys:
            if name in ("left", "right"):
                entries[name] = self._image(getattr(frame, name)[cut])
            elif name == "disparity":
                entries[name] = np.nan_to_num(frame.disparity_left[cut], nan=self.unknown)
            else:
                entries[name] = (np.asarray(frame.occlusion_left)[cut] == 0).astype(np.float32)
        return {self.keys[name]: torch.from_numpy(np.ascontiguousarray(e)) for name, e in entries.items()}

    def _place(self, height: int, width: int) -> tuple[slice, slice]:
        if self.crop is None:
            return slice(height), slice(width)
        starts = [
            int(torch.randint(whole - part + 1, ()))
            for whole, part in zip((height, width), self.crop, strict=True)
        ]
        return slice(starts[0], starts[0] + self.crop[0]), slice(starts[1], starts[1] + self.crop[1])

    def _image(self, picture: NDArray[np.uint8]) -> NDArray[np.float32]:
        image = picture.astype(np.float32) / 255
        if self.normalized:
            image = (image - np.array(IMAGENET_MEAN, np.float32)) / np.array(IMAGENET_DEVIATION, np.float32)
        return np.asarray(image.transpose(2, 0, 1))
