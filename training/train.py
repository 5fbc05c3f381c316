"""One training run, from data sets to weights."""

from __future__ import annotations

import itertools
import json
import logging
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytorch_lightning as pl
import torch
from pytorch_lightning.callbacks import ModelCheckpoint
from pytorch_lightning.loggers import TensorBoardLogger

from storage import write_text
from training.callbacks import BestWeights, RunProgress
from training.data import DEFAULT_CACHE_BYTES, StereoDataModule, open_sources
from training.errors import TrainingError
from training.networks import ConfNet, DispNetCorr1D, GradNet
from training.presets import (
    ConfNetPreset,
    FineTuningPreset,
    FreeConfNetPreset,
    FreeGradNetPreset,
    GradNetPreset,
    Preset,
    RegressorPreset,
    find_preset,
)
from training.tasks import (
    ConfNetTask,
    FineTuningTask,
    FreeConfNetTask,
    FreeGradNetTask,
    GradNetTask,
    RegressorTask,
    StereoTask,
)
from training.weights import (
    TrainingSummary,
    copy_weights,
    has_weights,
    load_regressor,
    read_summary,
    save_weights,
)

CALIBRATION_BATCHES = 20


def train(
    task: str,
    data: Sequence[tuple[str | Path, float]],
    out: Path,
    preset: str | Preset = "small",
    *,
    validation: Sequence[str | Path] = (),
    init: Path | None = None,
    resume: bool = False,
    steps: int | None = None,
    seed: int = 0,
    workers: int = 0,
    device: str = "auto",
    cache_bytes: int = DEFAULT_CACHE_BYTES,
    progress: bool = True,
) -> TrainingSummary:
    """Train one network and leave it in the run folder.

    Args:
        task: `regressor`, `regressor_f` (eq. 9, starts from a regressor), `confnet` or `gradnet` (on a frozen one),
            `confnet_free` or `gradnet_free` (on semi-global matching, need no regressor).
        data: data sets (`datagen.source.open_source`) and their weights, how often each is drawn from; their train
            splits are trained on, their val splits decide which weights are kept.
        out: run folder; receives `<task>.safetensors`, `<task>.json` and `logs/<task>/`.
        preset: name of a preset, or one of your own.
        validation: data sets whose frames decide instead; needed where `data` has no val splits.
        init: run folder with the regressor to start from (`regressor`: optional) or to build on (other tasks: `out`
            by default, and copied there).
        resume: continue from the last checkpoint, as if never interrupted; starts anew where there is none.
        steps: length of the run, the preset's by default; all its schedules are scaled to it.
        workers: processes that prepare crops; results do not depend on their number.
        device: `auto`, `cpu`, `cuda`, `cuda:1`, ...
        cache_bytes: memory for decoded frames.

    Returns:
        What is known of the weights that were kept.

    Raises:
        TrainingError: anything wrong with the request, the run folder or the weights; a loss that is not finite.
        DatasetError: anything wrong with a data set.
    """
    preset_name = preset if isinstance(preset, str) else "custom"
    preset = find_preset(task, preset) if isinstance(preset, str) else preset
    steps = preset.steps if steps is None else steps
    if steps < 1:
        raise TrainingError(f"a run needs at least one step, got {steps}")
    out.mkdir(parents=True, exist_ok=True)
    logs = out / "logs" / task
    checkpoint = logs / "last.ckpt"
    settings = {
        "preset": asdict(preset),
        "steps": steps,
        "seed": seed,
        "data": [[str(f), w] for f, w in data],
        "validation": [str(source) for source in validation],
    }
    resume = resume and checkpoint.is_file()
    if resume:
        _check_settings(logs / "settings.json", settings)
    elif has_weights(out, task):
        raise TrainingError(
            f"{out}: already holds a {task}; continue it with --resume or choose another folder"
        )
    write_text(logs / "settings.json", json.dumps(settings, indent=2) + "\n")

    sources, held_out = open_sources(data, (preset.crop_height, preset.crop_width), validation)
    module = StereoDataModule(sources, held_out, preset, steps, seed, workers, cache_bytes)
    summary = TrainingSummary(preset_name, steps, seed, tuple((str(f), w) for f, w in data), best_step=0)
    with _quiet_lightning(), torch.random.fork_rng():
        torch.manual_seed(seed)
        lightning_task, regressor_sha256 = _build_task(preset, module, out, init, steps, seed)

        def save(step: int, figures: dict[str, float]) -> None:
            description = replace(summary, best_step=step, validation=figures)
            save_weights(out, task, lightning_task.network, description, regressor_sha256)

        callbacks: list[pl.Callback] = [BestWeights(save), _last_checkpoint(checkpoint)]
        if progress:
            callbacks.append(RunProgress(f"{task} ({preset_name})"))
        trainer = _trainer(preset, steps, logs, callbacks, device)
        trainer.fit(lightning_task, module, ckpt_path=checkpoint if resume else None, weights_only=True)
    return read_summary(out, task)


def _build_task(
    preset: Preset, module: StereoDataModule, out: Path, init: Path | None, steps: int, seed: int
) -> tuple[StereoTask, str | None]:
    """The task of a preset with its networks, and the digest of the regressor a head is built on."""
    if isinstance(preset, RegressorPreset):
        return RegressorTask(preset, _new_regressor(preset, module, init), steps, seed), None
    if isinstance(preset, FreeConfNetPreset | FreeGradNetPreset):
        return _build_free_task(preset, module, steps, seed), None
    regressor = load_regressor(_with_regressor(out, init))
    if isinstance(preset, FineTuningPreset):
        return FineTuningTask(preset, regressor.network, steps, seed), None
    channels = regressor.network.feature_channels
    task: ConfNetTask | GradNetTask
    if isinstance(preset, ConfNetPreset):
        confnet = ConfNet(replace(preset.network, feature_channels=channels))
        task = ConfNetTask(preset, regressor.network, confnet, steps, seed)
    elif isinstance(preset, GradNetPreset):
        gradnet = GradNet(replace(preset.network, feature_channels=channels))
        task = GradNetTask(preset, regressor.network, gradnet, steps, seed)
    else:
        raise TypeError(f"no task trains a {type(preset).__name__}")
    _calibrate(task, module)
    return task, regressor.sha256


def _build_free_task(
    preset: FreeConfNetPreset | FreeGradNetPreset, module: StereoDataModule, steps: int, seed: int
) -> StereoTask:
    """The task of a head that needs no regressor."""
    task: FreeConfNetTask | FreeGradNetTask
    if isinstance(preset, FreeConfNetPreset):
        task = FreeConfNetTask(preset, ConfNet(preset.network), steps, seed)
    else:
        task = FreeGradNetTask(preset, GradNet(preset.network), steps, seed)
    _calibrate(task, module)
    return task


def _new_regressor(preset: RegressorPreset, module: StereoDataModule, init: Path | None) -> DispNetCorr1D:
    if init is None:
        network = DispNetCorr1D(preset.network)
        network.image_mean.copy_(torch.from_numpy(module.image_mean()))
        return network
    network = load_regressor(init).network
    if network.config != preset.network:
        raise TrainingError(f"{init}: its regressor is {network.config}, the preset's {preset.network}")
    return network.train()


def _with_regressor(out: Path, init: Path | None) -> Path:
    """The run folder with the regressor, copied there from `init` first if need be."""
    if init is None or init.resolve() == out.resolve():
        return out
    if not has_weights(out, "regressor"):
        copy_weights(init, out, "regressor")
    elif load_regressor(init).sha256 != load_regressor(out).sha256:
        raise TrainingError(f"{out}: already holds another regressor than {init}")
    return out


@torch.no_grad()
def _calibrate(
    task: ConfNetTask | GradNetTask | FreeConfNetTask | FreeGradNetTask, module: StereoDataModule
) -> None:
    """Give a head the mean and deviation of its input channels over the first crops of the run."""
    batches = itertools.islice(module.block(0), CALIBRATION_BATCHES)
    joined = torch.cat([task.network.joined_input(*task.head_inputs(batch)[0]) for batch in batches])
    task.network.standardize(joined.mean((0, 2, 3)), joined.std((0, 2, 3)))


def _last_checkpoint(path: Path) -> ModelCheckpoint:
    """Everything needed to continue, replaced (atomically, by Lightning) after every validation."""
    return ModelCheckpoint(
        dirpath=path.parent,
        filename=path.stem,
        save_top_k=1,
        enable_version_counter=False,
        save_on_train_epoch_end=True,
    )


def _trainer(preset: Preset, steps: int, logs: Path, callbacks: list[pl.Callback], device: str) -> pl.Trainer:
    return pl.Trainer(
        **_hardware(device),
        max_steps=steps,
        max_epochs=-1,
        reload_dataloaders_every_n_epochs=1,
        use_distributed_sampler=False,
        gradient_clip_val=preset.optimizer.clip_norm,
        callbacks=callbacks,
        logger=TensorBoardLogger(logs.parent, name=logs.name, version=""),
        log_every_n_steps=10,
        num_sanity_val_steps=0,
        enable_progress_bar=False,
        enable_model_summary=False,
    )


def _hardware(device: str) -> dict[str, Any]:
    """Lightning's words for `auto`, `cpu`, `cuda`, `cuda:1`, ..."""
    kind, _, index = device.partition(":")
    try:
        torch.device("cpu" if kind == "auto" else device)
    except RuntimeError as error:
        raise TrainingError(f"there is no device {device!r}; try auto, cpu, cuda or cuda:1") from error
    if kind == "cuda" and not torch.cuda.is_available():
        raise TrainingError(f"cannot train on {device}: torch finds no GPU here")
    return {"accelerator": kind, "devices": [int(index)] if index and kind != "cpu" else 1}


def _check_settings(path: Path, settings: dict[str, Any]) -> None:
    """A resumed run must be the interrupted one."""
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise TrainingError(f"{path}: cannot be read, so the run cannot be resumed ({error})") from error
    for key, value in json.loads(json.dumps(settings)).items():
        if stored.get(key) != value:
            raise TrainingError(
                f"{path}: the run was started with another {key}, so it cannot be resumed with this"
            )


@contextmanager
def _quiet_lightning() -> Iterator[None]:
    """Keep Lightning's hardware notes and advice off the terminal."""
    logger = logging.getLogger("pytorch_lightning.utilities.rank_zero")
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module="pytorch_lightning")
            yield
    finally:
        logger.setLevel(level)
