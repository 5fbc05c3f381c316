"""Aggregation-based multigrid in torch for a batch of refinements: preconditions `refine.mrf.torch.differentiable`.

Plain pairwise aggregation (Y. Notay, "An aggregation-based algebraic multigrid method", ETNA 37, 2010): each unknown
is paired with the neighbour it is most strongly coupled to, if that is mutual; a pair is one unknown of the next level.
The samples of a batch are one graph that is not connected, so they are coarsened together, by sorting and scattering
alone. As in `refine.solvers.multigrid`, the image is smoothed with A itself, and the levels below are those of an
M-matrix with a part of the colour term's couplings. Needs torch, which `import refine` does not.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from refine.energy.affinity import NEIGHBORS

COLOR_SCALE = 0.5
"""Share of the colour term's couplings in the M-matrix, as in `refine.solvers.multigrid`."""
DAMPING = 0.6
"""omega of the Jacobi smoothers."""
MAX_COARSE = 400
"""Up to this many unknowns a level is solved densely."""
_STALLED = 0.9
"""Coarsening ends where a level keeps more than this share of the one above."""
_MATCHING_ROUNDS = 3
"""Rounds of matching; from the second on among the unknowns that have no partner yet."""


@dataclass(frozen=True)
class _Graph:
    """A symmetric M-matrix: couplings w_ij = -M_ij of unknowns i < j, and row sums M 1."""

    first: Tensor
    second: Tensor
    coupling: Tensor
    row_sum: Tensor

    @property
    def size(self) -> int:
        return self.row_sum.numel()

    def diagonal(self) -> Tensor:
        diagonal = self.row_sum.index_add(0, self.first, self.coupling)
        return diagonal.index_add_(0, self.second, self.coupling)

    def matrix(self) -> Tensor:
        """M in CSR, where torch can multiply that."""
        own = torch.arange(self.size, device=self.row_sum.device)
        rows = torch.cat([self.first, self.second, own])
        columns = torch.cat([self.second, self.first, own])
        values = torch.cat([-self.coupling, -self.coupling, self.diagonal()])
        square = (self.size, self.size)
        listed = torch.sparse_coo_tensor(torch.stack([rows, columns]), values, square, check_invariants=False)
        if not (listed.is_cuda or torch.backends.mkl.is_available()):  # type: ignore[no-untyped-call]
            return listed.coalesce()  # on CPUs torch multiplies CSR with MKL only
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Sparse", UserWarning)  # "in beta state"
            return listed.coalesce().to_sparse_csr()


@dataclass(frozen=True)
class _Level:
    """A level below the image, but for the coarsest."""

    matrix: Tensor
    """(n, n) M, sparse."""
    damped_inverse: Tensor
    """(n) omega / diagonal."""
    aggregate: Tensor
    """(n) each unknown's aggregate on the next level: P as a list of columns."""


class AggregationCycle:
    """A symmetric V-cycle: an approximate inverse of A, the same linear map at every application.

    Args:
        parts: Weights of the energy's terms, as in `refine.mrf.torch.differentiable`: tau (B, H, W), the gradient
            term's to the right (B, H, W - 1) and downwards (B, H - 1, W), the colour term's (B, H, W) and w_pq
            (B, 8, H, W).
        apply: x -> A x, both (B, H, W).
        diagonal: (B, H, W), of A.
    """

    def __init__(
        self, parts: tuple[Tensor, ...], apply: Callable[[Tensor], Tensor], diagonal: Tensor
    ) -> None:
        self._apply = apply
        self._damped_inverse = DAMPING / diagonal
        graph = _image_graph(parts)
        self._aggregate, graph = _coarsen(graph)
        self._levels: list[_Level] = []
        while graph.size > MAX_COARSE:
            aggregate, coarser = _coarsen(graph)
            if coarser.size > _STALLED * graph.size:
                break
            self._levels.append(_Level(graph.matrix(), DAMPING / graph.diagonal(), aggregate))
            graph = coarser
        self._coarsest_size = graph.size
        if graph.size <= MAX_COARSE:
            self._coarsest_inverse = torch.linalg.inv(graph.matrix().to_dense().double()).to(diagonal.dtype)
        else:
            self._coarsest_inverse = DAMPING / graph.diagonal()

    def __call__(self, residual: Tensor) -> Tensor:
        """An approximate solution of A x = residual; both (B, H, W)."""
        x = self._damped_inverse * residual  # pre-smoothing
        smoothed = (residual - self._apply(x)).reshape(-1)
        x = x + self._coarse_correction(0, self._aggregate, smoothed).view_as(x)
        return x + self._damped_inverse * (residual - self._apply(x))  # post-smoothing

    def _coarse_correction(self, depth: int, aggregate: Tensor, residual: Tensor) -> Tensor:
        """P M_coarse^-1 P' residual, approximately; P is piecewise constant on the aggregates."""
        coarsest = depth == len(self._levels)
        size = self._coarsest_size if coarsest else self._levels[depth].damped_inverse.numel()
        restricted = residual.new_zeros(size).index_add_(0, aggregate, residual)
        return self._v_cycle(depth, restricted)[aggregate]

    def _v_cycle(self, depth: int, b: Tensor) -> Tensor:
        if depth == len(self._levels):
            inverse = self._coarsest_inverse
            return inverse @ b if inverse.ndim == 2 else inverse * b
        level = self._levels[depth]
        x = level.damped_inverse * b
        x = x + self._coarse_correction(depth + 1, level.aggregate, b - level.matrix @ x)
        return x + level.damped_inverse * (b - level.matrix @ x)


def _image_graph(parts: tuple[Tensor, ...]) -> _Graph:
    """The M-matrix N + c (graph Laplacian of Phibar W + W' Phibar); unknowns in reading order, sample by sample."""
    tau, gradient_x, gradient_y, color, neighbors = parts
    height, width = tau.shape[1:]
    index = torch.arange(tau.numel(), device=tau.device).view(tau.shape)
    firsts, seconds, couplings = [], [], []
    for k in range(4, 8):  # the later one of each pair of opposite neighbours
        dy, dx = NEIGHBORS[k]
        rows, columns = slice(height - dy), slice(max(0, -dx), width - max(0, dx))
        other_rows, other_columns = slice(dy, height), slice(max(0, dx), width - max(0, -dx))
        coupling = COLOR_SCALE * (color * neighbors[:, k])[:, rows, columns]
        coupling = coupling + COLOR_SCALE * (color * neighbors[:, 7 - k])[:, other_rows, other_columns]
        if dy == 0:
            coupling = coupling + gradient_x
        elif dx == 0:
            coupling = coupling + gradient_y
        firsts.append(index[:, rows, columns].reshape(-1))
        seconds.append(index[:, other_rows, other_columns].reshape(-1))
        couplings.append(coupling.reshape(-1))
    return _Graph(torch.cat(firsts), torch.cat(seconds), torch.cat(couplings), tau.reshape(-1))


def _coarsen(graph: _Graph) -> tuple[Tensor, _Graph]:
    """Each unknown's aggregate, and the Galerkin product P' M P: couplings and row sums added up over the pairs."""
    own = torch.arange(graph.size, device=graph.row_sum.device)
    mate = _matching(graph)
    kept, aggregate = torch.unique(torch.where(mate >= 0, torch.minimum(own, mate), own), return_inverse=True)
    first, second = aggregate[graph.first], aggregate[graph.second]
    between = first != second
    low, high = torch.minimum(first, second)[between], torch.maximum(first, second)[between]
    keys, place = torch.unique(low * kept.numel() + high, return_inverse=True)
    coupling = graph.coupling.new_zeros(keys.numel()).index_add_(0, place, graph.coupling[between])
    row_sum = graph.row_sum.new_zeros(kept.numel()).index_add_(0, aggregate, graph.row_sum)
    return aggregate, _Graph(keys // kept.numel(), keys % kept.numel(), coupling, row_sum)


def _matching(graph: _Graph) -> Tensor:
    """Each unknown's partner, -1 for none: pairs whose strongest couplings are mutual.

    Ties are broken by a hash; in reading order, a long row of equal couplings would form one pair a round.
    """
    mate = torch.full((graph.size,), -1, device=graph.row_sum.device)
    for _ in range(_MATCHING_ROUNDS):
        free = (mate[graph.first] < 0) & (mate[graph.second] < 0) & (graph.coupling > 0)
        first, second, coupling = graph.first[free], graph.second[free], graph.coupling[free]
        if not first.numel():
            break
        edge = torch.arange(first.numel(), device=first.device)
        mixed = (edge * 2654435761 % (1 << 31) << 31) + edge
        strongest = coupling.new_zeros(graph.size)
        chosen = torch.full_like(mate, torch.iinfo(torch.int64).max)
        for end in (first, second):
            strongest.scatter_reduce_(0, end, coupling, "amax")
        for end in (first, second):
            best = coupling >= strongest[end]
            chosen.scatter_reduce_(0, end[best], mixed[best], "amin")
        mutual = (chosen[first] == mixed) & (chosen[second] == mixed)
        mate[first[mutual]] = second[mutual]
        mate[second[mutual]] = first[mutual]
    return mate
