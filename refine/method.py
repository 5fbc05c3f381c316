"""What an evaluation compares: frames in, disparities (or gradients) out, one class a row of the tables.

`refine.registry` finds the classes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from stereoforge_kit.errors import InputError

INPUTS_IN_WORDS = {
    "confidence": "a confidence",
    "gradient": "predicted gradients",
    "right": "the right view",
    "fine_tuned": "the disparity of a regressor fine-tuned on gradients",
    "objects": "an object map",
}
"""What a reader calls the fields of `EvaluationFrame` that methods may need."""


@dataclass(frozen=True)
class EvaluationFrame:
    """One view with its ground truth and what the networks predicted for it."""

    name: str
    image: NDArray[np.uint8]
    """(H, W, 3)."""
    truth: NDArray[np.float32]
    """(H, W) disparity in pixels, NaN where unknown."""
    occlusion: NDArray[np.uint8]
    """(H, W): 0 visible, 1 occluded in the other view, 2 out of the other frame."""
    disparity: NDArray[np.float32]
    """(H, W) initial disparity, NaN where there is none."""
    confidence: NDArray[np.float32] | None = None
    """(H, W) in [0, 1], probability that the initial disparity is right."""
    gradient: NDArray[np.float32] | None = None
    """(H, W, 2) as [dx, dy], the predicted disparity gradient."""
    right: NDArray[np.uint8] | None = None
    """(H, W, 3), the right view of the pair."""
    fine_tuned: NDArray[np.float32] | None = None
    """(H, W) disparity of a regressor fine-tuned on gradients too (the paper's eq. 9)."""
    objects: NDArray[np.uint16] | None = None
    """(H, W): 0 background, anything else foreground (KITTI's object map)."""
    scene: str = ""
    """Frames of one scene are alike and are resampled together (`refine.evaluation.bootstrap`); the frame's name if
    empty."""
    other_confidences: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)
    """Further confidence measures to compare, by name: (H, W), higher is surer, any scale."""
    seconds: Mapping[str, float] = field(default_factory=dict)
    """How long it took to predict a field, by its name."""

    def __post_init__(self) -> None:
        size = self.truth.shape
        shapes: dict[str, tuple[tuple[int, ...], tuple[int, ...]]] = {
            "image": (self.image.shape, (*size, 3)),
            "occlusion": (self.occlusion.shape, size),
            "disparity": (self.disparity.shape, size),
        }
        if self.confidence is not None:
            shapes["confidence"] = (self.confidence.shape, size)
        if self.gradient is not None:
            shapes["gradient"] = (self.gradient.shape, (*size, 2))
        if self.right is not None:
            shapes["right"] = (self.right.shape, (*size, 3))
        if self.fine_tuned is not None:
            shapes["fine_tuned"] = (self.fine_tuned.shape, size)
        if self.objects is not None:
            shapes["objects"] = (self.objects.shape, size)
        for name, values in self.other_confidences.items():
            shapes[f"confidence {name!r}"] = (values.shape, size)
        for name, (got, expected) in shapes.items():
            if got != expected:
                raise InputError(f"frame {self.name}: {name} has shape {got}, expected {expected}")


@dataclass(frozen=True)
class MethodOutput:
    """What a method makes of a frame: a disparity, a gradient, or both."""

    disparity: NDArray[np.float32] | None = None
    """(H, W) pixels; None for a method that predicts gradients only."""
    gradient: NDArray[np.float32] | None = None
    """(H, W, 2) [dx, dy]; None where the disparity's own forward differences are to be measured."""
    seconds: float = 0.0
    """Time spent beforehand on what is only handed on, to be added to the time that `run` takes."""


@dataclass(frozen=True)
class Method(ABC):
    """One row of the tables; a subclass's fields are the method's parameters."""

    name: ClassVar[str]
    """Short name in files and on the command line (METHOD names of the paper's tables)."""
    label: ClassVar[str]
    """Name for readers of the report."""
    upper_bound: ClassVar[bool] = False
    """Whether it looks at the ground truth: no rival, but the room that is left."""
    needs: ClassVar[frozenset[str]] = frozenset()
    """Optional fields of `EvaluationFrame` the method cannot do without."""
    search: ClassVar[Mapping[str, tuple[float | int | str | None, ...]]] = {}
    """What validation may choose from: for a field (`parameters.alpha` for a field of a record) its values in
    order, the default among them."""
    tied: ClassVar[tuple[tuple[str, str], ...]] = ()
    """Pairs of these that make up for one another, so that one of them alone can hardly be bettered."""
    follows: ClassVar[Mapping[str, str]] = {}
    """Fields that hold another method, by its name: they take that method's validated parameters."""

    @abstractmethod
    def run(self, frame: EvaluationFrame) -> MethodOutput:
        """Process one frame; only an upper bound may look at its ground truth."""

    def deviation(self, frame: EvaluationFrame, samples: int) -> NDArray[np.float32] | None:  # noqa: ARG002
        """How unsure the method is of each of its disparities, (H, W), less is surer; None if it does not know."""
        return None

    def missing(self, frame: EvaluationFrame) -> tuple[str, ...]:
        """Which of the fields it needs this frame does not have."""
        return tuple(sorted(name for name in self.needs if getattr(frame, name) is None))

    def lacks(self, frame: EvaluationFrame) -> str:
        """The same in a reader's words, such as "a confidence and predicted gradients"; empty if it has them all."""
        return " and ".join(INPUTS_IN_WORDS[name] for name in self.missing(frame))


def mrf_inputs(
    method: Method, frame: EvaluationFrame
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], NDArray[np.uint8]]:
    """The disparity (H, W), confidence (H, W), gradient (H, W, 2) and image (H, W, 3) of a frame.

    Raises InputError if the frame lacks one of them.
    """
    if frame.confidence is None or frame.gradient is None:
        raise InputError(
            f"{method.label} needs {method.lacks(frame)}, which frame {frame.name} comes without"
        )
    return frame.disparity, frame.confidence, frame.gradient, frame.image
