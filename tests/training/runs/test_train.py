"""Whole runs on data sets on disk: they learn, resume exactly, and say what is wrong."""

import hashlib
import json
import shutil
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pytorch_lightning as pl
import safetensors.torch
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from datagen import DatasetError, StereoDataset
from stereoforge_kit.files import alone
from tests.datagen.sources import published
from tests.training.running import train_quietly
from tests.training.synthetic import NO_AUGMENTATION, random_pair, write_dataset
from training.data.pipeline import check_sizes
from training.errors import TrainingError
from training.networks import DispNetConfig
from training.prediction.predictor import StereoPredictor
from training.preset_kinds import Preset, RegressorPreset
from training.presets import find_preset
from training.runs.checkpoints import checkpoint_step
from training.runs.continuation import describe_continuation
from training.runs.hardware import Precision
from training.runs.run_folder import Continuation
from training.runs.weights import read_summary
from training.tasks import GradNetTask, StereoTask


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_dataset(tmp_path_factory.mktemp("set"), 0, train=4, val=2)


def quick(task: str, network: str = "dispnet", **changes: object) -> Preset:
    """The tiny preset on small crops."""
    small = {"crop_width": 128, "crop_height": 64, "batch_size": 4, "validation_interval": 4}
    return replace(find_preset(task, "tiny", network), **(small | changes))  # type: ignore[arg-type]


NARROW: dict[str, dict[str, object]] = {
    "dispnet": {"width": 0.0625},
    "costvolume": {
        "stem": 4,
        "encoder": (8,) * 4,
        "aggregation": (4,) * 4,
        "look_channels": 8,
        "full_channels": 4,
    },
}


def quick_regressor(network: str = "dispnet", **changes: object) -> RegressorPreset:
    preset = quick("regressor", network, **changes)
    assert isinstance(preset, RegressorPreset)
    return replace(preset, network=replace(preset.network, **NARROW[network]))


@pytest.fixture(scope="module")
def runs(data: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """For each network, a run folder with a regressor of a few steps."""
    folders = {network: tmp_path_factory.mktemp(network) for network in NARROW}
    for network, folder in folders.items():
        train_quietly("regressor", [(data, 1.0)], folder, quick_regressor(network), steps=6)
    return folders


@pytest.fixture(scope="module")
def run(runs: dict[str, Path]) -> Path:
    """The run folder of a DispNetCorr1D."""
    return runs["dispnet"]


def weights(run: Path, task: str) -> dict[str, torch.Tensor]:
    return safetensors.torch.load_file(run / f"{task}.safetensors")


def scalars(run: Path, task: str, name: str) -> dict[int, float]:
    events = EventAccumulator(str(run / "logs" / task))
    events.Reload()
    return {event.step: event.value for event in events.Scalars(name)}


def test_statistics_are_measured_once_and_then_fixed(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the middle of a run BatchNorm normalises by the mean over a block of what it saw of each batch."""
    seen: list[tuple[torch.Tensor, torch.Tensor]] = []  # a batch's mean and variance, in the first BatchNorm
    known: list[torch.Tensor] = []  # the running mean and variance after each step

    def note(norm: torch.nn.Module, inputs: tuple[torch.Tensor]) -> None:
        if norm.training:
            seen.append((inputs[0].mean((0, 2, 3)).detach(), inputs[0].var((0, 2, 3)).detach()))

    def begin(task: StereoTask) -> None:
        first = next(part for part in task.network.modules() if isinstance(part, torch.nn.BatchNorm2d))
        first.register_forward_pre_hook(note)

    def end(task: StereoTask, *_: object) -> None:
        first = next(part for part in task.network.modules() if isinstance(part, torch.nn.BatchNorm2d))
        known.append(torch.cat([first.running_mean, first.running_var]).clone())

    monkeypatch.setattr(StereoTask, "on_train_start", begin)
    monkeypatch.setattr(StereoTask, "on_train_batch_end", end)
    preset = replace(quick_regressor(), fixed_statistics=0.5)
    train_quietly("regressor", [(data, 1.0)], tmp_path, preset, steps=8)
    assert len(seen) == 8  # four steps, then the four batches that are measured over
    measured = seen[4:]
    expected = [torch.stack(part).mean(0) for part in zip(*measured, strict=True)]
    assert not torch.equal(known[2], known[3])
    for later in known[4:]:
        torch.testing.assert_close(later, torch.cat(expected))


@pytest.mark.slow
def test_overfits_four_samples(data: Path, tmp_path: Path) -> None:
    """The regressor, then both heads on it, learn four pairs (mean disparity about 10 px) nearly by heart."""
    network = DispNetConfig(0.125, 10, one_sided=True, normalization="batch", prediction_scale=16.0)
    alike = {"augmentation": NO_AUGMENTATION, "validation_interval": 300}
    presets = {task: quick(task, **alike) for task in ("regressor", "confnet", "gradnet")}
    presets["regressor"] = replace(
        quick_regressor(**alike),
        network=network,
        optimizer=replace(presets["regressor"].optimizer, learning_rate=3e-3, weight_decay=0.0),
    )
    final = {}
    for task, steps in {"regressor": 900, "confnet": 150, "gradnet": 150}.items():
        train_quietly(task, [(data, 1.0)], tmp_path, presets[task], steps=steps)
        losses = scalars(tmp_path, task, "train/loss")
        final[task] = losses[max(losses)]
    # A weighted sum over six scales whose weights add up to 2: under 1.1 px on average.
    assert final["regressor"] < 2.2
    assert final["confnet"] < 0.3
    assert final["gradnet"] < 0.04


@pytest.mark.parametrize("network", ["dispnet", "costvolume"])
@pytest.mark.parametrize("task", ["regressor", "regressor_f", "confnet", "gradnet"])
def test_resumed_equals_uninterrupted(
    task: str, network: str, data: Path, runs: dict[str, Path], tmp_path: Path
) -> None:
    """Stopped by an exception in the middle of a block and resumed: the same weights, bit for bit."""
    preset = quick_regressor(network) if task == "regressor" else quick(task)
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    for folder in (whole, broken):
        folder.mkdir()
        if task != "regressor":
            for file in runs[network].glob("regressor.*"):
                shutil.copy(file, folder)
    train_quietly(task, [(data, 1.0)], whole, preset, steps=11, seed=3)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(StereoTask, "on_train_batch_end", _stop_after(6, _PowerCut), raising=False)
        with pytest.raises(_PowerCut):
            train_quietly(task, [(data, 1.0)], broken, preset, steps=11, seed=3)
    train_quietly(task, [(data, 1.0)], broken, preset, steps=11, seed=3, resume=True)

    expected, got = weights(whole, task), weights(broken, task)
    assert expected.keys() == got.keys()
    assert all(torch.equal(expected[name], got[name]) for name in expected)
    assert json.loads((whole / f"{task}.json").read_text()) == json.loads(
        (broken / f"{task}.json").read_text()
    )
    state = [
        torch.load(folder / "logs" / task / "last.ckpt", weights_only=True) for folder in (whole, broken)
    ]
    for name, tensor in state[0]["state_dict"].items():
        assert torch.equal(tensor, state[1]["state_dict"][name])


class _PowerCut(Exception):  # noqa: N818
    pass


def _stop_after(steps: int, why: type[BaseException]) -> object:
    def on_train_batch_end(self: pl.LightningModule, *_: object) -> None:
        if self.global_step == steps:
            raise why

    return on_train_batch_end


def _interrupted_after(
    steps: int, patch: pytest.MonkeyPatch, number: signal.Signals = signal.SIGTERM
) -> None:
    """Have the signal sent within the step after so many."""

    def on_train_batch_start(self: StereoTask, *arguments: object) -> None:
        if self.global_step == steps:
            signal.raise_signal(number)
        start(self, *arguments)  # type: ignore[arg-type]

    start = StereoTask.on_train_batch_start
    patch.setattr(StereoTask, "on_train_batch_start", on_train_batch_start)


def _same_run(first: Path, second: Path, task: str) -> None:
    """Weights, description and logged figures are the same."""
    expected, got = weights(first, task), weights(second, task)
    assert all(torch.equal(expected[name], got[name]) for name in expected)
    assert (first / f"{task}.json").read_text() == (second / f"{task}.json").read_text()
    assert scalars(first, task, "validation/epe") == scalars(second, task, "validation/epe")


@pytest.mark.parametrize(
    ("step", "kept"), [(1, 2), (3, 4), (5, 6), (8, 9), (10, 8)], ids=lambda value: str(value)
)
def test_an_interruption_keeps_the_step_under_way(step: int, kept: int, data: Path, tmp_path: Path) -> None:
    """SIGTERM in any step, the last before a validation too; only in the last of all it is the checkpoint before."""
    preset, options = quick_regressor(fixed_statistics=0.4), {"steps": 11, "changes": {"ema_decay": 0.9}}
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    train_quietly("regressor", [(data, 1.0)], whole, preset, **options)
    with pytest.MonkeyPatch.context() as patch:
        _interrupted_after(step, patch)
        with pytest.raises(KeyboardInterrupt):
            train_quietly("regressor", [(data, 1.0)], broken, preset, **options)
    assert checkpoint_step(broken / "logs" / "regressor" / "last.ckpt") == kept
    train_quietly("regressor", [(data, 1.0)], broken, preset, resume=True, **options)
    _same_run(whole, broken, "regressor")
    assert scalars(whole, "regressor", "train/loss") == scalars(broken, "regressor", "train/loss")


def test_a_validation_that_was_interrupted_is_done_again(data: Path, tmp_path: Path) -> None:
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    train_quietly("regressor", [(data, 1.0)], whole, quick_regressor(), steps=6)
    with pytest.MonkeyPatch.context() as patch:
        validate = StereoTask.validation_step
        patch.setattr(
            StereoTask,
            "validation_step",
            lambda *arguments: (validate(*arguments), signal.raise_signal(signal.SIGINT))[0],
        )
        with pytest.raises(KeyboardInterrupt):
            train_quietly("regressor", [(data, 1.0)], broken, quick_regressor(), steps=6)
    assert not (broken / "regressor.safetensors").exists()
    assert checkpoint_step(broken / "logs" / "regressor" / "last.ckpt") == 4
    train_quietly("regressor", [(data, 1.0)], broken, quick_regressor(), steps=6, resume=True)
    _same_run(whole, broken, "regressor")


def test_killed_between_two_validations_a_run_goes_on_from_the_last_minutes(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Checkpoints are written by the clock too; here after every step."""
    monkeypatch.setattr("training.runs.checkpoints.CHECKPOINT_EVERY_S", 0.0)
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    train_quietly("regressor", [(data, 1.0)], whole, quick_regressor(), steps=11)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(StereoTask, "on_train_batch_end", _stop_after(7, _PowerCut), raising=False)
        with pytest.raises(_PowerCut):
            train_quietly("regressor", [(data, 1.0)], broken, quick_regressor(), steps=11)
    assert checkpoint_step(broken / "logs" / "regressor" / "last.ckpt") == 7
    train_quietly("regressor", [(data, 1.0)], broken, quick_regressor(), steps=11, resume=True)
    _same_run(whole, broken, "regressor")


def test_an_interruption_comes_out_as_one_and_the_next_is_heard_too(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(StereoTask, "on_train_batch_end", _stop_after(6, KeyboardInterrupt), raising=False)
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with pytest.raises(KeyboardInterrupt):
        train_quietly("regressor", [(data, 1.0)], tmp_path, quick_regressor(), steps=11)
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before
    assert read_summary(tmp_path, "regressor").best_step == 4  # whole: the last validation's


def test_resuming_a_finished_run_changes_nothing(data: Path, run: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(run, tmp_path / "run")
    before = (folder / "regressor.safetensors").read_bytes()
    summary = train_quietly("regressor", [(data, 1.0)], folder, quick_regressor(), steps=6, resume=True)
    assert (folder / "regressor.safetensors").read_bytes() == before
    assert summary.best_step in (4, 6)
    assert set(summary.validation) == {"epe", "bad1", "bad3", "gradient"}


def test_seed_and_workers(data: Path, tmp_path: Path) -> None:
    """The same seed gives the same weights whatever the workers; another seed gives others."""
    for name, seed, workers in (("a", 0, 0), ("b", 0, 1), ("c", 1, 0)):
        train_quietly(
            "regressor",
            [(data, 1.0)],
            tmp_path / name,
            quick_regressor(),
            steps=3,
            seed=seed,
            workers=workers,
        )
    first, second, third = (weights(tmp_path / name, "regressor")["pr6.weight"] for name in "abc")
    assert torch.equal(first, second)
    assert not torch.equal(first, third)


def test_the_callers_random_state_is_left_alone(data: Path, tmp_path: Path) -> None:
    torch.manual_seed(42)
    expected = torch.rand(3)
    torch.manual_seed(42)
    train_quietly("regressor", [(data, 1.0)], tmp_path, quick_regressor(), steps=1)
    assert torch.equal(torch.rand(3), expected)


def test_heads_see_the_regressor_unchanged(data: Path, run: Path, tmp_path: Path) -> None:
    """Built on another run's regressor, which is copied, frozen, BatchNorm statistics included."""
    train_quietly("confnet", [(data, 1.0)], tmp_path, quick("confnet"), init=run, steps=3)
    before, after = weights(run, "regressor"), weights(tmp_path, "regressor")
    assert all(torch.equal(before[name], after[name]) for name in before)
    inner = torch.load(tmp_path / "logs" / "confnet" / "last.ckpt", weights_only=True)["state_dict"]
    assert all(torch.equal(before[name], inner[f"regressor.{name}"]) for name in before)
    sample = StereoDataset(data, "val")[0]
    prediction = StereoPredictor(tmp_path).predict(sample.left, sample.right)
    assert prediction.confidence is not None
    assert prediction.confidence.shape == sample.left.shape[:2]


def test_tensorboard_holds_figures_and_pictures(run: Path) -> None:
    assert set(scalars(run, "regressor", "validation/epe")) == {3, 5}  # Lightning counts from 0
    events = EventAccumulator(str(run / "logs" / "regressor"))
    events.Reload()
    assert events.Tags()["images"] == ["frame0", "frame1"]
    width = events.Images("frame0")[0].width
    assert width == 4 * 128 + 3 * 4


def test_the_card_names_data_steps_figures_and_code(data: Path, run: Path) -> None:
    card = (run / "model_card.md").read_text()
    summary = read_summary(run, "regressor")
    recipe = hashlib.sha256((data / "recipe.yaml").read_bytes()).hexdigest()
    assert f"| data, weight 1 | {data}: 4 frames, recipe {recipe} |" in card
    assert f"| steps | {summary.best_step} of 6 " in card
    assert f"{summary.validation['epe']:.4g}" in card
    assert summary.revision in card


def test_the_card_names_what_a_regressor_started_from(data: Path, run: Path, tmp_path: Path) -> None:
    first = read_summary(run, "regressor")
    assert first.started_from is None
    train_quietly("regressor", [(data, 2.0)], tmp_path, quick_regressor(), init=run, steps=2)
    assert read_summary(tmp_path, "regressor").started_from == first
    card = (tmp_path / "model_card.md").read_text()
    assert "| data, weight 2 |" in card.split("It started from weights that were trained so:")[0]
    assert "| data, weight 1 |" in card.split("It started from weights that were trained so:")[1]


def test_a_moving_average_is_what_is_kept(data: Path, tmp_path: Path) -> None:
    """With a decay of 0.5 the kept weights are the average of those of every step, half the weight each time."""
    steps: list[torch.Tensor] = []
    with pytest.MonkeyPatch.context() as patch:
        update = StereoTask.on_train_batch_end

        def on_train_batch_end(self: StereoTask, *arguments: object) -> None:
            steps.append(self.network.state_dict()["pr6.weight"].clone())
            update(self, *arguments)  # type: ignore[arg-type]

        patch.setattr(StereoTask, "on_train_batch_end", on_train_batch_end)
        train_quietly(
            "regressor", [(data, 1.0)], tmp_path, quick_regressor(), steps=4, changes={"ema_decay": 0.5}
        )
    average = steps[0]
    for weight in steps[1:]:
        average = 0.5 * average + 0.5 * weight
    torch.testing.assert_close(weights(tmp_path, "regressor")["pr6.weight"], average)
    assert not torch.equal(average, steps[-1])
    assert read_summary(tmp_path, "regressor").preset == "custom with ema_decay 0.5"


def test_mixed_precision_is_nearly_the_same_run(data: Path, tmp_path: Path) -> None:
    """bf16 holds three digits: the loss of weights that hardly move is that of 32 bits to one percent, and not exactly.

    Ten steps at a usual rate carry the last digits' differences to 4 % on a processor without bf16 instructions.
    """
    preset = quick_regressor(validation_interval=10)
    preset = replace(preset, optimizer=replace(preset.optimizer, learning_rate=1e-9))
    names: tuple[Precision, ...] = ("32", "bf16")
    for name in names:
        train_quietly("regressor", [(data, 1.0)], tmp_path / name, preset, steps=10, precision=name)
    losses = [scalars(tmp_path / name, "regressor", "train/loss")[9] for name in names]
    assert losses[0] == pytest.approx(losses[1], rel=0.01)
    assert losses[0] != losses[1]
    stored = weights(tmp_path / "bf16", "regressor")
    assert all(tensor.dtype in (torch.float32, torch.int64) for tensor in stored.values())


def test_a_run_is_resumed_whatever_its_data_set_is_called(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    train_quietly("regressor", [(data, 1.0)], tmp_path, quick_regressor(), steps=5)
    monkeypatch.chdir(data.parent)
    (tmp_path / "regressor.safetensors").unlink()
    again = [(data.name, 1.0)]
    train_quietly("regressor", again, tmp_path, quick_regressor(), steps=5, resume=True)
    with pytest.raises(TrainingError, match=r"with another data\.1\.weight \(1\.0, not 2\.0\), so it cannot"):
        train_quietly("regressor", [(data, 2.0)], tmp_path, quick_regressor(), steps=5, resume=True)


def test_killed_before_the_first_checkpoint(data: Path, tmp_path: Path) -> None:
    """Weights without a checkpoint: --resume starts the same run anew instead of refusing it."""
    train_quietly("regressor", [(data, 1.0)], tmp_path, quick_regressor(), steps=2)
    before = weights(tmp_path, "regressor")
    (tmp_path / "logs" / "regressor" / "last.ckpt").unlink()
    train_quietly("regressor", [(data, 1.0)], tmp_path, quick_regressor(), steps=2, resume=True)
    assert all(torch.equal(before[name], tensor) for name, tensor in weights(tmp_path, "regressor").items())


def test_what_an_unfinished_run_left_is_not_replaced(data: Path, tmp_path: Path) -> None:
    """A forgotten --resume does not cost the hours that are in a checkpoint."""
    with pytest.MonkeyPatch.context() as patch:
        _interrupted_after(1, patch)
        with pytest.raises(KeyboardInterrupt):
            train_quietly("regressor", [(data, 1.0)], tmp_path, quick_regressor(), steps=6)
    with pytest.raises(
        TrainingError, match="already holds a checkpoint of step 2 of a regressor; continue it"
    ):
        train_quietly("regressor", [(data, 1.0)], tmp_path, quick_regressor(), steps=6)


def test_a_run_may_go_on_for_longer(data: Path, tmp_path: Path) -> None:
    """Finished after 6 steps, between two validations, it goes on to 11 in the blocks of a run of 11."""
    train_quietly("regressor", [(data, 1.0)], tmp_path, quick_regressor(), steps=6)
    summary = train_quietly("regressor", [(data, 1.0)], tmp_path, quick_regressor(), steps=11, resume=True)
    assert summary.steps == 11, "also where the best weights are those of the 6 steps"
    assert checkpoint_step(tmp_path / "logs" / "regressor" / "last.ckpt") == 11
    assert set(scalars(tmp_path, "regressor", "validation/epe")) == {3, 5, 7, 10}  # counted from 0


def test_more_steps_are_said_with_what_they_change() -> None:
    continued = Continuation(Path("last.ckpt"), 600, 1000)
    preset = quick_regressor(steps=1000, fixed_statistics=0.2, curriculum=0.5)
    assert describe_continuation(preset, 1000, continued) == "goes on from step 600 of 1000"
    said = describe_continuation(preset, 2000, continued)
    assert said.startswith("goes on from step 600 of 2000, 1000 before; the learning rate is ")
    assert (
        "; BatchNorm is fixed from step 1600 instead of 800; the curriculum ends at step 1000 instead of 500;"
        in said
    )


def write_kitti(root: Path, count: int) -> None:
    """Sparse ground truth in KITTI's layout."""
    for index in range(count):
        pair = random_pair(np.random.default_rng(index), 80, 140)
        name = f"{index:06d}_10.png"
        published.png(root / f"training/image_2/{name}", pair.left)
        published.png(root / f"training/image_3/{name}", pair.right)
        code = np.rint(pair.disparity_left * 256).astype(np.uint16)
        code[::3] = code[:, ::3] = 0
        published.png(root / f"training/disp_occ_0/{name}", code)


def test_recipes_for_sparse_real_data(run: Path, tmp_path: Path) -> None:
    """The paper's: ConfNet on the first pairs with t = 3, GradNet on dense disparities of another method."""
    write_kitti(tmp_path / "kitti", 4)
    data, held_out = [(f"kitti2015:{tmp_path / 'kitti'}#0-1", 1.0)], [f"{tmp_path / 'kitti'}#2-3"]
    train_quietly(
        "confnet",
        data,
        tmp_path / "run",
        quick("confnet"),
        init=run,
        validation=held_out,
        steps=4,
        changes={"correct_within_px": 3.0},
    )
    assert set(read_summary(tmp_path / "run", "confnet").validation) == {"auc", "auc_random", "auc_optimal"}

    for index in range(2):
        dense = random_pair(np.random.default_rng(index), 80, 140).disparity_left
        published.pfm(tmp_path / f"pseudo/{index:06d}_10.{'pfm' if index else 'PFM'}", dense)
    seen: list[float] = []
    with pytest.MonkeyPatch.context() as patch:
        loss = GradNetTask.loss
        patch.setattr(
            GradNetTask,
            "loss",
            lambda self, batch: (
                seen.append(torch.isnan(batch.disparity).float().mean().item()) or loss(self, batch)
            ),
        )
        train_quietly(
            "gradnet", data, tmp_path / "run", quick("gradnet"), pseudo_labels=tmp_path / "pseudo", steps=4
        )
    assert max(seen) == 0
    assert "pseudo labels from" in read_summary(tmp_path / "run", "gradnet").preset

    (tmp_path / "pseudo" / "000001_10.pfm").unlink()
    with pytest.raises(TrainingError, match="has no disparity for the frame 000001_10"):
        train_quietly(
            "gradnet",
            data,
            tmp_path / "run",
            quick("gradnet"),
            pseudo_labels=tmp_path / "pseudo",
            steps=4,
            resume=True,
        )


def test_validation_is_optional(tmp_path: Path) -> None:
    data = write_dataset(tmp_path / "set", 0, train=2)
    summary = train_quietly("regressor", [(data, 1.0)], tmp_path / "run", quick_regressor(), steps=5)
    assert summary.best_step == 5
    assert summary.validation == {}


def test_a_loss_that_is_not_finite_stops_the_run(data: Path, tmp_path: Path) -> None:
    preset = quick_regressor()
    preset = replace(preset, optimizer=replace(preset.optimizer, learning_rate=1e30, clip_norm=None))
    with pytest.raises(TrainingError, match=r"the loss of step \d+ is (nan|inf), so training stopped"):
        train_quietly("regressor", [(data, 1.0)], tmp_path, preset, steps=20)


def test_wrong_requests_are_sentences(data: Path, run: Path, tmp_path: Path) -> None:
    source = [(data, 1.0)]
    with pytest.raises(TrainingError, match="no task 'depthnet'; there are regressor"):
        train_quietly("depthnet", source, tmp_path)
    with pytest.raises(TrainingError, match="regressor has no preset 'huge'; there are tiny, small, full"):
        train_quietly("regressor", source, tmp_path, "huge")
    with pytest.raises(TrainingError, match="crops must be multiples of 64 each way, not 100x64"):
        train_quietly("regressor", source, tmp_path, quick("regressor"), changes={"crop_width": 100})
    with pytest.raises(
        TrainingError, match="correct_within_px does not apply here: a RegressorPreset has batch_size"
    ):
        train_quietly("regressor", source, tmp_path, "tiny", changes={"correct_within_px": 3.0})
    with pytest.raises(TrainingError, match="16-bit floats need a GPU; bf16 works on CPUs too"):
        train_quietly("regressor", source, tmp_path, "tiny", precision="16", device="cpu")
    with pytest.raises(TrainingError, match="at least one step"):
        train_quietly("regressor", source, tmp_path, "tiny", steps=0)
    with pytest.raises(TrainingError, match="no trained regressor"):
        train_quietly("confnet", source, tmp_path / "empty", quick("confnet"))
    with pytest.raises(TrainingError, match="already holds a regressor; continue it with --resume"):
        train_quietly("regressor", source, run, quick_regressor(), steps=6)
    with pytest.raises(
        TrainingError, match=r"started with 6 steps; it can be continued with more, not with 5"
    ):
        train_quietly("regressor", source, run, quick_regressor(), steps=5, resume=True)
    slower = quick_regressor()
    slower = replace(slower, optimizer=replace(slower.optimizer, learning_rate=1e-5))
    with pytest.raises(TrainingError) as refusal:
        train_quietly("regressor", source, run, slower, steps=6, resume=True)
    rates = f"{quick_regressor().optimizer.learning_rate}, not 1e-05"
    assert f"started with another preset.optimizer.learning_rate ({rates})" in str(refusal.value)
    with pytest.raises(TrainingError, match=r"with another data\.2 \(null, not "):
        train_quietly("regressor", source * 2, run, quick_regressor(), steps=6, resume=True)
    with (
        alone(run / "logs" / "regressor" / ".lock"),
        pytest.raises(TrainingError, match="another process is training its regressor right now"),
    ):
        train_quietly("regressor", source, run, quick_regressor(), steps=6, resume=True)
    with pytest.raises(TrainingError, match="no device 'abacus'; it is called auto"):
        train_quietly("regressor", source, tmp_path / "device", quick_regressor(), device="abacus")
    with pytest.raises(
        TrainingError, match=r"frames of 128x64 are smaller than the 320x160 .* \(--crop 128x64\)"
    ):
        train_quietly("regressor", source, tmp_path / "crop", "tiny")
    # What is said first of a request with two faults: the one that --crop does not cure.
    with pytest.raises(
        TrainingError, match="holds no trained regressor, which confnet starts from; train one"
    ):
        train_quietly("confnet", source, tmp_path / "crop", "tiny")
    with pytest.raises(DatasetError, match="no such folder"):
        train_quietly("regressor", [(tmp_path / "nowhere", 1.0)], tmp_path / "x", "tiny")
    assert not (tmp_path / "x").exists()


def test_a_proposed_crop_fits_all_data_sets_and_is_within_the_preset_s() -> None:
    sizes = [("wide", (96, 400)), ("small", (200, 150))]
    for crop, proposal in (((128, 320), "128x64"), ((192, 128), "128x64")):
        with pytest.raises(TrainingError, match=rf"^wide: frames of 400x96 .* \(--crop {proposal}\)$"):
            check_sizes(sizes, crop)
    check_sizes(sizes, (64, 128))
    with pytest.raises(TrainingError, match=r"frames of 150x40 .* no crop can be smaller than 64x64"):
        check_sizes([("flat", (40, 150))], (128, 320))


def test_another_regressor_is_not_overwritten(data: Path, run: Path, tmp_path: Path) -> None:
    train_quietly("regressor", [(data, 1.0)], tmp_path, quick_regressor(), steps=2, seed=9)
    with pytest.raises(TrainingError, match="already holds another regressor"):
        train_quietly("gradnet", [(data, 1.0)], tmp_path, quick("gradnet"), init=run, steps=2)


def test_a_damaged_image_is_a_sentence(data: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(data, tmp_path / "set")
    image = next((copy / "frames_cleanpass" / "TRAIN").rglob("*.png"))
    image.write_bytes(image.read_bytes()[:100])
    with pytest.raises(DatasetError, match=image.name):
        train_quietly("regressor", [(copy, 1.0)], tmp_path / "run", quick_regressor(), steps=1)
