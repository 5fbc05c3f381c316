"""The refinement that networks are trained through, by the solver's kernels and by torch's operations, on the CPU.

    python -m benchmarks.differentiable --data DATASET [--weights RUN] [--crops 4] [--repeat 5]

One step is what `train joint` does for a batch of its `small` preset: the hierarchy, the solve, and the solve for the
gradients, with the run's own parameters and its networks' outputs. Both ways in turn; medians.
"""

from __future__ import annotations

import argparse
import statistics
import time
from pathlib import Path
from unittest.mock import patch

import numpy as np
import torch
from torch import Tensor

from datagen.sources.registry import open_source
from refine.energy.parameters import MRFParameters
from refine.mrf.torch.differentiable import ImageWeights, image_weights, refine_batch
from stereoforge.bundled_weights import BUNDLED_WEIGHTS
from stereoforge.pipelines.prediction import open_predictors, open_settings
from training.presets import find_preset

WAYS = {"kernels": True, "torch": False}


def crops(options: argparse.Namespace) -> tuple[Tensor, Tensor, Tensor, ImageWeights, MRFParameters]:
    """Disparities, confidences and gradients of as many frames, cropped as in training, and their weights."""
    preset = find_preset("joint", "small")
    predictors = open_predictors(options.weights)
    ours = open_settings(None, options.weights).ours
    frames = open_source(options.data).frames("test")
    inputs = []
    for i in np.linspace(0, len(frames) - 1, options.crops).astype(int):
        frame = predictors.frame(frames[i])
        assert frame.confidence is not None
        assert frame.gradient is not None
        confidence = ours.shape.apply(frame.confidence)
        arrays = (frame.disparity, confidence, frame.gradient, frame.image)
        inputs.append([array[: preset.crop_height, : preset.crop_width] for array in arrays])
    disparity, confidence, gradient, image = (
        torch.from_numpy(np.stack(each)) for each in zip(*inputs, strict=True)
    )
    weights = image_weights(image.permute(0, 3, 1, 2), ours.parameters.sigma_r)
    return disparity, confidence, gradient.permute(0, 3, 1, 2), weights, ours.parameters


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", required=True)
    parser.add_argument("--weights", type=Path, default=BUNDLED_WEIGHTS)
    parser.add_argument("--crops", type=int, default=4)
    parser.add_argument("--repeat", type=int, default=5)
    options = parser.parse_args()
    disparity, confidence, gradient, weights, parameters = crops(options)
    tolerance = find_preset("joint", "small").tolerance  # type: ignore[attr-defined]
    seconds: dict[str, list[float]] = {way: [] for way in WAYS}
    found: dict[str, Tensor] = {}
    for _ in range(1 + options.repeat):  # the first compiles
        for way, kernels in WAYS.items():
            trust = confidence.clone().requires_grad_()
            with patch("refine.mrf.torch.differentiable._has_kernels", lambda *_, kernels=kernels: kernels):
                began = time.perf_counter()
                refined = refine_batch(disparity, trust, gradient, weights, parameters, tolerance=tolerance)
                refined.sum().backward()  # type: ignore[no-untyped-call]
            seconds[way].append(time.perf_counter() - began)
            found[way] = refined.detach()
    medians = {way: statistics.median(times[1:]) for way, times in seconds.items()}
    apart = float((found["kernels"] - found["torch"]).abs().max())
    print(
        f"{options.crops} crops of {disparity.shape[2]}x{disparity.shape[1]}, forwards and backwards: "
        + ", ".join(f"{way} {median:.2f} s" for way, median in medians.items())
        + f"; ratio {medians['torch'] / medians['kernels']:.1f}, disparities apart by up to {apart:.3f} px"
    )


if __name__ == "__main__":
    main()
