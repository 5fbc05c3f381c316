"""The estimated standard deviations against the exact diagonal of the inverse."""

from __future__ import annotations

import numpy as np
import pytest

from refine import MRFParameters
from refine.mrf.posterior import posterior_deviation
from refine.mrf.solve import checked_problem
from tests.refine.worlds import random_problem


def exact_deviation(problem):
    made = checked_problem(*problem.inputs, MRFParameters(), "exact")
    inverse = np.linalg.inv(made.system().matrix().toarray())
    return np.sqrt(np.diag(inverse) / 2).reshape(made.shape)


@pytest.mark.parametrize("style", ["smooth", "noise", "constant", "mixed"])
def test_estimate_is_as_close_to_the_exact_diagonal_as_its_samples_allow(style):
    problem = random_problem(24, 31, seed=1, style=style)
    estimate, exact = posterior_deviation(*problem.inputs, samples=128), exact_deviation(problem)
    error = estimate / exact - 1
    assert 0.5 / 16 < np.sqrt((error**2).mean()) < 1.5 / 16  # 1 / sqrt(2 * 128)
    assert abs(error.mean()) < 0.03


def test_pixels_without_confidence_are_less_sure():
    problem = random_problem(20, 20, seed=3, style="blocks")
    confidence = np.ones((20, 20))
    sure = posterior_deviation(problem.disparity, confidence, problem.gradient, problem.image)
    confidence[5:15, 5:15] = 0
    unsure = posterior_deviation(problem.disparity, confidence, problem.gradient, problem.image)
    assert unsure[5:15, 5:15].mean() > 1.5 * sure[5:15, 5:15].mean()
    np.testing.assert_allclose(unsure[:2], sure[:2], rtol=0.2)


def test_bad_options_are_named():
    with pytest.raises(ValueError, match="samples"):
        posterior_deviation(*random_problem(4, 4, seed=0).inputs, samples=0)
