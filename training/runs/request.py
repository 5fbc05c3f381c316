"""What a training run is asked to do, and the plan that a sound request becomes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from refine.methods.ours import Ours
from training.data.pipeline import DEFAULT_CACHE_BYTES, Source
from training.errors import TrainingError
from training.preset_kinds import (
    JointPreset,
    Preset,
    RegressorFreeConfNetPreset,
    RegressorFreeGradNetPreset,
    RegressorPreset,
)
from training.presets import DEFAULT_NETWORK, change_preset, find_preset
from training.runs.hardware import Precision, process_count, trainer_options
from training.runs.weights import has_weights, load_regressor


@dataclass(frozen=True)
class TrainingRequest:
    """One network to train, on which data, into which run folder."""

    task: str
    """`regressor`, `regressor_f` (fine-tunes a regressor with eq. 9), `confnet` or `gradnet` (on a frozen regressor),
    `confnet_free` or `gradnet_free` (on semi-global matching, without a regressor), or `joint` (trains the confnet and
    gradnet of another run folder further, through the refinement)."""
    data: tuple[tuple[str | Path, float], ...]
    """Data sets, as `datagen.sources.registry.open_source` takes them, each with how often it is drawn from relative to
    the others. Their train splits are trained on; their val splits decide which weights are kept."""
    out: Path
    """Run folder. It receives `<task>.safetensors`, `<task>.json`, `model_card.md` and `logs/<task>/`."""
    preset: str | Preset = "small"
    """Name of one of the task's presets, or a preset of your own."""
    validation: tuple[str | Path, ...] = ()
    """Data sets whose frames decide which weights are kept, instead of the val splits of `data`."""
    network: str = DEFAULT_NETWORK
    """`regressor` with the name of a preset: which network, as `training.networks.regressors.registry` knows it."""
    changes: Mapping[str, Any] = field(default_factory=dict)
    """Other values for some of the preset's fields."""
    pseudo_labels: Path | None = None
    """Folder of disparities (`training.data.pseudo_labels`) to train on instead of the data set's ground truth."""
    disparity_scale: float | None = None
    """What a pixel of disparity is stored as in the pseudo labels; None for what their formats say."""
    init: Path | None = None
    """Run folder of the regressor to start from (`regressor`: a new one by default) or to build on (other tasks: `out`
    by default; from another folder it is copied to `out`). `joint` starts from all three networks of this folder,
    which must not be `out`."""
    refinement: Ours | None = None
    """`joint` only: the refinement to train through, with the paper's quadratic gradient term; None takes the default
    parameters."""
    resume: bool = False
    """Continue from the last checkpoint as if never interrupted, or with more `steps` than before; without a checkpoint
    the run starts anew."""
    steps: int | None = None
    """Optimizer steps, the preset's by default. All schedules are scaled to them."""
    seed: int = 0
    """Everything random follows from it."""
    workers: int = 0
    """Processes that prepare crops. Results do not depend on their number."""
    device: str = "auto"
    """As `training.devices.parse_device` takes it; under torchrun every process takes one device and its
    share of a step."""
    precision: Precision = "32"
    """Bits of the convolutions."""
    cache_bytes: int = DEFAULT_CACHE_BYTES
    """Memory for decoded frames."""
    progress: bool = True
    """Show a progress bar and the validation figures on the terminal."""


@dataclass(frozen=True)
class RunPlan:
    """A request that can be carried out, with everything looked up that needs no data set."""

    request: TrainingRequest
    """What was asked for."""
    preset: Preset
    """The preset with the request's changes."""
    preset_name: str
    """The preset and its changes in words, for the model card."""
    steps: int
    """Optimizer steps."""
    refinement: Ours | None
    """What `joint` trains through; None for the other tasks."""
    judged: str | None
    """Digest of the regressor whose disparities regressor-free heads learn from too; None for other tasks."""
    trainer_options: Mapping[str, Any]
    """Device, precision and processes in Lightning's words."""

    @property
    def logs(self) -> Path:
        """Folder of the run's checkpoint, settings and TensorBoard files."""
        return self.request.out / "logs" / self.request.task

    def settings(self, sources: Sequence[Source]) -> dict[str, Any]:
        """Everything that decides the weights, as JSON values: a resumed run must have the same."""
        request = self.request
        return {
            "preset": asdict(self.preset),
            "steps": self.steps,
            "seed": request.seed,
            # What the data sets are, not where: one may be named by another path, or moved.
            "data": [[source.fingerprint, source.weight] for source in sources],
            "validation": [str(source) for source in request.validation],
            "pseudo_labels": None if request.pseudo_labels is None else _pseudo_labels(request),
            "precision": request.precision,
            "processes": process_count(),
            "refinement": None if self.refinement is None else asdict(self.refinement),
            "judged": self.judged,
        }


def _pseudo_labels(request: TrainingRequest) -> str:
    scale = "" if request.disparity_scale is None else f" / {request.disparity_scale:g}"
    return f"{request.pseudo_labels}{scale}"


def plan_run(request: TrainingRequest) -> RunPlan:
    """Look up what a request names and check all that can be checked before a data set is opened.

    Raises:
        TrainingError: an unknown task, preset, field or device, no steps, a missing regressor, or a refinement that
            cannot be trained through.
    """
    preset, name = _changed_preset(request)
    steps = preset.steps if request.steps is None else request.steps
    if steps < 1:
        raise TrainingError(f"a run needs at least one step, got {steps}")
    _require_regressor(request, preset)
    options = trainer_options(request.device, request.precision)
    refinement, judged = _refinement_of(request, preset), _judged_by_free_heads(request, preset)
    return RunPlan(request, preset, name, steps, refinement, judged, options)


def _changed_preset(request: TrainingRequest) -> tuple[Preset, str]:
    """The preset with the request's changes, and both in words."""
    if isinstance(request.preset, str):
        preset, name = find_preset(request.task, request.preset, request.network), request.preset
    else:
        preset, name = request.preset, "custom"
    if request.changes:
        preset = change_preset(preset, request.changes)
        name += " with " + ", ".join(f"{field} {value}" for field, value in request.changes.items())
    if request.pseudo_labels is not None:
        name += f", pseudo labels from {_pseudo_labels(request)}"
    if isinstance(preset, RegressorFreeConfNetPreset | RegressorFreeGradNetPreset) and request.init:
        name += f", half on the disparity of {request.init}"
    return preset, name


def _judged_by_free_heads(request: TrainingRequest, preset: Preset) -> str | None:
    """Digest of the regressor that regressor-free heads are given."""
    free = isinstance(preset, RegressorFreeConfNetPreset | RegressorFreeGradNetPreset)
    return load_regressor(request.init).sha256 if free and request.init is not None else None


def _refinement_of(request: TrainingRequest, preset: Preset) -> Ours | None:
    """What `joint` trains through. Raises TrainingError for a robust one, or where another task is given one."""
    if not isinstance(preset, JointPreset):
        if request.refinement is not None:
            raise TrainingError(f"only joint trains through a refinement, {request.task} does not")
        return None
    refinement = request.refinement or Ours()
    if refinement.gradient_scale is not None:
        raise TrainingError(
            "joint trains through the MRF with the paper's quadratic gradient term, not with a robust one"
        )
    return refinement


def _require_regressor(request: TrainingRequest, preset: Preset) -> None:
    """Raise TrainingError where the regressor to build on is missing: the first thing to know, before any data."""
    out, init = request.out, request.init
    if isinstance(preset, JointPreset) and (init is None or init.resolve() == out.resolve()):
        raise TrainingError("joint starts from another run folder's networks: name it as init (--init)")
    if isinstance(preset, RegressorFreeConfNetPreset | RegressorFreeGradNetPreset) and init is None:
        return
    if isinstance(preset, RegressorPreset) and init is None:
        if preset.frozen:
            raise TrainingError(
                "frozen parts keep the weights of another run: name its folder as init (--init)"
            )
        return
    folder = out if init is None else init
    if not has_weights(folder, "regressor"):
        raise TrainingError(
            f"{folder}: holds no trained regressor, which {request.task} starts from; train one into it first, or name "
            "the run folder that has one as init (--init)"
        )
