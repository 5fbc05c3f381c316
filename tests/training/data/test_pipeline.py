"""Which crop a draw gives: decided by seed and number alone."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from datagen import DatasetError
from datagen.sources.webdataset import ShardFrames
from tests.datagen.sources import published
from tests.training.synthetic import random_pair, write_dataset
from training.data.augmentation import AugmentationConfig
from training.data.pipeline import (
    PairCache,
    Source,
    StereoDataModule,
    open_sources,
    schedule_draws,
    shuffle,
)
from training.errors import TrainingError
from training.preset_kinds import OptimizerConfig, Preset

PRESET = Preset(
    steps=12, batch_size=2, crop_width=64, crop_height=64, optimizer=OptimizerConfig(), validation_interval=5
)


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    root = tmp_path_factory.mktemp("data")
    return write_dataset(root / "a", 0, train=3, val=2), write_dataset(root / "b", 1, train=2)


def module_of(folders: tuple[Path, Path], seed: int = 0, **options: int) -> StereoDataModule:
    sources, validation = open_sources([(folders[0], 2.0), (folders[1], 1.0)], (64, 64))
    return StereoDataModule(sources, validation, PRESET, PRESET.steps, seed, **options)


def lefts(module: StereoDataModule, first: int = 0, rank: int = 0, processes: int = 1) -> torch.Tensor:
    return torch.cat([batch.left for batch in module.block(first, rank, processes)])


def test_draws_do_not_depend_on_workers_or_cache(folders: tuple[Path, Path]) -> None:
    reference = lefts(module_of(folders))
    torch.testing.assert_close(lefts(module_of(folders, workers=2)), reference, rtol=0, atol=0)
    torch.testing.assert_close(lefts(module_of(folders, cache_bytes=0)), reference, rtol=0, atol=0)
    assert not torch.equal(lefts(module_of(folders, seed=1)), reference)


def test_two_processes_share_the_draws_of_one_with_double_batch(folders: tuple[Path, Path]) -> None:
    module = module_of(folders)
    first, second = (list(module.block(0, rank, 2)) for rank in range(2))
    together = [torch.cat([a.left, b.left]) for a, b in zip(first, second, strict=True)]
    sources, validation = open_sources([(folders[0], 2.0), (folders[1], 1.0)], (64, 64))
    double = Preset(**{**vars(PRESET), "batch_size": 4})
    alone = StereoDataModule(sources, validation, double, PRESET.steps, 0)
    for pair, batch in zip(together, alone.block(0), strict=True):
        torch.testing.assert_close(pair, batch.left, rtol=0, atol=0)


def test_blocks_divide_the_run(folders: tuple[Path, Path]) -> None:
    module = module_of(folders)
    assert [len(module.block(first)) for first in (0, 5, 10)] == [5, 5, 2]
    crops = torch.cat([lefts(module, first) for first in (0, 5, 10)])
    torch.testing.assert_close(lefts(module, 7), lefts(module, 5)[2 * 2 :], rtol=0, atol=0)
    assert len(torch.unique(crops.flatten(1), dim=0)) == 24


def test_schedule_takes_every_frame_once_a_pass_and_sources_by_weight() -> None:
    frames: list[Source] = [Source([None] * 7, 3.0), Source([None] * 4, 1.0)]  # type: ignore[list-item]
    schedule = schedule_draws(frames, 4000, seed=5)
    assert (schedule[:, 0] == 0).mean() == pytest.approx(0.75, abs=0.03)
    for source, count in ((0, 7), (1, 4)):
        order = schedule[schedule[:, 0] == source, 1]
        passes = order[: len(order) // count * count].reshape(-1, count)
        assert (np.sort(passes, axis=1) == np.arange(count)).all()
        assert not (passes == passes[0]).all()
    np.testing.assert_array_equal(schedule_draws(frames, 100, seed=5), schedule[:100])


@settings(max_examples=30, deadline=None)
@given(
    length=st.sampled_from([450, 900, 1800]),
    counts=st.lists(st.integers(1, 300), min_size=1, max_size=3),
    seed=st.integers(0, 99),
)
def test_a_curriculum_adds_the_frames_in_their_order(length: int, counts: list[int], seed: int) -> None:
    """No draw takes a frame further on than its ninth of the curriculum allows; afterwards all are taken."""
    draws = 1800
    sources: list[Source] = [Source([None] * count) for count in counts]  # type: ignore[list-item]
    schedule = schedule_draws(sources, draws, seed, length / draws)
    part = np.minimum(np.arange(draws) // (length // 9), 9)
    for index, count in enumerate(counts):
        allowed = np.ceil(count * (part + 1) / 10).astype(int)
        own = schedule[:, 0] == index
        for number in range(10):
            seen, first = schedule[own & (part == number), 1], allowed[part == number].max(initial=1)
            assert (seen < first).all()
            assert len(np.unique(seen)) == min(len(seen), first)
    np.testing.assert_array_equal(schedule[:, 0], schedule_draws(sources, draws, seed)[:, 0])


def test_a_preset_with_a_curriculum_begins_with_the_first_frames(tmp_path: Path) -> None:
    sources, _ = open_sources([(write_dataset(tmp_path, 3, train=10), 1.0)], (64, 64))
    still = AugmentationConfig(log_zoom=(0, 0), log_squeeze=(0, 0), log_brightness=0, log_gamma=0)
    preset = replace(PRESET, augmentation=still, curriculum=1.0)
    first = StereoDataModule(sources, [], preset, 100, 0).block(0)
    schedule = schedule_draws(sources, 200, 0, 1.0)
    assert set(schedule[:10, 1]) == {0}
    without = StereoDataModule(sources, [], replace(preset, curriculum=0.0), 100, 0).block(0)
    assert not torch.equal(next(iter(first)).disparity, next(iter(without)).disparity)


def test_shards_are_taken_a_few_at_a_time() -> None:
    """A pass over shards takes every sample once, eight shards at a time."""
    frames = ShardFrames(tuple((f"train-{i // 5:06d}.tar", str(i)) for i in range(200)))
    order = shuffle(np.random.default_rng(0), frames)
    assert sorted(order) == list(range(200))
    for window in order.reshape(5, 40):
        assert len({index // 5 for index in window}) == 8
    assert not (np.diff(order[:40]) > 0).all()


def test_every_kind_of_source_is_trained_on(folders: tuple[Path, Path], tmp_path: Path) -> None:
    """Mixed sets: ours, and a sparse one of another layout, without the right view's ground truth, held out in part."""
    for index in range(4):
        name = f"{index:06d}_10.png"
        w = random_pair(np.random.default_rng(index), 80, 140)
        published.png(tmp_path / f"training/image_2/{name}", w.left)
        published.png(tmp_path / f"training/image_3/{name}", w.right)
        code = np.rint(w.disparity_left * 256).astype(np.uint16)
        code[::2] = 0
        published.png(tmp_path / f"training/disp_occ_0/{name}", code)
    data = [(folders[1], 1.0), (f"kitti2015:{tmp_path}#0-1", 3.0)]
    sources, held_out = open_sources(data, (64, 64), [f"{tmp_path}#2-3"])
    assert [frame.name for frame in held_out] == ["000002_10", "000003_10"]
    assert [len(source.frames) for source in sources] == [2, 2]
    preset = replace(PRESET, augmentation=AugmentationConfig(horizontal_flip=1.0))
    batches = list(StereoDataModule(sources, held_out, preset, 5, 0).block(0))
    holes = torch.stack([torch.isnan(batch.disparity).float().mean((1, 2, 3)) for batch in batches])
    assert {share > 0.3 for share in holes.flatten().tolist()} == {True, False}


def test_frames_smaller_than_the_crop_are_named(tmp_path: Path) -> None:
    """Sets such as KITTI mix sizes; only the first frame is looked at before the run."""
    for index, width in enumerate((140, 60)):
        for folder in ("image_2", "image_3"):
            image = np.zeros((80, width, 3), np.uint8)
            published.png(tmp_path / f"training/{folder}/{index:06d}_10.png", image)
        code = np.ones((80, width), np.uint16)
        published.png(tmp_path / f"training/disp_occ_0/{index:06d}_10.png", code)
    sources, _ = open_sources([(tmp_path, 1.0)], (64, 64))
    with pytest.raises(TrainingError, match="000001_10: frames of 60x80 are smaller than the 64x64"):
        list(StereoDataModule(sources, [], PRESET, 5, 0).block(0))


def test_cache_is_bounded(folders: tuple[Path, Path]) -> None:
    sources, _ = open_sources([(folders[0], 1.0)], (64, 64))
    one = 2 * 64 * 128 * (3 + 4)
    for capacity, kept in ((0, 0), (one, 1), (2 * one + 1, 2), (100 * one, 3)):
        cache = PairCache(sources, capacity)
        assert len(cache) == kept
        np.testing.assert_array_equal(cache[0, 2].left, sources[0].frames[2].left)


def test_validation_frames_are_whole(folders: tuple[Path, Path]) -> None:
    batches = list(module_of(folders).val_dataloader())
    assert len(batches) == 2
    assert batches[0].left.shape == (1, 3, 64, 128)
    assert torch.isnan(batches[0].gradient[:, :, -1]).all()


def test_wrong_requests_are_sentences(folders: tuple[Path, Path], tmp_path: Path) -> None:
    with pytest.raises(TrainingError, match="at least one data set"):
        open_sources([], (64, 64))
    with pytest.raises(TrainingError, match="weight of a data set must be positive, got 0"):
        open_sources([(folders[0], 0.0)], (64, 64))
    with pytest.raises(TrainingError, match="frames of 128x64 are smaller than the 256x64 crops"):
        open_sources([(folders[0], 1.0)], (64, 256))
    with pytest.raises(DatasetError, match="no such folder"):
        open_sources([(tmp_path / "nothing", 1.0)], (64, 64))
