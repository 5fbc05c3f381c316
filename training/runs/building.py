"""The networks that a run trains, inside the Lightning task that trains them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import torch

from training.data.pipeline import StereoDataModule
from training.errors import TrainingError
from training.networks import ConfNet, GradNet, Regressor
from training.networks.layout import faster_layout
from training.networks.regressors.registry import regressor_for
from training.preset_kinds import (
    ConfNetPreset,
    FineTuningPreset,
    GradNetPreset,
    JointPreset,
    RegressorFreeConfNetPreset,
    RegressorFreeGradNetPreset,
    RegressorPreset,
)
from training.runs.hardware import process_rank
from training.runs.request import RunPlan
from training.runs.run_folder import written_networks
from training.runs.weights import (
    StoredNetwork,
    copy_weights,
    has_weights,
    load_confnet,
    load_gradnet,
    load_regressor,
    on_regressor,
)
from training.tasks import (
    ConfNetTask,
    FineTuningTask,
    GradNetTask,
    JointHeads,
    JointTask,
    RegressorFreeConfNetTask,
    RegressorFreeGradNetTask,
    RegressorTask,
    StereoTask,
)

CALIBRATION_BATCHES = 20
"""Batches over which the statistics of a head's input channels are measured."""


@dataclass(frozen=True)
class BuiltTask:
    """A task with its networks, ready to be trained."""

    task: StereoTask
    """The Lightning module."""
    regressor_sha256: str | None
    """Digest of the regressor that heads are built on; None for the other tasks."""

    def kept_networks(self, name: str) -> dict[str, Regressor | ConfNet | GradNet]:
        """The networks to save, by the names of their files; `name` is the task's."""
        kept = self.task.kept_network
        parts = (kept.confnet, kept.gradnet) if isinstance(kept, JointHeads) else (kept,)
        return dict(zip(written_networks(name), parts, strict=True))


def build_task(plan: RunPlan, module: StereoDataModule) -> BuiltTask:
    """Build the task of a plan with new networks, or with those of the run folder that it starts from.

    Reads torch's global random state for new weights.

    Raises:
        TrainingError: missing or damaged weights, or weights of another regressor.
    """
    built = _with_networks(plan, module)
    on_cpu = plan.trainer_options["accelerator"] == "cpu" or not torch.cuda.is_available()
    mixed = plan.request.precision != "32"
    if on_cpu or mixed:
        faster_layout(built.task)
    built.task.mixed_precision = mixed
    if plan.preset.ema_decay is not None:
        built.task.average_weights(plan.preset.ema_decay)
    return built


def _with_networks(plan: RunPlan, module: StereoDataModule) -> BuiltTask:
    preset, steps, seed = plan.preset, plan.steps, plan.request.seed
    if isinstance(preset, RegressorPreset):
        network = _regressor_to_train(preset, module, plan.request.init)
        return BuiltTask(RegressorTask(preset, network, steps, seed), None)
    if isinstance(preset, RegressorFreeConfNetPreset | RegressorFreeGradNetPreset):
        init = plan.request.init
        judged = None if init is None else load_regressor(init).network
        free_task = _regressor_free_task(preset, judged, steps, seed)
        _calibrate(free_task, module)
        return BuiltTask(free_task, None)
    regressor = load_regressor(_regressor_folder(plan))
    if isinstance(preset, FineTuningPreset):
        return BuiltTask(FineTuningTask(preset, regressor.network, steps, seed), None)
    if isinstance(preset, JointPreset):
        return BuiltTask(_joint_task(plan, preset, regressor), regressor.sha256)
    if isinstance(preset, ConfNetPreset | GradNetPreset):
        head_task = _head_task(preset, regressor.network, steps, seed)
        _calibrate(head_task, module)
        return BuiltTask(head_task, regressor.sha256)
    raise TypeError(f"no task trains a {type(preset).__name__}")


def _head_task(
    preset: ConfNetPreset | GradNetPreset, regressor: Regressor, steps: int, seed: int
) -> ConfNetTask | GradNetTask:
    if isinstance(preset, ConfNetPreset):
        return ConfNetTask(preset, regressor, ConfNet(preset.network.on(regressor)), steps, seed)
    return GradNetTask(preset, regressor, GradNet(preset.network.on(regressor)), steps, seed)


def _regressor_free_task(
    preset: RegressorFreeConfNetPreset | RegressorFreeGradNetPreset,
    regressor: Regressor | None,
    steps: int,
    seed: int,
) -> RegressorFreeConfNetTask | RegressorFreeGradNetTask:
    if isinstance(preset, RegressorFreeConfNetPreset):
        return RegressorFreeConfNetTask(preset, regressor, ConfNet(preset.network), steps, seed)
    return RegressorFreeGradNetTask(preset, regressor, GradNet(preset.network), steps, seed)


def _joint_task(plan: RunPlan, preset: JointPreset, regressor: StoredNetwork[Regressor]) -> JointTask:
    init, refinement = plan.request.init, plan.refinement
    assert init is not None
    assert refinement is not None
    heads = JointHeads(
        on_regressor(init, "confnet", load_confnet(init), regressor.sha256),
        on_regressor(init, "gradnet", load_gradnet(init), regressor.sha256),
    )
    return JointTask(preset, regressor.network, heads.train(), refinement, plan.steps, plan.request.seed)


def _regressor_to_train(preset: RegressorPreset, module: StereoDataModule, init: Path | None) -> Regressor:
    """A new regressor that knows the data's mean colour, or the one of the run folder `init`."""
    if init is None:
        network: Regressor = regressor_for(preset.network)(preset.network)
        network.image_mean.copy_(torch.from_numpy(module.image_mean()))
        return network
    network = load_regressor(init).network
    if network.config != preset.network:
        raise TrainingError(f"{init}: its regressor is {network.config}, the preset's {preset.network}")
    return network.train()


def _regressor_folder(plan: RunPlan) -> Path:
    """The run folder with the regressor, which is copied from `init` to `out` first if need be."""
    out, init = plan.request.out, plan.request.init
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
    task: ConfNetTask | GradNetTask | RegressorFreeConfNetTask | RegressorFreeGradNetTask,
    module: StereoDataModule,
) -> None:
    """Give a head the mean and standard deviation of its input channels over the first crops of the run."""
    batches = itertools.islice(module.block(0), CALIBRATION_BATCHES)
    joined = torch.cat([task.network.joined_input(*task.head_inputs(batch)[0]) for batch in batches])
    task.network.standardize(joined.mean((0, 2, 3)), joined.std((0, 2, 3)))
