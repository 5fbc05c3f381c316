"""The parts of the multigrid solver, each against a dense computation of its own."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import scipy.sparse as sp

from refine import MRFParameters
from refine.solvers.amg.csr import Rows
from tests.refine.worlds import random_problem

DEFAULTS = MRFParameters()


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 6), (7, 1), (6, 8), (7, 9), (8, 7)])
def test_eliminating_black_pixels_is_the_schur_complement(height, width):
    from refine.solvers.amg.red_black import eliminate_black
    from refine.solvers.linear import Problem as Checked
    from refine.solvers.stencil.operator import couplings_of, data_weight

    problem = random_problem(height, width, seed=23)
    checked = Checked(*problem.inputs, DEFAULTS, "exact", problem.disparity)
    system = checked.system()
    ties = np.diag(0.5 * system.color_weight) @ (np.eye(height * width) - system.laplacian.toarray())
    dense = system.five_point.toarray() + np.diag((ties + ties.T).sum(axis=1)) - (ties + ties.T)
    matrix = with_detours(dense, width)
    rounded = (matrix.astype(np.float32).view(np.uint32) + np.uint32(0x8000)) & np.uint32(0xFFFF0000)
    matrix = rounded.view(np.float32).astype(np.float64)
    matrix[np.diag_indices(height * width)] = 0
    matrix += np.diag(np.maximum(problem.confidence, DEFAULTS.confidence_floor).ravel() - matrix.sum(axis=1))
    black = np.indices((height, width)).sum(axis=0).ravel() % 2 == 1
    coupled = (matrix[np.ix_(black, black)] < -1e-12).any(axis=1)
    gone = np.flatnonzero(black)[~coupled]
    left = np.setdiff1d(np.arange(height * width), gone)
    across = matrix[np.ix_(left, gone)]
    expected = matrix[np.ix_(left, left)] - across @ np.linalg.inv(matrix[np.ix_(gone, gone)]) @ across.T
    tau = data_weight(checked)
    graph, excess, _ = eliminate_black(tau, partial(couplings_of, checked, tau), 0.5).graph()
    found = np.zeros_like(expected)
    found[np.repeat(np.arange(excess.size), np.diff(graph.start)), graph.column] = -graph.value
    found += np.diag(excess - found.sum(axis=1))
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("style", ["smooth", "noise", "mixed"])
def test_the_first_level_is_smoothed_alike_as_an_image_and_by_windows(style):
    from refine.solvers.amg.hierarchy import build_hierarchy
    from refine.solvers.amg.red_black import eliminate_black, grid_hierarchy
    from refine.solvers.amg.sell import by_windows
    from refine.solvers.linear import Problem as Checked
    from refine.solvers.stencil.operator import couplings_of, data_weight

    problem = random_problem(45, 62, seed=5, style=style)
    checked = Checked(*problem.inputs, DEFAULTS, "exact", problem.disparity)
    tau = data_weight(checked)
    elimination = eliminate_black(tau, partial(couplings_of, checked, tau), 0.5)
    graph, excess, place = elimination.graph()
    smoother, position = by_windows(graph, excess)
    right_hand_side = np.random.default_rng(0).normal(size=elimination.tau.size).astype(np.float32)
    arranged = np.empty(excess.size, np.float32)
    arranged[position] = right_hand_side[place]
    hierarchy = build_hierarchy(lambda: (graph, excess, position), lambda *_: smoother)
    expected = hierarchy.correct(arranged)[position]
    found = grid_hierarchy(elimination).correct(right_hand_side)
    # Couplings by windows are rounded to 8 bits.
    np.testing.assert_allclose(found[place], expected, rtol=0, atol=0.01 * np.abs(expected).max())


@pytest.mark.parametrize("form", ["exact", "paper"])
@pytest.mark.parametrize("style", ["noise", "smooth", "constant"])
@pytest.mark.parametrize("sigma_r", [0.1, 2.55, 300.0])
def test_the_stencils_are_the_sparse_matrix(form, style, sigma_r):
    """Taller than the bands of rows they are made by; a third of the gradients unknown."""
    from refine.solvers.linear import Problem as Checked
    from refine.solvers.stencil.operator import crop, data_weight, pad, system_of

    problem = random_problem(133, 19, seed=31, style=style)
    gradient = np.where(np.random.default_rng(2).random((133, 19, 2)) < 0.3, np.nan, problem.gradient)
    inputs = (problem.disparity, problem.confidence, gradient, problem.image)
    start = np.random.default_rng(3).uniform(0, 60, (133, 19))
    checked = Checked(*inputs, MRFParameters(sigma_r=sigma_r), form, start)
    system, sparse = system_of(checked, data_weight(checked)), checked.system()
    x = np.random.default_rng(4).uniform(0, 60, (133, 19))
    found = pad(np.zeros_like(x), np.float64)
    system.operator.apply(pad(x, np.float64), found)
    largest = np.abs(sparse.apply(x.ravel())).max()
    np.testing.assert_allclose(crop(found).ravel(), sparse.apply(x.ravel()), rtol=1e-5, atol=1e-6 * largest)
    left = sparse.right_hand_side - sparse.apply(start.ravel())
    np.testing.assert_allclose(crop(system.residual).ravel(), left, rtol=1e-5, atol=1e-6 * largest)
    assert system.size == pytest.approx(np.linalg.norm(sparse.right_hand_side))
    inverse = crop(system.operator.inverse_diagonal()).ravel()
    np.testing.assert_allclose(inverse, 1 / sparse.diagonal(), rtol=1e-4)


def random_graph(size, reach, seed):
    """Couplings between unknowns no further apart than that, by rows, and an excess."""
    rng = np.random.default_rng(seed)
    ends = rng.integers(0, size, (3 * size, 2))
    ends[:, 1] = np.clip(ends[:, 0] + rng.integers(-reach, reach + 1, 3 * size), 0, size - 1)
    ends = ends[ends[:, 0] != ends[:, 1]]
    couplings = sp.coo_array((rng.lognormal(0, 3, len(ends)), ends.T), shape=(size, size))
    couplings = sp.csr_array(couplings + couplings.T)
    start, column = couplings.indptr.astype(np.int32), couplings.indices.astype(np.int32)
    rows = Rows(start, column, couplings.data.astype(np.float32))
    return rows, rng.uniform(0, 1, size).astype(np.float32)


@pytest.mark.parametrize(("size", "reach"), [(1, 1), (511, 40), (1300, 1300), (90_000, 70_000)])
def test_smoothing_by_windows_is_damped_jacobi_on_the_couplings(size, reach):
    from refine.solvers.amg.sell import by_windows

    rows, excess = random_graph(size, reach, seed=3)
    smoother, position = by_windows(rows, excess)
    assert smoother.column.dtype == (np.uint16 if reach < 30_000 else np.uint32)
    couplings = sp.csr_array((rows.value, rows.column, rows.start), shape=(size, size))
    diagonal = excess + couplings.sum(axis=1)
    b, x = np.random.default_rng(1).normal(size=(2, size)).astype(np.float32)
    arranged = [np.empty(size, np.float32) for _ in range(4)]
    for vector, values in zip(arranged, (b, x), strict=False):
        vector[position] = values
    smoother.again(arranged[0], arranged[1], arranged[2])
    expected = 0.3 * x + 0.7 * (b + couplings @ x) / diagonal
    np.testing.assert_allclose(arranged[2][position], expected, rtol=0.02, atol=0.02)
    smoother.from_zero(arranged[0], arranged[2], arranged[3])
    np.testing.assert_allclose(arranged[2][position], 0.7 * b / diagonal, rtol=0.02)
    stepped = arranged[2][position]
    left = b + couplings @ stepped - diagonal * stepped
    np.testing.assert_allclose(arranged[3][position], left, rtol=0.02, atol=0.02 * np.abs(b).max())


def test_what_is_smoothed_with_by_windows_keeps_the_excess():
    """Rounded couplings would otherwise weigh more than a small excess: M' 1 = excess all the same."""
    from refine.solvers.amg.sell import by_windows

    rows, excess = random_graph(1300, 100, seed=4)
    smoother, position = by_windows(rows, 1e-4 * excess)
    ones, moved = np.ones(1300, np.float32), np.empty(1300, np.float32)
    smoother.again(np.zeros(1300, np.float32), ones, moved)
    diagonal = 1e-4 * excess + sp.csr_array((rows.value, rows.column, rows.start)).sum(axis=1)
    np.testing.assert_allclose(moved[position], 1 - 0.7 * 1e-4 * excess / diagonal, rtol=0, atol=1e-4)


@pytest.mark.parametrize(("size", "reach"), [(5000, 50), (20_000, 300), (20_000, 20_000)])
def test_restriction_is_the_transpose_of_interpolation(size, reach):
    from refine.solvers.amg.interpolation import transfer_of

    rng = np.random.default_rng(5)
    length = rng.integers(0, 4, size)
    start = np.concatenate([[0], np.cumsum(length)]).astype(np.int32)
    row = np.repeat(np.arange(size), length)
    column = np.clip(row // 3 + rng.integers(-reach, reach + 1, row.size), 0, size // 3).astype(np.int32)
    prolong = Rows(start, column, rng.uniform(0, 1, row.size).astype(np.float32))
    identity = np.arange(size, dtype=np.int32)
    coarse = rng.permutation(size // 3 + 1).astype(np.int32) if reach == size else identity[: size // 3 + 1]
    transfer = transfer_of(prolong, identity, coarse)
    assert transfer.bounds.size == (9 if reach < size / 10 else 2)
    matrix = sp.csr_array((prolong.value, coarse[column], start), shape=(size, size // 3 + 1))
    values, below = (
        rng.normal(size=size).astype(np.float32),
        rng.normal(size=size // 3 + 1).astype(np.float32),
    )
    out = np.full(size // 3 + 1, np.nan, np.float32)
    transfer.restrict(values, out)
    np.testing.assert_allclose(out, matrix.T @ values, rtol=1e-4, atol=1e-4)
    raised = values.copy()
    transfer.prolong(below, raised)
    np.testing.assert_allclose(raised, values + matrix @ below, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("size", [2, 40, 900])
def test_the_next_level_is_the_galerkin_product(size):
    from refine.solvers.amg.cf_splitting import COARSE, LOOSE, lead_with_strong, split
    from refine.solvers.amg.galerkin import galerkin_pieces, interpolation, joined

    rows, excess = random_graph(size, 30, seed=6)
    couplings = sp.csr_array((rows.value, rows.column, rows.start), shape=(size, size)).toarray()
    diagonal = (excess + couplings.sum(axis=1)).astype(np.float32)
    ends, state = lead_with_strong(rows.start, rows.column, rows.value, diagonal, 0.5, 0.2)
    largest = couplings.max(axis=1)
    for i in range(min(size, 100)):
        there, own = ends[0, i], ends[1, i]
        tied = np.flatnonzero(couplings[i])
        strong = tied[couplings[i, tied] >= 0.5 * largest[i]] if state[i] != LOOSE else []
        assert set(rows.column[there : ends[2, i]]) == set(strong)
        strong_there = tied[(couplings[i, tied] >= 0.5 * largest[tied]) & (state[tied] != LOOSE)]
        assert set(rows.column[rows.start[i] : own]) == set(strong_there)
    bounds = np.array([0, size // 2, size])
    split(rows.start, rows.column, ends, state, bounds)
    prolong, coarse = interpolation(rows, diagonal, excess, ends, state)
    assert coarse == (state == COARSE).sum()
    parts = np.array([0, coarse // 3, coarse])
    pieces, next_excess = galerkin_pieces(rows, diagonal, excess, prolong, coarse, parts)
    graph = joined(pieces)
    p = sp.csr_array((prolong.value, prolong.column, prolong.start), shape=(size, coarse)).astype(np.float64)
    matrix = sp.csr_array(np.diag(excess + couplings.sum(axis=1)) - couplings)
    expected = (p.T @ matrix @ p).toarray()
    found = np.zeros((coarse, coarse))
    found[np.repeat(np.arange(coarse), np.diff(graph.start)), graph.column] = -graph.value
    found += np.diag(next_excess - found.sum(axis=1))
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5 * np.abs(couplings).max())


def with_detours(matrix, width):
    """The M-matrix after two black pixels' couplings took the way over a pixel beside both that is three times
    as strongly coupled to one of them; sums of rows as they were."""
    ties, made = np.diag(np.diag(matrix)) - matrix, matrix.copy()
    for corner in range(len(matrix) - width - 1):
        y, x = divmod(corner, width)
        if x == width - 1:
            continue
        square = np.array([[corner, corner + 1], [corner + width, corner + width + 1]])
        one, other = square[1, 0], square[0, 1]
        reds = (square[0, 0], square[1, 1])
        if (y + x) % 2 == 1:
            (one, other), reds = reds, (one, other)
        # A red pixel as good as one black pixel is coupled to the other in its stead.
        strength, red, partner = max((ties[b, r], r, one + other - b) for b in (one, other) for r in reds)
        if strength < 3 * ties[one, other]:
            continue
        for sign, p, q in ((1, one, other), (-1, red, partner)):
            weight = sign * ties[one, other]
            made[[p, q], [q, p]] += weight
            made[[p, q], [p, q]] -= weight
    return made
