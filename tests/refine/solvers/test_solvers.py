"""The parts of the multigrid solver, each against a dense computation of its own."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import scipy.sparse as sp

from refine import MRFParameters
from refine.solvers.amg.csr import CSRMatrix
from tests.refine.worlds import random_problem

DEFAULTS = MRFParameters()


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 6), (7, 1), (6, 8), (7, 9), (8, 7)])
def test_eliminating_black_pixels_is_the_schur_complement(height, width):
    from refine.solvers.amg.red_black import red_black_reduction
    from refine.solvers.linear import Problem as Checked
    from refine.solvers.stencil.weights import data_weight, stencil_weights

    problem = random_problem(height, width, seed=23)
    checked = Checked(*problem.inputs, DEFAULTS, "exact", problem.disparity)
    system = checked.system()
    color = np.diag(0.5 * system.color_weight) @ (np.eye(height * width) - system.laplacian.toarray())
    dense = system.five_point.toarray() + np.diag((color + color.T).sum(axis=1)) - (color + color.T)
    matrix = with_compensation(dense, width)
    rounded = (matrix.astype(np.float32).view(np.uint32) + np.uint32(0x8000)) & np.uint32(0xFFFF0000)
    matrix = rounded.view(np.float32).astype(np.float64)
    matrix[np.diag_indices(height * width)] = 0
    matrix += np.diag(np.maximum(problem.confidence, DEFAULTS.confidence_floor).ravel() - matrix.sum(axis=1))
    black = np.indices((height, width)).sum(axis=0).ravel() % 2 == 1
    coupled = (matrix[np.ix_(black, black)] < -1e-12).any(axis=1)
    eliminated = np.flatnonzero(black)[~coupled]
    remaining = np.setdiff1d(np.arange(height * width), eliminated)
    between = matrix[np.ix_(remaining, eliminated)]
    inverse = np.linalg.inv(matrix[np.ix_(eliminated, eliminated)])
    expected = matrix[np.ix_(remaining, remaining)] - between @ inverse @ between.T
    tau = data_weight(checked)
    reduction = red_black_reduction(tau, partial(stencil_weights, checked, tau), 0.5)
    couplings, row_sum, _ = reduction.schur_complement()
    found = dense_m_matrix(couplings, row_sum)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("style", ["smooth", "noise", "mixed"])
def test_the_first_level_is_smoothed_alike_as_a_stencil_and_in_sell_format(style):
    from refine.solvers.amg.hierarchy import build_hierarchy
    from refine.solvers.amg.red_black import red_black_reduction, reduced_hierarchy
    from refine.solvers.amg.sell import sell_smoother
    from refine.solvers.linear import Problem as Checked
    from refine.solvers.stencil.weights import data_weight, stencil_weights

    problem = random_problem(45, 62, seed=5, style=style)
    checked = Checked(*problem.inputs, DEFAULTS, "exact", problem.disparity)
    tau = data_weight(checked)
    reduction = red_black_reduction(tau, partial(stencil_weights, checked, tau), 0.5)
    couplings, row_sum, place = reduction.schur_complement()
    smoother, position = sell_smoother(couplings, row_sum)
    right_hand_side = np.random.default_rng(0).normal(size=reduction.tau.size).astype(np.float32)
    arranged = np.empty(row_sum.size, np.float32)
    arranged[position] = right_hand_side[place]
    hierarchy = build_hierarchy(lambda: (couplings, row_sum, position), lambda *_: smoother)
    expected = hierarchy.v_cycle(arranged)[position]
    found = reduced_hierarchy(reduction).v_cycle(right_hand_side)
    # In SELL format couplings are rounded to 8 bits.
    np.testing.assert_allclose(found[place], expected, rtol=0, atol=0.01 * np.abs(expected).max())


@pytest.mark.parametrize("form", ["exact", "paper"])
@pytest.mark.parametrize("style", ["noise", "smooth", "constant"])
@pytest.mark.parametrize("sigma_r", [0.1, 2.55, 300.0])
def test_the_stencils_are_the_sparse_matrix(form, style, sigma_r):
    """Taller than the bands that they are assembled in; a third of the gradients unknown."""
    from refine.solvers.linear import Problem as Checked
    from refine.solvers.stencil.padding import crop, pad
    from refine.solvers.stencil.right_hand_side import assemble_system
    from refine.solvers.stencil.weights import data_weight

    problem = random_problem(133, 19, seed=31, style=style)
    gradient = np.where(np.random.default_rng(2).random((133, 19, 2)) < 0.3, np.nan, problem.gradient)
    inputs = (problem.disparity, problem.confidence, gradient, problem.image)
    start = np.random.default_rng(3).uniform(0, 60, (133, 19))
    checked = Checked(*inputs, MRFParameters(sigma_r=sigma_r), form, start)
    system, sparse = assemble_system(checked, data_weight(checked)), checked.system()
    x = np.random.default_rng(4).uniform(0, 60, (133, 19))
    found = pad(np.zeros_like(x), np.float64)
    system.operator.apply(pad(x, np.float64), found)
    largest = np.abs(sparse.apply(x.ravel())).max()
    np.testing.assert_allclose(crop(found).ravel(), sparse.apply(x.ravel()), rtol=1e-5, atol=1e-6 * largest)
    residual = sparse.right_hand_side - sparse.apply(start.ravel())
    np.testing.assert_allclose(crop(system.residual).ravel(), residual, rtol=1e-5, atol=1e-6 * largest)
    assert system.right_hand_side_norm == pytest.approx(np.linalg.norm(sparse.right_hand_side))
    inverse = crop(system.operator.inverse_diagonal()).ravel()
    np.testing.assert_allclose(inverse, 1 / sparse.diagonal(), rtol=1e-4)


def random_m_matrix(size, reach, seed):
    """Couplings between unknowns no further apart than `reach`, and row sums, of an M-matrix."""
    rng = np.random.default_rng(seed)
    ends = rng.integers(0, size, (3 * size, 2))
    ends[:, 1] = np.clip(ends[:, 0] + rng.integers(-reach, reach + 1, 3 * size), 0, size - 1)
    ends = ends[ends[:, 0] != ends[:, 1]]
    couplings = sp.coo_array((rng.lognormal(0, 3, len(ends)), ends.T), shape=(size, size))
    both = sp.csr_array(couplings + couplings.T)
    indptr, indices = both.indptr.astype(np.int32), both.indices.astype(np.int32)
    return CSRMatrix(indptr, indices, both.data.astype(np.float32)), rng.uniform(0, 1, size).astype(
        np.float32
    )


@pytest.mark.parametrize(("size", "reach"), [(1, 1), (511, 40), (1300, 1300), (90_000, 70_000)])
def test_smoothing_in_sell_format_is_damped_jacobi(size, reach):
    from refine.solvers.amg.sell import sell_smoother

    csr, row_sum = random_m_matrix(size, reach, seed=3)
    smoother, position = sell_smoother(csr, row_sum)
    assert smoother.column.dtype == (np.uint16 if reach < 30_000 else np.uint32)
    couplings = sp.csr_array((csr.data, csr.indices, csr.indptr), shape=(size, size))
    diagonal = row_sum + couplings.sum(axis=1)
    b, x = np.random.default_rng(1).normal(size=(2, size)).astype(np.float32)
    arranged = [np.empty(size, np.float32) for _ in range(4)]
    for vector, values in zip(arranged, (b, x), strict=False):
        vector[position] = values
    smoother.post_smooth(arranged[0], arranged[1], arranged[2])
    expected = 0.3 * x + 0.7 * (b + couplings @ x) / diagonal
    np.testing.assert_allclose(arranged[2][position], expected, rtol=0.02, atol=0.02)
    smoother.pre_smooth(arranged[0], arranged[2], arranged[3])
    np.testing.assert_allclose(arranged[2][position], 0.7 * b / diagonal, rtol=0.02)
    stepped = arranged[2][position]
    residual = b + couplings @ stepped - diagonal * stepped
    np.testing.assert_allclose(arranged[3][position], residual, rtol=0.02, atol=0.02 * np.abs(b).max())


def test_the_sell_smoother_keeps_the_row_sums():
    """The rounding of the couplings is larger than a small row sum, but the smoother's matrix has it all the same."""
    from refine.solvers.amg.sell import sell_smoother

    csr, row_sum = random_m_matrix(1300, 100, seed=4)
    smoother, position = sell_smoother(csr, 1e-4 * row_sum)
    ones, moved = np.ones(1300, np.float32), np.empty(1300, np.float32)
    smoother.post_smooth(np.zeros(1300, np.float32), ones, moved)
    diagonal = 1e-4 * row_sum + sp.csr_array((csr.data, csr.indices, csr.indptr)).sum(axis=1)
    np.testing.assert_allclose(moved[position], 1 - 0.7 * 1e-4 * row_sum / diagonal, rtol=0, atol=1e-4)


@pytest.mark.parametrize(("size", "reach"), [(5000, 50), (20_000, 300), (20_000, 20_000)])
def test_restriction_is_the_transpose_of_interpolation(size, reach):
    from refine.solvers.amg.interpolation import arrange_interpolation

    rng = np.random.default_rng(5)
    length = rng.integers(0, 4, size)
    indptr = np.concatenate([[0], np.cumsum(length)]).astype(np.int32)
    row = np.repeat(np.arange(size), length)
    column = np.clip(row // 3 + rng.integers(-reach, reach + 1, row.size), 0, size // 3).astype(np.int32)
    p = CSRMatrix(indptr, column, rng.uniform(0, 1, row.size).astype(np.float32))
    identity = np.arange(size, dtype=np.int32)
    coarse = rng.permutation(size // 3 + 1).astype(np.int32) if reach == size else identity[: size // 3 + 1]
    interpolation = arrange_interpolation(p, identity, coarse)
    assert interpolation.bounds.size == (9 if reach < size / 10 else 2)
    matrix = sp.csr_array((p.data, coarse[column], indptr), shape=(size, size // 3 + 1))
    values, below = (
        rng.normal(size=size).astype(np.float32),
        rng.normal(size=size // 3 + 1).astype(np.float32),
    )
    out = np.full(size // 3 + 1, np.nan, np.float32)
    interpolation.restrict(values, out)
    np.testing.assert_allclose(out, matrix.T @ values, rtol=1e-4, atol=1e-4)
    raised = values.copy()
    interpolation.prolong(below, raised)
    np.testing.assert_allclose(raised, values + matrix @ below, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("size", [2, 40, 900])
def test_the_next_level_is_the_galerkin_product(size):
    from refine.solvers.amg.cf_splitting import COARSE, DIAGONALLY_DOMINANT, cf_splitting, sort_by_strength
    from refine.solvers.amg.galerkin import galerkin_product
    from refine.solvers.amg.interpolation import direct_interpolation

    csr, row_sum = random_m_matrix(size, 30, seed=6)
    couplings = sp.csr_array((csr.data, csr.indices, csr.indptr), shape=(size, size)).toarray()
    diagonal = (row_sum + couplings.sum(axis=1)).astype(np.float32)
    strong_ends, state = sort_by_strength(*csr.arrays(), diagonal, 0.5, 0.2)
    largest = couplings.max(axis=1)
    for i in range(min(size, 100)):
        neighbors = np.flatnonzero(couplings[i])
        strong = neighbors[couplings[i, neighbors] >= 0.5 * largest[i]]
        depends_on = strong if state[i] != DIAGONALLY_DOMINANT else []
        assert set(csr.indices[strong_ends[0, i] : strong_ends[2, i]]) == set(depends_on)
        strong = neighbors[couplings[i, neighbors] >= 0.5 * largest[neighbors]]
        influences = strong[state[strong] != DIAGONALLY_DOMINANT]
        assert set(csr.indices[csr.indptr[i] : strong_ends[1, i]]) == set(influences)
    bounds = np.array([0, size // 2, size])
    cf_splitting(csr.indptr, csr.indices, strong_ends, state, bounds)
    p_csr, coarse = direct_interpolation(csr, diagonal, row_sum, strong_ends, state)
    assert coarse == (state == COARSE).sum()
    blocks, coarse_row_sum = galerkin_product(
        csr, diagonal, row_sum, p_csr, coarse, np.array([0, coarse // 3, coarse])
    )
    p = sp.csr_array((p_csr.data, p_csr.indices, p_csr.indptr), shape=(size, coarse)).astype(np.float64)
    matrix = sp.csr_array(np.diag(row_sum + couplings.sum(axis=1)) - couplings)
    expected = (p.T @ matrix @ p).toarray()
    found = dense_m_matrix(blocks.concatenated(), coarse_row_sum)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5 * np.abs(couplings).max())


def dense_m_matrix(couplings, row_sum):
    matrix = np.zeros((row_sum.size, row_sum.size))
    matrix[np.repeat(np.arange(row_sum.size), np.diff(couplings.indptr)), couplings.indices] = -couplings.data
    return matrix + np.diag(row_sum - matrix.sum(axis=1))


def with_compensation(matrix, width):
    """The M-matrix without the couplings of two black pixels that a red pixel, three times as strongly coupled to one
    of them, can compensate for; the row sums are kept."""
    couplings, made = np.diag(np.diag(matrix)) - matrix, matrix.copy()
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
        strength, red, partner = max(
            (couplings[b, r], r, one + other - b) for b in (one, other) for r in reds
        )
        if strength < 3 * couplings[one, other]:
            continue
        for sign, p, q in ((1, one, other), (-1, red, partner)):
            weight = sign * couplings[one, other]
            made[[p, q], [q, p]] += weight
            made[[p, q], [p, q]] -= weight
    return made
