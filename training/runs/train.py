"""One training run, from data sets to weights."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import pytorch_lightning as pl
import torch
from pytorch_lightning.loggers import TensorBoardLogger

from datagen.sources.ground_truth import require_ground_truth
from datagen.sources.stereo_frame import StereoFrame
from training.data.pipeline import Source, StereoDataModule, open_sources
from training.data.pseudo_labels import with_pseudo_labels
from training.data.worker_errors import plain_worker_errors
from training.runs.building import BuiltTask, build_task
from training.runs.callbacks import BestWeights, RunProgress
from training.runs.checkpoints import RunCheckpoints, WholeCheckpoints
from training.runs.continuation import describe_continuation
from training.runs.interruption import Interruption
from training.runs.model_card import write_model_card
from training.runs.provenance import code_revision
from training.runs.request import RunPlan, TrainingRequest, plan_run
from training.runs.run_folder import (
    Continuation,
    checkpoint_path,
    claim_run_folder,
    only_writer,
    written_networks,
)
from training.runs.weights import TrainingSummary, read_summary, save_weights


def train(request: TrainingRequest) -> TrainingSummary:
    """Train one network and leave its best weights in the run folder, with a model card.

    Torch's global random state is the same afterwards as before.

    Returns:
        The summary of the weights that were kept.

    Raises:
        TrainingError: anything wrong with the request, the run folder or the weights; a loss that is not finite.
        DatasetError: anything wrong with a data set.
    """
    plan = plan_run(request)
    sources, held_out = _open_data(plan)
    request.out.mkdir(parents=True, exist_ok=True)
    with (
        only_writer(request.out, request.task),
        _quiet_lightning(),
        Interruption() as interruption,
        torch.random.fork_rng(),
        plain_worker_errors(),
    ):
        # Before any frame is decoded, which takes a while.
        continued = claim_run_folder(request.out, request.task, request.resume, plan.settings(sources))
        module = StereoDataModule(
            sources, held_out, plan.preset, plan.steps, request.seed, request.workers, request.cache_bytes
        )
        torch.manual_seed(request.seed)
        built = build_task(plan, module)
        callbacks = _callbacks(plan, built, _summary_of(plan, sources), interruption)
        if request.progress:
            remarks = [*_said_of(sources), *_remarks(plan, module, continued)]
            callbacks.append(RunProgress(f"{request.task} ({plan.preset_name})", remarks))
        checkpoint = None if continued is None else continued.checkpoint
        trainer = _trainer(plan, callbacks)
        trainer.fit(built.task, module, ckpt_path=checkpoint, weights_only=True)
        trainer.strategy.barrier()  # the first process writes what the others read now
    # The best weights may be those of a shorter run that this one continued.
    return replace(read_summary(request.out, written_networks(request.task)[0]), steps=plan.steps)


def _open_data(plan: RunPlan) -> tuple[list[Source], list[StereoFrame]]:
    """The data sets to train on and the frames to validate on, both with ground truth."""
    request, crop = plan.request, (plan.preset.crop_height, plan.preset.crop_width)
    sources, held_out = open_sources(request.data, crop, request.validation)
    if request.pseudo_labels is not None:
        sources = [with_pseudo_labels(sources, request.pseudo_labels, request.disparity_scale)]
    for (location, _), source in zip(request.data, sources, strict=True):
        require_ground_truth(str(location), source.frames)
    require_ground_truth(", ".join(map(str, request.validation or (d for d, _ in request.data))), held_out)
    return sources, held_out


def _summary_of(plan: RunPlan, sources: Sequence[Source]) -> TrainingSummary:
    """How the networks come about, before the first of them is kept."""
    return TrainingSummary(
        plan.preset_name,
        plan.steps,
        plan.request.seed,
        tuple((str(source), weight) for source, weight in plan.request.data),
        best_step=0,
        fingerprints=tuple(source.fingerprint for source in sources),
        revision=code_revision(),
        started_from=_start_of(plan.request),
    )


def _start_of(request: TrainingRequest) -> TrainingSummary | None:
    """How the regressor was trained that a regressor starts from."""
    if request.task not in ("regressor", "regressor_f"):
        return None
    if request.task == "regressor" and request.init is None:
        return None
    return read_summary(request.init or request.out, "regressor")


def _remarks(plan: RunPlan, module: StereoDataModule, continued: Continuation | None) -> list[str]:
    """What is worth saying before the run begins: of the data sets, and of where it goes on."""
    shares = zip(plan.request.data, module.impossible_shares(), strict=True)
    remarks = [f"{location}: {share}" for (location, _), share in shares if share]
    if continued is not None:
        note = describe_continuation(plan.preset, plan.steps, continued)
        remarks.append(f"{plan.request.task} ({plan.preset_name}): {note}")
    return remarks


def _said_of(sources: Sequence[Source]) -> Iterator[str]:
    return (remark for source in sources for remark in source.remarks)


def _callbacks(
    plan: RunPlan, built: BuiltTask, summary: TrainingSummary, interruption: Interruption
) -> list[pl.Callback]:
    checkpoint = checkpoint_path(plan.request.out, plan.request.task)
    return [BestWeights(_saver(plan, built, summary)), RunCheckpoints(checkpoint, interruption)]


def _saver(
    plan: RunPlan, built: BuiltTask, summary: TrainingSummary
) -> Callable[[int, dict[str, float]], None]:
    """What writes the networks as they are, after so many steps and with these validation figures."""
    out = plan.request.out

    def save(step: int, figures: dict[str, float]) -> None:
        description = replace(summary, best_step=step, validation=figures)
        for name, network in built.kept_networks(plan.request.task).items():
            save_weights(out, name, network, description, built.regressor_sha256)
        write_model_card(out)

    return save


def _trainer(plan: RunPlan, callbacks: list[pl.Callback]) -> pl.Trainer:
    return pl.Trainer(
        **plan.trainer_options,
        plugins=[WholeCheckpoints()],
        max_steps=plan.steps,
        max_epochs=-1,
        reload_dataloaders_every_n_epochs=1,
        use_distributed_sampler=False,
        gradient_clip_val=plan.preset.optimizer.clip_norm,
        callbacks=callbacks,
        logger=TensorBoardLogger(plan.logs.parent, name=plan.logs.name, version=""),
        log_every_n_steps=10,
        num_sanity_val_steps=0,
        enable_progress_bar=False,
        enable_model_summary=False,
    )


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
