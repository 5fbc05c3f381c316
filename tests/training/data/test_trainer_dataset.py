"""Our data sets in other projects' training loops."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import torch
import torch.nn.functional as F  # noqa: N812
from torch.utils.data import DataLoader

from datagen import StereoDataset
from tests.datagen import analytic_world
from tests.training.synthetic import write_dataset
from training.data.trainer_dataset import GWCNET, STEREO_TOOLBOX, TrainerDataset
from training.errors import TrainingError


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_dataset(tmp_path_factory.mktemp("set"), 0, train=4, unknown_rows=3)


def test_whole_frames_are_those_of_the_set(tmp_path: Path) -> None:
    analytic_world.write_dataset(tmp_path, {"train": 1})
    frame = StereoDataset(tmp_path, "train")[1]
    item = TrainerDataset(tmp_path)[1]
    assert set(item) == set(STEREO_TOOLBOX.values())
    np.testing.assert_array_equal((item["ref"] * 255).round().byte().permute(1, 2, 0), frame.left)
    np.testing.assert_array_equal((item["tgt"] * 255).round().byte().permute(1, 2, 0), frame.right)
    np.testing.assert_array_equal(item["gt_disp"], np.nan_to_num(frame.disparity_left))
    assert 0 < float(item["noc_mask"].mean()) < 1
    np.testing.assert_array_equal(item["noc_mask"] == 1, frame.occlusion_left == 0)


def test_what_is_unknown_is_marked(data: Path) -> None:
    assert (TrainerDataset(data, keys=GWCNET)[2]["disparity"][:6] == 0).all()
    marked = TrainerDataset(data, keys={"disparity": "d"}, unknown=-1)[2]
    assert set(marked) == {"d"}
    assert (marked["d"][:6] == -1).all()
    assert (marked["d"][6:] > 0).all()


def test_crops_of_both_views_lie_at_one_place(data: Path) -> None:
    dataset = TrainerDataset(data, crop=(32, 64), keys=GWCNET, normalized=True)
    whole = TrainerDataset(data, keys=GWCNET, normalized=True)[0]
    torch.manual_seed(1)
    item = dataset[0]
    windows = [
        (y, x)
        for y in range(33)
        for x in range(65)
        if torch.equal(whole["left"][:, y : y + 32, x : x + 64], item["left"])
    ]
    ((y, x),) = windows
    for name, window in (("right", whole["right"][:, y : y + 32, x : x + 64]),):
        assert torch.equal(item[name], window)
    assert torch.equal(item["disparity"], whole["disparity"][y : y + 32, x : x + 64])
    assert abs(float(whole["left"].mean())) < 3
    assert float(whole["left"].min()) < 0


def test_wrong_requests_are_sentences(data: Path) -> None:
    with pytest.raises(TrainingError, match="frames of 128x64 are smaller than crops of 256x32"):
        TrainerDataset(data, crop=(32, 256))
    with pytest.raises(TrainingError, match="there is no depth to name; there are left, right"):
        TrainerDataset(data, keys={"left": "l", "depth": "d"})


def gwcnet() -> Any:
    """GwcNet of stereo-toolbox, without its other networks, which need packages that need a GPU."""
    package = importlib.util.find_spec("stereo_toolbox")
    assert package is not None
    assert package.origin is not None
    for name in ("stereo_toolbox.models", "stereo_toolbox.models.GwcNet"):
        bare = ModuleType(name)
        bare.__path__ = [str(Path(package.origin).parent.joinpath(*name.split(".")[1:]))]
        sys.modules[name] = bare
    return importlib.import_module("stereo_toolbox.models.GwcNet.gwcnet").GwcNet_G(64)


@pytest.mark.slow
def test_gwcnet_of_stereo_toolbox_learns_from_a_set_of_ours(data: Path) -> None:
    """Two steps of its usual loss on one batch bring that loss down."""
    torch.manual_seed(0)
    dataset = TrainerDataset(data, crop=(64, 128), keys=GWCNET, normalized=True)
    batch = next(iter(DataLoader(dataset, batch_size=2, shuffle=True)))
    network = gwcnet().train()
    optimizer = torch.optim.Adam(network.parameters(), lr=1e-3)
    known = (batch["disparity"] > 0) & (batch["disparity"] < 64)
    losses = []
    for _ in range(3):
        outputs = network(batch["left"], batch["right"])
        loss = sum(
            weight * F.smooth_l1_loss(output.squeeze(1)[known], batch["disparity"][known])
            for weight, output in zip((0.5, 0.5, 0.7, 1.0), outputs, strict=True)
        )
        losses.append(float(loss.detach()))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert losses[2] < losses[0]
