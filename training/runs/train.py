"""One training run, from data sets to weights."""

from __future__ import annotations

import itertools
import json
import logging
import signal
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytorch_lightning as pl
import torch
from pytorch_lightning.loggers import TensorBoardLogger

from refine.methods.ours import Ours
from stereoforge_kit.files import alone, write_text
from training.data.pipeline import DEFAULT_CACHE_BYTES, Source, StereoDataModule, open_sources
from training.data.pseudo_labels import PseudoFrames
from training.errors import TrainingError
from training.networks import ConfNet, DispNetCorr1D, GradNet
from training.presets import (
    ConfNetPreset,
    FineTuningPreset,
    FreeConfNetPreset,
    FreeGradNetPreset,
    GradNetPreset,
    JointPreset,
    Preset,
    RegressorPreset,
    change_preset,
    find_preset,
)
from training.runs.callbacks import BestWeights, RunProgress
from training.runs.checkpoints import WholeCheckpoints, last_checkpoint
from training.runs.hardware import Precision, faster_layout, process_count, process_rank, trainer_options
from training.runs.model_card import write_model_card
from training.runs.provenance import code_revision
from training.runs.weights import (
    TrainingSummary,
    copy_weights,
    has_weights,
    load_confnet,
    load_gradnet,
    load_regressor,
    on_regressor,
    read_summary,
    save_weights,
)
from training.tasks import (
    ConfNetTask,
    FineTuningTask,
    FreeConfNetTask,
    FreeGradNetTask,
    GradNetTask,
    JointHeads,
    JointTask,
    RegressorTask,
    StereoTask,
)

CALIBRATION_BATCHES = 20
CHECKPOINT = "last.ckpt"
LOCK = ".lock"
LONGEST_SHOWN = 100
"""Of a setting in a complaint about it, in characters."""


def train(
    task: str,
    data: Sequence[tuple[str | Path, float]],
    out: Path,
    preset: str | Preset = "small",
    *,
    validation: Sequence[str | Path] = (),
    changes: Mapping[str, Any] | None = None,
    pseudo: Path | None = None,
    init: Path | None = None,
    refinement: Ours | None = None,
    resume: bool = False,
    steps: int | None = None,
    seed: int = 0,
    workers: int = 0,
    device: str = "auto",
    precision: Precision = "32",
    cache_bytes: int = DEFAULT_CACHE_BYTES,
    progress: bool = True,
) -> TrainingSummary:
    """Train one network and leave it in the run folder, with a model card.

    Args:
        task: `regressor`, `regressor_f` (eq. 9, starts from a regressor), `confnet` or `gradnet` (on a frozen one),
            `confnet_free` or `gradnet_free` (on semi-global matching, need no regressor), `joint` (confnet and
            gradnet of another run folder, trained further through the refinement).
        data: data sets (`datagen.sources.registry.open_source`) and their weights, how often each is drawn from; their
            train splits are trained on, their val splits decide which weights are kept.
        out: run folder; receives `<task>.safetensors`, `<task>.json` and `logs/<task>/`.
        preset: name of a preset, or one of your own.
        validation: data sets whose frames decide instead; needed where `data` has no val splits.
        changes: other values of some of the preset's fields.
        pseudo: folder of disparities (`training.data.pseudo_labels`) to train on instead of the set's own ground truth.
        init: run folder with the regressor to start from (`regressor`: optional) or to build on (other tasks: `out`
            by default, and copied there). `joint`: the run folder whose three networks to start from, not `out`.
        refinement: `joint`: what to train through, its gradient term quadratic; the MRF with its default parameters if
            None.
        resume: continue from the last checkpoint, as if never interrupted; starts anew where there is none.
        steps: length of the run, the preset's by default; all its schedules are scaled to it.
        workers: processes that prepare crops; results do not depend on their number.
        device: `auto`, `cpu`, `cuda`, `cuda:1`, ...; under torchrun every process takes one, and a step its crops.
        precision: bits of the convolutions.
        cache_bytes: memory for decoded frames.

    Returns:
        What is known of the weights that were kept.

    Raises:
        TrainingError: anything wrong with the request, the run folder or the weights; a loss that is not finite.
        DatasetError: anything wrong with a data set.
    """
    preset_name = preset if isinstance(preset, str) else "custom"
    preset = find_preset(task, preset) if isinstance(preset, str) else preset
    if changes:
        preset = change_preset(preset, changes)
        preset_name += " with " + ", ".join(f"{name} {value}" for name, value in changes.items())
    steps = preset.steps if steps is None else steps
    if steps < 1:
        raise TrainingError(f"a run needs at least one step, got {steps}")
    _require_regressor(task, preset, out, init)
    hardware = trainer_options(device, precision)
    sources, held_out = open_sources(data, (preset.crop_height, preset.crop_width), validation)
    if pseudo is not None:
        sources = [_with_pseudo_truth(sources, pseudo)]
        preset_name += f", truth from {pseudo}"
    out.mkdir(parents=True, exist_ok=True)
    logs = out / "logs" / task
    if isinstance(preset, JointPreset):
        refinement = refinement or Ours()
        if refinement.gradient_scale is not None:
            raise TrainingError(
                "joint trains through the MRF with the paper's quadratic gradient term, not with a robust one"
            )
    elif refinement is not None:
        raise TrainingError(f"only joint trains through a refinement, {task} does not")
    settings = {
        "preset": asdict(preset),
        "steps": steps,
        "seed": seed,
        # What they are, not where: a data set may be named by another path, or moved.
        "data": [[source.fingerprint, source.weight] for source in sources],
        "validation": [str(source) for source in validation],
        "pseudo": None if pseudo is None else str(pseudo),
        "precision": precision,
        "processes": process_count(),
        "refinement": None if refinement is None else asdict(refinement),
    }
    with _only_writer(out, task), _quiet_lightning(), _interruptible(), torch.random.fork_rng():
        checkpoint = _prepare(out, task, resume, settings)  # before any frame is decoded
        module = StereoDataModule(sources, held_out, preset, steps, seed, workers, cache_bytes)
        summary = TrainingSummary(
            preset_name,
            steps,
            seed,
            tuple((str(source), weight) for source, weight in data),
            best_step=0,
            fingerprints=tuple(source.fingerprint for source in sources),
            revision=code_revision(),
        )
        torch.manual_seed(seed)
        lightning_task, regressor_sha256 = _build_task(preset, module, out, init, refinement, steps, seed)
        if hardware["accelerator"] == "cpu" or precision != "32" or not torch.cuda.is_available():
            faster_layout(lightning_task)
        lightning_task.mixed_precision = precision != "32"
        if preset.ema_decay is not None:
            lightning_task.average_weights(preset.ema_decay)

        def save(step: int, figures: dict[str, float]) -> None:
            description = replace(summary, best_step=step, validation=figures)
            for name, network in _kept_networks(task, lightning_task).items():
                save_weights(out, name, network, description, regressor_sha256)
            write_model_card(out)

        callbacks: list[pl.Callback] = [BestWeights(save), last_checkpoint(logs / CHECKPOINT)]
        if progress:
            callbacks.append(RunProgress(f"{task} ({preset_name})"))
        trainer = _trainer(preset, steps, logs, callbacks, hardware)
        trainer.fit(lightning_task, module, ckpt_path=checkpoint, weights_only=True)
        trainer.strategy.barrier()  # the first process writes what the others read now
    return read_summary(out, written_by(task)[0])


def _require_regressor(task: str, preset: Preset, out: Path, init: Path | None) -> None:
    """Raise TrainingError where the regressor to build on is missing: the first thing to know, before any data."""
    if isinstance(preset, JointPreset) and (init is None or init.resolve() == out.resolve()):
        raise TrainingError("joint starts from another run folder's networks: name it as init (--init)")
    if isinstance(preset, FreeConfNetPreset | FreeGradNetPreset):
        return
    if isinstance(preset, RegressorPreset) and init is None:
        return
    folder = out if init is None else init
    if not has_weights(folder, "regressor"):
        raise TrainingError(
            f"{folder}: holds no trained regressor, which {task} starts from; train one into it first, or name the run "
            "folder that has one as init (--init)"
        )


def written_by(task: str) -> tuple[str, ...]:
    """The networks that a task leaves in its run folder."""
    return ("confnet", "gradnet") if task == "joint" else (task,)


def _kept_networks(task: str, lightning_task: StereoTask) -> dict[str, Any]:
    kept = lightning_task.kept_network
    parts = [kept.confnet, kept.gradnet] if isinstance(kept, JointHeads) else [kept]
    return dict(zip(written_by(task), parts, strict=True))


def _only_writer(out: Path, task: str) -> AbstractContextManager[None]:
    """Keep a second run out of the folder: it would write over the first one's checkpoints and weights."""
    if process_rank() > 0:  # torchrun's other processes write nothing
        return nullcontext()
    busy = TrainingError(
        f"{out}: another process is training its {task} right now; wait for it, or choose another folder"
    )
    return alone(out / "logs" / task / LOCK, busy)


def _prepare(out: Path, task: str, resume: bool, settings: dict[str, Any]) -> Path | None:
    """Check that the run folder is fit for the run, note its settings, and find the checkpoint to continue from.

    A run killed before its first checkpoint starts anew.
    """
    logs = out / "logs" / task
    noted = logs / "settings.json"
    if resume and noted.is_file():
        _check_settings(noted, settings)
    else:
        for name in written_by(task):
            if has_weights(out, name):
                raise TrainingError(
                    f"{out}: already holds a {name}; continue it with --resume or choose another folder"
                )
    if process_rank() == 0:
        write_text(noted, json.dumps(settings, indent=2) + "\n")
    checkpoint = logs / CHECKPOINT
    return checkpoint if resume and checkpoint.is_file() else None


def _with_pseudo_truth(sources: Sequence[Source], folder: Path) -> Source:
    if len(sources) != 1:
        raise TrainingError("disparities to train on instead of the truth need exactly one data set")
    return replace(sources[0], frames=PseudoFrames(sources[0].frames, folder))


def _build_task(
    preset: Preset,
    module: StereoDataModule,
    out: Path,
    init: Path | None,
    refinement: Ours | None,
    steps: int,
    seed: int,
) -> tuple[StereoTask, str | None]:
    """The task of a preset with its networks, and the digest of the regressor a head is built on."""
    if isinstance(preset, RegressorPreset):
        return RegressorTask(preset, _new_regressor(preset, module, init), steps, seed), None
    if isinstance(preset, FreeConfNetPreset | FreeGradNetPreset):
        return _build_free_task(preset, module, steps, seed), None
    regressor = load_regressor(_with_regressor(out, init))
    if isinstance(preset, FineTuningPreset):
        return FineTuningTask(preset, regressor.network, steps, seed), None
    if isinstance(preset, JointPreset):
        assert init is not None
        assert refinement is not None
        heads = JointHeads(
            on_regressor(init, "confnet", load_confnet(init), regressor.sha256),
            on_regressor(init, "gradnet", load_gradnet(init), regressor.sha256),
        )
        joint = JointTask(preset, regressor.network, heads.train(), refinement, steps, seed)
        return joint, regressor.sha256
    task: ConfNetTask | GradNetTask
    if isinstance(preset, ConfNetPreset):
        confnet = ConfNet(preset.network.on(regressor.network))
        task = ConfNetTask(preset, regressor.network, confnet, steps, seed)
    elif isinstance(preset, GradNetPreset):
        gradnet = GradNet(preset.network.on(regressor.network))
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
    """The run folder with the regressor, copied to `out` from `init` if need be."""
    if init is None or init.resolve() == out.resolve():
        return out
    if process_rank() > 0:
        return init
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


def _trainer(
    preset: Preset, steps: int, logs: Path, callbacks: list[pl.Callback], hardware: dict[str, Any]
) -> pl.Trainer:
    return pl.Trainer(
        **hardware,
        plugins=[WholeCheckpoints()],
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


def _check_settings(path: Path, settings: dict[str, Any]) -> None:
    """A resumed run must be the interrupted one."""
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise TrainingError(f"{path}: cannot be read, so the run cannot be resumed ({error})") from error
    for key, value in json.loads(json.dumps(settings)).items():
        if stored.get(key) != value:
            raise TrainingError(
                f"{path}: the run was started with another {key} ({_brief(stored.get(key))}, not {_brief(value)}), "
                "so it cannot be resumed"
            )


def _brief(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]} ..."


@contextmanager
def _quiet_lightning() -> Iterator[None]:
    """Keep Lightning's hardware notes and advice off the terminal."""
    logger = logging.getLogger("pytorch_lightning")
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module="pytorch_lightning")
            yield
    finally:
        logger.setLevel(level)


@contextmanager
def _interruptible() -> Iterator[None]:
    """Let an interruption out as the KeyboardInterrupt it was: Lightning makes it SystemExit, and turns a deaf ear to
    further ones."""
    before = signal.getsignal(signal.SIGINT)
    try:
        yield
    except SystemExit as end:
        if not isinstance(end.__context__, KeyboardInterrupt):
            raise
        signal.signal(signal.SIGINT, before)
        raise end.__context__ from None
