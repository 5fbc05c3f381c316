"""A multigrid cycle in torch for a batch of refinements: what preconditions `refine.mrf.torch.differentiable`.

Plain aggregation by pairs (Notay, "An aggregation-based algebraic multigrid method", 2010): each unknown joins the
neighbour it hangs together with most, if that is mutual; a pair is one unknown of the next level. All samples of a
batch are one graph in several pieces, so they are coarsened together, by sorting and scattering alone. As in
`refine.solvers.multigrid` the image is smoothed with A itself, and the levels below are those of an M-matrix with
a part of the colour couplings. Needs torch, which `import refine` does not.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from refine.energy.affinity import NEIGHBORS

COLOR_SCALE = 0.5
"""Share of the colour couplings in the M-matrix; as `refine.solvers.multigrid` has it."""
DAMPING = 0.6
"""Of the Jacobi smoothers."""
COARSEST = 400
"""Up to this many unknowns a level is solved densely."""
_STALLED = 0.9
"""Coarsening ends where a level keeps more than this share of the one above."""
_MATCHINGS = 3
"""Rounds in which unknowns without a partner look for another."""


@dataclass(frozen=True)
class _Graph:
    """A symmetric M-matrix: couplings w_ij = -M_ij of unknowns i < j, and the excess M 1."""

    first: Tensor
    second: Tensor
    coupling: Tensor
    excess: Tensor

    @property
    def size(self) -> int:
        return self.excess.numel()

    def diagonal(self) -> Tensor:
        diagonal = self.excess.index_add(0, self.first, self.coupling)
        return diagonal.index_add_(0, self.second, self.coupling)

    def matrix(self) -> Tensor:
        """M as a sparse matrix by rows."""
        own = torch.arange(self.size, device=self.excess.device)
        rows = torch.cat([self.first, self.second, own])
        columns = torch.cat([self.second, self.first, own])
        values = torch.cat([-self.coupling, -self.coupling, self.diagonal()])
        square = (self.size, self.size)
        listed = torch.sparse_coo_tensor(torch.stack([rows, columns]), values, square, check_invariants=False)
        if not (listed.is_cuda or torch.backends.mkl.is_available()):  # type: ignore[no-untyped-call]
            return listed.coalesce()  # torch multiplies rows with MKL only, on CPUs
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Sparse", UserWarning)  # "in beta state"
            return listed.coalesce().to_sparse_csr()


@dataclass(frozen=True)
class _Level:
    """A level below the image, but for the coarsest."""

    matrix: Tensor
    step: Tensor
    """Damped inverse of the diagonal."""
    parent: Tensor
    """Each unknown's aggregate on the next level."""


class AggregationCycle:
    """An approximate inverse of A, symmetric and the same at every application.

    Args:
        parts: tau (B, H, W), couplings to the right (B, H, W - 1) and downwards (B, H - 1, W), color (B, H, W) and
            neighbour weights (B, 8, H, W), as `refine.mrf.torch.differentiable` has them.
        apply: x -> A x.
        diagonal: (B, H, W), of A.
    """

    def __init__(
        self, parts: tuple[Tensor, ...], apply: Callable[[Tensor], Tensor], diagonal: Tensor
    ) -> None:
        self._apply = apply
        self._step = DAMPING / diagonal
        graph = _image_graph(parts)
        self._parent, graph = _aggregate(graph)
        self._levels: list[_Level] = []
        while graph.size > COARSEST:
            parent, coarser = _aggregate(graph)
            if coarser.size > _STALLED * graph.size:
                break
            self._levels.append(_Level(graph.matrix(), DAMPING / graph.diagonal(), parent))
            graph = coarser
        self._size = graph.size
        if graph.size <= COARSEST:
            self._coarsest = torch.linalg.inv(graph.matrix().to_dense().double()).to(diagonal.dtype)
        else:
            self._coarsest = DAMPING / graph.diagonal()

    def __call__(self, residual: Tensor) -> Tensor:
        """What A maps nearly to the residual (B, H, W)."""
        x = self._step * residual
        remaining = (residual - self._apply(x)).reshape(-1)
        x = x + self._correction(0, self._parent, remaining).view_as(x)
        return x + self._step * (residual - self._apply(x))

    def _correction(self, depth: int, parent: Tensor, residual: Tensor) -> Tensor:
        """The residual summed up over the aggregates, solved for there, and handed back."""
        size = self._levels[depth].step.numel() if depth < len(self._levels) else self._size
        coarse = self._cycle(depth, residual.new_zeros(size).index_add_(0, parent, residual))
        return coarse[parent]

    def _cycle(self, depth: int, b: Tensor) -> Tensor:
        if depth == len(self._levels):
            return self._coarsest @ b if self._coarsest.ndim == 2 else self._coarsest * b
        level = self._levels[depth]
        x = level.step * b
        x = x + self._correction(depth + 1, level.parent, b - level.matrix @ x)
        return x + level.step * (b - level.matrix @ x)


def _image_graph(parts: tuple[Tensor, ...]) -> _Graph:
    """N + c (Phibar W + W' Phibar) as a graph Laplacian, unknowns numbered in reading order, sample by sample."""
    tau, axial_x, axial_y, color, weights = parts
    height, width = tau.shape[1:]
    index = torch.arange(tau.numel(), device=tau.device).view(tau.shape)
    firsts, seconds, couplings = [], [], []
    for k in range(4, 8):  # the later one of each pair of opposite neighbours
        dy, dx = NEIGHBORS[k]
        rows, columns = slice(height - dy), slice(max(0, -dx), width - max(0, dx))
        other_rows, other_columns = slice(dy, height), slice(max(0, dx), width - max(0, -dx))
        coupling = COLOR_SCALE * (color * weights[:, k])[:, rows, columns]
        coupling = coupling + COLOR_SCALE * (color * weights[:, 7 - k])[:, other_rows, other_columns]
        if dy == 0:
            coupling = coupling + axial_x
        elif dx == 0:
            coupling = coupling + axial_y
        firsts.append(index[:, rows, columns].reshape(-1))
        seconds.append(index[:, other_rows, other_columns].reshape(-1))
        couplings.append(coupling.reshape(-1))
    return _Graph(torch.cat(firsts), torch.cat(seconds), torch.cat(couplings), tau.reshape(-1))


def _aggregate(graph: _Graph) -> tuple[Tensor, _Graph]:
    """Each unknown's pair, and the graph of the pairs: sums over both of a pair, what ties them together dropped."""
    own = torch.arange(graph.size, device=graph.excess.device)
    mate = _matching(graph)
    kept, parent = torch.unique(torch.where(mate >= 0, torch.minimum(own, mate), own), return_inverse=True)
    first, second = parent[graph.first], parent[graph.second]
    between = first != second
    low, high = torch.minimum(first, second)[between], torch.maximum(first, second)[between]
    keys, place = torch.unique(low * kept.numel() + high, return_inverse=True)
    coupling = graph.coupling.new_zeros(keys.numel()).index_add_(0, place, graph.coupling[between])
    excess = graph.excess.new_zeros(kept.numel()).index_add_(0, parent, graph.excess)
    return parent, _Graph(keys // kept.numel(), keys % kept.numel(), coupling, excess)


def _matching(graph: _Graph) -> Tensor:
    """Each unknown's partner, -1 for none: those whose strongest couplings are mutual; what is equally strong is
    told apart by a hash, or whole rows of equal couplings would hand on one partner each round."""
    mate = torch.full((graph.size,), -1, device=graph.excess.device)
    for _ in range(_MATCHINGS):
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
