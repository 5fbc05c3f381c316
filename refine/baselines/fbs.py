"""The fast bilateral solver: pixels close in position and colour get similar disparities.

J. T. Barron, B. Poole, "The Fast Bilateral Solver", ECCV 2016; the simplified grid of J. T. Barron, A. Adams,
Y. Shih, C. Hernandez, "Fast Bilateral-Space Stereo for Synthetic Defocus", CVPR 2015.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, cg

from refine.method import EvaluationFrame, Method, MethodOutput
from stereoforge_kit.errors import InputError
from stereoforge_kit.matching import fill_nearest

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class FBS(Method):
    """argmin lambda/2 sum_pq W_pq (x_p - x_q)^2 + sum_p c_p (x_p - d_p)^2, W the bistochastic bilateral affinity.

    Solved over the vertices of a bilateral grid, as published; the defaults are the published demo's. What differs:
    disparities are not scaled to 0..1 first (the problem is linear), confidences have a floor, so that no vertex is
    without any, and the iteration goes on until it has converged (the demo stops it after 25 steps). OpenCV's
    `fastBilateralSolverFilter` needs a build with Eigen, which its wheels are not.
    """

    name: ClassVar[str] = "fbs"
    label: ClassVar[str] = "Fast bilateral solver"
    needs: ClassVar[frozenset[str]] = frozenset({"confidence"})
    search: ClassVar = {
        "smoothness": (2.0, 8.0, 32.0, 128.0, 512.0),
        "sigma_spatial_px": (2.0, 4.0, 8.0, 16.0, 32.0),
        "sigma_luma": (2.0, 4.0, 8.0, 16.0, 32.0, 64.0),
        "sigma_chroma": (2.0, 4.0, 8.0, 16.0, 32.0, 64.0),
        "confidence_floor": (1e-5, 1e-4, 1e-3, 3e-3, 1e-2),
    }

    sigma_spatial_px: float = 8.0
    """Side of the grid's cells in the image."""
    sigma_luma: float = 4.0
    """Side of the grid's cells in brightness, 8-bit units of Y in Y'CbCr."""
    sigma_chroma: float = 4.0
    """Side of the grid's cells in colour, 8-bit units of Cb and Cr."""
    smoothness: float = 128.0
    """Lambda."""
    confidence_floor: float = 1e-3
    """Confidences are raised to at least this (ours)."""
    tolerance: float = 1e-5
    """Relative residual at which the iteration stops."""
    max_iterations: int = 1000

    def __post_init__(self) -> None:
        for name in ("sigma_spatial_px", "sigma_luma", "sigma_chroma", "smoothness", "confidence_floor"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise InputError(f"the bilateral solver's {name} must be positive, got {value}")

    def run(self, frame: EvaluationFrame) -> MethodOutput:
        """Filter the frame's initial disparity, weighted by its confidence."""
        assert frame.confidence is not None
        unknown = np.isnan(frame.disparity)
        trust = np.where(unknown, 0, frame.confidence).astype(np.float64)
        solved = self.solve(
            fill_nearest(frame.disparity), np.maximum(trust, self.confidence_floor), frame.image
        )
        return MethodOutput(solved.astype(np.float32))

    def solve(self, target: NDArray[np.float32], weight: Floats, image: NDArray[np.uint8]) -> Floats:
        """The minimiser for a (H, W) target with weights > 0 and its (H, W, 3) image."""
        splat, blur = bilateral_grid(image, (self.sigma_spatial_px, self.sigma_luma, self.sigma_chroma))
        scale, mass = bistochastic(splat, blur)
        data = splat @ weight.ravel()
        right_hand_side = splat @ (weight * target).ravel()
        blur_scaled = sp.diags_array(scale) @ blur @ sp.diags_array(scale)
        matrix = sp.csr_array(self.smoothness * (sp.diags_array(mass) - blur_scaled) + sp.diags_array(data))
        inverse_diagonal = 1 / matrix.diagonal()
        size = data.size
        solution, _ = cg(
            matrix,
            right_hand_side,
            x0=right_hand_side / data,
            rtol=self.tolerance,
            maxiter=self.max_iterations,
            M=LinearOperator((size, size), matvec=lambda r: inverse_diagonal * r, dtype=np.float64),
        )
        sliced: Floats = (splat.T @ solution).reshape(target.shape)
        return sliced


def bilateral_grid(
    image: NDArray[np.uint8], sigmas: tuple[float, float, float]
) -> tuple[sp.csr_array, sp.csr_array]:
    """The simplified bilateral grid: which vertex each pixel falls into, and each vertex's neighbours.

    A vertex is a cell of (x, y, Y, Cb, Cr) that holds a pixel, of the sides `sigmas` in place, brightness, colour.

    Returns:
        splat: (V, H W), 1 where the pixel is in the vertex's cell.
        blur: (V, V), [1 2 1] along each of the five dimensions, summed: 10 on the diagonal, 1 for each neighbour.
    """
    cells = _cells(image, sigmas)
    # One number a cell, with a margin at both ends of each dimension so that neighbours never wrap around.
    extent = cells.max(axis=0) + 3
    steps = np.concatenate([[1], np.cumprod(extent[:-1])])
    numbers, vertex_of_pixel = np.unique((cells + 1) @ steps, return_inverse=True)
    vertices, pixels = numbers.size, vertex_of_pixel.size
    splat = sp.csr_array((np.ones(pixels), (vertex_of_pixel, np.arange(pixels))), shape=(vertices, pixels))
    blur = 2.0 * len(steps) * sp.eye_array(vertices)
    for step in steps:
        place = np.minimum(np.searchsorted(numbers, numbers + step), vertices - 1)
        here = np.flatnonzero(numbers[place] == numbers + step)
        following = sp.coo_array((np.ones(here.size), (here, place[here])), shape=(vertices, vertices))
        blur = blur + following + following.T
    return splat, sp.csr_array(blur)


def bistochastic(splat: sp.csr_array, blur: sp.csr_array, iterations: int = 10) -> tuple[Floats, Floats]:
    """Scales n and masses m of the vertices that make n * blur(n) equal m: every pixel's affinities sum to 1.

    The published fixed point; m starts as the number of pixels of a vertex and is set to n * blur(n) at the end,
    so that the smoothness term leaves a constant alone exactly.
    """
    mass = splat.sum(axis=1)
    scale = np.ones_like(mass)
    for _ in range(iterations):
        scale = np.sqrt(scale * mass / (blur @ scale))
    return scale, scale * (blur @ scale)


def _cells(image: NDArray[np.uint8], sigmas: tuple[float, float, float]) -> NDArray[np.int64]:
    """(H W, 5) whole cell coordinates of each pixel; colours in JPEG's full-range Y'CbCr (ITU-R BT.601).

    Colours are whole millionths: greys lie on a border between cells, where rounding would decide.
    """
    spatial, luma, chroma = sigmas
    height, width = image.shape[:2]
    red, green, blue = (image[..., c].astype(np.int64) for c in range(3))
    y, x = np.mgrid[:height, :width]
    coordinates = (
        x / spatial,
        y / spatial,
        (299_000 * red + 587_000 * green + 114_000 * blue) / (1e6 * luma),
        (128_000_000 - 168_736 * red - 331_264 * green + 500_000 * blue) / (1e6 * chroma),
        (128_000_000 + 500_000 * red - 418_688 * green - 81_312 * blue) / (1e6 * chroma),
    )
    return np.stack([np.floor(values).astype(np.int64).ravel() for values in coordinates], axis=1)
