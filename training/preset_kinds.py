"""The kinds of presets: which numbers a training run of each task has. The numbers are in `training.presets`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from stereoforge_kit.matching import SGBMParameters
from training.data.sampling import SamplingConfig
from training.networks import PUBLISHED_GRADNET, HeadConfig
from training.networks.regressors.interface import Objective, RegressorConfig


@dataclass(frozen=True)
class OptimizerConfig:
    """Adam and the schedule of its learning rate.

    Steps are those of the preset; a run of another length scales them.
    """

    learning_rate: float = 1e-4
    """The largest rate, after the warm-up."""
    schedule: Literal["halving", "cosine"] = "halving"
    """`halving` halves the rate at each of `halve_at`; `cosine` brings it to zero at the end."""
    halve_at: tuple[int, ...] = ()
    """Steps at which the schedule `halving` halves the rate."""
    warmup_steps: int = 0
    """Steps over which the rate grows linearly, from the first."""
    betas: tuple[float, float] = (0.9, 0.999)
    """Adam's beta 1 and beta 2."""
    epsilon: float = 1e-4
    """Adam's epsilon."""
    weight_decay: float = 0.0
    """L2 penalty, in a regressor on the weights of the encoder's convolutions, in a head on all parameters."""
    clip_norm: float | None = None
    """Norm at which the gradient is clipped; None does not clip."""


@dataclass(frozen=True, kw_only=True)
class Preset(SamplingConfig):
    """What every training run has."""

    steps: int
    """Optimizer steps."""
    optimizer: OptimizerConfig
    """Adam and its learning rate."""
    ema_decay: float | None = None
    """Decay per step of an exponential moving average of the weights, which is then what is validated and kept; None
    keeps the weights themselves."""
    fixed_statistics: float = 0.0
    """Share of the run, at its end, over which BatchNorm normalises by fixed statistics, as it does in prediction, so
    that the weights adapt to them (ours). 0 normalises every batch by its own statistics to the end; 1 keeps the
    statistics of the network that the run starts from."""


@dataclass(frozen=True, kw_only=True)
class DisparityPreset(Preset):
    """What every training of a regressor has."""

    frozen: tuple[str, ...] = ()
    """Parts of the network (`named_children`) that stay as they were in the run folder that the training starts from,
    with the statistics of their BatchNorm."""


@dataclass(frozen=True, kw_only=True)
class RegressorPreset(DisparityPreset):
    """A regressor from scratch."""

    network: RegressorConfig
    """Options of the network; their type says which network it is."""
    objective: Objective
    """What the network is trained to minimise."""


@dataclass(frozen=True, kw_only=True)
class FineTuningPreset(DisparityPreset):
    """`regressor_f`: a trained regressor, fine-tuned with eq. 9.

    Its presets do not zoom, since eq. 9 takes differences of the ground truth, and a zoomed map of nearest pixels has
    steps.
    """

    gradient_weight: float = 5.0
    """Lambda of eq. 9."""


@dataclass(frozen=True, kw_only=True)
class ConfidencePreset(Preset):
    """A ConfNet, on disparities from wherever."""

    network: HeadConfig = field(default_factory=HeadConfig)
    """Options of the network; the number of feature channels is taken from what gives the disparity."""
    correct_within_px: float = 1.0
    """t: a disparity this close to the ground truth is correct. The paper does not give it; KITTI's convention is 3."""


@dataclass(frozen=True, kw_only=True)
class ConfNetPreset(ConfidencePreset):
    """ConfNet on a frozen regressor."""

    enlarged_share: float = 0.5
    """Share of the crops of a batch that the regressor sees enlarged, if it is one that sees pictures enlarged
    (ours)."""


@dataclass(frozen=True, kw_only=True)
class GradientPreset(Preset):
    """A GradNet, on disparities from wherever."""

    network: HeadConfig = field(default_factory=lambda: PUBLISHED_GRADNET)
    """As in `ConfidencePreset`."""
    gradient_threshold_px: float = 1.0
    """Pixels with larger forward differences are discontinuities and left out. The paper gives one digit, most likely
    1."""


@dataclass(frozen=True, kw_only=True)
class GradNetPreset(GradientPreset):
    """GradNet on a frozen regressor."""

    enlarged_share: float = 0.5
    """As in `ConfNetPreset`."""


@dataclass(frozen=True, kw_only=True)
class RegressorFreeConfNetPreset(ConfidencePreset):
    """ConfNet on disparities from anywhere, without a regressor's features (ours)."""

    matcher: SGBMParameters = field(default_factory=SGBMParameters)
    """Options of the matcher, which matches crops and validation frames during the run."""


@dataclass(frozen=True, kw_only=True)
class RegressorFreeGradNetPreset(GradientPreset):
    """GradNet on disparities from anywhere, without a regressor's features (ours)."""

    matcher: SGBMParameters = field(default_factory=SGBMParameters)
    """Options of the matcher, which matches crops and validation frames during the run."""


@dataclass(frozen=True, kw_only=True)
class JointPreset(Preset):
    """ConfNet and GradNet of a run folder, trained further through the refinement (ours).

    Its presets leave the colours as they are. The refinement finds edges in the image in absolute units, and noise
    would put one between any two pixels.
    """

    refined_weight: float = 0.2
    """Weight of the refined disparity's loss. The heads' own losses, cross-entropy and gradient L1, have weight 1; 0
    trains the heads on these alone."""
    refined_gradient_weight: float = 5.0
    """Weight of the refined disparity's gradient error beside its error in pixels."""
    correct_within_px: float = 1.0
    """As in `ConfidencePreset`."""
    gradient_threshold_px: float = 1.0
    """As in `GradientPreset`; also for the refined disparity's gradient."""
    tolerance: float = 1e-4
    """Relative residual at which the linear solves of the forward and the backward pass stop."""
