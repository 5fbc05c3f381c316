"""Small worlds with known answers, shared by the tests of `refine`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from refine.evaluation.evaluate import EvaluationFrame


@dataclass(frozen=True)
class Problem:
    """Inputs of a refinement."""

    disparity: NDArray[np.float64]
    confidence: NDArray[np.float64]
    gradient: NDArray[np.float64]
    image: NDArray[np.uint8]

    @property
    def inputs(
        self,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.uint8]]:
        return self.disparity, self.confidence, self.gradient, self.image


def random_problem(height: int, width: int, seed: int, style: str = "mixed") -> Problem:
    """Random inputs; `style` says what the image is: "noise", "smooth", "constant", "blocks" or "mixed"."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:height, :width]
    pictures = {
        "noise": rng.integers(0, 256, (height, width, 3)),
        "smooth": np.stack([40 + x, 60 + y, 90 + x + y], axis=2) + rng.integers(0, 2, (height, width, 3)),
        "constant": np.full((height, width, 3), 128),
        "blocks": 30 + 60 * ((x // 3 + y // 2) % 3)[..., None] + rng.integers(0, 3, (height, width, 3)),
    }
    blend = np.where((x < width / 2)[..., None], pictures["smooth"], pictures["noise"])
    image = pictures.get(style, blend).astype(np.uint8)
    return Problem(
        disparity=rng.uniform(0, 60, (height, width)),
        confidence=rng.uniform(0, 1, (height, width)),
        gradient=rng.normal(0, 0.5, (height, width, 2)),
        image=image,
    )


def toy_frame(seed: int, height: int = 48, width: int = 80) -> EvaluationFrame:
    """A slanted plane behind a box, the initial disparity fattened around the box and noisy."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:height, :width].astype(np.float64)
    box = (abs(x - width * 0.55) < 12) & (abs(y - height * 0.5) < 10)
    fat = (abs(x - width * 0.55) < 16) & (abs(y - height * 0.5) < 14)
    plane = 6 + 0.03 * x + 0.05 * y
    truth = np.where(box, 24.0, plane)
    initial = np.where(fat, 24.0, plane) + rng.normal(0, 0.4, truth.shape)
    confidence = np.where(np.abs(initial - truth) > 1, 0.05, 0.95) + rng.uniform(-0.05, 0.05, truth.shape)
    gradient = np.where(box[..., None], 0.0, np.array([0.03, 0.05])) + rng.normal(0, 0.01, (*truth.shape, 2))
    image = np.where(box[..., None], [180, 60, 50], [70, 110, 160]) + rng.integers(-1, 2, (*truth.shape, 1))
    occlusion = np.zeros(truth.shape, np.uint8)
    left_edge = int(np.flatnonzero(box.any(axis=0))[0])
    occlusion[box.any(axis=1), left_edge - 10 : left_edge] = 1
    occlusion[:, :5] = 2
    return EvaluationFrame(
        name=f"TEST/A/{seed:04d}/0006",
        image=image.astype(np.uint8),
        truth=truth.astype(np.float32),
        occlusion=occlusion,
        disparity=initial.astype(np.float32),
        confidence=confidence.astype(np.float32),
        gradient=gradient.astype(np.float32),
    )
