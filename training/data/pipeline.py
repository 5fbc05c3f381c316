"""Stereo data sets as a stream of training crops and a list of validation frames.

Every crop of a run has a number, its draw. The frame that a draw takes and its augmentation follow from the seed and
that number alone. So results depend neither on the number of workers nor on where a run was interrupted.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytorch_lightning as pl
import torch
from numpy.typing import NDArray
from torch.utils.data import DataLoader, Dataset

from datagen.formats.impossible_disparity import ImpossibleShare
from datagen.sources.ground_truth import mean_share
from datagen.sources.registry import DataSource, open_source
from datagen.sources.stereo_frame import StereoFrame
from datagen.sources.webdataset import ShardFrames
from training.data.augmentation import IDENTITY_CURVE, StereoPair, TrainingSample, Window, augment, cut
from training.data.batch import StereoBatch
from training.data.fingerprint import data_fingerprint
from training.data.sampling import CROP_MULTIPLE, SamplingConfig
from training.errors import TrainingError

DEFAULT_CACHE_BYTES = 2 << 30
"""Memory for decoded frames, 2 GiB."""
IMAGE_MEAN_FRAMES = 100
"""Frames over which a regressor's mean colour is measured."""
SHARDS_TOGETHER = 8
"""Shards that are drawn from at the same time."""
CURRICULUM_PARTS = 10
"""A curriculum adds a tenth of every data set at a time."""


@dataclass(frozen=True)
class Source:
    """A data set that is trained on."""

    frames: Sequence[StereoFrame]
    """The frames to train on."""
    weight: float = 1.0
    """How often it is drawn from, relative to the other sources' weights."""
    fingerprint: str = ""
    """What identifies the frames (`training.data.fingerprint`)."""
    remarks: tuple[str, ...] = ()
    """What the user should know of how the frames were found and read."""


def read_pair(frame: StereoFrame) -> StereoPair:
    """Decode the images and the ground truth of a frame. Raises DatasetError for damaged files."""
    return StereoPair(frame.left, frame.right, frame.disparity_left, frame.disparity_right)


class PairCache:
    """The decoded frames of all sources; the first of them stay in memory, up to a number of bytes.

    It is filled before worker processes are forked, so that they share it.
    """

    def __init__(self, sources: Sequence[Source], capacity_bytes: int = DEFAULT_CACHE_BYTES) -> None:
        self._sources = sources
        self._pairs: dict[tuple[int, int], StereoPair] = {}
        self._shares: list[list[ImpossibleShare]] = [[] for _ in sources]
        for key in self._interleaved():
            frame = sources[key[0]].frames[key[1]]
            pair = read_pair(frame)
            self._shares[key[0]].append(frame.impossible_left)
            capacity_bytes -= pair.nbytes
            if capacity_bytes < 0:
                break
            self._pairs[key] = pair

    def __len__(self) -> int:
        return len(self._pairs)

    def __getitem__(self, key: tuple[int, int]) -> StereoPair:
        """The pair of the index (source, frame), from memory or decoded."""
        pair = self._pairs.get(key)
        return read_pair(self._sources[key[0]].frames[key[1]]) if pair is None else pair

    def impossible_shares(self) -> list[ImpossibleShare]:
        """How much of each source's ground truth cannot be, over the frames that were decoded for the memory."""
        return [mean_share(shares) for shares in self._shares]

    def name(self, source: int, frame: int) -> str:
        """The name of a frame, for messages."""
        return self._sources[source].frames[frame].name

    def first(self, count: int) -> Iterator[StereoPair]:
        """The first `count` pairs, taken from all sources in turn."""
        return (self[key] for key in itertools.islice(self._interleaved(), count))

    def _interleaved(self) -> Iterator[tuple[int, int]]:
        longest = max(len(source.frames) for source in self._sources)
        for frame in range(longest):
            for index, source in enumerate(self._sources):
                if frame < len(source.frames):
                    yield index, frame


def schedule_draws(
    sources: Sequence[Source], draws: int, seed: int, curriculum: float = 0.0
) -> NDArray[np.int64]:
    """Decide which frame each draw takes: sources by their weights, frames in a new order in every pass.

    Without a curriculum, a longer schedule begins with the shorter one. Shards are taken a few at a time, so that
    remote ones can be fetched during the run.

    Args:
        sources: The data sets.
        draws: Number of draws.
        seed: Decides everything.
        curriculum: Share (0..1) of the draws, from the first, that take frames of a growing first part of every source,
            in the source's own order.

    Returns:
        (draws, 2): source and frame.
    """
    weights = np.array([source.weight for source in sources], np.float64)
    rng = np.random.default_rng([seed, 0])
    chosen = np.searchsorted(np.cumsum(weights / weights.sum())[:-1], rng.random(draws), side="right")
    parts = np.arange(1, CURRICULUM_PARTS)
    ends = np.rint(draws * curriculum * parts / parts[-1]).astype(int)
    schedule = np.empty((draws, 2), np.int64)
    for index, source in enumerate(sources):
        places = np.flatnonzero(chosen == index)
        order = np.random.default_rng([seed, 1, index])
        frames = [
            _passes(order, source.frames, share, len(stage))
            for share, stage in zip(
                np.append(parts, CURRICULUM_PARTS) / CURRICULUM_PARTS,
                np.split(places, np.searchsorted(places, ends)),
                strict=True,
            )
        ]
        schedule[places, 0] = index
        schedule[places, 1] = np.concatenate(frames)
    return schedule


def _passes(
    rng: np.random.Generator, frames: Sequence[StereoFrame], share: float, count: int
) -> NDArray[np.int64]:
    """The indices of `count` frames: passes over the first `share` of all, each in a new order."""
    first = math.ceil(len(frames) * share)
    passes = [np.empty(0, np.int64)]
    for _ in range(-(-count // first)):
        order = shuffle(rng, frames)
        passes.append(order[order < first])
    return np.concatenate(passes)[:count]


def shuffle(rng: np.random.Generator, frames: Sequence[StereoFrame]) -> NDArray[np.int64]:
    """A random order of the frames, (N,) indices. Shards are used up `SHARDS_TOGETHER` at a time."""
    if not isinstance(frames, ShardFrames):
        return rng.permutation(len(frames))
    shards = np.split(np.arange(len(frames)), np.cumsum(frames.groups)[:-1])
    shards = [shards[place] for place in rng.permutation(len(shards))]
    return np.concatenate(
        [
            rng.permutation(np.concatenate(shards[first : first + SHARDS_TOGETHER]))
            for first in range(0, len(shards), SHARDS_TOGETHER)
        ]
    )


class CropDataset(Dataset[StereoBatch]):
    """The augmented crops of a run, by the numbers of their draws."""

    def __init__(
        self,
        cache: PairCache,
        schedule: NDArray[np.int64],
        sampling: SamplingConfig,
        seed: int,
        draws_per_step: int,
    ) -> None:
        self._cache = cache
        self._schedule = schedule
        self._sampling = sampling
        self._seed = seed
        self._draws_per_step = draws_per_step

    def __getitem__(self, draw: int) -> StereoBatch:
        source, frame = (int(number) for number in self._schedule[draw])
        size = (self._sampling.crop_height, self._sampling.crop_width)
        pair = self._cache[source, frame]
        if pair.left.shape[0] < size[0] or pair.left.shape[1] < size[1]:
            found = pair.left.shape[:2]
            raise TrainingError(too_small(self._cache.name(source, frame), found, size, found))
        rng = np.random.default_rng([self._seed, 2, draw])
        return as_tensors(
            augment(rng, pair, size, self._sampling.augmentation, step=draw // self._draws_per_step)
        )


class FrameDataset(Dataset[StereoBatch]):
    """Whole frames without augmentation, for validation."""

    def __init__(self, frames: Sequence[StereoFrame]) -> None:
        self._frames = frames

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, index: int) -> StereoBatch:
        pair = read_pair(self._frames[index])
        height, width = pair.disparity_left.shape
        whole = cut(pair, Window(0.0, 0.0, 1.0, 1.0), (height, width), (IDENTITY_CURVE, IDENTITY_CURVE))
        return as_tensors(whole)


def as_tensors(sample: TrainingSample) -> StereoBatch:
    """One sample as tensors, channels first."""
    return StereoBatch(
        left=torch.from_numpy(sample.left).permute(2, 0, 1).contiguous(),
        right=torch.from_numpy(sample.right).permute(2, 0, 1).contiguous(),
        disparity=torch.from_numpy(sample.disparity)[None],
        gradient=torch.from_numpy(sample.gradient).permute(2, 0, 1).contiguous(),
    )


class StereoDataModule(pl.LightningDataModule):
    """Training crops in blocks of `validation_interval` steps (Lightning's epochs), and validation frames."""

    def __init__(
        self,
        sources: Sequence[Source],
        validation: Sequence[StereoFrame],
        sampling: SamplingConfig,
        steps: int,
        seed: int,
        workers: int = 0,
        cache_bytes: int = DEFAULT_CACHE_BYTES,
    ) -> None:
        """Decode as many frames as the cache holds.

        Args:
            sources: The data sets to train on.
            validation: Frames to validate on; `sampling.validation_samples` of them are used.
            sampling: How crops and validation frames are taken.
            steps: Optimizer steps of the run.
            seed: Decides all crops.
            workers: Processes that prepare crops; the crops do not depend on their number.
            cache_bytes: Memory for decoded frames.
        """
        super().__init__()
        self._sampling = sampling
        self._steps = steps
        self._seed = seed
        self._workers = workers
        self._sources = sources
        self._cache = PairCache(sources, cache_bytes)
        spread = np.linspace(0, len(validation) - 1, min(sampling.validation_samples, len(validation)))
        self._validation = FrameDataset([validation[round(i)] for i in spread])

    def impossible_shares(self) -> list[ImpossibleShare]:
        """How much of each source's ground truth cannot be (`PairCache.impossible_shares`)."""
        return self._cache.impossible_shares()

    def image_mean(self) -> NDArray[np.float32]:
        """Mean colour (3,) in 0..1 of both views of the first frames of all sources."""
        images = [view for pair in self._cache.first(IMAGE_MEAN_FRAMES) for view in (pair.left, pair.right)]
        mean: NDArray[np.float32] = np.mean([image.mean((0, 1)) for image in images], axis=0) / 255
        return mean.astype(np.float32)

    def train_dataloader(self) -> DataLoader[StereoBatch]:
        """The crops from the current step to the next validation; under torchrun, this process's share of every step.

        Lightning cannot resume a run between two validations exactly; to begin an epoch at whatever step it was can.
        """
        assert self.trainer is not None
        loop, step = self.trainer.fit_loop.epoch_loop, self.trainer.global_step
        loop.restarting = False
        loop._batches_that_stepped = step  # what loggers count
        return self.block(step, self.trainer.global_rank, self.trainer.world_size)

    def block(self, first: int, rank: int = 0, processes: int = 1) -> DataLoader[StereoBatch]:
        """The crops of the steps from `first` to the next multiple of `validation_interval`, or to the run's end.

        Args:
            first: Number of the first step.
            rank: Of this process.
            processes: Number of processes; each takes `batch_size` crops of every step.
        """
        size = self._sampling.batch_size
        per_step = size * processes
        schedule = schedule_draws(
            self._sources, self._steps * per_step, self._seed, self._sampling.curriculum
        )
        interval = self._sampling.validation_interval
        steps = range(first, min((first // interval + 1) * interval, self._steps))
        batches = [list(range(s * per_step + rank * size, s * per_step + (rank + 1) * size)) for s in steps]
        crops = CropDataset(self._cache, schedule, self._sampling, self._seed, per_step)
        return DataLoader(crops, batch_sampler=batches, num_workers=self._workers)

    def val_dataloader(self) -> DataLoader[StereoBatch] | list[DataLoader[StereoBatch]]:
        """The validation frames one by one, each as a batch of one; an empty list if there are none."""
        return DataLoader(self._validation, batch_size=1) if len(self._validation) else []


def open_sources(
    data: Sequence[tuple[str | Path, float]], crop: tuple[int, int], validation: Sequence[str | Path] = ()
) -> tuple[list[Source], list[StereoFrame]]:
    """Open the data sets to train on and collect the frames to validate on.

    Args:
        data: Data sets as `datagen.sources.registry.open_source` takes them, with their weights.
        crop: (height, width) of the crops, which must fit into the frames.
        validation: Data sets to validate on; if empty, the val splits of `data`.

    Raises:
        TrainingError: no data, a weight that is not positive, or frames smaller than the crop.
        DatasetError: a location that is no data set or has nothing to train on.
    """
    if not data:
        raise TrainingError("training needs at least one data set")
    sources: list[Source] = []
    held_out: list[StereoFrame] = []
    for location, weight in data:
        if not weight > 0:
            raise TrainingError(f"{location}: the weight of a data set must be positive, got {weight}")
        opened = open_source(location)
        frames = opened.frames("train")
        sources.append(_source(opened, frames, weight))
        if not validation:
            held_out.extend(opened.validation_frames())
    check_sizes(
        [(str(location), each.frames[0].size) for (location, _), each in zip(data, sources, strict=True)],
        crop,
    )
    for location in validation:
        held_out.extend(open_source(location).held_out_frames())
    return sources, held_out


def _source(opened: DataSource, frames: Sequence[StereoFrame], weight: float) -> Source:
    """A source with what is to be said of how its frames were found."""
    remarks = [] if opened.note is None else [f"{opened.location}: {opened.note}"]
    if opened.sets_aside:
        count = len(opened.validation_frames())
        remarks.append(
            f"{opened.location}: has no validation split, so its last {count} of {count + len(frames)} frames are not "
            "trained on but validate"
        )
    fingerprint = data_fingerprint(opened.location, frames, opened.options.get("scale"))
    return Source(frames, weight, fingerprint, tuple(remarks))


def check_sizes(sizes: Sequence[tuple[str, tuple[int, int]]], crop: tuple[int, int]) -> None:
    """Check that crops fit into the frames of all data sets.

    Args:
        sizes: Name and frame size (height, width) of each data set.
        crop: (height, width) of the crops.

    Raises:
        TrainingError: names the first data set that is too small, and a crop that fits them all.
    """
    smallest = min(height for _, (height, _) in sizes), min(width for _, (_, width) in sizes)
    for name, size in sizes:
        if size[0] < crop[0] or size[1] < crop[1]:
            raise TrainingError(too_small(name, size, crop, smallest))


def too_small(name: str, size: tuple[int, ...], crop: tuple[int, int], smallest: tuple[int, ...]) -> str:
    """The message about frames that are smaller than the crops, with a crop that fits `smallest`.

    All sizes are (height, width).
    """
    said = f"{name}: frames of {size[1]}x{size[0]} are smaller than the {crop[1]}x{crop[0]} crops"
    height, width = (
        min(least // CROP_MULTIPLE * CROP_MULTIPLE, length)
        for least, length in zip(smallest, crop, strict=True)
    )
    if min(height, width) < CROP_MULTIPLE:
        return f"{said}, and no crop can be smaller than {CROP_MULTIPLE}x{CROP_MULTIPLE}"
    return f"{said}; crops of {width}x{height} fit (--crop {width}x{height})"
