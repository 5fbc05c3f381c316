"""Our multigrid against the readable reference."""

from __future__ import annotations

import numpy as np
import pytest

from refine import MRFParameters, solve_mrf
from refine.energy.system import build_system
from tests.refine.ruge_stueben import m_matrix, solve_ruge_stueben
from tests.refine.worlds import random_problem, toy_frame

DEFAULTS = MRFParameters()


@pytest.mark.parametrize("form", ["exact", "paper"])
@pytest.mark.parametrize("style", ["mixed", "noise", "blocks", "toy"])
def test_multigrid_and_pyamg_reach_the_same_solution(form, style):
    if style == "toy":
        frame = toy_frame(1, 72, 96)
        inputs = (frame.disparity, frame.confidence, frame.gradient, frame.image)
    else:
        inputs = random_problem(72, 96, seed=5, style=style).inputs
    expected, failed = solve_ruge_stueben(build_system(*inputs, DEFAULTS, form), inputs[0], tolerance=1e-9)
    found = solve_mrf(*inputs, form=form, solver="multigrid", tolerance=1e-9)
    assert not failed
    assert not found.info.fell_back
    np.testing.assert_allclose(found.disparity, expected, rtol=0, atol=1e-3)


def test_the_references_matrix_is_an_m_matrix_with_the_data_weight_as_row_sums():
    problem = random_problem(9, 11, seed=2)
    matrix = m_matrix(build_system(*problem.inputs, DEFAULTS, "exact")).toarray()
    np.testing.assert_allclose(matrix, matrix.T)
    assert (matrix - np.diag(np.diag(matrix)) <= 0).all()
    tau = np.maximum(problem.confidence, DEFAULTS.confidence_floor)
    np.testing.assert_allclose(matrix.sum(axis=1), tau.ravel(), atol=1e-9)
