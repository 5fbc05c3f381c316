"""A as a stencil: assembled from the weights, and applied without a sparse matrix.

Every plane and every vector is padded (`refine.solvers.stencil.padding`). Coefficients are float32. Each form's A has
A 1 = tau, so it is applied as

    (A x)_p = tau_p x_p + sum_q A_pq (x_q - x_p),

which holds to rounding of the differences, however small tau is beside the coefficients.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from refine.energy.affinity import NEIGHBORS
from refine.energy.system import Form
from refine.solvers.arrays import Float32Array, FloatArray
from refine.solvers.bfloat16 import BFloat16Array, to_float32
from refine.solvers.linear import SolverError
from refine.solvers.stencil.padding import MARGIN, crop, row_bands
from refine.solvers.stencil.weights import BandWeights
from stereoforge_kit.kernels import njit, prange

HALF_STENCIL = ((0, 1), (0, 2), *((dy, dx) for dy in (1, 2) for dx in range(-2, 3)))
"""One of each pair of opposite offsets (rows down, columns right) in the 5x5 window: the planes of the symmetric
25-point stencil."""
_HALF_STENCIL = np.array(HALF_STENCIL)
_NEIGHBORS = np.array(NEIGHBORS)


@dataclass(frozen=True)
class StencilOperator:
    """The matrix A of one form, symmetric with 25 points (exact) or not symmetric with 9 (paper)."""

    tau: Float32Array
    """(H, W) row sums of A, padded."""
    planes: Float32Array
    """Off-diagonal entries, padded. Exact form: (12, H, W), A[p, p + o] for o in `HALF_STENCIL`. The paper's:
    (8, H, W), A[p, p + o] for o in `NEIGHBORS`."""

    @property
    def symmetric(self) -> bool:
        """Whether this is the exact form."""
        return self.planes.shape[0] == len(HALF_STENCIL)

    def apply(self, x: FloatArray, out: FloatArray) -> None:
        """Compute out = A x; both (H, W), padded, in float32 or float64."""
        _apply(self.planes, self.tau, x, out)

    def apply_and_dot(self, x: Float32Array, other: FloatArray, out: Float32Array) -> tuple[float, float]:
        """Compute out = A x in one pass with two dot products in float64.

        Returns:
            <A x, other> and <A x, A x>.
        """
        return _apply_and_dot(self.planes, self.tau, x, other, out)

    def residual(self, b: FloatArray, x: FloatArray, out: FloatArray) -> float:
        """Compute out = b - A x in the precision of `x`.

        Returns:
            The squared norm of the residual.
        """
        return _residual(self.planes, self.tau, b, x, out)

    def jacobi_step(
        self, b: Float32Array, damped_inverse: BFloat16Array, x: Float32Array, out: Float32Array
    ) -> None:
        """One step of damped Jacobi, out = x + omega D^-1 (b - A x), with omega D^-1 given in bfloat16."""
        _jacobi_step(self.planes, self.tau, b, damped_inverse, x, out)

    def inverse_diagonal(self) -> Float32Array:
        """1 / A_pp, (H, W) padded with zeros.

        Raises:
            refine.SolverError: If some A_pp is 0: nothing determines that pixel.
        """
        inverse = np.zeros_like(self.tau)
        invert = _invert_symmetric_diagonal if self.symmetric else _invert_diagonal
        invert(self.planes, self.tau, inverse)
        if not crop(inverse).all():
            height, width = crop(inverse).shape
            raise SolverError(
                f"the MRF of {width}x{height} pixels is singular: "
                "some pixel has neither a disparity nor a tie to its surroundings"
            )
        return inverse


def assemble_operator(tau: Float32Array, weights: BandWeights, form: Form) -> StencilOperator:
    """Assemble A from the weights of the energy.

    Args:
        tau: (H, W) weight of the data term, padded.
        weights: Called once for each band of rows, from top to bottom.
        form: "exact" or "paper".
    """
    exact = form == "exact"
    planes = np.zeros((len(HALF_STENCIL) if exact else len(NEIGHBORS), *tau.shape), np.float32)
    assemble = _assemble_exact if exact else _assemble_paper
    for first, last in row_bands(tau.shape[0] - 2 * MARGIN):
        band = weights(first, last)
        assemble(band.neighbors, band.color, band.gradient, first, planes)
    return StencilOperator(tau, planes)


@njit(parallel=True, fastmath=True)
def _assemble_exact(weights, color, gradient, first, planes):
    """Off-diagonal planes of N + beta L' Phibar L for a band of rows: a sum over the windows, with centres s, that hold
    both p and p + o."""
    height, width = color.shape[0] - 4, color.shape[1] - 4
    for y in prange(height):
        for k in range(12):
            dy, dx = _HALF_STENCIL[k, 0], _HALF_STENCIL[k, 1]
            row = planes[k, first + y + 2]
            for sy in range(max(-1, dy - 1), min(1, dy + 1) + 1):
                for sx in range(max(-1, dx - 1), min(1, dx + 1) + 1):
                    # Seen from s: p lies at -(sy, sx), p + o at (dy - sy, dx - sx).
                    near = _neighbor_number(-sy, -sx)
                    far = _neighbor_number(dy - sy, dx - sx)
                    c = color[y + 2 + sy, 2 + sx :]
                    if near < 0:
                        w = weights[far, y + 2 + sy, 2 + sx :]
                        for x in range(width):
                            row[x + 2] -= c[x] * w[x]
                    elif far < 0:
                        w = weights[near, y + 2 + sy, 2 + sx :]
                        for x in range(width):
                            row[x + 2] -= c[x] * w[x]
                    else:
                        w, v = weights[near, y + 2 + sy, 2 + sx :], weights[far, y + 2 + sy, 2 + sx :]
                        for x in range(width):
                            row[x + 2] += c[x] * w[x] * v[x]
        for x in range(width):
            planes[0, first + y + 2, x + 2] -= gradient[0, y + 2, x + 2]
            planes[4, first + y + 2, x + 2] -= gradient[1, y + 2, x + 2]


@njit()
def _neighbor_number(dy, dx):
    """Number of the offset among `NEIGHBORS`; -1 for the centre."""
    number = (dy + 1) * 3 + dx + 1
    if number == 4:
        return -1
    return number if number < 4 else number - 1


@njit(parallel=True, fastmath=True)
def _assemble_paper(weights, color, gradient, first, planes):
    """Off-diagonal planes of N + beta Phibar L for a band of rows."""
    height, width = color.shape[0] - 4, color.shape[1] - 4
    for y in prange(height):
        for x in range(width):
            for k in range(8):
                planes[k, first + y + 2, x + 2] = -color[y + 2, x + 2] * weights[k, y + 2, x + 2]
            planes[1, first + y + 2, x + 2] -= gradient[1, y + 1, x + 2]
            planes[3, first + y + 2, x + 2] -= gradient[0, y + 2, x + 1]
            planes[4, first + y + 2, x + 2] -= gradient[0, y + 2, x + 2]
            planes[6, first + y + 2, x + 2] -= gradient[1, y + 2, x + 2]


@njit(fastmath={"contract"})
def _apply_row(a, tau, x, y, out):
    """Row y of A x into a padded row.

    One plane at a time: numba takes ten times as long to compile one loop over all planes, which runs no faster,
    because reading the planes from memory is what takes the time.
    """
    here, own = x[y + 2], tau[y + 2]
    for j in range(2, here.size - 2):
        out[j] = own[j] * here[j]
    if a.shape[0] == 12:
        for k in range(12):
            dy, dx = _HALF_STENCIL[k, 0], _HALF_STENCIL[k, 1]
            _add_plane(a[k, y + 2], 0, x[y + 2 + dy], dx, here, out)
            _add_plane(a[k, y + 2 - dy], -dx, x[y + 2 - dy], -dx, here, out)
    else:
        for k in range(8):
            dy, dx = _NEIGHBORS[k, 0], _NEIGHBORS[k, 1]
            _add_plane(a[k, y + 2], 0, x[y + 2 + dy], dx, here, out)


@njit(fastmath={"contract"})
def _add_plane(plane, shift, row, dx, here, out):
    """Add A_pq (x_q - x_p) for the neighbours q at column offset dx in `row`; A_pq is at column offset `shift` in
    `plane`."""
    for j in range(2, here.size - 2):
        out[j] += plane[j + shift] * (row[j + dx] - here[j])


@njit(parallel=True)
def _apply(a, tau, x, out):
    for y in prange(tau.shape[0] - 4):
        _apply_row(a, tau, x, y, out[y + 2])


@njit(parallel=True, fastmath={"contract", "reassoc"})
def _apply_and_dot(a, tau, x, other, out):
    dot = norm = 0.0
    for y in prange(tau.shape[0] - 4):
        row, other_row = out[y + 2], other[y + 2]
        _apply_row(a, tau, x, y, row)
        row_dot = row_norm = 0.0
        for j in range(row.size):
            row_dot += np.float64(row[j]) * np.float64(other_row[j])
            row_norm += np.float64(row[j]) * np.float64(row[j])
        dot += row_dot
        norm += row_norm
    return dot, norm


@njit(parallel=True, fastmath={"contract", "reassoc"})
def _residual(a, tau, b, x, out):
    norm = 0.0
    for y in prange(tau.shape[0] - 4):
        product = np.zeros(tau.shape[1], x.dtype)
        _apply_row(a, tau, x, y, product)
        row, b_row = out[y + 2], b[y + 2]
        row_norm = 0.0
        for j in range(row.size):
            row[j] = b_row[j] - product[j]
            row_norm += np.float64(row[j]) * np.float64(row[j])
        norm += row_norm
    return norm


@njit(parallel=True, fastmath={"contract"})
def _jacobi_step(a, tau, b, damped_inverse, x, out):
    for y in prange(tau.shape[0] - 4):
        row = out[y + 2]
        _apply_row(a, tau, x, y, row)
        x_row, b_row, factor = x[y + 2], b[y + 2], damped_inverse[y + 2]
        for j in range(row.size):
            row[j] = x_row[j] + to_float32(factor[j]) * (b_row[j] - row[j])


@njit(parallel=True)
def _invert_symmetric_diagonal(a, tau, inverse):
    height, width = tau.shape[0] - 4, tau.shape[1] - 4
    for y in prange(height):
        for j in range(width):
            diagonal = tau[y + 2, j + 2]
            for k in range(12):
                diagonal -= (
                    a[k, y + 2, j + 2] + a[k, y + 2 - _HALF_STENCIL[k, 0], j + 2 - _HALF_STENCIL[k, 1]]
                )
            inverse[y + 2, j + 2] = 1 / diagonal if diagonal > 0 else 0


@njit(parallel=True)
def _invert_diagonal(a, tau, inverse):
    height, width = tau.shape[0] - 4, tau.shape[1] - 4
    for y in prange(height):
        for j in range(width):
            diagonal = tau[y + 2, j + 2]
            for k in range(8):
                diagonal -= a[k, y + 2, j + 2]
            inverse[y + 2, j + 2] = 1 / diagonal if diagonal > 0 else 0
